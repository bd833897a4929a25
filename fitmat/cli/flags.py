"""Flags: groups of options that several commands share, and what they make of them.

They read no file and print nothing.
"""

import functools
import inspect
from collections.abc import Callable
from math import radians
from typing import Annotated, Any

import typer

from fitmat.errors import ReadError

FILE = "What the file does not say"
INSTRUMENT = "The instrument"

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
        help="Of the source, in W/sr, where the file holds radiances.",
        metavar="X",
        show_default=False,
        rich_help_panel=FILE,
    ),
]

DistanceFlag = Annotated[
    float | None,
    typer.Option(
        help="Of the source from the sample, in m, with --intensity.",
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
        help="The values are right but for one common factor: fit it.",
        rich_help_panel=INSTRUMENT,
    ),
]

CalibrationFlag = Annotated[
    float,
    typer.Option(
        min=0,
        max=1,
        help="Relative standard deviation of a scale error that all values share, such as 0.03.",
        metavar="X",
        show_default=False,
        rich_help_panel=INSTRUMENT,
    ),
]

SourceAngleFlag = Annotated[
    float,
    typer.Option(
        min=0,
        max=30,
        help="Half-angle of the cone in which light reaches the sample, in degrees.",
        metavar="DEG",
        show_default=False,
        rich_help_panel=INSTRUMENT,
    ),
]

ReceiverAngleFlag = Annotated[
    float,
    typer.Option(
        min=0,
        max=30,
        help="Half-angle of the cone that the detector collects, in degrees.",
        metavar="DEG",
        show_default=False,
        rich_help_panel=INSTRUMENT,
    ),
]

DarkFlag = Annotated[
    str,
    typer.Option(
        help="Dark signal and stray light as BRDF times cosθ_o, in sr⁻¹, or 'fit'.",
        metavar="X",
        show_default=False,
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


def instrument(
    calibration: CalibrationFlag = 0.0,
    source_angle: SourceAngleFlag = 0.0,
    receiver_angle: ReceiverAngleFlag = 0.0,
    dark: DarkFlag = "0",
) -> Any:
    """The `fitmat.measurements.instrument.Instrument` that the flags describe.

    Raises:
        ReadError: --dark is neither a number nor "fit", or a number is out of range.
    """
    from fitmat.measurements.instrument import Instrument

    try:
        level = None if dark == "fit" else float(dark)
    except ValueError:
        raise ReadError(f"--dark {dark}: expected a number in sr⁻¹, or fit.") from None
    return Instrument(radians(source_angle), radians(receiver_angle), calibration, level)


def takes(*groups: Callable[..., Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the flags of `groups` beside its own, and what each group makes of them as a parameter."""
    flags = {group.__name__: inspect.signature(group).parameters for group in groups}

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = [p for p in inspect.signature(command).parameters.values() if p.name not in flags]
        every = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in (*own, *_parameters(flags.values()))]

        @functools.wraps(command)
        def wrapped(**given: Any) -> None:
            made = {group.__name__: group(**{n: given.pop(n) for n in flags[group.__name__]}) for group in groups}
            command(**given, **made)

        wrapped.__signature__ = inspect.Signature(every)  # pyright: ignore[reportAttributeAccessIssue]
        wrapped.__annotations__ = {p.name: p.annotation for p in every}
        return wrapped

    return decorate


def _parameters(groups: Any) -> list[inspect.Parameter]:
    return [parameter for group in groups for parameter in group.values()]
