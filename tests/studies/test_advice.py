"""Advice: named only where something is open, and what is measured there tells as much as was promised."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.studies import record
from fitmat.studies.advice import WORTH, Advice
from fitmat.studies.cards import cards
from fitmat.studies.study import study

CATALOGUE = Path(__file__).parents[2] / "data" / "synthetic"

PAIR = "lambert+blinn-phong,lambert+ggx"

HOLDS = 0.5
"""Relative: the sharpening that was promised, averaged over what may be true, holds so well for one truth."""


def joined(one: fm.Measurements, other: fm.Measurements) -> fm.Measurements:
    assert one.sigma is not None
    assert other.sigma is not None
    parts = {n: np.concatenate([getattr(one, n), getattr(other, n)]) for n in ("wi", "wo", "value", "sigma", "valid")}
    return dataclasses.replace(one, **parts)


def measured(where: Advice, truth: dict[str, float], seed: int) -> fm.Measurements:
    """The curve that was advised, of the catalogue's material, with its noise."""
    theta_o = np.deg2rad(np.linspace(*where.theta_o_deg, 41))
    values: dict[str, Any] = dict(truth)
    material = fm.model("lambert+ggx", **values)
    return fm.simulate(
        material, [np.deg2rad(where.theta_i_deg)], theta_o, relative_noise=0.02, absolute_noise=1e-3, seed=seed
    )


def test_where_everything_is_known_nothing_is_advised() -> None:
    found = study(fm.read(CATALOGUE / "satin-plastic.csv"), PAIR, sampling=False)
    assert found.advice is None
    assert record.to_dict(found)["next"] is None
    assert cards(record.to_dict(found))[2].sentence.endswith("no further angle is needed.")


@pytest.mark.study
def test_the_angle_that_is_advised_tells_what_was_open() -> None:
    """At normal incidence η and ks are lost; with the curve both are found, and the truth lies within 4 sd."""
    truth = {"kd": 0.3, "ks": 1.0, "alpha": 0.05, "eta": 1.5}
    m = fm.read(CATALOGUE / "normal-incidence.csv")
    found = study(m, PAIR, sampling=False)
    assert found.advice is not None
    assert found.advice.gain > 10
    assert found.advice.target in {"ks", "eta"}
    told = record.to_dict(found)
    assert told["next"]["theta_i_deg"] == found.advice.theta_i_deg
    assert f"measure next: incidence {found.advice.theta_i_deg:.0f}°" in cards(told)[2].sentence
    again = fm.fit(joined(m, measured(found.advice, truth, 1)), "lambert+ggx")
    assert again.undetermined == ()
    sd = np.sqrt(np.diag(again.covariance))[: len(truth)]
    assert np.abs(again.values[: len(truth)] - list(truth.values())).max() < 4 * sd.max()


@pytest.mark.study
def test_a_weak_parameter_sharpens_as_promised() -> None:
    """Of a noisy file: the sd of a refit with the curve that was advised, over seeds."""
    m = fm.read(CATALOGUE / "noisy.csv")
    found = study(m, PAIR, sampling=False)
    where, fit = found.advice, found.findings[1].fit
    assert where is not None
    assert where.gain >= WORTH
    assert m.sigma is not None
    k = fit.coordinates.names.index(where.target)
    truth: dict[str, Any] = dict(zip(fit.coordinates.names, fit.values, strict=True))
    theta_o = np.deg2rad(np.linspace(*where.theta_o_deg, 41))
    law = np.median(m.sigma / np.abs(m.value))
    refits = []
    for seed in range(4):
        curve = fm.simulate(
            fm.model("lambert+ggx", **truth), [np.deg2rad(where.theta_i_deg)], theta_o,
            relative_noise=float(law), absolute_noise=1e-6, seed=seed,
        )  # fmt: skip
        refits.append(np.sqrt(fm.fit(joined(m, curve), "lambert+ggx").covariance[k, k]))
    assert np.sqrt(fit.covariance[k, k]) / np.mean(refits) == pytest.approx(where.gain, rel=HOLDS)
