"""pab-opto: text files of the pg2 goniophotometer's Mountain, one incidence each, as Radiance reads them.

It reads what the lit side reflects; what goes through is masked and counted. It writes nothing.

The layout is that of Radiance's manual, pabopto2bsdf(1) (G. Ward): lines that begin with # and hold `format: theta phi`
and BSDF, BRDF, BTDF or DSF (which includes the cosine of the scattered angle), `intheta` and `inphi` or
`incident_angle` with both, perhaps `upphi` and `colorimetry: CIE-XYZ`; below them two angles and one value a line, or
three. Angles are degrees about the normal of the front, one system for light and sensor, up to θ = 180 behind the
sample; φ counts counter-clockwise as seen from the front, so that the mirror side of φ is φ + 180.
"""

import os
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
import polars as pl

from fitmat.errors import ReadError
from fitmat.maths.directions import from_angles
from fitmat.measurements.parsing import blocks, contents
from fitmat.measurements.parsing.recording import HORIZON, Recording
from fitmat.measurements.samples import default_channels

QUANTITIES = {"bsdf": "brdf", "brdf": "brdf", "dsf": "brdf_cos"}
"""Word of the format → what the values are."""

CHANNELS = {"cie-y": default_channels(1), "cie-xyz": ("x", "y", "z")}
"""Colorimetry → channels."""

_FORMAT = rb"#[ \t]*format:?[ \t]+theta[ \t]+phi[ \t]+(BSDF|BRDF|BTDF|DSF)\b"
_LINE = r"^#\s*([A-Za-z_]+)\s*:?\s*(.*)$"
_TURN, _BACK = 360.0, 180.0


class _Head(NamedTuple):
    """What the lines above the numbers say."""

    theta: float
    phi: float
    up: float
    quantity: str
    channels: tuple[str, ...]


def claims(head: bytes, size: int) -> bool:
    """Whether comments state the format, and the incidence."""
    return blocks.begins(head, _FORMAT, rb"#[ \t]*(intheta|incident_angle)\b")


def load(path: str | os.PathLike[str]) -> Recording:
    """One row for each direction, with the file's own azimuths; a sample that was lit from behind is turned over.

    Raises:
        ReadError: the head contradicts itself, a line holds other numbers than it says, or all is transmitted light.
    """
    source = contents.name(path)
    text, notes = contents.decoded(contents.contents(path), source)
    stated = _stated(text)
    head = _head(stated, source)
    body = blocks.lines(text, source)
    number = body.table(2 + len(head.channels), f"theta, phi and {len(head.channels)} of {head.quantity}")
    theta, phi = number[:, 0], number[:, 1]
    for bad in np.flatnonzero(~np.isnan(theta) & ~((theta >= 0) & (theta <= _BACK)) | (np.abs(phi) > _TURN))[:1]:
        got = f"theta {theta[bad]:g}, phi {phi[bad]:g}"
        raise ReadError(f"{body.where(bad)}: {got}, expected degrees, theta of 0 to 180. Is the unit another one?")
    wi, wo = (
        blocks.placed(from_angles(np.deg2rad(polar), np.deg2rad(azimuth - head.up)))
        for polar, azimuth in ((np.full_like(theta, head.theta), np.full_like(theta, head.phi)), (theta, phi))
    )
    if behind := head.theta > _BACK / 2:
        wi, wo = wi * [1.0, -1.0, -1.0], wo * [1.0, -1.0, -1.0]
    through = wo[:, 2] < -HORIZON
    if through.all() and len(through):
        got = "light that goes through the sample only, expected reflected light, which fitmat fits"
        raise ReadError(f"{source}: {got}. Choose the file of the side that is lit.")
    return Recording(
        source=source,
        wi=wi,
        wo=wo,
        value=number[:, 2:],
        quantity=head.quantity,
        channels=head.channels,
        doubts={"transmitted: on the other side than the light": np.tile(through[:, None], len(head.channels))},
        notes=(*notes, *_notes(head, behind, stated, len(theta))),
    )


def _stated(text: str) -> dict[str, tuple[str, int]]:
    """Keyword of each comment → what follows, and the line; the last one counts."""
    lines = pl.Series([text.replace("\r\n", "\n").replace("\r", "\n")]).str.split("\n").explode().str.strip_chars()
    parts = lines.str.extract_groups(_LINE).struct.unnest()
    found = parts.with_row_index("line", offset=1).drop_nulls()
    return {str(key).lower(): (str(rest), int(line)) for line, key, rest in found.rows()}


def _head(stated: Mapping[str, tuple[str, int]], source: str) -> _Head:
    if "format" not in stated:
        raise ReadError(f"{source}: no line #format that can be read, expected theta phi BSDF. Correct the head.")
    words = stated["format"][0].split()
    kind = words[2].lower() if len(words) > 2 else ""
    if kind == "btdf":
        got = "format BTDF, expected BRDF, since fitmat fits reflection"
        raise ReadError(f"{source}: {got}. Choose a file of the reflected light.")
    if kind not in QUANTITIES or len(words) > 3:
        got = f"format {blocks.shown(' '.join(words))}"
        raise ReadError(
            f"{source} row {stated['format'][1]}: {got}, expected theta phi BSDF, or DSF. Correct the line."
        )
    colours = stated.get("colorimetry", ("CIE-Y", 0))
    if colours[0].lower() not in CHANNELS:
        got = f"colorimetry {blocks.shown(colours[0])}, expected CIE-Y or CIE-XYZ"
        raise ReadError(f"{source} row {colours[1]}: {got}. Correct the line.")
    theta, phi = _incidence(stated, source)
    (up,) = _numbers(stated, "upphi", 1, source) if "upphi" in stated else (0.0,)
    return _Head(theta, phi, up, QUANTITIES[kind], CHANNELS[colours[0].lower()])


def _incidence(stated: Mapping[str, tuple[str, int]], source: str) -> tuple[float, float]:
    """Zenith angle and azimuth of the light in degrees, as one line or two say them."""
    said = [*_numbers(stated, "incident_angle", 2, source)] if "incident_angle" in stated else [np.nan, np.nan]
    for place, key in enumerate(("intheta", "inphi")):
        if key not in stated:
            continue
        (number,) = _numbers(stated, key, 1, source)
        if np.isfinite(said[place]) and said[place] != number:
            got = f"{key} {number:g} and incident_angle {said[0]:g} {said[1]:g}, expected them to agree"
            raise ReadError(f"{source} row {stated[key][1]}: {got}. Correct one of the lines.")
        said[place] = number
    theta, phi = said
    if not np.isfinite(theta) or not np.isfinite(phi):
        got = f"no line {'inphi' if np.isfinite(theta) else 'intheta'}"
        raise ReadError(
            f"{source}: {got}, expected intheta and inphi, or incident_angle with both. Add it to the head."
        )
    if not 0 <= theta <= _BACK:
        raise ReadError(f"{source}: intheta {theta:g}, expected 0 to 180 degrees. Correct the head.")
    return theta, phi


def _numbers(stated: Mapping[str, tuple[str, int]], key: str, count: int, source: str) -> tuple[float, ...]:
    """The numbers behind a keyword."""
    rest, line = stated[key]
    words = rest.split()[:count]
    try:
        numbers = tuple(float(word) for word in words)
    except ValueError:
        numbers = ()
    if len(numbers) < count or not np.isfinite(numbers).all():
        got = f"{key} {blocks.shown(rest) or '(nothing)'}"
        raise ReadError(f"{source} row {line}: {got}, expected {count} in degrees. Correct the line.")
    return numbers


def _notes(head: _Head, behind: bool, stated: Mapping[str, tuple[str, int]], rows: int) -> Iterator[str]:
    side = ", from behind: the sample is turned over" if behind else ""
    yield f"pab-opto head: lit at theta {head.theta:g}°, phi {head.phi:g}°{side}; the mirror side is phi + 180°."
    if head.up:
        yield f"Azimuths count from the sample's up, phi {head.up:g}°."
    count = stated.get("datapoints_in_file", (str(rows), 0))[0]
    if count != str(rows):
        yield f"The head says {blocks.shown(count)} data points, the file has {rows} lines of them."
