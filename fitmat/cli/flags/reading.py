"""Flags that say what a file does not, and what `fitmat.read` is told of them.

They read no file.
"""

from typing import Annotated, Any

import typer

FILE, INSTRUMENT = "What the file does not say", "The instrument"
"""Headings in the help."""

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
        help="Unit of the angles: degrees (default) or radians.",
        metavar="UNIT",
        show_default=False,
        rich_help_panel=FILE,
    ),
]

ForwardFlag = Annotated[
    str,
    typer.Option(
        help="Sign of theta_o on the mirror side, in files without azimuth: positive or negative.",
        metavar="SIGN",
        rich_help_panel=FILE,
    ),
]

SpecularAzimuthFlag = Annotated[
    int,
    typer.Option(
        help="Relative azimuth phi of the mirror side in the file: 180 or 0.", metavar="PHI", rich_help_panel=FILE
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
    forward: ForwardFlag = "positive",
    specular_azimuth: SpecularAzimuthFlag = 180,
    intensity: IntensityFlag = None,
    distance: DistanceFlag = None,
    where: WhereFlag = None,
    panel: PanelFlag = None,
    unknown_scale: UnknownScaleFlag = False,
) -> dict[str, Any]:
    """What the flags say of a file, as arguments of `fitmat.read`."""
    return dict(locals())
