"""Batch: many files studied side by side, each kept when it is done, and the table of them all.

What was done before is not done again; what cannot be done is a row that says why.
"""

import dataclasses
import io
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from fitmat import arguments, files
from fitmat._types import Progress
from fitmat.batches import cluster, pools, record, rows, workers
from fitmat.batches.jobs import Job, digest, every_file, from_table
from fitmat.batches.record import PARTS, Claim
from fitmat.batches.runs import RUN, RUNS, is_there, link
from fitmat.errors import FitmatError, OutputError
from fitmat.fitting.asking import asked
from fitmat.fitting.pooling import Pooled
from fitmat.reports import summary
from fitmat.studies import DEFAULT_MODELS
from fitmat.studies.plan import named, wants_all
from fitmat.text import brief, visible

TABLE, PAGE = "results.parquet", "index.html"
"""What a batch leaves in its folder: the table and its page."""

Waiting = Mapping[str, tuple[Job, str]]
"""Key → job and the digest of its file."""

Do = Callable[[Waiting], Iterator[tuple[str, workers.Rows]]]
"""Who does what waits."""


@dataclasses.dataclass(frozen=True, eq=False)
class Batch:
    """What a batch found.

    Attributes:
        file: The table on disk.
        table: One row for each file and model.
        counts: Files that were fitted, refused, and that were done by an earlier run.
        pooled: Of each parameter that was pooled and each model, what the files tell of it together.
    """

    file: Path
    table: pl.DataFrame
    counts: Mapping[str, int]
    pooled: tuple[Pooled, ...] = ()

    __repr__ = brief

    def __str__(self) -> str:
        """How many files were fitted, what was pooled, and why some files were not fitted."""
        told = f"{self.counts['fitted']} of {self.counts['fitted'] + self.counts['refused']} files fitted"
        again = f" ({self.counts['earlier']} known from an earlier run)" if self.counts["earlier"] else ""
        lost = self.table.filter(pl.col("outcome").is_in([rows.REFUSED, rows.FAILED]))
        why = lost["file", "message"].iter_rows() if len(lost) else ()
        return "\n".join([f"{told}{again}.", *map(str, self.pooled), *(_of_file(*words) for words in why)])


def batch(
    sources: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    folder: str | os.PathLike[str],
    models: str | Sequence[str] = DEFAULT_MODELS,
    *,
    jobs: str | os.PathLike[str] | None = None,
    reading: Mapping[str, Any] | None = None,
    studying: Mapping[str, Any] | None = None,
    processes: int | None = None,
    scheduler: str | None = None,
    pool: str | Sequence[str] | None = None,
    runs: bool = False,
    force: bool = False,
    progress: Progress | None = None,
) -> Batch:
    """Study every file, and write one table of all.

    Args:
        sources: Files, folders, patterns such as "scans/*.csv"; may be empty where `jobs` is given.
        folder: For `results.parquet` and its page `index.html`, and what is kept to go on after an interruption.
        models: As in `fitmat.study`.
        jobs: A table with a column `file`, and others for what differs from file to file: `columns`, `ior`, `fix`, ….
        reading: Arguments of `fitmat.read` for every file.
        studying: Arguments of `fitmat.study` for every file; without "sampling" the posteriors are Laplace's.
        processes: How many work side by side; None for one for each core.
        scheduler: Address of a Dask scheduler, such as "tcp://10.0.0.1:8786", whose workers do the work instead; they
            must see the files under the same paths.
        pool: Parameters in which the files are taken to be of one kind, as the index of one lacquer: each is drawn to
            the others as far as its own data leave it open. They are columns NAME_pooled of the table beside the
            others; what was fitted stays.
        runs: Whether each file leaves a run of its own too, with its page, in the folder `runs`; slower.
        force: Replace the results in the folder though some are of files, or of arguments, that are not given now.
        progress: Called with what is done next.

    Returns:
        A `Batch`; a file that cannot be used is a row with its sentence.

    Raises:
        FitmatError: no file is found, a table of jobs cannot be read, results would be lost and `force` is off, another
            batch writes there, the disk refuses, the cluster cannot be used, or what is to be pooled is held, unknown,
            or of fewer than three files.

    Example:
        >>> batch("scans/*.csv", "results").table  # doctest: +SKIP
    """
    arguments.kind("folder", folder, str, os.PathLike)
    arguments.whole("processes", processes, 1, optional=True)
    arguments.kind("scheduler", scheduler, str, optional=True)
    arguments.flags(runs=runs, force=force)
    arguments.function("progress", progress)
    arguments.named(reading=reading, studying=studying)
    if not wants_all(models):
        named(models)
    told = {"sampling": False} | dict(studying or {}) | {"models": models}
    target, names, listed = Path(folder), asked("pool", pool), _jobs(sources, jobs, dict(reading or {}), told)
    pools.refuse_idle(names, listed, told)
    if runs:
        listed = [dataclasses.replace(job, runs=target / RUNS) for job in listed]
    if scheduler is not None and processes is not None:
        arguments.refuse("processes", processes, "None with a scheduler, whose workers are as many as they are")
    with files.alone(target):
        claim = record.claimed(target, _each(listed), (TABLE, PAGE), force=force)
        return _studied(listed, claim, _doing(processes, scheduler), names, progress or (lambda *_: None))


def _each(every: Sequence[Job]) -> dict[str, str]:
    """Each file, and as a digest how it is read and studied; what is in it may change, and what is pooled."""
    how: dict[str, list[Any]] = {}
    for job in every:
        how.setdefault(os.path.abspath(job.path), []).append([job.reading, job.studying])
    return {path: record.digest(each) for path, each in how.items()}


def _doing(processes: int | None, scheduler: str | None) -> Do:
    """Who does the work: these processes, or a cluster."""
    if scheduler is not None:
        return lambda waiting: cluster.each(waiting, scheduler)
    return lambda waiting: workers.each(waiting, processes or os.cpu_count() or 1)


def _jobs(sources: Any, table: Any, reading: dict[str, Any], told: dict[str, Any]) -> list[Job]:
    arguments.kind("jobs", table, str, os.PathLike, optional=True)
    given = [sources] if isinstance(sources, str | os.PathLike) else sources
    arguments.kind("sources", given, Sequence)
    for path in given:
        arguments.kind("one of sources", path, str, os.PathLike)
    listed = [Job(path, reading, told) for path in every_file([Path(path) for path in given])]
    every = [*listed, *(from_table(Path(table), reading, told) if table is not None else [])]
    if not every:
        raise FitmatError("no file is given, expected files, a folder, a pattern or a table of jobs.")
    return every


def _studied(every: Sequence[Job], claim: Claim, do: Do, names: Sequence[str], say: Progress) -> Batch:
    """The table of all jobs; rows are kept as they come."""
    target = claim.folder
    done: dict[int, list[dict[str, Any]]] = {}
    keys: dict[str, list[int]] = {}
    waiting: dict[str, tuple[Job, str]] = {}
    for k, job in enumerate(every):
        try:
            content = digest(job.path)
        except FitmatError as error:
            done[k] = rows.refused(error)
            continue
        key = job.key(content)
        keys.setdefault(key, []).append(k)
        waiting[key] = (job, content)
    earlier = dict(_kept(target, waiting))
    for key, found in earlier.items():
        del waiting[key]
        done |= dict.fromkeys(keys[key], found)
    lost = sum(_lost(found) for found in done.values())
    _tell(say, done, lost, len(every))
    for key, found in do(waiting):
        if not any(row["outcome"] == rows.FAILED for row in found):
            files.write_text(target / PARTS / f"{key}.json", json.dumps(found))
        done |= dict.fromkeys(keys[key], found)
        lost += len(keys[key]) * _lost(found)
        _tell(say, done, lost, len(every))
    whole, told = pools.pool_rows(names, done)
    table = _table(every, whole)
    memory = io.BytesIO()
    table.write_parquet(memory)
    claim.renew((TABLE, PAGE), [f"{key}.json" for key in keys], _of_runs(every, whole))
    file = files.write_bytes(target / TABLE, memory.getvalue())
    files.write_text(target / PAGE, _page(every, whole, told))
    before = sum(len(keys[key]) for key in earlier)
    return Batch(file, table, {"fitted": len(every) - lost, "refused": lost, "earlier": before}, told)


def _of_runs(every: Sequence[Job], done: pools.Done) -> list[str] | None:
    """Names of the runs; None where none was asked for."""
    asked_for = any(job.runs is not None for job in every)
    return sorted({str(found[0][RUN]) for found in done.values() if found[0].get(RUN)}) if asked_for else None


def _of_file(file: str, message: str) -> str:
    name = visible(Path(file).name)
    return message if visible(message).startswith((name, visible(file))) else f"{name}: {message}"


def _page(every: Sequence[Job], done: pools.Done, told: Sequence[Pooled]) -> str:
    """The page: of each file its best model, or why there is none."""
    fitted = [_best(job, done[k]) for k, job in enumerate(every) if not _lost(done[k])]
    refused = [{"message": done[k][0]["message"]} for k in range(len(every)) if _lost(done[k])]
    return summary.to_html(fitted, refused, [str(one) for one in told])


def _best(job: Job, found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    row = next((one for one in found if one["best"]), found[0])
    levels = {f"{name}_level": row.get(f"{name}_level", "unknown") for name in rows.CARDS}
    numbers = {
        "delta_e": row.get("match_delta_e_2000"),
        "distance": row.get("match_measured_distance"),
        "misfit": row.get("misfit_over_noise"),
    }
    said = {name: row.get(name, "") for name in rows.CARDS}
    told = {"name": job.path.name, "swatch": row.get(rows.SWATCH), "link": link(row)}
    return told | said | levels | numbers | {"columns": _numbers(row)}


def _numbers(row: Mapping[str, Any]) -> dict[str, float]:
    """What of a row can be drawn."""
    return {name: cell for name, cell in row.items() if isinstance(cell, float | int) and not isinstance(cell, bool)}


def _lost(found: Sequence[Mapping[str, Any]]) -> bool:
    return found[0]["outcome"] in (rows.REFUSED, rows.FAILED)


def _tell(say: Progress, done: Mapping[int, Any], lost: int, total: int) -> None:
    say(f"fitting {total} files{f', {lost} refused' if lost else ''}", len(done), total)


def _kept(target: Path, waiting: Waiting) -> Iterator[tuple[str, list[dict[str, Any]]]]:
    """Rows that an earlier run left, by key; what cannot be read, or lacks a run that is asked for, is done again."""
    for key, (job, _) in waiting.items():
        try:
            found = json.loads((target / PARTS / f"{key}.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            continue
        sound = isinstance(found, list) and found and all(isinstance(row, dict) and "outcome" in row for row in found)
        if sound and is_there(job, found):
            yield key, found


def _table(every: Sequence[Job], done: pools.Done) -> pl.DataFrame:
    """One row for each file and model, the columns in the order in which they first appear."""
    flat = [{"file": os.fspath(job.path)} | row for k, job in enumerate(every) for row in done[k]]
    names = [name for name in dict.fromkeys(name for row in flat for name in row) if name != rows.SWATCH]
    columns = {name: [_storable(row.get(name)) for row in flat] for name in names}
    try:
        return pl.DataFrame({name: pl.Series(name, column, strict=False) for name, column in columns.items()})
    except pl.exceptions.PolarsError as error:
        raise OutputError(f"the rows make no table ({error}); their parts are kept.") from error


def _storable(cell: Any) -> Any:
    """Text as UTF-8 can hold it: a file's name may be of bytes that are no text."""
    return cell.encode("utf-8", "backslashreplace").decode("utf-8") if isinstance(cell, str) else cell
