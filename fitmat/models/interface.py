"""Transmission: what a dielectric interface reflects and lets through from either side, smooth or rough.

A smooth interface lets T = 1 − F through. A rough one is that of Walter et al. 2007, one collision: on one side
f = F D G/(4 |c_i c_o|); across, with η = index on the side of ω_o over that on the side of ω_i,

f = η² (1 − F) D G |ω_i·h| |ω_o·h|/(|c_i c_o| (ω_i·h + η ω_o·h)²),  h along −(ω_i + η ω_o)

∫ f |c_o| dω_o is the energy that comes out: f is meant for light that travels from ω_i to ω_o. A renderer that follows
paths from the eye carries radiance and divides by η². f(ω_i, ω_o)/η_o² is reciprocal.

Parameters: alpha, or alpha_x and alpha_y, slope parameters, 0.0001 to 2; eta, index below over that above, any but 1.

Static choice: masking = "correlated" (the default, exact on Smith surfaces: 1/(1+Λ_i+Λ_o) on one side, the beta
function B(1+Λ_i, 1+Λ_o) across) or "separable" (1/((1+Λ_i)(1+Λ_o)), as in Walter 2007 and Mitsuba 3).

Limits: evaluated, not fitted: measurements of transmitted light are not read. What neither leaves here nor there
meets the interface again: `albedo_walk` follows it. eta = 1 lets light pass straight on, which no value of f holds.

References: B. Walter, S. Marschner, H. Li & K. Torrance, Microfacet models for refraction through rough surfaces, EGSR
2007, eqs. 16, 20 and 21; across with correlated heights: E. Heitz, J. Hanika, E. d'Eon & C. Dachsbacher, ACM TOG
35(4), 2016.

Example: `fm.evaluate_interface(fm.Surface("ggx", 0.3, 1.5, transmits=True), wi, wo)`
"""

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from fitmat import arguments
from fitmat.errors import ModelError
from fitmat.maths.quadrature import AZIMUTH_NODES, ZENITH_NODES, facets
from fitmat.models.base import direction_pairs
from fitmat.models.multiple_scattering.surface import (
    Surface,
    facet_area,
    mirror_phase,
    mirrored,
    refracted,
    refraction_phase,
    smith,
)
from fitmat.models.terms.fresnel import Dielectric, dielectric
from fitmat.text import brief

MASKINGS = ("correlated", "separable")
"""Heitz et al. 2016: 1/(1+Λ_i+Λ_o), and B(1+Λ_i, 1+Λ_o) across the interface; Walter 2007: 1/((1+Λ_i)(1+Λ_o))."""

NODES = 4 * ZENITH_NODES, 2 * AZIMUTH_NODES
"""Of the energies, zenith and azimuth on each side: total reflection has an edge."""

LEAST = 1e-5
"""What the bound of their error never falls below."""


@dataclasses.dataclass(frozen=True, eq=False)
class InterfaceEnergy:
    """Fractions of the light from each direction after one collision.

    Attributes:
        reflected: What leaves on the side that it came from, (k,).
        transmitted: What leaves on the other; what is missing from 1 meets the interface again.
        error: Bound of the quadrature's error of either: twice the distance of a coarser rule, and `LEAST`.
    """

    reflected: Float[np.ndarray, " k"]
    transmitted: Float[np.ndarray, " k"]
    error: Float[np.ndarray, " k"]

    __repr__ = brief


def transmittance(theta_i: ArrayLike, eta: ArrayLike) -> Float[np.ndarray, "..."]:
    """T = 1 − F of a smooth dielectric interface, the exact Fresnel equations; 0 where it reflects totally.

    Args:
        theta_i: Angles of incidence in radians, 0 to π/2, any shape.
        eta: Index behind the interface over that before it, above 0: 1.5 into glass, 1/1.5 out of it; 1 lets all pass.
            Of a shape that fits.

    Raises:
        FitmatError: an angle or an index is out of range.

    Example:
        >>> transmittance([0.0, 1.0], 1.5).round(4)
        array([0.96  , 0.9225])
    """
    theta = arguments.angles("theta_i", theta_i, arguments.ZENITH)
    index = _index("eta", arguments.numbers("eta", eta))
    try:
        cos, index = np.broadcast_arrays(np.cos(theta), index)
    except ValueError as error:
        raise ModelError(
            f"theta_i and eta have shapes {np.shape(theta)} and {np.shape(index)}: expected the same, or one number."
        ) from error
    return np.where(index == 1.0, 1.0, 1.0 - dielectric(np.maximum(cos, 0.0), index))


def evaluate_interface(
    surface: Surface, wi: ArrayLike, wo: ArrayLike, *, masking: str = "correlated"
) -> Float[np.ndarray, " n"]:
    """BSDF of a rough dielectric interface in sr⁻¹ (no cosine), light of one collision, from either side.

    See the module for the formula; ∫ f |c_o| dω_o is the energy that comes out.

    Args:
        surface: A rough interface with `transmits=True`; its `Dielectric(eta)` is the index below over that above.
        wi: Unit vectors to where the light comes from, (n, 3): z > 0 above, z < 0 below.
        wo: Unit vectors to where it goes, (n, 3); on the other side of the interface it is transmitted.
        masking: "correlated" or "separable".

    Returns:
        Values (n,); 0 along the surface.

    Raises:
        ModelError: the surface does not transmit, its index is 1 (light passes straight on, which no value of f
            holds), directions are no unit vectors, or the masking is another.

    Example:
        >>> glass = Surface("ggx", 0.3, 1.5, transmits=True)
        >>> evaluate_interface(glass, [[0.0, 0.0, 1.0]], [[0.0, 0.0, -1.0]]).round(2)
        array([30.56])
    """
    eta = _checked(surface, masking)
    pair = direction_pairs(wi, wo)
    turned = pair[0][:, 2] < 0.0
    flip = np.where(turned[:, None], [1.0, 1.0, -1.0], 1.0)
    light, sensor = (jnp.asarray((w * flip).T) for w in pair)
    ratio = jnp.asarray(np.where(turned, 1.0 / eta, eta))
    back, cos = mirror_phase(surface, light, sensor)
    back = back * dielectric(jnp.clip(cos, 0.0, 1.0), ratio) * (sensor[2] > 0.0)
    through = refraction_phase(surface, light, sensor, ratio) * (sensor[2] < 0.0)
    same = np.asarray(sensor[2] > 0.0)
    seen = _seen(surface, light, sensor, masking, same) / np.maximum(np.abs(np.asarray(sensor[2])), 1e-300)
    return np.where(np.asarray(light[2] * sensor[2]) != 0.0, np.asarray(back + through) * seen, 0.0)


def albedo_interface(
    surface: Surface, theta_i: ArrayLike, *, inside: bool = False, masking: str = "correlated"
) -> InterfaceEnergy:
    """Fractions that one collision reflects and transmits, by quadrature over the facets that face the light.

    Args:
        surface: As for `evaluate_interface`; alpha_x is meant along the plane of incidence.
        theta_i: Angles of incidence in radians, 0 to π/2, (k,).
        inside: Whether the light comes from below.
        masking: As for `evaluate_interface`.

    Raises:
        FitmatError: what `evaluate_interface` refuses, or an angle is out of range.

    Example:
        >>> found = albedo_interface(Surface("ggx", 0.3, 1.5, transmits=True), [0.5])
        >>> found.reflected.round(3), found.transmitted.round(3)
        (array([0.037]), array([0.946]))
    """
    eta = _checked(surface, masking)
    arguments.flags(inside=inside)
    theta = np.atleast_1d(arguments.angles("theta_i", theta_i, arguments.ZENITH))
    if theta.ndim != 1 or not theta.size:
        raise ModelError(f"theta_i has shape {theta.shape}: expected (k,), k ≥ 1.")
    ratio = 1.0 / eta if inside else eta
    rules = (NODES, (NODES[0] * 5 // 8, NODES[1] * 5 // 8))
    fine, coarse = (np.array([_shares(surface, float(t), ratio, masking, nodes) for t in theta]) for nodes in rules)
    return InterfaceEnergy(fine[:, 0], fine[:, 1], 2.0 * np.abs(fine - coarse).max(axis=1) + LEAST)


def _shares(
    surface: Surface, theta: float, eta: float, masking: str, nodes: tuple[int, int]
) -> tuple[np.floating, np.floating]:
    """Reflected and transmitted: means over the visible normals."""
    ax, ay = (float(slope) for slope in surface.slopes)
    normals = facets(theta, min(ax, ay), phi_i=None if ax == ay else 0.0, nodes=nodes)
    w, h = jnp.asarray(normals.wi[:, None]), jnp.asarray(normals.h.T)
    cos = jnp.clip(w[0] * h[0] + w[1] * h[1] + w[2] * h[2], 0.0, 1.0)
    visible = normals.solid * np.asarray(surface.distribution.density(h, surface.slopes) * cos / facet_area(surface, w))
    part, ways = np.asarray(dielectric(cos, jnp.asarray(eta))), (mirrored(w, h), refracted(w, h, jnp.asarray(eta)))
    reflected, transmitted = (_seen(surface, w, out, masking, np.array(k == 0)) for k, out in enumerate(ways))
    leaves = [np.asarray(side * out[2] > 0.0) for side, out in zip((1.0, -1.0), ways, strict=True)]
    return visible @ (part * reflected * leaves[0]), visible @ ((1.0 - part) * transmitted * leaves[1])


def _seen(surface: Surface, wi: Array, wo: Array, masking: str, same: np.ndarray) -> np.ndarray:
    """G (1 + Λ_i): whether the facets that ω_i sees are seen from ω_o as well, on the same side or on the other."""
    one, other = (1.0 + np.asarray(smith(surface, w)) for w in (wi, wo))
    if masking == "separable":
        return 1.0 / other + 0.0 * one
    from scipy.special import betaln

    return np.where(same, one / (one + other - 1.0), one * np.exp(betaln(one, other)))


def _checked(surface: object, masking: object) -> float:
    """The index of a surface that transmits."""
    arguments.kind("surface", surface, Surface)
    assert isinstance(surface, Surface)
    if not surface.transmits:
        raise ModelError('the surface does not transmit, expected Surface("ggx", alpha, eta, transmits=True).')
    arguments.kind("masking", masking, str)
    if masking not in MASKINGS:
        raise ModelError(f"masking {masking!r}: expected one of {', '.join(MASKINGS)}.")
    assert isinstance(surface.fresnel, Dielectric)
    eta = float(_index("eta of the surface", np.asarray(surface.fresnel.eta, float)).reshape(()))
    if eta == 1.0:
        raise ModelError("eta = 1 of the surface: light passes straight on, which no value holds. Take another index.")
    return eta


def _index(name: str, eta: np.ndarray) -> np.ndarray:
    if not np.all(np.isfinite(eta) & (eta > 0.0)):
        raise ModelError(f"{name} = {eta}: expected an index above 0, behind the interface over before it.")
    return eta
