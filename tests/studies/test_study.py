"""The story of one file: every number computed once, in the order of the work; an interrupt keeps what was done."""

import dataclasses
import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.batches import rows
from fitmat.errors import FitmatError
from fitmat.measurements.large import chunks
from fitmat.measurements.samples import Measurements
from fitmat.models.parameters import vector
from fitmat.models.simulation import simulate
from fitmat.reports import page, terminal
from fitmat.studies import findings, record
from fitmat.studies import study as room
from fitmat.studies.cards import cards
from fitmat.studies.result import POSTERIOR, RECORD, load
from fitmat.studies.sampling import forget
from fitmat.studies.study import DETAILED, Study, judge, study
from fitmat.uncertainty.posterior import Posterior

NAMES = ("lambert+blinn-phong", "lambert+ggx")

SAME = 1e-9
"""Relative; the same sums in another order."""


@pytest.fixture(scope="module")
def measurements() -> Measurements:
    """One channel, three incidences, 51 directions."""
    truth = fm.model("lambert+ggx", kd=0.3, alpha=0.3)
    angles = np.deg2rad([20, 45, 70]), np.deg2rad(np.arange(-80, 81, 10))
    return simulate(truth, *angles, relative_noise=0.02, absolute_noise=1e-3, seed=1)


@pytest.fixture(scope="module")
def studied(measurements: Measurements) -> Study:
    return study(measurements, NAMES, sampling=False, full=True)


def test_a_study_holds_one_noun_for_each_model(studied: Study, measurements: Measurements) -> None:
    assert [found.name for found in studied.findings] == list(NAMES)
    assert studied.measurements is measurements
    assert studied.match is not None
    assert studied.choice is not None
    assert len(studied.match.imitations) == 8
    for found in studied.findings:
        assert found.identifiability is not None
        assert found.check is not None
        assert found.second_opinion is None
        assert len(found.curves) == 3
        assert [q.name for q in found.parameters] == [*(e.name for e in found.fit.entries), "discrepancy"]
        assert [learnt.name for learnt in found.learnt] == list(found.fit.coordinates.names)
        assert found.residuals.shape == found.fit.data.x.shape


def test_a_short_study_says_the_same_of_less(
    studied: Study, measurements: Measurements, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A row of a table and the verdict are those of the whole; a page can be made, which shows less."""
    found = study(measurements, NAMES, sampling=False, short=True)
    assert found.match is not None
    assert studied.match is not None
    assert found.match.verdict == studied.match.verdict
    assert found.match.ablation is None  # nothing is said of it
    assert list(found.match.distances.whole) == ["relative"]
    assert found.match.cube_root_distance is None
    for row, other in zip(rows.rows(found), rows.rows(studied), strict=True):
        assert row.keys() == other.keys()
        for name, cell in row.items():
            assert cell == (pytest.approx(other[name], rel=SAME) if isinstance(cell, float) else other[name]), name
    for one in found.findings:
        assert (one.curves, one.budget, one.check, one.metrics, one.scope) == ((), None, None, {}, "")
        assert one.identifiability is not None
    assert json.loads(json.dumps(record.to_dict(found), allow_nan=False))["match"]["budget"] is None
    monkeypatch.setattr("fitmat.match.sentences.grazing_matters", lambda excess: True)
    said, whole = fm.compare(*found.posteriors, spheres=False, short=True).ablation, studied.match.ablation
    assert said is not None
    assert whole is not None
    assert said.near == {}
    for term, fall in said.grazing.items():
        assert fall.ci95 == pytest.approx(whole.grazing[term].ci95, rel=SAME)
    with_causes = dataclasses.replace(found, match=dataclasses.replace(found.match, ablation=said))
    assert fm.report(with_causes, tmp_path / "run").is_file()


def test_what_is_written_is_read_back(studied: Study, tmp_path: Path) -> None:
    """Every model with its values, intervals and draws; which of them the data prefer."""
    (tmp_path / RECORD).write_text(json.dumps(record.to_dict(studied)), encoding="utf-8")
    for posterior in studied.posteriors:
        posterior.save(tmp_path / POSTERIOR.format(posterior.fit.name))
    result = load(tmp_path)
    for one, found in zip(result.fits, studied.findings, strict=True):
        assert one.name == found.name
        assert np.array_equal(vector(one.model), found.fit.values)
        assert np.array_equal(one.draws, found.posterior.values)
        assert [q.name for q in one.parameters] == [q.name for q in found.parameters]
        for read, told in zip(one.parameters, found.parameters, strict=True):
            assert np.array_equal(read.ci95, told.ci95, equal_nan=True)
    assert studied.choice is not None
    assert result.fitted().name == studied.choice.best.name


def test_every_row_is_reported_where_some_are_shown(
    measurements: Measurements, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 51 rows with 3 masked 12 or so are at hand; from memory, and from a file read in parts."""
    valid = measurements.valid.copy()
    valid[[5, 20, 21]] = False
    given = dataclasses.replace(measurements, valid=valid, source="gold.csv")
    monkeypatch.setattr("fitmat.studies.large.MOST_AT_ONCE", 40)
    monkeypatch.setattr("fitmat.measurements.large.stream.PART", 12)
    found = study(given, "lambert", sampling=False)
    assert found.measurements.n_samples < 20
    written = record.to_dict(found)
    assert (written["n_samples"], written["n_masked"]) == (51, 3)
    assert str(found).startswith("gold.csv: 51 samples\n")
    path = tmp_path / "gold.csv"
    value = np.where(valid, measurements.value, np.nan)
    fm.write(dataclasses.replace(measurements, value=value), path)
    read = study(chunks.scan(path, rows=20, part=12), "lambert", sampling=False)
    assert (read.n_samples, read.n_masked) == (51, 3)
    assert read.measurements.n_samples < 20


def test_the_data_narrow_what_they_determine(studied: Study) -> None:
    """Uniform in ln α over 1e-4 to 1, then known to about a percent: a factor of hundreds."""
    alpha = next(learnt for learnt in studied.findings[1].learnt if learnt.name == "alpha")
    found = studied.findings[1].posterior
    after = np.log(found.values[:, found.fit.coordinates.names.index("alpha")]).std()
    assert alpha.narrower == pytest.approx(np.log(1e4) / np.sqrt(12.0) / after, rel=1e-9)


def test_everything_is_computed_once_and_then_read(
    measurements: Measurements, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The record, the page and the terminal call none of it, and each runs once for a model."""
    calls: Counter[str] = Counter()

    def counted(module: Any, name: str) -> None:
        real = getattr(module, name)

        def call(*arguments: Any, **options: Any) -> Any:
            calls[name] += 1
            return real(*arguments, **options)

        monkeypatch.setattr(module, name, call)

    watched = [
        (Posterior, "quantities"),
        (findings, "derived"),
        (findings, "find_doubts"),
        (findings, "fit_metrics"),
        (findings, "predict_curves"),
        (room, "identify"),
        (room, "check_predictions"),
    ]
    for module, name in watched:
        counted(module, name)
    counted(room, "compare")
    found = study(measurements, NAMES, sampling=False)
    assert found.match is not None
    assert found.match.imitations == ()  # which only a full study asks for
    record.to_dict(found)
    page.write(tmp_path, found)
    terminal.show(record.to_dict(found), tmp_path)
    assert calls == {**{name: 2 for _, name in watched}, "compare": 1}


def test_progress_names_every_stage(measurements: Measurements) -> None:
    told: list[str] = []
    study(measurements, "lambert", seed=1, progress=lambda what, *_: told.append(what))
    stages = list(dict.fromkeys(told))
    assert stages == ["fitting lambert", "sampling lambert", "comparing", "examining lambert"]


def test_an_interrupt_keeps_what_was_done(measurements: Measurements) -> None:
    def stop(what: str, done: int, total: int) -> None:
        if what == "sampling lambert" and done:
            raise KeyboardInterrupt

    found = study(measurements, "lambert,phong", progress=stop)
    first, second = found.posteriors
    assert first.interrupted
    assert first.diagnostics is not None
    assert not second.interrupted
    assert second.diagnostics is None


def test_a_missing_second_sampler_is_said_before_any_fit(
    measurements: Measurements, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "blackjax", None)
    monkeypatch.setattr(room, "laplace_each", lambda *_, **__: pytest.fail("a fit was started"))
    with pytest.raises(FitmatError, match=r"blackjax, .* install it with pip install 'fitmat\[nuts\]'"):
        study(measurements, "lambert", second_opinion=True)


def test_what_is_unknown_is_refused_before_any_fit(measurements: Measurements, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "laplace_each", lambda *_, **__: pytest.fail("a fit was started"))
    with pytest.raises(FitmatError, match="no lobe 'gxg'"):
        study(measurements, "gxg")


def test_of_many_models_a_few_are_examined_one_by_one(
    studied: Study, measurements: Measurements, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of the match, then the best."""
    monkeypatch.setattr(room, "identify", lambda posterior: None)
    monkeypatch.setattr(room, "check_predictions", lambda posterior, seed: posterior)
    worse = [dataclasses.replace(studied.posteriors[0]) for _ in range(DETAILED)]
    posteriors: list[Posterior] = [*worse, *studied.posteriors]
    found = judge(posteriors, seed=0)
    assert found.match is not None
    asked = [f.posterior for f in found.findings if f.check is not None]
    assert len(asked) == DETAILED
    assert {found.match.empirical, found.match.microfacet} <= set(asked)
    assert [f.posterior for f in found.detailed] == asked


@pytest.mark.parametrize(
    ("told", "most", "sentence"),
    [
        (
            {"sampling": False},
            10**6,
            r"a second opinion \(--check-posterior\) without sampling \(--no-mcmc\), expected",
        ),
        ({"loss": "ngan"}, 10**6, r"\(--check-posterior\) under the loss ngan \(--loss\), which is no likelihood"),
        ({}, 50, r"\(--check-posterior\) on 51 values, expected at most 50, which are sampled\. Leave it out"),
    ],
)
def test_a_second_opinion_needs_a_first(
    measurements: Measurements, monkeypatch: pytest.MonkeyPatch, told: dict[str, Any], most: int, sentence: str
) -> None:
    monkeypatch.setattr(room, "laplace_each", lambda *_, **__: pytest.fail("a fit was started"))
    monkeypatch.setattr(room, "MOST_SAMPLED", most)
    with pytest.raises(FitmatError, match=sentence):
        study(measurements, "lambert", second_opinion=True, **told)


def test_what_was_not_sampled_has_no_second_opinion(studied: Study, monkeypatch: pytest.MonkeyPatch) -> None:
    """As after an interrupt: the rest is told all the same."""
    monkeypatch.setattr(room, "identify", lambda posterior: None)
    monkeypatch.setattr(room, "check_predictions", lambda posterior, seed: posterior)
    found = judge(studied.posteriors[:1], seed=0, second_opinion=True)
    assert [f.second_opinion for f in found.findings] == [None]


def parts(thing: Any) -> dict[int, Any]:
    """All that a result is made of, by identity."""
    inner = list(thing) if isinstance(thing, tuple | list) else list(thing.values()) if isinstance(thing, dict) else []
    found = {}
    if dataclasses.is_dataclass(thing):
        found[id(thing)] = thing
        inner = [getattr(thing, field.name) for field in dataclasses.fields(thing)]
    for one in inner:
        found |= parts(one)
    return found


def test_a_prompt_shows_what_a_result_is(studied: Study) -> None:
    """Not the draws behind it: at most 2,000 characters, which begin with what it is."""
    every = parts((studied, fm.examine(studied.measurements))).values()
    assert {type(one).__name__ for one in every} >= {
        "Study",
        "Findings",
        "Match",
        "Choice",
        "Posterior",
        "Fit",
        "Examination",
    }
    for one in every:
        assert repr(one).startswith(type(one).__name__)
        assert len(repr(one)) <= 2000
    assert repr(studied).startswith("Study: simulated lambert+ggx: 51 samples\nlambert+blinn-phong: ")
    assert studied.match is not None
    assert repr(studied.match) == f"Match: {studied.match.verdict}"
    assert "ks" in repr(studied.findings[0].fit)


def test_what_a_run_kept_to_go_on_is_removed_and_nothing_else(tmp_path: Path) -> None:
    """Parts of models, also of those that an earlier run sampled; not the notes of a person beside them."""
    for model in NAMES:
        (tmp_path / "x.resume" / model).mkdir(parents=True)
        (tmp_path / "x.resume" / model / "00000050.part").touch()
    notes = tmp_path / "x.resume" / "mine.txt"
    notes.write_text("mine")
    forget(tmp_path / "x.resume")
    assert list(notes.parent.iterdir()) == [notes]
    notes.unlink()
    forget(tmp_path / "x.resume")
    forget(tmp_path / "x.resume")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.study
def test_a_pair_under_an_objective_is_matched_and_not_examined(measurements: Measurements) -> None:
    """It has no posterior of which anything could be determined or replicated."""
    found = study(measurements, NAMES, loss="log10", sampling=False)
    assert found.match is not None
    assert [(one.identifiability, one.check) for one in found.findings] == [(None, None)] * 2
    told = cards(record.to_dict(found))
    assert told[2].sentence == "In part: GGX is a single best fit under the loss log10, without intervals."
