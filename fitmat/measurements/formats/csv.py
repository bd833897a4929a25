"""CSV: measurements as a table of text that `fitmat.read` reads.

It reads nothing (`text` does) and touches no file.
"""

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from fitmat.measurements.samples import Measurements

FLAT = 1e-6
"""Radians; an azimuth this close to 0 or π is written as the sign of theta_o."""


def columns(measurements: Measurements) -> dict[str, Float[np.ndarray, " n"]]:
    """Angles in degrees, BRDF and σ in sr⁻¹, by the names under which they are read.

    theta_i, theta_o, brdf (brdf_r, … for several channels) and, where known, sigma; in the plane of incidence theta_o
    is signed, positive on the mirror side, else phi follows it, or phi_i and phi_o where the light does not always come
    from azimuth 0. Masked values are NaN.
    """
    m = measurements
    theta_i, theta_o, phi, phi_i = m.theta_i, m.theta_o, m.phi, m.phi_i
    aside = np.minimum(phi, np.pi - phi)
    flat = bool(np.all((aside < FLAT) | (theta_i < FLAT) | (theta_o < FLAT)))
    turned = bool(np.any(np.abs((phi_i + np.pi) % (2 * np.pi) - np.pi) > FLAT))
    angles = {"theta_i": theta_i, "theta_o": m.signed_theta_o if flat and not turned else theta_o}
    if turned:
        angles |= {"phi_i": phi_i, "phi_o": np.arctan2(m.wo[:, 1], m.wo[:, 0]) % (2 * np.pi)}
    elif not flat:
        angles |= {"phi": phi}
    tails = [f"_{name}" for name in m.channels] if len(m.channels) > 1 else [""]
    numbers = {"brdf": m.value} if m.sigma is None else {"brdf": m.value, "sigma": m.sigma}
    return {name: np.rad2deg(angle) for name, angle in angles.items()} | {
        kind + tail: np.where(m.valid[:, k], number[:, k], np.nan)
        for kind, number in numbers.items()
        for k, tail in enumerate(tails)
    }


def dump(measurements: Measurements, comments: Iterable[str] = ()) -> str:
    """The table of `columns` as text, masked values as nan.

    Values have 7 digits, angles 10⁻⁶ degrees, so that the same measurements give the same bytes.

    Args:
        measurements: What to write.
        comments: Lines to go before the header, each behind a #.
    """
    table = columns(measurements)
    angles = [name for name in table if name.startswith(("theta", "phi"))]
    rounded = {name: np.round(column, 6) + 0.0 if name in angles else column for name, column in table.items()}
    line = ",".join("%.9g" if name in angles else "%.6e" for name in table)
    rows = [line % row for row in zip(*(column.tolist() for column in rounded.values()), strict=True)]
    return "\n".join([*(f"# {comment}" for comment in comments), ",".join(table), *rows, ""])
