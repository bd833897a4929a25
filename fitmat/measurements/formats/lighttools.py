"""LightTools: BSDF files of Synopsys' LightTools, angles measured from the normal.

It reads what the front side reflects; other blocks are counted in the notes. It writes nothing.

The layout is the one that libbsdf reads (R. Kimura, `LightToolsBsdfReader.cpp`): a head with the azimuths and zenith
angles of all blocks, then after DataBegin the blocks, each with its own AOI, POI, Side, Wavelength, ScatterType and
TristimulusValue above a line TIS, and below it one line for each azimuth and one number for each zenith angle. The
light comes from azimuth 90°, so that the mirror direction is at 270°.
"""

import dataclasses
import os
from collections.abc import Iterator

import numpy as np
import polars as pl
from jaxtyping import Bool, Float

from fitmat.errors import ReadError
from fitmat.maths.directions import from_angles
from fitmat.measurements.parsing import blocks, contents
from fitmat.measurements.parsing.recording import Recording, channel_names, pivot
from fitmat.measurements.samples import StatedAlbedo, default_channels

LIGHT = 90.0
"""Azimuth of the light in such files, degrees."""

CONTENTS = ("monochrome", "xyz")
SYMMETRIES = ("asymmetric", "asymmetrical", "planesymmetric", "planesymmetrical")

_BLOCK = ("aoi", "poi", "side", "wavelength", "scattertype", "tristimulusvalue")
_HEAD = ("source", "symmetry", "spectralcontent", "scatterazimuth", "scatterradial")
_KEYS = (*_HEAD, *_BLOCK, "databegin", "tis", "dataend")
_LARGEST = 1e6
_TRISTIMULUS = {f"tris{name}": name for name in "xyz"}


def claims(head: bytes, size: int) -> bool:
    """Whether the head lists radial angles and a block states its angle of incidence."""
    return blocks.begins(head, rb"ScatterRadial\b", rb"AOI\b")


def load(path: str | os.PathLike[str]) -> Recording:
    """One row for each direction of a block, XYZ and wavelengths side by side; light at azimuth 0, mirror side at π.

    Raises:
        ReadError: the file is incomplete, holds no reflection of the front side, or planes of incidence that differ.
    """
    source = contents.name(path)
    text, notes = contents.decoded(contents.contents(path), source)
    found = blocks.sections(text, source, _KEYS)
    found.refuse_numbers_outside("tis", "scatterazimuth", "scatterradial")
    found.word("Symmetry", SYMMETRIES)
    content = found.word("SpectralContent", CONTENTS)
    azimuth = np.deg2rad(found.listed("ScatterAzimuth", -360, 360))
    theta = np.deg2rad(found.listed("ScatterRadial", 0, 180))
    number = found.blocks(found.at("tis"), len(azimuth) * len(theta), f"{len(azimuth)} × {len(theta)} angles")
    front = (_stated(found, "side", "front") == "front") & (_stated(found, "scattertype", "brdf") == "brdf")
    _refuse_blocks(found, front)
    aoi = np.deg2rad(_numbers(found, "aoi", front))
    theta_i, phi_o, theta_o = np.meshgrid(aoi, azimuth - np.deg2rad(LIGHT), theta, indexing="ij")
    value = number[front].reshape(*theta_i.shape, 1)
    twice = blocks.repeated(value, theta, azimuth).reshape(-1, 1)
    long = Recording(
        source=source,
        wi=from_angles(theta_i.ravel(), np.zeros(theta_i.size)),
        wo=from_angles(theta_o.ravel(), phi_o.ravel()),
        value=value.reshape(-1, 1),
        quantity="brdf",
        channels=default_channels(1),
        doubts={"the same value of a direction once more, for another azimuth": twice},
        notes=(*notes, *_conventions(front)),
    )
    labels = _labels(found, front, content)
    long = dataclasses.replace(long, stated=tuple(_totals(found, front, aoi, labels)))
    return long if labels is None else pivot(long, np.repeat(labels, value[0].size))


def _stated(found: blocks.Sections, key: str, default: str) -> np.ndarray:
    """What each block says, in lower case, (j,); the last line counts where a block has several."""
    tis, rows = found.at("tis"), found.at(key)
    said = np.full(len(tis), default, dtype=object)
    block = np.searchsorted(tis, rows)
    inside = block < len(tis)
    said[block[inside]] = found.rest.str.to_lowercase().gather(rows[inside]).to_numpy()
    return said


def _numbers(found: blocks.Sections, key: str, front: Bool[np.ndarray, " j"]) -> Float[np.ndarray, " f"]:
    """What each block of the front side says as a number; 0 where it says nothing and need not."""
    words = pl.Series(_stated(found, key, "" if key == "aoi" else "0")[front], dtype=pl.String)
    number = words.cast(pl.Float64, strict=False).fill_null(np.nan).to_numpy()
    limit = 90 if key == "aoi" else _LARGEST
    for bad in np.flatnonzero(~((number >= 0) & (number <= limit)))[:1]:
        expected = "an angle of 0 to 90 degrees" if key == "aoi" else f"a number from 0 to {_LARGEST:g}"
        got = f"the block of this line has {key.upper()} {blocks.shown(words[int(bad)]) or '(none)'}"
        row = int(found.at("tis")[front][bad])
        raise ReadError(f"{found.heads.where(row)}: {got}, expected {expected}. Correct the line.")
    return number


def _refuse_blocks(found: blocks.Sections, front: Bool[np.ndarray, " j"]) -> None:
    if not front.any():
        got = f"{len(front)} blocks, none of which is a BRDF of the front side"
        raise ReadError(f"{found.heads.source}: {got}, expected one. fitmat fits reflection: choose another file.")
    planes = np.unique(_numbers(found, "poi", front))
    if len(planes) > 1:
        got = f"planes of incidence (POI) {', '.join(f'{plane:g}' for plane in planes[:4])}"
        raise ReadError(f"{found.heads.source}: {got}, expected one, their sense is not published. Split the file.")


def _labels(found: blocks.Sections, front: Bool[np.ndarray, " j"], content: str) -> np.ndarray | None:
    """Channel of each block: x, y, z, or a wavelength in nm; None where the file states none."""
    if content == "xyz":
        words = _stated(found, "tristimulusvalue", "")[front]
        for bad in np.flatnonzero([word not in _TRISTIMULUS for word in words])[:1]:
            got = f"the block of this line has TristimulusValue {blocks.shown(str(words[bad])) or '(none)'}"
            where = found.heads.where(int(found.at("tis")[front][bad]))
            raise ReadError(f"{where}: {got}, expected TrisX, TrisY or TrisZ. Correct the line.")
        return np.array([_TRISTIMULUS[word] for word in words])
    wavelength = _numbers(found, "wavelength", front)
    return wavelength if (wavelength > 0).all() else None


def _totals(
    found: blocks.Sections, front: Bool[np.ndarray, " j"], aoi: Float[np.ndarray, " f"], labels: np.ndarray | None
) -> Iterator[StatedAlbedo]:
    """The TIS of each block of the front side."""
    names = default_channels(1) * len(aoi) if labels is None else channel_names(labels)
    for theta_i, name, total in zip(aoi, names, found.totals(found.at("tis"))[front], strict=True):
        if np.isfinite(total):
            yield StatedAlbedo(float(theta_i), 0.0, name, float(total))


def _conventions(front: Bool[np.ndarray, " j"]) -> tuple[str, ...]:
    note = f"LightTools azimuths turned: the light at {LIGHT:g}°, the mirror side at {LIGHT + 180:g}° of the file."
    others = np.count_nonzero(~front)
    return (note, f"Blocks not read, of the back side or of transmission: {others}.") if others else (note,)
