"""Pareto-smoothed weights and leave-one-out densities against arviz_stats and closed forms."""

import subprocess
import sys

import numpy as np
import pytest
from arviz_stats.base.array import array_stats
from scipy import stats

from fitmat.uncertainty import pareto
from fitmat.uncertainty.mixing import split_rhat
from fitmat.uncertainty.pareto import FEWEST_IN_TAIL, leave_one_out, smoothed

ROUNDING = 1e-10
"""The same formulas, summed in another order: of log weights, of k̂, of densities in nats."""

MONTE_CARLO = 5e-3
"""Nats; 4000 draws of ln p(y_i | μ), whose standard deviation is at most |y_i − ȳ|/√20, below 0.5 each."""


@pytest.mark.parametrize("scale", [1e-3, 0.1, 1.0, 10.0])
@pytest.mark.parametrize("count", [30, 100, 224, 225, 226, 1000, 4000])
def test_weights_and_shape_are_those_of_arviz(count: int, scale: float) -> None:
    """From hardly any tail to a single weight that is all."""
    logs = scale * np.random.default_rng(count).standard_t(5, size=(2, 3, count)) - 700.0
    weights, k = smoothed(logs)
    expected, shape = array_stats.psislw(-logs)
    assert k.shape == (2, 3)
    np.testing.assert_allclose(np.log(weights), expected, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(k, shape, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(weights.sum(axis=-1), 1.0, rtol=1e-12)


@pytest.mark.parametrize("top", [-500.0, -690.0])
def test_a_tail_of_hundreds_of_decades_is_weighed(top: float) -> None:
    """The quantiles of its distribution are beyond all numbers; weights end at the largest ratio, as arviz has it."""
    logs = np.r_[np.linspace(-2000.0, -1000.0, 3800), np.linspace(top, 0.0, 200)]
    weights, k = smoothed(logs)
    with np.errstate(over="ignore"):
        expected, shape = array_stats.psislw(-logs)
    assert float(k) == pytest.approx(float(shape), rel=ROUNDING)
    assert k > 100.0
    assert weights.sum() == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(weights, np.exp(expected), rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("r_eff", [1.0, 0.5, 0.225, 0.01])
def test_left_out_densities_are_those_of_arviz(r_eff: float) -> None:
    """Of values that hardly matter and of some that decide; correlated draws have a longer tail."""
    rng = np.random.default_rng(1)
    logs = rng.normal(size=(1000, 60)) * np.exp(rng.normal(size=60)) - 3.0
    elpd, k, p_loo = leave_one_out(logs, r_eff)
    expected, shape, p = array_stats.loo(logs.T[:, None, :], r_eff=r_eff)
    np.testing.assert_allclose(elpd, expected, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(k, shape, rtol=0, atol=ROUNDING)
    assert p_loo == pytest.approx(p.sum(), abs=60 * ROUNDING)
    assert k.max() > 0.7 > k.min()


def test_equal_draws_are_weighted_as_by_arviz() -> None:
    """A walk that stays has some draws twice; their order in the tail is of no consequence for the density."""
    logs = np.repeat(np.random.default_rng(2).normal(size=(500, 5)), 2, axis=0)
    elpd, k, _ = leave_one_out(logs)
    expected, shape, _ = array_stats.loo(logs.T[:, None, :])
    np.testing.assert_allclose(elpd, expected, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(k, shape, rtol=0, atol=ROUNDING)


def test_many_values_are_weighed_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    logs = np.random.default_rng(3).normal(size=(200, 11))
    whole = leave_one_out(logs)
    monkeypatch.setattr(pareto, "MOST_NUMBERS", 600)
    for one, other in zip(whole, leave_one_out(logs), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-14)


def test_a_left_out_density_has_its_closed_form() -> None:
    """y_i ~ N(μ, 1), flat prior: without y_i, μ ~ N(mean of the others, 1/(n − 1)), y_i ~ N(that, n/(n − 1))."""
    n, rng = 20, np.random.default_rng(4)
    y = rng.normal(size=n)
    mu = y.mean() + rng.normal(size=4000) / np.sqrt(n)
    elpd, k, p_loo = leave_one_out(stats.norm.logpdf(y, mu[:, None], 1.0))
    exact = stats.norm.logpdf(y, (y.sum() - y) / (n - 1), np.sqrt(n / (n - 1)))
    np.testing.assert_allclose(elpd, exact, atol=4 * MONTE_CARLO)
    assert k.max() < 0.7
    assert p_loo == pytest.approx(np.sum(stats.norm.logpdf(y, y.mean(), np.sqrt(1 + 1 / n)) - exact), abs=0.02)


@pytest.mark.parametrize(
    "logs",
    [np.zeros(1000), np.append(np.zeros(990), np.arange(10.0)), np.arange(5.0 * FEWEST_IN_TAIL - 1.0)],
    ids=["all the same", "the lower quarter of the tail at its edge", "too few"],
)
def test_where_no_tail_can_be_fitted_the_ratios_are_the_weights(logs: np.ndarray) -> None:
    weights, k = smoothed(logs)
    np.testing.assert_allclose(weights, np.exp(logs) / np.exp(logs).sum(), rtol=1e-12)
    assert k == np.inf


def test_ratios_of_nothing_weigh_nothing() -> None:
    logs = np.random.default_rng(5).normal(size=400)
    logs[:100] = -np.inf
    weights, k = smoothed(logs)
    expected, shape = array_stats.psislw(-logs)
    np.testing.assert_allclose(weights, np.exp(expected), rtol=ROUNDING)
    assert k == pytest.approx(float(shape), abs=ROUNDING)
    assert weights[:100].max() == 0.0


def test_split_rhat_is_that_of_arviz() -> None:
    """Of a parameter with ties, of one that drifts, and of two good ones; odd and even lengths, few and many."""
    rng = np.random.default_rng(6)
    for steps, walkers in ((4, 2), (5, 3), (501, 32)):
        chain = rng.normal(size=(steps, walkers, 4))
        chain[..., 0] = np.round(chain[..., 0])
        chain[..., 1] += np.linspace(0.0, 1.0, steps)[:, None]
        expected = np.array(array_stats.rhat(chain, chain_axis=1, draw_axis=0), float)
        np.testing.assert_allclose(split_rhat(chain), expected, rtol=ROUNDING)
    chain[7, 1, 2] = np.nan
    np.testing.assert_array_equal(np.isnan(split_rhat(chain)), [False, False, True, False])
    for short in (chain[:3], chain[:, :1]):
        assert np.isnan(split_rhat(short)).all()


def test_neither_arviz_nor_scipy_is_loaded_to_weigh() -> None:
    code = """
import sys
import numpy as np
from fitmat.uncertainty.pareto import leave_one_out, smoothed
from fitmat.uncertainty.mixing import split_rhat
x = np.random.default_rng(0).normal(size=(300, 4, 2))
smoothed(x[:, 0, 0]), leave_one_out(x[:, 0]), split_rhat(x)
assert not {"arviz_stats", "scipy"} & set(sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
