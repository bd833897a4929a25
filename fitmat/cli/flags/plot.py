"""Flags of a picture for a paper: which, of what, how wide.

They set no default and check nothing but their type.
"""

from pathlib import Path
from typing import Annotated

import typer

WhatFlag = Annotated[
    str,
    typer.Option(
        help="curves (points, fits, bands), residuals, lobes (polar), slice (over half vector and difference), albedo, "
        "match (distance by angle and region), corner, or coverage (what was measured).",
        metavar="PICTURE",
    ),
]

PaperFlag = Annotated[
    Path,
    typer.Option(help="The picture, .svg, .pdf or .png; its numbers go into .csv beside it.", metavar="FILE"),
]

DrawnChannelFlag = Annotated[
    str | None,
    typer.Option(
        help="Channel of curves, residuals, lobes and slice; default the first.", metavar="NAME", show_default=False
    ),
]

CornerModelFlag = Annotated[
    str | None,
    typer.Option(help="Model of the corner; default the last of the run.", metavar="NAME", show_default=False),
]

WidthFlag = Annotated[float, typer.Option(min=40.0, max=500.0, help="Width in mm; 84 is a column.", metavar="MM")]

ReplacePaperFlag = Annotated[bool, typer.Option("--force", help="Replace the files of --out.")]
