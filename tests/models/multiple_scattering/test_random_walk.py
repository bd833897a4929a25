"""Multiple scattering against Heitz's own program, closed forms and conservation laws."""

from collections.abc import Callable
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles.multiscatter import REFLECTED, SHARES, VALUES, Value
from scipy.special import erf
from selection import always

from fitmat.errors import FitmatError, ModelError
from fitmat.maths.directions import from_angles
from fitmat.maths.quadrature import lobe_rule
from fitmat.models.base import evaluate
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.multiple_scattering import paths
from fitmat.models.multiple_scattering.paths import MonteCarlo
from fitmat.models.multiple_scattering.position_free import Depths, Flight, evaluate_slab, fly
from fitmat.models.multiple_scattering.random_walk import albedo_walk, evaluate_walk
from fitmat.models.multiple_scattering.surface import (
    Surface,
    _beckmann_slopes,
    dot,
    flown,
    refraction_phase,
    visible_normal,
)
from fitmat.models.terms.distributions import GGX, AbstractDistribution, Anisotropic, Beckmann, BeckmannRational
from fitmat.models.terms.fresnel import AbstractFresnel, Conductor, Dielectric, White, conductor, dielectric

SIGMAS = 4.0
"""Standard errors that two estimates may be apart: about 400 comparisons here, of which 0.03 pass it by chance."""

HEITZ = 1e-3
"""Relative; what Heitz's program approximates (see the oracle), on top of its standard error."""

QUADRATURE = 2e-3
"""Absolute; 48 × 24 nodes over the outgoing hemisphere, worst for alpha = 0.1 at 85°."""

INVERTED = 1e-6
"""Absolute, in the distribution function; a thousandth of what the Monte Carlo tests can see."""

LATER_ORDERS = 1e-4
"""Half of (1 − the four recorded shares), times 2⁻⁴."""

GRID = 5e-3
"""Relative; midpoints of 400 × 400 cells over the sphere; the lobe ends abruptly at the critical angle."""

EXACT = 1e-12
"""Relative; the same formula written twice in double precision."""

GOLD = (0.16, 3.5)
"""η and κ of gold in the red, rounded (Johnson & Christy 1972)."""

GLASS = Dielectric(eta=jnp.array(1.5))

SAMPLES = 40_000
"""Paths per pair; the same in most tests, so that these share their compiled programs."""

Estimator = Callable[..., MonteCarlo]
DISTRIBUTIONS: dict[str, AbstractDistribution] = {"ggx": GGX(), "beckmann": Beckmann()}
BOTH = pytest.mark.parametrize("distribution", DISTRIBUTIONS.values(), ids=DISTRIBUTIONS.keys())
ESTIMATORS = pytest.mark.parametrize("estimator", [evaluate_walk, evaluate_slab], ids=["walk", "slab"])

PAIRS = [(10, 30, 180), (45, 45, 180), (60, 20, 90), (75, 75, 180), (75, 60, 40)]
"""theta_i, theta_o, phi in degrees, as in the oracle."""


def _directions(pairs: list[tuple[int, int, int]]) -> tuple[np.ndarray, np.ndarray]:
    theta_i, theta_o, phi = np.deg2rad(np.array(pairs, float)).T
    start = np.deg2rad(20.0)
    return from_angles(theta_i, np.full_like(phi, start)), from_angles(theta_o, start + phi)


WI, WO = _directions(PAIRS)


def _agree(one: MonteCarlo, other: MonteCarlo, where: object = "") -> None:
    apart = np.abs(one.value - other.value)
    allowed = SIGMAS * np.hypot(one.standard_error, other.standard_error) + EXACT * np.abs(other.value)
    assert (apart <= allowed).all(), (where, one, other)


class Mirrors(AbstractFresnel):
    """Three channels: all of the light, half of it at any angle, and gold's red."""

    suffix: ClassVar[str] = "-mirrors"

    def __call__(self, cos_d: jax.Array) -> jax.Array:
        """1, 1/2, F."""
        return jnp.stack(
            [jnp.ones_like(cos_d), jnp.full_like(cos_d, 0.5), conductor(cos_d, jnp.array(GOLD[0]), jnp.array(GOLD[1]))]
        )

    def normal_reflectance(self) -> jax.Array:
        """The same along the normal."""
        return self(jnp.ones(()))


def _against_heitz(found: MonteCarlo, channel: int, rows: list[Value]) -> None:
    """All rows are of one surface; angles that are not listed were too faint to record."""
    assert rows
    for row in rows:
        k, scale = PAIRS.index((int(row.theta_i), int(row.theta_o), int(row.phi))), 0.5 ** (channel * row.order)
        error = np.hypot(found.standard_error[k, channel], scale * row.standard_error)
        assert abs(found.value[k, channel] - scale * row.value) <= SIGMAS * error + HEITZ * scale * row.value, row


def _surfaces(order: int, *, dielectric: bool) -> list[tuple[Surface, list[Value]]]:
    """What the oracle has of that order, gathered by surface."""
    rows: dict[tuple[str, float, float], list[Value]] = {}
    for row in VALUES:
        if row.order == order and (row.eta > 0) == dielectric:
            rows.setdefault((row.distribution, row.alpha_x, row.alpha_y), []).append(row)
    fresnel = GLASS if dielectric else Mirrors()
    return [(Surface(DISTRIBUTIONS[d], (ax, ay), fresnel, dielectric), same) for (d, ax, ay), same in rows.items()]


@pytest.mark.study
@pytest.mark.parametrize(
    ("estimator", "order"),
    [
        pytest.param(one, order, marks=() if one is evaluate_walk and order is None else pytest.mark.study)
        for one in (evaluate_walk, evaluate_slab)
        for order in (None, 2, 3)
    ],
)
def test_white_mirrors_agree_with_heitzs_program(estimator: Estimator, order: int | None) -> None:
    """GGX and Beckmann, alpha 0.5 and 1, and GGX with alpha 0.2 across 0.7; the sum of all orders and single ones.

    A mirror that reflects half of the light at any angle scales order k of the white one by 2⁻ᵏ.
    """
    surfaces = _surfaces(order or 0, dielectric=False)
    assert len(surfaces) == 5
    for surface, rows in surfaces:
        found = estimator(surface, WI, WO, samples=SAMPLES, seed=3, order=order)
        _against_heitz(found, 0, rows)
        if order:
            _against_heitz(found, 1, rows)


@pytest.mark.study
def test_dielectrics_agree_with_heitzs_program() -> None:
    """Reflected BRDF, light that went through facets and came back included, and albedo; GGX 0.5, Beckmann 0.8."""
    surfaces = _surfaces(0, dielectric=True)
    assert len(surfaces) == 2
    for surface, rows in surfaces:
        _against_heitz(evaluate_walk(surface, WI, WO, samples=SAMPLES, seed=3), 0, rows)
        theirs = [row for row in REFLECTED if row.distribution == rows[0].distribution]
        wi = from_angles(np.deg2rad([row.theta_i for row in theirs]), np.full(len(theirs), np.deg2rad(20.0)))
        ours = albedo_walk(surface, wi, samples=SAMPLES, seed=5).reflected
        error = np.hypot(ours.standard_error[:, 0], [row.standard_error for row in theirs])
        assert (np.abs(ours.value[:, 0] - [row.value for row in theirs]) <= SIGMAS * error).all()


@pytest.mark.parametrize("distribution", [GGX(), pytest.param(Beckmann(), marks=pytest.mark.study)])
def test_first_order_is_the_height_correlated_microfacet_lobe(distribution: AbstractDistribution) -> None:
    """Slab: exactly; walk: within its standard error. The lobe itself is tested against Mitsuba 3 elsewhere."""
    for slopes in [(0.5, 0.5), (0.2, 0.7)]:
        lobe = evaluate(
            Microfacet(
                jnp.ones(()),
                Anisotropic(jnp.array(slopes[0]), jnp.array(slopes[1]), rotation=jnp.zeros(())),
                Mirrors(),
                distribution,
            ),
            WI,
            WO,
        )
        surface = Surface(distribution, slopes, Mirrors())
        exact = evaluate_slab(surface, WI, WO, samples=2, seed=0, order=1)
        np.testing.assert_allclose(exact.value, lobe, rtol=EXACT)
        assert not exact.standard_error.any()
        _agree(evaluate_walk(surface, WI, WO, samples=SAMPLES, seed=1, order=1), exact)


@pytest.mark.study
@BOTH
def test_white_furnace(distribution: AbstractDistribution) -> None:
    """∫ f c_o dω_o = 1 for F = 1: values to ω_o, integrated by a rule that knows nothing of paths.

    Of the estimator with the smaller standard errors; that the walk has the same mean is tested below.
    """
    for alpha, theta in [(0.1, 0.0), (0.1, 85.0), (0.5, 50.0), (1.0, 85.0)]:
        rule = lobe_rule(np.deg2rad(theta), alpha, nodes=(48, 24))
        weight = np.asarray(rule.weight)
        wo = np.where(np.asarray(rule.wo)[:, 2:] > 0, rule.wo, [0.0, 0.0, 1.0])
        wi = np.tile(np.asarray(rule.wi), (len(wo), 1))
        found = evaluate_slab(Surface(distribution, (alpha, alpha), White()), wi, wo, samples=32, seed=9)
        error = np.linalg.norm(weight * found.standard_error[:, 0])
        albedo = weight @ found.value[:, 0]
        assert abs(albedo - 1) <= SIGMAS * error + QUADRATURE, (alpha, theta, albedo, error)


@pytest.mark.study
@BOTH
def test_nothing_is_lost_where_nothing_is_absorbed(distribution: AbstractDistribution) -> None:
    """Dielectric: reflected and transmitted light add up to 1, from the normal to 85°."""
    wi = from_angles(np.deg2rad([0.0, 50.0, 85.0]), np.zeros(3))
    for alpha in (0.1, 1.0):
        surface = Surface(distribution, (alpha, alpha), GLASS, transmits=True)
        glass = albedo_walk(surface, wi, samples=SAMPLES, seed=1)
        total = glass.reflected.value[:, 0] + glass.transmitted.value[:, 0] + glass.reflected.omitted
        np.testing.assert_allclose(total, 1, rtol=EXACT)
        assert (glass.reflected.omitted < 1e-3).all()


def test_a_white_mirror_reflects_all_light() -> None:
    """And one that reflects half of it at any angle Σ 2⁻ᵏ p_k, p_k Heitz's shares of light that meets k facets."""
    wi = from_angles(np.deg2rad([45.0]), np.deg2rad([20.0]))
    found = albedo_walk(Surface(GGX(), (0.5, 0.5), Mirrors()), wi, samples=SAMPLES, seed=1)
    assert found.reflected.value[0, 0] == pytest.approx(1, rel=EXACT)
    assert not found.transmitted.value.any()
    grey = sum(share * 0.5**k for k, share in enumerate(SHARES, start=1))
    assert abs(found.reflected.value[0, 1] - grey) <= SIGMAS * found.reflected.standard_error[0, 1] + LATER_ORDERS


@pytest.mark.parametrize("kind", always({"walk, glass"}, ["walk, gold", "slab, gold", "walk, glass"]))
def test_reciprocal(kind: str) -> None:
    estimator = evaluate_slab if "slab" in kind else evaluate_walk
    glass = "glass" in kind
    surface = Surface(GGX(), (0.4, 0.9), GLASS if glass else Mirrors(), transmits=glass)
    there = estimator(surface, WI, WO, samples=SAMPLES, seed=1)
    back = estimator(surface, WO, WI, samples=SAMPLES, seed=2)
    _agree(there, back, kind)


@pytest.mark.study
@BOTH
def test_without_depths_the_mean_is_the_walks(distribution: AbstractDistribution) -> None:
    """White, grey and gold, smooth and rough; and the standard error is smaller."""
    for alpha in (0.2, 1.0):
        surface = Surface(distribution, (alpha, alpha), Mirrors())
        walked = evaluate_walk(surface, WI, WO, samples=SAMPLES, seed=11)
        exact = evaluate_slab(surface, WI, WO, samples=SAMPLES, seed=12)
        _agree(walked, exact, alpha)
        assert np.median(exact.standard_error / np.maximum(walked.standard_error, 1e-300)) < 0.75


@pytest.mark.study
def test_standard_errors_are_the_scatter_of_independent_runs() -> None:
    """8 seeds: their variance against the squares of the stated errors, averaged over pairs and channels."""
    surface = Surface(GGX(), (0.5, 0.5), Mirrors())
    for estimator in (evaluate_walk, evaluate_slab):
        runs = [estimator(surface, WI, WO, samples=SAMPLES, seed=seed) for seed in range(8)]
        stated = np.mean([run.standard_error**2 for run in runs], axis=0)
        ratio = np.var([run.value for run in runs], axis=0, ddof=1) / stated
        assert 0.5 < ratio.mean() < 1.8


def test_visible_slopes_of_beckmann_follow_their_distribution() -> None:
    """Scipy's erf in the distribution function, light from above and from below the horizon."""
    angles, shares = np.deg2rad([0.1, 30, 60, 89, 91, 110, 140]), np.linspace(1e-6, 1 - 1e-6, 501)
    theta, u = (a.ravel() for a in np.meshgrid(angles, shares))
    sin, cos = np.sin(theta), np.cos(theta)
    x = np.asarray(_beckmann_slopes(jnp.array(sin), jnp.array(cos), (jnp.array(u), jnp.array(u)))[0])

    def area(x: np.ndarray) -> np.ndarray:
        return 0.5 * cos * (1 + erf(x)) + sin * np.exp(-(x**2)) / (2 * np.sqrt(np.pi))

    np.testing.assert_allclose(area(x) / area(cos / sin), u, atol=INVERTED)


def test_depths_are_the_integrals_over_exponentials() -> None:
    """Down, down, up, down with partial fractions as a computer algebra system prints them, also for equal rates."""
    shape, out = (1, 2), jnp.array([[0.7, 0.7]])
    first, second = np.array([1.3, 1.5]), np.array([2.1, 1.5])
    up, last = np.array([0.4, 0.4]), np.array([1.8, 1.5])
    empty = jnp.zeros((4, *shape))
    rates, shares = empty.at[0].set(first), empty.at[0].set(1.0)
    depths = Depths(rates, shares, jnp.ones(shape, int))

    def on(rate: np.ndarray, *, leaves: bool) -> Flight:
        return Flight(jnp.full(shape, leaves), jnp.array(rate)[None])

    depths, total, reach, reach_up = fly(depths, on(second, leaves=False), on(up, leaves=True), out)
    np.testing.assert_allclose(total, 1, rtol=EXACT)
    np.testing.assert_allclose(reach[0], first / (first + 0.7) * second / (second + 0.7), rtol=EXACT)
    np.testing.assert_allclose(reach_up[0], up / (up + first) * first / (first + 0.7), rtol=EXACT)
    depths, total, reach, _ = fly(depths, on(up, leaves=True), on(up, leaves=True), out)
    escape = first * second / ((up + first) * (up + second))  # E[exp(−s t)] of the depth t
    np.testing.assert_allclose(total[0], 1 - escape, rtol=EXACT)
    # ∫∫ e₂(t') s exp(−s(t'−t)) exp(−0.7t) over 0 < t < t' = s/(s−0.7) (L(0.7) − L(s)), L the transform of e₂.
    transform = first / (first + 0.7) * second / (second + 0.7)
    left = up / (up - 0.7) * (transform - escape)
    np.testing.assert_allclose(reach[0], left, rtol=EXACT)
    *_, reach, _ = fly(depths, on(last, leaves=False), on(up, leaves=True), out)
    np.testing.assert_allclose(reach[0], left * last / (last + 0.7), rtol=EXACT)


@pytest.mark.study
@ESTIMATORS
def test_cut_paths_are_counted(estimator: Estimator, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two collisions at most: the value is the sum of two orders, and the energy missing in it is stated."""
    surface = Surface(GGX(), (1.0, 1.0), Mirrors())
    orders = [estimator(surface, WI, WO, samples=SAMPLES, seed=k, order=k) for k in (1, 2)]
    monkeypatch.setattr(paths, "MOST_BOUNCES", 2)
    found = estimator(surface, WI, WO, samples=SAMPLES, seed=3)
    error = np.linalg.norm([found.standard_error, *[part.standard_error for part in orders]], axis=0)
    assert (np.abs(found.value - orders[0].value - orders[1].value) <= SIGMAS * error).all()
    # Heitz's program, 4·10⁶ paths: 1 − (0.37653 + 0.33309) of the light from 45° meets three facets or more.
    assert found.omitted[1] == pytest.approx(0.29038, abs=0.02)


@pytest.mark.study
def test_runs_repeat_and_seeds_differ() -> None:
    surface = Surface(GGX(), (0.5, 0.5), Mirrors())
    for estimator in (evaluate_walk, evaluate_slab):
        one, same, other = (estimator(surface, WI, WO, samples=SAMPLES, seed=seed).value for seed in (1, 1, 2))
        np.testing.assert_array_equal(one, same)
        assert (one != other).all()


@ESTIMATORS
def test_wrong_input_is_refused(estimator: Estimator) -> None:
    surface = Surface(GGX(), (0.5, 0.5), White())
    with pytest.raises(ModelError, match=r"shapes \(5, 3\) and \(4, 3\)"):
        estimator(surface, WI, WO[:4], samples=10, seed=0)
    with pytest.raises(ModelError, match=r"wo row 1 is .* expected a unit vector above the surface"):
        estimator(surface, WI, WO * np.array([[1], [-1], [1], [1], [1]]), samples=10, seed=0)
    with pytest.raises(FitmatError, match=r"samples is 1, expected a whole number of at least 2\."):
        estimator(surface, WI, WO, samples=1, seed=0)
    with pytest.raises(ModelError, match="order = 257: expected 1 to 256"):
        estimator(surface, WI, WO, samples=10, seed=0, order=257)


def test_surfaces_that_cannot_be_walked_are_refused() -> None:
    with pytest.raises(ModelError, match="distribution BeckmannRational: multiple scattering needs GGX or Beckmann"):
        Surface(BeckmannRational(), (0.5, 0.5), White())
    for slopes in [(0.5, 3.0), (0.5, float("nan")), (0.5, 0.5, 0.5)]:
        with pytest.raises(ModelError, match=r"expected \(alpha_x, alpha_y\), each from 0.0001 to 2"):
            Surface(GGX(), slopes, White())
    with pytest.raises(ModelError, match="needs fresnel = Dielectric with one eta"):
        Surface(GGX(), (0.5, 0.5), Conductor(), transmits=True)
    glass = Surface(GGX(), (0.5, 0.5), GLASS, transmits=True)
    with pytest.raises(ModelError, match=r"the surface transmits.* take evaluate_walk"):
        evaluate_slab(glass, WI, WO, samples=10, seed=0)


@BOTH
def test_facets_refract_what_they_do_not_reflect(distribution: AbstractDistribution) -> None:
    """∫ of the refraction phase function over all directions = 1 − F, averaged over visible facets; both sides."""
    surface = Surface(distribution, (0.5, 0.5), GLASS, transmits=True)
    cos, azimuth = (np.arange(400) + 0.5) / 400 * 2 - 1, (np.arange(400) + 0.5) * 2 * np.pi / 400
    wo = jnp.array(from_angles(*(a.ravel() for a in np.meshgrid(np.arccos(cos), azimuth))).T)
    u = [jnp.array(a.ravel()) for a in np.meshgrid(*[(np.arange(400) + 0.5) / 400] * 2)]
    for eta in (1.5, 1 / 1.5):
        w = jnp.broadcast_to(jnp.array(WI[2])[:, None], wo.shape)
        total = 4 * np.pi * float(refraction_phase(surface, w, wo, jnp.array(eta)).mean())
        normals = visible_normal(surface, w, (u[0], u[1]))
        expected = 1 - float(dielectric(jnp.clip(dot(w, normals), 0, 1), jnp.array(eta)).mean())
        assert total == pytest.approx(expected, rel=GRID)


def test_flights_end_as_the_extinction_says() -> None:
    """Downwards after 1/(1 + Λ) on average; upwards exp(−Λ t) of them leave. Λ is Heitz's for GGX, as printed."""
    surface = Surface(GGX(), (0.7, 0.7), White())
    up = np.deg2rad(60.0)
    smith = (np.sqrt(1 + 0.7**2 * np.tan(up) ** 2) - 1) / 2
    u = jnp.array((np.arange(100_000) + 0.5) / 100_000)
    w = jnp.broadcast_to(jnp.array([np.sin(up), 0.0, np.cos(up)])[:, None], (3, u.size))
    assert float(flown(surface, -w, jnp.array(0.8), u).mean()) == pytest.approx(0.8 + 1 / (1 + smith), rel=1e-4)
    assert float((flown(surface, w, jnp.array(0.8), u) <= 0).mean()) == pytest.approx(np.exp(-0.8 * smith), rel=1e-4)
