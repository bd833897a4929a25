"""Recognition: which format a file is of, by its content, and what it holds, by the room of that format.

It converts no value and masks none.
"""

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fitmat.errors import ReadError
from fitmat.measurements.formats import (
    alta,
    astm,
    excel,
    fred,
    lighttools,
    merl,
    pab_opto,
    parquet,
    rgl,
    road,
    ssdd,
    utia,
    zemax,
)
from fitmat.measurements.options import Options
from fitmat.measurements.parsing import cells, contents, tabular
from fitmat.measurements.parsing.recording import Recording
from fitmat.measurements.writing import marks

FORMATS: tuple[Any, ...] = (rgl, merl, zemax, lighttools, fred, astm, alta, ssdd, road, pab_opto, utia)
"""Rooms of one format each, asked in this order: `claims(head, size)` says whether a file is theirs, `load(path)` makes
the `Recording`; what none claims is a text table."""

TABLES = (pab_opto,)
"""Those that are text tables too: where the user says what the columns are, they are read as such."""


def layout_of(head: bytes, size: int) -> Any:
    """The room of the format that claims a file of that beginning and so many bytes; None where none does."""
    return next((layout for layout in FORMATS if layout.claims(head, size)), None)


def recording(
    path: str | os.PathLike[str], columns: str | Mapping[str, str | int] | None, options: Options
) -> Recording:
    """What a file holds.

    Args:
        path: On disk.
        columns: As in `fitmat.read`; for tables only.
        options: For tables but for what any file needs to be told.

    Raises:
        ReadError: it is damaged, or told what its format settles.
    """
    head, size = contents.contents(path, contents.HEAD), contents.size(path)
    layout = layout_of(head, size)
    if layout is None or (columns and layout in TABLES):
        room = next((room for room in (parquet, excel) if room.claims(head, size)), cells)
        return tabular.recording(room.load(path), columns, options)
    _refuse_needless(contents.name(path), layout.__name__.rpartition(".")[2], columns, options)
    return _with_marks(layout.load(path), Path(path))


def _with_marks(recording: Recording, path: Path) -> Recording:
    """The recording; where a file beside it tells what was inferred in it, with a warning that says so."""
    beside = marks(path)
    if beside is None or not beside.exists():
        return recording
    told = (
        f"{contents.shown(beside.name)} beside this file says that some of its values were inferred, not measured. "
        "Read that one, of which only what was measured is used."
    )
    return dataclasses.replace(recording, warnings=(*recording.warnings, told))


def _refuse_needless(name: str, layout: str, columns: str | Mapping[str, str | int] | None, options: Options) -> None:
    """Stop where the user says of a file what its format settles."""
    usual = Options()
    settled = ("quantity", "where", "angle_unit", "forward", "specular_azimuth", "scale")
    said = [n for n in settled if getattr(options, n) != getattr(usual, n)]
    for option in [*(["columns"] if columns else []), *said, *options.constants][:1]:
        expected = f"expected no {option}= (--{option.replace('_', '-')}): the format settles it"
        raise ReadError(f"{name}: a file of the format {layout}, {expected}. Leave it out.")
