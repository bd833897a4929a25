"""Angles: the angle columns of a table → zenith and azimuth of light and sensor, in radians.

It measures nothing twice: a sign becomes an azimuth, and angles that may be radians are asked about.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from fitmat.errors import ReadError
from fitmat.measurements.options import Options
from fitmat.measurements.parsing import units
from fitmat.measurements.parsing.table import Table

ROUNDING = 1e-6
"""Radians; printed angles are rounded, so one this close to 90° or 180° is there."""

_LIMIT = {"theta_i": 180, "theta_o": 180, "phi": 360, "phi_i": 360, "phi_o": 360}
_RADIANS = (0.1, 1.6)


def directions(
    table: Table, columns: Mapping[str, int], options: Options
) -> tuple[Float[np.ndarray, "n 4"], tuple[str, ...]]:
    """Columns theta_i, phi_i, theta_o, phi_o in radians, NaN where not known, and notes on what was assumed.

    Zenith angles come out as 0 to π: a negative one turns its azimuth by π. The mirror side is φ_o − φ_i = π.

    Args:
        table: Where the angles are.
        columns: Name of the angle → column.
        options: Unit, sign and azimuth conventions of the file.

    Raises:
        ReadError: an angle is text or out of range, the unit is doubtful, or an option cannot apply.
    """
    angles = {name: table.numbers(column) for name, column in columns.items()}
    stated = _stated_units(table, columns, options)
    _refuse_doubtful_unit(table, {name: angle for name, angle in angles.items() if name not in stated}, options)
    unit_of = {name: stated.get(name, options.angle_unit or "degrees") for name in columns}
    for name, unit in unit_of.items():
        angle = angles[name]
        angles[name] = angle if unit == "radians" else np.deg2rad(angle)
        beyond = np.isfinite(angle) & (np.abs(angles[name]) > np.deg2rad(_LIMIT[name]) + ROUNDING)
        limit = f"{np.deg2rad(_LIMIT[name]):.5g}" if unit == "radians" else f"{_LIMIT[name]}"
        expected = f"−{limit} to {limit} {unit}. Is the column, or its unit (--angle-unit), another one?"
        table.refuse(columns[name], beyond, expected)
    phi_i, phi_o, note = _azimuths(table, angles, options)
    theta_i, theta_o = angles["theta_i"], angles["theta_o"]
    found = np.stack(
        [
            np.abs(theta_i),
            np.where(theta_i < 0, phi_i + np.pi, phi_i),
            np.abs(theta_o),
            np.where(theta_o < 0, phi_o + np.pi, phi_o),
        ],
        axis=1,
    )
    found[~np.isfinite(found).all(axis=1)] = np.nan
    radians = [name for name, unit in unit_of.items() if unit == "radians"]
    told = "Angles" if len(radians) == len(unit_of) else ", ".join(radians)
    return found, (*([f"{told} read as radians."] if radians else []), note)


def _stated_units(table: Table, columns: Mapping[str, int], options: Options) -> dict[str, str]:
    """Angle → unit, where the header says it.

    Raises:
        ReadError: the header and an option say different units.
    """
    written = {name: units.split(table.names[column])[1] for name, column in columns.items()}
    stated = {
        name: {"deg": "degrees", "rad": "radians"}[unit] for name, unit in written.items() if unit in ("deg", "rad")
    }
    for name, unit in stated.items():
        if options.angle_unit not in (None, unit):
            got = f"the header says {table.label(columns[name])}, --angle-unit says {options.angle_unit}"
            raise ReadError(
                f"{table.source}: {got}, expected them to agree. Correct the header, or leave the flag out."
            )
    return stated


def _azimuths(table: Table, angles: Mapping[str, np.ndarray], options: Options) -> tuple[np.ndarray, np.ndarray, str]:
    """phi_i, phi_o in radians for positive zenith angles, and the convention in words."""
    zero = np.zeros_like(angles["theta_i"])
    turned = options.specular_azimuth == 0
    if not angles.keys() & {"phi", "phi_o"}:
        if turned:
            expected = "expected only with azimuth columns. Use forward= (--forward) for the sign of theta_o."
            raise ReadError(f"{table.source}: specular_azimuth = 0 without an azimuth column, {expected}")
        side = np.pi if options.forward == "positive" else 0.0
        return (
            zero,
            zero + side,
            f"No azimuth column: in-plane, {options.forward} theta_o is forward (mirror side).",
        )
    if options.forward != "positive":
        expected = "expected only without azimuth columns. Use specular_azimuth= (--specular-azimuth)."
        raise ReadError(f"{table.source}: forward = {options.forward} beside azimuth columns, {expected}")
    given = "phi" if "phi" in angles else "phi_o − phi_i"
    note = f"Relative azimuth {given}: {options.specular_azimuth}° is the mirror side"
    note += ", turned by 180°." if turned else "."
    if (angles["theta_i"] < 0).any() or (angles["theta_o"] < 0).any():
        note += " Negative zenith angles turn their azimuth by 180°."
    phi_o = angles["phi"] if "phi" in angles else angles["phi_o"]
    return angles.get("phi_i", zero), phi_o + np.pi if turned else phi_o, note


def _refuse_doubtful_unit(table: Table, angles: Mapping[str, np.ndarray], options: Options) -> None:
    zenith = np.abs(
        np.concatenate([np.zeros(0), *(angle for name, angle in angles.items() if name.startswith("theta"))])
    )
    largest = np.max(zenith[np.isfinite(zenith)], initial=0.0)
    if options.angle_unit is None and options.doubtful and _RADIANS[0] < largest <= _RADIANS[1]:
        expected = "expected degrees; they look like radians"
        remedy = "Confirm with --angle-unit radians or --angle-unit degrees (angle_unit=)."
        raise ReadError(f"{table.source}: no zenith angle exceeds {largest:g}, {expected}. {remedy}")
