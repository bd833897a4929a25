"""Exact zeros: masked where the curve they stand in cannot be 0, kept where it falls to 0 or noise reaches it."""

import numpy as np
import pytest

import fitmat as fm
from fitmat.measurements.blocked import EQUAL, REASON

ANGLES = np.arange(-80.0, 81.0, 2.0)
X = np.deg2rad(ANGLES)
NOISE = np.random.default_rng(1).normal(size=X.size)
PLATEAU = 0.2 * (1 + 0.01 * NOISE)
LOBE = 0.1 + np.exp(-(((X - 0.5) / 0.1) ** 2))


def kept(value: np.ndarray, **columns: np.ndarray) -> fm.Measurements:
    return fm.read({"theta_i": np.full(X.size, 30.0), "theta_o": ANGLES, "brdf": value, **columns})


BLOCKED = {
    "at the end": np.where(X < -1.0, 0.0, PLATEAU),
    "in the middle": np.where(np.abs(X + 0.5) < 0.07, 0.0, PLATEAU),
    "a single reading": np.where(np.arange(X.size) == 33, 0.0, PLATEAU),
    "beside the lobe": np.where(np.abs(X - 0.35) < 0.02, 0.0, LOBE),
    "cut off at a threshold": np.where(PLATEAU < 0.1975, 0.0, PLATEAU),
}

READINGS = {
    "a lobe that ends at 90° from the mirror": np.maximum(np.cos(X - np.deg2rad(30)), 0.0) * 0.3,
    "a power of it": np.maximum(np.cos(X - np.deg2rad(30)), 0.0) ** 20 * 0.3,
    "rounded to 4 digits": np.round(LOBE - 0.1, 4),
    "a narrow one rounded": np.round(3 * np.exp(-(((X - 0.5) / 0.02) ** 2)), 4),
    "noise cut off at 0": np.maximum(0.01 + 0.01 * NOISE, 0.0),
    "black": np.zeros(X.size),
}


@pytest.mark.parametrize("name", BLOCKED)
def test_zeros_amid_high_readings_are_masked_and_counted(name: str) -> None:
    value = BLOCKED[name]
    m = kept(value)
    np.testing.assert_array_equal(m.valid[:, 0], value != 0)
    assert m.masked == {REASON: np.count_nonzero(value == 0)}


@pytest.mark.parametrize("name", READINGS)
def test_zeros_that_a_curve_reaches_are_kept(name: str) -> None:
    value = READINGS[name]
    assert np.count_nonzero(value == 0) > 0
    m = kept(value)
    assert m.valid.all()
    assert m.masked == {}


def test_a_given_sigma_says_what_is_far() -> None:
    """0.2 is 20 standard deviations from 0, or one."""
    value = BLOCKED["in the middle"]
    assert not kept(value, sigma=np.full(X.size, 0.01)).valid.all()
    assert kept(value, sigma=np.full(X.size, 0.2)).valid.all()


def test_only_the_blocked_channel_is_masked() -> None:
    value = BLOCKED["in the middle"]
    columns = {"theta_i": np.full(X.size, 30.0), "theta_o": ANGLES, "brdf_r": value, "brdf_g": PLATEAU}
    m = fm.read(columns)
    np.testing.assert_array_equal(m.valid, np.column_stack([value != 0, np.ones(X.size, bool)]))


def test_several_curves_are_judged_one_by_one() -> None:
    """Zeros at the end of one curve are not compared with the next one."""
    falls = np.maximum(1.0 - X**2, 0.0)
    m = fm.read(
        {
            "theta_i": np.repeat([20.0, 40.0], X.size),
            "theta_o": np.tile(ANGLES, 2),
            "brdf": np.concatenate([falls, PLATEAU]),
        }
    )
    assert np.count_nonzero(falls == 0) > 0
    assert m.valid.all()


@pytest.mark.parametrize("name", BLOCKED)
@pytest.mark.parametrize("limit", [1e-6, 1e-3])
def test_equal_tiny_readings_are_masked_as_zeros_are(name: str, limit: float) -> None:
    """What is written where nothing was seen; a single one, or a limit close to the rest, tells nothing."""
    value = np.where(BLOCKED[name] == 0, limit, BLOCKED[name])
    m = kept(value)
    if np.count_nonzero(value == limit) < 3:
        assert m.valid.all()
    else:
        np.testing.assert_array_equal(m.valid[:, 0], value != limit)
        assert m.masked == {EQUAL: np.count_nonzero(value == limit)}
        assert m.value[~m.valid[:, 0]].max() == 0.0


@pytest.mark.parametrize("name", READINGS)
def test_a_limit_that_a_curve_reaches_is_kept(name: str) -> None:
    assert kept(np.maximum(READINGS[name], 1e-6)).valid.all()


def test_a_limit_beside_a_steep_flank_is_kept_and_said() -> None:
    """Whether a lobe falls so far from one angle to the next, nobody knows."""
    lobe = 0.1 + 5.0 * np.exp(-(((X - 0.5) / 0.06) ** 2))
    m = kept(np.where(X > 0.59, 1e-6, lobe))
    assert m.valid.all()
    (warning,) = m.warnings
    count = np.count_nonzero(X > 0.59)
    assert (
        f"The smallest value, 1e-06 sr⁻¹, occurs exactly {count} times, and nothing else is below 10 times" in warning
    )
    assert kept(lobe).warnings == ()
    assert kept(np.where(X > -0.2, lobe, 0.1)).warnings == ()  # without noise a floor is one value many times
