"""A dielectric layer as the light within it sees it: what its face lets out, sends back, and what it absorbs.

It knows no base.
"""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import COS_MIN
from fitmat.maths.quadrature import gauss

Energy = Float[Array, "*n c"]
"""One fraction for every cosine and channel."""

_TINY = 1e-16


class Layer(eqx.Module):
    """A layer of one index.

    Attributes:
        eta: Index of refraction, over that outside.
        depth: Absorption coefficient times thickness, one or one per channel.
        reflectance: Outer cosines → fraction that the face reflects from there; the rest enters.
    """

    eta: Scalar
    depth: Spectrum
    reflectance: Callable[[Array], Array]

    def inner(self, outer: Array) -> Array:
        """Cosine inside from that outside: √(η² − 1 + c²)/η."""
        square = (self.eta - 1.0) * (self.eta + 1.0) + outer**2  # without the cancellation of 1 − sin² θ/η²
        return jnp.sqrt(jnp.maximum(square, COS_MIN**2)) / self.eta

    def outer(self, sin2: Array) -> Array:
        """Cosine outside from the squared sine inside; 0 beyond the critical angle."""
        square = 1.0 - self.eta**2 * sin2
        leaves = square > 0.0
        return jnp.where(leaves, jnp.sqrt(jnp.where(leaves, square, 1.0)), 0.0)

    def critical(self) -> Scalar:
        """Cosine of the critical angle inside, √(1 − 1/η²)."""
        return jnp.sqrt(jnp.maximum((self.eta - 1.0) * (self.eta + 1.0), _TINY)) / self.eta

    def left(self, inner: Array) -> Energy:
        """exp(−τ/c), what one passage at inner cosines leaves."""
        return jnp.exp(-jnp.atleast_1d(self.depth) / jnp.maximum(inner, COS_MIN)[..., None])

    def crossing(self, outer: Array, inner: Array) -> tuple[Energy, Energy]:
        """What leaves of light that goes up from the base, (1 − R₁) exp(−τ/c), and what returns, R₁ exp(−2τ/c)."""
        leaves = outer > 0.0
        reflected = jnp.where(leaves, self.reflectance(jnp.where(leaves, outer, 1.0)), 1.0)[..., None]
        left = self.left(inner)
        return (1.0 - reflected) * left, reflected * left**2

    def refracted(self, w: Vec3) -> Vec3:
        """The direction inside of one outside, still pointing up: sin θ′ = sin θ/η."""
        return jnp.stack([w[0] / self.eta, w[1] / self.eta, self.inner(jnp.clip(w[2], 0.0, 1.0))])

    def returned(self) -> Spectrum:
        """2∫ R₁ exp(−2τ/c′) c′ dc′: the fraction of evenly spread light from below that comes back to the base.

        Total reflection below the critical cosine is one part; the other is integrated over the outer cosine c, with
        c′ dc′ = c dc/η².
        """
        x, weights = gauss(16)
        cos, share = jnp.asarray((x + 1.0) / 2.0), jnp.asarray(weights * (x + 1.0) / 2.0)
        critical = self.critical()
        total = critical**2 * (share @ self.left(critical * cos) ** 2)
        back = (share / self.eta**2) @ self.crossing(cos, self.inner(cos))[1]
        return total + back
