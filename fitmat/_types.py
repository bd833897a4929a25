"""Array shapes that recur, named once: n samples, c channels, p parameters, w walkers.

Nothing here computes.
"""

from jaxtyping import Array, Float

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
