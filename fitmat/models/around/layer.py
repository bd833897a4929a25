"""A dielectric layer as the light within it sees it: what its face lets in and out, sends back, and what it absorbs.

It knows no base.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import COS_MIN
from fitmat.maths.quadrature import gauss
from fitmat.models.around.nodes import TO_LEAVING, cosines, critical, inside, series, shares
from fitmat.models.around.passage import Passage, smooth_passage

Energy = Float[Array, "*n c"]
"""One fraction for every cosine and channel."""

_TINY = 1e-16


class Ways(NamedTuple):
    """What becomes of the light between the nodes, absorption counted, a channel in the last axis.

    Attributes:
        entered: Of what reaches the base from the outer nodes: shares of the inner ones, (k, n, c); their sum is 1.
        leaves: Of what goes up from the base at the inner nodes: the fraction that leaves, (n, c).
        back: The same: fractions that come back to the base, (n, n, c).
    """

    entered: Array
    leaves: Array
    back: Array


class Layer(eqx.Module):
    """A layer of one index.

    Attributes:
        eta: Index of refraction, over that outside.
        depth: Absorption coefficient times thickness, one or one per channel.
        reflectance: Outer cosines → fraction that the face reflects from there; the rest enters.
        passage: Where it goes, and what the face sends back.
        slope: Alpha of the face, 0 of a smooth one.
        absorbed: Of a rough face the fraction of what enters that is absorbed on its way to the base, of a
            `nodes.series`, (k, c); None of a smooth one, under which that way has one direction.
    """

    eta: Scalar
    depth: Spectrum
    reflectance: Callable[[Array], Array]
    passage: Passage
    slope: Scalar
    absorbed: Float[Array, "k c"] | None

    def left(self, inner: Array) -> Energy:
        """exp(−τ/c), what one passage at inner cosines leaves."""
        return jnp.exp(-jnp.atleast_1d(self.depth) / jnp.maximum(inner, COS_MIN)[..., None])

    def entering(self, outer: Array) -> Energy:
        """The fraction of light from outer cosines that reaches the base, (1 − R₁) exp(−τ/c′) under a smooth face.

        By reciprocity also what leaves in that direction, over what light as bright everywhere at the base would.
        """
        if self.absorbed is None:
            left = self.left(inside(self.eta, outer))
        else:
            left = 1.0 - jnp.clip(series(self.absorbed, outer), 0.0, 1.0)
        return (1.0 - self.reflectance(outer))[..., None] * left

    def refracted(self, w: Vec3) -> Vec3:
        """The direction inside of one outside, still pointing up: sin θ′ = sin θ/η."""
        return jnp.stack([w[0] / self.eta, w[1] / self.eta, inside(self.eta, jnp.clip(w[2], 0.0, 1.0))])

    def ways(self) -> Ways:
        """From the passage and exp(−τ/c′)."""
        left = self.left(cosines(self.eta)[1])
        way = jnp.atleast_1d(self.depth) / jnp.maximum(cosines(self.eta)[1], COS_MIN)[:, None]
        entered = self.passage.entering[..., None] * jnp.exp(jnp.min(way, axis=0) - way)  # else 0/0 in thick coats
        entered = entered / jnp.maximum(jnp.sum(entered, axis=1, keepdims=True), _TINY)
        back = self.passage.returning
        return Ways(entered, (1.0 - jnp.sum(back, axis=1))[:, None] * left, left[:, None] * back[..., None] * left)

    def returned(self) -> Spectrum:
        """2∫ R₁ exp(−2τ/c′) c′ dc′: the fraction of evenly spread light from below that comes back to the base.

        Of a smooth face total reflection below the critical cosine is one part; the other is integrated over the
        outer cosine c, with c′ dc′ = c dc/η².
        """
        cos, share = _rule()
        if self.absorbed is not None:
            way = 1.0 / jnp.maximum(cosines(self.eta)[1], COS_MIN)
            lost = -jnp.expm1(-jnp.atleast_1d(self.depth) * (way[:, None] + way)[..., None])
            dark = shares(self.eta) @ jnp.sum(self.passage.returning[..., None] * lost, axis=1)
            return 1.0 - share @ (1.0 - self.reflectance(cos)) / self.eta**2 - dark
        edge = critical(self.eta)
        total = edge**2 * (share @ self.left(edge * cos) ** 2)
        reflected = self.reflectance(cos)[:, None] * self.left(inside(self.eta, cos)) ** 2
        return total + (share / self.eta**2) @ reflected


def smooth_layer(eta: Scalar, depth: Spectrum, reflectance: Callable[[Array], Array]) -> Layer:
    """Under a polished face."""
    return Layer(eta, depth, reflectance, smooth_passage(eta), jnp.zeros(()), None)


def rough_layer(
    eta: Scalar, alpha: Scalar, depth: Spectrum, reflectance: Callable[[Array], Array], passage: Passage
) -> Layer:
    """Under a rough face; what it sends back is made reciprocal to what it reflects from outside.

    Evenly spread light leaves by ∫ (1 − R₁) c dc/η² (D. B. Judd, J. Res. NBS 29, 1942).
    """
    cos, share = _rule()
    leaves = 1.0 - jnp.sum(passage.returning, axis=1)
    wanted = share @ (1.0 - reflectance(cos)) / eta**2
    kept = leaves * (1.0 - wanted / jnp.maximum(shares(eta) @ leaves, _TINY))
    passage = passage._replace(returning=passage.returning + jnp.diag(kept))
    lost = -jnp.expm1(-jnp.atleast_1d(depth) / jnp.maximum(cosines(eta)[1], COS_MIN)[:, None])
    return Layer(eta, depth, reflectance, passage, alpha, jnp.asarray(TO_LEAVING) @ (passage.entering @ lost))


def _rule() -> tuple[Array, Array]:
    """Cosines and shares of 2∫ · c dc."""
    x, weights = gauss(16)
    return jnp.asarray((x + 1.0) / 2.0), jnp.asarray(weights * (x + 1.0) / 2.0)
