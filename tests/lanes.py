"""Many evaluations of a model side by side, operation by operation or by a program; it tests nothing.

Blocks of one fixed length let all models and tests share JAX's kernels, where a program for each model takes seconds to
compile. That both give the same numbers is tested by `models/test_laws.py`.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from fitmat.maths.programs import UNFUSED

LANES = 2048
"""Rows of a block; the last one is filled up."""


def mapped(function: Callable[..., Any], rows: Sequence[np.ndarray], pairs: Sequence[np.ndarray]) -> Any:
    """`function(*row, *pair)` of every row with every pair, without a program for it.

    Args:
        function: Returns an array, or a tuple of them.
        rows: Columns of m rows; none for a function of pairs only, m = 1.
        pairs: Columns of n rows.

    Returns:
        What it returns, each array (m, n, …).
    """
    m, n = len(rows[0]) if rows else 1, len(pairs[0])
    row, pair = (place.ravel() for place in np.indices((m, n)))
    blocks = []
    for first in range(0, m * n, LANES):
        within = np.minimum(np.arange(first, first + LANES), m * n - 1)
        columns = [*(column[row[within]] for column in rows), *(column[pair[within]] for column in pairs)]
        blocks.append(jax.tree.map(np.asarray, jax.vmap(function)(*map(jnp.asarray, columns))))
    return jax.tree.map(lambda *parts: np.concatenate(parts)[: m * n].reshape(m, n, *parts[0].shape[1:]), *blocks)


def programmed(function: Callable[..., Any], rows: Sequence[np.ndarray], pairs: Sequence[np.ndarray]) -> Any:
    """What `mapped` returns, by a program for all pairs of a row: for models that solve much once for all of them."""

    def over(row: Sequence[jax.Array], pair: Sequence[jax.Array]) -> Any:
        return jax.vmap(lambda *one: function(*row, *one))(*pair)

    run = jax.jit(over, compiler_options=UNFUSED)
    found = [run([jnp.asarray(part) for part in row], list(pairs)) for row in [*zip(*rows, strict=True)] or [()]]
    return jax.tree.map(lambda *parts: np.stack(parts), *found)
