"""Flags of a batch: its files, where the table goes, and how many work on it.

They set no default and check nothing but their type.
"""

from pathlib import Path
from typing import Annotated, Literal

import typer

SourcesFlag = Annotated[
    list[Path] | None,
    typer.Argument(
        help="Files of measurements, folders of them, or patterns in quotes ('scans/*.csv'), in any format that fit "
        "reads; or one texture (.npz, .zarr).",
        show_default=False,
    ),
]

BatchOutFlag = Annotated[
    Path, typer.Option(help="Folder for results.parquet; the same one goes on where it stopped.", metavar="DIR")
]

JobsFlag = Annotated[
    Path | None,
    typer.Option(
        help="CSV with a column file, and any of columns, quantity, theta_i, panel, ior, fix, prior, models, … for "
        "what differs from file to file; blank cells are as the flags say.",
        metavar="FILE",
        show_default=False,
    ),
]

LightsFlag = Annotated[
    Path | None,
    typer.Option(
        help="Pictures of a flat sample under one light each, as a texture: CSV with columns picture (OpenEXR), "
        "theta_i, phi_i (degrees) and irradiance, in radiances × sr; theta_o and phi_o where the camera is not above; "
        "sigma, the standard deviation of a picture's radiances, where it is known; saturation, from which radiance on "
        "the camera is full.",
        metavar="FILE",
        show_default=False,
    ),
]

ProcessesFlag = Annotated[
    int | None,
    typer.Option(min=1, help="How many files at once; default one for each core.", metavar="N", show_default=False),
]

SchedulerFlag = Annotated[
    str | None,
    typer.Option(
        help="Dask scheduler whose workers do the work, such as tcp://10.0.0.1:8786; they must see the files under the "
        "same paths, and have one thread each.",
        metavar="ADDRESS",
        show_default=False,
    ),
]

PoolFlag = Annotated[
    str | None,
    typer.Option(
        help="Parameters in which the files are of one kind, as eta of one lacquer: each file's is drawn to the others "
        "as far as its own data leave it open (columns NAME_pooled).",
        metavar="NAMES",
        show_default=False,
    ),
]

SmoothFlag = Annotated[
    str | None,
    typer.Option(
        help="Parameters in which neighbouring points of a texture differ little, as alpha,kd: each point's is drawn "
        "to its neighbours as far as its own data leave it open, less across edges (arrays NAME_smooth, and the maps).",
        metavar="NAMES",
        show_default=False,
    ),
]

DeviceFlag = Annotated[
    Literal["cpu", "gpu"], typer.Option(help="Where the points of a texture are fitted; files always on the CPU.")
]

RunsFlag = Annotated[
    bool, typer.Option("--runs", help="Leave of each file what fit leaves too, its page among it, in runs/; slower.")
]

PrecisionFlag = Annotated[
    Literal["double", "single"],
    typer.Option(
        help="Numbers in which the optimum of a texture's points is looked for; single is faster, and ends in double."
    ),
]

McmcFlag = Annotated[
    bool, typer.Option("--mcmc", help="Sample every posterior; slower, else intervals from Laplace's approximation.")
]

ReplaceBatchFlag = Annotated[
    bool, typer.Option("--force", help="Replace results in --out of other files, another texture or other flags.")
]
