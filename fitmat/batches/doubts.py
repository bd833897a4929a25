"""Doubts: what of pictures and of their lights is taken as it is, but may not be meant, in sentences.

It changes no value and refuses nothing.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from fitmat.text import visible

GRAZING = 80.0
"""Degrees beyond which 1/cosθ_i makes much of small errors."""

ERROR = 0.5
"""Degrees of a light or of the sample's normal, of which a sentence says what they do."""

NEGATIVE = 0.01
"""Share of values below 0 that noise around black may have without a word."""

ALIKE, FEW = 0.001, 16
"""Share of a picture's pixels, and their number, that may be its largest value by chance."""


class Pictures(NamedTuple):
    """What is looked at.

    Attributes:
        table: Where it is from.
        names: Of the n pictures.
        layers: Radiances of each, (c, rows, columns).
        full: Radiances at and above which they are masked, (n,).
        theta_i: Where the lights are, degrees, (n,).
    """

    table: Path
    names: Sequence[str]
    layers: Sequence[np.ndarray]
    full: Float[np.ndarray, " n"]
    theta_i: Float[np.ndarray, " n"]


def doubts(seen: Pictures) -> Iterator[str]:
    """A sentence for each thing that looks wrong."""
    yield from _grazing(seen)
    yield from _negative(seen)
    yield from _alike(seen)


def _grazing(seen: Pictures) -> Iterator[str]:
    """Of a value that is divided by cosθ_i an error dθ is tanθ_i dθ."""
    count, most = np.count_nonzero(seen.theta_i > GRAZING), int(np.argmax(seen.theta_i))
    if count:
        theta = seen.theta_i[most]
        share = 100.0 * np.tan(np.deg2rad(theta)) * np.deg2rad(ERROR)
        got = f"{seen.table}: {count} of {len(seen.names)} lights beyond {GRAZING:g}°"
        worst = f"at {theta:g}° ({visible(seen.names[most])}) an error of {ERROR:g}° in it, or in the sample's flatness"
        yield f"{got}: values are divided by cos θ_i, and {worst}, is one of {share:.2g} %. Leave them out if in doubt."


def _negative(seen: Pictures) -> Iterator[str]:
    below = [np.count_nonzero(np.isfinite(layers) & (layers < 0)) for layers in seen.layers]
    share = sum(below) / sum(layers.size for layers in seen.layers)
    if share > NEGATIVE:
        most = visible(seen.names[int(np.argmax(below))])
        got = f"{seen.table}: {100 * share:.2g} % of the radiances are below 0, most of them in {most}"
        yield f"{got}: they stay, as noise around black has such. If it is not that, correct the pictures' black."


def _alike(seen: Pictures) -> Iterator[str]:
    found = {
        name: worst
        for name, layers, full in zip(seen.names, seen.layers, seen.full.tolist(), strict=True)
        if (worst := max(map(_largest, layers, [full] * len(layers))))[0] > 0.0
    }
    if found:
        (name, (share, value)), *others = found.items()
        got = f"{seen.table}: {visible(name)}{f' and {len(others)} more look' if others else ' looks'} saturated"
        why = f"{100 * share:.3g} % of its pixels have the largest value, {value:.6g}"
        yield f"{got}: {why}. Say in a column saturation from which radiance on the camera is full: that is masked."


def _largest(layer: np.ndarray, full: float) -> tuple[float, float]:
    """The share of pixels that have the largest value, and that value; 0 where chance may do so."""
    with np.errstate(over="ignore"):  # a number of the table may exceed those of the picture's kind
        used = layer[np.isfinite(layer) & (layer < full)]
    if not used.size:
        return 0.0, 0.0
    most = used.max()
    count = np.count_nonzero(used == most)
    return (count / layer.size if count > max(FEW, ALIKE * layer.size) else 0.0), float(most)
