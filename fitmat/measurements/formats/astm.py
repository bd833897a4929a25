"""ASTM: BRDF files after ASTM E1392, as the Cornell light measurement laboratory published them.

It guesses no unit: angles are radians, as in all published files, and degrees are refused.

The layout is the one that libbsdf (R. Kimura, `AstmReader.cpp`) and ALTA (`plugins/data_io/astm.cpp`) read: lines of a
keyword and its value, of which NUM_POINTS states the number of rows; a line VARS that names the columns, theta_i,
phi_i, theta_s, phi_s and then R,G,B or X,Y,Z or wavelengths such as 550nm or one quantity; then rows with commas.
Azimuths are those of the directions themselves, so that the mirror side is φ_s − φ_i = π.
"""

import os
import re

import numpy as np

from fitmat.errors import ReadError
from fitmat.maths.directions import from_angles
from fitmat.measurements.parsing import blocks, contents
from fitmat.measurements.parsing.angles import ROUNDING
from fitmat.measurements.parsing.recording import Recording
from fitmat.measurements.samples import default_channels

ANGLES = {"theta_i": "theta_i", "phi_i": "phi_i", "theta_s": "theta_o", "phi_s": "phi_o"}
"""Name in VARS → ours; phi_i may be absent, and is 0 then."""

_TRIPLES = {("r", "g", "b"), ("x", "y", "z")}
_WAVELENGTH = re.compile(r"(\d+(?:\.\d+)?) ?nm")
_COSINE = ("ccbrdf", "ccbsdf")


def claims(head: bytes, size: int) -> bool:
    """Whether a line VARS names theta_i."""
    return blocks.begins(head, rb"VARS[ \t].*\btheta_i\b")


def load(path: str | os.PathLike[str]) -> Recording:
    """One row for each line, with the file's own azimuths.

    Raises:
        ReadError: VARS names other columns, rows are fewer or more than NUM_POINTS, or angles are not radians.
    """
    source = contents.name(path)
    text, notes = contents.decoded(contents.contents(path), source)
    every = blocks.lines(text, source)
    start = every.text.str.contains(r"(?i)^VARS\b").arg_true()
    if not len(start):
        raise ReadError(f"{source}: no line VARS, expected one with the names of the columns. Is the file complete?")
    row = int(start[0])
    names = [name.strip().lower() for name in re.sub(r"(?i)^VARS\s*", "", every.text[row]).split(",")]
    channels, quantity = _channels(names, every.where(row))
    below = every.keep(np.arange(len(every.text)) > row)
    table = blocks.Lines(source, below.number, below.text.str.replace_all(r"\s*,\s*", " ")).table(
        len(names), "the columns that VARS names"
    )
    _refuse_count(every.keep(np.arange(len(every.text)) < row), len(table))
    angles = {ours: table[:, names.index(name)] for name, ours in ANGLES.items() if name in names}
    for name, angle in angles.items():
        limit = np.pi if name.startswith("theta") else 2 * np.pi
        for bad in np.flatnonzero(np.abs(angle) > limit + ROUNDING)[:1]:
            got = f"{name} = {angle[bad]:g}, expected −{limit:.4g} to {limit:.4g} radians, the unit of the format"
            remedy = "If it is in degrees, delete the lines above VARS and that word, and read the rest as a table"
            raise ReadError(f"{below.where(bad)}: {got}. {remedy}.")
    return Recording(
        source=source,
        wi=blocks.placed(from_angles(angles["theta_i"], angles.get("phi_i", np.zeros(len(table))))),
        wo=blocks.placed(from_angles(angles["theta_o"], angles["phi_o"])),
        value=np.delete(table, [names.index(name) for name in ANGLES if name in names], axis=1),
        quantity=quantity,
        channels=channels,
        notes=(*notes, "ASTM angles read as radians; the mirror side is phi_s − phi_i = π."),
    )


def _channels(names: list[str], where: str) -> tuple[tuple[str, ...], str]:
    """Names of the channels, and the quantity that they are of."""
    missing = [name for name in ANGLES if name not in names and name != "phi_i"]
    values = [name for name in names if name not in ANGLES]
    if missing or len(set(names)) < len(names) or not values:
        got = f"VARS names {blocks.shown(', '.join(names))}"
        raise ReadError(f"{where}: {got}, expected {', '.join(ANGLES)} and values, once each. Correct the line.")
    if tuple(values) in _TRIPLES:
        return tuple(values), "brdf"
    wavelengths = [match[1] for name in values if (match := _WAVELENGTH.fullmatch(name))]
    if len(wavelengths) == len(values) == len(set(wavelengths)):
        return tuple(wavelengths), "brdf"
    if len(values) == 1:
        return default_channels(1), "brdf_cos" if values[0].startswith(_COSINE) else "brdf"
    expected = "expected R,G,B or X,Y,Z or wavelengths as 550nm or one quantity"
    raise ReadError(f"{where}: VARS names {blocks.shown(', '.join(values))}, {expected}. Rename them.")


def _refuse_count(head: blocks.Lines, rows: int) -> None:
    stated = head.text.str.extract(r"(?i)^NUM_POINTS\s+(.*)$")
    for row in stated.is_not_null().arg_true():
        if stated[row] != str(rows):
            got = f"NUM_POINTS {blocks.shown(stated[row])} and {rows} rows, expected them to agree"
            raise ReadError(f"{head.where(row)}: {got}. Was the file cut off?")
    if not rows:
        raise ReadError(f"{head.source}: no rows below VARS, expected at least one. Was the file cut off?")
