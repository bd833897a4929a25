"""Distributions of normals and masking against quadrature, Mitsuba 3 and the formulas as printed."""

from collections.abc import Callable
from types import ModuleType

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from lanes import mapped
from scipy.special import erfc

from fitmat.maths.directions import half_vector, pair
from fitmat.models.terms.distributions import (
    GGX,
    MASKINGS,
    AbstractDistribution,
    AbstractRoughness,
    Anisotropic,
    Beckmann,
    BeckmannRational,
    Isotropic,
    Masking,
    Slopes,
    visibility,
)

QUADRATURE = 1e-5
"""Absolute; 960 × 64 Gauss nodes; the worst, 2e-6, is the kink where facets begin to face away."""

MITSUBA = 1e-5
"""Relative; single precision, for alpha ≥ 0.1: D multiplies the rounding of h, 6e-8, by about 4/alpha."""

WALTER = 0.0035
"""Relative error that Walter et al. 2007 state for the approximation of Beckmann's G1, which Mitsuba uses."""

EXACT = 1e-12
"""Relative; the same formula written twice in double precision, at angles that are not grazing."""

DISTRIBUTIONS = pytest.mark.parametrize("distribution", [GGX(), Beckmann()], ids=["ggx", "beckmann"])
ALPHAS = pytest.mark.parametrize("alpha", [1e-3, 0.05, 0.3, 1.0])
NODES, WEIGHTS = np.polynomial.legendre.leggauss(64)


def _integral(integrand: Callable[[np.ndarray], np.ndarray], alpha: float) -> float:
    """∫ integrand(θ) dθ over [0, π/2]: 60 panels of 16 Gauss nodes in u, tan θ = alpha sinh u.

    Ends at tan θ = 1e9; a sensor at 89° sees 1e-9 of the facets of GGX, alpha = 1, beyond it.
    """
    edges = np.linspace(0, np.arcsinh(1e9 / alpha), 61)
    nodes, weights = np.polynomial.legendre.leggauss(16)
    u = (edges[:-1, None] + np.diff(edges)[:, None] * (nodes + 1) / 2).ravel()
    du = (np.diff(edges)[:, None] * weights / 2).ravel()
    tan = alpha * np.sinh(u)
    return float(np.sum(integrand(np.arctan(tan)) * alpha * np.cosh(u) / (1 + tan**2) * du))


def _normals(theta: np.ndarray, phi: np.ndarray | float) -> np.ndarray:
    theta, phi = np.broadcast_arrays(theta, phi)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)


def _slopes(alpha: float | tuple[float, float]) -> Slopes:
    x, y = alpha if isinstance(alpha, tuple) else (alpha, alpha)
    return jnp.array(x), jnp.array(y)


def _density(distribution: AbstractDistribution, alpha: float | tuple[float, float], h: np.ndarray) -> np.ndarray:
    values = jax.vmap(distribution.density, (0, None))(jnp.array(h.reshape(-1, 3)), _slopes(alpha))
    return np.asarray(values).reshape(h.shape[:-1])


@ALPHAS
@DISTRIBUTIONS
def test_distribution_is_normalised(distribution: AbstractDistribution, alpha: float) -> None:
    """∫ D(h) c_h dω_h = 1: the micro-surface projects onto the whole macro-surface."""

    def ring(theta: np.ndarray) -> np.ndarray:
        return 2 * np.pi * np.sin(theta) * np.cos(theta) * _density(distribution, alpha, _normals(theta, 0.4))

    assert _integral(ring, alpha) == pytest.approx(1, abs=QUADRATURE)


@pytest.mark.parametrize("theta_o", [0.0, 40.0, 75.0, 89.0])
@ALPHAS
@DISTRIBUTIONS
def test_weak_white_furnace(distribution: AbstractDistribution, alpha: float, theta_o: float) -> None:
    """∫ G1(ω_o) D(h)/(4 c_o) dω_i = 1 over all directions (Heitz 2014): no micro-mirror loses light.

    Integrated over h with dω_i = 4 (ω_o·h) dω_h; in azimuth as far as the facet faces the sensor.
    """
    wo = _normals(np.deg2rad(theta_o), 0.0)
    g1 = wo[2] / float(distribution.masked_cos(jnp.array(wo), _slopes(alpha)))

    def ring(theta: np.ndarray) -> np.ndarray:
        facing = np.arccos(np.clip(-wo[2] / np.tan(theta) / max(wo[0], 1e-300), -1, 1))[:, None]
        h = _normals(theta[:, None], facing * (NODES + 1) / 2)
        wi = 2 * (h @ wo)[..., None] * h - wo
        found = jax.vmap(half_vector, (0, None))(jnp.array(wi.reshape(-1, 3)), jnp.array(wo))
        density = _density(distribution, alpha, np.asarray(found).reshape(h.shape))
        seen = g1 * density / (4 * wo[2]) * 4 * (h @ wo)
        return np.sin(theta) * ((facing * seen) @ WEIGHTS)

    assert _integral(ring, alpha) == pytest.approx(1, abs=QUADRATURE)


@pytest.mark.parametrize("alpha", [(0.1, 0.1), (0.3, 0.3), (1.0, 1.0), (0.1, 0.4), (0.9, 0.2)])
@pytest.mark.parametrize("distribution", [GGX(), BeckmannRational()], ids=["ggx", "beckmann"])
def test_distribution_and_masking_agree_with_mitsuba(
    mitsuba: ModuleType, distribution: AbstractDistribution, alpha: tuple[float, float]
) -> None:
    """D within five widths of the normal, and G1; Mitsuba's Beckmann G1 is Walter's approximation."""
    kind = mitsuba.MicrofacetType.GGX if isinstance(distribution, GGX) else mitsuba.MicrofacetType.Beckmann
    theirs = mitsuba.MicrofacetDistribution(kind, *alpha)
    rng = np.random.default_rng(4)
    theta = np.arctan(np.minimum(min(alpha) * rng.uniform(0, 5, 2000), 50))
    h = _normals(theta, rng.uniform(0, 2 * np.pi, 2000)).astype(np.float32)
    exact = h / np.linalg.norm(np.float64(h), axis=1)[:, None]
    d = np.array([theirs.eval(row) for row in h])
    g1 = np.array([theirs.smith_g1(row, [0, 0, 1]) for row in h])
    masked = np.asarray(jax.vmap(distribution.masked_cos, (0, None))(jnp.array(exact), _slopes(alpha)))
    np.testing.assert_allclose(_density(distribution, alpha, exact), d, rtol=MITSUBA)
    np.testing.assert_allclose(exact[:, 2] / masked, g1, rtol=MITSUBA)


@pytest.mark.parametrize("alpha", [0.05, 0.3, 1.0])
def test_walters_approximation_of_beckmanns_masking(alpha: float) -> None:
    """Within the 0.35 % that the paper states, and not equal."""
    w = jnp.array(_normals(np.deg2rad(np.linspace(0.5, 89.5, 500)), 0.0))
    exact, rational = (
        np.asarray(jax.vmap(d.masked_cos, (0, None))(w, _slopes(alpha))) for d in (Beckmann(), BeckmannRational())
    )
    error = np.abs(exact / rational - 1)
    assert 1e-4 < error.max() < WALTER


@pytest.mark.parametrize(
    "roughness", [Isotropic(jnp.array(0.2)), Anisotropic(jnp.array(0.1), jnp.array(0.4), jnp.array(30.0))]
)
def test_slopes_are_meant_along_the_tangent(roughness: AbstractRoughness) -> None:
    """A tangent at azimuth 30° is the local x axis; the normal stays."""
    tangent, normal = jnp.array([np.cos(np.pi / 6), 0.5, 0.0]), jnp.array([0.0, 0.0, 1.0])
    expected = tangent if roughness.isotropic else jnp.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(roughness.local(tangent), expected, atol=EXACT)
    np.testing.assert_allclose(roughness.local(normal), normal, atol=EXACT)
    assert roughness.width() == min(roughness.slopes)


def _smith(distribution: AbstractDistribution, cos: float, alpha: float) -> float:
    """Λ as Heitz 2014 prints it, a = 1/(alpha tan θ)."""
    a = cos / (alpha * np.sqrt(1 - cos**2))
    if isinstance(distribution, GGX):
        return (-1 + np.sqrt(1 + 1 / a**2)) / 2
    return -erfc(a) / 2 + np.exp(-(a**2)) / (2 * a * np.sqrt(np.pi))


@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.0])
@DISTRIBUTIONS
def test_masking_as_the_papers_print_it(distribution: AbstractDistribution, alpha: float) -> None:
    """From Λ (Heitz 2014; separable: Walter 2007, eq. 23) and from V grooves (Cook & Torrance 1982)."""
    for wi, wo in [
        ((0.3, 0.4), (-0.6, 0.2)),
        ((0.0, 0.9), (0.3, -0.7)),
        ((0.9, 0.1), (0.2, 0.0)),
        ((0.1, 0.0), (0.2, 0.1)),
    ]:
        one, two = (np.array([*w, np.sqrt(1 - w[0] ** 2 - w[1] ** 2)]) for w in (wi, wo))
        h = (one + two) / np.linalg.norm(one + two)
        ci, co, ch, cd = one[2], two[2], h[2], one @ h
        li, lo = _smith(distribution, ci, alpha), _smith(distribution, co, alpha)
        printed: dict[Masking, float] = {
            "correlated": 1 / (1 + li + lo),
            "separable": 1 / ((1 + li) * (1 + lo)),
            "v-cavity": min(1, 2 * ch * ci / cd, 2 * ch * co / cd),
        }
        assert tuple(printed) == MASKINGS
        for masking, g in printed.items():
            ours = visibility(distribution, masking, _slopes(alpha), pair(jnp.array(one), jnp.array(two)))
            np.testing.assert_allclose(ours, g / (ci * co), rtol=EXACT, err_msg=masking)


@pytest.mark.parametrize("masking", ["correlated", "separable", "v-cavity"])
@DISTRIBUTIONS
def test_finite_on_the_closed_hemisphere(
    distribution: AbstractDistribution, masking: Masking, singular: dict[str, tuple[np.ndarray, np.ndarray]]
) -> None:
    """D G/(c_i c_o) and its gradients in alpha, ω_i and ω_o, at both bounds of alpha."""

    def product(alpha: jax.Array, wi: jax.Array, wo: jax.Array) -> jax.Array:
        slopes, both = (alpha, 0.5 * alpha), pair(wi, wo)
        return distribution.density(both.h, slopes) * visibility(distribution, masking, slopes, both)

    wi, wo = (np.array(column) for column in zip(*singular.values(), strict=True))
    value, slopes = mapped(jax.value_and_grad(product, argnums=(0, 1, 2)), [np.array([1e-4, 1.0])], [wi, wo])
    assert np.all(value >= 0)
    for found in (value, *slopes):
        broken = ~np.isfinite(found).reshape(2, len(singular), -1).all(axis=2)
        assert not broken.any(), [(list(singular)[k], row) for row, k in np.argwhere(broken)]
