"""Axes: the palette and the empty figures that all pictures begin with.

Nothing is drawn here.
"""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fitmat import arguments
from fitmat.text import visible

# Okabe & Ito's palette, safe for colour-blind readers.
BLACK, ORANGE, BLUE, GREEN, PURPLE = "#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7"
FIT_COLOURS = (ORANGE, BLUE, GREEN, PURPLE)


MM = 25.4
"""In an inch."""

WIDTH_MM, NARROW_MM = 178.0, 120.0
"""Of a figure over both columns of a page; below the second, panels stand one below the other."""


def plain(text: str) -> str:
    """A text in which Matplotlib finds no formula and no letter without a shape, for names that users choose."""
    return visible(text).replace("$", r"\$")


def check_channel(channel: object, names: Sequence[str]) -> None:
    """Stop where there is no channel of that number.

    Raises:
        FitmatError: says how many there are.
    """
    arguments.whole("channel", channel)
    if channel not in range(len(names)):
        arguments.refuse("channel", channel, f"0 to {len(names) - 1}: {', '.join(names)}")


def new_axes(width: float = 5.0, height: float = 3.6) -> Axes:
    """An empty figure's only axes, without pyplot's global state."""
    return Figure(figsize=(width, height), layout="constrained").add_subplot()


def new_figure(width_mm: float, shape: float) -> Figure:
    """An empty figure so many millimetres wide, its height that times `shape`, and room for a legend.

    Raises:
        FitmatError: the width is not from 40 to 500.
    """
    arguments.numbers("width_mm", width_mm, 40.0, 500.0, single=True)
    width = width_mm / MM
    return Figure(figsize=(width, shape * width + 0.4), layout="constrained")
