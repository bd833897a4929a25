"""Many evaluations of a model side by side, operation by operation; it tests nothing.

Blocks of one fixed length let all models and tests share JAX's kernels, where a program for each model takes seconds to
compile. That both give the same numbers is tested by `models/test_laws.py`.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

LANES = 2048
"""Rows of a block; the last one is filled up."""


def mapped(
    function: Callable[..., Any], rows: Sequence[np.ndarray], pairs: Sequence[np.ndarray], block: int = LANES
) -> Any:
    """`function(*row, *pair)` of every row with every pair, without a program for it.

    Args:
        function: Returns an array, or a tuple of them.
        rows: Columns of m rows; none for a function of pairs only, m = 1.
        pairs: Columns of n rows.
        block: Rows that go together; fewer for a model that takes much memory for each.

    Returns:
        What it returns, each array (m, n, …).
    """
    m, n = len(rows[0]) if rows else 1, len(pairs[0])
    row, pair = (place.ravel() for place in np.indices((m, n)))
    blocks = []
    for first in range(0, m * n, block):
        within = np.minimum(np.arange(first, first + block), m * n - 1)
        columns = [*(column[row[within]] for column in rows), *(column[pair[within]] for column in pairs)]
        blocks.append(jax.tree.map(np.asarray, jax.vmap(function)(*map(jnp.asarray, columns))))
    return jax.tree.map(lambda *parts: np.concatenate(parts)[: m * n].reshape(m, n, *parts[0].shape[1:]), *blocks)
