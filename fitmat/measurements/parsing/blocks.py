"""Blocks: text files of keyword lines and, below them, blocks of numbers; and the angles in which such files count.

It knows no format and skips no line: a word that is not a keyword of the format is refused, as is a cell that is no
number.
"""

import dataclasses
import re
from collections.abc import Collection

import numpy as np
import polars as pl
from jaxtyping import Bool, Float, Int

from fitmat.errors import ReadError
from fitmat.maths.directions import from_angles
from fitmat.measurements.parsing.contents import shown as shown
from fitmat.text import brief

_BOM = b"\xef\xbb\xbf"
_WORD = r"^[A-Za-z]"
_NO_WORD = r"^(?i)(nan|inf|infinity)(\s|$)"
_TURN = 2 * np.pi
_SAME = 1e-9


def begins(head: bytes, *patterns: bytes) -> bool:
    """Whether each pattern stands at the beginning of a line, whatever its letter case and line ends."""
    text = head.removeprefix(_BOM).replace(b"\r", b"\n")
    return all(re.search(rb"(?im)^[ \t]*" + pattern, text) for pattern in patterns)


@dataclasses.dataclass(frozen=True, eq=False)
class Lines:
    """Lines of a file without blank ones and comments.

    Attributes:
        source: Name of the file, for messages.
        number: Number of each line in the file, (k,), from 1.
        text: The lines, without white space at their ends.
    """

    source: str
    number: Int[np.ndarray, " k"]
    text: pl.Series

    __repr__ = brief

    def where(self, row: int) -> str:
        """File and line, as messages begin."""
        return f"{self.source} row {self.number[row]}"

    def keep(self, chosen: Bool[np.ndarray, " k"]) -> "Lines":
        """The lines for which `chosen` is true."""
        return Lines(self.source, self.number[chosen], self.text.filter(pl.Series(chosen, dtype=pl.Boolean)))

    def numbers(self) -> tuple[Float[np.ndarray, " m"], Int[np.ndarray, " k"]]:
        """All numbers, separated by white space, and how many each line holds.

        Raises:
            ReadError: a word is no number; the first one is named.
        """
        if not len(self.text):
            return np.zeros(0), np.zeros(0, int)
        cells = self.text.str.replace_all(r"\s+", " ").str.strip_chars().str.split(" ")
        count, flat = cells.list.len().to_numpy().astype(int), cells.explode()
        number = flat.str.strip_prefix("+").cast(pl.Float64, strict=False)
        for bad in number.is_null().arg_true()[:1]:
            row = int(np.searchsorted(np.cumsum(count), bad, side="right"))
            raise ReadError(f"{self.where(row)}: {shown(flat[bad])}, expected a number. Correct the line.")
        return number.to_numpy(), count

    def table(self, width: int, expected: str) -> Float[np.ndarray, "k {width}"]:
        """The numbers as a table.

        Args:
            width: Numbers that each line must hold.
            expected: Why that many, for the message.

        Raises:
            ReadError: a line holds more or fewer, or no numbers.
        """
        number, count = self.numbers()
        for row in np.flatnonzero(count != width)[:1]:
            remedy = "Was the file cut off?" if row == len(count) - 1 else "Correct the line."
            raise ReadError(f"{self.where(row)}: {count[row]} numbers, expected {width} ({expected}). {remedy}")
        return number.reshape(-1, width)


def lines(text: str, source: str, *, comment: str = "#", first: int = 1) -> Lines:
    """The lines that hold something.

    Args:
        text: Of the file, or of a part of it.
        source: Name of the file.
        comment: What a line that is left out begins with.
        first: Number of the first line in the file.
    """
    unified = text.replace("\r\n", "\n").replace("\r", "\n")
    every = pl.Series([unified]).str.split("\n").explode().str.strip_chars()
    kept = ((every != "") & ~every.str.starts_with(comment)).to_numpy()
    return Lines(source, np.arange(first, first + len(every)), every).keep(kept)


@dataclasses.dataclass(frozen=True, eq=False)
class Sections:
    """A file cut at its k keyword lines.

    Attributes:
        heads: The keyword lines.
        key: Their keywords, in lower case.
        rest: What follows the keyword on its line.
        start: Where the numbers below each keyword line begin in `number`, and where the last ones end, (k + 1,).
        number: All numbers below keyword lines, (m,).
    """

    heads: Lines
    key: pl.Series
    rest: pl.Series
    start: Int[np.ndarray, " k_1"]
    number: Float[np.ndarray, " m"]

    __repr__ = brief

    def at(self, *keys: str) -> Int[np.ndarray, " j"]:
        """Which sections have one of these keywords."""
        return self.key.is_in(list(keys)).arg_true().to_numpy().astype(int)

    def word(self, key: str, allowed: Collection[str]) -> str:
        """The word beside a keyword that stands once in the file, in lower case.

        Raises:
            ReadError: the keyword is missing or there twice, or the word is not an allowed one.
        """
        row = self._only(key)
        word = str(self.rest[row]).lower()
        if word not in allowed:
            expected = " or ".join(allowed)
            remedy = "Write the file with one of these"
            raise ReadError(f"{self.heads.where(row)}: {key} {shown(word)}, expected {expected}. {remedy}.")
        return word

    def listed(self, key: str, lowest: float, highest: float) -> Float[np.ndarray, " j"]:
        """The angles of a keyword line that states their number.

        Raises:
            ReadError: they are missing, more or fewer than stated, or out of range (degrees).
        """
        row = self._only(key)
        found = self.number[self.start[row] : self.start[row + 1]]
        stated = str(self.rest[row])
        if stated != str(len(found)) or not len(found):
            got = f"{key} {shown(stated)} with {len(found)} angles below it"
            raise ReadError(f"{self.heads.where(row)}: {got}, expected as many angles as stated. Correct the number.")
        for bad in found[~((found >= lowest) & (found <= highest))][:1]:
            got, expected = f"{key} holds {bad:g}", f"expected {lowest:g} to {highest:g} degrees"
            raise ReadError(f"{self.heads.where(row)}: {got}, {expected}. Correct the angle.")
        return found

    def blocks(self, rows: Int[np.ndarray, " j"], size: int, expected: str) -> Float[np.ndarray, "j {size}"]:
        """The numbers of several sections, as many in each.

        Raises:
            ReadError: a section holds more or fewer.
        """
        count = self.start[rows + 1] - self.start[rows]
        for bad in np.flatnonzero(count != size)[:1]:
            got = f"{count[bad]} numbers in the block that begins here"
            raise ReadError(
                f"{self.heads.where(int(rows[bad]))}: {got}, expected {size} ({expected}). Was the file cut off?"
            )
        inside = np.zeros(len(self.key), bool)
        inside[rows] = True
        return self.number[np.repeat(inside, np.diff(self.start))].reshape(-1, size)

    def totals(self, rows: Int[np.ndarray, " j"]) -> Float[np.ndarray, " j"]:
        """The numbers beside keywords that state what a block adds up to; NaN where none does, or none above 0."""
        stated = self.rest.gather(rows).cast(pl.Float64, strict=False).fill_null(np.nan).to_numpy()
        return np.where(stated > 0, stated, np.nan)

    def refuse_numbers_outside(self, *keys: str) -> None:
        """Stop at numbers below any other keyword.

        Raises:
            ReadError: there are some.
        """
        stray = np.diff(self.start) > 0
        stray[self.at(*keys)] = False
        for row in np.flatnonzero(stray)[:1]:
            got = f"numbers below {shown(str(self.key[int(row)]))}, expected none"
            raise ReadError(f"{self.heads.where(row)}: {got}. Was a line lost?")

    def _only(self, key: str) -> int:
        rows = self.at(key.lower())
        if len(rows) == 1:
            return int(rows[0])
        got = f"no line {key}" if not len(rows) else f"{len(rows)} lines {key}, the second on row"
        got += f" {self.heads.number[rows[1]]}" if len(rows) else ""
        raise ReadError(f"{self.heads.source}: {got}, expected one. Is the file complete?")


def sections(text: str, source: str, known: Collection[str]) -> Sections:
    """Cut a text at its keyword lines.

    Args:
        text: Of the file.
        source: Its name.
        known: The format's keywords, in lower case.

    Raises:
        ReadError: another word begins a line, numbers stand above the first keyword, or a cell is no number.
    """
    every = lines(text, source)
    worded = (every.text.str.contains(_WORD) & ~every.text.str.contains(_NO_WORD)).to_numpy()
    heads = every.keep(worded)
    parts = heads.text.str.replace_all(r"\s+", " ").str.splitn(" ", 2).struct.unnest()
    key = parts.to_series(0).str.to_lowercase()
    for row in (~key.is_in(list(known))).arg_true()[:1]:
        remedy = "Put # before the line if it can be left out"
        raise ReadError(f"{heads.where(row)}: {shown(key[row])}, expected a keyword of the format. {remedy}.")
    if not worded[:1].all():
        raise ReadError(f"{every.where(0)}: numbers above the first keyword, expected none. Is it the right file?")
    number, count = every.keep(~worded).numbers()
    below = np.zeros(len(worded), int)
    below[~worded] = count
    start = np.append((np.cumsum(below) - below)[worded], len(number))
    return Sections(heads, key, parts.to_series(1).fill_null(""), start, number)


def placed(w: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 3"]:
    """Directions, NaN throughout where one of their angles is missing, be it the azimuth alone."""
    return np.where(np.isnan(w).any(axis=-1, keepdims=True), np.nan, w)


def around(
    polar_m: np.ndarray, phi_i: np.ndarray, polar: np.ndarray, azimuth: np.ndarray
) -> Float[np.ndarray, "... 3"]:
    r"""Directions from their angles about a mirror direction; all in radians, broadcast against each other.

    .. math:: \omega_o = \cos\rho\, m + \sin\rho (\cos\alpha\, t + \sin\alpha\, m \times t)

    with the mirror direction m, and t at right angles to it towards the normal: azimuth 0 leads over the normal to the
    light's side, π to grazing, and it increases counter-clockwise as seen from outside the hemisphere.

    Args:
        polar_m: Zenith angle of the mirror direction; that of the light where the two agree.
        phi_i: Azimuth of the light.
        polar: Angle ρ from the mirror direction.
        azimuth: Angle α about it.
    """
    zero = np.zeros(np.broadcast_shapes(*(np.shape(a) for a in (polar_m, phi_i, polar, azimuth))))
    mirror = from_angles(polar_m + zero, phi_i + np.pi + zero)
    upward = from_angles(np.pi / 2 - polar_m + zero, phi_i + zero)
    across = np.cross(mirror, upward)
    cos, sin = (f(azimuth + zero)[..., None] for f in (np.cos, np.sin))
    return np.cos(polar + zero)[..., None] * mirror + np.sin(polar + zero)[..., None] * (cos * upward + sin * across)


def from_half(
    theta_h: np.ndarray, phi_h: np.ndarray, theta_d: np.ndarray, phi_d: np.ndarray
) -> tuple[Float[np.ndarray, "... 3"], Float[np.ndarray, "... 3"]]:
    r"""The two directions of a half vector and a difference direction; angles in radians, of one shape.

    The first is :math:`R_z(\phi_h) R_y(\theta_h)\, d(\theta_d, \phi_d)`, the second its mirror image about the half
    vector (S. Rusinkiewicz, "A New Change of Variables for Efficient BRDF Representation", 1998).
    """
    half, difference = from_angles(theta_h, phi_h), from_angles(theta_d, phi_d)
    x, y, z = np.moveaxis(difference, -1, 0)
    tilted = np.cos(theta_h) * x + np.sin(theta_h) * z
    first = np.stack(
        [
            np.cos(phi_h) * tilted - np.sin(phi_h) * y,
            np.sin(phi_h) * tilted + np.cos(phi_h) * y,
            np.cos(theta_h) * z - np.sin(theta_h) * x,
        ],
        axis=-1,
    )
    return first, 2.0 * np.cos(theta_d)[..., None] * half - first


def repeated(
    value: Float[np.ndarray, "... a p c"], polar: Float[np.ndarray, " p"], azimuth: Float[np.ndarray, " a"]
) -> Bool[np.ndarray, "... a p c"]:
    """Cells that repeat a direction and its value: the pole for every azimuth, and the last azimuth of a full turn.

    Grids store such cells because they are rectangular; they were measured once.

    Args:
        value: What the grid holds.
        polar: Polar angles of the grid in radians.
        azimuth: Its azimuths in radians, the seam being at the first one.
    """
    pole = np.abs(np.sin(polar)) < _SAME
    seam = np.abs(azimuth - azimuth[0] - _TURN) < _SAME
    twice = (pole | seam[:, None])[..., None] & (value == value[..., :1, :, :])
    twice[..., 0, :, :] = False
    return twice
