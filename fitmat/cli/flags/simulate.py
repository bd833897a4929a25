"""Flags of a simulation: the material, the angles, the noise.

They set no default and check nothing but their type.
"""

from pathlib import Path
from typing import Annotated

import typer

ModelFlag = Annotated[str | None, typer.Argument(help="True model, e.g. lambert+ggx.", show_default=False)]

SimulatedOutFlag = Annotated[Path, typer.Option(help="CSV file to write.")]

SetFlag = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="A true parameter, e.g. alpha=0.2, or kd=0.4,0.1,0.1 for three channels; repeat for more.",
        metavar="NAME=VALUE",
        show_default=False,
    ),
]

WavelengthsFlag = Annotated[
    str | None,
    typer.Option(
        help="Wavelengths of the channels in nm, FIRST:LAST:STEP or a list A,B,C: a spectrum. A parameter by channel "
        "is then one number for all, or one for each.",
        metavar="NM",
        show_default=False,
    ),
]

SimulatedLawFlag = Annotated[
    str | None,
    typer.Option(
        help="Law of the refractive index over --wavelengths: cauchy, sellmeier, smooth, drude, drude-lorentz or "
        "smooth-metal; its parameters by --set, e.g. cauchy_a=1.48.",
        metavar="LAW",
        show_default=False,
    ),
]

SimulatedIorFlag = Annotated[
    str | None,
    typer.Option(
        help="Material whose refractive index the surface has, or what lies under its film: Au, N-BK7, PMMA, or "
        "shelf/book/page.",
        metavar="NAME",
        show_default=False,
    ),
]

SimulatedFilmFlag = Annotated[
    str | None,
    typer.Option(
        help="Material whose refractive index the thin film of ggx-film and others has: TiO2, fused-silica, ….",
        metavar="NAME",
        show_default=False,
    ),
]

ThetaIFlag = Annotated[str, typer.Option(help="Incidence angles in degrees, as --theta-o.", metavar="ANGLES")]

ThetaOFlag = Annotated[
    str,
    typer.Option(
        help="Outgoing angles in degrees, FIRST:LAST:STEP or a list A,B,C; positive = mirror side.",
        metavar="ANGLES",
    ),
]

PhiFlag = Annotated[
    str, typer.Option(help="Relative azimuths in degrees; 180 is the plane of incidence.", metavar="ANGLES")
]

PhiIFlag = Annotated[
    str, typer.Option(help="Azimuths of incidence in degrees, for anisotropic samples.", metavar="ANGLES")
]

NoiseFlag = Annotated[float, typer.Option(min=0, help="Relative noise, as a fraction of the true value.", metavar="X")]

FloorFlag = Annotated[float, typer.Option(min=0, help="Absolute noise in sr⁻¹.", metavar="X")]

SamplesFlag = Annotated[
    int | None,
    typer.Option(
        help="Paths for each geometry of a model that is estimated, such as ggx-walk or ggx-slab; 4096 without.",
        metavar="N",
        show_default=False,
    ),
]

SimulatedSeedFlag = Annotated[int, typer.Option(min=0, help="Seed of the noise, and of paths.", metavar="N")]

CatalogueFlag = Annotated[
    Path | None,
    typer.Option(help="Write the catalogue of synthetic materials into this folder instead.", show_default=False),
]
