"""Gaps: directions of a table's own grid at which nothing valid was measured.

It fills nothing.
"""

import numpy as np
from jaxtyping import Float

from fitmat.errors import OutputError
from fitmat.maths.directions import from_angles
from fitmat.measurements.samples import Measurements

DIGITS = 5
"""Decimals of an angle in radians that tell one direction from another."""

MOST = 50
"""Times as many directions as were measured: where a grid would have more, the angles form none."""

Directions = tuple[Float[np.ndarray, "m 3"], Float[np.ndarray, "m 3"]]


def gaps(m: Measurements) -> Directions:
    """Every direction of light with every direction of the sensor, relative to it, that occurs; less what is whole.

    Raises:
        OutputError: nothing is missing, or the angles form no grid.
    """
    light = np.round(np.stack([m.theta_i, m.phi_i], axis=1), DIGITS)
    sensor = np.round(np.stack([m.theta_o, np.where(m.theta_o < 10.0**-DIGITS, 0.0, m.signed_phi)], axis=1), DIGITS)
    sensor[:, 1] = np.where(np.abs(sensor[:, 1] + np.round(np.pi, DIGITS)) < 10.0**-DIGITS, -sensor[:, 1], sensor[:, 1])
    (_, first, i), (_, at, o) = (
        np.unique(part, axis=0, return_index=True, return_inverse=True) for part in (light, sensor)
    )
    lights = np.stack([m.theta_i, m.phi_i], axis=1)[first]
    sensors = np.stack([m.theta_o, np.where(sensor[:, 1] == 0.0, 0.0, m.signed_phi)], axis=1)[at]
    if len(lights) * len(sensors) > MOST * m.n_samples:
        raise OutputError(
            f"{m.source}: {len(lights)} directions of light and {len(sensors)} of the sensor form no grid that could "
            "be completed, expected the same angles again and again. Write .binary, which has a grid of its own."
        )
    filled = np.zeros((len(lights), len(sensors)), bool)
    some = m.valid.any(axis=1)
    filled[i.ravel()[some], o.ravel()[some]] = True
    filled |= (np.cos(lights[:, :1]) < 1e-6) | (np.cos(sensors[:, 0]) < 1e-6)
    if filled.all() and m.valid[some].all():
        raise OutputError(
            f"{m.source}: nothing to complete: every direction of its grid was measured. Leave --complete out."
        )
    a, b = np.nonzero(~filled)
    theta_i, phi_i, theta_o = lights[a, 0], lights[a, 1], sensors[b, 0]
    return from_angles(theta_i, phi_i), from_angles(theta_o, phi_i + sensors[b, 1])
