"""Runs of a batch: what `fitmat fit` leaves of each file, beside rows that are the same without them."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import polars as pl
import pytest

import fitmat as fm
from fitmat.batches import workers
from fitmat.batches.jobs import Job
from fitmat.batches.workers import studied

DATA = Path(__file__).parents[2] / "data" / "synthetic"

SAME = 1e-9
"""Relative; a short study and a whole one may add in another order."""


def one_by_one(jobs: Any, count: int, work: Callable[..., Any] = studied) -> Any:
    """As `workers.each`, in this process."""
    del count
    for key, told in list(jobs.items()):
        yield key, work(*told)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the files that were studied."""
    names: list[str] = []

    def counted(job: Job, content: str) -> Any:
        names.append(job.path.name)
        return studied(job, content)

    monkeypatch.setattr(workers, "each", lambda jobs, count: one_by_one(jobs, count, counted))
    return names


@pytest.fixture
def scans(tmp_path: Path) -> Path:
    """Two files whose names differ in case alone, and one that is broken."""
    folder = tmp_path / "scans"
    folder.mkdir()
    shutil.copy(DATA / "wax.csv", folder / "a b.csv")
    shutil.copy(DATA / "sparse.csv", folder / "A B.csv")
    (folder / "bad.csv").write_text("theta_i,theta_o,brdf\n10,20,much\n", encoding="utf-8")
    return folder


def test_each_file_leaves_a_run(scans: Path, tmp_path: Path, asked: list[str]) -> None:
    """That `fitmat.load` reads, to which its line leads; rows stay, but for the run's name and the seconds."""
    plain = fm.batch(scans, tmp_path / "plain", "lambert")
    found = fm.batch(scans, tmp_path / "out", "lambert", runs=True)
    assert len(asked) == 6
    names = found.table["run"].drop_nulls().to_list()
    assert sorted(os.listdir(tmp_path / "out" / "runs")) == sorted(names)
    assert len({name.casefold() for name in names}) == 2
    rows = (table.filter(pl.col("model").is_not_null()).iter_rows(named=True) for table in (found.table, plain.table))
    for row, alone in zip(*rows, strict=True):
        kept = fm.load(tmp_path / "out" / "runs" / row["run"])
        assert kept.record["fits"][0]["parameters"]["kd"]["value"] == pytest.approx(row["kd"], rel=SAME)
        assert row["seconds"] > 0
        for name, cell in alone.items():
            if name != "seconds":
                assert row[name] == (pytest.approx(cell, rel=SAME) if isinstance(cell, float) else cell)
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    for name in names:
        assert f'href="runs/{name.replace(" ", "%20")}/report.html"' in page


def test_a_run_that_is_gone_is_made_again_and_nothing_else(scans: Path, tmp_path: Path, asked: list[str]) -> None:
    out = tmp_path / "out"
    first = fm.batch(scans, out, "lambert", runs=True)
    asked.clear()
    fm.batch(scans, out, "lambert", runs=True)
    assert asked == []
    gone = first.table.filter(pl.col("file").str.ends_with("a b.csv"))["run"][0]
    shutil.rmtree(out / "runs" / gone)
    again = fm.batch(scans, out, "lambert", runs=True)
    assert asked == ["a b.csv"]
    assert (out / "runs" / gone / "fit.json").exists()
    assert again.table.drop("seconds").equals(first.table.drop("seconds"))


def test_stale_runs_go_and_what_is_the_users_stays(scans: Path, tmp_path: Path, asked: list[str]) -> None:
    """Those of a file that changed, or is no longer asked for; a batch without runs lets those of its files be."""
    out = tmp_path / "out"
    before = set(fm.batch(scans, out, "lambert", runs=True).table["run"].drop_nulls())
    (noted,) = (name for name in before if name.startswith("a b"))
    (out / "runs" / noted / "note.txt").write_text("mine", encoding="utf-8")
    fm.batch(scans, out, "lambert")
    assert set(os.listdir(out / "runs")) == before
    with (scans / "a b.csv").open("a", encoding="utf-8") as file:
        file.write("20,5,0.1,0.003\n")
    after = set(fm.batch(scans, out, "lambert", runs=True).table["run"].drop_nulls())
    assert len(after - before) == 1
    assert set(os.listdir(out / "runs")) == after | {noted}
    assert os.listdir(out / "runs" / noted) == ["note.txt"]
    fm.batch(scans / "A B.csv", out, "lambert", force=True)
    assert os.listdir(out / "runs") == [noted]


def test_a_run_that_cannot_be_written_is_a_row_that_is_not_kept(scans: Path, tmp_path: Path, asked: list[str]) -> None:
    """As where a file stands in the way, here in the place of the folder of runs."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "runs").write_text("in the way", encoding="utf-8")
    found = fm.batch(scans / "a b.csv", out, "lambert", runs=True)
    assert found.table["outcome"].to_list() == ["failed"]
    assert "cannot write" in found.table["message"][0]
    (out / "runs").unlink()
    asked.clear()
    assert fm.batch(scans / "a b.csv", out, "lambert", runs=True).counts["fitted"] == 1
    assert asked == ["a b.csv"]


def test_a_foreign_record_in_the_folder_of_a_run_is_not_replaced(scans: Path, tmp_path: Path, asked: list[str]) -> None:
    out = tmp_path / "out"
    name = fm.batch(scans / "a b.csv", out, "lambert", runs=True).table["run"][0]
    for file in (out / "runs" / name).iterdir():
        file.unlink()
    (out / "runs" / name / "report.html").write_text("mine", encoding="utf-8")
    found = fm.batch(scans / "a b.csv", out, "lambert", runs=True)
    assert "not known to be of an earlier run" in found.table["message"][0]
    assert (out / "runs" / name / "report.html").read_text(encoding="utf-8") == "mine"
    fm.batch(scans / "A B.csv", out, "lambert", force=True)
    assert os.listdir(out / "runs" / name) == ["report.html"]
