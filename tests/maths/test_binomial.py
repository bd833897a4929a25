"""Probabilities of numbers of successes against scipy."""

import numpy as np
import pytest
from scipy import stats

from fitmat.maths import binomial

ROUNDING = 1e-10
"""Relative, up to 12 standard deviations from the mean; ratios of a million neighbours are multiplied."""


@pytest.mark.parametrize("p", [0.0455, 0.5, 0.99])
@pytest.mark.parametrize("count", [1, 7, 500, 20_000, 1_000_000])
def test_masses_and_tails_are_those_of_scipy(count: int, p: float) -> None:
    found, sd = binomial.masses(count, p), np.sqrt(count * p * (1 - p))
    assert found.shape == (count + 1,)
    k = np.unique(np.clip(count * p + sd * np.linspace(-12.0, 12.0, 241), 0, count).astype(int))
    np.testing.assert_allclose(found[k], stats.binom.pmf(k, count, p), rtol=ROUNDING)
    np.testing.assert_allclose(np.cumsum(found)[k], stats.binom.cdf(k, count, p), rtol=ROUNDING)
    since = np.cumsum(found[::-1])[::-1]
    np.testing.assert_allclose(since[k], stats.binom.sf(k - 1, count, p), rtol=ROUNDING)
    np.testing.assert_array_equal(
        np.searchsorted(np.cumsum(found), [0.025, 0.3, 0.975]), stats.binom.ppf([0.025, 0.3, 0.975], count, p)
    )
