"""Batches: rows are those of single studies, nothing is done twice or lost, and one bad file is one row."""

import json
import os
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from typer.testing import CliRunner

import fitmat as fm
from fitmat import files
from fitmat.batches import workers
from fitmat.batches.jobs import Job, digest, every_file, from_table
from fitmat.batches.rows import CARDS, SWATCH
from fitmat.batches.workers import studied
from fitmat.cli.application import app
from fitmat.errors import FitmatError, OutputError, ReadError
from fitmat.studies import record
from fitmat.studies.cards import cards

DATA = Path(__file__).parents[2] / "data" / "synthetic"

TOLD: dict[str, Any] = {"models": "lambert", "sampling": False}

SAME = 1e-9
"""Relative; the same program on the same numbers in another process."""


def one_by_one(jobs: Any, count: int, work: Callable[..., Any] = studied) -> Any:
    """As `workers.each`, in this process."""
    for key, told in list(jobs.items()):
        yield key, work(*told)


@pytest.fixture
def scans(tmp_path: Path) -> Path:
    """Two good files, one of them twice, one broken, one hidden, and a folder."""
    folder = tmp_path / "scans"
    (folder / "older").mkdir(parents=True)
    for name in ("sparse", "wax"):
        shutil.copy(DATA / f"{name}.csv", folder)
    shutil.copy(DATA / "wax.csv", folder / "wax again.csv")
    (folder / "bad.csv").write_text("theta_i,theta_o,brdf\n10,20,much\n", encoding="utf-8")
    (folder / ".hidden").write_text("x", encoding="utf-8")
    return folder


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "each", one_by_one)


@pytest.mark.study
@pytest.mark.usefixtures("here")
def test_rows_are_those_of_single_studies(scans: Path, tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []
    found = fm.batch(scans, tmp_path / "out", progress=lambda *said: told.append(said))
    table = pl.read_parquet(tmp_path / "out" / "results.parquet")
    assert table.equals(found.table)
    names = [Path(file).name for file in table["file"]]
    assert names == ["bad.csv", *(name for name in ("sparse.csv", "wax again.csv", "wax.csv") for _ in range(2))]
    for name in ("sparse.csv", "wax.csv"):
        alone = fm.study(DATA / name, sampling=False)
        assert alone.match is not None
        said = {name: card.sentence for name, card in zip(CARDS, cards(record.to_dict(alone)), strict=True)}
        for one in alone.findings:
            row = table.filter(pl.col("file").str.ends_with(f"/{name}"), pl.col("model") == one.name).row(0, named=True)
            assert row["outcome"] == one.fit.result
            assert row["best"] == (alone.choice is not None and alone.choice.candidates[0].name == one.name)
            assert row["material"].startswith("Like ")
            assert {name: row[name] for name in CARDS} == said
            assert row["match_distance"] == pytest.approx(alone.match.hemisphere_distance.value, rel=SAME)
            for q in one.parameters:
                assert row[q.name] == pytest.approx(q.value[0], rel=SAME)
                assert [row[f"{q.name}_low"], row[f"{q.name}_high"]] == pytest.approx(list(q.ci95[0]), rel=SAME)
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert "<h1>3 of 4 files fitted</h1>" in page
    assert page.count('src="data:image/png;base64,') == 3
    assert "swatch" not in table.columns
    bad = table.row(0, named=True)
    assert (bad["outcome"], bad["model"], bad["exponent"]) == ("refused", None, None)
    assert bad["message"].startswith("bad.csv")
    assert str(found) == f"3 of 4 files fitted.\n{bad['message']}"
    assert told[-1] == ("fitting 4 files, 1 refused", 4, 4)


@pytest.mark.usefixtures("here")
def test_what_is_done_is_not_done_again(scans: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """But for a file that changed, another question, and a part that is damaged."""
    asked: list[str] = []

    def counted(job: Job, content: str) -> Any:
        asked.append(job.path.name)
        return studied(job, content)

    monkeypatch.setattr(workers, "each", lambda jobs, count: one_by_one(jobs, count, counted))
    out = tmp_path / "out"
    first = fm.batch(scans, out, "lambert")
    assert sorted(asked) == ["bad.csv", "sparse.csv", "wax again.csv", "wax.csv"]
    asked.clear()
    again = fm.batch(scans, out, "lambert")
    assert asked == []
    assert again.table.equals(first.table)
    assert str(again).startswith("3 of 4 files fitted (4 known from an earlier run).")
    with (scans / "sparse.csv").open("a", encoding="utf-8") as file:
        file.write("20,5,0.1,0.003\n")
    fm.batch(scans, out, "lambert")
    assert asked == ["sparse.csv"]
    asked.clear()
    fm.batch(scans / "wax.csv", out, "lambert", studying={"fixed": {"kd": 0.5}}, force=True)
    assert asked == ["wax.csv"]
    fm.batch(scans, out, "lambert", force=True)
    for part in (out / "parts").iterdir():
        part.write_text("[", encoding="utf-8")
    asked.clear()
    assert len(fm.batch(scans, out, "lambert").table) == len(first.table)
    assert len(asked) == 4


def test_another_batch_takes_no_rows_away(scans: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files may be added, and change; a file that is left out, or asked otherwise, would lose its rows."""
    monkeypatch.setattr(workers, "each", lambda jobs, count: ((key, [FITTED]) for key in jobs))
    out, one = tmp_path / "out", scans / "wax.csv"
    fm.batch(one, out, "lambert")
    assert len(fm.batch([one, scans / "sparse.csv"], out, "lambert").table) == 2
    before = (out / "results.parquet").read_bytes()
    with pytest.raises(OutputError, match=r"out holds results of other data.*\(.*sparse\.csv\), which would be lost"):
        fm.batch(one, out, "lambert")
    with pytest.raises(OutputError, match=r"\(.*wax\.csv and 1 more\), which would be lost"):
        fm.batch([one, scans / "sparse.csv"], out, "ggx")
    assert (out / "results.parquet").read_bytes() == before
    assert len(fm.batch(one, out, "lambert", force=True).table) == 1
    assert len(list((out / "parts").iterdir())) == 1
    (out / "batch.json").unlink()  # as of a fitmat that wrote none
    with pytest.raises(OutputError, match=r"out holds results .* or --force to replace them"):
        fm.batch(one, out, "ggx")
    assert len(fm.batch(one, out, "ggx", force=True).table) == 1
    assert len(list((out / "parts").iterdir())) == 1
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "index.html").write_text("mine")
    with pytest.raises(OutputError, match=r"index\.html is not known to be of an earlier batch"):
        fm.batch(one, tmp_path / "own", "lambert", force=True)


@pytest.mark.parametrize("command", ["colour", "export", "render", "report", "plot", "cite", "compare"])
def test_a_batch_in_the_place_of_a_run_is_told_apart(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "each", lambda jobs, count: ((key, [FITTED]) for key in jobs))
    fm.batch(DATA / "wax.csv", tmp_path / "out", "lambert")
    ran = CliRunner().invoke(app, [command, str(tmp_path / "out"), *(["other"] if command == "compare" else [])])
    assert isinstance(ran.exception, ReadError)
    assert "out is the folder of a batch, which keeps one table (or arrays) of all, and no runs" in str(ran.exception)
    assert "fitmat fit FILE --out DIR" in str(ran.exception)


@pytest.mark.parametrize("text", [None, "", "theta_i,theta_o,brdf\n10,20,0.1\n"])
def test_a_file_that_changes_while_it_waits_is_done_again(
    text: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Removed, half copied, another: what is read of it is not kept for the file that it was."""
    path, whole = tmp_path / "wax.csv", (DATA / "wax.csv").read_text(encoding="utf-8")
    path.write_text(whole, encoding="utf-8")

    def meanwhile(jobs: Any, count: int) -> Any:
        path.unlink() if text is None else path.write_text(text, encoding="utf-8")
        yield from one_by_one(jobs, count)

    monkeypatch.setattr(workers, "each", meanwhile)
    found = fm.batch(path, tmp_path / "out", "lambert")
    assert found.counts["refused"] == 1
    assert str(found).split("\n")[1] == f"{path} changed while it waited. Give the same command again."
    path.write_text(whole, encoding="utf-8")
    monkeypatch.setattr(workers, "each", lambda jobs, count: ((key, [FITTED]) for key in jobs))
    assert fm.batch(path, tmp_path / "out", "lambert").counts == {"fitted": 1, "refused": 0, "earlier": 0}


FITTED: dict[str, Any] = {"outcome": "converged", "message": "", "model": "lambert", "best": True}


def test_names_that_differ_only_in_case_are_two_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts are named so that a disk which tells no capitals apart keeps both."""
    for name in ("wax.csv", "Wax.csv", "WAX.csv"):
        (tmp_path / name).write_text("the same", encoding="utf-8")
    if len(list(tmp_path.iterdir())) < 3:
        pytest.skip("this disk tells no capitals apart")
    monkeypatch.setattr(workers, "each", lambda jobs, count: ((k, [FITTED | {"doubts": k}]) for k in jobs))
    found = fm.batch(tmp_path / "*.csv", tmp_path / "out", "lambert")
    assert [Path(file).name for file in found.table["file"]] == ["WAX.csv", "Wax.csv", "wax.csv"]
    assert found.table["doubts"].n_unique() == 3
    assert len({path.name.lower() for path in (tmp_path / "out" / "parts").iterdir()}) == 3
    assert fm.batch(tmp_path / "*.csv", tmp_path / "out", "lambert").table.equals(found.table)


def test_a_full_disk_is_said_and_what_was_kept_serves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second part finds no room, as by a limit of the size of files; later there is some."""
    resource = pytest.importorskip("resource", reason="no limits on this system")
    for name in ("a", "b", "c"):
        (tmp_path / f"{name}.csv").write_text(name, encoding="utf-8")
    asked: list[str] = []

    def growing(jobs: Any, count: int) -> Any:
        del count
        for key, (job, _) in list(jobs.items()):
            asked.append(job.path.stem)
            yield key, [FITTED | {"doubts": "x" * (100_000 if job.path.stem == "b" else 1)}]

    monkeypatch.setattr(workers, "each", growing)
    out, limits = tmp_path / "out", resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, limits[1]))
    try:
        with pytest.raises(FitmatError, match=r"\.json: cannot be written \(File too large\); choose another place\.$"):
            fm.batch(tmp_path / "*.csv", out, "lambert")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert [path.suffix for path in (out / "parts").iterdir()] == [".json"]
    assert os.listdir(out) == ["parts"]
    found = fm.batch(tmp_path / "*.csv", out, "lambert")
    assert found.counts == {"fitted": 3, "refused": 0, "earlier": 1}
    assert asked == ["a", "b", "b", "c"]


def test_too_little_memory_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def greedy(*_: Any, **__: Any) -> Any:
        raise MemoryError

    monkeypatch.setattr(workers, "study", greedy)
    (row,) = studied(Job(DATA / "wax.csv", {}, TOLD), digest(DATA / "wax.csv"))
    assert (row["outcome"], row["message"].partition(";")[0]) == ("failed", "there is not enough memory")


@pytest.mark.usefixtures("here")
def test_a_name_that_is_no_text_is_kept_as_text(tmp_path: Path) -> None:
    """Of bytes that are no UTF-8, as a disk of another system has them; the file is used, or refused by that name."""
    for name, text in ((b"good\xff.csv", (DATA / "wax.csv").read_bytes()), (b"bad\xff.csv", b"theta_i,theta_o,brdf\n")):
        (tmp_path / os.fsdecode(name)).write_bytes(text)
    for earlier in (0, 2):
        found = fm.batch(tmp_path / "*.csv", tmp_path / "out", "lambert")
        assert found.counts["earlier"] == earlier
        assert [Path(file).name for file in found.table["file"]] == ["bad\\udcff.csv", "good\\udcff.csv"]
        assert pl.read_parquet(found.file).equals(found.table)
        assert str(found).split("\n")[1].startswith("bad\\udcff.csv: a header and no rows")


@pytest.mark.usefixtures("here")
def test_what_is_wrong_with_a_job_names_its_file(tmp_path: Path) -> None:
    shutil.copy(DATA / "wax.csv", tmp_path)
    (tmp_path / "jobs.csv").write_text("file,models,seed\nwax.csv,lambort,\nwax.csv,lambert,-1\n", encoding="utf-8")
    (tmp_path / "new\nline.csv").touch()
    found = fm.batch([tmp_path / "new\nline.csv"], tmp_path / "out", jobs=tmp_path / "jobs.csv")
    assert [words[:30] for words in str(found).split("\n")[1:]] == [
        "new\\nline.csv: the file is emp",
        "wax.csv: model 'lambort': no l",
        "wax.csv: seed is -1, expected ",
    ]


def test_a_fault_of_ours_is_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "study", lambda *_, **__: 1 / 0)
    (row,) = studied(Job(DATA / "wax.csv", {}, TOLD), digest(DATA / "wax.csv"))
    assert row["outcome"] == "failed"
    assert row["message"].startswith("ZeroDivisionError: division by zero. Please report it")


def test_a_table_of_jobs_says_what_differs(tmp_path: Path) -> None:
    table = tmp_path / "jobs.csv"
    table.write_text("file,theta_i,fix,models\na.csv,30,ks=1;kd=0.2,ggx\nb.csv,,,\n", encoding="utf-8")
    first, second = from_table(table, {"quantity": "brdf", "constants": {"phi": 0.0}}, TOLD)
    assert first.path == tmp_path / "a.csv"
    assert first.reading == {"quantity": "brdf", "constants": {"phi": 0.0, "theta_i": 30}}
    assert first.studying == TOLD | {"models": "ggx", "fixed": {"ks": 1.0, "kd": 0.2}}
    assert second.reading == {"quantity": "brdf", "constants": {"phi": 0.0}}
    assert second.studying == TOLD


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,ior\na.csv,Au\n", r"jobs\.csv: columns name, ior, expected file and any of angle_unit, columns, "),
        ("file,iors\na.csv,Au\n", r"jobs\.csv: a column 'iors', expected file and any of"),
        ("file,ior\n,Au\n", r"jobs\.csv: a row without a file, expected a path in each"),
        ("", r"jobs\.csv: no table of jobs can be read .*Write CSV with a column file"),
    ],
)
def test_a_table_of_jobs_that_says_nothing_is_refused(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "jobs.csv").write_text(text, encoding="utf-8")
    with pytest.raises(FitmatError, match=message):
        fm.batch([], tmp_path / "out", jobs=tmp_path / "jobs.csv")


def test_what_is_not_there_is_refused_before_anything(tmp_path: Path) -> None:
    with pytest.raises(FitmatError, match=r"nowhere: no such file or folder, and no file of that pattern"):
        fm.batch(tmp_path / "nowhere", tmp_path / "out")
    (tmp_path / "empty").mkdir()
    with pytest.raises(FitmatError, match=r"empty holds no file, expected measurements"):
        fm.batch(tmp_path / "empty", tmp_path / "out")
    with pytest.raises(FitmatError, match=r"no lobe 'lambort'"):
        fm.batch(DATA / "wax.csv", tmp_path / "out", "lambort")
    with pytest.raises(FitmatError, match=r"no file is given, expected files, a folder, a pattern or a table"):
        fm.batch([], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_patterns_and_folders_give_each_file_once(scans: Path) -> None:
    found = every_file([scans, scans / "wax*.csv"])
    assert [path.name for path in found] == ["bad.csv", "sparse.csv", "wax again.csv", "wax.csv"]


@pytest.mark.usefixtures("here")
def test_two_batches_do_not_write_to_one_folder(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with files.alone(out), pytest.raises(FitmatError, match=r"out is being written by another run; wait for it"):
        fm.batch(DATA / "wax.csv", out, "lambert")
    assert len(fm.batch(DATA / "wax.csv", out, "lambert").table) == 1
    assert sorted(os.listdir(out)) == ["batch.json", "index.html", "parts", "results.parquet"]


def deadly(job: Job, content: str) -> Any:
    """Dies of the file "kills.csv" always, of "once.csv" the first time."""
    mark = job.path.with_suffix(".seen")
    if job.path.name == "kills.csv" or (job.path.name == "once.csv" and not mark.exists()):
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return [{"outcome": "converged", "message": "", "content": content}]


@pytest.mark.study
def test_a_worker_that_dies_loses_nothing_but_its_file(tmp_path: Path) -> None:
    """One that dies once is tried again; the others are not asked for what they did."""
    for name in ("a", "once", "kills", "b", "c"):
        (tmp_path / f"{name}.csv").write_text(name, encoding="utf-8")
    jobs = {path.stem: (Job(path, {}, {}), path.stem) for path in sorted(tmp_path.glob("*.csv"))}
    found = dict(workers.each(jobs, 2, deadly))
    assert {key: row["outcome"] for key, (row,) in found.items()} == {
        "a": "converged", "b": "converged", "c": "converged", "kills": "failed", "once": "converged",
    }  # fmt: skip
    assert found["kills"][0]["message"].endswith("it was killed, or there was not enough memory.")


@pytest.mark.study
def test_processes_side_by_side_find_what_one_finds(scans: Path, tmp_path: Path) -> None:
    both = fm.batch(scans, tmp_path / "both", "lambert,ggx", processes=2)
    (tmp_path / "both" / "results.parquet").unlink()
    parts = {path.name: json.loads(path.read_text()) for path in (tmp_path / "both" / "parts").iterdir()}
    assert len(parts) == 4
    alone = {path.name: studied(Job(path, {}, TOLD | {"models": "lambert,ggx"}), digest(path))
             for path in every_file([scans])}  # fmt: skip
    for row in both.table.iter_rows(named=True):
        meant = next(one for one in alone[Path(row["file"]).name] if one.get("model") == row["model"])
        told = {name: value for name, value in meant.items() if name not in (SWATCH, "seconds")}
        assert {name: row[name] for name in told} == told
