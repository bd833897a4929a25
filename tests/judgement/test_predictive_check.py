"""Predictive checks: p-values that are uniform where the model is right, and failures named where it is wrong."""

import dataclasses

import numpy as np
import pytest
from scipy import stats

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.fitting.result import Fit
from fitmat.judgement.predictive import check
from fitmat.judgement.predictive.check import PredictiveCheck, check_predictions
from fitmat.measurements.incidences import incidences
from fitmat.uncertainty.posterior import Posterior

REPEATS = 60
"""Files that differ by their noise alone."""

UNIFORM = 0.01
"""Least p-value of a Kolmogorov–Smirnov test of what should be uniform: fails for one choice of seeds in 100."""

FALSE_ALARMS = 0.15
"""Share of right models that any of the checks may call wrong: 5 % by construction, and three errors √(.05·.95/60)."""

INCIDENCES, SENSOR = np.deg2rad([20.0, 40.0, 60.0]), np.deg2rad(np.arange(-78, 79, 4))
SHAPE = len(INCIDENCES), len(SENSOR)
LEVEL = 0.3 / np.pi


def surface(seed: int, planted: np.ndarray | float = 0.0, kd: float = 0.3) -> fm.Measurements:
    """A Lambert surface with 3 % noise and something planted, as a fraction of the level, (3, 40)."""
    noise = 0.03 * np.random.default_rng(seed).normal(size=SHAPE)
    theta_i, theta_o = np.meshgrid(INCIDENCES, SENSOR, indexing="ij")
    value = kd / np.pi * (1.0 + noise + planted)
    sigma = np.full(SHAPE, 0.03 * kd / np.pi)
    return fm.from_arrays(theta_i.ravel(), theta_o.ravel(), value.ravel(), sigma=sigma.ravel())


def checked(m: fm.Measurements, loss: str = "default") -> PredictiveCheck:
    return check_predictions(fm.laplace(fm.fit(m, "lambert", loss=loss), seed=1, corrected=False), seed=2)


@pytest.fixture(scope="module")
def right() -> list[PredictiveCheck]:
    return [checked(surface(seed)) for seed in range(REPEATS)]


@pytest.mark.study
@pytest.mark.parametrize("kind", ["largest", "peak", "pattern"])
def test_p_values_are_uniform_where_the_model_is_right(right: list[PredictiveCheck], kind: str) -> None:
    p = [next(s.p for s in check.statistics if s.kind == kind) for check in right]
    assert stats.kstest(p, "uniform").pvalue > UNIFORM


@pytest.mark.study
def test_right_models_are_seldom_called_wrong(right: list[PredictiveCheck]) -> None:
    assert np.mean([bool(check.failed) for check in right]) <= FALSE_ALARMS
    sides = np.array([s.p for check in right for s in check.statistics if s.kind == "side"])
    assert np.mean(sides < 0.05) < 0.08  # two more percent than chance: they are, if anything, conservative
    fine = next(check for check in right if not check.failed)
    assert fine.words == f"lambert can make data like these: none of {len(fine.statistics)} checks is surprising."


@pytest.mark.study
def test_the_ranges_shown_hold_what_was_measured(right: list[PredictiveCheck]) -> None:
    """95 % of right models' numbers lie in their ranges, those of peaks replicated apart from their p-values."""
    for kind in ("largest", "peak", "pattern"):
        shown = [s for check in right for s in check.statistics if s.kind == kind]
        inside = np.mean([s.expected[0] <= s.observed <= s.expected[1] for s in shown])
        assert inside > 0.95 - 3 * np.sqrt(0.05 * 0.95 / len(shown))


def test_few_draws_say_what_many_say(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a large file: p-values within three errors 0.3 √(1/20 + 1/200), ranges that seeds move little.

    By Gumbel's law for maxima the upper end of 200 replicates has an error of 9 % of the range, of 20 that of 28 %.
    """
    posterior = fm.laplace(fm.fit(surface(3), "lambert"), seed=1, corrected=False)
    many = check_predictions(posterior, seed=2).statistics
    monkeypatch.setattr(check, "MOST_NUMBERS", 1)
    few = [check_predictions(posterior, seed=seed).statistics for seed in range(20)]
    np.testing.assert_allclose(np.median([[s.p for s in one] for one in few], axis=0), [s.p for s in many], atol=0.21)
    ends = np.array([[s.expected for s in one if s.kind == "peak"] for one in few])
    assert np.mean(ends[..., 1].std(axis=0) / np.ptp(ends.mean(axis=0), axis=1)) < 0.11


def places(check: PredictiveCheck, kind: str) -> list[str]:
    return [s.place for s in check.failed if s.kind == kind]


def test_a_wave_along_one_curve_is_a_pattern_there() -> None:
    wave = np.zeros(SHAPE)
    wave[2] = 0.1 * np.sin(np.arange(len(SENSOR)) / 2.0)
    found = checked(surface(1, wave))
    assert places(found, "pattern") == ["60°"]
    assert "cannot make the pattern seen at 60°" in found.words
    assert max(s.p for s in found.failed) < 0.01


def test_a_brighter_incidence_is_one_where_the_model_reflects_too_little() -> None:
    brighter = np.zeros(SHAPE)
    brighter[2] = 0.2
    found = checked(surface(1, brighter), loss="gaussian")  # no discrepancy takes the step for its own
    assert any(place.startswith("60°") for place in places(found, "side"))
    assert "reflects too little at 60°" in found.words
    assert "has too low a peak at 60°" in found.words
    assert "reflects too much at 20°" in found.words
    assert "cannot" in str(found)


def test_one_wild_value_is_the_largest_residual() -> None:
    wild = np.zeros(SHAPE)
    wild[0, 7] = 0.5
    found = checked(surface(1, wild))
    assert [s.kind for s in found.failed][:1] == ["largest"]
    assert "cannot make its largest residual" in found.words
    assert not places(found, "pattern")


def test_noise_that_is_stated_too_large_is_said() -> None:
    m = surface(1)
    assert m.sigma is not None
    found = checked(dataclasses.replace(m, sigma=3.0 * m.sigma))
    assert "the noise is stated too large" in found.words


@pytest.fixture(scope="module")
def fit() -> Fit:
    return fm.fit(surface(1), "lambert")


def test_neighbouring_angles_are_taken_together_where_there_are_many() -> None:
    theta = np.deg2rad(np.linspace(0, 80, 81))
    wi = np.stack([np.sin(theta), 0 * theta, np.cos(theta)], axis=1)
    found = incidences(wi, theta > 0.0)
    assert len(found) == 12
    assert found[0].name == "1–7°"
    assert sorted(np.concatenate([g.rows for g in found]).tolist()) == list(range(1, 81))
    assert incidences(wi, np.zeros(81, bool)) == ()


def test_what_cannot_be_checked_is_refused(fit: Fit) -> None:
    lost = Posterior(dataclasses.replace(fit, log_likelihood=np.nan, result="nonfinite"), "laplace",
        fit.values[None], np.zeros(1))  # fmt: skip
    with pytest.raises(
        FitmatError, match=r"lambert: the fit ended nonfinite, there is nothing to check; check the data"
    ):
        check_predictions(lost, seed=1)
    heavy = fm.fit(surface(1), "lambert", loss="student-t")
    with pytest.raises(FitmatError, match=r"the loss student-t makes no Gaussian residuals to check; fit with the def"):
        check_predictions(Posterior(heavy, "laplace", heavy.values[None], np.zeros(1)), seed=1)
