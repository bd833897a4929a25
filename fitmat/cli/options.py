"""Options: what the flags of the command line are called, and what their help says.

They set no default and check nothing but their type.
"""

from pathlib import Path
from typing import Annotated, Literal

import typer

File = Annotated[
    Path,
    typer.Argument(
        help="Measurements: CSV or any text table, Parquet, MERL, RGL, Zemax, LightTools, FRED, ASTM, UTIA, ALTA, SSDD."
    ),
]

Models = Annotated[
    str,
    typer.Option(
        help="Models to fit, separated by commas, or 'all'; see [bold]fitmat models[/bold]. An empirical and a "
        "microfacet model are compared. Default: lambert+blinn-phong and lambert+ggx.",
        metavar="NAMES",
        show_default=False,
    ),
]

Out = Annotated[
    Path | None,
    typer.Option(
        help="Folder for the report; default NAME-fitmat (then -2, -3, …) beside the input.",
        metavar="DIR",
        show_default=False,
    ),
]

Force = Annotated[bool, typer.Option("--force", help="Replace the report of an earlier run in --out.")]

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else.")]

NoMcmc = Annotated[
    bool, typer.Option("--no-mcmc", help="Skip sampling: faster, intervals from Laplace's approximation.")
]

Seed = Annotated[int, typer.Option(min=0, help="Seed of the sampling; the same seed, the same report.", metavar="N")]

Fix = Annotated[
    list[str] | None,
    typer.Option(help="Hold a parameter, e.g. ks=1; repeat for more.", metavar="NAME=VALUE", show_default=False),
]

Masking = Annotated[
    str | None,
    typer.Option(
        help="Shadowing of microfacet lobes: correlated (default), separable or v-cavity.",
        metavar="KIND",
        show_default=False,
    ),
]

Plot = Annotated[
    Path | None,
    typer.Option(help="Draw what was measured where into this PNG, SVG or PDF.", metavar="FILE", show_default=False),
]

DesignPlot = Annotated[
    Path | None,
    typer.Option(
        help="Draw what each next angle is worth into this PNG, SVG or PDF.", metavar="FILE", show_default=False
    ),
]

Converted = Annotated[
    Path,
    typer.Argument(help="File to write: .csv, .parquet, .binary (MERL), .bsdf (Zemax) or .alta.", show_default=False),
]

Replace = Annotated[bool, typer.Option("--force", help="Replace the file where it exists.")]

Loss = Annotated[
    str,
    typer.Option(
        help="What the fit minimises, see [bold]fitmat losses[/bold]: default, gaussian, student-t, mixture, log10 "
        "and others",
        metavar="NAME",
    ),
]

Prior = Annotated[
    list[str] | None,
    typer.Option(
        help="What is known beforehand: centre and standard deviation, e.g. eta=1.5,0.05; repeat for more.",
        metavar="NAME=CENTRE,SD",
        show_default=False,
    ),
]

CheckPosterior = Annotated[
    bool,
    typer.Option(
        "--check-posterior",
        help="Sample each posterior a second time, with NUTS (pip install 'fitmat[nuts]'), and compare.",
    ),
]

For = Annotated[
    str | None,
    typer.Option(
        "--for",
        help="What to learn: a parameter such as eta, or 'match' to tell the two models apart; default all parameters.",
        metavar="NAME",
        show_default=False,
    ),
]

Kind = Annotated[
    Literal["sample", "curve"], typer.Option(help="What is measured next: single samples, or whole curves.")
]

Count = Annotated[int, typer.Option(min=1, max=50, help="How many measurements to propose.", metavar="N")]

Ior = Annotated[
    str | None,
    typer.Option(
        help="Material whose refractive index is fixed from the literature: Au, N-BK7, PMMA, or shelf/book/page of "
        "refractiveindex.info, such as main/Cr/Rakic-BB (pip install 'fitmat[materials]').",
        metavar="NAME",
        show_default=False,
    ),
]

Tilt = Annotated[
    bool, typer.Option("--tilt", help="Fit how far the sample's normal leans in its mount, with every model.")
]

Model = Annotated[str | None, typer.Argument(help="True model, e.g. lambert+ggx.", show_default=False)]

SimulatedOut = Annotated[Path, typer.Option(help="CSV file to write.")]

Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="A true parameter, e.g. alpha=0.2, or kd=0.4,0.1,0.1 for three channels; repeat for more.",
        metavar="NAME=VALUE",
        show_default=False,
    ),
]

ThetaI = Annotated[str, typer.Option(help="Incidence angles in degrees, as --theta-o.", metavar="ANGLES")]

ThetaO = Annotated[
    str,
    typer.Option(
        help="Outgoing angles in degrees, FIRST:LAST:STEP or a list A,B,C; positive = mirror side.",
        metavar="ANGLES",
    ),
]

Phi = Annotated[
    str, typer.Option(help="Relative azimuths in degrees; 180 is the plane of incidence.", metavar="ANGLES")
]

PhiI = Annotated[str, typer.Option(help="Azimuths of incidence in degrees, for anisotropic samples.", metavar="ANGLES")]

Noise = Annotated[float, typer.Option(min=0, help="Relative noise, as a fraction of the true value.", metavar="X")]

Floor = Annotated[float, typer.Option(min=0, help="Absolute noise in sr⁻¹.", metavar="X")]

SimulatedSeed = Annotated[int, typer.Option(min=0, help="Seed of the noise.", metavar="N")]

Catalogue = Annotated[
    Path | None,
    typer.Option(help="Write the catalogue of synthetic materials into this folder instead.", show_default=False),
]

Name = Annotated[
    str | None, typer.Argument(help="A lobe or model, e.g. ggx or lambert+ggx; 'fresnel' for the Fresnel terms.")
]

Check = Annotated[
    bool, typer.Option("--check", help="Measure which laws of reflection every lobe keeps (some minutes).")
]
