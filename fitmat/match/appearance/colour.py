"""Spectra: what colour the channels of a file have to an eye, and how different two colours look.

It knows no material and no light but daylight D65; the spaces in which colours are compared are those of `differences`.
"""

import dataclasses
import functools
from pathlib import Path

import numpy as np
from jaxtyping import Float

from fitmat.match.appearance import differences
from fitmat.text import brief, visible

COVERED = 0.95
"""Share of each colour-matching function that must lie between the first and the last wavelength."""

LARGEST_GAP = 50.0
"""Nanometres between neighbouring wavelengths, beyond which a spectrum is too coarse to have a colour."""

WHITE_LUMINANCE = 203.0
"""Luminance of white in cd/m² where ΔE_ITP needs one: the reference white of ITU-R BT.2408-7, sec. 2.1."""

FROM_SRGB = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
"""Linear sRGB to XYZ, to the four digits of IEC 61966-2-1."""

FILE = Path(__file__).with_name("observer.npz")
"""Wavelengths in nm, and the CIE 1931 2° observer times D65 there; `benchmarks/observer.py`."""


@dataclasses.dataclass(frozen=True, eq=False)
class Colouring:
    """How values per channel become a colour: XYZ = values @ weights.

    Attributes:
        weights: CIE XYZ of each channel, (c, 3); values of 1 in all channels are white, Y = 1 (D65).
        words: In a sentence, what the channels were taken for.
    """

    weights: Float[np.ndarray, "c 3"]
    words: str

    __repr__ = brief


def colouring(channels: tuple[str, ...]) -> Colouring:
    """The colour of each channel under D65, from its name.

    One channel is grey. r, g, b are linear sRGB (IEC 61966-2-1, the primaries of BT.709); x, y, z are CIE tristimulus
    values. Numbers are wavelengths in nm: Σ_k R_k ∫ Λ_k S x̄ dλ/∫ S ȳ dλ with the CIE 1931 2° observer x̄, ȳ, z̄, D65 as
    S (CIE 15:2018, sec. 7.1) and hats Λ_k, which make R(λ) linear between the wavelengths and constant outside.
    What it cannot place is grey, from the mean of the channels.

    Args:
        channels: Names as in `Measurements.channels`.
    """
    names = tuple(name.strip().lower() for name in channels)
    if len(names) == 1:
        return _grey(1, "one channel, drawn grey")
    if set(names) == set("rgb") and len(names) == 3:
        return Colouring(FROM_SRGB.T[["rgb".index(name) for name in names]], "r, g and b as linear sRGB")
    if set(names) == set("xyz") and len(names) == 3:
        return Colouring(np.eye(3)[["xyz".index(name) for name in names]], "x, y and z as tristimulus values under D65")
    wavelengths = _numbers(names)
    if wavelengths is None:
        return _grey(len(names), f"channels {_listed(channels)} have no known colour: drawn grey, from their mean")
    return _spectral(wavelengths)


def delta_e_2000(one: Float[np.ndarray, "... 3"], other: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "..."]:
    """CIEDE2000 colour difference, `differences.ciede2000`.

    Args:
        one: CIE XYZ, white D65 at Y = 1.
        other: The same of the other colours.
    """
    return differences.ciede2000(differences.to_lab(one), differences.to_lab(other))


def delta_e_itp(one: Float[np.ndarray, "... 3"], other: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "..."]:
    """ΔE_ITP, `differences.itp`.

    Args:
        one: CIE XYZ, white D65 at Y = 1, which has `WHITE_LUMINANCE`; clipped to what ITU-R BT.2100 can say.
        other: The same of the other colours.
    """
    pairs = (np.clip(WHITE_LUMINANCE * xyz, 0.0, differences.HIGHEST_LUMINANCE) for xyz in (one, other))
    return differences.itp(*(differences.to_ictcp(xyz) for xyz in pairs))


def shown(xyz: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 3"]:
    """XYZ as an sRGB display shows it: red, green and blue of at least 0 and at most those of white (Y = 1)."""
    return _linear(xyz) @ FROM_SRGB.T


def to_srgb(xyz: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 3"]:
    """XYZ (white Y = 1) as sRGB values from 0 to 1, encoded as in IEC 61966-2-1."""
    linear = _linear(xyz)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def _linear(xyz: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 3"]:
    return np.clip(xyz @ np.linalg.inv(FROM_SRGB).T, 0.0, 1.0)


def _grey(count: int, words: str) -> Colouring:
    return Colouring(np.tile(FROM_SRGB.sum(axis=1) / count, (count, 1)), words)


def _numbers(names: tuple[str, ...]) -> Float[np.ndarray, " c"] | None:
    try:
        found = np.array([float(name.removesuffix("nm")) for name in names])
    except ValueError:
        return None
    return found if np.isfinite(found).all() and len(np.unique(found)) == len(found) else None


def _spectral(wavelengths: Float[np.ndarray, " c"]) -> Colouring:
    """The formula of `colouring` on a grid of 1 nm; grey where the wavelengths do not show a colour."""
    order = np.argsort(wavelengths)
    known, (grid, seen) = wavelengths[order], _seen()
    span, inside = f"{known[0]:g} to {known[-1]:g} nm", (grid >= known[0]) & (grid <= known[-1])
    if (seen[inside].sum(axis=0) < COVERED * seen.sum(axis=0)).any():
        return _grey(len(known), f"{span} do not cover what an eye sees: drawn grey, from the mean of the channels")
    if (gap := np.diff(known).max()) > LARGEST_GAP:
        words = f"wavelengths {gap:.0f} nm apart are too coarse for a colour: drawn grey, from the mean of the channels"
        return _grey(len(known), words)
    hats = np.stack([np.interp(grid, known, row) for row in np.eye(len(known))])
    weights = np.empty((len(known), 3))
    weights[order] = hats @ seen / seen[:, 1].sum()
    return Colouring(weights, f"spectrum from {span}, seen by the CIE 1931 2° observer under D65")


def _listed(names: tuple[str, ...]) -> str:
    return ", ".join(map(visible, names if len(names) < 5 else (*names[:2], "…", names[-1])))


@functools.cache
def _seen() -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 3"]]:
    """Wavelengths of 1 nm and colour-matching functions times D65, which CIE interpolates linearly (CIE 15:2018)."""
    with np.load(FILE) as arrays:
        return arrays["wavelength"], arrays["seen"]
