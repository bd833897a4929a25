"""Flags of an export: which run, for which renderer, under which name.

They set no default and check nothing but their type.
"""

from pathlib import Path
from typing import Annotated

import typer

ResultsFlag = Annotated[list[Path], typer.Argument(help="Folders of two runs of fitmat fit, or more.", metavar="RUN…")]

ResultFlag = Annotated[Path, typer.Argument(help="Folder of a run of fitmat fit, or the fit.json in it.")]

TargetFlag = Annotated[
    str,
    typer.Option(
        "--to",
        help="What it is written for: glsl, glsl-330, mitsuba, materialx, openpbr, gltf, usd, pbrt, radiance, "
        "klems, blender, unreal, unity, osl, zemax, table, merl.",
        metavar="TARGET",
    ),
]

TableThetaIFlag = Annotated[
    str | None,
    typer.Option(
        "--theta-i",
        help="Incidences of a table or Zemax file in degrees, 10,30,60 or FIRST:LAST:STEP; default as reflection.",
        show_default=False,
    ),
]

StepFlag = Annotated[
    float | None,
    typer.Option(
        "--step",
        help="Degrees between such a table's angles of reflection, and its azimuths; default 5, 15 if anisotropic.",
        show_default=False,
    ),
]

BumpFlag = Annotated[
    bool,
    typer.Option("--bump", help="Bend the normal in the fragment shader of glsl by a height's surface gradient."),
]

ExportOutFlag = Annotated[
    Path | None,
    typer.Option(
        "--out",
        help="Folder for the files; default RESULT-TARGET (then -2, -3, …) beside the run.",
        metavar="DIR",
        show_default=False,
    ),
]

OneModelFlag = Annotated[
    str | None,
    typer.Option(help="Which model of the run; default the one that the data prefer.", show_default=False),
]

MaterialNameFlag = Annotated[
    str | None,
    typer.Option(help="Name of the material, and of its files; default that of the measurements.", show_default=False),
]

StrictFlag = Annotated[
    bool, typer.Option("--strict", help="Refuse where the target differs from the model; else say so.")
]

NoVerifyFlag = Annotated[
    bool,
    typer.Option(
        "--no-verify", help="Do not run what was written; else what reads or runs it there does, where there is one."
    ),
]

ReplaceExportFlag = Annotated[bool, typer.Option("--force", help="Replace the files of an earlier export in --out.")]
