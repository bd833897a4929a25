"""Several laboratories: Paule–Mandel against published numbers, and who is off against laboratories made so."""

import dataclasses
import json
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.judgement.laboratories.agreement import agreement, paule_mandel
from fitmat.judgement.laboratories.scales import named_off
from fitmat.measurements.instrument import UNKNOWN_SCALE, Instrument

DEGREE = np.pi / 180

ANGLES = (
    (np.array([10.0, 40.0, 65.0]), np.arange(-76.0, 77.0, 4.0)),
    (np.array([20.0, 50.0]), np.arange(-75.0, 76.0, 3.0)),
    (np.array([15.0, 30.0, 45.0]), np.arange(-70.0, 71.0, 5.0)),
)
"""Incidences and outgoing angles of three laboratories, in degrees: no two measure alike."""


def measured(off: float, seed: int, at: int = 1, noise: float = 0.02, told: Instrument | None = None) -> list[Any]:
    """Three laboratories on one surface, the scale of one off by a fraction."""
    truth = fm.model("lambert+ggx", kd=0.3, ks=0.8, alpha=0.2, eta=1.5)
    found = []
    for k, (light, sensor) in enumerate(ANGLES):
        m = fm.simulate(truth, light * DEGREE, sensor * DEGREE, relative_noise=noise, absolute_noise=1e-3,
                        seed=1000 * seed + k)  # fmt: skip
        assert m.sigma is not None
        factor = 1.0 + off if k == at else 1.0
        m = dataclasses.replace(m, value=m.value * factor, sigma=m.sigma * factor, source=f"lab {k + 1}")
        found.append(m if told is None else dataclasses.replace(m, instrument=told))
    return found


BORROWED = np.array([(3.7, 0.2), (4.1, 0.3), (3.2, 0.25), (5.0, 0.4), (3.9, 0.15)])


def test_paule_mandel_solves_its_equation() -> None:
    """Bisection of F(y) = Σ w (x − x̄)² − (L − 1), w = 1/(u² + y), as their paper has it, in another program."""
    x, u = BORROWED.T

    def equation(y: float) -> float:
        w = [1.0 / (sd * sd + y) for sd in u]
        mean = sum(a * b for a, b in zip(w, x, strict=True)) / sum(w)
        return sum(a * (b - mean) ** 2 for a, b in zip(w, x, strict=True)) - (len(x) - 1)

    low, high = 0.0, 10.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if equation(middle) > 0 else (low, middle)
    assert paule_mandel(x, u) ** 2 == pytest.approx(low, rel=1e-9)


def test_equal_uncertainties_have_the_variance_of_the_mean() -> None:
    """Where all u are one, u_b² = s² − u², and so are DerSimonian & Laird's (1986) moments."""
    x, u = np.array([9.8, 10.4, 10.1, 11.0]), np.full(4, 0.2)
    found = agreement("kd", x, u)
    laird = (found.chi2 - 3) / (4 / u[0] ** 2 - 4 / u[0] ** 2 / 4)
    assert found.between**2 == pytest.approx(x.var(ddof=1) - 0.04) == pytest.approx(laird)
    assert found.value == pytest.approx(x.mean())
    assert found.uncertainty == pytest.approx(x.std(ddof=1) / 2.0)
    assert found.ci95[1] - found.value == pytest.approx(3.182 * found.uncertainty, rel=1e-3)  # Student's t, 3


def test_laboratories_that_agree_weigh_as_they_state() -> None:
    x, u = np.array([1.00, 1.02, np.nan, 0.99]), np.array([0.02, 0.03, np.nan, 0.01])
    found = agreement("kd", x, u)
    weight = np.array([2500.0, 1 / 9e-4, 1e4])
    mean = float(weight @ x[[0, 1, 3]] / weight.sum())
    square = float(weight @ (x[[0, 1, 3]] - mean) ** 2)
    assert (found.between, found.freedom) == (0.0, 2)
    assert found.value == pytest.approx(mean)
    assert found.uncertainty == pytest.approx(weight.sum() ** -0.5)
    assert found.p == pytest.approx(chi2.sf(square, 2))


def test_who_is_off_is_named_one_by_one() -> None:
    covariance = np.diag(np.full(5, 1e-4))
    assert named_off(np.array([0.0, 0.001, 0.1, -0.002, -0.2]), covariance) == ([4, 2], False)
    assert named_off(np.array([0.0, 0.1]), covariance[:2, :2]) == ([], True)
    assert named_off(np.array([0.0, 0.01]), covariance[:2, :2]) == ([], False)


def test_chance_names_nobody_more_often_than_is_stated() -> None:
    """20,000 sets of five scales that chance alone makes, some as correlated as shared readings of a surface are."""
    rng, count = np.random.default_rng(0), 20_000
    covariance = 1e-4 * (np.diag([1.0, 0.5, 2.0, 1.0, 0.2]) + 0.3)
    drawn = rng.multivariate_normal(np.zeros(5), covariance, size=count)
    alarms = np.mean([bool(named_off(logs, covariance)[0]) for logs in drawn])
    assert alarms <= 0.05 + 3.0 * np.sqrt(0.05 * 0.95 / count)


@pytest.mark.study
def test_one_that_is_five_percent_off_is_named() -> None:
    found = fm.compare_laboratories(measured(0.05, 0))
    assert [s.laboratory for s in found.scales if s.off] == ["lab 2"]
    off = found.scales[1]
    assert off.ci95[0] < 1.05 < off.ci95[1]
    assert not found.agree
    assert not next(a for a in found.agreements if a.name == "albedo").agree
    assert "lab 2 is off: it reads" in found.words
    assert "% higher (95 %:" in found.words
    told = json.loads(json.dumps(found.as_dict(), allow_nan=False))
    assert told["scales"][1]["off"] is True
    assert told["quantities"]["kd"]["agree"] is False


@pytest.mark.study
def test_what_the_calibrations_state_is_no_difference() -> None:
    found = fm.compare_laboratories(measured(0.05, 0, told=Instrument(calibration=0.03)))
    assert found.agree
    assert found.words.endswith(
        "agree within the uncertainties they state (lambert+ggx). No calibration is seen to be off."
    )
    assert found.scales[1].factor == pytest.approx(1.05, abs=0.01)  # the factor is told all the same


@pytest.mark.study
def test_of_two_nobody_knows_which() -> None:
    found = fm.compare_laboratories(measured(0.05, 0)[:2])
    assert found.unsettled == ("value",)
    assert not any(s.off for s in found.scales)
    assert "with two that differ nobody can say which is off" in found.words


def test_what_cannot_be_compared_is_refused() -> None:
    one, other, _ = measured(0.0, 0)
    rgb = dataclasses.replace(other, channels=("r",))
    for given, sentence in (
        ([one], "1 laboratory, expected at least two"),
        ([one, rgb], "lab 2 has the channels r, lab 1 value, expected the same of all"),
        ([one, dataclasses.replace(one, source="copy")], "lab 1 and copy hold the same values, expected each lab"),
        ([one, dataclasses.replace(other, source="lab 1")], "names lab 1, lab 1 for 2 laboratories, expected one each"),
        ([one, dataclasses.replace(other, instrument=Instrument(receiver=0.01))], "lab 2 has other apertures"),
        ([one, dataclasses.replace(other, instrument=Instrument(calibration=UNKNOWN_SCALE))], "lab 2: a scale of wh"),
        ("one", "measurements is the text 'one'"),
        ([one, 3], "one of measurements is 3, expected Measurements"),
    ):
        with pytest.raises(FitmatError, match=sentence.replace("(", r"\(")):
            fm.compare_laboratories(given)  # pyright: ignore[reportArgumentType]
