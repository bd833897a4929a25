"""Spaces of colour: XYZ as linear numbers of a display or a renderer, encoded for a screen, and as lightness and hue.

It knows neither spectra nor differences. Nothing is clipped but where a display shows it (`shown`, `to_srgb`).
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat import arguments

FROM_SRGB = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
"""Linear sRGB to XYZ, to the four digits of IEC 61966-2-1."""

BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
"""XYZ to the cones' responses in which colours are adapted to another white (ICC.1:2022, annex E)."""

OKLAB_LMS = np.array(
    [
        [0.8189330101, 0.3618667424, -0.1288597137],
        [0.0329845436, 0.9293118715, 0.0361456387],
        [0.0482003018, 0.2643662691, 0.6338517070],
    ]
)
OKLAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)
"""XYZ (D65) to cones, and their cube roots to L, a, b (B. Ottosson, A perceptual color space for image processing)."""


@dataclasses.dataclass(frozen=True)
class Space:
    """Linear numbers of three primaries.

    Attributes:
        red, green, blue, white: Chromaticities x, y.
        doc: Where they stand.
    """

    red: tuple[float, float]
    green: tuple[float, float]
    blue: tuple[float, float]
    white: tuple[float, float]
    doc: str

    def to_xyz(self) -> Float[np.ndarray, "3 3"]:
        """Matrix from linear numbers to XYZ: the primaries, so much of each that (1, 1, 1) is white with Y = 1."""
        columns = np.stack([_xyz(xy) for xy in (self.red, self.green, self.blue)], axis=1)
        return columns * np.linalg.solve(columns, _xyz(self.white))


D65 = (0.3127, 0.3290)
SPACES = {
    "srgb": Space((0.64, 0.33), (0.30, 0.60), (0.15, 0.06), D65, "IEC 61966-2-1, linear; BT.709's primaries"),
    "p3": Space((0.680, 0.320), (0.265, 0.690), (0.150, 0.060), D65, "Display P3, linear; SMPTE EG 432-1's primaries"),
    "acescg": Space((0.713, 0.293), (0.165, 0.830), (0.128, 0.044), (0.32168, 0.33767), "ACEScg, AMPAS S-2014-004"),
}
"""Name → primaries."""


def linear(xyz: Float[np.ndarray, "... 3"], space: str = "srgb") -> Float[np.ndarray, "... 3"]:
    """XYZ under D65 as linear numbers of a space; a colour outside it has some below 0 or above 1.

    A space of another white gets the colour adapted to it (von Kries in Bradford's cones), so that white is (1, 1, 1).

    Args:
        xyz: CIE XYZ, white D65 at Y = 1.
        space: A key of `SPACES`.

    Raises:
        FitmatError: the space is not known.
    """
    arguments.choice("space", space, SPACES)
    if space == "srgb":
        return xyz @ np.linalg.inv(FROM_SRGB).T
    found = SPACES[space]
    return xyz @ adaptation(_xyz(D65), _xyz(found.white)).T @ np.linalg.inv(found.to_xyz()).T


def adaptation(source: Float[np.ndarray, "3"], target: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """The matrix that makes one white another: von Kries in Bradford's cones (ICC.1:2022, annex E).

    Args:
        source: XYZ of the white that is.
        target: XYZ of the white that shall be.
    """
    return np.linalg.solve(BRADFORD, (BRADFORD @ target / (BRADFORD @ source))[:, None] * BRADFORD)


def oklch(xyz: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 3"]:
    """Lightness (white 1), chroma and hue in degrees, of Oklab (Ottosson 2020).

    Args:
        xyz: CIE XYZ, white D65 at Y = 1.
    """
    lab = np.cbrt(xyz @ OKLAB_LMS.T) @ OKLAB.T
    hue = np.rad2deg(np.arctan2(lab[..., 2], lab[..., 1])) % 360.0
    return np.stack([lab[..., 0], np.hypot(lab[..., 1], lab[..., 2]), hue], axis=-1)


def shown(xyz: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 3"]:
    """XYZ as an sRGB display shows it: red, green and blue of at least 0 and at most those of white (Y = 1)."""
    return np.clip(linear(xyz), 0.0, 1.0) @ FROM_SRGB.T


def to_srgb(xyz: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 3"]:
    """XYZ (white Y = 1) as sRGB values from 0 to 1, encoded as in IEC 61966-2-1."""
    return encoded(np.clip(linear(xyz), 0.0, 1.0))


def encoded(values: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Linear values from 0 to 1 as sRGB has them, IEC 61966-2-1."""
    return np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055)


def _xyz(xy: tuple[float, float]) -> Float[np.ndarray, "3"]:
    """A chromaticity at Y = 1."""
    x, y = xy
    return np.array([x / y, 1.0, (1.0 - x - y) / y])
