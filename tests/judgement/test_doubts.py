"""Doubts: data that contradict the model, the noise or themselves are labelled in words; good data are not."""

import dataclasses

import numpy as np
import pytest
from selection import always

import fitmat as fm
from fitmat.judgement.doubts import ALLOWED, find_doubts

ANGLES = np.deg2rad([10.0, 30.0, 50.0, 70.0]), np.deg2rad(np.arange(-80.0, 81.0, 2.0))
CAUTION = "The intervals hold only if the model and the noise are right, which these data contradict."


@pytest.fixture(scope="module")
def made() -> fm.Measurements:
    """324 values of a satin plastic, σ given."""
    truth = fm.model("lambert+ggx", kd=0.2, alpha=0.2)
    return fm.simulate(truth, *ANGLES, relative_noise=0.02, absolute_noise=1e-3, seed=1)


def changed(m: fm.Measurements, value: np.ndarray) -> fm.Measurements:
    return dataclasses.replace(m, value=value)


def test_good_data_raise_no_doubt(made: fm.Measurements) -> None:
    found = find_doubts(fm.fit(made, "lambert+ggx"))
    assert found.words == ()
    assert not found.inadequate


def test_contradictory_repeats_are_named(made: fm.Measurements) -> None:
    """Two measurements of one geometry, 10 σ of their difference apart."""
    assert made.sigma is not None
    row = 40
    doubled = made.rows(np.r_[np.arange(made.n_samples), row])
    value = doubled.value.copy()
    value[-1] += 10 * np.sqrt(2) * made.sigma[row]
    found = find_doubts(fm.fit(changed(doubled, value), "lambert+ggx"))
    assert found.inadequate
    assert not found.intervals_hold
    assert found.words[0].startswith("Two measurements of one geometry (θᵢ 10°, θₒ 0°) differ by 10 times their noise")
    assert found.words[-1] == CAUTION


@pytest.mark.parametrize(("factor", "words"), [(1e-3, "1e+03 times smaller"), (1e3, "times larger")])
def test_a_sigma_that_is_off_by_a_thousand_is_doubted(made: fm.Measurements, factor: float, words: str) -> None:
    assert made.sigma is not None
    found = find_doubts(fm.fit(dataclasses.replace(made, sigma=factor * made.sigma), "lambert+ggx"))
    assert found.inadequate
    assert words in str(found)
    assert "correct its unit" in str(found)


def test_noise_from_neighbours_beyond_the_lobe_is_called_a_bound() -> None:
    """Steps of 10° beside lobes of alpha 0.1 and 0.5."""
    angles = np.deg2rad(np.linspace(5.0, 75.0, 8)), np.deg2rad(np.arange(-80.0, 81.0, 10.0))
    for alpha in (0.1, 0.5):
        truth = fm.model("lambert+ggx", kd=0.2, alpha=alpha)
        m = fm.simulate(truth, *angles, relative_noise=0.02, absolute_noise=1e-3, seed=1)
        words = str(find_doubts(fm.fit(dataclasses.replace(m, sigma=None), "lambert+ggx")))
        told = "The noise was estimated from neighbours 10° apart beside a lobe" in words
        assert told == (alpha == 0.1)
        assert ("upper bound" in words) == told


def test_identical_values_are_named(made: fm.Measurements) -> None:
    found = find_doubts(fm.fit(changed(made, np.full_like(made.value, 0.3)), "lambert+ggx"))
    assert found.inadequate
    assert "are identical (0.3 sr⁻¹)" in found.words[0]


@pytest.mark.parametrize("loss", always(("default",), ["default", "gaussian"]))
def test_retro_reflection_is_recognised(made: fm.Measurements, loss: str) -> None:
    """A peak towards the light, which no model here has; also under a loss that takes the model as exact."""
    back = 0.5 * np.exp(-(((made.signed_theta_o + made.theta_i) / 0.1) ** 2))
    found = find_doubts(fm.fit(changed(made, made.value + back[:, None]), "lambert+ggx", loss=loss))
    assert found.inadequate
    assert "lambert+ggx is inadequate: it misses the data by " in found.words[0]
    assert "back towards the light (retro-reflection), where it is too dark" in found.words[0]
    assert found.words[-1] == ALLOWED
    assert found.intervals_hold


@pytest.mark.study
def test_bad_values_are_counted(made: fm.Measurements) -> None:
    value = made.value.copy()
    value[[3, 100, 200]] *= 1.4
    found = find_doubts(fm.fit(changed(made, value), "lambert+ggx", loss="mixture"))
    assert found.words[0].startswith("3 of 324 values are probably bad, the worst at ")
    assert not found.inadequate


@pytest.mark.study
def test_no_wrong_alarm_over_many_seeds() -> None:
    """Forty good data sets: at a level of 10⁻³ each none is expected to raise a doubt, two are allowed."""
    truth = fm.model("lambert+ggx", kd=0.2, alpha=0.2)
    doubts = 0
    for seed in range(40):
        m = fm.simulate(truth, *ANGLES, relative_noise=0.02, absolute_noise=1e-3, seed=seed)
        doubts += bool(find_doubts(fm.fit(m, "lambert+ggx")).words)
    assert doubts <= 2
