"""Intervals: 95 % of the draws, and the best value among them wherever it lies."""

import numpy as np
import pytest

from fitmat.uncertainty.estimate import band, estimate, limits

DRAWS = np.arange(1.0, 1001.0)


@pytest.mark.parametrize(
    ("best", "expected"),
    [
        (500.0, (25.975, 975.025)),
        (990.0, (50.95, 1000.0)),
        (2000.0, (50.95, 2000.0)),
        (10.0, (1.0, 950.05)),
        (-5.0, (-5.0, 950.05)),
    ],
)
def test_an_interval_holds_the_best_value_and_95_percent_of_the_draws(
    best: float, expected: tuple[float, float]
) -> None:
    """Quantiles of 1 … 1000 by linear interpolation: 1 + 999 q."""
    found = estimate(np.r_[best, DRAWS])
    assert found.ci95 == pytest.approx(expected)
    assert found.ci95[0] <= found.value <= found.ci95[1]
    inside = (found.ci95[0] <= DRAWS) & (found.ci95[1] >= DRAWS)
    assert inside.mean() == pytest.approx(0.95, abs=1e-3)


def test_bands_and_other_levels_are_the_same_pointwise() -> None:
    curves = np.stack([np.r_[500.0, DRAWS], np.r_[2000.0, DRAWS]], axis=1)
    low, best, high = band(curves)
    assert low == pytest.approx([25.975, 50.95])
    assert best == pytest.approx([500, 2000])
    assert high == pytest.approx([975.025, 2000])
    assert limits(curves[0], curves[1:], 0.5)[:, 0] == pytest.approx([250.75, 750.25])


def test_what_is_not_a_number_stays_so() -> None:
    assert np.isnan(limits(np.array([np.nan]), np.full((9, 1), np.nan))).all()
