"""Flags that say what a file does not, and what `fitmat.read` is told of them.

They read no file.
"""

from typing import Annotated, Any

import typer

FILE, INSTRUMENT = "What the file does not say", "The instrument"
"""Headings in the help."""


def _constant(what: str) -> Any:
    return typer.Option(
        help=f"{what} where it is the same in every row and has no column.",
        metavar="X",
        show_default=False,
        rich_help_panel=FILE,
    )


ColumnsFlag = Annotated[
    str | None,
    typer.Option(
        help="Which column is what, where the header has other names: theta_i=Zenith,brdf=3 (a name in the "
        "header, or a column number from 1).",
        metavar="OURS=THEIRS",
        show_default=False,
        rich_help_panel=FILE,
    ),
]

QuantityFlag = Annotated[
    str | None,
    typer.Option(
        help="What a column called 'value' holds: brdf (sr⁻¹), brdf_cos, reflectance_factor, radiance, panel_ratio.",
        metavar="KIND",
        show_default=False,
        rich_help_panel=FILE,
    ),
]

AngleUnitFlag = Annotated[
    str | None,
    typer.Option(
        help="Unit of the angles: degrees (default), radians or gon; or of single columns: phi=radians.",
        metavar="UNIT",
        show_default=False,
        rich_help_panel=FILE,
    ),
]

ForwardFlag = Annotated[
    str | None,
    typer.Option(
        help="Sign of theta_o on the mirror side of a positive theta_i, in files without azimuth: positive (default) "
        "or negative.",
        metavar="SIGN",
        show_default=False,
        rich_help_panel=FILE,
    ),
]

SpecularAzimuthFlag = Annotated[
    int | None,
    typer.Option(
        help="Relative azimuth phi of the mirror side in the file: 180 (default), 0, 90 or 270.",
        metavar="PHI",
        show_default=False,
        rich_help_panel=FILE,
    ),
]

IntensityFlag = Annotated[
    float | None,
    typer.Option(
        help="Intensity of the source in W/sr, where the file holds radiances; with --distance.",
        metavar="X",
        show_default=False,
        rich_help_panel=FILE,
    ),
]

DistanceFlag = Annotated[
    float | None,
    typer.Option(
        help="Distance of the source from the sample in m; with --intensity.",
        metavar="X",
        show_default=False,
        rich_help_panel=FILE,
    ),
]

ScaleFlag = Annotated[
    str | None,
    typer.Option(
        help="How the values are written: linear (default), percent, or as logarithms: db, log10, ln.",
        metavar="HOW",
        show_default=False,
        rich_help_panel=FILE,
    ),
]

ThetaIFlag = Annotated[float | None, _constant("theta_i, in degrees,")]
ThetaOFlag = Annotated[float | None, _constant("theta_o, in degrees,")]
PhiFlag = Annotated[float | None, _constant("phi, in degrees,")]
PhiIFlag = Annotated[float | None, _constant("phi_i, in degrees,")]
PhiOFlag = Annotated[float | None, _constant("phi_o, in degrees,")]
WavelengthFlag = Annotated[float | None, _constant("The wavelength, in nm,")]

WhereFlag = Annotated[
    str | None,
    typer.Option(
        help="Read only the rows in which a column has this value: material=Alu.",
        metavar="NAME=VALUE",
        show_default=False,
        rich_help_panel=FILE,
    ),
]

PanelFlag = Annotated[
    float | None,
    typer.Option(
        help="Reflectance factor of the white panel, where the file holds signal and reference, or their ratio.",
        metavar="R",
        show_default=False,
        rich_help_panel=FILE,
    ),
]

UnknownScaleFlag = Annotated[
    bool,
    typer.Option(
        "--unknown-scale",
        help="The values are right but for one common factor: fit it. Not beside what says it: --calibration, --panel, "
        "--intensity.",
        rich_help_panel=INSTRUMENT,
    ),
]


def reading(
    columns: ColumnsFlag = None,
    quantity: QuantityFlag = None,
    angle_unit: AngleUnitFlag = None,
    forward: ForwardFlag = None,
    specular_azimuth: SpecularAzimuthFlag = None,
    intensity: IntensityFlag = None,
    distance: DistanceFlag = None,
    where: WhereFlag = None,
    panel: PanelFlag = None,
    unknown_scale: UnknownScaleFlag = False,
    scale: ScaleFlag = None,
    theta_i: ThetaIFlag = None,
    theta_o: ThetaOFlag = None,
    phi: PhiFlag = None,
    phi_i: PhiIFlag = None,
    phi_o: PhiOFlag = None,
    wavelength: WavelengthFlag = None,
) -> dict[str, Any]:
    """What the flags say of a file, as arguments of `fitmat.read`."""
    said = dict(locals())
    constants = {name: said.pop(name) for name in ("theta_i", "theta_o", "phi", "phi_i", "phi_o", "wavelength")}
    return said | {"constants": {name: number for name, number in constants.items() if number is not None}}
