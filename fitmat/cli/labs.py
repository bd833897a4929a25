"""Laboratories: files of several that measured one sample, read one by one, and compared.

It compares nothing itself.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from fitmat._types import Progress
from fitmat.errors import FitmatError
from fitmat.judgement.laboratories.comparing import Laboratories, compare_laboratories
from fitmat.measurements.joining import refuse_twice, tails
from fitmat.measurements.reader import read
from fitmat.text import visible


def compared(
    files: Sequence[Path], reading: Mapping[str, Any], model: str, fixed: Mapping[str, Any], say: Progress
) -> Laboratories:
    """What the laboratories say of the sample, each with its file's name.

    Args:
        files: One of each.
        reading: Arguments of `fitmat.read`, the same for all.
        model: Name of the model.
        fixed: Parameters to hold.
        say: Is told what is done.

    Raises:
        FitmatError: as `fitmat.read` and `compare_laboratories`.
    """
    if len(files) < 2:
        raise FitmatError(f"{files[0]} is of one laboratory, expected files of two or more that measured one sample.")
    refuse_twice(files)
    measured = [read(path, **reading) for path in files]
    names = [tail or m.source for tail, m in zip(tails(files), measured, strict=True)]
    say(f"comparing {len(files)} laboratories", 0, 0)
    return compare_laboratories(measured, model, names=names, fixed=fixed)


def as_json(found: Laboratories) -> str:
    """Everything that was found, as one JSON object."""
    return json.dumps(found.as_dict(), indent=2, ensure_ascii=False, allow_nan=False)


def show(found: Laboratories, screen: Console | None = None) -> None:
    """Print the verdict, then what each laboratory has of each quantity, then the scales.

    Args:
        found: What to show.
        screen: Where to; stdout if None.
    """
    out = screen or Console()
    plain = not out.is_terminal or out.is_dumb_terminal
    out.print(Text(visible(found.words), "bold"), soft_wrap=plain)
    for title, headings, rows in (
        (f"\nQuantities of {found.model}: u between is the scatter that the stated uncertainties do not explain.",
         found.headings, found.rows()),
        ("\nScale of each laboratory over that of the others", ("laboratory", "scale", "95 %", "p", ""),
         found.scale_rows()),
    ):  # fmt: skip
        if rows:
            out.print(Text(title, "dim"), soft_wrap=plain)
            out.print(_table(headings, rows), soft_wrap=plain)


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    table = Table(box=None, pad_edge=False)
    for k, heading in enumerate(headings):
        table.add_column(Text(visible(heading)), no_wrap=k == 0, min_width=len(rows[0][k].split(" ")[0]))
    for row in rows:
        table.add_row(*(Text(visible(cell)) for cell in row))
    return table
