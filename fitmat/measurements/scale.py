"""Scale: values known but for a common factor, brought to the size of a BRDF.

It finds no scale: what is unknown stays a parameter of the fit, with a wide prior.
"""

import dataclasses

import numpy as np

from fitmat.errors import ReadError
from fitmat.measurements.instrument import UNKNOWN_SCALE
from fitmat.measurements.samples import Measurements

TYPICAL_ALBEDO = 0.4
"""Between 0.05 and 1, where nearly all surfaces lie, this and a factor of e either way are a fair guess."""


def of_unknown_scale(m: Measurements) -> Measurements:
    """The values divided by one factor, and an instrument whose scale is not known.

    The factor gives the middle one of the incidence angles a directional albedo of about `TYPICAL_ALBEDO`. The albedo
    is guessed as π times the mean BRDF, each sample weighted with cosθ_o and with the circle about the mirror
    direction on which it lies; exact for a Lambertian surface.

    Raises:
        ReadError: no value is positive, or the instrument states how well the scale is known.
    """
    if m.instrument.calibration:
        got = f"calibration = {m.instrument.calibration:g} (--calibration) beside unknown_scale (--unknown-scale)"
        raise ReadError(
            f"{m.source}: {got}, expected one of the two: the scale is known so well, or not at all. Leave one out."
        )
    mirror = np.stack([-m.wi[:, 0], -m.wi[:, 1], m.wi[:, 2]], axis=1)
    apart = np.sqrt(np.maximum(1.0 - np.sum(mirror * m.wo, axis=1) ** 2, 1e-6))
    weight = (m.wo[:, 2] * apart)[:, None] * m.valid
    curve = np.unique(np.round(np.rad2deg(m.theta_i)), return_inverse=True)[1].reshape(-1)
    total, reflected = (np.bincount(curve, part.mean(axis=1)) for part in (weight, weight * m.value))
    factor = np.pi * np.median((reflected / np.where(total > 0, total, np.nan))[total > 0]) / TYPICAL_ALBEDO
    if not factor > 0:
        raise ReadError(f"{m.source}: no positive values, expected readings of reflected light. Check the column.")
    return dataclasses.replace(
        m,
        value=m.value / factor,
        sigma=None if m.sigma is None else np.where(m.valid, m.sigma / factor, 1.0),
        stated=(),
        notes=(*m.notes, f"Scale unknown: values divided by {factor:.4g}; the scale is fitted."),
        instrument=dataclasses.replace(m.instrument, calibration=UNKNOWN_SCALE),
    )
