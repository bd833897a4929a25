"""How results print themselves: numbers to the precision of their error, small tables as text and HTML.

Knows no result.
"""

import math
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

LARGE = 1e6
"""Numbers from here on are written with a power of ten."""


def with_error(value: float, sd: float) -> str:
    """A value to the precision of its standard deviation: `0.1503 ± 0.0010`; four digits where there is none."""
    if not math.isfinite(value):
        return "–"
    digits = _digits(sd)
    if digits is None or not abs(value) / LARGE**2 < sd <= abs(value) * LARGE:
        return f"{value:.4g}"
    return f"{value:.{digits}f} ± {sd:.{digits}f}" if max(abs(value), sd) < LARGE else f"{value:.3g} ± {sd:.2g}"


def interval(low: float, high: float, sd: float) -> str:
    """Two limits to the precision of the standard deviation; three digits where there is none."""
    digits = _digits(sd)
    if digits is None or max(abs(low), abs(high)) >= LARGE or high - low < sd / LARGE:
        return f"{low:.3g} – {high:.3g}"
    return " – ".join(f"{limit:.{digits}f}" if limit else "0" for limit in (low, high))


def _digits(sd: float) -> int | None:
    """Decimals that show two digits of the standard deviation; None where there is none."""
    return max(0, 1 - math.floor(math.log10(sd))) if math.isfinite(sd) and sd > 0 else None


def html_table(caption: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table for a notebook; every text is escaped."""
    head = "".join(f"<th>{escape(text)}</th>" for text in headings)
    body = "".join("<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>" for row in rows)
    return f"<p>{escape(caption)}</p><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def text_table(caption: str, rows: Sequence[Sequence[str]]) -> str:
    """The same without headings, columns aligned, for a terminal."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return "\n".join([caption, *lines])


def plain(thing: Any) -> Any:
    """JSON types only: arrays to lists, NaN and infinity to None."""
    if isinstance(thing, dict):
        return {key: plain(value) for key, value in thing.items()}
    if isinstance(thing, list | tuple):
        return [plain(value) for value in thing]
    if isinstance(thing, np.ndarray | np.generic):
        return plain(thing.tolist())
    return None if isinstance(thing, float) and not math.isfinite(thing) else thing
