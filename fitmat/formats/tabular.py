"""Tabular: a table's named columns → a `Recording`.

It opens no file and masks nothing.
"""

from collections.abc import Mapping

import numpy as np

from fitmat.formats.angles import directions
from fitmat.formats.columns import assign
from fitmat.formats.options import Options
from fitmat.formats.recording import Recording, pivot
from fitmat.formats.table import Table
from fitmat.geometry import from_angles
from fitmat.measurement import default_channels


def recording(table: Table, columns: str | Mapping[str, str | int] | None, options: Options) -> Recording:
    """One row for each geometry and repeat.

    Args:
        table: Named columns.
        columns: Our name → theirs, where the header has other names.
        options: What the table does not say about itself.

    Raises:
        ReadError: a column is missing or doubtful, or a cell is not what it should be.
    """
    layout = assign(table, columns, options.quantity)
    angles, assumed = directions(table, layout.angles, options)
    theta_i, phi_i, theta_o, phi_o = angles.T
    value = np.stack([table.numbers(column) for column in layout.values.values()], axis=1)
    sigma = [table.numbers(column) for column in layout.sigmas.values()]
    unused = (f"Columns not used: {', '.join(layout.unused)}.",) if layout.unused else ()
    found = Recording(
        source=table.source,
        wi=from_angles(theta_i, phi_i),
        wo=from_angles(theta_o, phi_o),
        value=value,
        quantity=layout.quantity,
        channels=tuple(layout.values) if any(layout.values) else default_channels(1),
        sigma=np.stack(sigma, axis=1) if sigma else None,
        doubts={"flagged invalid": np.broadcast_to(_flagged(table, layout.marks)[:, None], value.shape)},
        notes=(*table.notes, *assumed, *unused),
    )
    labels = _labels(table, layout.marks)
    return found if labels is None else pivot(found, labels)


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
        labels = table.numbers(marks["wavelength"])
        wrong, expected = ~(np.isfinite(labels) & (labels > 0)), "a wavelength in nm"
    elif "channel" in marks:
        labels = table.words(marks["channel"])
        wrong, expected = labels == "", "the name of a channel"
    else:
        return None
    column = marks.get("wavelength", marks.get("channel", 0))
    table.refuse(column, wrong, f"{expected}. Correct the cell, or put # before the line to leave it out.")
    return labels
