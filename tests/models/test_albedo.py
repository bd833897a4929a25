"""Directional albedo against closed forms and against an average over Heitz's visible normals."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from oracles import ggx
from selection import always

import fitmat as fm
from fitmat.maths.quadrature import cosine_mean, curve, incidence, incidence_rule, lobe_rule
from fitmat.models.albedo import albedo
from fitmat.models.base import AbstractBRDF

NARROW = 1e-3
"""Relative, the accuracy that `albedo` claims, for lobes down to alpha = 0.002 and 80°."""

WIDE = 1e-3
"""Relative; the same for wide lobes, where the rule over half vectors meets the edge of the horizon."""


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


@pytest.mark.parametrize("alpha", always({0.001, 0.05, 0.3, 1.0}, [0.001, 0.01, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0]))
def test_the_stated_error_bounds_the_error(alpha: float) -> None:
    """Against the average over visible normals at 17 angles, up to 88°."""
    theta = np.deg2rad(np.r_[0.0, 10:86:5, 88.0])
    found = albedo(fm.model("ggx", alpha=alpha, eta=1.5), theta)
    error = np.abs(found.value[:, 0] - [ggx.albedo(angle, alpha, 1.5) for angle in theta])
    assert np.all(error < found.error[:, 0])
    assert found.error.max() < 1e-3


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
        rule = lobe_rule(jnp.array(0.6), jnp.array(width))
        assert rule.weight @ rule.wo[:, 2] ** power == pytest.approx(2 * np.pi / (power + 2), rel=WIDE)
        np.testing.assert_allclose(jnp.linalg.norm(rule.wo, axis=1), 1.0)


def test_the_rule_over_incidence() -> None:
    """∫ g(θ) c dω for g = 1 and sin²θ: π and π/2, by hand."""
    theta, weight = incidence_rule()
    assert weight.sum() == pytest.approx(np.pi)
    assert weight @ np.sin(theta) ** 2 == pytest.approx(np.pi / 2)
    np.testing.assert_allclose(incidence(jnp.array(0.3)), [np.sin(0.3), 0.0, np.cos(0.3)])
