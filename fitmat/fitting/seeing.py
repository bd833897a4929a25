"""Seeing: a model as the instrument of some measurements shows it, before it is fitted.

It fits nothing.
"""

import numpy as np

from fitmat.errors import ModelError
from fitmat.measurements.samples import Measurements
from fitmat.models.around.instrument import Seen
from fitmat.models.around.tilt import Tilted
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import as_parameter


def seen(template: AbstractBRDF, m: Measurements) -> AbstractBRDF:
    """The model as the measurements' instrument shows it, with what is to be fitted of the instrument at its start.

    Raises:
        ModelError: the sample may lean, and the angles have an error: both at once offset the angles.
    """
    if m.instrument.ideal:
        return template
    dark = np.quantile((m.value * m.wo[:, 2:])[m.valid], 0.01)
    told = m.instrument
    if told.angle_error and Tilted.prefix in template.name:
        got = f"a tilt (--tilt) beside angle_error = {np.rad2deg(told.angle_error):g}° (--angle-error)"
        raise ModelError(f"{got}, expected one of the two: a sample that leans offsets both angles. Leave one out.")
    offset = as_parameter(0.0) if told.angle_error else None
    return Seen(
        template,
        # Static, and what is fitted would be compiled for at each value.
        told.without_errors(),
        scale=as_parameter(1.0) if told.calibration else None,
        dark=np.clip(0.5 * dark, 1e-6, 0.5) if told.dark is None else None,
        aperture=as_parameter(1.0) if told.aperture_error else None,
        theta_i_offset=offset,
        theta_o_offset=offset,
        signed=bool(m.in_plane.all()),
    )
