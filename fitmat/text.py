"""How results print themselves: numbers to the precision of their error, small tables as text and HTML.

Knows no result.
"""

import dataclasses
import json
import math
import os
import shlex
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

MOST_SHOWN = 1500
"""Characters of what a prompt shows of a result."""

MOST_ROWS = 30
"""Rows of a table in a notebook."""

FEW = 4
"""So many numbers or names are listed; of more, only how many there are is said."""

LARGE = 1e6
"""Numbers from here on are written with a power of ten."""


def visible(text: str, keep: str = "") -> str:
    r"""Text without what a terminal or a page would obey: escape sequences, control characters, marks of direction.

    Args:
        text: What a user, a file or a folder may have named.
        keep: Characters that stay as they are, as the line ends of text that is ours.

    Returns:
        The text, each character that cannot be printed as JSON writes it, so that JSON stays what it is.

    Example:
        >>> print(visible("\x1b[31mred"))
        \u001b[31mred
    """
    odd = () if text.isprintable() else (c for c in set(text) if not c.isprintable() and c not in keep)
    return text.translate({ord(c): "\\u007f" if c == "\x7f" else json.dumps(c)[1:-1] for c in odd})


def visible_in(thing: Any, *, keep: str = "") -> Any:
    """JSON types with `visible` texts, names of their parts included."""
    if isinstance(thing, str):
        return visible(thing, keep=keep)
    if isinstance(thing, Mapping):
        return {visible(str(key)): visible_in(value, keep=keep) for key, value in thing.items()}
    return [visible_in(part, keep=keep) for part in thing] if isinstance(thing, list | tuple) else thing


def channel_labels(name: str, count: int, channels: Sequence[str], *, own: bool) -> list[str]:
    """The name of each of `count` values on one line, with its channel where there are several and each has its own."""
    if not own or len(channels) < 2:
        return [name] * count
    return [f"{name} {visible(channel)}" for channel in channels]


def for_shell(path: str | os.PathLike[str]) -> str:
    """A path as a command line takes it, quoted where it must be."""
    return visible(shlex.quote(os.fspath(path)))


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
    left = len(rows) - MOST_ROWS
    caption += f" The first {MOST_ROWS} of {len(rows)} rows; print it for all." if left > 0 else ""
    rows = rows[:MOST_ROWS]
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
    import numpy as np  # the command line's start does without it

    if isinstance(thing, dict):
        return {key: plain(value) for key, value in thing.items()}
    if isinstance(thing, list | tuple):
        return [plain(value) for value in thing]
    if isinstance(thing, np.ndarray | np.generic):
        return plain(thing.tolist())
    return None if isinstance(thing, float) and not math.isfinite(thing) else thing


def brief(self: Any) -> str:
    """What a prompt shows of a result: its own words where it has some, else its fields; arrays by their shape.

    Example:
        >>> import numpy as np
        >>> @dataclasses.dataclass(frozen=True, eq=False)
        ... class Curve:
        ...     name: str
        ...     values: np.ndarray
        ...     __repr__ = brief
        >>> Curve("kd", np.zeros((5, 3)))
        Curve(name='kd', values=array (5, 3))
    """
    called = type(self).__name__
    if type(self).__str__ is not object.__str__:
        whole = f"{called}: {self}"
    else:
        parts = (f"{f.name}={_shown(getattr(self, f.name))}" for f in dataclasses.fields(self))
        whole = f"{called}({', '.join(parts)})"
    return whole if len(whole) <= MOST_SHOWN else f"{whole[:MOST_SHOWN].rstrip()} … (print it for all)"


def _shown(part: Any) -> str:
    """One field, in a few words."""
    import numpy as np

    if isinstance(part, float | np.floating):
        return f"{part:.4g}"
    if part is None or isinstance(part, bool | int | np.generic):
        return str(part)
    if isinstance(part, str):
        return repr(part if len(part) <= 60 else part[:59] + "…")
    if hasattr(part, "shape"):
        few = np.ndim(part) == 1 and np.size(part) <= FEW
        return f"[{', '.join(map(_shown, np.asarray(part)))}]" if few else f"array {tuple(np.shape(part))}"
    if isinstance(part, Mapping):
        return f"{{{_listed([str(key) for key in part])}}}"
    if isinstance(part, tuple | list):
        return f"({_listed([_shown(one) for one in part])})"
    if dataclasses.is_dataclass(part) and all(
        isinstance(getattr(part, f.name), float | int | str | tuple | None) for f in dataclasses.fields(part)
    ):
        return f"{type(part).__name__}({', '.join(_shown(getattr(part, f.name)) for f in dataclasses.fields(part))})"
    name = getattr(part, "name", None)
    return f"{type(part).__name__}({name})" if isinstance(name, str) else type(part).__name__


def _listed(texts: Sequence[str]) -> str:
    return ", ".join(texts if len(texts) <= FEW else [*texts[: FEW - 1], f"… {len(texts)} in all"])
