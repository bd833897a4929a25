"""Zemax: BSDF files of OpticStudio, angles measured from the mirror direction; read and written.

It reads reflection only, and it duplicates no half of a symmetrical measurement.

The layout is that of R. Rykowski, "BSDF Data Interchange File Format Specification" (Zemax knowledge base, 2008; today
"Zemax Tabular BSDF data file format"): for each sample rotation and angle of incidence a block headed TIS, with one
line for each azimuth and one number for each radial angle. Radial angles count from the mirror direction, azimuth 0
points from there towards the normal and increases counter-clockwise. The format has no mark for a cell without datum;
its writers put 0 there, below the horizon and where the instrument does not reach.
"""

import os
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import polars as pl
from jaxtyping import Float, Int

from fitmat.errors import OutputError, ReadError
from fitmat.maths.directions import from_angles, zenith
from fitmat.measurements.parsing import blocks, contents
from fitmat.measurements.parsing.recording import HORIZON, Recording
from fitmat.measurements.samples import Measurements, StatedAlbedo, default_channels

CHANNELS = {"monochrome": default_channels(1), "xyz": ("x", "y", "z"), "rgb": ("r", "g", "b")}
"""SpectralContent → channels; RGB is not in the specification, but written by instruments."""

AXES = ("SampleRotation", "AngleOfIncidence", "ScatterAzimuth", "ScatterRadial")
"""The angles of the grid, slowest first."""

SPARSEST = 0.25
"""Cells of the grid that must hold a sample for `dump` to write it."""

_RANGE = {"SampleRotation": (-360, 360), "AngleOfIncidence": (0, 90), "ScatterAzimuth": (-360, 360)}
_INDICATORS = ("monochrome", *(f"tristimulus{name}" for name in "xyzrgb"))
_HEAD = ("source", "symmetry", "spectralcontent", "scattertype", *(axis.lower() for axis in AXES))
_KEYS = (*_HEAD, *_INDICATORS, "databegin", "tis", "dataend")
_DIGITS = 7


def claims(head: bytes, size: int) -> bool:
    """Whether the two lists of angles that only this format has begin lines of the file."""
    return blocks.begins(head, rb"AngleOfIncidence\b", rb"ScatterRadial\b")


def load(path: str | os.PathLike[str]) -> Recording:
    """One row for each cell, sample rotation slowest, radial angle fastest; the light at the azimuth of the rotation.

    Raises:
        ReadError: the file is incomplete, describes transmission, or holds what the format does not know.
    """
    source = contents.name(path)
    text, notes = contents.decoded(contents.contents(path), source)
    found = blocks.sections(text, source, _KEYS)
    found.refuse_numbers_outside("tis", *(axis.lower() for axis in AXES))
    found.word("Symmetry", ("planesymmetrical", "asymmetrical", "asymmetrical4d"))
    channels = CHANNELS[found.word("SpectralContent", tuple(CHANNELS))]
    if found.word("ScatterType", ("brdf", "btdf")) == "btdf":
        got = "ScatterType BTDF, expected BRDF, since fitmat fits reflection"
        raise ReadError(f"{source}: {got}. Choose a file of the reflected light.")
    angles = [np.deg2rad(found.listed(axis, *_RANGE.get(axis, (0, 180)))) for axis in AXES]
    value = _values(found, [len(angle) for angle in angles], channels)
    rotation, theta_i, azimuth, radial = np.meshgrid(*angles, indexing="ij", sparse=True)
    wo = blocks.around(theta_i, rotation, radial, azimuth)
    wi = np.broadcast_to(from_angles(*np.broadcast_arrays(theta_i, rotation)), wo.shape)
    below = (wo[..., 2:] <= HORIZON) & (value == 0)
    doubts = {
        "0 below the horizon, which the format writes for no datum": below,
        "0 above the horizon, which the format writes for no datum": (value == 0) & ~below,
        "the same value of a direction once more, for another azimuth": blocks.repeated(value, angles[3], angles[2]),
    }
    return Recording(
        source=source,
        wi=wi.reshape(-1, 3),
        wo=wo.reshape(-1, 3),
        value=value.reshape(-1, len(channels)),
        quantity="brdf",
        channels=channels,
        doubts={reason: doubt.reshape(-1, len(channels)) for reason, doubt in doubts.items()},
        notes=(*notes, *_conventions(len(angles[0]))),
        stated=tuple(_stated(found, angles[0], angles[1], channels)),
    )


def dump(measurements: Measurements) -> str:
    """The text of a file with the grid of the data's own distinct angles; cells without a valid sample hold 0.

    Angles are written to 10⁻⁷ degrees, values exactly. TIS, which the format asks for, is a sum by trapezoids over the
    cells that are given. σ has no place in the format.

    Raises:
        OutputError: the samples form no such grid, a valid one is 0, or there are other channels than one or x, y, z.
    """
    content = {1: "Monochrome"}.get(len(measurements.channels))
    if measurements.channels == CHANNELS["xyz"]:
        content = "XYZ"
    if content is None:
        got = f"channels {', '.join(measurements.channels)}, expected one, or x, y, z"
        raise OutputError(f"A Zemax file cannot hold {got}. Write .csv, .parquet or ALTA.")
    grid = _gridded(measurements)
    full = bool((grid.axes[2] > 180).any())
    symmetry = "ASymmetrical4D" if len(grid.axes[0]) > 1 else "ASymmetrical" if full else "PlaneSymmetrical"
    source = " ".join(measurements.source.split())
    head = [f"# {source}, written by fitmat; 0 marks no datum", "Source\tMeasured", f"Symmetry\t{symmetry}"]
    head += [f"SpectralContent\t{content}", "ScatterType\tBRDF"]
    for axis, angles in zip(AXES, grid.axes, strict=True):
        head += [f"{axis}\t{len(angles)}", "\t".join(f"{angle:.10g}" for angle in angles)]
    labels = ("Monochrome",) if content == "Monochrome" else ("TristimulusX", "TristimulusY", "TristimulusZ")
    return "\n".join(head) + "\n" + "".join(_data(label, grid, k) for k, label in enumerate(labels))


def losses(measurements: Measurements) -> tuple[str, ...]:
    """What `dump` does not keep, in sentences with counts; empty where all comes back."""
    return tuple(_losses(measurements))


def _losses(measurements: Measurements) -> Iterator[str]:
    if masked := np.count_nonzero(~measurements.valid.all(axis=1)):
        yield f"{masked} samples masked in some channel: there the file holds 0, its mark for no datum."
    if measurements.sigma is not None:
        yield "sigma not written: a Zemax file has no place for it."
    if len(measurements.channels) == 1 and measurements.channels != default_channels(1):
        yield f"The channel's name, {measurements.channels[0]}, not written: a Zemax file has no place for it."


class _Grid(NamedTuple):
    """Distinct angles of each of `AXES` in degrees, and the values in the cells between them, 0 where there is none."""

    axes: list[Float[np.ndarray, " j"]]
    value: Float[np.ndarray, "s i a r c"]


def _values(found: blocks.Sections, shape: list[int], channels: tuple[str, ...]) -> Float[np.ndarray, "s i a r c"]:
    """The cells of all blocks, which stand in the order of the grid for one channel after the other."""
    rows = found.at("tis")
    each, size = shape[0] * shape[1], shape[2] * shape[3]
    labels = found.at(*(f"tristimulus{name}" for name in channels)) if len(channels) > 1 else np.zeros(1, int)
    channel = np.searchsorted(labels, rows, side="right") - 1
    if len(labels) != len(channels) or not np.array_equal(channel, np.repeat(np.arange(len(labels)), each)):
        got = f"{len(rows)} blocks (TIS) below {len(labels)} channels"
        expected = f"{each} of each of {len(channels)}: {shape[0]} rotations × {shape[1]} incidences"
        raise ReadError(f"{found.heads.source}: {got}, expected {expected}. Was the file cut off?")
    given = [str(found.key[int(row)])[-1:] for row in labels]
    if len(channels) > 1 and given != list(channels):
        got = f"channels in the order {', '.join(given)}"
        raise ReadError(f"{found.heads.source}: {got}, expected {', '.join(channels)}. Sort its blocks.")
    number = found.blocks(rows, size, f"{shape[2]} azimuths × {shape[3]} radial angles")
    return np.moveaxis(number.reshape(len(channels), *shape), 0, -1)


def _stated(
    found: blocks.Sections, rotation: np.ndarray, theta_i: np.ndarray, channels: tuple[str, ...]
) -> Iterator[StatedAlbedo]:
    """The TIS of each block, in the order of `_values`."""
    total = found.totals(found.at("tis")).reshape(len(channels), len(rotation), len(theta_i))
    for channel, turned, lit in zip(*np.nonzero(np.isfinite(total)), strict=True):
        value = float(total[channel, turned, lit])
        yield StatedAlbedo(float(theta_i[lit]), float(rotation[turned]), channels[channel], value)


def _conventions(rotations: int) -> Iterator[str]:
    yield "Zemax angles about the mirror direction turned into directions; azimuth 0 points from it towards the normal."
    if rotations > 1:
        yield "SampleRotation read as the azimuth of the light; Zemax counts it from the normal of the incident plane."


def _angles(measurements: Measurements, used: Int[np.ndarray, " n"]) -> Float[np.ndarray, "n 4"]:
    """Rotation, incidence, azimuth and radial angle of samples in degrees, rounded; 0 where a pole leaves one open."""
    wi, wo = measurements.wi[used], measurements.wo[used]
    theta_i = zenith(wi)
    upright = np.sin(theta_i) < 10.0**-_DIGITS
    phi_i = np.arctan2(wi[:, 1], wi[:, 0])
    phi_i = np.where(upright, phi_i[~upright][0] if not upright.all() else 0.0, phi_i)
    quarter = np.pi / 2
    mirror, upward, across = (
        blocks.around(theta_i, phi_i, np.array(polar), np.array(azimuth))
        for polar, azimuth in ((0.0, 0.0), (quarter, 0.0), (quarter, quarter))
    )
    along, x, y = (np.einsum("ij,ij->i", wo, axis) for axis in (mirror, upward, across))
    radial = np.arctan2(np.hypot(x, y), along)
    azimuth = np.where(np.hypot(x, y) < 10.0**-_DIGITS, 0.0, np.arctan2(y, x))
    found = np.rad2deg([phi_i % (2 * np.pi), theta_i, azimuth % (2 * np.pi), radial]).T
    found = np.round(found, _DIGITS)
    found[:, [0, 2]] %= 360
    return found


def _gridded(measurements: Measurements) -> _Grid:
    used = np.flatnonzero(measurements.valid.any(axis=1))
    if not len(used):
        raise OutputError(f"{measurements.source}: no valid sample, expected at least one. Check what is masked.")
    angles = _angles(measurements, used)
    pairs = [np.unique(column, return_inverse=True) for column in angles.T]
    axes, cell = [axis for axis, _ in pairs], tuple(place for _, place in pairs)
    shape, polar = [len(axis) for axis in axes], angles[:, 3] == 0
    cells = int(np.prod([float(count) for count in shape]))
    if len(used) < SPARSEST * (cells - polar.sum() * (shape[2] - 1)):
        got = f"{len(used)} samples at {' × '.join(map(str, shape))} distinct angles ({', '.join(AXES)})"
        expected = f"expected at least one in {1 / SPARSEST:g} cells of that grid"
        raise OutputError(f"No Zemax file can hold {got}, {expected}. Write .csv, .parquet or ALTA instead.")
    flat = np.ravel_multi_index(cell, shape)
    if len(np.unique(flat)) < len(flat):
        got = f"{len(flat) - len(np.unique(flat))} samples repeat the angles of another one"
        raise OutputError(f"{got}, expected one for each cell of a Zemax file. Average them, or write .csv or ALTA.")
    valid, value = measurements.valid[used], measurements.value[used]
    if zeros := np.count_nonzero(valid & (value == 0)):
        got = f"{zeros} valid values are 0, which a Zemax file uses for no datum"
        raise OutputError(f"{got}, expected none. Mask them, or write .csv, .parquet or ALTA.")
    filled = np.zeros((*shape, value.shape[1]))
    filled[cell] = np.where(valid, value, 0.0)
    rotation, incidence, _, radial = (place[polar] for place in cell)
    filled[rotation, incidence, :, radial] = np.where(valid, value, 0.0)[polar, None]
    return _Grid(axes, filled)


def _data(label: str, grid: _Grid, channel: int) -> str:
    """The blocks of one channel."""
    value = grid.value[..., channel]
    total = _tis(grid.axes, value)
    text = [f"{label}\nDataBegin\n"]
    for place in np.ndindex(*total.shape):
        numbers = pl.DataFrame(value[place]).write_csv(separator="\t", include_header=False)
        text.append(f"TIS\t{total[place]:.6g}\n{numbers}")
    return "".join(text) + "DataEnd\n"


def _tis(axes: list[np.ndarray], value: Float[np.ndarray, "s i a r"]) -> Float[np.ndarray, "s i"]:
    r"""Total integrated scatter of each block, ∫ f_r cos θ_o dω by trapezoids over the cells above the horizon."""
    rotation, theta_i, azimuth, radial = np.meshgrid(*(np.deg2rad(a) for a in axes), indexing="ij", sparse=True)
    cos = np.maximum(blocks.around(theta_i, rotation, radial, azimuth)[..., 2], 0.0)
    inner = np.trapezoid(value * cos * np.sin(radial), radial.ravel(), axis=-1)
    gaps = np.diff(azimuth.ravel())
    weight = np.append(gaps, 0.0) + np.append(0.0, gaps) if len(gaps) else np.ones(1)
    return 2 * np.pi * (inner * weight).sum(axis=-1) / weight.sum()
