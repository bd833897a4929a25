"""Flags that describe the instrument, and the `Instrument` that they make.

They correct no value.
"""

from math import radians
from typing import Annotated, Any

import typer

from fitmat.cli.flags.reading import INSTRUMENT
from fitmat.errors import ReadError

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

ApertureErrorFlag = Annotated[
    float,
    typer.Option(
        min=0,
        max=0.5,
        help="Relative standard uncertainty of these half-angles, such as 0.05.",
        metavar="X",
        show_default=False,
        rich_help_panel=INSTRUMENT,
    ),
]

AngleErrorFlag = Annotated[
    float,
    typer.Option(
        min=0,
        max=2,
        help="Standard uncertainty of theta_i and theta_o in degrees: of an offset that all rows share, which is "
        "fitted, and of what each row adds to it by chance.",
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


def instrument(
    calibration: CalibrationFlag = 0.0,
    source_angle: SourceAngleFlag = 0.0,
    receiver_angle: ReceiverAngleFlag = 0.0,
    aperture_error: ApertureErrorFlag = 0.0,
    angle_error: AngleErrorFlag = 0.0,
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
    half_angles = radians(source_angle), radians(receiver_angle)
    return Instrument(*half_angles, calibration, level, radians(angle_error), aperture_error)
