"""Jobs: which files a batch studies, with what each is told, and the key under which its rows are kept.

It opens files only for their bytes.
"""

import dataclasses
import glob
import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import polars as pl

from fitmat.errors import ReadError
from fitmat.fitting import priors
from fitmat.measurements.parsing.constants import CONSTANTS
from fitmat.models.parameters import assignments
from fitmat.text import visible

FILE = "file"
"""Column of a table of jobs that names the measurements."""

READING = (
    *("columns", "quantity", "angle_unit", "forward", "specular_azimuth", "intensity", "distance", "where", "panel"),
    *("unknown_scale", "scale"),
)
"""Columns that are arguments of `fitmat.read`."""

STUDYING = ("models", "loss", "masking", "ior", "tilt", "dispersion", "film", "seed")
"""Columns that are arguments of `fitmat.study`."""

ASSIGNED = ("fix", "prior")
"""Columns that are arguments of `fitmat.study` too, as on the command line, with semicolons between several."""


@dataclasses.dataclass(frozen=True)
class Job:
    """One file and what is told of it.

    Attributes:
        path: The file.
        reading: Arguments of `fitmat.read`.
        studying: Arguments of `fitmat.study`.
        runs: Folder in which it leaves a run of its own; None where none is asked for.
    """

    path: Path
    reading: Mapping[str, Any]
    studying: Mapping[str, Any]
    runs: Path | None = None

    def key(self, content: str) -> str:
        """The name under which the rows are kept: of what is read, how, and by which fitmat.

        Args:
            content: `digest` of the file.
        """
        told = [self.path.name, self.reading, self.studying, version("fitmat"), content, self.runs is not None]
        return hashlib.sha256(json.dumps(told, sort_keys=True, default=str).encode()).hexdigest()[:32]


def digest(path: Path) -> str:
    """SHA-256 of a file's bytes.

    Raises:
        ReadError: it cannot be read.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ReadError(f"{path}: {error.strerror or error}.") from error


def every_file(sources: Sequence[Path]) -> list[Path]:
    """The files that paths, folders and patterns lead to, each once, in their order; of folders by name.

    Hidden files, and what lies in folders of a folder, are left out.

    Raises:
        ReadError: nothing is there.
    """
    found = [path for source in sources for path in _files(source)]
    return list(dict.fromkeys(found))


def _files(source: Path) -> Iterator[Path]:
    if source.is_dir():
        inside = sorted(path for path in source.iterdir() if path.is_file() and not path.name.startswith("."))
        if not inside:
            raise ReadError(f"{source} holds no file, expected measurements. Give another folder, or a pattern.")
        yield from inside
    elif source.exists():
        yield source
    else:
        inside = sorted(map(Path, glob.glob(os.fspath(source), recursive=True)))
        if not inside:
            raise ReadError(f"{source}: no such file or folder, and no file of that pattern.")
        yield from (path for path in inside if path.is_file())


def from_table(table: Path, reading: Mapping[str, Any], studying: Mapping[str, Any]) -> list[Job]:
    """Jobs of a table with a column `file`, and one for each option that differs from file to file; blank is as given.

    Args:
        table: CSV; paths in it are relative to its folder.
        reading: Arguments of `fitmat.read` that hold where the table has none.
        studying: Those of `fitmat.study`.

    Raises:
        FitmatError: it cannot be read, or a column is none of these, or a cell means nothing.
    """
    rows = read_table(table, "jobs", f"a column {FILE}")
    known = {FILE, *READING, *CONSTANTS, *STUDYING, *ASSIGNED}
    odd = sorted(set(rows.columns) - known)
    if FILE not in rows.columns or odd:
        got = f"a column {odd[0]!r}" if FILE in rows.columns else f"columns {', '.join(rows.columns)}"
        raise ReadError(f"{table}: {got}, expected {FILE} and any of {', '.join(sorted(known - {FILE}))}.")
    return [_job(table, row, reading, studying) for row in rows.iter_rows(named=True)]


def read_table(table: Path, of: str, having: str, *, infer_schema: bool = True) -> pl.DataFrame:
    """A table in CSV, in which lines that begin with # are comments.

    Args:
        table: The file.
        of: What the table is of.
        having: What it must have, for the sentence where it cannot be read.
        infer_schema: Whether cells are read as numbers where a column has nothing else.

    Raises:
        ReadError: it cannot be read.
    """
    try:
        return pl.read_csv(table, comment_prefix="#", infer_schema=infer_schema)
    except (OSError, pl.exceptions.PolarsError) as error:
        first = visible(str(getattr(error, "strerror", None) or error).partition("\n")[0])
        raise ReadError(f"{table}: no table of {of} can be read ({first}). Write CSV with {having}.") from error


def _job(table: Path, row: Mapping[str, Any], reading: Mapping[str, Any], studying: Mapping[str, Any]) -> Job:
    if row[FILE] is None:
        raise ReadError(f"{table}: a row without a {FILE}, expected a path in each.")
    said = {name: cell for name, cell in row.items() if cell is not None and name != FILE}
    constants = dict(reading.get("constants") or {}) | {name: said[name] for name in CONSTANTS if name in said}
    read = dict(reading) | {name: said[name] for name in READING if name in said} | {"constants": constants}
    told = dict(studying) | {name: said[name] for name in STUDYING if name in said}
    if "fix" in said:
        told["fixed"] = assignments(str(said["fix"]).split(";"), "fix")
    if "prior" in said:
        told["priors"] = priors.assignments(str(said["prior"]).split(";"))
    return Job(table.parent / str(row[FILE]), read, told)
