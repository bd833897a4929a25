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
from fitmat.models.around.layer import Energy, Layer, Ways
from fitmat.models.around.nodes import (
    FINE,
    KEPT,
    LEAVING,
    Curve,
    cardinal,
    cosines,
    curve,
    finer,
    hermite,
    inside,
    leaving,
)
from fitmat.models.base import AbstractBRDF
from fitmat.models.glsl import spectrum, table
from fitmat.models.lobes.lambert import Lambert

RAYS, STEPS = 8, 8
"""Of the rule over what the base reflects: azimuths about the mirror direction (over half a turn), and distances from
it on each side of the critical circle."""

AZIMUTHS = 4
"""Azimuths of incidence over half a turn that stand for all, where the base is anisotropic."""

TRAPPED = 1e-6
"""Share of the returned light that is dropped at each bounce, so that light which never leaves has a limit."""

SWEEPS = 12
"""Of the search for the factors of the lobe; each halves the logarithm of what is missing."""

_TINY, _ALMOST = 1e-16, 0.999

_NODES = np.r_[: len(FINE) : 2, len(FINE) : len(FINE) + KEPT]
"""The nodes among `FINE` and those below the critical angle."""


class Exchange(eqx.Module):
    """What the base's light becomes by going back and forth, over outer cosines.

    Attributes:
        layer: The coat.
        raised: h, what the base's lobe as it is seen is multiplied with, at each of the two directions.
        later: e, the fraction of the light at the base that leaves and is not in the lobe so raised.
    """

    layer: Layer
    raised: Curve
    later: Curve

    def spread(self, ci: Scalar, co: Scalar) -> Spectrum:
        """BRDF inside the coat, sr⁻¹, of the rest: η² e(c_i) e(c_o)/(π 2∫ e E c dc).

        Kulla & Conty's form (2017): reciprocal, and its energy is e.
        """
        return self.layer.eta**2 * self.later(ci) * self.later(co) / (jnp.pi * self._whole())

    def numbers(self) -> tuple[Curve, Curve, Spectrum]:
        """`raised`, `later`, and what `spread` divides by."""
        return self.raised, self.later, self._whole()

    def _whole(self) -> Spectrum:
        return jnp.maximum(cosine_mean(lambda c: self.later(c) * self.layer.entering(c)), _TINY)


def mirrored(seen: AbstractBRDF, layer: Layer, wi: Vec3) -> Energy:
    """Fraction of the light from outside that leaves by the mirror image of the base, T² p/(1 − p R)."""
    image = seen.mirror(layer.refracted(wi))
    back = layer.reflectance(wi[2]) * layer.left(layer.refracted(wi)[2]) ** 2
    return layer.entering(wi[2]) ** 2 * image / jnp.maximum(1.0 - image * back, _TINY)


def exchange(base: AbstractBRDF, seen: AbstractBRDF, layer: Layer) -> Exchange:
    """Solve for the light that comes back to the base, once for all directions.

    g(c′) is the fraction of the light on the base from c′ that leaves in the end, by any number of bounces: the
    adding equation (K. N. Liou, An Introduction to Atmospheric Radiation, 2002, sec. 6.4) for the mean over azimuth,

    g = B (L + A R A g),  L = A (1 − R 1),  A = exp(−τ/c′)

    with what the base sends between the nodes, B, and what the face does, R, as matrices by product integration: the
    kernels may be as narrow as a mirror's. For a Lambert base nothing is left: Saunderson's ρ/(π(1 − ρR)). A base that
    reflects more than it receives exchanges light as if it were scaled down to all.

    Args:
        base: What is below the coat.
        seen: The base with its lobes as wide as they are seen through the face; the base itself through a smooth one.
        layer: The coat.
    """
    if isinstance(base, Lambert):
        every = jnp.ones((len(FINE), 1)) / jnp.sqrt(1.0 - jnp.atleast_1d(base.kd) * layer.returned())
        return Exchange(layer, Curve(FINE, every, 0.0 * every), Curve(FINE, 0.0 * every, 0.0 * every))
    _, inner = cosines(layer.eta)
    ways = layer.ways()
    fine = jnp.concatenate([inside(layer.eta, jnp.asarray(FINE**2)), inner[LEAVING:]])
    if seen is base:
        every = jax.vmap(lambda cos: _sent(base, layer, cos))(fine)
        sent, through = (Sent(*(part[rows] for part in every)) for rows in (_NODES, np.arange(len(FINE))))
    else:
        sent = jax.vmap(lambda cos: _sent(base, layer, cos))(inner)
        through = jax.vmap(lambda cos: _sent(seen, layer, cos))(fine[: len(FINE)])
    image = _mirror(base, inner)
    scale = 1.0 / jnp.maximum(image + jnp.sum(sent.energy, axis=1), 1.0)
    kernel = jnp.einsum("nqc,nqk->cnk", sent.energy, cardinal(layer.eta, sent.inner))
    kernel = (kernel + jax.vmap(jnp.diag)(image.T)) * scale.T[..., None]
    once = jnp.einsum("cnk,kc->nc", kernel, ways.leaves)
    loop = jnp.eye(len(inner)) - (1.0 - TRAPPED) * jnp.einsum("cnk,kmc->cnm", kernel, ways.back)
    total = jnp.linalg.solve(loop, once.T[..., None])[..., 0].T
    once, total = (jnp.einsum("jnc,nc->jc", ways.entered, part) for part in (once, total))
    through = through._replace(energy=through.energy * finer(scale[:LEAVING])[:, None])
    return Exchange(layer, *(curve(FINE, part) for part in _shared(seen, layer, ways, through, once, total)))


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
    return Sent(leaving(layer.eta, out), out, f * area.ravel()[:, None], twice, peak)


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


def _shared(
    seen: AbstractBRDF, layer: Layer, ways: Ways, sent: Sent, once: Energy, total: Energy
) -> tuple[Array, Array]:
    """What leaves after one bounce and after all, (k, c), shared between lobe and rest: h and e at `FINE`.

    Near the critical angle what a lobe sends out changes faster than the nodes stand.
    s is what one more bounce adds to the lobe in the mirror direction, relative, a bounce off a rough face being as
    much fainter there as it is wider. h h times the energy of the lobe as it is seen is what leaves once, over 1 − s.
    """
    _, inner = cosines(layer.eta)
    image = _mirror(seen, inner[:LEAVING])
    repeated = 1.0 / jnp.maximum(1.0 - image * jnp.einsum("nnc->nc", ways.back)[:LEAVING], _TINY)
    direct = image * ways.leaves[:LEAVING]
    leaves = (sent.outer > 0.0)[..., None]
    leave = jnp.where(leaves, layer.entering(jnp.where(leaves[..., 0], sent.outer, 1.0)), 0.0)
    kernel, along = (jnp.einsum("jqc,jqk->cjk", sent.energy * leave, at) for at in hermite(FINE, sent.outer))
    back = cardinal(layer.eta, sent.inner) @ jnp.sum(ways.back, axis=1)
    second = jnp.sum(sent.energy * back * sent.twice, axis=1) / jnp.maximum(sent.peak, _TINY)
    wide = seen.width() ** 2
    second = jnp.clip(second * wide / (wide + layer.slope**2), 0.0, _ALMOST)
    all_sent, leaving_sent = jnp.sum(sent.energy, axis=1), jnp.sum(sent.energy * leave, axis=1)
    every = all_sent * finer((total - direct * repeated) / jnp.maximum(all_sent[::2], _TINY))
    once = leaving_sent * finer((once - direct) / jnp.maximum(leaving_sent[::2], _TINY))
    repeated = finer(repeated)
    wanted = jnp.clip(once * repeated**2 / (1.0 - second), 0.0, jnp.maximum(every, 0.0))
    factor = repeated / jnp.sqrt(1.0 - second)

    def lobe(factor: Array) -> Energy:
        return jnp.einsum("cjk,kc->jc", kernel, factor) + jnp.einsum("cjk,kc->jc", along, curve(FINE, factor).slopes)

    def swept(_: int, factor: Array) -> Array:
        return jnp.sqrt(factor * (wanted + _TINY) / (lobe(factor) + _TINY))

    factor = jax.lax.fori_loop(0, SWEEPS, swept, factor)
    return factor, jnp.maximum(every - factor * lobe(factor), 0.0)


def light_glsl(raised: Curve, later: Curve, whole: Spectrum) -> str:
    """`raised` and `later` of an `Exchange` in GLSL, from its `numbers`."""
    return (
        table("roots", raised.roots)
        + table("raised_values", raised.values)
        + table("raised_slopes", raised.slopes)
        + table("later_values", later.values)
        + table("later_slopes", later.slopes)
        + spectrum("whole", whole)
        + """
// h(c): by how much the base's lobe is raised.
vec3 raised(float c) {
    return coat_curve(roots, raised_values, raised_slopes, c);
}

// e(c): what leaves later, spread over all directions.
vec3 later(float c) {
    return coat_curve(roots, later_values, later_slopes, c);
}
"""
    )
