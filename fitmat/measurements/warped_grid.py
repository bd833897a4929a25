"""Measured BRDFs on a grid that is warped to each material's visible normals, as RGL-EPFL stores them.

It reads no file, fits nothing, and neither smooths nor clamps what was measured.

Source: J. Dupuy & W. Jakob, An Adaptive Parameterization for Efficient Material Acquisition and Modeling, ACM TOG
37(6), 2018, and the evaluation code that the authors publish (powitacq, and Mitsuba's `measured` and `Marginal2D`).
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import ArrayLike

from fitmat import arguments
from fitmat.errors import ModelError
from fitmat.maths import parts
from fitmat.maths.directions import from_angles, zenith
from fitmat.maths.warp import EDGE, Blend, Cell, Warp
from fitmat.text import brief

_BLOCK = 2**17
"""Numbers at a time while the nodes of a file are worked out."""


class Nodes(NamedTuple):
    """A material's own grid as directions, slice by slice (phi_i, then theta_i), row by row.

    Attributes:
        wi: Unit vectors to the light.
        wo: Unit vectors to the sensor; below the horizon for many, so wherever h does not face the light.
        value: f_r in sr⁻¹; NaN where wo is at or below the horizon.
        empty: Where the slice has no density, so that its positions mean nothing.
        unseen: Where the light sees no projected area.
    """

    wi: Float[np.ndarray, "n 3"]
    wo: Float[np.ndarray, "n 3"]
    value: Float[np.ndarray, "n c"]
    empty: Bool[np.ndarray, " n"]
    unseen: Bool[np.ndarray, " n"]


@dataclasses.dataclass(frozen=True, eq=False)
class RGLMaterial:
    """A measured material: f_r cos θ_o = s D(h)/(4 σ(ω_i)), its factor s tabulated where the warp sends (ω_i, h).

    (θ, φ) ↔ (√(2θ/π), φ/2π + ½) takes directions to the unit square; `vndf` takes h from there to the grid of
    `values`. The luminance that the files hold steers importance sampling only: no value depends on it.

    Limits: between incidences, and beyond the first and last, slices are interpolated linearly and held. A material
    of one or two azimuths of incidence is isotropic; azimuths over 180° or 90° repeat by two-fold symmetry or by
    mirroring. As measured: neither reciprocal nor bounded by its energy, and noise may be negative.

    Attributes:
        theta_i: Zenith angles of incidence in radians, increasing.
        phi_i: Azimuths of incidence in radians, increasing, from −π.
        ndf: D(h) on the unit square, rows along φ.
        sigma: Projected area of the microsurface, σ(ω_i), on the unit square.
        vndf: Distributions of visible normals on the unit square, one slice for each (phi_i, theta_i).
        values: The factor s, (slices, h, w, channels).
        channels: r, g, b, or wavelengths in nm.
        jacobian: Whether D/(4σ) is to be multiplied with; else the values are f_r cos θ_o themselves.
        description: The authors' words.

    References: J. Dupuy & W. Jakob, ACM TOG 37(6), 2018, secs. 3–4; f_r cos θ_o by `powitacq.h` of its authors.

    Example: `fitmat.measurements.formats.rgl.material("paper_white_rgb.bsdf").evaluate(wi, wo)`
    """

    theta_i: Float[np.ndarray, " t"]
    phi_i: Float[np.ndarray, " p"]
    ndf: Float[np.ndarray, "a b"]
    sigma: Float[np.ndarray, "d e"]
    vndf: Warp
    values: Float[np.ndarray, "s h w c"]
    channels: tuple[str, ...]
    jacobian: bool
    description: str

    __repr__ = brief

    @property
    def isotropic(self) -> bool:
        """Whether only the difference of the azimuths counts."""
        return len(self.phi_i) <= 2

    @property
    def symmetry(self) -> int:
        """How often the azimuths of incidence must be repeated to cover the circle: 1, 2 (turned) or 4 (mirrored)."""
        return 1 if self.isotropic else round(2 * np.pi / float(self.phi_i[-1] - self.phi_i[0]))

    def evaluate(self, wi: ArrayLike, wo: ArrayLike) -> Float[np.ndarray, "n c"]:
        """f_r in sr⁻¹, without cosine, for n pairs of directions.

        Args:
            wi: Unit vectors to the light, (n, 3), local frame with the normal +z.
            wo: Unit vectors to the sensor, (n, 3).

        Returns:
            Values (n, c); 0 where a direction is not above the surface, or sees no projected area.

        Raises:
            ModelError: the shapes differ or the vectors are not of unit length.
        """
        wi, wo = _checked(wi, wo)
        lit = (wi[:, 2] > 0) & (wo[:, 2] > 0)
        wi, wo = self._folded(*(np.where(lit[:, None], w, [0.0, 0.0, 1.0]) for w in (wi, wo)))
        h = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
        theta_i, phi_i = zenith(wi), np.arctan2(wi[:, 1], wi[:, 0])
        blend = self._blend(theta_i, phi_i)
        turned = _to_square(zenith(h), np.arctan2(h[:, 1], h[:, 0]) - (phi_i if self.isotropic else 0.0))
        turned[:, 1] %= 1.0
        height, width = self.values.shape[1:3]
        with np.errstate(invalid="ignore", over="ignore"):
            value = Cell.at(self.vndf.invert(turned, blend), width, height).bilinear(blend, self.values)
            value = value * (self._density(theta_i, phi_i, turned) / wo[:, 2])[:, None]
        return np.where(lit[:, None], value, 0.0)

    def nodes(self) -> Nodes:
        """Where the file's own numbers stand, and what the model gives there."""
        slices, height, width, channels = self.values.shape
        number = slices * height * width
        flags = (np.zeros(number, bool) for _ in range(2))
        nodes = Nodes(np.empty((number, 3)), np.empty((number, 3)), np.empty((number, channels)), *flags)
        azimuths = self._azimuths()
        for block in parts.slices(number, max(1, _BLOCK // (channels + 16))):
            chosen, y, x = np.unravel_index(np.arange(block.start, block.stop), (slices, height, width))
            theta_i, phi_i = self.theta_i[chosen % len(self.theta_i)], azimuths[chosen // len(self.theta_i)]
            at = self.vndf.sample(np.stack([x / (width - 1), y / (height - 1)], axis=1), Blend.only(chosen))
            theta_h, phi_h = np.pi / 2 * at[:, 0] ** 2, 2 * np.pi * at[:, 1] - np.pi
            wi, h = from_angles(theta_i, phi_i), from_angles(theta_h, phi_h + (phi_i if self.isotropic else 0.0))
            wo = 2 * np.sum(wi * h, axis=1, keepdims=True) * h - wi
            with np.errstate(invalid="ignore", over="ignore"):
                cos = np.where(wo[:, 2] > 0, wo[:, 2], np.nan)
                value = self.values[chosen, y, x] * (self._density(theta_i, phi_i, at) / cos)[:, None]
            nodes.wi[block], nodes.wo[block], nodes.value[block] = wi, wo, value
            nodes.empty[block] = self.vndf.empty[chosen]
            nodes.unseen[block] = self.jacobian & (self._area(theta_i, phi_i) <= 0)
        return nodes

    def _azimuths(self) -> Float[np.ndarray, " p"]:
        """`phi_i`, the outermost just within their range, where the published code finds their own slices.

        π in single precision lies beyond π: the light would be across the seam, or across a plane of symmetry.
        """
        if self.isotropic:
            return self.phi_i
        return np.clip(self.phi_i, max(self.phi_i[0], -np.pi) + EDGE, min(self.phi_i[-1], np.pi) - EDGE)

    def _folded(self, wi: np.ndarray, wo: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Both directions turned or mirrored so that the light is at an azimuth of incidence that was measured."""
        if self.symmetry < 2:
            return wi, wo
        flip = np.where(np.signbit(wi[:, :2]), 1.0, -1.0)
        sign = np.column_stack([flip[:, int(self.symmetry != 4)], flip[:, 1], np.ones(len(wi))])
        return wi * sign, wo * sign

    def _blend(self, theta_i: np.ndarray, phi_i: np.ndarray) -> Blend:
        """The slices next to an incidence."""
        azimuth, elevation = Blend.between(self.phi_i, phi_i), Blend.between(self.theta_i, theta_i)
        return azimuth.times(elevation, len(self.theta_i))

    def _density(self, theta_i: np.ndarray, phi_i: np.ndarray, u: np.ndarray) -> Float[np.ndarray, " n"]:
        """D(h)/(4 σ(ω_i)) with h on the unit square; 0 without projected area."""
        if not self.jacobian:
            return np.ones(len(u))
        area = self._area(theta_i, phi_i)
        d = _interpolated(self.ndf, u)
        return np.where(area > 0, d / (4.0 * np.where(area > 0, area, 1.0)), 0.0)

    def _area(self, theta_i: np.ndarray, phi_i: np.ndarray) -> Float[np.ndarray, " n"]:
        """σ(ω_i)."""
        return _interpolated(self.sigma, _to_square(theta_i, phi_i))


def _interpolated(table: np.ndarray, u: np.ndarray) -> Float[np.ndarray, " n"]:
    height, width = table.shape
    return Cell.at(u, width, height).bilinear(Blend.only(np.zeros(len(u), int)), table[None])


def _to_square(theta: np.ndarray, phi: np.ndarray) -> Float[np.ndarray, "n 2"]:
    return np.stack([np.sqrt(2 / np.pi * theta), phi / (2 * np.pi) + 0.5], axis=1)


def _checked(wi: ArrayLike, wo: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    pair = np.asarray(wi, float), np.asarray(wo, float)
    if pair[0].shape != pair[1].shape or pair[0].ndim != 2 or pair[0].shape[1] != 3:
        raise ModelError(f"wi and wo have shapes {pair[0].shape} and {pair[1].shape}: expected the same (n, 3).")
    for name, w in zip(("wi", "wo"), pair, strict=True):
        arguments.unit_vectors(name, w)
    return pair
