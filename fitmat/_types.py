"""Types that recur, named once; of arrays: n samples, c channels, p parameters, w walkers.

Nothing here computes.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from jaxtyping import Float

if TYPE_CHECKING:
    from jaxtyping import Array
else:
    Array = Any  # it would load JAX, which reading a file does not need

Scalar = Float[Array, ""]
"""One real number."""

Vec3 = Float[Array, "3"]
"""A unit vector in the local frame of the surface, normal = +z."""

Directions = Float[Array, "n 3"]
"""n unit vectors."""

Spectrum = Float[Array, " c"]
"""One value per channel."""

Samples = Float[Array, "n c"]
"""One value per sample and channel."""

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much of it is done, and how much is expected (0 while nobody knows)."""

SAMPLING = "sampling"
"""How what is being done begins where an interrupt keeps what was done."""
