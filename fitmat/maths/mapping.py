"""Mapping: a function of every item of an array inside a compiled program, as suits the machine.

Knows nothing of what is mapped.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike


def mapped(function: Callable[[Any], Any], items: Any, count: ArrayLike | None = None) -> Any:
    """`function` of the first `count` rows of one or several arrays: one after the other on a CPU, else all at once.

    On a few cores the loop compiles in half the time and runs twice as fast, because each pass stays in the cache.
    What stands behind the first ones is of no meaning.
    """
    if jax.default_backend() != "cpu":
        return jax.vmap(function)(items)
    if count is None:
        return jax.lax.map(function, items)
    length = len(jax.tree.leaves(items)[0])
    shapes = jax.eval_shape(lambda every: function(jax.tree.map(lambda part: part[0], every)), items)
    empty = jax.tree.map(lambda part: jnp.zeros((length, *part.shape), part.dtype), shapes)

    def step(k: Array, found: Any) -> Any:
        item = jax.tree.map(lambda part: part[k], items)
        return jax.tree.map(lambda whole, part: whole.at[k].set(part), found, function(item))

    return jax.lax.fori_loop(0, count, step, empty)
