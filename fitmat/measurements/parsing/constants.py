"""Constants: what is the same in every row and has no column: by the user's word, or by a comment of the file.

It replaces no column: a constant beside a column of that meaning is refused, a comment beside one is left alone.
"""

import dataclasses
from collections.abc import Mapping

import numpy as np
import polars as pl

from fitmat.errors import ReadError
from fitmat.measurements.options import ANGLES, ELEVATIONS
from fitmat.measurements.parsing.columns import roles
from fitmat.measurements.parsing.names import Role, role
from fitmat.measurements.parsing.table import Table
from fitmat.measurements.parsing.wavelengths import SHORTEST

CONSTANTS = (*ANGLES, "wavelength")
"""What can be said to be the same in every row."""


def with_constants(
    table: Table, columns: str | Mapping[str, str | int] | None, constants: Mapping[str, float]
) -> Table:
    """The table with a column for each constant, which a note names.

    Args:
        table: As it was read.
        columns: The user's mapping, as for `columns.assign`.
        constants: Name → number, in the unit of the file's angles, or nm.

    Raises:
        ReadError: a constant has a column, is none of `CONSTANTS`, or comments state two numbers for it.
    """
    found = roles(table, columns)
    there = {mine.kind: column for mine, column in found.items()}
    for name, number in constants.items():
        said = f"{name} = {number:g} (--{name.replace('_', '-')})"
        if name not in CONSTANTS:
            raise ReadError(f"{table.source}: {said}, expected one of {', '.join(CONSTANTS)}. Correct the name.")
        if name in there:
            got = f"{said} beside a column of that meaning, {table.label(there[name])}"
            raise ReadError(f"{table.source}: {got}, expected one of them. Leave the constant out.")
        if not np.isfinite(number):
            raise ReadError(f"{table.source}: {said}, expected a number. Correct it.")
        table = _added(table, name, number, "as was said")
    known = {*there, *constants} | ({"channel"} if any(mine.channel for mine in found) else set())
    for name in _wanted(known):
        rows = [(number, row) for words, number, row in table.stated if role(words) == Role(name)]
        if rows := [stated for stated in rows if name != "wavelength" or stated[0] >= SHORTEST]:
            _refuse_contradiction(table, name, rows)
            table = _added(table, name, rows[0][0], f"by the comment in row {rows[0][1]}")
    return table


def _wanted(known: set[str]) -> list[str]:
    """The angles that a file needs and has no column for, and the wavelength, where no channel has a name."""
    wanted = [zenith for zenith, elevation in ELEVATIONS.items() if not {zenith, elevation} & known]
    wanted += ["phi_i"] if "phi_o" in known and not {"phi", "phi_i"} & known else []
    return wanted if {"wavelength", "channel"} & known else [*wanted, "wavelength"]


def _refuse_contradiction(table: Table, name: str, rows: list[tuple[float, int]]) -> None:
    for number, row in rows:
        if number != rows[0][0]:
            got = f"comments state {name} = {rows[0][0]:g} in row {rows[0][1]} and {number:g} in row {row}"
            raise ReadError(f"{table.source}: {got}, expected one for the file. Give it a column, or split the file.")


def _added(table: Table, name: str, number: float, why: str) -> Table:
    constant = pl.Series(f"constant {name}", np.full(len(table.lines), float(number)))
    note = f"{name} = {number:g} in every row, {why}."
    cells = table.cells.with_columns(constant)
    return dataclasses.replace(table, names=(*table.names, name), cells=cells, notes=(*table.notes, note))
