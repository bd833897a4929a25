"""Calibration by simulation: the tests of uniformity against exact sums, and planted faults that must be found."""

import dataclasses
import itertools
from typing import Any

import numpy as np
import pytest
from arviz_stats.ecdf_utils import ecdf_pit
from scipy import stats

import fitmat as fm
from fitmat.errors import FitmatError, ModelError
from fitmat.judgement import calibration
from fitmat.judgement.calibration import RANKED_DRAWS, Calibration, calibrate, coverage_limits, join
from fitmat.judgement.multiplicity import adjusted_for_many
from fitmat.judgement.uniformity import SETS, band, p_values

PRIORS: dict[str, Any] = {"kd": (0.5, 0.1), "discrepancy": (0.0, 0.005)}
SIMULATIONS = 60

MONTE_CARLO = 4.0 * 0.5 / np.sqrt(SETS)
"""Four standard errors, at most √(¼/n) each, of a p-value from `SETS` sets."""

SIDES = ("less", "greater")

CLEARLY = 1e-3
"""p below which a planted fault counts as found; by chance in one of 300 runs of three quantities."""


def exact_p(counts: tuple[int, ...]) -> float:
    """P(the smallest pointwise two-sided probability is as small), by summing over all sets of ranks."""
    bins, n = len(counts), sum(counts)

    def smallest(counts: tuple[int, ...]) -> float:
        below, z = np.cumsum(counts)[:-1], np.arange(1, bins) / bins
        return float(
            min(stats.binomtest(int(k), n, p, side).pvalue for k, p in zip(below, z, strict=True) for side in SIDES)
        )

    observed = smallest(counts)
    sets = (other for other in itertools.product(range(n + 1), repeat=bins) if sum(other) == n)
    as_far = [other for other in sets if smallest(other) <= observed * (1 + 1e-12)]
    return float(np.sum([stats.multinomial.pmf(other, n, np.full(bins, 1 / bins)) for other in as_far]))


@pytest.mark.parametrize("counts", [(3, 0), (5, 1), (4, 0, 0), (1, 2, 1), (0, 4, 1), (0, 1, 2, 2)])
def test_p_values_are_those_of_the_sum_over_all_sets(counts: tuple[int, ...]) -> None:
    ranks = np.repeat(np.arange(len(counts)), counts)[:, None]
    assert p_values(ranks, len(counts) - 1) == pytest.approx([exact_p(counts)], abs=MONTE_CARLO)


def test_the_band_is_that_of_arviz() -> None:
    """Another program's simulation of the same band: limits differ by one rank at most."""
    uniform = (np.arange(100) + 0.5) / 100
    z, _, lower, upper = ecdf_pit(uniform, 0.95, 4000, rng=np.random.default_rng(1))
    ours, limits = band(100, 99, 0.95)
    inside = (z > 0.0) & (z < 1.0)  # some versions add both ends
    np.testing.assert_allclose(ours, z[inside])
    np.testing.assert_allclose(limits, [lower[inside], upper[inside]], atol=0.01 + 1e-9)
    assert band(100, 99, 0.99)[1][1].mean() > limits[1].mean()


def test_uniform_ranks_leave_their_band_as_often_as_it_says() -> None:
    """Of 2,000 sets of uniform ranks 5 % ± 1.5 %, three standard errors."""
    ranks = np.random.default_rng(5).integers(0, RANKED_DRAWS + 1, size=(200, 2000))
    z, limits = band(200, RANKED_DRAWS, 0.95)
    below = np.array([np.mean(ranks < (k + 1), axis=0) for k in range(len(z))])
    outside = ((below < limits[0][:, None] - 1e-12) | (below > limits[1][:, None] + 1e-12)).any(axis=0)
    assert outside.mean() == pytest.approx(0.05, abs=0.015)
    assert np.mean(p_values(ranks, RANKED_DRAWS) <= 0.05) == pytest.approx(0.05, abs=0.015)


def test_holm_by_hand() -> None:
    """Holm (1979): 0.01 ≤ 0.05/4, 0.013 ≤ 0.05/3, 0.03 > 0.05/2, after which nothing more falls."""
    assert adjusted_for_many(np.array([0.03, 0.01, 0.04, 0.013])) == pytest.approx([0.06, 0.04, 0.06, 0.04])
    assert adjusted_for_many(np.array([0.2, 0.9])) == pytest.approx([0.4, 0.9])
    assert adjusted_for_many(np.array([1e-4, 1e-3])) == pytest.approx([2e-4, 1e-3])


def test_limits_of_a_coverage_by_closed_form() -> None:
    """Clopper & Pearson (1934): where all of n hit, the lower limit is 0.025^(1/n)."""
    assert coverage_limits(30, 30) == pytest.approx((0.025 ** (1 / 30), 1.0))
    assert coverage_limits(30, 0) == pytest.approx((0.0, 1 - 0.025 ** (1 / 30)))


def lambert(told: float = 1.0, **changes: Any) -> Calibration:
    plane = fm.from_arrays(0.3, np.linspace(-1.2, 1.2, 17), np.ones(17))
    given: dict[str, Any] = {"simulations": SIMULATIONS, "seed": 3, "told": told, "priors": PRIORS} | changes
    return calibrate("lambert", plane, (0.1, 1e-3), **given)


@pytest.fixture(scope="module")
def right() -> Calibration:
    return lambert()


def test_a_right_program_is_calibrated(right: Calibration) -> None:
    assert right.quantities == ("kd", "discrepancy", "log-likelihood")
    assert right.ranks.shape == (SIMULATIONS, 3)
    assert right.faults() == ()
    for level, covered in zip((0.5, 0.68, 0.95), right.covered[right.trusted].sum(axis=0), strict=True):
        for hits in covered:
            assert stats.binomtest(int(hits), int(right.trusted.sum()), level).pvalue > CLEARLY
    assert right.words.startswith("lambert, laplace: the intervals are as sure as they say")


def test_too_little_noise_told_is_found_as_too_much_discrepancy() -> None:
    """Fits that are told half of the noise there was: the truth of s lies low among its draws."""
    wrong = lambert(0.5)
    assert "discrepancy" in wrong.faults()
    assert wrong.p_values().min() < CLEARLY
    assert np.median(wrong.ranks[wrong.trusted, 1]) < RANKED_DRAWS / 4
    assert wrong.words.startswith("lambert, laplace: NOT calibrated: the posterior is wrong in ")


@pytest.mark.study
@pytest.mark.parametrize("given", [True, False])
def test_intervals_hold_as_people_fit(given: bool) -> None:
    """Default priors, σ given or estimated: what is quoted holds 95 truths in 100; small `benchmarks/as_fitted.py`."""
    rng, angles = np.random.default_rng(4), np.deg2rad(np.arange(-80.0, 81.0, 5.0))
    at = fm.from_arrays(np.deg2rad(45.0), np.abs(angles), np.ones(33), phi=np.where(angles >= 0, np.pi, 0.0))
    held = []
    for _ in range(250):
        truth = rng.uniform([0.1, 0.1, 10.0], [0.5, 0.5, 50.0])
        surface = fm.model("lambert+blinn-phong", **dict(zip(("kd", "ks", "exponent"), truth, strict=True)))
        exact = fm.evaluate(surface, at.wi, at.wo)
        sigma = np.hypot(0.02 * exact, 1e-3)
        measured = dataclasses.replace(at, value=exact + sigma * rng.normal(size=exact.shape))
        told = dataclasses.replace(measured, sigma=sigma if given else None)
        quoted = fm.laplace(fm.fit(told, surface.name), seed=1).quantities()[:3]
        held.append([q.ci95[0, 0] <= x <= q.ci95[0, 1] for q, x in zip(quoted, truth, strict=True)])
    for hits in np.sum(held, axis=0):
        low, high = coverage_limits(len(held), int(hits))
        assert stats.binomtest(int(hits), len(held), 0.95).pvalue > CLEARLY
        assert low < 0.98
        assert high > 0.92


@pytest.mark.study
def test_too_much_noise_told_is_found_as_too_wide_intervals() -> None:
    """Fits that are told half as much noise again as there was: Gaussian intervals of 68 % cover 86 %."""
    wrong = lambert(1.5)
    assert wrong.p_values().min() < CLEARLY
    assert wrong.faults()
    assert wrong.coverage()[1, 0] == pytest.approx(0.864, abs=3 * np.sqrt(0.864 * 0.136 / SIMULATIONS))


def test_chains_are_ranked_as_well() -> None:
    seen: list[tuple[int, int]] = []
    few = lambert(simulations=2, method="emcee", progress=lambda what, done, of: seen.append((done, of)))
    assert few.method == "emcee"
    assert few.trusted.all()
    assert ((few.ranks >= 0) & (few.ranks <= RANKED_DRAWS)).all()
    assert seen == [(1, 2), (2, 2)]


def test_calibrations_are_joined(right: Calibration) -> None:
    twice = join([right, right])
    assert twice.ranks.shape == (2 * SIMULATIONS, 3)
    np.testing.assert_array_equal(twice.coverage(), right.coverage())


def test_what_cannot_be_drawn_is_refused() -> None:
    with pytest.raises(ModelError, match="cannot draw from a flat prior of discrepancy"):
        lambert(priors={"kd": (0.5, 0.1)})


def test_a_fit_without_an_end_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    class Lost:
        finite, result = False, "nonfinite"

    monkeypatch.setattr(calibration, "fit", lambda *_, **__: Lost())
    with pytest.raises(FitmatError, match=r"simulation 0 of lambert: the fit ended nonfinite\."):
        lambert()
