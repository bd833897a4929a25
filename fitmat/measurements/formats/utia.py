"""UTIA: an anisotropic RGB BRDF of the UTIA database, read from its headerless `.bin` file.

It undoes no colour curve and sets no scale, which the file does not tell and its published readers do not agree on.

Layout of J. Filip and R. Vávra, "Template-Based Sampling of Anisotropic BRDFs", Computer Graphics Forum 33, 2014, as in
Filip's lookup code TBDR and its ports (ALTA's `data_utia`, A. Sztrajman's `read_brdf.py`): three planes, R, G and B, of
float64, each of 288 × 288 numbers. Number (48 i + j) 288 + 48 k + l belongs to light at θ_i = 15° i, φ_i = 7.5° j and
sensor at θ_v = 15° k, φ_v = 7.5° l, with i, k < 6 and j, l < 48. There is no header: a file is known by its exact size,
1,990,656 bytes (995,328 of float32), and by numbers that a reflectance could be.

What the numbers are: Filip's code, ALTA and Sztrajman use them as linear values; A. Fichet's `utia.py` first undoes the
sRGB curve; J. Dupuy's `dj_brdf.h` divides by 140, undoes it and multiplies by 100. Here they are linear.
"""

import os

import numpy as np

from fitmat.errors import ReadError
from fitmat.maths.directions import from_angles
from fitmat.measurements.parsing import contents
from fitmat.measurements.parsing.recording import Recording

CHANNELS = ("r", "g", "b")

SHAPE = (6, 48, 6, 48)
"""Directions in θ_i, φ_i, θ_v and φ_v."""

STEPS = (15.0, 7.5, 15.0, 7.5)
"""Degrees between them; each begins at 0."""

NOTES = (
    "UTIA numbers read as linear f_r in sr⁻¹: the database does not state their scale and its published readers differ "
    "(some undo an sRGB curve, one divides by 140 first). Trust the shape of the lobes, not albedos.",
    "UTIA azimuths are those of the sample, φ_o − φ_i = 180° is the mirror side.",
)

_TYPES = {len(CHANNELS) * 288 * 288 * width: f"<f{width}" for width in (8, 4)}
_LARGEST = 1e6
_SMALLEST = 1e-9
_TEXT = frozenset(range(32, 127)) | frozenset(b"\t\n\r\f")


def claims(head: bytes, size: int) -> bool:
    """Whether the size is exact and the first numbers are finite and of a reflectance's magnitude."""
    return size in _TYPES and _plausible(head, _TYPES[size])


def load(path: str | os.PathLike[str]) -> Recording:
    """One row for each pair of directions, in the order of the file.

    Raises:
        ReadError: the file cannot be opened, is of another size, or begins with what no reflectance could be.
    """
    source, raw = contents.name(path), contents.contents(path)
    if len(raw) not in _TYPES:
        expected = f"expected {' or '.join(map(str, _TYPES))}. Was its download cut off?"
        raise ReadError(f"{source}: {len(raw)} bytes, which no UTIA file has, {expected}")
    kind = _TYPES[len(raw)]
    if not _plausible(raw[: contents.HEAD], kind):
        expected = f"expected numbers from {_SMALLEST:g} to {_LARGEST:g}. Is it the right file?"
        raise ReadError(f"{source}: the first {contents.HEAD} bytes are not those of a UTIA file, {expected}")
    grid = np.meshgrid(*(np.deg2rad(step) * np.arange(n) for n, step in zip(SHAPE, STEPS, strict=True)), indexing="ij")
    theta_i, phi_i, theta_v, phi_v = (angle.ravel() for angle in grid)
    return Recording(
        source=source,
        wi=from_angles(theta_i, phi_i),
        wo=from_angles(theta_v, phi_v),
        value=_numbers(raw, kind).reshape(len(CHANNELS), -1).T,
        quantity="brdf",
        channels=CHANNELS,
        notes=NOTES,
    )


def _numbers(raw: bytes, kind: str) -> np.ndarray:
    with np.errstate(invalid="ignore"):  # NaNs may be of the signalling kind
        return np.frombuffer(raw[: len(raw) // 8 * 8], kind) * np.float64(1.0)


def _plausible(head: bytes, kind: str) -> bool:
    """Whether the bytes are no text, and numbers of moderate size, of which most are neither 0 nor tiny."""
    if _TEXT.issuperset(head):
        return False
    size = np.abs(_numbers(head, kind))
    return bool((size <= _LARGEST).all() and (size > _SMALLEST).mean() > 0.5)
