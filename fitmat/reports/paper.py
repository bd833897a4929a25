"""Paper: a picture of a run as a file for a paper, its fonts inside, and beside it the numbers that it shows.

It draws nothing itself.
"""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from fitmat import arguments, files
from fitmat.errors import OutputError
from fitmat.reports import plot
from fitmat.reports.drawn import KINDS, table
from fitmat.reports.pictures import refuse_picture, write_picture
from fitmat.studies.result import Result
from fitmat.studies.study import Study

COLUMN_MM = 84.0
"""Of one column of a journal."""

STYLE: Mapping[Any, Any] = MappingProxyType(
    {"font.size": 8.0, "axes.titlesize": 8.0, "legend.fontsize": 7.0, "pdf.fonttype": 42, "svg.fonttype": "path"}
)
"""Letters as small as journals print them; of a PDF with their font, of an SVG as outlines."""


_OF_A_CHANNEL: Mapping[str, Callable[..., Figure]] = MappingProxyType(
    {"curves": plot.curves, "residuals": plot.residuals, "lobes": plot.lobes, "slice": plot.slices}
)
_OF_ALL: Mapping[str, Callable[..., Figure]] = MappingProxyType(
    {"albedo": plot.albedo, "match": plot.distances, "coverage": plot.coverage}
)


def save(
    what: Study | Result,
    path: str | os.PathLike[str],
    kind: str = "curves",
    *,
    channel: str | int = 0,
    model: str | None = None,
    width_mm: float = COLUMN_MM,
    force: bool = False,
) -> list[Path]:
    """Write a picture, and its numbers as CSV beside it.

    Args:
        what: A study, or the result of one from `fitmat.load`.
        path: Of the picture; its ending says the format: .svg, .pdf or .png.
        kind: "curves", "residuals", "lobes", "slice", "albedo", "corner", "match" or "coverage".
        channel: Of curves, residuals, lobes and slices, by its name or from 0.
        model: Of the corner; None for the last with draws.
        width_mm: Of the figure, 40 to 500.
        force: Replace the files.

    Returns:
        The picture and the table.

    Raises:
        FitmatError: there is nothing of the kind, or a file is there already or cannot be written.
    """
    arguments.kind("path", path, str, os.PathLike)
    arguments.choice("kind", kind, KINDS)
    arguments.flags(force=force)
    picture = Path(path)
    refuse_picture(picture, force=force)
    numbers = picture.with_suffix(".csv")
    if os.path.lexists(numbers) and not force:
        raise OutputError(f"{numbers}: already exists; choose another name, or --force to replace it.")
    found = table(what, kind, channel=channel, model=model)
    files.write_text(numbers, found.write_csv())
    with mpl.rc_context(dict(STYLE)):
        write_picture(lambda: _draw(kind, what, channel, model, width_mm), picture, exact=True)
    return [picture, numbers]


def _draw(kind: str, what: Study | Result, channel: str | int, model: str | None, width_mm: float) -> Figure:
    if kind == "corner":
        return plot.corner(what, model, width_mm=width_mm)
    if kind in _OF_A_CHANNEL:
        return _OF_A_CHANNEL[kind](what, channel=channel, width_mm=width_mm)
    return _OF_ALL[kind](what, width_mm=width_mm)
