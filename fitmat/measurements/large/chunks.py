"""Chunks: a table too large for memory, looked through once and then read again and again, part by part.

What only the whole file can tell (a number that stands for "nothing", the unit of its angles) is settled by the first
look, so that every chunk is read as it would be in one piece. It fits nothing.
"""

import dataclasses
import os
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from jaxtyping import Bool

from fitmat._types import Progress
from fitmat.errors import ReadError
from fitmat.measurements.instrument import IDEAL, Instrument
from fitmat.measurements.large import tables
from fitmat.measurements.large.first_pass import FirstPass, joined_rows, magnitudes
from fitmat.measurements.large.stream import CHUNK, PART, is_kept
from fitmat.measurements.options import Options
from fitmat.measurements.parsing import contents, tabular
from fitmat.measurements.parsing.angles import as_stated
from fitmat.measurements.parsing.columns import Columns
from fitmat.measurements.parsing.recording import Recording, named
from fitmat.measurements.parsing.table import Table
from fitmat.measurements.peak_side import with_peak_side
from fitmat.measurements.plausible_values import refuse_implausible, with_doubts
from fitmat.measurements.reader import measured
from fitmat.measurements.recognition import layout_of
from fitmat.measurements.samples import Measurements
from fitmat.measurements.scale import of_unknown_scale
from fitmat.text import brief

LARGE = 1 << 28
"""Bytes of a table from which it is read in chunks."""


@dataclasses.dataclass(frozen=True, eq=False)
class Chunks:
    """A large file; iterating over it reads it from its beginning, as `Measurements` of at most `rows` rows.

    Attributes:
        path: The file.
        columns: As in `fitmat.read`.
        options: What the file does not say about itself.
        rows: Most rows of a chunk.
        where: NAME=VALUE of the rows that are read; None for all.
        sentinel: The number that stands for "nothing", in the file's own quantity; None where there is none.
        factor: By which values and σ are divided: 1, or what brings an unknown scale to the size of a BRDF.
        n_samples: Rows that are read, masked ones included.
        n_valid: Values (rows × channels) that can be fitted.
        thinning: One row in so many is in `part`.
        part: Rows spread evenly over the file; their source, counts and notes are those of the whole file.
    """

    path: str | os.PathLike[str]
    columns: str | Mapping[str, str | int] | None
    options: Options
    rows: int
    where: str | None
    sentinel: float | None
    factor: float
    n_samples: int
    n_valid: int
    thinning: int
    part: Measurements

    __repr__ = brief

    def __iter__(self) -> Iterator[Measurements]:
        for table in _chosen(self.path, self.rows, self.where):
            found = _converted(
                tabular.recording(table, self.columns, self.options, doubted=False), self.options, self.sentinel
            )
            yield found if self.factor == 1.0 else _divided(found, self.factor)

    def in_part(self, first: int, count: int) -> Bool[np.ndarray, " count"]:
        """Which of `count` rows, from the file's row `first` (from 0) on, are in `part`."""
        return is_kept(np.arange(first, first + count), self.thinning)


def is_large(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a table of at least `LARGE` bytes, which `fitmat.read` should not hold at once.

    Raises:
        ReadError: it cannot be opened.
    """
    size = contents.size(path)
    return size >= LARGE and layout_of(contents.contents(path, contents.HEAD), size) is None


def scan(
    path: str | os.PathLike[str],
    *,
    columns: str | Mapping[str, str | int] | None = None,
    instrument: Instrument = IDEAL,
    rows: int = CHUNK,
    part: int = PART,
    progress: Progress | None = None,
    **conventions: Any,
) -> Chunks:
    """FirstPass through a large CSV or Parquet file.

    Args:
        path: Of the file.
        columns: Our name → name or number (from 1) in the file; or as text, "theta_i=Zenith,theta_o=3".
        instrument: Apertures, calibration and dark signal of what took the values.
        rows: Most rows of a chunk.
        part: Most rows of the part that stands for the whole.
        progress: Called after each chunk.
        conventions: The other options of `fitmat.read`.

    Raises:
        ReadError: as `fitmat.read`; also where channels are rows, because a geometry's rows may lie in two chunks.
    """
    options = Options(**conventions)
    lenient = whole = dataclasses.replace(options, where=None)  # rows are chosen here
    look = FirstPass(part)
    for table in _chosen(path, rows, options.where):
        whole_table, layout = tabular.laid_out(table, columns, whole)
        _refuse_long(table, layout)
        # One chunk may hold small angles only; whether all do is asked at the end.
        stated = as_stated(whole_table, layout.angles, whole)
        lenient = stated.with_units({name: stated.unit(name) or "degrees" for name in layout.angles})
        angles = {name: column for name, column in layout.angles.items() if column < len(table.names)}
        look.add(tabular.recorded(whole_table, layout, lenient, doubted=not look.n_samples), table, angles)
        if progress is not None:
            progress("reading", look.n_samples, 0)
    if look.extremes is not None:
        tabular.recording(look.extremes, columns, whole, doubted=False)
    if not look.n_valid:
        listed = ", ".join(f"{count} {reason}" for reason, count in look.masked.items()) or "none chosen"
        expected = "expected at least one value that can be used. Check the columns and units"
        raise ReadError(f"{contents.name(path)}: every row is masked ({listed}), {expected}.")
    raw = dataclasses.replace(_part(look, lenient), instrument=instrument)
    refuse_implausible(raw, look.kept[0].quantity, options)
    raw = with_doubts(with_peak_side(raw, look.kept[0].unsaid_side))
    shown = of_unknown_scale(raw) if options.unknown_scale else raw
    top = int(np.argmax(raw.value))
    return Chunks(
        path=path,
        columns=columns,
        options=lenient,
        rows=rows,
        where=options.where,
        sentinel=look.sentinel,
        factor=float(raw.value.flat[top] / shown.value.flat[top]) if options.unknown_scale else 1.0,
        n_samples=look.n_samples,
        n_valid=look.n_valid,
        thinning=look.thinning,
        part=shown,
    )


def _chosen(path: str | os.PathLike[str], rows: int, where: str | None) -> Iterator[Table]:
    """The tables of a file, or of each what `where` chooses; tables without such rows are passed over."""
    name, _, value = (part.strip() for part in (where or "").partition("="))
    kinds = set[bool | None]()
    for table in tables.tables(path, rows, words=name):
        if where is None:
            yield table
            continue
        kinds |= {table.is_numeric(name)} if name in table.names else set()
        if kinds >= {True, False}:
            got = f"numbers and, from row {table.lines[0]} on, text in the column {contents.shown(name)}"
            raise ReadError(f"{table.source}: {got}, expected one of both for --where. Write them alike.")
        if name not in table.names or table.matches(name, value).any():
            yield dataclasses.replace(table.chosen(where), notes=(*table.notes, f"Only rows with {name} = {value}."))


def _divided(m: Measurements, factor: float) -> Measurements:
    sigma = None if m.sigma is None else np.where(m.valid, m.sigma / factor, 1.0)
    return dataclasses.replace(m, value=m.value / factor, sigma=sigma)


def _refuse_long(table: Table, layout: Columns) -> None:
    width = len(table.names)  # behind it are constants
    if named := {name for name in ("wavelength", "channel") if layout.marks.get(name, width) < width}:
        got = f"a column {named.pop()}, one row for each channel"
        raise ReadError(f"{table.source}: {got}, expected one column for each in so large a file. Pivot the table.")


def _converted(recording: Recording, options: Options, sentinel: float | None) -> Measurements:
    """`measured`, with the sentinel of the whole file instead of the equal negative values of one chunk."""
    marked = {} if sentinel is None else {named(sentinel): recording.value == sentinel}
    found = measured(magnitudes(recording, marked), options)
    return dataclasses.replace(found, value=np.where(recording.value < 0, -found.value, found.value))


def _part(look: FirstPass, options: Options) -> Measurements:
    """The kept rows, with the counts and notes of the whole file."""
    part = _converted(joined_rows(look.kept), options, look.sentinel)
    notes = [note for note in part.notes if not any(other.startswith(note) and other != note for other in look.notes)]
    notes += [note for note in look.notes if note not in notes and note not in part.notes]
    if look.sentinel is None and look.negatives:
        notes.append(f"Negative values kept as noise: {look.negatives}.")
    if look.thinning > 1:
        notes.append(
            f"Shown: one row in {look.thinning:,}, evenly spread over the {look.n_samples:,} rows; all are fitted."
        )
    return dataclasses.replace(part, masked=look.masked, notes=tuple(notes))
