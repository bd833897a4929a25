"""Phrases: numbers, angles and lists as they stand in a sentence.

It knows no finding.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from fitmat.text import visible

LISTED = 12
"""No list of names is longer than this."""


class Said(NamedTuple):
    """What there is to say of one subject: warnings first, then description."""

    warnings: list[str]
    lines: list[str]


def count(number: int, thing: str) -> str:
    """`1 row`, `2 rows`."""
    return f"{number} {thing}" + ("" if number == 1 else "s")


def channels(names: Sequence[str]) -> str:
    """`channel r`, `channels r, g`."""
    listed = ", ".join(map(visible, names[:LISTED])) + (" …" if len(names) > LISTED else "")
    return ("channel " if len(names) == 1 else "channels ") + listed


def degrees(angle: float) -> str:
    """Radians as degrees, to a hundredth below a degree and a tenth above."""
    degrees = float(np.rad2deg(angle))
    return f"{round(degrees, 2 if abs(degrees) < 1 else 1) + 0.0:g}°"


def percent(share: float) -> str:
    """A fraction as a percentage of two digits."""
    return f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"


def percent_range(shares: Sequence[float]) -> str:
    """Several fractions as one range of percentages."""
    low, high = percent(min(shares)), percent(max(shares))
    return high if low == high else f"{low.removesuffix(' %')}–{high}"


def two_digits(value: float) -> str:
    """A number of two digits."""
    return f"{value:.2g}"


def span(numbers: Sequence[float], write: Callable[[Any], str]) -> str:
    """One number, or the smallest and the largest, if they are not written alike."""
    low, high = write(min(numbers)), write(max(numbers))
    return low if low == high else f"{low} to {high}"


def one_of(names: Sequence[str]) -> str:
    """`a, b or c`."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"
