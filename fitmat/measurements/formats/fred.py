"""FRED: tabulated BSDF of Photon Engineering's FRED, directions about the normal.

It reads values, not their logarithms, whose base the format does not state; and it writes nothing.

The layout is that of FRED's help, "Tabulated BSDF": a line `type bsdf_data`, a line
`format angles=[deg/sin] bsdf=[value/log] scale=…`, then for each mirror direction a line with its two angles, followed
by lines of two angles of a scattering direction and its BSDF. `sin` stands for direction cosines. A zenith angle may be
negative; a scattering direction equal to that of the line above the block is the mirror direction.
"""

import os
import re

import numpy as np
from jaxtyping import Float, Int

from fitmat.errors import ReadError
from fitmat.maths.directions import from_angles, mirror
from fitmat.measurements.parsing import blocks, contents
from fitmat.measurements.parsing.recording import Recording
from fitmat.measurements.samples import default_channels

ANGLES = {
    "deg": "FRED zenith and azimuth in degrees",
    "rad": "FRED zenith and azimuth in radians",
    "sin": "FRED direction cosines sin θ cos φ and sin θ sin φ",
}
"""angles= → what two of them are."""

_LIMIT = {"deg": 360.0, "rad": 2 * np.pi, "sin": 1.0}
_ROUNDING = 1e-6
_SECOND = 2


def claims(head: bytes, size: int) -> bool:
    """Whether a line says `type bsdf_data`."""
    return blocks.begins(head, rb"type[ \t]+bsdf_data\b")


def load(path: str | os.PathLike[str]) -> Recording:
    """One row for each scattering direction; the light is at the azimuth of the mirror direction's line.

    Raises:
        ReadError: the head is not FRED's, values are logarithms, or a line is neither two angles nor two and a value.
    """
    source = contents.name(path)
    text, notes = contents.decoded(contents.contents(path), source)
    every = blocks.lines(text, source)
    unit, scale = _format(every)
    body = every.keep(np.arange(len(every.text)) >= _SECOND)
    number, count = body.numbers()
    for row in np.flatnonzero((count != 2) & (count != 3))[:1]:
        expected = "2 (a mirror direction) or 3 (a direction and its BSDF)"
        raise ReadError(f"{body.where(row)}: {count[row]} numbers, expected {expected}. Correct the line.")
    if not (count == 3).any() or count[0] != 2:
        expected = "a mirror direction (two angles) above each block of directions"
        raise ReadError(f"{source}: {len(count)} lines of numbers, expected {expected}. Is the file complete?")
    start = np.cumsum(count) - count
    spec, scat = start[count == 2], start[count == 3]
    block = (np.cumsum(count == 2) - 1)[count == 3]
    specular = _directions(body.keep(count == 2), number[spec], number[spec + 1], unit)
    wo = _directions(body.keep(count == 3), number[scat], number[scat + 1], unit)
    with np.errstate(over="ignore"):
        value = scale * number[scat + 2][:, None]
    return Recording(
        source=source,
        wi=specular[block],
        wo=mirror(wo),
        value=value,
        quantity="brdf",
        channels=default_channels(1),
        notes=(
            *notes,
            f"{ANGLES[unit]}, scale {scale:g}; turned by 180°: the light is at its mirror direction's azimuth.",
        ),
    )


def _format(every: blocks.Lines) -> tuple[str, float]:
    """Unit of the angles and scale of the values, from the second line."""
    line = every.text[1] if len(every.text) > 1 else ""
    words = line.lower().split()
    parts = " ".join(words).replace(" =", "=").replace("= ", "=").split()
    stated = {key: word for key, mark, word in (part.partition("=") for part in parts) if mark}
    if words[:1] != ["format"] or not re.match(r"type\s+bsdf_data$", every.text[0].lower()):
        expected = "expected type bsdf_data and format angles=… bsdf=… scale=… on the first two lines"
        raise ReadError(f"{every.source}: {blocks.shown(line) or 'no second line'}, {expected}. Restore them.")
    unit, kind, scale = (
        stated.get(key, given) for key, given in (("angles", "deg"), ("bsdf", "value"), ("scale", "1"))
    )
    if unit not in ANGLES:
        expected = f"expected {' or '.join(ANGLES)}. Write the file with one of these"
        raise ReadError(f"{every.where(1)}: angles={blocks.shown(unit)}, {expected}.")
    if kind != "value":
        expected = "expected bsdf=value: the format does not state the base of its logarithms. Export the values"
        raise ReadError(f"{every.where(1)}: bsdf={blocks.shown(kind)}, {expected}.")
    if not re.fullmatch(r"\+?(\d+(\.\d*)?|\.\d+)(e[-+]?\d+)?", scale) or not 0 < float(scale) < np.inf:
        raise ReadError(f"{every.where(1)}: scale={blocks.shown(scale)}, expected a positive number. Correct it.")
    return unit, float(scale)


def _directions(
    lines: blocks.Lines, first: Float[np.ndarray, " n"], second: Float[np.ndarray, " n"], unit: str
) -> Float[np.ndarray, "n 3"]:
    """Unit vectors from the two numbers of a direction; NaN where one is missing."""
    limit = _LIMIT[unit] + _ROUNDING
    level = np.hypot(first, second) if unit == "sin" else np.maximum(np.abs(first), np.abs(second))
    for row in _first(level > limit):
        got = f"{first[row]:g} and {second[row]:g}, expected {'direction cosines' if unit == 'sin' else 'angles'}"
        raise ReadError(f"{lines.where(row)}: {got} (angles={unit}) of at most {limit:.4g}. Is the unit another one?")
    if unit == "sin":
        level = np.maximum(level, 1.0)
        return np.stack([first / level, second / level, np.sqrt(np.maximum(1.0 - (first**2 + second**2), 0.0))], axis=1)
    scale = np.pi / 180 if unit == "deg" else 1.0
    return blocks.placed(from_angles(scale * first, scale * second))


def _first(bad: np.ndarray) -> Int[np.ndarray, " one"]:
    return np.flatnonzero(bad)[:1]
