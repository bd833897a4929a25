"""Distances and ablation: Lambert surfaces by hand, lobes by brute force in numpy, terms by the published formulas."""

from typing import Any

import numpy as np
import pytest
from oracles import ggx
from scipy.integrate import dblquad, quad

import fitmat as fm
from fitmat.match.ablation import TERMS, Ablation, CosinePower, ablate, ablated
from fitmat.match.distances import ANGLES, METRICS, Distances, measure_distances
from fitmat.match.regions import REGIONS
from fitmat.models.base import AbstractBRDF, Sum
from fitmat.models.lobes.lambert import Lambert
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.parameters import vector
from fitmat.models.terms.distributions import GGX, Isotropic
from fitmat.models.terms.fresnel import White
from fitmat.uncertainty.estimate import Estimate

EXACT = 1e-9
"""Relative; where both models are constant over ω_o the quadrature cancels or is Gauss's for a polynomial."""

SMOOTH = 2e-3
"""Relative; the rules' error for smooth functions, and for cos^(2/3), whose slope is infinite at grazing."""

FEWER = 5e-3
"""Relative; the ablation's rule has a third of the nodes."""

EDGE = 0.03
"""Relative; the edge of a region, or of Ngan's 80°, runs between the nodes over ω_o."""

SPREAD = 0.05
"""Widths of the interval; a hundred draws put its ends no nearer than 0.07."""

FIRST, SECOND = 0.25 / np.pi, 0.2 / np.pi
"""The values of the two Lambert surfaces, in sr⁻¹."""


def rows(*models: AbstractBRDF) -> np.ndarray:
    return np.stack([np.asarray(vector(m)) for m in models])


def blinn(**values: Any) -> AbstractBRDF:
    return fm.model("lambert+blinn-phong", channels=1, **values)


def facets(**values: Any) -> AbstractBRDF:
    return fm.model("lambert+ggx", channels=1, **values)


def measured(
    one: list[AbstractBRDF], other: list[AbstractBRDF], incidences: tuple[float, ...] = (0.0, 45.0, 90.0)
) -> Distances:
    """Best fit and draws of both."""
    return measure_distances(one[0], other[0], (rows(*one), rows(*other)), np.deg2rad(incidences))


@pytest.fixture(scope="module")
def grey() -> Distances:
    """Lobes of weight 0; three models each: one best fit and two draws."""
    one = [blinn(kd=kd, ks=0.0, exponent=30.0) for kd in (0.25, 0.24, 0.30)]
    return measured(one, [facets(kd=0.2, ks=0.0, alpha=0.3)] * 3)


@pytest.fixture(scope="module")
def lobes() -> Distances:
    one, other = blinn(kd=0.2, ks=0.05, exponent=10.0), facets(kd=0.2, ks=1.0, alpha=0.4, eta=1.5)
    return measured([one] * 3, [other] * 3)


def test_every_distance_of_two_lambert_surfaces_is_known(grey: Distances) -> None:
    """Means over solid angle are integrals over both cosines from 0 to 1; Löw's have 2/π in front."""
    limit, apart = np.cos(np.deg2rad(80.0)), FIRST - SECOND

    def ratio(co: float, ci: float) -> float:
        kappa = max(ci * co, 1e-3)
        return np.log((FIRST * kappa + 1e-3) / (SECOND * kappa + 1e-3)) ** 2

    logs = quad(lambda c: (np.log1p(FIRST * c) - np.log1p(SECOND * c)) ** 2, 0, 1)[0]
    expected = {
        "relative": (0.25, EXACT),
        "ngan": (apart * np.sqrt((1 - limit**3) / (3 * (1 - limit))), SMOOTH),
        "low-e1": (2 / np.pi * apart**2 / 3, SMOOTH),
        "low-e2": (2 / np.pi * logs, SMOOTH),
        "cube-root": ((np.cbrt(FIRST) - np.cbrt(SECOND)) * np.sqrt(0.6), SMOOTH),
        "log-ratio": (np.sqrt(dblquad(ratio, 0, 1, 0, 1, epsabs=1e-8)[0]), SMOOTH),
        "albedo": (0.05, SMOOTH),
    }
    assert list(expected) == list(METRICS)
    for name, (value, tolerance) in expected.items():
        assert grey.whole[name].value == pytest.approx(value, rel=tolerance), name


def test_distances_at_one_incidence_are_known(grey: Distances) -> None:
    """Löw's weight sinθ_i, and the light as a fraction of what arrives from there."""
    cos, sin = np.cos(grey.theta_i), np.sin(grey.theta_i)
    assert grey.by_incidence["relative"][1] == pytest.approx(np.full(18, 0.25), rel=EXACT)
    assert grey.by_incidence["low-e1"][1] == pytest.approx(sin * ((FIRST - SECOND) * cos) ** 2, rel=EXACT)
    assert grey.by_incidence["cube-root"][1] == pytest.approx((np.cbrt(FIRST) - np.cbrt(SECOND)) * np.cbrt(cos))
    assert grey.by_incidence["albedo"][1] == pytest.approx(np.full(18, 0.05), rel=SMOOTH)
    assert np.isnan(grey.by_incidence["ngan"][1, grey.theta_i > np.deg2rad(80)]).all()
    assert grey.grazing_excess.value == pytest.approx(0.25, rel=EXACT)


def test_draws_give_the_interval(grey: Distances) -> None:
    """Draws of 0.24 and 0.30 beside 0.2: distances 0.2 and 0.5, whose quantiles lie between."""
    assert grey.whole["relative"].ci95 == pytest.approx((0.2 + 0.025 * 0.3, 0.2 + 0.975 * 0.3))
    assert grey.by_incidence["relative"][[0, 2], 4] == pytest.approx([0.2075, 0.4925])


def test_what_is_extrapolated_is_known_to_a_factor() -> None:
    """Beside two Lambert surfaces, of which sin²θ₂ − sin²θ₁ of the squared difference lies between θ₁ and θ₂."""
    kd = 0.25 + 1e-9 * np.arange(300)  # draws that spread, if hardly
    found = measured([blinn(kd=k, ks=0.0, exponent=30.0) for k in kd], [facets(kd=0.2, ks=0.0)] * 300, (40.0, 50.0))
    factors = np.abs(1.0 + 0.5 * np.random.default_rng(9).normal(size=(100_000, 2)))
    below, above = np.sin(np.deg2rad(37.5)) ** 2, np.cos(np.deg2rad(52.5)) ** 2
    expected = 0.25 * np.sqrt(1.0 - below - above + factors**2 @ [below, above])
    assert found.whole["relative"].value == pytest.approx(0.25, rel=1e-6)
    assert found.whole["relative"].ci95 == pytest.approx(np.quantile(expected, [0.025, 0.975]), rel=0.1)
    at_10, at_45 = found.by_incidence["relative"][[0, 2]][:, [2, 9]].T
    assert at_10 == pytest.approx(0.25 * np.quantile(factors, [0.025, 0.975]), abs=0.04)
    assert at_45 == pytest.approx([0.25, 0.25], rel=1e-5)


def test_the_spread_of_draws_needs_fewer_nodes_than_the_best_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    """The ends of every interval, by the coarse rule and by the rule of the best fits, in widths of the interval."""
    rng = np.random.default_rng(1)
    one = [blinn(kd=0.2, ks=0.05 * u, exponent=40.0 * v) for u, v in np.exp(0.15 * rng.normal(size=(60, 2)))]
    other = [facets(kd=0.2 * u, ks=v, alpha=0.2, eta=1.5) for u, v in np.exp(0.05 * rng.normal(size=(60, 2)))]
    coarse = measured(one, other)
    monkeypatch.setattr("fitmat.match.distances.COARSE", (64, 32))
    fine = measured(one, other)
    for name, exact in fine.whole.items():
        near = coarse.whole[name]
        assert near.value == pytest.approx(exact.value, rel=EXACT)
        assert np.abs(np.subtract(near.ci95, exact.ci95)).max() < SPREAD * np.ptp(exact.ci95), name


def test_shares_of_the_regions_are_those_of_their_light(grey: Distances) -> None:
    """Both directions are within 70° for (sin² 70°)² of the light that a Lambert surface reflects."""
    within = np.sin(np.deg2rad(70.0)) ** 4
    assert grey.share["albedo"]["grazing"].value == pytest.approx(1 - within, rel=EDGE)
    assert grey.by_region["albedo"]["grazing"].value == pytest.approx(0.05 * (1 - within), rel=EDGE)
    for region in REGIONS:
        assert grey.by_region["relative"][region].value == pytest.approx(0.25, rel=EXACT)
    assert sum(share.value for share in grey.share["relative"].values()) == pytest.approx(1.0)


def test_lobes_differ_by_region_as_by_brute_force(lobes: Distances) -> None:
    """Both formulas again in numpy, on midpoint grids; the regions by the angles of the directions."""
    count = 90
    theta, phi = (np.arange(count) + 0.5) * np.pi / 2 / count, (np.arange(count) + 0.5) * np.pi / count
    ti, to, azimuth = np.meshgrid(theta, theta, phi, indexing="ij")
    wi, wo = ggx.hemisphere(ti, 0.0), ggx.hemisphere(to, azimuth)
    h = (wi + wo) / np.linalg.norm(wi + wo, axis=-1, keepdims=True)
    second = 0.2 / np.pi + ggx.brdf(wi, wo, 0.4, 1.5)
    apart = 0.2 / np.pi + 0.05 * 18 / (8 * np.pi) * h[..., 2] ** 10 - second
    weight = np.sin(ti) * np.sin(to) * np.cos(ti) * np.cos(to)
    slope, grazing = np.tan(np.arccos(h[..., 2])), np.maximum(ti, to) > np.deg2rad(70)
    inside = {
        "core": ~grazing & (slope <= 0.4),
        "tail": ~grazing & (slope > 0.4) & (slope <= 2.0),
        "grazing": grazing,
        "diffuse": ~grazing & (slope > 2.0),
    }
    whole = np.sum(weight * apart**2)
    for region, mask in inside.items():
        top, bottom = (np.sum(weight * mask * x**2) for x in (apart, second))
        assert lobes.by_region["relative"][region].value == pytest.approx(np.sqrt(top / bottom), rel=EDGE), region
        assert lobes.share["relative"][region].value == pytest.approx(top / whole, rel=2 * EDGE, abs=1e-4), region
    light = np.sum(weight * np.abs(apart)) * 2 * (np.pi / 2 / count) ** 2 * (np.pi / count) * 2 * np.pi / np.pi
    assert lobes.whole["albedo"].value == pytest.approx(light, rel=5e-3)


def ablation(one: AbstractBRDF, other: AbstractBRDF) -> Ablation:
    found = ablate(one, other, (np.tile(rows(one), (2, 1)), np.tile(rows(other), (2, 1))))
    assert found is not None
    return found


def test_without_all_three_terms_ggx_is_blinn_phong() -> None:
    """F0 (n+2)/(8π) c_hⁿ with n = 2/α² − 2 = 48: ks = F0 (n+2)/(n+8), and no distance is left."""
    facet = facets(kd=0.1, ks=1.0, alpha=0.2, eta=1.5)
    found = ablation(blinn(kd=0.1, ks=0.04 * 50 / 56, exponent=48.0), facet)
    assert found.fall["all"][1] == pytest.approx(np.ones(18), abs=EXACT)
    assert found.near["all"].value == pytest.approx(1.0, abs=EXACT)
    assert "fresnel" in found.causes(found.grazing)
    assert "all" not in found.causes(found.grazing)


def test_a_constant_fresnel_term_explains_nothing() -> None:
    """F = 1 at every angle."""
    white = Sum((Lambert(0.1), Microfacet(0.5, Isotropic(0.2), White())))  # type: ignore[arg-type]
    found = ablation(blinn(kd=0.1, ks=0.3, exponent=48.0), white)
    assert np.abs(found.fall["fresnel"]).max() < EXACT
    assert "fresnel" not in found.causes(found.grazing)


def test_distances_of_the_ablation_are_those_by_incidence(lobes: Distances) -> None:
    found = ablation(blinn(kd=0.2, ks=0.05, exponent=10.0), facets(kd=0.2, ks=1.0, alpha=0.4, eta=1.5))
    assert found.distance[1] == pytest.approx(lobes.by_incidence["relative"][1], rel=FEWER)
    assert found.theta_i is ANGLES


@pytest.mark.parametrize("name", ["ggx", "walter-ggx"])
@pytest.mark.parametrize("term", [term for term in TERMS if term != "all"])
def test_each_term_is_replaced_as_published(name: str, term: str) -> None:
    """F by F0 = 0.04; G/(c_i c_o) by 1; GGX by Walter's D = (n+2)/(2π) c_hⁿ with the same peak."""
    rng = np.random.default_rng(3)
    wi, wo = (ggx.hemisphere(*angles) for angles in rng.uniform([[0.1], [0.0]], [[1.2], [3.0]], (2, 2, 40)))
    h = (wi + wo) / np.linalg.norm(wi + wo, axis=-1, keepdims=True)
    cos_d, c_h = np.sum(wi * h, axis=-1), h[..., 2]
    alpha, n = 0.3, 2 / 0.3**2 - 2
    d = alpha**2 / (np.pi * c_h**4 * (alpha**2 + (1 - c_h**2) / c_h**2) ** 2)
    a, b = ggx.smith(wi, alpha), ggx.smith(wo, alpha)
    g = 1 / (1 + a + b) if name == "ggx" else 1 / (1 + a) / (1 + b)
    f, v = ggx.fresnel(cos_d, 1.5), g / (wi[..., 2] * wo[..., 2])
    expected = {"fresnel": 0.04 * d * v, "masking": f * d, "tail": f * v * (n + 2) / (2 * np.pi) * c_h**n}[term] / 4
    found = fm.evaluate(ablated(fm.model(name, alpha=alpha, eta=1.5), term), wi, wo)[:, 0]
    assert found == pytest.approx(expected, rel=1e-6)  # smith() cancels at small angles


def test_cook_torrance_loses_its_terms_as_well() -> None:
    """π D' where Walter has 4 D: four times F0 (n+2)/(8π) c_hⁿ is left."""
    up = np.array([[0.0, 0.0, 1.0]])
    bare = ablated(fm.model("cook-torrance", alpha=0.2, eta=1.5), "all")
    assert fm.evaluate(bare, up, up)[0, 0] == pytest.approx(4 * 0.04 * 50 / (8 * np.pi))


def test_the_cosine_power_is_normalised_where_anisotropic() -> None:
    """∫ D c_h dω_h = 1 for slopes 0.2 and 0.5, by midpoints."""
    theta, phi = np.meshgrid((np.arange(400) + 0.5) * np.pi / 800, (np.arange(400) + 0.5) * np.pi / 200)
    h = ggx.hemisphere(theta, phi)
    density = np.asarray(CosinePower(GGX()).density(np.moveaxis(h, -1, 0), (0.2, 0.5)))  # type: ignore[arg-type]
    cell = np.pi / 800 * np.pi / 200
    assert np.sum(density * np.cos(theta) * np.sin(theta)) * cell == pytest.approx(1.0, rel=1e-4)


def test_models_without_separate_terms_are_left_alone() -> None:
    whole = fm.model("plastic", kd=0.4, alpha=0.1, eta=1.5)
    assert ablated(whole, "all") is whole
    assert ablate(blinn(kd=0.1, ks=0.1, exponent=9.0), whole, (np.zeros((2, 3)), np.zeros((2, 4)))) is None


def test_causes_are_certain_and_large() -> None:
    found = ablation(blinn(kd=0.1, ks=0.05, exponent=48.0), facets(kd=0.1, ks=1.0, alpha=0.2, eta=1.5))
    where = {
        "fresnel": Estimate(0.4, (0.3, 0.5)),
        "masking": Estimate(0.6, (-0.1, 0.7)),  # not certain
        "tail": Estimate(0.1, (0.05, 0.15)),  # little
        "all": Estimate(0.9, (0.8, 1.0)),
    }
    assert found.causes(where) == ("fresnel",)
