"""What a person at the terminal sees, and which option concerns which model."""

import dataclasses
import signal
import sys

import numpy as np
import pytest

import fitmat
from fitmat.cli import session
from fitmat.errors import FitmatError, ModelError
from fitmat.models.simulation import simulate
from fitmat.reports import terminal
from fitmat.studies.study import Study
from fitmat.uncertainty.posterior import Posterior


@pytest.fixture(scope="module")
def posterior() -> Posterior:
    truth = fitmat.model("lambert+ggx", channels=3, kd=np.array([0.4, 0.1, 0.2]), alpha=0.3)
    angles = np.deg2rad([20, 45, 70]), np.deg2rad(np.arange(-80, 81, 10))
    made = simulate(truth, *angles, relative_noise=0.02, absolute_noise=1e-3, seed=1)
    return session.fitted(made, session.Plan({"lambert+ggx": {}}))[0]


@pytest.fixture(autouse=True)
def narrow(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")


def test_model_names_are_tidied():
    assert session.model_names(" lambert + GGX,phong,,lambert+ggx") == ["lambert+ggx", "phong"]


def test_no_model_name():
    with pytest.raises(ModelError, match="no model given; try --models lambert"):
        session.model_names(" , ")


def test_show_fits_80_columns(posterior, capsys, tmp_path):
    terminal.show(Study((posterior,)), tmp_path)
    out = capsys.readouterr().out
    lines = out.splitlines()
    assert max(map(len, (line for line in lines if str(tmp_path) not in line))) <= 80
    assert "…" not in out
    assert lines[-1] == f"Report: {tmp_path / 'report.html'}"
    assert "lambert+ggx: converged, " in out
    for name in ("kd r", "kd g", "ks b", "alpha", "eta", "discrepancy", "→ f0", "→ roughness"):
        assert any(line.startswith(name) for line in lines)


def test_show_names_the_outcome(posterior, capsys, tmp_path):
    fit = dataclasses.replace(posterior.fit, result="unidentifiable", undetermined=("eta",))
    terminal.show(Study((dataclasses.replace(posterior, fit=fit, interrupted=True),)), tmp_path)
    out = capsys.readouterr().out
    assert "unidentifiable: At least one parameter is not determined" in out
    assert "interrupted: sampling was stopped" in out
    assert any(line.startswith("eta") and line.rstrip().endswith("not determined") for line in out.splitlines())


def test_brackets_in_names_are_text(posterior, capsys, tmp_path):
    measurements = dataclasses.replace(posterior.fit.measurements, source="[red]x.csv", channels=("[bold]", "g", "b"))
    fit = dataclasses.replace(posterior.fit, measurements=measurements)
    terminal.show(Study((dataclasses.replace(posterior, fit=fit),)), tmp_path / "[dim]")
    out = capsys.readouterr().out
    assert all(text in out for text in ("[red]x.csv", "kd [bold]", "[dim]/report.html"))


def test_options_go_to_the_models_that_have_them(posterior):
    fixed = {"exponent": np.array([20.0]), "kd": np.array([0.3])}
    names = ["lambert+phong", "lambert+ggx"]
    measurements = posterior.fit.measurements
    plan = session.Plan({name: {} for name in names}, fixed, masking="separable")
    assert [sorted(p.fit.held) for p in session.fitted(measurements, plan)] == [["exponent", "kd"], ["kd"]]


@pytest.mark.parametrize(
    ("chosen", "sentence"),
    [
        ({"fixed": {"zz": np.array([1.0])}}, r"--fix zz: no model of lambert has it; they have kd\."),
        ({"priors": {"eta": (1.5, 0.1)}}, r"--prior eta: no model of lambert has it; they have kd\."),
        ({"masking": "separable"}, "--masking separable: none of lambert has a masking to choose"),
    ],
)
def test_options_that_concern_no_model(posterior, chosen, sentence):
    measurements = posterior.fit.measurements
    with pytest.raises(ModelError, match=sentence):
        session.study(measurements, session.Plan({"lambert": {}}, sampling=False, **chosen))


def test_a_missing_second_sampler_is_said_before_any_fit(posterior, monkeypatch):
    monkeypatch.setitem(sys.modules, "blackjax", None)
    monkeypatch.setattr(session, "_fitted", lambda *_: pytest.fail("a fit was started"))
    with pytest.raises(FitmatError, match=r"blackjax, .* install it with pip install 'fitmat\[nuts\]'"):
        session.study(posterior.fit.measurements, session.Plan({"lambert": {}}, second_opinion=True))


def test_handler_is_restored_after_sampling(posterior, monkeypatch):
    before = signal.getsignal(signal.SIGINT)
    seen = []

    def sample(found, *, seed, progress, checkpoint):
        seen.append(signal.getsignal(signal.SIGINT))
        progress(1, 2)
        return posterior

    monkeypatch.setattr(session, "sample", sample)
    monkeypatch.setattr(session, "concluded", lambda found, match, **_: Study(tuple(found), match))
    session.study(posterior.fit.measurements, session.Plan({"lambert+ggx": {}}))
    assert seen[0] is not before
    assert signal.getsignal(signal.SIGINT) is before
