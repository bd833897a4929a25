"""Directional albedo against closed forms and against an average over Heitz's visible normals."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from oracles import ggx
from selection import TRIED, always

import fitmat as fm
from fitmat.maths.directions import from_angles as directions
from fitmat.maths.quadrature import cosine_mean, curve, incidence, incidence_rule, lobe_rule
from fitmat.models import laws, values
from fitmat.models.albedo import albedo
from fitmat.models.base import AbstractBRDF

NARROW = 1e-3
"""Relative, the accuracy that `albedo` claims, for lobes down to alpha = 0.002 and 80°."""

WIDE = 1e-3
"""Relative; the same for wide lobes."""

SMOOTH = 1e-8
"""Relative; lobes without creases: the rule ends where the horizon is."""

CREASED = {"eon": {"kd": 1.0, "r": 1.0}, "oren-nayar-full": {"kd": 1.0, "sigma_n": 60.0}, "cook-torrance": {}}
"""Lobes with a crease where Δφ = 90°, θ_o = θ_i or two masks meet, with parameters that show it."""

SEVEN = (0.0, 20.0, 40.0, 60.0, 75.0, 85.0, 89.0)


def from_angles(model: AbstractBRDF, *degrees: float) -> np.ndarray:
    return albedo(model, np.deg2rad(degrees)).value[:, 0]


def test_lambert_reflects_kd_at_every_angle() -> None:
    np.testing.assert_allclose(from_angles(fm.model("lambert", kd=0.7), 0.0, 30.0, 60.0, 80.0), 0.7, rtol=WIDE)


@pytest.mark.parametrize("exponent", [1.0, 10.0, 1000.0, 1e5])
@pytest.mark.parametrize("name", ["phong", "blinn-phong-exact"])
def test_normalised_lobes_reflect_ks_at_normal_incidence(name: str, exponent: float) -> None:
    """Lafortune & Willems 1994; Giesen 2009."""
    assert from_angles(fm.model(name, ks=0.4, exponent=exponent), 0.0) == pytest.approx(0.4, rel=WIDE)


@pytest.mark.parametrize("n", [4.0, 50.0])
def test_the_course_normalisation_misses_one_as_computed_by_hand(n: float) -> None:
    """(n+8)/(8π) over Giesen's (n+2)(n+4)/(8π(2^(−n/2) + n)); 1.0625 at n = 4."""
    by_hand = (n + 8) * (2 ** (-n / 2) + n) / ((n + 2) * (n + 4))
    assert from_angles(fm.model("blinn-phong", ks=1.0, exponent=n), 0.0) == pytest.approx(by_hand, rel=WIDE)
    assert n > 4 or by_hand == pytest.approx(1.0625)


@pytest.mark.parametrize("alpha", [0.002, 0.02, 0.3])
def test_ggx_against_visible_normals(alpha: float) -> None:
    degrees = (0.0, 20.0, 40.0, 60.0, 70.0, 80.0)
    expected = [ggx.albedo(np.deg2rad(angle), alpha, 1.5) for angle in degrees]
    np.testing.assert_allclose(from_angles(fm.model("ggx", alpha=alpha, eta=1.5), *degrees), expected, rtol=NARROW)


@pytest.mark.parametrize("alpha", always({0.001, 0.3}, [0.001, 0.01, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0]))
def test_the_stated_error_bounds_the_error(alpha: float) -> None:
    """Against the average over visible normals at 17 angles, up to 88°."""
    theta = np.deg2rad(np.r_[0.0, 10:86:5, 88.0])
    found = albedo(fm.model("ggx", alpha=alpha, eta=1.5), theta)
    error = np.abs(found.value[:, 0] - [ggx.albedo(angle, alpha, 1.5) for angle in theta])
    assert np.all(error < found.error[:, 0])
    assert found.error.max() < 1e-3


def _panels(lower: float, upper: float, at: float, finest: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss–Legendre in panels that halve towards both ends and towards a place, from which creases start."""
    steps = [(upper - lower) / 2**k for k in range(1, 60) if (upper - lower) / 2**k > finest]
    ends = [at, *(place + sign * step for place in (lower, at, upper) for sign in (-1, 1) for step in steps)]
    edges = np.unique(np.clip([lower, *ends, upper], lower, upper))
    x, weights = np.polynomial.legendre.leggauss(count)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (x + 1)).ravel(), (half * weights).ravel()


def _over_zenith_and_azimuth(model: AbstractBRDF, degrees: float, count: int = 6) -> np.ndarray:
    """∫ f c_o dω_o in θ_o and φ, with panels that meet where θ_o = θ_i and where Δφ is 0°, 90° and 180°.

    It shares neither its variables nor its nodes with `albedo`, but the program of the values; for lobes no narrower
    than 0.1.
    """
    theta_i = np.deg2rad(degrees)
    theta, d_theta = _panels(0, np.pi / 2, theta_i, 0.005, count)
    ahead, d_ahead = _panels(0, np.pi, np.pi / 2, 0.001, count)
    phi, d_phi = np.r_[ahead, ahead + np.pi], np.r_[d_ahead, d_ahead]
    zenith, azimuth = (part.ravel() for part in np.meshgrid(theta, phi, indexing="ij"))
    weight = np.outer(d_theta * np.sin(theta) * np.cos(theta), d_phi).ravel()
    wi = np.tile([np.sin(theta_i), 0.0, np.cos(theta_i)], (len(weight), 1))
    return weight @ values.at(model, wi, directions(zenith, azimuth))


def _within_bounds(model: AbstractBRDF, degrees: tuple[float, ...]) -> None:
    found = albedo(model, np.deg2rad(degrees))
    expected = np.array([_over_zenith_and_azimuth(model, angle) for angle in degrees])
    assert np.all(np.abs(found.value - expected) < found.error), np.abs(found.value - expected) / found.error
    assert np.all(found.error <= 1e-3 * np.maximum(found.value, 1.0))


@pytest.mark.parametrize("name", CREASED)
def test_the_stated_error_bounds_that_of_creased_lobes(name: str) -> None:
    _within_bounds(fm.model(name, **CREASED[name]), (60.0, 85.0))


@pytest.mark.study
@pytest.mark.parametrize("name", TRIED)
def test_the_stated_error_bounds_that_of_every_lobe(name: str) -> None:
    _within_bounds(fm.model(laws.examples(name)[0], **CREASED.get(name, {})), SEVEN)


@pytest.mark.parametrize("phi", [0.0, 45.0, 90.0])
def test_the_stated_error_bounds_that_of_a_brushed_surface(phi: float) -> None:
    """Against visible normals; a streak of 0.01 by 1 near grazing."""
    theta, turn = np.deg2rad(85.0), np.deg2rad(phi)
    found = albedo(fm.model("ggx-aniso", alpha_x=0.01, alpha_y=1.0, eta=1.5), np.array([theta]), turn)
    expected = ggx.albedo(theta, (0.01, 1.0), 1.5, 700, turn)
    assert abs(found.value[0, 0] - expected) < found.error[0, 0] <= 1e-3


def test_smooth_lobes_are_integrated_to_the_horizon() -> None:
    """Lambert reflects kd; GGX what it does with twice the nodes in other variables."""
    np.testing.assert_allclose(from_angles(fm.model("lambert", kd=0.7), *SEVEN), 0.7, rtol=SMOOTH)
    rough = fm.model("ggx", alpha=0.5)
    assert from_angles(rough, 60.0)[0] == pytest.approx(_over_zenith_and_azimuth(rough, 60.0, 10)[0], rel=SMOOTH)


def test_evenly_lit_a_mirror_of_glass_reflects_judds_fraction() -> None:
    """D. B. Judd, J. Res. NBS 29, 1942, table 2: 0.0918 of diffuse light for η = 1.5; a hemisphere of kd gives kd."""
    assert albedo(fm.model("lambert", kd=0.3)).value[0, 0] == pytest.approx(0.3, rel=NARROW)
    glass = albedo(fm.model("ggx", alpha=1e-3, eta=1.5))
    assert glass.value[0, 0] == pytest.approx(0.0918, abs=5e-4)


def test_a_brushed_surface_is_darker_along_one_azimuth() -> None:
    """Turning sample and light together changes nothing; equal slopes are the isotropic lobe."""
    theta = np.full(3, np.deg2rad(70.0))
    brushed: dict[str, Any] = {"alpha_x": 0.1, "alpha_y": 0.5}
    level = albedo(fm.model("ggx-aniso", **brushed), theta, np.deg2rad([0.0, 45.0, 90.0])).value[:, 0]
    turned = albedo(fm.model("ggx-aniso", **brushed, rotation=30.0), theta, np.deg2rad([30.0, 75.0, 120.0]))
    np.testing.assert_allclose(turned.value[:, 0], level, rtol=NARROW)
    assert abs(level[0] / level[2] - 1) > 0.1
    equal = albedo(fm.model("ggx-aniso", alpha_x=0.3, alpha_y=0.3), theta, 1.0).value[:, 0]
    np.testing.assert_allclose(equal, [ggx.albedo(t, 0.3, 1.5) for t in theta], rtol=NARROW)


@pytest.mark.parametrize("power", [1.0, 2.0, 3.5])
def test_curves_and_their_means(power: float) -> None:
    """c^p at any cosine, and 2∫ c^p c dc = 2/(p+2)."""
    cos = jnp.linspace(0.0, 1.0, 50)
    tabulated = curve(lambda c: c**power)
    np.testing.assert_allclose([tabulated(c) for c in cos], cos**power, atol=2e-8)
    assert cosine_mean(lambda c: c**power) == pytest.approx(2 / (power + 2))


def test_a_mirror_reflects_fresnels_share() -> None:
    """At alpha → 0 the albedo is F(θ_i)."""
    degrees = np.array([0.0, 30.0, 60.0, 80.0])
    expected = ggx.fresnel(np.cos(np.deg2rad(degrees)), 1.5)
    np.testing.assert_allclose(from_angles(fm.model("ggx", alpha=1e-4, eta=1.5), *degrees), expected, rtol=NARROW)


@pytest.mark.parametrize("power", [0, 1, 4])
def test_the_rule_integrates_cosines(power: int) -> None:
    """∫ c_oᵏ c_o dω_o = 2π/(k+2), for any width of the rule."""
    for width in (0.01, 0.3, 1.0):
        rule = lobe_rule(0.6, width)
        assert rule.weight @ rule.wo[:, 2] ** power == pytest.approx(2 * np.pi / (power + 2), rel=WIDE)
        np.testing.assert_allclose(jnp.linalg.norm(rule.wo, axis=1), 1.0)


def test_the_rule_over_incidence() -> None:
    """∫ g(θ) c dω for g = 1 and sin²θ: π and π/2, by hand."""
    theta, weight = incidence_rule()
    assert weight.sum() == pytest.approx(np.pi)
    assert weight @ np.sin(theta) ** 2 == pytest.approx(np.pi / 2)
    np.testing.assert_allclose(incidence(jnp.array(0.3)), [np.sin(0.3), 0.0, np.cos(0.3)])
