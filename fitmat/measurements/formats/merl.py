"""MERL: a dense isotropic RGB BRDF in one `.binary` file, read and written.

It interpolates nothing and clamps nothing: a cell is one row, and an empty cell is an invalid one.

The layout is that of Matusik's `BRDFRead.cpp` (W. Matusik, H. Pfister, M. Brand, L. McMillan, "A Data-Driven
Reflectance Model", SIGGRAPH 2003; coordinates of S. Rusinkiewicz, "A New Change of Variables for Efficient BRDF
Representation", 1998): three little-endian int32, (90, 90, 180), then a plane of float64 each for R, G and B, in which
the cell of half-angle row h, difference row d and column p stands at p + 180 (d + 90 h); numbers × (1, 1.15, 1.66)/1500
are f_r in sr⁻¹, negative ones are invalid. The lookup rounds down, so a cell covers h ≤ 90 √(θ_h/90°) < h + 1,
d ≤ θ_d/1° < d + 1 and p ≤ φ_d/1° < p + 1; its row stands for the centre, θ_h = 90° ((h + ½)/90)², θ_d = d + ½,
φ_d = p + ½ degrees.
"""

import os
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from fitmat.errors import OutputError, ReadError
from fitmat.measurements.parsing import contents
from fitmat.measurements.parsing.recording import Recording
from fitmat.measurements.samples import Measurements, default_channels
from fitmat.text import visible

SHAPE = (90, 90, 180)
"""Cells in θ_h, θ_d and φ_d of the database's files, and of those that are written."""

SCALE = np.array([1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0])
"""sr⁻¹ for each unit of the R, G and B planes."""

LOWEST = 1e-6
"""Cosine of the horizon."""

INVALID = -1.0
"""What a plane holds where there is no datum."""

CHANNELS = ("r", "g", "b")

_HEADER = 12
_NUMBER = 8
_CENTRED = 1e-6


def claims(head: bytes, size: int) -> bool:
    """Whether the file is as long as the three counts at its beginning say, or these are the database's own."""
    shape = _dimensions(head)
    if size <= _HEADER or min(shape) < 1:
        return False
    return _size(shape) == size or shape[:2] == SHAPE[:2]


def load(path: str | os.PathLike[str]) -> Recording:
    """One row for each cell, at its centre, θ_h slowest and φ_d fastest; light at azimuth 0.

    Files of other dimensions are read alike; φ_d covers half a turn, or a whole one where its cells are four times
    those of θ_d, as non-reciprocal models are stored (90 × 90 × 360).

    Raises:
        ReadError: the file cannot be opened, or is not as long as its header says.
    """
    source, raw = contents.name(path), contents.contents(path)
    shape = _dimensions(raw)
    if min(shape) < 1 or len(raw) != _size(shape):
        found = f"a MERL header of {shape[0]} × {shape[1]} × {shape[2]} cells and {len(raw)} bytes"
        expected = f"expected {_size(shape)} bytes" if min(shape) > 0 else "expected three positive counts"
        raise ReadError(f"{source}: {found}, {expected}. Was its download cut off?")
    planes = np.frombuffer(raw, "<f8", offset=_HEADER).reshape(len(CHANNELS), -1)
    with np.errstate(invalid="ignore"):  # NaNs may be of the signalling kind
        value = planes * SCALE[:, None]
    turn = 2 if shape[2] == 4 * shape[1] else 1
    wi, wo = centres(shape, turn * np.pi)
    return Recording(
        source=source,
        wi=wi,
        wo=wo,
        value=value.T,
        quantity="brdf",
        channels=CHANNELS,
        doubts={"negative, which MERL uses for invalid": (value < 0).T},
        notes=_conventions(shape, turn),
        distinct=turn == 1,
    )


def dump(measurements: Measurements) -> bytes:
    """A file of 90 × 90 × 180 cells: each holds the mean of the valid samples that fall into it, or is invalid.

    Measurements read from such a file come back bit for bit; a value that lies between two scaled numbers is off by its
    last bit. One channel is written to all three planes. f_r is taken to be isotropic and reciprocal, as the format is;
    σ has no place in it. See `losses`.

    Raises:
        OutputError: neither 1 nor 3 channels.
    """
    grid = _gridded(measurements)
    filled = (grid.samples > 0) & (grid.mean >= 0)
    planes = np.where(filled, grid.mean / SCALE, INVALID)
    return np.array(SHAPE, "<i4").tobytes() + np.ascontiguousarray(planes.T, "<f8").tobytes()


def gaps(measurements: Measurements) -> tuple[Float[np.ndarray, "m 3"], Float[np.ndarray, "m 3"]]:
    """Directions of the cells above the horizon into which no valid sample falls.

    Raises:
        OutputError: neither 1 nor 3 channels, or there is no such cell.
    """
    empty = ~(_gridded(measurements).samples > 0).any(axis=1)
    wi, wo = centres()
    asked = empty & (wi[:, 2] > LOWEST) & (wo[:, 2] > LOWEST)
    if not asked.any():
        raise OutputError(f"{measurements.source}: nothing to complete: every MERL cell is filled. Leave it out.")
    return wi[asked], wo[asked]


def losses(measurements: Measurements) -> tuple[str, ...]:
    """What `dump` does not keep, in sentences with counts; empty where all comes back.

    Raises:
        OutputError: neither 1 nor 3 channels.
    """
    return tuple(_losses(measurements, _gridded(measurements)))


class _Grid(NamedTuple):
    """Samples in cells: their number and mean value in each, (cells, 3), and how many lie off a cell's centre."""

    samples: Int[np.ndarray, "m 3"]
    mean: Float[np.ndarray, "m 3"]
    moved: int


def _dimensions(raw: bytes) -> tuple[int, int, int]:
    h, d, p = (int.from_bytes(raw[at : at + 4], "little", signed=True) for at in (0, 4, 8))
    return h, d, p


def _size(shape: tuple[int, int, int]) -> int:
    """Bytes of a file of that many cells."""
    return _HEADER + len(CHANNELS) * _NUMBER * shape[0] * shape[1] * shape[2]


def _conventions(shape: tuple[int, int, int], turn: int) -> tuple[str, ...]:
    centres = "MERL cells read at their centres in θ_h, θ_d and φ_d, light at azimuth 0."
    if shape == SHAPE:
        return (centres,)
    span = "a whole turn" if turn == 2 else "half a turn"
    return (centres, f"MERL grid of {shape[0]} × {shape[1]} × {shape[2]} cells: φ_d taken to cover {span}.")


def centres(
    shape: tuple[int, int, int] = SHAPE, span: float = np.pi
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
    r"""Directions of all cells in the order of the file, light turned to azimuth 0.

    Sines are taken along the axes of the grid only.

    With h = (sin θ_h, 0, cos θ_h) and d = (sin θ_d cos φ_d, sin θ_d sin φ_d, cos θ_d), Rusinkiewicz's definition gives

    .. math:: \omega_i = (c_h d_x + s_h d_z,\ d_y,\ c_h d_z - s_h d_x), \quad
        \omega_o = (s_h d_z - c_h d_x,\ -d_y,\ c_h d_z + s_h d_x)

    Both are then turned by minus the azimuth of ω_i.
    """
    centre = [(np.arange(count) + 0.5) / count for count in shape]
    theta_h, theta_d, phi_d = centre[0] ** 2 * np.pi / 2, centre[1] * np.pi / 2, centre[2] * span
    sin_h, cos_h = np.sin(theta_h)[:, None, None], np.cos(theta_h)[:, None, None]
    dx = np.sin(theta_d)[:, None] * np.cos(phi_d)
    dy = np.sin(theta_d)[:, None] * np.sin(phi_d)
    dz = np.cos(theta_d)[:, None]
    level = np.sqrt((cos_h * dx + sin_h * dz) ** 2 + dy**2)
    forward = (sin_h * dz) ** 2 - (cos_h * dx) ** 2 - dy**2
    wi = np.stack([level, np.zeros_like(level), cos_h * dz - sin_h * dx])
    wo = np.stack([forward / level, -2.0 * sin_h * dz * dy / level, cos_h * dz + sin_h * dx])
    return wi.reshape(3, -1).T, wo.reshape(3, -1).T


def cells(
    wi: Float[np.ndarray, "n 3"], wo: Float[np.ndarray, "n 3"]
) -> tuple[Int[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """The cell of each pair of directions of a file of `SHAPE`, and whether it lies off the centre of it."""
    half, aside = wi + wo, wi - wo
    level = np.hypot(half[:, 0], half[:, 1])
    theta_h = np.arctan2(level, half[:, 2])
    theta_d = np.arctan2(np.linalg.norm(aside, axis=1), np.linalg.norm(half, axis=1))
    upright = level == 0
    level = np.where(upright, 1.0, level)
    cos_phi, sin_phi = np.where(upright, 1.0, half[:, 0] / level), np.where(upright, 0.0, half[:, 1] / level)
    dx = np.cos(theta_h) * (cos_phi * wi[:, 0] + sin_phi * wi[:, 1]) - np.sin(theta_h) * wi[:, 2]
    dy = cos_phi * wi[:, 1] - sin_phi * wi[:, 0]
    phi_d = np.arctan2(dy, dx) % np.pi
    position = np.sqrt(theta_h / (np.pi / 2)), theta_d / (np.pi / 2), phi_d / np.pi
    places = [part * count for part, count in zip(position, SHAPE, strict=True)]
    rows = tuple(np.clip(place.astype(int), 0, count - 1) for place, count in zip(places, SHAPE, strict=True))
    off = np.any([np.abs(place - row - 0.5) > _CENTRED for place, row in zip(places, rows, strict=True)], axis=0)
    return np.ravel_multi_index(rows, SHAPE), off


def _gridded(measurements: Measurements) -> _Grid:
    channels = len(measurements.channels)
    if channels not in (1, len(CHANNELS)):
        remedy = "Write .csv or .parquet, or select the channels first."
        raise OutputError(f"MERL files hold r, g and b, got {channels} channels, expected 1 or 3. {remedy}")
    used = np.flatnonzero(measurements.valid.any(axis=1))
    cell, off = cells(measurements.wi[used], measurements.wo[used])
    size = SHAPE[0] * SHAPE[1] * SHAPE[2]
    count, total = np.zeros((size, channels), int), np.zeros((size, channels))
    for k in range(channels):
        valid = measurements.valid[used, k]
        count[:, k] = np.bincount(cell[valid], minlength=size)
        total[:, k] = np.bincount(cell[valid], weights=measurements.value[used, k][valid], minlength=size)
    mean = total / np.maximum(count, 1)
    shape = (size, len(CHANNELS))
    return _Grid(np.broadcast_to(count, shape), np.broadcast_to(mean, shape), int(off.sum()))


def _losses(measurements: Measurements, grid: _Grid) -> Iterator[str]:
    samples = grid.samples.max(axis=1)
    if grid.moved:
        filled = f"{np.count_nonzero(samples)} of {len(samples)} cells are filled"
        yield f"{grid.moved} samples moved to the centre of their MERL cell; {filled}."
    if several := np.count_nonzero(samples > 1):
        yield f"{several} MERL cells hold the mean of several samples."
    if negative := np.count_nonzero(((grid.samples > 0) & (grid.mean < 0)).any(axis=1)):
        yield f"{negative} MERL cells of negative value written as invalid."
    if len(measurements.channels) == 1:
        yield "One channel written to all three planes of the MERL file."
    if measurements.channels not in (CHANNELS, default_channels(1)):
        named = ", ".join(map(visible, measurements.channels))
        yield f"Names of channels, {named}, not written: the planes of a MERL file are r, g, b."
    if measurements.sigma is not None:
        yield "sigma not written: a MERL file has no place for it."
