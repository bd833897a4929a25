"""Road: r-tables, reduced luminance coefficients of a road surface as its drivers see it.

It asks for no scale: a table that is normalised is refused, since nothing in it says by how much.

The table is that of CIE 144:2001 (before, CIE 30.2), Road surface and road marking reflection characteristics: 10⁴ r of
tan γ (rows) and β (columns, 0 to 180°), where γ is the zenith angle of the light, β the angle between the planes of
incidence and observation with the mirror side at 0, r = q cos³γ, and q = L/E, cd/(m² lx), which is f_r. The observer
looks down at 1°. It comes as text with the β of the CIE in one line and tan γ in front of each row, or as DIALux's .RTB
(DIAL, "R-tables in DIALux"): RTable.v1, a name, the number of tan γ and each, the number of β and each, Q0, then all
values, tan γ fastest, one a line.
"""

import os
import re
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from fitmat.errors import ReadError
from fitmat.maths.directions import from_angles
from fitmat.measurements.parsing import blocks, contents
from fitmat.measurements.parsing.recording import Recording
from fitmat.measurements.samples import default_channels

OBSERVER = np.deg2rad(89.0)
"""Zenith angle of the observer: 1° above the road."""

BETAS = (0, 2, 5, 10, 15, 20, 25, 30, 35, 40, 45, 60, 75, 90, 105, 120, 135, 150, 165, 180)
"""Columns of the CIE's table, degrees."""

SCALE = 1e4
"""By which tables are multiplied."""

DARKEST, WHITE = 1e-3, 1.0 / np.pi
"""In sr⁻¹, of light along the normal: no road is darker than the one, and none whiter than a perfect white."""

_MAGIC = rb"RTable\.v\d"
_GAP = r"[ \t;,]+"
_NUMBER = r"{}(?:\.0+)?(?:Â?°)?"  # of UTF-8 read as Latin-1, too
_AXIS = r"\b" + _GAP.join(_NUMBER.format(beta) for beta in BETAS)
_MARK = re.compile(r"(?<=\b2)(?:\.0+)?°?([ \t;,]+)5")
_NOTHING = "\0"  # a character that no text has
_EMPTY = ("", "-", "–", "—")


class _Table(NamedTuple):
    """10⁴ r of the cells, NaN where there is none."""

    tan: Float[np.ndarray, " t"]
    beta: Float[np.ndarray, " b"]
    cells: Float[np.ndarray, "t b"]
    title: str


def claims(head: bytes, size: int) -> bool:
    """Whether it begins as an .RTB file does, or a line holds the β of the CIE."""
    return bool(re.match(rb"(\xef\xbb\xbf)?\s*" + _MAGIC, head) or re.search(_AXIS.encode("latin-1"), head))


def load(path: str | os.PathLike[str]) -> Recording:
    """One row for each cell, tan γ slowest; the light at azimuth 0, the mirror side at 180° − β.

    Raises:
        ReadError: the table is cut off, its axes are no tan γ and β, or its values no r × 10⁴.
    """
    source = contents.name(path)
    text, notes = contents.decoded(contents.contents(path), source)
    table = _rtb(text, source) if re.match(r"\s*" + _MAGIC.decode(), text) else _matrix(text, source)
    _refuse_axes(table, source)
    gamma, beta = np.arctan(table.tan), np.deg2rad(table.beta)
    q = table.cells / (SCALE * np.cos(gamma)[:, None] ** 3)
    _refuse_scale(q, table.tan, source)
    theta_i, phi = (a.ravel() for a in np.meshgrid(gamma, np.pi - beta, indexing="ij"))
    twice = blocks.repeated(q.T[..., None], gamma, beta)[..., 0].T
    return Recording(
        source=source,
        wi=from_angles(theta_i, np.zeros_like(theta_i)),
        wo=from_angles(np.full_like(theta_i, OBSERVER), phi),
        value=q.reshape(-1, 1),
        quantity="brdf",
        channels=default_channels(1),
        doubts={
            "0, which r-tables hold where nothing is defined": q.reshape(-1, 1) == 0,
            "the same value of a direction once more: along the normal there is no β": twice.reshape(-1, 1),
        },
        notes=(
            *notes,
            f"Road r-table{table.title}: f_r = r/(10⁴ cos³γ), seen from 1° above the road (theta_o = 89°); β = 0 is "
            "the mirror side.",
        ),
    )


def _rtb(text: str, source: str) -> _Table:
    """The numbers of an .RTB file, one a line."""
    lines = blocks.lines(text, source)
    body = lines.keep(np.arange(len(lines.text)) >= 2)
    number, count = blocks.Lines(body.source, body.number, body.text.str.replace(",", ".")).numbers()
    if (count != 1).any() or len(number) < 2:
        row = int(np.argmax(count != 1)) if len(count) else 0
        where = body.where(row) if len(count) else source
        raise ReadError(f"{where}: expected one number a line below the name of the road. Was the file cut off?")
    axes, at = [], 0
    for axis in ("tan γ", "β"):
        size = number[at] if at < len(number) else np.nan
        if not (size == round(size) if np.isfinite(size) else False) or not 2 <= size < len(number) - at:
            where = body.where(min(at, len(number) - 1))
            raise ReadError(f"{where}: {size:g}, expected the number of {axis} that follow. Was the file cut off?")
        axes.append(number[at + 1 : at + 1 + int(size)])
        at += 1 + int(size)
    tan, beta = axes
    cells = number[at + 1 :]
    if len(cells) != len(tan) * len(beta):
        got = f"{len(cells)} values below Q0, expected {len(tan) * len(beta)}: {len(tan)} tan γ × {len(beta)} β"
        raise ReadError(f"{source}: {got}. Was the file cut off?")
    title = f", {blocks.shown(lines.text[1])}, Q0 = {number[at]:g}"
    return _Table(tan, beta, cells.reshape(len(beta), len(tan)).T, title)


def _matrix(text: str, source: str) -> _Table:
    """The cells below the line of β, which may be a comment, tan γ in front of them."""
    lines = blocks.lines(text, source, comment=_NOTHING)
    row = next((k for k, line in enumerate(lines.text) if re.search(_AXIS, line)), len(lines.text) - 1)
    mark = _MARK.search(lines.text[row])
    delimiter = (mark[1].strip() if mark else "") or None
    below = np.arange(len(lines.text)) > row
    body = lines.keep(below & ~lines.text.str.starts_with("#").to_numpy())
    numbers = [_cells(body, k, delimiter) for k in range(len(body.text))]
    if not numbers:
        raise ReadError(f"{lines.where(row)}: no rows below the line of β, expected tan γ and values. Was it cut off?")
    filled = np.array([cells + [np.nan] * (len(BETAS) + 1 - len(cells)) for cells in numbers])
    return _Table(filled[:, 0], np.array(BETAS, float), filled[:, 1:], "")


def _cells(body: blocks.Lines, row: int, delimiter: str | None) -> list[float]:
    """tan γ and the values of a row; the last ones may be missing."""
    found = []
    words = [word.strip() for word in body.text[row].split(delimiter)]
    for word in words:
        plain = word if delimiter == "," else word.replace(",", ".")
        try:
            found.append(np.nan if plain in _EMPTY else float(plain))
        except ValueError:
            raise ReadError(f"{body.where(row)}: {blocks.shown(word)}, expected a number. Correct the cell.") from None
    if not 2 <= len(found) <= len(BETAS) + 1:
        got = f"{len(found)} cells, expected tan γ and up to {len(BETAS)} values, one for each β"
        raise ReadError(f"{body.where(row)}: {got}. Correct the line, or put # before it.")
    return found


def _refuse_axes(table: _Table, source: str) -> None:
    for name, axis, most in (("tan γ", table.tan, 100.0), ("β", table.beta, 180.0)):
        if not (np.isfinite(axis).all() and (np.diff(axis) > 0).all() and axis[0] >= 0 and axis[-1] <= most):
            got = f"{name} of {', '.join(f'{a:g}' for a in axis[:4])} …"
            raise ReadError(f"{source}: {got}, expected numbers that increase from 0 to {most:g}. Is it turned?")


def _refuse_scale(q: Float[np.ndarray, "t b"], tan: np.ndarray, source: str) -> None:
    """Stop where light from above, as near the normal as there is, shows another scale."""
    if not np.isfinite(q).any():
        raise ReadError(f"{source}: no values below β, expected r × 10⁴ of a road. Was the file cut off?")
    row = int(np.argmax(np.isfinite(q).any(axis=1)))
    typical = float(np.nanmedian(q[row]))
    if DARKEST <= typical <= WHITE:
        return
    got = f"r/(10⁴ cos³γ) = {typical:.3g} sr⁻¹ at tan γ = {tan[row]:g}, expected {DARKEST:g} to {WHITE:.2g}"
    remedy = "Multiply a table normalised to Q0 = 1 by its Q0" if typical > WHITE else "Multiply the values by 10⁴"
    raise ReadError(f"{source}: {got}. {remedy}.")
