"""Telling two models apart: differences by hand, and the error rate of the best test by simulation."""

import dataclasses

import numpy as np
import pytest

import fitmat as fm
from fitmat.fitting.result import Fit
from fitmat.match.discernibility import ROWS, SEPARATED, Telling, tell_apart
from fitmat.models.parameters import vector

CHANCE = 0.005
"""Four standard errors of a rate of 2.5 % in 20,000 simulated measurements."""

SIGMA = 0.01


def lambert(kd: float) -> np.ndarray:
    return np.asarray(vector(fm.model("lambert", channels=1, kd=kd)))[None]


@pytest.fixture(scope="module")
def fit() -> Fit:
    """30 readings at 20° and 60 at 60°, σ = 0.01 sr⁻¹; one of each is masked."""
    theta_i, theta_o = np.deg2rad(np.repeat([20.0, 60.0], [30, 60])), np.deg2rad(np.r_[0:30, 0:60])
    value = np.full(90, 0.1)
    value[[3, 40]] = np.nan
    return fm.fit(fm.from_arrays(theta_i, theta_o, value, sigma=np.full(90, SIGMA)), "lambert")


def told(fit: Fit, one: float, other: float) -> Telling:
    return tell_apart(fit, fit, (np.tile(lambert(one * np.pi), (3, 1)), np.tile(lambert(other * np.pi), (3, 1))))


def test_a_constant_difference_is_counted_by_hand(fit: Fit) -> None:
    """0.005 sr⁻¹ is z = 0.5 in every reading: d′ = 0.5 √n, and (3.92/d′)² repeats."""
    found = told(fit, 0.105, 0.1)
    assert found.theta_i_deg == pytest.approx([20.0, 60.0])
    assert list(found.readings) == [29, 59]
    assert found.rms[1] == pytest.approx([0.5, 0.5])
    assert found.beyond[1] == pytest.approx([0.0, 0.0])
    assert found.separation[1] == pytest.approx(0.5 * np.sqrt([29, 59]))
    assert found.repeats[1] == pytest.approx(3.92**2 / 0.25 / np.array([29, 59]))
    assert found.every.value == pytest.approx(0.5 * np.sqrt(88))
    assert found.repeats_needed.value == pytest.approx(3.92**2 / 0.25 / 88)
    assert found.alike_up_to_deg == 60.0 - 40.0 * (0.5 * np.sqrt(59) > SEPARATED)
    assert found.hidden_up_to_deg == 60.0
    large = told(fit, 0.125, 0.1)
    assert large.beyond[1] == pytest.approx([1.0, 1.0])
    assert large.alike_up_to_deg is None
    assert large.hidden_up_to_deg is None


def test_the_threshold_means_one_error_in_forty(fit: Fit) -> None:
    """Measurements of one model are simulated; the likelihood ratio takes 2.5 % of them for the other at d′ = 3.92."""
    apart = SIGMA * SEPARATED / np.sqrt(88)
    found = told(fit, 0.1 + apart, 0.1)
    assert found.every.value == pytest.approx(SEPARATED)
    readings = 0.1 + SIGMA * np.random.default_rng(5).normal(size=(20_000, 88))
    mistaken = ((readings - 0.1 - apart) ** 2).sum(axis=1) < ((readings - 0.1) ** 2).sum(axis=1)
    assert np.mean(mistaken) == pytest.approx(0.025, abs=CHANCE)


def test_many_readings_are_thinned_and_many_incidences_grouped(fit: Fit) -> None:
    """9,000 readings at 90 incidences: d′ of all is scaled to all, and five incidences each are taken together."""
    lights = np.repeat(np.deg2rad(np.arange(0.0, 90.0)), 100)
    many = fm.from_arrays(lights, np.full(9000, 0.2), np.full(9000, 0.1), sigma=np.full(9000, SIGMA))
    sigma = dataclasses.replace(fit.noise, sigma=np.full((9000, 1), SIGMA))
    found = told(dataclasses.replace(fit, measurements=many, noise=sigma), 0.105, 0.1)
    assert len(many.wi) > ROWS
    assert found.every.value == pytest.approx(0.5 * np.sqrt(9000), rel=1e-9)
    np.testing.assert_allclose(found.theta_i_deg, np.arange(2.0, 90.0, 5.0), atol=0.02)  # thinned unevenly
    assert found.readings.sum() == pytest.approx(9000, abs=10)


def test_what_is_masked_in_one_channel_does_not_count(fit: Fit) -> None:
    """Two channels of 90 readings, z = 0.5; three readings of the second are masked."""
    m, valid = fit.measurements, np.ones((90, 2), bool)
    valid[:3, 1] = False
    both = dataclasses.replace(m, value=np.full((90, 2), 0.1), sigma=None, valid=valid, channels=("a", "b"))
    noise = dataclasses.replace(fit.noise, sigma=np.full((90, 2), SIGMA))
    coloured = dataclasses.replace(fit, measurements=both, noise=noise, model=fm.model("lambert", channels=2, kd=0.3))
    values = tuple(np.full((3, 2), f * np.pi) for f in (0.105, 0.1))
    found = tell_apart(coloured, coloured, (values[0], values[1]))
    assert list(found.readings) == [57, 120]
    assert found.every.value == pytest.approx(0.5 * np.sqrt(177))
