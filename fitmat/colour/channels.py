"""Channels: what colour the channels of a file have to an eye under daylight D65, and to which light each responds.

It knows no material; what has no colour is grey and said to be so, never guessed.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.colour import observers
from fitmat.colour.spaces import FROM_SRGB, linear
from fitmat.errors import FitmatError
from fitmat.text import brief, visible

COVERED = 0.95
"""Share of each colour-matching function that must lie between the first and the last wavelength."""

LARGEST_GAP = 50.0
"""Nanometres between neighbouring wavelengths, beyond which a spectrum is too coarse to have a colour."""


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

    @property
    def grey(self) -> bool:
        """Whether whatever the values are they make a grey, so that the luminance Y says it all."""
        return bool(np.allclose(self.weights, self.weights[:, 1:2] * FROM_SRGB.sum(axis=1)))


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


def colouring_under(channels: tuple[str, ...], illuminant: str, observer: str = "2") -> Float[np.ndarray, "c 3"]:
    """CIE XYZ of each channel under a light, (c, 3); values of 1 in all channels are white, Y = 1.

    Args:
        channels: Names as in `Measurements.channels`: wavelengths in nm; for D65 and the 2° observer also r, g, b or
            x, y, z; one channel of any name is a grey under every light.
        illuminant: As in `observers.seen`.
        observer: As in `observers.seen`.

    Raises:
        FitmatError: they have no colour under that light.
    """
    names = tuple(name.strip().lower() for name in channels)
    if (illuminant, observer) == ("D65", "2") and sorted(names) in (["b", "g", "r"], ["x", "y", "z"]):
        return colouring(channels).weights
    if len(names) == 1:
        return observers.white(illuminant, observer)[None]
    wavelengths = _numbers(names)
    why = f"channels {_listed(channels)}" if wavelengths is None else unseen(wavelengths, illuminant, observer)
    if wavelengths is None or why is not None:
        raise FitmatError(
            f"{why}: no colour under {illuminant} is known, expected wavelengths from 400 to 700 nm or more, every 50 "
            "nm or closer, or r, g and b, which have one under D65."
        )
    return tristimulus(wavelengths, illuminant, observer)


def sensitivities() -> Float[np.ndarray, "3 n"]:
    """To which light linear sRGB responds: rgb = sensitivities @ R of a reflectance R(λ) at `observers.wavelengths`.

    The CIE 1931 2° observer under D65 through the inverse of IEC 61966-2-1's matrix, negative lobes included, each
    row scaled to 1 (by 2e-4 at most: that matrix has four digits), so that white is 1, 1, 1.
    """
    response = linear(observers.seen())
    return (response / response.sum(axis=0)).T


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
    if (why := unseen(wavelengths)) is not None:
        return _grey(len(wavelengths), f"{why}: drawn grey, from the mean of the channels")
    span = f"{wavelengths.min():g} to {wavelengths.max():g} nm"
    return Colouring(tristimulus(wavelengths), f"spectrum from {span}, seen by the CIE 1931 2° observer under D65")


def unseen(wavelengths: Float[np.ndarray, " c"], illuminant: str = "D65", observer: str = "2") -> str | None:
    """Why a spectrum at these wavelengths has no colour under a light, in words; None where it has one.

    Args:
        wavelengths: In nm, in any order, no two alike.
        illuminant: As in `observers.seen`.
        observer: As in `observers.seen`.
    """
    known, grid, seen = np.sort(wavelengths), observers.wavelengths(), observers.seen(illuminant, observer)
    inside = (grid >= known[0]) & (grid <= known[-1])
    if (seen[inside].sum(axis=0) < COVERED * seen.sum(axis=0)).any():
        return f"{known[0]:g} to {known[-1]:g} nm do not cover what an eye sees"
    gap = float(np.diff(known).max())
    return f"wavelengths {gap:.0f} nm apart are too coarse for a colour" if gap > LARGEST_GAP else None


def tristimulus(
    wavelengths: Float[np.ndarray, " c"], illuminant: str = "D65", observer: str = "2"
) -> Float[np.ndarray, "c 3"]:
    """What a reflectance of 1 at each wavelength adds to XYZ, by the formula of `colouring` under any light.

    Args:
        wavelengths: As in `unseen`, which says whether they show a colour.
        illuminant: As in `observers.seen`.
        observer: As in `observers.seen`.
    """
    order = np.argsort(wavelengths)
    hats = np.stack([np.interp(observers.wavelengths(), wavelengths[order], row) for row in np.eye(len(order))])
    weights = np.empty((len(order), 3))
    weights[order] = hats @ observers.seen(illuminant, observer)
    return weights


def _listed(names: tuple[str, ...]) -> str:
    return ", ".join(map(visible, names if len(names) < 5 else (*names[:2], "…", names[-1])))
