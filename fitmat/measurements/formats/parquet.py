"""Parquet: a columnar file's columns as a `Table`, and measurements as such a file.

It knows no column name (`columns` does) and rounds nothing.
"""

import contextlib
import io
import os
import tempfile
import threading
from collections.abc import Iterator

import numpy as np
import polars as pl

from fitmat.errors import ReadError
from fitmat.measurements.formats import csv
from fitmat.measurements.parsing import contents, footer
from fitmat.measurements.parsing.table import Table
from fitmat.measurements.samples import Measurements

MAGIC = b"PAR1"
"""The first and the last four bytes of a Parquet file."""

_STDERR, _PANIC, _LOCK = 2, b"panicked at", threading.Lock()
_PLAIN = (pl.Boolean, pl.Null, pl.String, pl.Categorical, pl.Enum, pl.Date, pl.Datetime, pl.Time)
_SWELLING = 64
_SMALL = 1 << 24


def claims(head: bytes, size: int) -> bool:
    """Whether the file begins as Parquet does."""
    return size > 2 * len(MAGIC) and head.startswith(MAGIC)


def load(path: str | os.PathLike[str]) -> Table:
    """The file's columns, rows numbered from 1; nulls are missing cells, columns of lists and the like are left out.

    Raises:
        ReadError: the file is damaged, unpacks to far more than its size, or holds no rows.
    """
    source, raw = contents.name(path), contents.contents(path)
    with refused_if_damaged(source):
        lazy = pl.scan_parquet(io.BytesIO(raw))
        schema = lazy.collect_schema()
        flat = [name for name, kind in schema.items() if kind.is_numeric() or kind in _PLAIN]
        rows = lazy.select(pl.len()).collect().item()
        _refuse_swelling(source, len(raw), 8 * rows * len(flat))
        _refuse_swelling(source, len(raw), footer.unpacked(raw, flat, rows))
        cells = pl.DataFrame([_plain(column) for column in lazy.select(flat).collect()])
        text = cells.select(pl.col(pl.String).str.len_bytes().sum())
        _refuse_swelling(source, len(raw), sum(text.row(0)) if text.width else 0)
    if cells.is_empty():
        raise ReadError(
            f"{source}: no rows of plain cells, expected at least one measured value. Check how it was made."
        )
    left = [name for name in schema if name not in flat]
    notes = (f"Columns that hold no plain cells, not read: {contents.listed(left)}.",) if left else ()
    return Table(source, tuple(cells.columns), cells, np.arange(1, cells.height + 1), notes)


@contextlib.contextmanager
def refused_if_damaged(source: str) -> Iterator[None]:
    """Make what polars comes upon in a damaged file one sentence; a panic of its threads is not printed.

    Raises:
        ReadError: polars cannot read the file.
    """
    try:
        with _LOCK, _without_panics():
            yield
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError, ValueError) as error:
        panic = isinstance(error, pl.exceptions.PanicException)
        reason = "its parts contradict each other" if panic else contents.shown(str(error).partition("\n")[0], 200)
        expected = "expected a whole Parquet file. Was its download cut off?"
        raise ReadError(f"{source}: its Parquet content cannot be read ({reason}), {expected}") from error


@contextlib.contextmanager
def _without_panics() -> Iterator[None]:
    """Hold back what compiled code prints on stderr, and print it afterwards unless a thread panicked."""
    with contextlib.ExitStack() as held:
        try:
            printed = _memory()
            held.callback(os.close, printed)
            before = os.dup(_STDERR)
        except OSError:  # no room, or no stderr
            yield
            return
        os.dup2(printed, _STDERR)
        try:
            yield
        finally:
            os.dup2(before, _STDERR)
            os.close(before)
            size = os.lseek(printed, 0, os.SEEK_END)
            os.lseek(printed, 0, os.SEEK_SET)
            if _PANIC not in (said := os.read(printed, size)):
                with contextlib.suppress(OSError):
                    os.write(_STDERR, said)


def _memory() -> int:
    """The descriptor of a new file without a name, in memory where the system has that."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("fitmat")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


def dump(measurements: Measurements) -> bytes:
    """The columns of `csv.columns` in full float64: what is read back is what was written.

    Raises:
        OutputError: a channel's name would not be read back.
    """
    columns = csv.columns(measurements)
    if csv.CHANNEL in columns:
        csv.refuse_lost(measurements, [_read_back(name) for name in measurements.channels])
    buffer = io.BytesIO()
    pl.DataFrame(columns).write_parquet(buffer)
    return buffer.getvalue()


def _read_back(name: str) -> str | None:
    """What is read of a channel's name where it is a cell."""
    try:
        cells = pl.DataFrame({csv.CHANNEL: [name]})
    except UnicodeEncodeError:
        return None
    return str(Table("", (csv.CHANNEL,), cells, np.ones(1, int)).words(0)[0])


def _refuse_swelling(source: str, size: int, unpacked: int) -> None:
    """Refuse what runs of equal values can promise in a few bytes."""
    limit = max(_SWELLING * size, _SMALL)
    if unpacked > limit:
        got = f"{size} bytes that unpack to {unpacked}"
        raise ReadError(f"{source}: {got}, expected at most {limit}. Write the table as CSV.")


def _plain(column: pl.Series) -> pl.Series:
    """Numbers as float64, NaN where there is none; everything else as text."""
    if column.dtype.is_numeric() or column.dtype in (pl.Boolean, pl.Null):
        return column.cast(pl.Float64).fill_null(np.nan)
    return column.cast(pl.String)
