"""Flags of colour: which material, under which light.

They set no default and check nothing but their type.
"""

from pathlib import Path
from typing import Annotated

import typer

MaterialFlag = Annotated[
    str | None,
    typer.Argument(
        help="Au, gold, brass, N-BK7, water, …, shelf/book/page of refractiveindex.info, as main/Au/McPeak; or a run's "
        "folder, for the colours of its models.",
        metavar="MATERIAL",
        show_default=False,
    ),
]

IlluminantFlag = Annotated[
    str, typer.Option(help="CIE illuminant: D65, D50, A, FL2, FL11, LED-B3 or E.", metavar="NAME")
]

TableFlag = Annotated[
    str | None,
    typer.Option(
        help="metals or dielectrics: F0 and edge tint in RGB of all that come with fitmat.",
        metavar="KIND",
        show_default=False,
    ),
]

ColourPlotFlag = Annotated[
    Path | None,
    typer.Option(
        help="Draw into this PNG, SVG or PDF: of a material colour and error by angle, of a run a*, b* and L* of its "
        "models with what the data leave open.",
        metavar="FILE",
        show_default=False,
    ),
]

EnergyFlag = Annotated[
    bool,
    typer.Option("--energy", help="Of a run: say what a renderer loses of each highlight, by roughness and angle."),
]
