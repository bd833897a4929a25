"""Laplace corrected by importance weights: against integrals of the density, closed forms, and where it must refuse."""

import dataclasses
import time
from typing import Any

import numpy as np
import pytest
from scipy import integrate, stats

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.fitting import fitting
from fitmat.fitting.result import Fit
from fitmat.measurements.noise import Noise, measured_noise
from fitmat.uncertainty import laplace as room
from fitmat.uncertainty.density import log_posterior
from fitmat.uncertainty.diagnostics import GOOD_PARETO, VERDICTS
from fitmat.uncertainty.laplace import LAPLACE_DRAWS, MOST_CORRECTED, PROPOSALS, heavy_tailed, laplace_each, smoothed
from fitmat.uncertainty.posterior import Posterior

EFFECTIVE = 1000
"""2000 draws from 4000 proposals of which about half count are worth at least so many independent ones."""

ERRORS = 3.0
"""A quantile may be off by so many of its standard errors √(p(1 − p)/n)/density; five are compared, seeds are fixed."""

TAIL = 0.2
"""Two standard errors (1 + k)/√424 of the k̂ of 20,000 weights, of which 424 make the tail."""

PROBABILITIES = (0.025, 0.25, 0.5, 0.75, 0.975)


def lambert(kd: float, relative: float, count: int = 31) -> fm.Measurements:
    """A Lambert surface seen at 0 to 70° with relative noise."""
    theta = np.linspace(0.0, 1.2, count)
    value = kd / np.pi * (1 + relative * np.random.default_rng(3).normal(size=count))
    return fm.from_arrays(theta, 0.3, value, sigma=np.full(count, relative * kd / np.pi))


@pytest.fixture(scope="module")
def held() -> Fit:
    """Nothing but s is free: a posterior in one dimension, far from Gaussian."""
    return fm.fit(lambert(0.3, 0.03), "lambert", fixed={"kd": 0.3})


@pytest.fixture(scope="module")
def near_bound() -> Fit:
    """Albedo 0.98 ± 0.02, cut off at 1."""
    return fm.fit(lambert(0.98, 0.1), "lambert")


def centres(low: float, high: float, count: int) -> np.ndarray:
    """Of `count` cells between two ends."""
    return low + (np.arange(count) + 0.5) * (high - low) / count


def errors(drawn: np.ndarray, grid: np.ndarray, density: np.ndarray) -> np.ndarray:
    """How far quantiles of draws are from those of a density in even cells, in Monte Carlo standard errors."""
    p, step = np.array(PROBABILITIES), grid[1] - grid[0]
    share = density / density.sum()
    exact = np.interp(p, np.append(0.0, np.cumsum(share)), np.append(grid, grid[-1] + step) - step / 2)
    height = np.interp(exact, grid, share / step)
    return np.abs(np.quantile(drawn, p) - exact) / (np.sqrt(p * (1 - p) / EFFECTIVE) / height)


def test_few_readings_of_unknown_noise_have_students_interval() -> None:
    """∛f of a Lambert surface at one incidence is a mean: SciPy's t with 4 degrees of freedom, carried over to kd."""
    value = 0.4 / np.pi * (1.0 + 0.02 * np.random.default_rng(3).normal(size=5))
    fit = fm.fit(fm.from_arrays(np.full(5, 0.5), np.array([-1.2, -0.6, 0.1, 0.7, 1.2]), value), "lambert")
    assert not fit.noise.known
    root = np.cbrt(value)
    half = 3.0 * np.pi * root.mean() ** 2 * stats.t.ppf(0.975, 4) * root.std(ddof=1) / np.sqrt(5.0)
    assert np.ptp(fit["kd"].ci95) / 2.0 == pytest.approx(half, rel=1e-3)  # second order of the root
    draws = fm.laplace(fit, seed=1, corrected=False).values
    assert 1.96 * draws.std() == pytest.approx(half, rel=0.05)  # 2000 draws


def test_the_corrected_discrepancy_follows_its_integral(held: Fit) -> None:
    """The likelihood of s from its definition, z(y) − z(f) = ∫ dt/(a + 3 s |t|^(2/3)), by scipy's quadrature."""
    m = held.measurements
    assert m.sigma is not None
    kappa = np.cos(m.theta_i)
    y, f, a = m.value[:, 0] * kappa, 0.3 / np.pi * kappa, m.sigma[:, 0] * kappa
    corrected, plain = (fm.laplace(held, seed=1, corrected=c) for c in (True, False))
    s_grid = centres(0.0, 1.5 * plain.discrepancy.max(), 300)

    def log_likelihood(s: float) -> float:
        z = [
            integrate.quad(lambda t, noise=noise: 1 / (noise + 3 * s * abs(t) ** (2 / 3)), low, high)[0]
            for low, high, noise in zip(f, y, a, strict=True)
        ]
        return float(-0.5 * np.sum(np.square(z)) - np.sum(np.log(a + 3 * s * np.abs(y) ** (2 / 3))))

    logs = np.array([log_likelihood(s) for s in s_grid])
    assert corrected.verdict == "corrected"
    assert errors(corrected.discrepancy, s_grid, np.exp(logs - logs.max())).max() < ERRORS


def test_the_corrected_draws_end_at_a_bound_as_the_density_does(near_bound: Fit) -> None:
    """The density over albedo and s, summed over a grid."""
    corrected, plain = (fm.laplace(near_bound, seed=1, corrected=c) for c in (True, False))
    kd, s = centres(0.9, 1.0, 80), centres(0.0, 1.5 * plain.discrepancy.max(), 200)
    points = np.stack(np.meshgrid(kd, s, indexing="ij"), axis=-1).reshape(-1, 2)
    logs = log_posterior(near_bound)(points).reshape(80, 200)
    density = np.exp(logs - logs.max())
    assert corrected.verdict == "corrected"
    assert corrected.values.shape == (LAPLACE_DRAWS, 1)
    assert corrected.values.max() <= 1.0
    assert errors(corrected.values[:, 0], kd, density.sum(axis=1)).max() < ERRORS
    assert errors(corrected.discrepancy, s, density.sum(axis=0)).max() < ERRORS
    assert errors(plain.values[:, 0], kd, density.sum(axis=1)).max() > ERRORS  # the correction is of consequence


def test_the_proposal_is_a_folded_multivariate_t(near_bound: Fit) -> None:
    around = heavy_tailed(near_bound)
    x = around.drawn(200, np.random.default_rng(1))
    exact: Any = stats.multivariate_t
    exact = exact(around.centre, around.factor @ around.factor.T, df=6)
    both = np.log(exact.pdf(x) + exact.pdf(x * [1, -1]))
    difference = around.log_density(x) - both
    np.testing.assert_allclose(
        difference, difference[0], atol=1e-6
    )  # the ridge of the factor, 1e-12, in whitened units
    inside = around.drawn_inside(500, np.random.default_rng(1))
    assert len(inside) == 500
    assert inside[:, 0].max() <= 1.0


@pytest.mark.parametrize("rate", [0.5, 0.1])
def test_the_tail_of_the_weights_has_its_exact_shape(rate: float) -> None:
    """Exp(rate) by draws of Exp(1): P(w > t) falls like t^(−1/(1 − rate)), so that k = 1 − rate."""
    x = np.random.default_rng(2).exponential(size=20_000)
    weight, k = smoothed((1.0 - rate) * x)
    assert k == pytest.approx(1.0 - rate, abs=TAIL)
    assert weight.sum() == pytest.approx(1.0)
    if k < GOOD_PARETO:
        assert np.sum(weight * x) == pytest.approx(1.0 / rate, rel=0.1)  # the mean of what is aimed at


def test_a_gaussian_that_misses_the_posterior_is_said_to_be_approximate(near_bound: Fit) -> None:
    narrow = dataclasses.replace(near_bound, information=1e6 * near_bound.information)
    found = fm.laplace(narrow, seed=1)
    assert found.verdict == "approximate"
    assert found.usable
    assert not found.exact
    assert found.pareto_k is not None
    assert found.pareto_k > GOOD_PARETO
    assert "Sample it" in VERDICTS[found.verdict]
    np.testing.assert_array_equal(found.values, fm.laplace(narrow, seed=1, corrected=False).values)


def test_a_heavy_tail_of_the_weights_forbids_the_correction(near_bound: Fit, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many effective draws there seem to be."""
    monkeypatch.setattr("fitmat.uncertainty.laplace.smoothed", lambda logs: (np.full(len(logs), 1 / len(logs)), 0.71))
    found = fm.laplace(near_bound, seed=1)
    assert (found.verdict, found.pareto_k) == ("approximate", 0.71)


def test_few_effective_draws_forbid_the_correction(near_bound: Fit, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the shape of their tail; the file `laplace-few-effective-draws.csv` ended here without a report."""
    weight = np.r_[1.0, np.zeros(PROPOSALS[1] - 1)]
    monkeypatch.setattr("fitmat.uncertainty.laplace.smoothed", lambda logs: (weight[: len(logs)], np.float64(0.1)))
    found = fm.laplace(near_bound, seed=1)
    assert (found.verdict, type(found.pareto_k)) == ("approximate", float)


def test_what_cannot_or_need_not_be_corrected_stays_gaussian(near_bound: Fit) -> None:
    large = dataclasses.replace(near_bound, n_values=MOST_CORRECTED + 1)
    for posterior in (fm.laplace(large, seed=1), fm.laplace(near_bound, seed=1, corrected=False)):
        assert posterior.verdict == "not sampled"
        assert posterior.pareto_k is None
    lost = dataclasses.replace(near_bound, log_likelihood=np.nan)
    assert fm.laplace(lost, seed=1).verdict == "unusable"


def test_the_seed_is_the_correction(near_bound: Fit) -> None:
    one, again, other = (fm.laplace(near_bound, seed=seed).values for seed in (5, 5, 6))
    np.testing.assert_array_equal(one, again)
    assert not np.array_equal(one, other)


def test_reported_intervals_come_from_corrected_draws(near_bound: Fit) -> None:
    corrected, plain = (fm.laplace(near_bound, seed=1, corrected=c) for c in (True, False))
    np.testing.assert_allclose(corrected.quantities()[0].ci95, corrected.interval())
    assert plain.quantities()[0].sd == pytest.approx(np.sqrt(near_bound.covariance[0, 0]))
    doubtful: Posterior = dataclasses.replace(corrected, pareto_k=0.8)
    np.testing.assert_allclose(doubtful.quantities()[0].ci95, plain.quantities()[0].ci95)


def test_the_noise_of_a_file_is_looked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is the same for every model."""
    monkeypatch.setattr(fitting, "fitted", lambda measurements, noise, name: noise)
    monkeypatch.setattr(room, "laplace", lambda fit, **_: fit)
    m = dataclasses.replace(lambert(0.5, 0.02), sigma=None)
    found: list[Any] = laplace_each(m, {"phong": {}, "ggx": {}}, seed=0)
    assert found[0] is found[1]
    np.testing.assert_array_equal(found[0].sigma, measured_noise(m).sigma)


@pytest.mark.parametrize("slow", ["phong", "ggx"])
def test_of_several_refusals_the_same_one_is_named(monkeypatch: pytest.MonkeyPatch, slow: str) -> None:
    """Whichever thread ends first."""

    def refused(measurements: fm.Measurements, noise: Noise, name: str) -> None:
        time.sleep(0.2 * (name == slow))
        raise FitmatError(name)

    monkeypatch.setattr(fitting, "fitted", refused)
    with pytest.raises(FitmatError, match=r"^ggx$"):
        laplace_each(lambert(0.5, 0.02), {"phong": {}, "ggx": {}}, seed=0)
