"""Light that goes back and forth between a base and the underside of a coat: the adding equation, for energies.

Knows the base by its values and the coat as a layer; what the coat's upper face mirrors is not its business.
"""

import itertools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import COS_MIN, mirror, rotated
from fitmat.maths.quadrature import cosine_mean, gauss
from fitmat.models.around.layer import Energy, Layer
from fitmat.models.base import AbstractBRDF
from fitmat.models.glsl import spectrum, table
from fitmat.models.lobes.lambert import Lambert

LEAVING, KEPT = 10, 5
"""Cosines at which energies are known: outer ones, whose light can leave, and inner ones below the critical angle."""

RAYS, STEPS = 8, 8
"""Of the rule over what the base reflects: azimuths about the mirror direction (over half a turn), and distances from
it on each side of the critical circle."""

AZIMUTHS = 4
"""Azimuths of incidence over half a turn that stand for all, where the base is anisotropic."""

TRAPPED = 1e-6
"""Share of the returned light that is dropped at each bounce, so that light which never leaves has a limit."""

_TINY, _ALMOST = 1e-16, 0.999


class Exchange(eqx.Module):
    """What the base's light becomes by going back and forth, over outer cosines.

    Attributes:
        base: The base; it counts here for its own mirror image p.
        layer: The coat.
        peak: Of s, what one more bounce adds to the base's lobe in the mirror direction, relative; coefficients (k, c).
        rest: Of e, the fraction of the refracted light that leaves later and is not in the lobe so raised.
    """

    base: AbstractBRDF
    layer: Layer
    peak: Float[Array, "k c"]
    rest: Float[Array, "k c"]

    def raised(self, outer: Array) -> Energy:
        """1/√(1 − s) · 1/(1 − p R): what the base's lobe is multiplied with, at each of the two directions."""
        ratio = jnp.clip(_powers(_root(outer), LEAVING) @ self.peak, 0.0, _ALMOST)
        return _repeated(self.base, self.layer, outer, self.layer.inner(outer)) / jnp.sqrt(1.0 - ratio)

    def spread(self, ci: Scalar, co: Scalar) -> Spectrum:
        """BRDF inside the coat, sr⁻¹, of the rest: η² e(c_i) e(c_o)/(π 2∫ e T c dc).

        Kulla & Conty's form (2017): reciprocal, and its energy is e.
        """
        return self.layer.eta**2 * self._later(ci) * self._later(co) / (jnp.pi * self._whole())

    def numbers(self) -> tuple[Array, Array, Spectrum]:
        """`peak` and `rest` as coefficients of Chebyshev polynomials in 2√c − 1, and what `spread` divides by."""
        turned = jnp.asarray(_TO_CHEBYSHEV)
        return turned @ self.peak, turned @ self.rest, self._whole()

    def _whole(self) -> Spectrum:
        return jnp.maximum(cosine_mean(lambda c: self._later(c) * self._leaves(c)), _TINY)

    def _later(self, outer: Array) -> Energy:
        return jnp.maximum(_powers(_root(outer), LEAVING) @ self.rest, 0.0)

    def _leaves(self, outer: Scalar) -> Energy:
        return self.layer.crossing(outer, self.layer.inner(outer))[0]


def mirrored(base: AbstractBRDF, layer: Layer, wi: Vec3) -> Energy:
    """Fraction of the light from outside that leaves by the mirror image of the base, T² p/(1 − p R)."""
    below = layer.refracted(wi)
    leaves, back = layer.crossing(wi[2], below[2])
    image = base.mirror(below)
    return leaves**2 * image / jnp.maximum(1.0 - image * back, _TINY)


def exchange(base: AbstractBRDF, layer: Layer) -> Exchange:
    """Solve for the light that comes back to the base, once for all directions.

    g(c′) is the fraction of the light on the base from c′ that leaves in the end, by any number of bounces: the
    adding equation (K. N. Liou, An Introduction to Atmospheric Radiation, 2002, sec. 6.4) for the mean over azimuth,

    g(c′) = ∫ f(c′, ω) (T + R g)(ω·n) c dω,  T = (1 − R₁) exp(−τ/c), R = R₁ exp(−2τ/c)

    by product integration at `LEAVING` + `KEPT` cosines: the kernel may be as narrow as a mirror's. For a Lambert base
    s = ρR and nothing is left: Saunderson's ρ/(π(1 − ρR)). A base that reflects more than it receives exchanges light
    as if it were scaled down to all.
    """
    if isinstance(base, Lambert):
        first = jnp.zeros((LEAVING, 1)).at[0].set(1.0)
        ratio = jnp.atleast_1d(base.kd) * layer.returned()
        return Exchange(base, layer, first * ratio, 0.0 * first)
    nodes = jnp.asarray(_ROOTS**2)
    outer = jnp.concatenate([nodes, jnp.zeros(KEPT)])
    inner = jnp.concatenate([layer.inner(nodes), layer.critical() * jnp.asarray(_BELOW)])
    sent = jax.vmap(lambda cos: _sent(base, layer, cos))(inner)
    image = _mirror(base, inner)
    scale = 1.0 / jnp.maximum(image + jnp.sum(sent.energy, axis=1), 1.0)
    energy, image = sent.energy * scale[:, None], image * scale
    (leave, back), (leave_here, back_here) = layer.crossing(sent.outer, sent.inner), layer.crossing(outer, inner)
    once = jnp.sum(energy * leave, axis=1) + image * leave_here
    returned = jnp.einsum("nqc,nqk->cnk", energy * back, _basis(layer, sent))
    returned += jax.vmap(jnp.diag)((image * back_here).T)
    total = jnp.linalg.solve(jnp.eye(len(inner)) - (1.0 - TRAPPED) * returned, once.T[..., None])[..., 0].T
    second = jnp.sum(sent.energy * back * sent.twice, axis=1) / jnp.maximum(sent.peak, _TINY)
    most = 1.0 - once / jnp.maximum(total, _TINY)
    ratio = jnp.asarray(_TO_LEAVING) @ jnp.clip(second, 0.0, jnp.clip(most, 0.0, _ALMOST))[:LEAVING]
    found = Exchange(base, layer, ratio, 0.0 * ratio)
    shown = jnp.sum(energy * leave * found.raised(sent.outer), axis=1) * found.raised(outer)
    rest = total - shown - image * leave_here * _repeated(base, layer, outer, inner)
    return Exchange(base, layer, ratio, jnp.asarray(_TO_LEAVING) @ rest[:LEAVING])


class Sent(NamedTuple):
    """Where a base sends the light from one inner cosine.

    Attributes:
        outer: Cosines of the directions outside, 0 where none, (q,).
        inner: Cosines inside, (q,).
        energy: Fractions of the light, (q, c).
        twice: The base's value from each direction, returned, towards the mirror direction of the first, (q, c).
        peak: The base's value in that mirror direction, (c,).
    """

    outer: Array
    inner: Array
    energy: Energy
    twice: Energy
    peak: Spectrum


def _sent(base: AbstractBRDF, layer: Layer, cos: Scalar) -> Sent:
    """A rule in polar coordinates about the mirror direction, in the projected disc, split at the critical circle.

    There solid angle times cosine is area, and a lobe of slope α is round and about α (c_i + c_o) wide. No direction
    of the rule is ever below the horizon; it moves with the lobe, so that value and slope belong together.
    """
    sin2, width = 1.0 - cos**2, base.width()
    sin, scale = jnp.sqrt(sin2), width * (cos + width)
    half = base.isotropic
    turn = ((np.arange(RAYS if half else 2 * RAYS) + 0.5) * np.pi / RAYS)[:, None]
    along, across = sin * np.cos(turn), sin2 * np.sin(turn) ** 2
    far = along + jnp.sqrt(1.0 - across)
    near = along + jnp.sqrt(jnp.maximum(layer.eta**-2 - across, _TINY))
    near = jnp.where(sin2 * layer.eta**2 < 1.0, near, jnp.maximum(near, far / 2.0))
    x, weights = gauss(STEPS)
    ends = [jnp.zeros_like(far), jnp.arcsinh(near / scale), jnp.arcsinh(far / scale)]
    parts = [
        (low + (high - low) * (x + 1.0) / 2.0, (high - low) * weights / 2.0) for low, high in itertools.pairwise(ends)
    ]
    step, share = (jnp.concatenate(part, axis=1) for part in zip(*parts, strict=True))
    r = scale * jnp.sinh(step)
    area = share * r * scale * jnp.cosh(step) * (np.pi / RAYS * (2.0 if half else 1.0))
    x, y = (r * np.cos(turn) - sin).ravel(), (r * np.sin(turn)).ravel()
    out2 = x**2 + y**2
    out = jnp.sqrt(jnp.maximum(1.0 - out2, COS_MIN**2))
    wi, wo = jnp.stack([sin, 0.0 * sin, cos]), jnp.stack([x, y, out], axis=-1)
    f, twice, peak = _averaged(base, wi, wo)
    return Sent(layer.outer(out2), out, f * area.ravel()[:, None], twice, peak)


def _averaged(base: AbstractBRDF, wi: Vec3, wo: Float[Array, "q 3"]) -> tuple[Energy, Energy, Spectrum]:
    """f(ω_i, ω), f(ω returned, mirror of ω_i) and f(ω_i, its mirror), averaged over the azimuth where it counts."""
    ahead = jnp.broadcast_to(mirror(wi), wo.shape)
    lights = jnp.concatenate([jnp.broadcast_to(wi, wo.shape), wo * np.array([-1.0, -1.0, 1.0]), wi[None]])
    sensors = jnp.concatenate([wo, ahead, ahead[:1]])

    def at(phi: Scalar) -> Energy:
        turned = (lambda w: w) if base.isotropic else (lambda w: rotated(w, phi))
        return jax.vmap(lambda a, b: jnp.atleast_1d(base(turned(a), turned(b))))(lights, sensors)

    turns = (jnp.arange(AZIMUTHS) + 0.5) * jnp.pi / AZIMUTHS
    f = at(turns[0]) if base.isotropic else jnp.mean(jax.vmap(at)(turns), axis=0)
    return f[: len(wo)], f[len(wo) : -1], f[-1]


def _mirror(base: AbstractBRDF, inner: Array) -> Energy:
    """The base's own mirror image at inner cosines."""
    sin = jnp.sqrt(jnp.maximum(1.0 - inner**2, _TINY))
    w = jnp.stack([sin, 0.0 * inner, inner], axis=-1)
    found = jax.vmap(lambda w: jnp.atleast_1d(base.mirror(w)))(w.reshape(-1, 3))
    return found.reshape(*inner.shape, -1)


def _repeated(base: AbstractBRDF, layer: Layer, outer: Array, inner: Array) -> Energy:
    """1/(1 − p R): what the mirror image of the base itself adds by going back and forth."""
    return 1.0 / jnp.maximum(1.0 - _mirror(base, inner) * layer.crossing(outer, inner)[1], _TINY)


def _basis(layer: Layer, sent: Sent) -> Array:
    """Cardinal functions of the nodes: polynomials in √c above the critical angle, in c′ below."""
    leaving = _powers(_root(sent.outer), LEAVING) @ _TO_LEAVING
    kept = _powers(jnp.minimum(sent.inner / layer.critical(), 1.0), KEPT) @ _TO_KEPT
    leaves = (sent.outer > 0.0)[..., None]
    return jnp.concatenate([jnp.where(leaves, leaving, 0.0), jnp.where(leaves, 0.0, kept)], axis=-1)


def _root(outer: Array) -> Array:
    """√c, with a slope at 0."""
    return jnp.sqrt(jnp.maximum(outer, 1e-8))


def _powers(x: Array, count: int) -> Array:
    """1, x, …, x^(count−1), last axis."""
    return x[..., None] ** jnp.arange(count)


def _points(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Chebyshev points on [0, 1], and the matrix from values at them to the coefficients of powers."""
    x = (np.polynomial.chebyshev.chebpts1(count) + 1.0) / 2.0
    return x, np.linalg.inv(np.vander(x, increasing=True))


_ROOTS, _TO_LEAVING = _points(LEAVING)
_BELOW, _TO_KEPT = _points(KEPT)

_TO_CHEBYSHEV = np.stack(
    [
        np.polynomial.chebyshev.poly2cheb(np.polynomial.polynomial.polypow([0.5, 0.5], k)).tolist()
        + [0.0] * (LEAVING - 1 - k)
        for k in range(LEAVING)
    ],
    axis=1,
)
# From coefficients of powers of √c to those of Chebyshev polynomials in 2√c − 1.


def light_glsl(peak: Array, rest: Array, whole: Spectrum) -> str:
    """`raised` and `later` of an `Exchange` in GLSL, from its `numbers`."""
    return (
        table("peak", peak)
        + table("rest", rest)
        + spectrum("whole", whole)
        + """
// h(c): by how much the base's lobe is raised.
vec3 raised(float c) {
    return inversesqrt(1.0 - clamp(coat_series(peak, c), 0.0, 0.999));
}

// e(c): what leaves later, spread over all directions.
vec3 later(float c) {
    return max(coat_series(rest, c), 0.0);
}
"""
    )
