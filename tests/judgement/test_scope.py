"""Scope: which incidences the intervals are about, and as how many independent readings those measured count."""

import dataclasses

import numpy as np
import pytest

import fitmat as fm
from fitmat.fitting.result import Fit
from fitmat.judgement.scope import describe_scope

ANGLES = np.deg2rad([10.0, 30.0, 50.0, 70.0]), np.deg2rad(np.arange(-80.0, 81.0, 2.0))
ABOUT = "The intervals of lambert+ggx are about the incidences measured (10–70°); beyond, they extrapolate."


@pytest.fixture(scope="module")
def made() -> fm.Measurements:
    """324 values of a satin plastic, σ given."""
    truth = fm.model("lambert+ggx", kd=0.2, alpha=0.2)
    return fm.simulate(truth, *ANGLES, relative_noise=0.02, absolute_noise=1e-3, seed=1)


@pytest.fixture(scope="module")
def fit(made: fm.Measurements) -> Fit:
    return fm.fit(made, "lambert+ggx")


def test_a_right_model_tells_where_it_was_measured(fit: Fit) -> None:
    assert describe_scope(fit) == ABOUT


def test_alike_misfits_are_counted(made: fm.Measurements) -> None:
    """A peak towards the light, which no model here has."""
    back = 0.5 * np.exp(-(((made.signed_theta_o + made.theta_i) / 0.1) ** 2))
    wrong = fm.fit(dataclasses.replace(made, value=made.value + back[:, None]), "lambert+ggx")
    found = wrong.correlation
    assert 1.0 < found.independent < 324.0
    counted = f"{found.independent:.0f}" if found.independent >= 10 else f"{found.independent:.2g}"
    shared = found.shared[0].upper() + found.shared[1:]
    wider = f"{np.sqrt(found.inflation.max()):.2g}"
    assert describe_scope(wrong) == (
        f"{ABOUT} {shared}: 324 readings count as {counted} independent ones. The intervals "
        f"allow for that: they are up to {wider} times wider."
    )


def test_few_readings_are_said_to_be_few(fit: Fit) -> None:
    """The first twelve, of one incidence."""
    weight = np.where(np.arange(len(fit.data.x)) < 12, 1.0, 0.0)[:, None]
    few = dataclasses.replace(fit, data=dataclasses.replace(fit.data, weight=weight), n_values=12)
    assert "(10°)" in describe_scope(few)
    assert describe_scope(few).endswith("cannot be judged from 12 readings: they hold only if the model is right.")


def test_what_has_no_interval_has_no_scope(fit: Fit) -> None:
    assert describe_scope(dataclasses.replace(fit, log_likelihood=np.nan)) == ""
