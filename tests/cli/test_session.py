"""What a person at the terminal sees, and what Ctrl-C does there."""

import dataclasses
import io
import signal
from typing import Any

import numpy as np
import pytest
from rich.console import Console

import fitmat
from fitmat.cli import session
from fitmat.models.simulation import simulate
from fitmat.reports import terminal
from fitmat.studies import record
from fitmat.studies.cards import cards
from fitmat.studies.findings import find
from fitmat.studies.study import Study
from fitmat.uncertainty.laplace import laplace_each
from fitmat.uncertainty.posterior import Posterior


@pytest.fixture(scope="module")
def posterior() -> Posterior:
    truth = fitmat.model("lambert+ggx", channels=3, kd=np.array([0.4, 0.1, 0.2]), alpha=0.3)
    angles = np.deg2rad([20, 45, 70]), np.deg2rad(np.arange(-80, 81, 10))
    made = simulate(truth, *angles, relative_noise=0.02, absolute_noise=1e-3, seed=1)
    return laplace_each(made, {"lambert+ggx": {}}, seed=0)[0]


def told(posterior: Posterior) -> dict[str, Any]:
    """The record of a study of one model."""
    return record.to_dict(Study((find(posterior, ()),)))


@pytest.fixture(autouse=True)
def narrow(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")


def test_show_fits_80_columns(posterior, tmp_path):
    written = io.StringIO()
    screen = Console(file=written, width=80, force_terminal=True, color_system=None)
    terminal.show(told(posterior), tmp_path / "report.html", screen)
    out = written.getvalue()
    lines = out.splitlines()
    assert max(map(len, (line for line in lines if str(tmp_path) not in line))) <= 80
    assert "…" not in out
    assert lines[-1] == f"Report: {tmp_path / 'report.html'}"
    assert "lambert+ggx: converged, " in out
    for name in ("kd r", "kd g", "ks b", "alpha", "eta", "discrepancy", "→ f0", "→ roughness"):
        assert any(line.startswith(name) for line in lines)


def test_nothing_is_wrapped_where_there_is_no_terminal(posterior, capsys, tmp_path):
    """Sentences stay whole for whoever searches them, however narrow the window."""
    found = find(posterior, ())
    terminal.show(record.to_dict(Study((found,))), tmp_path)
    lines = capsys.readouterr().out.splitlines()
    (card, *_) = cards(record.to_dict(Study((found,))))
    assert any(line.endswith(card.sentence) for line in lines)
    assert found.fit.noise.words in lines


def test_the_answer_comes_first_then_parameters_doubts_and_the_path(posterior, capsys, tmp_path):
    """The sentences are those of the page."""
    found = told(posterior)
    found["warnings"] = ["something is odd."]
    terminal.show(found, tmp_path / "report.html")
    out = capsys.readouterr().out
    marks = [f"{card.title}  {card.sentence}" for card in cards(found)]
    marks += ["lambert+ggx: converged", "WARNING: something is odd.", f"Report: {tmp_path}"]
    places = [out.index(mark) for mark in marks]
    assert places == sorted(places)


def test_show_names_the_outcome(posterior, capsys, tmp_path):
    fit = dataclasses.replace(posterior.fit, result="unidentifiable", undetermined=("eta",))
    terminal.show(told(dataclasses.replace(posterior, fit=fit, interrupted=True)), tmp_path)
    out = capsys.readouterr().out
    assert "unidentifiable: At least one parameter is not determined" in out
    assert "interrupted: sampling was stopped" in out
    assert any(line.startswith("eta") and line.rstrip().endswith("not determined") for line in out.splitlines())


def test_brackets_in_names_are_text(posterior, capsys, tmp_path):
    measurements = dataclasses.replace(posterior.fit.measurements, source="[red]x.csv", channels=("[bold]", "g", "b"))
    fit = dataclasses.replace(posterior.fit, measurements=measurements)
    terminal.show(told(dataclasses.replace(posterior, fit=fit)), tmp_path / "[dim]" / "report.html")
    out = capsys.readouterr().out
    assert all(text in out for text in ("[red]x.csv", "kd [bold]", "[dim]/report.html"))


def test_ctrl_c_is_noted_while_sampling_only():
    """The first is raised at the next step; before and afterwards the signal belongs to whom it did."""
    before = signal.getsignal(signal.SIGINT)
    with session.watch() as told:
        told("fitting ggx", 0, 0)
        assert signal.getsignal(signal.SIGINT) is before
        told("sampling ggx", 0, 0)
        assert signal.getsignal(signal.SIGINT) is not before
        signal.raise_signal(signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) is before
        with pytest.raises(KeyboardInterrupt):
            told("sampling ggx", 50, 250)
        told("comparing", 0, 0)
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize("stage", ["comparing", None])
def test_ctrl_c_is_given_back_after_sampling(stage):
    before = signal.getsignal(signal.SIGINT)
    with session.watch() as told:
        told("sampling ggx", 0, 0)
        if stage is not None:
            told(stage, 0, 0)
            assert signal.getsignal(signal.SIGINT) is before
    assert signal.getsignal(signal.SIGINT) is before


def test_a_run_that_goes_on_says_so(monkeypatch):
    written = io.StringIO()
    told = session.Watch(Console(file=written, width=80, force_terminal=True))
    told.open("loading")
    told("sampling ggx, resumed at step 1,000", 1000, 0)
    told.close()
    assert "Sampling ggx, resumed at step 1,000.\n" in written.getvalue()


def test_a_line_a_stage_where_nobody_watches():
    """A pipe, and a terminal that cannot move its cursor: nothing is wrapped, nothing is said twice."""
    name = "lambert+" + "a-very-long-name-" * 8
    for moves, kind in ((False, "xterm"), (True, "dumb")):
        written = io.StringIO()
        told = session.Watch(Console(file=written, width=40, force_terminal=moves, _environ={"TERM": kind}))
        told.open("loading")
        for done in range(3):
            told(f"fitting {name}", done, 3)
            told.preparing("loading", name)
            told.preparing("compiling", name)
            told.preparing("", name)
        told("comparing", 0, 0)
        told.close()
        lines = written.getvalue().splitlines()
        assert lines == [f"Fitting {name}.", f"compiling {name}, once for this machine", "Comparing."]


def test_the_line_at_a_terminal_is_never_blank():
    written = io.StringIO()
    told = session.Watch(Console(file=written, width=100, force_terminal=True))
    told.open("loading")
    told("fitting ggx", 0, 0)
    told.preparing("compiling", "ggx")
    told.preparing("", "ggx")
    told.preparing("loading", "ggx")
    told("sampling ggx", 50, 200)
    told.close()
    shown = written.getvalue()
    assert shown.index("compiling ggx") < shown.rindex("fitting ggx ") < shown.index("sampling ggx")
    assert all(
        words in shown
        for words in ("loading", "fitting ggx", "compiling ggx, once for this machine", "loading ggx", "sampling ggx")
    )


def test_a_long_stage_says_how_far_it_is_where_there_is_no_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every half minute, with the time left at the speed since the stage began; news of it do not begin it anew."""
    now = [100.0]
    monkeypatch.setattr(session.time, "monotonic", lambda: now[0])
    written = io.StringIO()
    watch = session.Watch(Console(file=written))
    watch("fitting 1000 files", 200, 1000)
    for done, words in ((210, ""), (240, ""), (250, ", 1 refused"), (290, ", 1 refused"), (320, ", 1 refused")):
        now[0] += 16.0
        watch(f"fitting 1000 files{words}", done, 1000)
    assert written.getvalue().splitlines() == [
        "Fitting 1000 files.",
        "240 of 1,000, about 10 min left.",
        "Fitting 1000 files, 1 refused.",
        "320 of 1,000, about 8 min left.",
    ]
    now[0] += 100.0
    watch("weighing the models", 0, 0)
    watch("drawing 100 pages", 0, 100)
    now[0] += 60.0
    watch("drawing 100 pages", 50, 100)
    assert written.getvalue().splitlines()[4:] == [
        "Weighing the models.",
        "Drawing 100 pages.",
        "50 of 100, about 60 s left.",
    ]
    assert watch.most == 320


def test_at_a_terminal_news_of_a_stage_keep_its_bar() -> None:
    written = io.StringIO()
    watch = session.Watch(Console(file=written, force_terminal=True, width=100))
    watch.open("loading")
    watch("fitting 4 files", 1, 4)
    assert watch._bar is not None
    first = watch._bar.tasks[0]
    watch("fitting 4 files, 1 refused", 2, 4)
    assert watch._bar.tasks == [first]
    assert (first.description, first.completed) == ("fitting 4 files, 1 refused", 2)
    watch("weighing the models", 0, 0)
    assert watch._bar.tasks[0] is not first
    watch.close()
