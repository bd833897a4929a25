"""Table: named columns of cells, each of which can say where it stands in its file.

It opens no file (`text` does) and knows no column name (`columns` does).
"""

import dataclasses
from collections.abc import Mapping

import numpy as np
import polars as pl
from jaxtyping import Bool, Float, Int

from fitmat.errors import ReadError
from fitmat.measurements.parsing.contents import listed, shown
from fitmat.text import brief

ERROR_VALUES = ("#n/a", "#div/0!", "#ref!", "#value!", "#name?", "#num!", "#null!")
"""What spreadsheets write into a cell that they cannot compute, in lower case."""

MISSING = ("", "nan", "na", "n/a", "n.a.", "<na>", "null", "none", "-", "--", "---", *ERROR_VALUES)
"""Cells that hold no number and say so, in lower case."""

_TRUTH = {"true": "1", "t": "1", "yes": "1", "y": "1", "false": "0", "f": "0", "no": "0", "n": "0"}
_FORTRAN = r"^([-+]?\d*\.?\d*)d([-+]?\d+)$"
_THREE_BEHIND, _WHOLE = r"^[-+−]?[1-9]\d{0,2}\.\d{3}$", r"^[-+−]?(0|[1-9]\d{0,2})$"
_PLAIN = {"−": "-", ",": "."}


@dataclasses.dataclass(frozen=True, eq=False)
class Table:
    """n rows of cells, text or numbers.

    Attributes:
        source: Name of the file, for messages.
        names: Header of each column; "" where there is none.
        cells: The cells, columns in the order of `names`.
        lines: Line number in the file of each row, (n,), from 1.
        notes: What was found out while reading.
        stated: Name, number (in nm for one in µm) and line of the comments "# theta_i = 30 deg".
    """

    source: str
    names: tuple[str, ...]
    cells: pl.DataFrame
    lines: Int[np.ndarray, " n"]
    notes: tuple[str, ...] = ()
    stated: tuple[tuple[str, float, int], ...] = ()

    __repr__ = brief

    def where(self, row: int) -> str:
        """File and line of a row, as messages begin."""
        return f"{self.source} row {self.lines[row]}"

    def label(self, column: int) -> str:
        """A column's name, or its number where it has none."""
        return shown(self.names[column]) or f"column {column + 1}"

    def numbers(self, column: int) -> Float[np.ndarray, " n"]:
        """The column as float64, NaN where a cell is empty.

        Raises:
            ReadError: a cell holds text; the first such cell is named.
        """
        return self._cast(column, self._lower(column), "a number")

    def truths(self, column: int) -> Float[np.ndarray, " n"]:
        """The column as 1 (true), 0 (false) or NaN (empty); other numbers as they are.

        Raises:
            ReadError: a cell is neither; the first such cell is named.
        """
        return self._cast(column, self._lower(column).replace(_TRUTH), "true or false")

    def words(self, column: int) -> np.ndarray:
        """The column as text, (n,), "" where a cell is empty."""
        text = self.cells.to_series(column).cast(pl.String).fill_null("").str.strip_chars()
        return text.to_numpy().astype(str)

    def chosen(self, where: str) -> "Table":
        """The rows in which a column has a value, `where` being NAME=VALUE.

        Raises:
            ReadError: no such column, or no such row; what there is is listed.
        """
        name, given, value = (part.strip() for part in where.partition("="))
        if not given:
            raise ReadError(f"{self.source}: where = {where!r} (--where), expected NAME=VALUE. Write material=Alu.")
        if name not in self.names:
            there = listed(self.names) or "none has a name"
            raise ReadError(f"{self.source}: where = {where!r} (--where), expected a column of {there}. Correct it.")
        words = self.words(self.names.index(name))
        rows = np.flatnonzero(self.matches(name, value))
        if not len(rows):
            found = list(dict.fromkeys(words.tolist()))
            expected = f"expected one of {listed(found)}. Choose one (--where)"
            raise ReadError(f"{self.source}: {shown(name)} is never {value!r}, {expected}.")
        noted = (*self.notes, f"Only rows with {name} = {value}: {len(rows)} of {len(words)}.")
        return dataclasses.replace(self, cells=self.cells[rows], lines=self.lines[rows], notes=noted)

    def matches(self, name: str, value: str) -> Bool[np.ndarray, " n"]:
        """Rows in which the column of that name has that value: as a number where all its cells are, else as text."""
        words = self.words(self.names.index(name))
        wanted = _numbers(pl.Series([value.lower()]))[0]
        if wanted is None or not self.is_numeric(name):
            return words == value
        return (_numbers(self._lower(self.names.index(name))) == wanted).fill_null(False).to_numpy()

    def is_numeric(self, name: str) -> bool | None:
        """Whether every cell of a column that is not missing is a number; None where all are missing."""
        text = self._lower(self.names.index(name))
        text = text.filter(~text.is_in(MISSING))
        return bool(_numbers(text).is_not_null().all()) if len(text) else None

    def refuse(self, column: int, bad: Bool[np.ndarray, " n"], expected: str) -> None:
        """Stop at the first bad cell of a column.

        Raises:
            ReadError: any of `bad` is true.
        """
        for row in np.flatnonzero(bad)[:1]:
            cell = shown(str(self.cells.to_series(column)[int(row)])) or "(empty)"
            raise ReadError(f"{self.where(row)}: {self.label(column)} = {cell}, expected {expected}")

    def grouped(self, column: int) -> tuple[str, str] | None:
        """Two cells of a column whose points may separate thousands, None where they cannot.

        As 1.234 beside 987: numbers with three digits behind a point and whole ones below 1000, and no others.
        """
        if (cells := self.cells.to_series(column)).dtype != pl.String:
            return None
        text = cells.fill_null("").str.strip_chars()
        pointed, whole = text.str.contains(_THREE_BEHIND), text.str.contains(_WHOLE)
        if not (pointed.any() and whole.any()) or (text.str.contains(r"\d") & ~pointed & ~whole).any():
            return None
        return text.filter(pointed)[0], text.filter(whole)[0]

    def _lower(self, column: int) -> pl.Series:
        return self.cells.to_series(column).cast(pl.String).fill_null("").str.strip_chars().str.to_lowercase()

    def _cast(self, column: int, text: pl.Series, expected: str) -> Float[np.ndarray, " n"]:
        if (cells := self.cells.to_series(column)).dtype.is_float():
            return cells.to_numpy()
        number = _numbers(text)
        bad = (number.is_null() & ~text.is_in(MISSING)).to_numpy()
        self.refuse(column, bad, f"{expected}. Correct the cell, or put # before the line to leave it out.")
        return number.fill_null(np.nan).to_numpy()


def _numbers(text: pl.Series) -> pl.Series:
    """Cells in lower case as numbers, null where they are none; Fortran writes 1.2d-02 for 1.2e-02."""
    plain = text.str.replace_many(_PLAIN)
    return plain.str.replace(_FORTRAN, "${1}e${2}").cast(pl.Float64, strict=False)


def from_arrays(arrays: Mapping[str, np.ndarray], source: str) -> Table:
    """A table of 1-D arrays; rows are numbered from 1, masked entries become empty.

    Raises:
        ReadError: no rows, an array that is not 1-D, or arrays of unlike length.
    """
    columns = {str(name): _series(str(name), array, source) for name, array in arrays.items()}
    lengths = {name: len(column) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        got = listed(f"{shown(name)}: {length}" for name, length in lengths.items())
        raise ReadError(f"{source}: columns of unlike length ({got}), expected one length. Give one value per row.")
    if not sum(lengths.values()):
        raise ReadError(f"{source}: no rows, expected at least one measured value. Check how it was made.")
    cells = pl.DataFrame(list(columns.values()))
    return Table(source, tuple(columns), cells, np.arange(1, cells.height + 1))


def _series(name: str, array: np.ndarray, source: str) -> pl.Series:
    try:
        column = np.ma.asarray(array)
        numeric = column.dtype.kind in "biuf"
        filled = np.ma.filled(column.astype(float), np.nan) if numeric else np.ma.filled(column.astype(str), "")
    except (TypeError, ValueError) as error:
        got = f"column {shown(name)} is not an array ({shown(str(error), 200)})"
        raise ReadError(f"{source}: {got}, expected (n,) numbers or texts. Give one value per row.") from error
    if filled.ndim != 1:
        expected = "expected (n,). Give one value per row, and each name once."
        raise ReadError(f"{source}: column {shown(name)} has shape {filled.shape}, {expected}")
    return pl.Series(name.encode("utf-8", "replace").decode(), filled if numeric else _sound(filled))


def _sound(text: np.ndarray) -> list[str]:
    """Text without the halves of characters that UTF-8 cannot hold."""
    return [cell.encode("utf-8", "replace").decode() for cell in text.tolist()]
