"""Arrays: which of the two libraries computes, so that one formula serves compiled programs and plain numbers.

It holds no formula.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np


def library(*values: Any) -> Any:
    """`jax.numpy` where a value is a JAX array, else NumPy."""
    return jnp if any(isinstance(value, jax.Array) for value in values) else np
