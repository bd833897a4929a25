"""Angles: the angle columns of a table → zenith and azimuth of light and sensor, in radians.

It measures nothing twice: a sign becomes an azimuth, and angles that may be radians are asked about.
"""

from collections.abc import Collection, Mapping

import numpy as np
from jaxtyping import Float

from fitmat.errors import ReadError
from fitmat.measurements.options import ELEVATIONS, TURNS, Options
from fitmat.measurements.parsing import units
from fitmat.measurements.parsing.table import Table

ROUNDING = 1e-6
"""Radians; printed angles are rounded, so one this close to 90° or 180° is there."""

DOUBTFUL = (0.1, 1.6)
"""Largest zenith angle between which what should be degrees looks like radians."""

_LIMIT = {"theta_i": 180, "theta_o": 180, "phi": 360, "phi_i": 360, "phi_o": 360, "elevation_i": 90, "elevation_o": 90}
_STATED = {"deg": "degrees", "rad": "radians", "gon": "gon"}
_SCAN = (0.7, 0.5)
# Beside angles in degrees, one that reaches less far, or varies less, is a fixed setting near the normal.
_DOUBTFUL_AZIMUTH = (1.5, 6.2842)
_LEVEL = np.deg2rad(1.0)
# A theta_i this little below zero is the normal itself, as an encoder reads it.


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
    angles, notes = _in_radians(table, columns, options)
    for zenith, elevation in ELEVATIONS.items():
        if elevation in angles:
            angles[zenith] = np.pi / 2 - angles.pop(elevation)
            notes.append(f"{zenith} is 90° − {elevation}.")
    if "theta_i" in columns:
        _refuse_unsaid_side(table, columns, angles["theta_i"], options)
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
    return found, (*notes, note)


def as_stated(table: Table, columns: Mapping[str, int], options: Options) -> Options:
    """The options with the units that the header says of angles.

    Raises:
        ReadError: the header and the user say different units.
    """
    written = {name: units.split(table.names[column])[1] for name, column in columns.items()}
    stated = {name: _STATED[unit] for name, unit in written.items() if unit in _STATED}
    for name, unit in stated.items():
        if options.unit(name) not in (None, unit):
            got = f"the header says {table.label(columns[name])}, --angle-unit says {options.unit(name)}"
            expected = "expected them to agree. Correct the header, or leave the flag out."
            raise ReadError(f"{table.source}: {got}, {expected}")
    if not stated:
        return options
    said = {name: unit for name in columns if (unit := options.unit(name)) is not None}
    return options.with_units(said | stated)


def _in_radians(
    table: Table, columns: Mapping[str, int], options: Options
) -> tuple[dict[str, Float[np.ndarray, " n"]], list[str]]:
    """The angles as they stand, in radians, and notes on their units."""
    if stray := options.said_units.keys() - columns.keys():
        expected = f"expected one of the file's angles, {', '.join(columns)}. Correct it."
        raise ReadError(f"{table.source}: angle_unit names {', '.join(sorted(stray))} (--angle-unit), {expected}")
    options = as_stated(table, columns, options)
    numbers = {name: table.numbers(column) for name, column in columns.items()}
    _refuse_doubtful_zeniths(table, numbers, options)
    _refuse_doubtful_azimuths(table, numbers, options)
    angles, notes = {}, []
    for name, number in numbers.items():
        unit = options.unit(name) or "degrees"
        angles[name] = number * (2 * np.pi / TURNS[unit])
        limit = TURNS[unit] * _LIMIT[name] / 360
        if name in ELEVATIONS and (over := (angles[name] >= 1.5 * np.pi) & (number <= TURNS[unit] + ROUNDING)).any():
            angles[name] = np.where(over, angles[name] - 2 * np.pi, angles[name])
            notes.append(f"{name} from three quarters of a turn on read as negative: 340° is −20°.")
        beyond = np.isfinite(number) & (np.abs(angles[name]) > np.deg2rad(_LIMIT[name]) + ROUNDING)
        expected = f"−{limit:.5g} to {limit:.5g} {unit}. Is the column, or its unit (--angle-unit), another one?"
        table.refuse(columns[name], beyond, expected)
    used = {name: options.unit(name) or "degrees" for name in columns}
    if {*used.values()} != {"degrees"}:
        listed = ", ".join(f"{name} in {unit}" for name, unit in used.items())
        alike = len({*used.values()}) == 1
        notes.append(f"Angles read as {used.popitem()[1]}." if alike else f"Angles read: {listed}.")
    return angles, notes


def _azimuths(table: Table, angles: Mapping[str, np.ndarray], options: Options) -> tuple[np.ndarray, np.ndarray, str]:
    """phi_i, phi_o in radians for positive zenith angles, and the convention in words."""
    zero = np.zeros_like(angles["theta_i"])
    side, forward = options.specular_azimuth, options.forward or "positive"
    if not angles.keys() & {"phi", "phi_o"}:
        if side not in (None, 180):
            expected = "expected only with azimuth columns. Use forward= (--forward) for the sign of theta_o."
            raise ReadError(f"{table.source}: specular_azimuth = {side} without an azimuth column, {expected}")
        opposite = np.pi if forward == "positive" else 0.0
        note = f"No azimuth column: in-plane, {forward} theta_o is forward (mirror side)"
        note += ". Of a negative theta_i it is the other sign." if (angles["theta_i"] < 0).any() else "."
        return zero, zero + opposite, note
    if options.forward is not None:
        expected = "expected only without azimuth columns. Use specular_azimuth= (--specular-azimuth)."
        raise ReadError(f"{table.source}: forward = {options.forward} beside azimuth columns, {expected}")
    given = "phi" if "phi" in angles else "phi_o − phi_i"
    turned = 180 - (180 if side is None else side)
    note = f"Relative azimuth {given}: {180 - turned}° is the mirror side"
    note += f", turned by {turned}°." if turned else "."
    if (angles["theta_i"] < 0).any() or (angles["theta_o"] < 0).any():
        note += " Negative zenith angles turn their azimuth by 180°."
    phi_o = angles["phi"] if "phi" in angles else angles["phi_o"]
    return angles.get("phi_i", zero), phi_o + np.deg2rad(turned) if turned else phi_o, note


def unsaid_side(columns: Collection[str], options: Options) -> tuple[str, ...]:
    """The flag that exchanges the mirror side and the light's, and the one that confirms them; empty where said."""
    if {"phi", "phi_o"} & {*columns}:
        said, flag, other, same = options.specular_azimuth, "--specular-azimuth", "0", "180"
    else:
        said, flag, other, same = options.forward, "--forward", "negative", "positive"
    return (f"{flag} {other}", f"{flag} {same}") if said is None else ()


def _refuse_unsaid_side(table: Table, columns: Mapping[str, int], theta_i: np.ndarray, options: Options) -> None:
    """Stop where light and sensor share a signed axis that fitmat may count the other way round."""
    if options.forward is not None or columns.keys() & {"phi", "phi_o"}:
        return
    expected = (
        "an angle from 0, or to be told on which side the mirror direction lies: pass --forward negative if that "
        "of theta_i = −20 is theta_o = 20, --forward positive if it is −20 (forward=)"
    )
    table.refuse(columns["theta_i"], theta_i < -_LEVEL, f"{expected}.")


def _refuse_doubtful_zeniths(table: Table, angles: Mapping[str, np.ndarray], options: Options) -> None:
    zeniths = {name: angle for name, angle in angles.items() if not name.startswith("phi")}
    largest = {name: _largest(angle) for name, angle in zeniths.items()}
    unsaid = [name for name in zeniths if options.unit(name) is None]
    most = max(largest.values())
    for name in unsaid:
        alone = _SCAN[0] < largest[name] <= DOUBTFUL[1] < most and _varies(zeniths[name])
        if not alone and (len(unsaid) < len(zeniths) or not DOUBTFUL[0] < most <= DOUBTFUL[1]):
            continue
        got = f"no {name} exceeds" if alone else "no zenith angle exceeds"
        column = f"{name}=" if alone else ""
        expected = f"expected degrees{' as of the other zenith angle' if alone else ''}; they look like radians"
        remedy = f"Confirm with --angle-unit {column}radians or --angle-unit {column}degrees (angle_unit=)."
        raise ReadError(f"{table.source}: {got} {largest[name] if alone else most:g}, {expected}. {remedy}")


def _refuse_doubtful_azimuths(table: Table, angles: Mapping[str, np.ndarray], options: Options) -> None:
    azimuths = {name: angle for name, angle in angles.items() if name.startswith("phi") and options.unit(name) is None}
    largest = max(map(_largest, azimuths.values()), default=0.0)
    if _DOUBTFUL_AZIMUTH[0] < largest <= _DOUBTFUL_AZIMUTH[1]:
        expected = "expected degrees up to 180 or 360; they look like radians"
        unit = ",".join(f"{name}={{0}}" for name in azimuths)
        remedy = f"Confirm with --angle-unit {unit.format('radians')} or --angle-unit {unit.format('degrees')}"
        raise ReadError(f"{table.source}: no azimuth exceeds {largest:g}, {expected}. {remedy} (angle_unit=).")


def _largest(angle: np.ndarray) -> float:
    return float(np.max(np.abs(angle[np.isfinite(angle)]), initial=0.0))


def _varies(angle: np.ndarray) -> bool:
    known = angle[np.isfinite(angle)]
    return len(known) > 0 and bool(np.ptp(known) > _SCAN[1])
