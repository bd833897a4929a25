"""Flags of a picture: which material, in which light, how large.

They set no default and check nothing but their type.
"""

from pathlib import Path
from typing import Annotated

import typer

PicturedFlag = Annotated[
    str, typer.Argument(help="Folder of a run of fitmat fit, or a model, e.g. lambert+ggx.", metavar="MODEL|RESULT")
]

PictureFlag = Annotated[Path, typer.Option("--out", help="PNG file to write.", metavar="FILE")]

PictureSetFlag = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="A parameter of a model, e.g. alpha=0.2, or kd=0.4,0.1,0.1 for three channels; repeat for more.",
        metavar="NAME=VALUE",
        show_default=False,
    ),
]

LightFlag = Annotated[
    list[str] | None,
    typer.Option(
        "--light",
        help="front, side, rim, sky, or degrees from the viewer and on the screen, e.g. 60,150; repeat for more. "
        "Default side and sky.",
        metavar="LIGHT",
        show_default=False,
    ),
]

SizeFlag = Annotated[int, typer.Option(help="Pixels along a side, 16 to 512.", metavar="N")]

ExposureFlag = Annotated[
    float | None,
    typer.Option(
        help="Factor from radiance to display; default the one that makes the mean luminance of what is lit 0.18.",
        metavar="X",
        show_default=False,
    ),
]

HdrFlag = Annotated[bool, typer.Option("--hdr", help="Also write the linear radiances as NAME.exr.")]

ReplacePictureFlag = Annotated[bool, typer.Option("--force", help="Replace the picture where it exists.")]
