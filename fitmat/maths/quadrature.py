"""Rules that integrate over directions, dense where a mirror-like lobe is, and curves tabulated against a cosine.

Knows no model.
"""

import functools
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat._types import Scalar
from fitmat.maths.arrays import library
from fitmat.maths.directions import rotated

ZENITH_NODES = 64
AZIMUTH_NODES = 32
AZIMUTHS = 4
"""Azimuths of incidence over half a turn in `lobe_rules`, where a surface is anisotropic."""

INCIDENCE_NODES = 16
CURVE_NODES = 24

_SPREAD = 0.5
# The rule is densest within this fraction of a lobe's width.


class Rule(eqx.Module):
    """Directions and weights: Σ weight·g(wo) ≈ ∫ g(ω_o) c_o dω_o over the upper hemisphere, for one incidence.

    Attributes:
        wi: The incidence.
        wo: Directions, (m, 3).
        weight: Weights with the cosine c_o and the solid angle, (m,); 0 below the horizon.
    """

    wi: Float[Any, "3"]
    wo: Float[Any, "m 3"]
    weight: Float[Any, " m"]


class Facets(eqx.Module):
    """Micro-normals that face ω_i, and solid angles: Σ solid·g(h) ≈ ∫ g(h) dω_h over them.

    Attributes:
        wi: The direction they face.
        h: Directions, (m, 3).
        solid: Solid angles in sr, (m,).
    """

    wi: Float[Any, "3"]
    h: Float[Any, "m 3"]
    solid: Float[Any, " m"]


def incidence(theta_i: Float[Any, ""]) -> Float[Any, "3"]:
    """The unit vector to the light at zenith angle theta_i (radians), azimuth 0."""
    xp = library(theta_i)
    return xp.stack([xp.sin(theta_i), 0.0 * theta_i, xp.cos(theta_i)])


@functools.lru_cache
def gauss(count: int) -> tuple[Float[np.ndarray, " count"], Float[np.ndarray, " count"]]:
    """Nodes and weights of Gauss–Legendre on [−1, 1]."""
    return np.polynomial.legendre.leggauss(count)


def facets(
    theta_i: Float[Any, ""],
    width: Float[Any, ""],
    *,
    phi_i: Float[Any, ""] | None = None,
    nodes: tuple[int, int] = (ZENITH_NODES, AZIMUTH_NODES),
) -> Facets:
    """A product rule over the micro-normals that face the light, dense around n on the scale of `width`.

    Gauss–Legendre in t with θ_h = w sinh(t asinh(π/(2w))), and in φ_h as far as ω_i·h > 0. The rule is constant
    under differentiation: the slope of an integral is the integral of the slope.

    Args:
        theta_i: Incidence in radians; where this and the rest are plain numbers, NumPy computes.
        width: Slope-like width of the narrowest lobe.
        phi_i: Azimuth of incidence in radians; None for integrands that are the same on both sides of the plane of
            incidence: then the light comes from azimuth 0 and one side is taken, doubled.
        nodes: How many in zenith, and in azimuth on each side.
    """
    xp = library(theta_i, width, *(() if phi_i is None else (phi_i,)))
    x, weights = gauss(nodes[0])
    t, scale = (x + 1) / 2, _SPREAD * width
    reach = xp.arcsinh(np.pi / 2 / scale)
    theta_h = (scale * xp.sinh(t * reach))[:, None]
    d_theta = (weights / 2 * scale * xp.cosh(t * reach) * reach)[:, None]
    y, ring = gauss(nodes[1] if phi_i is None else 2 * nodes[1])
    edge = xp.arccos(xp.clip(-xp.cos(theta_i) / xp.maximum(xp.sin(theta_i) * xp.tan(theta_h), 1e-300), -1, 1))
    phi = edge * ((y + 1) / 2 if phi_i is None else y)
    solid = d_theta * xp.sin(theta_h) * edge * ring
    wi = incidence(theta_i)
    h = xp.stack([xp.sin(theta_h) * xp.cos(phi), xp.sin(theta_h) * xp.sin(phi), xp.cos(theta_h) + 0.0 * phi])
    if phi_i is not None:
        wi, h = rotated(wi, phi_i), rotated(h, phi_i)
    found = Facets(wi, h.reshape(3, -1).T, xp.ravel(solid))
    return found if xp is np else jax.lax.stop_gradient(found)


def reflected(normals: Facets) -> Rule:
    """The rule over outgoing directions that mirror ω_i at the normals: dω_o = 4 (ω_i·h) dω_h (Walter 2007, eq. 14)."""
    wi = normals.wi
    cos_d = normals.h @ wi
    wo = 2.0 * cos_d[:, None] * normals.h - wi
    weight = library(cos_d).where((cos_d > 0) & (wo[:, 2] > 0), 4.0 * cos_d * normals.solid * wo[:, 2], 0.0)
    return Rule(wi, wo, weight)


def stepped(width: float, octave: int = 4) -> float:
    """The next width below of a series of so many an octave: a rule for it resolves the lobe too, and serves many."""
    return float(2.0 ** (np.floor(octave * np.log2(max(width, 1e-300))) / octave))


def lobe_rule(
    theta_i: float, width: float, *, phi_i: float | None = None, nodes: tuple[int, int] = (ZENITH_NODES, AZIMUTH_NODES)
) -> Rule:
    """A rule over ω_o that resolves lobes of a given width around the mirror direction; arguments as in `facets`.

    The normals that mirror ω_i to somewhere above the horizon, and no others: cosφ_h > −cot θ_i cot 2θ_h. They fill
    rings up to (π/2 − θ_i)/2, and from there on arcs that shrink to a point at (π/2 + θ_i)/2. Gauss–Legendre on rings
    and on arcs, these in u with t = t₀ + (1 − t₀) sin²(πu/2), as the arc begins and ends like a root; in t as in
    `facets`. What is smooth above the horizon is integrated to 1e-7; no node lies where the surface reflects nothing.
    """
    theta_i, width = float(theta_i), float(width)
    inner, outer = (np.pi / 2 - theta_i) / 2, (np.pi / 2 + theta_i) / 2
    scale = _SPREAD * width
    reach = np.arcsinh(outer / scale)
    t, share = _rings_and_arcs(float(np.arcsinh(inner / scale) / reach), nodes[0])
    theta_h = scale * np.sinh(t * reach)
    d_theta = share * scale * np.cosh(t * reach) * reach
    level = np.maximum(np.sin(theta_i) * np.sin(2.0 * theta_h), 1e-300)
    edge = np.arccos(np.clip(-np.cos(theta_i) * np.cos(2.0 * theta_h) / level, -1.0, 1.0))
    y, ring = gauss(nodes[1] if phi_i is None else 2 * nodes[1])
    phi = edge[:, None] * ((y + 1) / 2 if phi_i is None else y)
    solid = (d_theta * np.sin(theta_h) * edge)[:, None] * ring
    sin, cos = np.sin(theta_h)[:, None], np.cos(theta_h)[:, None]
    wi, h = incidence(np.array(theta_i)), np.stack([sin * np.cos(phi), sin * np.sin(phi), cos + 0.0 * phi])
    if phi_i is not None:
        wi, h = rotated(wi, phi_i), rotated(h, phi_i)
    return reflected(Facets(wi, h.reshape(3, -1).T, np.ravel(solid)))


def lobe_rules(
    theta_i: Float[np.ndarray, " k"],
    width: float,
    *,
    isotropic: bool,
    nodes: tuple[int, int] = (ZENITH_NODES, AZIMUTH_NODES),
) -> list[Rule]:
    """A rule over ω_o at each incidence; of a surface that is not isotropic `AZIMUTHS` of them, one after the other.

    Args:
        theta_i: Incidences in radians.
        width: Slope-like width of the narrowest lobe of all draws, which every wider one is resolved with.
        isotropic: Whether the surfaces are.
        nodes: In zenith and azimuth, as in `lobe_rule`.
    """
    turns = [None] if isotropic else ((np.arange(AZIMUTHS) + 0.5) * np.pi / AZIMUTHS).tolist()
    width = stepped(width)
    return [_rule(float(theta), width, phi_i=turn, nodes=nodes) for theta in theta_i for turn in turns]


_rule = functools.lru_cache(1024)(lobe_rule)  # files of a batch have incidences and widths in common


def _rings_and_arcs(border: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes t in [0, 1] and weights in two panels that meet at `border`: shares of the nodes as of the length.

    But no less than a quarter, and none for a panel of no length.
    """
    on_arcs = round(count * min(max(1.0 - border, 0.25), 0.75))
    on_arcs = count if border < 1e-9 else 0 if border > 1.0 - 1e-9 else on_arcs
    t, weight = [], []
    if on_arcs < count:
        x, weights = gauss(count - on_arcs)
        t.append(border * (x + 1) / 2)
        weight.append(border * weights / 2)
    if on_arcs:
        x, weights = gauss(on_arcs)
        angle = np.pi * (x + 1) / 4
        t.append(border + (1.0 - border) * np.sin(angle) ** 2)
        weight.append((1.0 - border) * np.pi / 4 * np.sin(2.0 * angle) * weights)
    return np.concatenate(t), np.concatenate(weight)


def incidence_rule() -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Incidence angles (radians) and weights of ∫ g(θ_i) c_i dω_i over the hemisphere: Gauss in cosθ_i.

    Divided by cosθ_i the weights integrate over solid angle.
    """
    nodes, weights = gauss(INCIDENCE_NODES)
    cos = (nodes + 1) / 2
    return np.arccos(cos), np.pi * weights * cos


class Curve(eqx.Module):
    """A smooth function of a cosine, known at `CURVE_NODES` nodes: a polynomial in √c.

    Attributes:
        coefficients: Of Chebyshev polynomials in 2√c − 1, (k,).
    """

    coefficients: Float[Array, " k"]

    def __call__(self, cos: Scalar) -> Scalar:
        """The function at a cosine in [0, 1]."""
        return chebyshev(self.coefficients, 2.0 * jnp.sqrt(jnp.maximum(cos, _ROOT_FLOOR)) - 1.0)


def chebyshev(coefficients: Float[Any, " k *n"], x: Float[Any, " *n"]) -> Float[Any, " *n"]:
    """Σ a_k T_k(x) by Clenshaw's recurrence; where the a_k are arrays, of each of their elements at one x."""
    one = two = 0.0 * x * coefficients[0]
    for k in range(len(coefficients) - 1, 0, -1):
        one, two = coefficients[k] + 2.0 * x * one - two, one
    return coefficients[0] + x * one - two


def curve(function: Callable[[Scalar], Scalar]) -> Curve:
    """Tabulate a function of a cosine; traceable, so that its parameters can be fitted."""
    return Curve(jnp.asarray(_TO_COEFFICIENTS) @ jax.vmap(function)(jnp.asarray(_NODES)))


_ROOT_FLOOR = 1e-8
# √c has no finite slope at 0.


def cosine_mean(function: Callable[[Scalar], Scalar]) -> Scalar:
    """2 ∫₀¹ f(c) c dc, the average over a hemisphere that is lit evenly; Gauss in √c."""
    return jnp.asarray(_SHARES) @ jax.vmap(function)(jnp.asarray(_COSINES))


def _chebyshev() -> tuple[np.ndarray, np.ndarray]:
    """Nodes in c, and the matrix from values at them to Chebyshev coefficients."""
    x = np.polynomial.chebyshev.chebpts1(CURVE_NODES)
    return ((x + 1) / 2) ** 2, np.linalg.inv(np.polynomial.chebyshev.chebvander(x, CURVE_NODES - 1))


def _gauss() -> tuple[np.ndarray, np.ndarray]:
    """Cosines and shares of `cosine_mean`: c = x², 2c dc = 4x³ dx."""
    x, weights = gauss(2 * CURVE_NODES)
    root = (x + 1) / 2
    return root**2, 2.0 * root**3 * weights


_NODES, _TO_COEFFICIENTS = _chebyshev()
_COSINES, _SHARES = _gauss()
