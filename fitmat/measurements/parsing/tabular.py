"""Tabular: a table's named columns → a `Recording`.

It opens no file and masks nothing.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from fitmat.errors import ReadError
from fitmat.maths.directions import from_angles
from fitmat.measurements import inferred
from fitmat.measurements.options import Options
from fitmat.measurements.parsing import contents, scales, units, unused
from fitmat.measurements.parsing.angles import ROUNDING, directions, unsaid_side
from fitmat.measurements.parsing.columns import Columns, assign
from fitmat.measurements.parsing.constants import with_constants
from fitmat.measurements.parsing.recording import Recording, pivot, sentinels
from fitmat.measurements.parsing.table import Table
from fitmat.measurements.parsing.wavelengths import in_nanometres, refuse_unlike
from fitmat.measurements.samples import default_channels

HIDDEN = 0.3
"""Share of the rows beyond 90° from the normal from which the angle may be another one."""


def recording(
    table: Table, columns: str | Mapping[str, str | int] | None, options: Options, *, doubted: bool = True
) -> Recording:
    """One row for each geometry and repeat.

    Args:
        table: Named columns.
        columns: Our name → theirs, where the header has other names.
        options: What the table does not say about itself.
        doubted: Whether to look for what may have been meant otherwise, which takes its time in every part of a file.

    Raises:
        ReadError: a column is missing or doubtful, or a cell is not what it should be.
    """
    if options.where is not None:
        table = table.chosen(options.where)
    return recorded(*laid_out(table, columns, options), options, doubted=doubted)


def laid_out(table: Table, columns: str | Mapping[str, str | int] | None, options: Options) -> tuple[Table, Columns]:
    """The table with a column for each constant, and what its columns mean; arguments and errors as `recording`."""
    whole = with_constants(table, columns, options.constants)
    return whole, assign(whole, columns, options.quantity)


def recorded(table: Table, layout: Columns, options: Options, *, doubted: bool) -> Recording:
    """The recording of a table whose columns are known, from `laid_out`; arguments and errors as `recording`."""
    refuse_unlike(table.source, tuple(layout.values))
    angles, assumed = directions(table, layout.angles, options)
    theta_i, phi_i, theta_o, phi_o = angles.T
    scale = _scale(table, layout, options)
    value, sigma = _stacked(table, layout.values), _stacked(table, layout.sigmas) if layout.sigmas else None
    doubts = {"flagged invalid": np.broadcast_to(_flagged(table, layout.marks)[:, None], value.shape)}
    if layout.inferred:
        marks = [np.nan_to_num(table.truths(column)) != 0 for column in layout.inferred.values()]
        doubts |= {inferred.REASON: np.stack(marks, axis=1)}
    doubts |= sentinels(value)
    value, sigma = scales.plain(value, sigma, scale)
    if layout.quantity == "signal":
        spread = _stacked(table, layout.reference_sigmas) if layout.reference_sigmas else None
        reference, spread = scales.plain(_stacked(table, layout.references), spread, scale)
        doubts |= {"reference reading not positive": ~(reference > 0)}
        value, sigma = _ratio((value, sigma), (np.where(reference > 0, reference, np.nan), spread))
    left = (f"Columns not used: {contents.listed(map(table.label, layout.unused))}.",) if layout.unused else ()
    wi, wo = from_angles(theta_i, phi_i), from_angles(theta_o, phi_o)
    labels = _labels(table, layout.marks)
    found = Recording(
        source=table.source,
        wi=wi,
        wo=wo,
        value=value,
        quantity="panel_ratio" if layout.quantity == "signal" else layout.quantity,
        channels=tuple(layout.values) if any(layout.values) else default_channels(1),
        sigma=sigma,
        doubts=doubts,
        notes=(*table.notes, *scales.note(scale), *assumed, *left),
        unsaid_side=unsaid_side(layout.angles, options),
        warnings=tuple(_doubts(table, layout, (wi, wo), labels, value, sigma)) if doubted else (),
    )
    return found if labels is None else pivot(found, labels)


def _doubts(
    table: Table,
    layout: Columns,
    pair: tuple[np.ndarray, np.ndarray],
    labels: np.ndarray | None,
    value: np.ndarray,
    sigma: np.ndarray | None,
) -> Iterator[str]:
    """What may have been meant otherwise: zenith angles beyond 90°, points in numbers, columns that play no part."""
    for name, w in zip(("theta_i", "theta_o"), pair, strict=True):
        beyond = int(np.count_nonzero(w[:, 2] < -ROUNDING))
        if beyond > HIDDEN * len(w):
            yield (
                f"{name} is beyond 90° in {beyond} of {len(w)} rows, which are not used: is it the angle of an arm "
                "that counts from elsewhere than the normal? Count it from the normal, in the file."
            )
    channel = [] if labels is None else [np.unique(labels, return_inverse=True)[1].reshape(-1, 1)]
    for column in (*layout.values.values(), *layout.references.values()):
        if cells := table.grouped(column):
            one, other = cells
            yield (
                f"{table.label(column)} has {one} beside {other}: the point was read as a decimal mark. "
                "If it separates thousands, write the numbers without it."
            )
    told, readings = np.hstack([*pair, *channel]), layout.quantity == "signal"
    yield from unused.doubts(table, layout.unused, told, value, noisy=sigma is not None, readings=readings)


def _scale(table: Table, layout: Columns, options: Options) -> str | None:
    """How the values are written: as the user says, or in percent where the header says so.

    Raises:
        ReadError: a column's name says that it holds logarithms and the user does not, or both say different things.
    """
    for column in (*layout.values.values(), *layout.sigmas.values()):
        name, scale = scales.stated(table.names[column])
        if scale and options.scale is None:
            remedy = f"pass --scale {scale}; if they are plain numbers, --scale linear (scale=)"
            got = f"the name of {table.label(column)} says that it holds logarithms of {contents.shown(name)}"
            raise ReadError(f"{table.source}: {got}, expected to be told. To read them as such, {remedy}.")
    if not _percent(table, layout):
        return options.scale
    if options.scale not in (None, "percent"):
        got = f"the header says %, --scale says {options.scale}"
        raise ReadError(f"{table.source}: {got}, expected them to agree. Correct the header, or leave the flag out.")
    return "percent"


def _stacked(table: Table, columns: Mapping[str, int]) -> np.ndarray:
    return np.stack([table.numbers(column) for column in columns.values()], axis=1)


def _percent(table: Table, layout: Columns) -> bool:
    """Whether the header says that the values are percentages; σ is in the unit of its values.

    Raises:
        ReadError: some columns are in % and others not, or a quantity that has a unit of its own is.
    """
    stated = {c: units.split(table.names[c])[1] == "%" for c in (*layout.values.values(), *layout.sigmas.values())}
    others = [*layout.references.values(), *layout.reference_sigmas.values()]
    if not any(stated.values()) and not any(units.split(table.names[c])[1] == "%" for c in others):
        return False
    if layout.quantity not in ("reflectance_factor", "panel_ratio"):
        got = f"{layout.quantity} or its sigma in %, expected {layout.quantity} in its own unit"
        remedy = (
            "Is it a reflectance factor (--columns reflectance_factor=…)? A sigma in % of the value: multiply it out"
        )
        raise ReadError(f"{table.source}: {got}. {remedy}.")
    if not all(stated[c] for c in layout.values.values()):
        named = contents.listed(table.label(c) for c, is_percent in stated.items() if is_percent)
        raise ReadError(f"{table.source}: only {named} in %, expected all values alike. Write them in one unit.")
    return True


def _ratio(
    signal: tuple[np.ndarray, np.ndarray | None], reference: tuple[np.ndarray, np.ndarray | None]
) -> tuple[np.ndarray, np.ndarray | None]:
    """y/r and its σ, √(σ_y² + (y/r σ_r)²)/r (JCGM 100:2008, eq. 10); a σ that is not given counts as 0."""
    (y, sigma_y), (r, sigma_r) = signal, reference
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is masked
        if sigma_y is None and sigma_r is None:
            return y / r, None
        given = (np.zeros_like(y) if sigma is None else sigma for sigma in (sigma_y, sigma_r))
        apart, shared = (np.where(sigma < 0, np.nan, sigma) for sigma in given)  # whose square would hide the sign
        return y / r, np.hypot(apart, y / r * shared) / r


def _flagged(table: Table, marks: Mapping[str, int]) -> np.ndarray:
    """Rows that the file calls invalid, (n,); an empty `valid` means no, an empty `flag` not raised."""
    flagged = np.zeros(len(table.lines), bool)
    if "valid" in marks:
        flagged |= ~(np.nan_to_num(table.truths(marks["valid"])) != 0)
    if "invalid" in marks:
        flagged |= np.nan_to_num(table.truths(marks["invalid"])) != 0
    return flagged


def _labels(table: Table, marks: Mapping[str, int]) -> np.ndarray | None:
    """Channel of each row, (n,), as wavelength or as text; None where columns are channels."""
    if "wavelength" in marks:
        unit = units.split(table.names[marks["wavelength"]])[1]
        labels, wrong, expected = in_nanometres(table.numbers(marks["wavelength"]), unit)
    elif "channel" in marks:
        labels = table.words(marks["channel"])
        refuse_unlike(table.source, tuple(dict.fromkeys(labels.tolist())))
        wrong, expected = labels == "", "the name of a channel"
    else:
        return None
    column = marks.get("wavelength", marks.get("channel", 0))
    table.refuse(column, wrong, f"{expected}. Correct the cell, or put # before the line to leave it out.")
    return labels
