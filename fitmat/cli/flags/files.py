"""Flags that name files: what is read, and what is written where.

They set no default and check nothing but their type.
"""

from pathlib import Path
from typing import Annotated

import typer

from fitmat.cli.flags.reading import FILE

STDIN = Path("/dev/stdin")


def _sources(given: list[Path]) -> list[Path]:
    return [STDIN if str(path) == "-" else path for path in given]


FilesFlag = Annotated[
    list[Path],
    typer.Argument(
        help="Measurements: CSV or any text table (also .gz), Parquet, Excel, MERL, RGL, Zemax, LightTools, FRED, "
        "ASTM, UTIA, ALTA, SSDD, pab-opto, road r-tables; - for standard input. Several with --join.",
        callback=_sources,
    ),
]

JoinFlag = Annotated[
    bool,
    typer.Option(
        "--join",
        help="The files are one measurement of one sample, as one for each incidence: each is read by its own header.",
        rich_help_panel=FILE,
    ),
]

OutFlag = Annotated[
    Path | None,
    typer.Option(
        help="Folder for the report; default NAME-fitmat (then -2, -3, …) beside the input, of a stream where you are.",
        metavar="DIR",
        show_default=False,
    ),
]

ReplacePageFlag = Annotated[bool, typer.Option("--force", help="Replace the page that is there.")]

ComparedPageFlag = Annotated[Path, typer.Option(help="The page, one file.", metavar="FILE")]

ForceFlag = Annotated[bool, typer.Option("--force", help="Replace the report of an earlier run in --out.")]

OpenFlag = Annotated[bool, typer.Option("--open", help="Open the report in a browser when it is written.")]

JsonFlag = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else.")]

PlotFlag = Annotated[
    Path | None,
    typer.Option(help="Draw what was measured where into this PNG, SVG or PDF.", metavar="FILE", show_default=False),
]

DesignPlotFlag = Annotated[
    Path | None,
    typer.Option(
        help="Draw what each next angle is worth into this PNG, SVG or PDF.", metavar="FILE", show_default=False
    ),
]

ConvertedFlag = Annotated[
    Path,
    typer.Argument(help="File to write: .csv, .parquet, .binary (MERL), .bsdf (Zemax) or .alta.", show_default=False),
]

CompleteFlag = Annotated[
    bool,
    typer.Option(
        "--complete",
        help="Fill what was not measured: all cells of a .binary (MERL), else the table's own grid, by a fitted model "
        "and what it misses nearby; each inferred value is marked, with its sd.",
    ),
]

FillingFlag = Annotated[
    str | None,
    typer.Option(
        help="Model that fills the gaps, beside --complete; lambert+ggx without. See [bold]fitmat models[/bold].",
        metavar="NAME",
        show_default=False,
    ),
]

ReplaceFlag = Annotated[bool, typer.Option("--force", help="Replace what is written where it exists.")]

ReplacePlotFlag = Annotated[bool, typer.Option("--force", help="Replace the picture of --plot where it exists.")]


def files(file: FilesFlag, join: JoinFlag = False) -> list[Path]:
    """The files of one measurement, of which several are given only with `--join`."""
    return file
