"""The Smith micro-surface as a half space: extinction, phase functions of its facets, and samples of them.

Knows single collisions and flights only; what paths they make up is for `paths`, `random_walk` and `position_free`.

Heights h enter as the depth t = −ln C1(h) ≥ 0 alone, so that their distribution does not matter: along ω the surface
is a half space t > 0 with the extinction Λ(ω) per unit t upwards and 1 + Λ(−ω) downwards (E. Heitz, J. Hanika,
E. d'Eon & C. Dachsbacher, Multiple-scattering microfacet BSDFs with the Smith model, ACM TOG 35(4), 2016).

Directions are given components first, (3, …), and point away from the collision; w may lie below the horizon.
"""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import erf, erfinv
from jaxtyping import Array, Bool, Float

from fitmat import arguments
from fitmat.errors import ModelError
from fitmat.maths.directions import COS_MIN
from fitmat.models.terms.distributions import GGX, AbstractDistribution, Beckmann, Slopes
from fitmat.models.terms.fresnel import AbstractFresnel, Dielectric, dielectric

Walker = Float[Array, "n w"]
"""One number for each of w walkers of each of n pairs."""

Walkers3 = Float[Array, "3 n w"]
"""One unit vector for each walker; components first, so that formulas for one vector serve for all."""

Colours = Float[Array, "c n w"]
"""One value per channel for each walker."""


DISTRIBUTIONS: dict[str, AbstractDistribution] = {"ggx": GGX(), "beckmann": Beckmann()}


NUMBERS = (int, float, np.generic, np.ndarray, jax.Array)
"""What a single number may be."""


def _as_distribution(given: Any) -> AbstractDistribution:
    if isinstance(given, str) and given not in DISTRIBUTIONS:
        raise ModelError(f"distribution {given!r}: expected {' or '.join(DISTRIBUTIONS)}.")
    return DISTRIBUTIONS[given] if isinstance(given, str) else given


def _as_fresnel(given: Any) -> AbstractFresnel:
    if not isinstance(given, NUMBERS):
        return given
    eta = float(arguments.numbers("fresnel", given, single=True))
    if not (np.isfinite(eta) and eta > 0.0):
        raise ModelError(f"fresnel = {eta:g}: expected a Fresnel term, or the index of a dielectric, above 0.")
    return Dielectric(jnp.asarray(eta))


def _as_slopes(slopes: Any) -> Slopes:
    """Arrays, so that surfaces that differ in their slopes alone share a compiled program."""
    if isinstance(slopes, NUMBERS) and np.ndim(slopes) == 0:
        slopes = (slopes, slopes)
    if not isinstance(slopes, Sequence | np.ndarray) or isinstance(slopes, str):
        arguments.refuse("slopes", slopes, "(alpha_x, alpha_y), each from 0.0001 to 2")
    values = tuple(a if isinstance(a, jax.Array) else jnp.asarray(arguments.numbers("slopes", a)) for a in slopes)
    if len(values) != 2 or not all(alpha.ndim == 0 and 1e-4 <= alpha <= 2.0 for alpha in values):
        raise ModelError(f"slopes {slopes}: expected (alpha_x, alpha_y), each from 0.0001 to 2.")
    return values


class Surface(eqx.Module):
    """A rough interface.

    Attributes:
        distribution: "ggx" or "beckmann", or `GGX()` or `Beckmann()`.
        slopes: alpha_x along the x axis, alpha_y along the y axis, or one alpha; 0.0001 to 2.
        fresnel: Reflectance of the facets: a Fresnel term, or a number, the index of a dielectric.
        transmits: Whether what a facet does not reflect is refracted through it (needs `Dielectric` with one eta)
            and may come back; otherwise it is absorbed.

    Raises:
        ModelError: an attribute is not of these.
    """

    distribution: AbstractDistribution = eqx.field(converter=_as_distribution)
    slopes: Slopes = eqx.field(converter=_as_slopes)
    fresnel: AbstractFresnel = eqx.field(converter=_as_fresnel)
    transmits: bool = eqx.field(static=True, default=False)

    def __check_init__(self) -> None:
        """Refuse what cannot be sampled."""
        if not isinstance(self.distribution, GGX | Beckmann):
            raise ModelError(
                f"distribution {type(self.distribution).__name__}: multiple scattering needs GGX or Beckmann."
            )
        arguments.flags(transmits=self.transmits)
        arguments.kind("fresnel", self.fresnel, AbstractFresnel)
        if self.transmits and not (isinstance(self.fresnel, Dielectric) and np.size(self.fresnel.eta) == 1):
            raise ModelError("a surface that transmits needs fresnel = Dielectric with one eta for all channels.")

    def eta(self, inside: Bool[Array, "n w"]) -> Walker:
        """Index behind a facet over that before it, for light from outside or inside; only where it transmits."""
        assert isinstance(self.fresnel, Dielectric)
        outside = jnp.reshape(self.fresnel.eta, ())
        return jnp.where(inside, 1.0 / outside, outside)


def refuse_kinds(surface: object, samples: object, seed: object, order: object) -> None:
    """Stop where a walk is given something else than it takes.

    Raises:
        FitmatError: names the argument.
    """
    arguments.kind("surface", surface, Surface)
    arguments.whole("samples", samples, 2)  # of one there is no standard error
    arguments.whole("seed", seed)
    arguments.whole("order", order, 1, optional=True)


def smith(surface: Surface, w: Walkers3) -> Walker:
    """Λ of the directions or of their opposites, whichever are above the horizon; kept off zero."""
    up = jnp.where(w[2] < 0.0, -w, w)
    return jnp.maximum(surface.distribution.masked_cos(up, surface.slopes) / jnp.maximum(up[2], COS_MIN) - 1.0, 1e-15)


def other_side(depth: Walker) -> Walker:
    """−ln(1 − exp(−t)): depth below one side of a surface of what lies t below the other, as C1(−h) = 1 − C1(h)."""
    return -jnp.log(-jnp.expm1(-jnp.maximum(depth, 1e-300)))


def flown(surface: Surface, away: Walkers3, depth: Walker, u: Walker) -> Walker:
    """Depth after a flight of optical length −ln(1−u); not positive outside."""
    optical, extinction = -jnp.log1p(-u), smith(surface, away)
    return jnp.where(away[2] >= 0.0, depth - optical / extinction, depth + optical / (1.0 + extinction))


def facet_area(surface: Surface, w: Walkers3) -> Walker:
    """Area of the facets seen from w, ∫ max(w·m, 0) D(m) dω_m: c(1 + Λ(w)) above the horizon, |c| Λ(−w) below."""
    return jnp.maximum(jnp.abs(w[2]), COS_MIN) * (smith(surface, w) + (w[2] >= 0.0))


def reflectance(fresnel: AbstractFresnel, cos_d: Walker) -> Colours:
    """Fresnel reflectance for all walkers."""
    values = jax.vmap(lambda c: jnp.atleast_1d(fresnel(c)))(jnp.clip(cos_d, 0.0, 1.0).ravel())
    return jnp.moveaxis(values, -1, 0).reshape(-1, *cos_d.shape)


def dot(a: Array, b: Array) -> Array:
    """a·b over the first axis."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _unit(a: Array) -> Array:
    return a / jnp.sqrt(jnp.maximum(dot(a, a), 1e-300))


def mirror_phase(surface: Surface, w: Walkers3, wo: Array) -> tuple[Walker, Walker]:
    """Density D(h)/(4 area(w)) in sr⁻¹ with which ideal mirrors send w to ω_o, and w·h (Heitz et al. 2016, eq. 17)."""
    h = _unit(w + wo)
    density = surface.distribution.density(h, surface.slopes) / (4.0 * facet_area(surface, w))
    return jnp.where(h[2] > 0.0, density, 0.0), dot(w, h)


def mirrored(w: Walkers3, m: Walkers3) -> Walkers3:
    """2(w·m)m − w."""
    return 2.0 * dot(w, m) * m - w


def refracted(w: Walkers3, m: Walkers3, eta: Walker) -> Walkers3:
    """The direction below a facet into which w is refracted, eta = index below over index above (Snell)."""
    cos = dot(w, m)
    inside = jnp.sqrt(jnp.maximum(1.0 - (1.0 - cos**2) / eta**2, 0.0))
    return _unit((cos / eta - inside) * m - w / eta)


def refraction_phase(surface: Surface, w: Walkers3, wo: Array, eta: Walker) -> Walker:
    """Density in sr⁻¹ with which facets refract w to ω_o on their other side, with the transmittance.

    η²(1−F)(w·h)(−ω_o·h) D(h)/(area(w)(w·h + η ω_o·h)²), h along ∓(w + η ω_o): Walter et al. 2007, eqs. 16–17.
    """
    h = _unit(w + eta * wo)
    h = h * jnp.where(h[2] < 0.0, -1.0, 1.0)
    cos_w, cos_o = dot(w, h), -dot(wo, h)
    crosses = (cos_w > 0.0) & (cos_o > 0.0)
    jacobian = eta**2 * cos_o / jnp.where(crosses, (cos_w - eta * cos_o) ** 2, 1.0)
    density = surface.distribution.density(h, surface.slopes) * cos_w / facet_area(surface, w)
    return jnp.where(crosses, (1.0 - dielectric(jnp.where(crosses, cos_w, 1.0), eta)) * density * jacobian, 0.0)


def visible_normal(surface: Surface, w: Walkers3, u: tuple[Walker, Walker]) -> Walkers3:
    """A facet as often as it is seen from w: density max(w·m, 0) D(m)/area(w), from two uniform numbers.

    The slopes are stretched to 1 and back (Heitz & d'Eon 2014); see `_ggx_normal` and `_beckmann_slopes`.
    """
    ax, ay = surface.slopes
    stretched = _unit(jnp.stack([ax * w[0], ay * w[1], w[2]]))
    if isinstance(surface.distribution, GGX):
        m = _ggx_normal(stretched, u)
    else:
        square = stretched[0] ** 2 + stretched[1] ** 2
        sin = jnp.sqrt(jnp.maximum(square, 1e-300))
        cos_phi, sin_phi = jnp.where(square > 1e-300, stretched[0] / sin, 1.0), stretched[1] / sin
        along, across = _beckmann_slopes(sin, stretched[2], u)
        m = jnp.stack([sin_phi * across - cos_phi * along, -sin_phi * along - cos_phi * across, jnp.ones_like(along)])
    return _unit(jnp.stack([ax * m[0], ay * m[1], jnp.maximum(m[2], 1e-300)]))


def _ggx_normal(w: Walkers3, u: tuple[Walker, Walker]) -> Walkers3:
    """h = c + w with c uniform on the spherical cap z > −w_z, smaller than a hemisphere for w below the horizon.

    J. Dupuy & A. Benyoub, Sampling visible GGX normals with spherical caps, HPG 2023.
    """
    sin2 = w[0] ** 2 + w[1] ** 2
    height = (1.0 - u[0]) * jnp.where(w[2] < 0.0, sin2 / (1.0 + jnp.abs(w[2])), 1.0 + w[2])
    z = height - w[2]
    sin, phi = jnp.sqrt(jnp.maximum((1.0 - z) * (1.0 + z), 0.0)), 2.0 * jnp.pi * u[1]
    return jnp.stack([sin * jnp.cos(phi) + w[0], sin * jnp.sin(phi) + w[1], height])


NEWTON = 12
"""Steps of the inversion of Beckmann's distribution function, which is then off by less than 1e-6."""

_STEEPEST = 6.5
# Slopes beyond have a share of exp(−42).


def _beckmann_slopes(sin: Walker, cos: Walker, u: tuple[Walker, Walker]) -> tuple[Walker, Walker]:
    """Slopes along w and across it of a visible facet of a Gaussian surface with alpha = 1.

    Along w the distribution function is proportional to P(x) = cos θ (1 + erf x)/2 + sin θ exp(−x²)/(2√π) up to
    cot θ (Heitz & d'Eon 2014, supplemental; W. Jakob, An improved visible normal sampling routine for the Beckmann
    distribution, 2014); it is inverted in y = erf x, where it
    is nearly straight, by Newton's method kept inside a bracket. Across, the slope is Gaussian.
    """
    highest = jnp.clip(cos / sin, -_STEEPEST, _STEEPEST)

    def area(x: Walker) -> Walker:
        return 0.5 * cos * (1.0 + erf(x)) + sin * jnp.exp(-(x**2)) / (2.0 * jnp.sqrt(jnp.pi))

    low, high = jnp.full_like(cos, -1.0), erf(highest)
    target = u[0] * area(highest)

    def improve(_: int, bracket: tuple[Walker, Walker, Walker]) -> tuple[Walker, Walker, Walker]:
        low, high, y = bracket
        x = _inverse_erf(y)
        excess = area(x) - target
        low, high = jnp.where(excess < 0.0, y, low), jnp.where(excess < 0.0, high, y)
        newton = y - 2.0 * excess / jnp.maximum(cos - x * sin, 1e-12)
        return low, high, jnp.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high))

    y = jax.lax.fori_loop(0, NEWTON, improve, (low, high, low + u[0] * (high - low)))[2]
    return _inverse_erf(y), _inverse_erf(2.0 * u[1] - 1.0)


def _inverse_erf(y: Walker) -> Walker:
    """Finite at ±1."""
    return erfinv(jnp.clip(y, -1.0 + 1e-16, 1.0 - 1e-16))
