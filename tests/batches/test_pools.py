"""Pools of a batch: columns and sentences from the rows that fits left, and what cannot be pooled."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import fitmat as fm
from fitmat.batches import workers
from fitmat.errors import FitmatError
from fitmat.maths.hierarchy import population
from fitmat.maths.normal import Z95

INDEX = np.array([1.46, 1.50, 1.53, 1.49, 1.61])
SPREAD = np.array([0.02, 0.01, 0.03, 0.20, 0.04])
"""ln η of five files is known to within this."""


def row(k: int, **more: Any) -> dict[str, Any]:
    low, high = (float(INDEX[k] * np.exp(side * Z95 * SPREAD[k])) for side in (-1, 1))
    told = {"eta": float(INDEX[k]), "eta_low": low, "eta_high": high, "eta_remark": ""}
    return {"outcome": "converged", "message": "", "model": "lambert+ggx", "best": True} | told | more


@pytest.fixture
def scans(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Five files whose fits are the rows above; more of each row stands in the file."""
    folder = tmp_path / "scans"
    folder.mkdir()
    for k in range(5):
        (folder / f"{k}.csv").write_text("{}", encoding="utf-8")

    def each(jobs: Any, count: int) -> Any:
        del count
        for key, (job, _) in list(jobs.items()):
            yield key, [row(int(job.path.stem), **json.loads(job.path.read_text(encoding="utf-8")))]

    monkeypatch.setattr(workers, "each", each)
    return folder


def test_columns_and_sentence_are_those_of_the_hierarchy(scans: Path, tmp_path: Path) -> None:
    """In ln η, the coordinate of its fits; with the pool nothing is fitted again, and the other columns stay."""
    first = fm.batch(scans, tmp_path / "out", "lambert+ggx")
    found = fm.batch(scans, tmp_path / "out", "lambert+ggx", pool="eta")
    assert found.counts == {"fitted": 5, "refused": 0, "earlier": 5}
    assert pl.read_parquet(found.file).select(first.table.columns).equals(first.table)
    meant = population(np.log(INDEX), SPREAD)
    for name, column in (("", meant.members[:, 1]), ("_low", meant.members[:, 0]), ("_high", meant.members[:, 2])):
        assert found.table[f"eta_pooled{name}"].to_numpy() == pytest.approx(np.exp(column), rel=1e-9)
    assert found.table["eta_pooled_sd"].to_numpy() == pytest.approx(meant.sd * np.exp(meant.members[:, 1]), rel=1e-9)
    (pool,) = found.pooled
    assert pool.centre == pytest.approx(np.exp(meant.centre), rel=1e-9)
    assert pool.following[0] < pool.centre[0]
    count, sentence = str(found).split("\n")
    assert count == "5 of 5 files fitted (5 known from an earlier run)."
    assert sentence.startswith("eta of lambert+ggx, pooled over 5: 1.507 (95 % 1.4")
    assert sentence == str(pool)
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8").replace("&nbsp;", " ")
    assert f"<p>{sentence}</p>" in page
    assert not fm.batch(scans, tmp_path / "out", "lambert+ggx").pooled


def test_what_is_open_is_drawn_to_the_others_and_what_is_known_stays(scans: Path, tmp_path: Path) -> None:
    table = fm.batch(scans, tmp_path / "out", "lambert+ggx", pool=["eta"]).table
    assert table["eta_pooled"][1] == pytest.approx(INDEX[1], rel=0.005)
    loose = table.row(3, named=True)
    assert loose["eta_pooled_high"] - loose["eta_pooled_low"] < 0.6 * (loose["eta_high"] - loose["eta_low"])


def test_files_on_a_bound_held_or_refused_take_no_part(scans: Path, tmp_path: Path) -> None:
    for k, words in ((0, '{"eta_remark": "at its lower bound"}'), (4, '{"eta_remark": "fixed"}')):
        (scans / f"{k}.csv").write_text(words, encoding="utf-8")
    found = fm.batch(scans, tmp_path / "out", "lambert+ggx", pool="eta")
    assert found.table["eta_pooled"].is_null().to_list() == [True, False, False, False, True]
    assert found.pooled[0].count == 3
    assert str(found).endswith(" 2 left out: on a bound, held, or without an interval.")
    (scans / "3.csv").write_text('{"eta_low": null, "eta_high": null}', encoding="utf-8")
    few = fm.batch(scans, tmp_path / "out", "lambert+ggx", pool="eta")
    assert "eta_pooled" not in few.table.columns
    assert str(few).split("\n")[1] == (
        "eta of lambert+ggx not pooled: 2 have an interval of it, expected at least 3. 3 left out: on a bound, held, "
        "or without an interval."
    )


def test_a_file_named_twice_counts_once(scans: Path, tmp_path: Path) -> None:
    jobs = scans / "jobs.csv"
    jobs.write_text("file\n" + "".join(f"{k}.csv\n" for k in (0, 1, 2, 0)), encoding="utf-8")
    found = fm.batch([], tmp_path / "out", "lambert+ggx", jobs=jobs, pool="eta")
    assert found.pooled[0].count == 3
    assert found.table["eta_pooled"][3] == found.table["eta_pooled"][0]


def test_each_channel_is_pooled_by_itself(scans: Path, tmp_path: Path) -> None:
    for k in range(5):
        told = {f"kd {c}{end}": x + 0.01 * k for c, at in (("r", 0.1), ("g", 0.5)) for end, x in
                (("", at), ("_low", at - 0.02), ("_high", at + 0.02))}  # fmt: skip
        (scans / f"{k}.csv").write_text(json.dumps(told), encoding="utf-8")
    found = fm.batch(scans, tmp_path / "out", "lambert+ggx", pool="kd")
    assert [pool.name for pool in found.pooled] == ["kd r of lambert+ggx", "kd g of lambert+ggx"]
    assert [pool.centre[1] for pool in found.pooled] == pytest.approx([0.12, 0.52], abs=0.01)
    assert {"kd r_pooled", "kd g_pooled_high"} <= set(found.table.columns)


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"pool": "etta"}, r"pool etta \(--pool\): no model of lambert\+ggx has it, expected one of kd, ks, al"),
        ({"studying": {"fixed": {"eta": 1.5}}}, r"pool eta \(--pool\): it is held, expected a parameter that is"),
        ({"studying": {"priors": {"eta": (1.5, 0.1)}}}, r"pool eta \(--pool\): it has a prior \(--prior\), expect"),
        ({"sources": 2}, r"pool eta \(--pool\): 2 files, expected at least 3, of which some can differ"),
        ({"pool": ""}, r"pool is the text '', expected the name of a parameter"),
    ],
)  # fmt: skip
def test_what_cannot_be_pooled_is_said_before_anything(told: Any, message: str, scans: Path, tmp_path: Path) -> None:
    asked: dict[str, Any] = {"pool": "eta"} | told
    files = sorted(scans.iterdir())[: asked.pop("sources", 5)]
    with pytest.raises(FitmatError, match=message):
        fm.batch(files, tmp_path / "out", "lambert+ggx", **asked)
    assert not (tmp_path / "out").exists()


def test_a_name_that_only_the_files_could_have_told_loses_nothing(scans: Path, tmp_path: Path) -> None:
    with pytest.raises(FitmatError, match=r"pool etta \(--pool\): no model of lambert\+ggx has it, expected one of kd"):
        fm.batch(scans, tmp_path / "out", "all", pool="etta")
    assert fm.batch(scans, tmp_path / "out", "all").counts["earlier"] == 5
