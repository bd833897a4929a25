"""Options: what the flags of the command line are called, and what their help says.

They set no default and check nothing but their type.
"""

from pathlib import Path
from typing import Annotated, Literal

import typer

FileFlag = Annotated[
    Path,
    typer.Argument(
        help="Measurements: CSV or any text table, Parquet, MERL, RGL, Zemax, LightTools, FRED, ASTM, UTIA, ALTA, SSDD."
    ),
]

ModelsFlag = Annotated[
    str,
    typer.Option(
        help="Models to fit, separated by commas, or 'all'; see [bold]fitmat models[/bold]. An empirical and a "
        "microfacet model are compared. Default: lambert+blinn-phong and lambert+ggx.",
        metavar="NAMES",
        show_default=False,
    ),
]

OutFlag = Annotated[
    Path | None,
    typer.Option(
        help="Folder for the report; default NAME-fitmat (then -2, -3, …) beside the input.",
        metavar="DIR",
        show_default=False,
    ),
]

ForceFlag = Annotated[bool, typer.Option("--force", help="Replace the report of an earlier run in --out.")]

JsonFlag = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else.")]

NoMcmcFlag = Annotated[
    bool, typer.Option("--no-mcmc", help="Skip sampling: faster, intervals from Laplace's approximation.")
]

SeedFlag = Annotated[
    int, typer.Option(min=0, help="Seed of the sampling; the same seed, the same report.", metavar="N")
]

FixFlag = Annotated[
    list[str] | None,
    typer.Option(help="Hold a parameter, e.g. ks=1; repeat for more.", metavar="NAME=VALUE", show_default=False),
]

MaskingFlag = Annotated[
    str | None,
    typer.Option(
        help="Shadowing of microfacet lobes: correlated (default), separable or v-cavity.",
        metavar="KIND",
        show_default=False,
    ),
]

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

ReplaceFlag = Annotated[bool, typer.Option("--force", help="Replace the file where it exists.")]

LossFlag = Annotated[
    str,
    typer.Option(
        help="What the fit minimises, see [bold]fitmat losses[/bold]: default, gaussian, student-t, mixture, log10 "
        "and others",
        metavar="NAME",
    ),
]

PriorFlag = Annotated[
    list[str] | None,
    typer.Option(
        help="What is known beforehand: centre and standard deviation, e.g. eta=1.5,0.05; repeat for more.",
        metavar="NAME=CENTRE,SD",
        show_default=False,
    ),
]

CheckPosteriorFlag = Annotated[
    bool,
    typer.Option(
        "--check-posterior",
        help="Sample each posterior a second time, with NUTS (pip install 'fitmat[nuts]'), and compare.",
    ),
]

ForFlag = Annotated[
    str | None,
    typer.Option(
        "--for",
        help="What to learn: a parameter such as eta, or 'match' to tell the two models apart; default all parameters.",
        metavar="NAME",
        show_default=False,
    ),
]

KindFlag = Annotated[
    Literal["sample", "curve"], typer.Option(help="What is measured next: single samples, or whole curves.")
]

CountFlag = Annotated[int, typer.Option(min=1, max=50, help="How many measurements to propose.", metavar="N")]

IorFlag = Annotated[
    str | None,
    typer.Option(
        help="Material whose refractive index is fixed from the literature: Au, N-BK7, PMMA, or shelf/book/page of "
        "refractiveindex.info, such as main/Cr/Rakic-BB (pip install 'fitmat[materials]').",
        metavar="NAME",
        show_default=False,
    ),
]

TiltFlag = Annotated[
    bool, typer.Option("--tilt", help="Fit how far the sample's normal leans in its mount, with every model.")
]

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

SimulatedSeedFlag = Annotated[int, typer.Option(min=0, help="Seed of the noise.", metavar="N")]

CatalogueFlag = Annotated[
    Path | None,
    typer.Option(help="Write the catalogue of synthetic materials into this folder instead.", show_default=False),
]

NameFlag = Annotated[
    str | None, typer.Argument(help="A lobe or model, e.g. ggx or lambert+ggx; 'fresnel' for the Fresnel terms.")
]

CheckFlag = Annotated[
    bool, typer.Option("--check", help="Measure which laws of reflection every lobe keeps (some minutes).")
]
