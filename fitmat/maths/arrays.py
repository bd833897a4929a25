"""Arrays: which of the two libraries computes, so that one formula serves compiled programs and plain numbers.

It holds no formula.
"""

import sys
from typing import Any

import numpy as np


def library(*values: Any) -> Any:
    """`jax.numpy` where a value is a JAX array, else NumPy; where JAX was not loaded, no value is one."""
    kind = getattr(sys.modules.get("jax"), "Array", ())
    if any(isinstance(value, kind) for value in values):
        import jax.numpy as jnp

        return jnp
    return np
