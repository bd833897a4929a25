"""Directional albedo against closed forms and against an average over Heitz's visible normals."""

import jax.numpy as jnp
import numpy as np
import pytest
from oracles import ggx

import fitmat as fm
from fitmat.brdf import AbstractBRDF
from fitmat.energy import directional_albedo, hemispherical_albedo
from fitmat.quadrature import cosine_mean, curve, incidence, incidence_rule, lobe_rule

NARROW = 1e-3
"""Relative, the accuracy that `directional_albedo` claims, for lobes down to alpha = 0.002 and 80°."""

WIDE = 1e-3
"""Relative; the same for wide lobes, where the rule over half vectors meets the edge of the horizon."""


def albedo(model: AbstractBRDF, *degrees: float) -> np.ndarray:
    return directional_albedo(model, np.deg2rad(degrees)).value[:, 0]


def test_lambert_reflects_kd_at_every_angle() -> None:
    np.testing.assert_allclose(albedo(fm.model("lambert", kd=0.7), 0.0, 30.0, 60.0, 80.0), 0.7, rtol=WIDE)


@pytest.mark.parametrize("exponent", [1.0, 10.0, 1000.0, 1e5])
@pytest.mark.parametrize("name", ["phong", "blinn-phong-exact"])
def test_normalised_lobes_reflect_ks_at_normal_incidence(name: str, exponent: float) -> None:
    """Lafortune & Willems 1994; Giesen 2009."""
    assert albedo(fm.model(name, ks=0.4, exponent=exponent), 0.0) == pytest.approx(0.4, rel=WIDE)


@pytest.mark.parametrize("n", [4.0, 50.0])
def test_the_course_normalisation_misses_one_as_computed_by_hand(n: float) -> None:
    """(n+8)/(8π) over Giesen's (n+2)(n+4)/(8π(2^(−n/2) + n)); 1.0625 at n = 4."""
    by_hand = (n + 8) * (2 ** (-n / 2) + n) / ((n + 2) * (n + 4))
    assert albedo(fm.model("blinn-phong", ks=1.0, exponent=n), 0.0) == pytest.approx(by_hand, rel=WIDE)
    assert n > 4 or by_hand == pytest.approx(1.0625)


@pytest.mark.parametrize("alpha", [0.002, 0.02, 0.3])
def test_ggx_against_visible_normals(alpha: float) -> None:
    degrees = (0.0, 20.0, 40.0, 60.0, 70.0, 80.0)
    expected = [ggx.albedo(np.deg2rad(angle), alpha, 1.5) for angle in degrees]
    np.testing.assert_allclose(albedo(fm.model("ggx", alpha=alpha, eta=1.5), *degrees), expected, rtol=NARROW)


def test_a_mirror_reflects_fresnels_share() -> None:
    """At alpha → 0 the albedo is F(θ_i)."""
    degrees = np.array([0.0, 30.0, 60.0, 80.0])
    expected = ggx.fresnel(np.cos(np.deg2rad(degrees)), 1.5)
    np.testing.assert_allclose(albedo(fm.model("ggx", alpha=1e-4, eta=1.5), *degrees), expected, rtol=NARROW)


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
