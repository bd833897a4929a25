"""The normal distribution against scipy, and its far tails against a continued fraction in 50 digits."""

from decimal import Decimal, localcontext

import numpy as np
import pytest
from scipy import special

from fitmat.maths import normal

ROUNDING = 1e-14
"""Relative; rational approximations to 18 digits, evaluated in double precision."""

THEIRS = 5e-13
"""Relative; scipy squares x/√2 in double precision, so that Φ(−37) is off by 37² · 1e-16; the fraction is not."""

X = np.concatenate([np.linspace(-40.0, 40.0, 16_001), np.linspace(-1.0, 1.0, 2001), np.nextafter(-1.0, [-2.0, 0.0])])

PI = Decimal("3.14159265358979323846264338327950288419716939937510582")


def lower_tail(x: float) -> Decimal:
    """Φ(x) of x < 0 by Laplace's continued fraction (Abramowitz & Stegun 26.2.14)."""
    with localcontext() as context:
        context.prec = 50
        z = -Decimal(x)
        fraction = z
        for k in range(400, 0, -1):
            fraction = z + k / fraction
        return (-z * z / 2).exp() / ((2 * PI).sqrt() * fraction)


def test_probabilities_are_those_of_scipy() -> None:
    central = np.abs(X) < 5.0
    np.testing.assert_allclose(normal.cdf(X[central]), special.ndtr(X[central]), rtol=ROUNDING)
    full = X > -37.5  # below, numbers are subnormal and have fewer digits
    np.testing.assert_allclose(normal.cdf(X[full]), special.ndtr(X[full]), rtol=THEIRS)


def test_logarithms_are_those_of_scipy() -> None:
    below = X < 5.0
    np.testing.assert_allclose(normal.log_cdf(X[below]), special.log_ndtr(X[below]), rtol=ROUNDING)
    above = X[X < 37.5]
    np.testing.assert_allclose(normal.log_cdf(above), special.log_ndtr(above), rtol=THEIRS)


@pytest.mark.parametrize("x", [-3.0, -5.3, -5.7, -9.1, -17.77, -26.05, -37.2])
def test_far_tails_have_all_their_digits(x: float) -> None:
    exact = lower_tail(x)
    with localcontext() as context:
        context.prec = 400
        logarithm, upper = exact.ln(), (1 - exact).ln()
    assert normal.cdf(x) == pytest.approx(float(exact), rel=ROUNDING, abs=0.0)
    assert normal.log_cdf(x) == pytest.approx(float(logarithm), rel=ROUNDING)
    assert normal.log_cdf(-x) == pytest.approx(float(upper), rel=ROUNDING, abs=0.0)


def test_quantiles_are_those_of_scipy() -> None:
    p = np.concatenate([np.geomspace(1e-300, 0.1, 3001), np.linspace(1e-4, 1.0 - 1e-4, 9999), [0.075, 0.925]])
    np.testing.assert_allclose(normal.quantile(p), special.ndtri(p), rtol=ROUNDING, atol=1e-16)
    high = 1.0 - np.geomspace(1e-16, 0.1, 301)
    np.testing.assert_allclose(normal.quantile(high), special.ndtri(high), rtol=ROUNDING)


def test_quantiles_invert_probabilities() -> None:
    x = np.linspace(-37.0, 5.0, 421)
    # dp/p = x dx, and the rounding of p near 1 is as good as lost.
    allowed = 1e-13 + np.finfo(float).eps / np.exp(-0.5 * np.maximum(x, 0.0) ** 2)
    assert np.all(np.abs(normal.quantile(normal.cdf(x)) - x) < allowed * 10)


def test_ends_and_nonsense() -> None:
    ends = np.array([-np.inf, np.inf, np.nan])
    np.testing.assert_array_equal(normal.cdf(ends), [0.0, 1.0, np.nan])
    np.testing.assert_array_equal(normal.log_cdf(ends), [-np.inf, 0.0, np.nan])
    np.testing.assert_array_equal(
        normal.quantile(np.array([0.0, 1.0, -0.1, 1.1, np.nan])), [-np.inf, np.inf, np.nan, np.nan, np.nan]
    )
    assert normal.quantile(0.5) == 0.0
    assert normal.cdf(np.zeros((2, 3, 4))).shape == (2, 3, 4)
    assert normal.log_cdf(np.zeros((0, 3))).shape == (0, 3)
