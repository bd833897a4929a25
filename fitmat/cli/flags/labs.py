"""Flags of a comparison of laboratories: their files, and the model of the surface.

They set no default and check nothing but their type.
"""

from pathlib import Path
from typing import Annotated

import typer

LaboratoriesFlag = Annotated[
    list[Path],
    typer.Argument(help="Measurements of one sample, a file of each laboratory, in any format that fit reads."),
]

SurfaceFlag = Annotated[str, typer.Option(help="Model of the surface, the same for all.", metavar="NAME")]
