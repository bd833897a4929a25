"""A scene: a sphere, the lights around it, and the pixels in which a viewer must look at it to miss nothing.

It knows no reflectance model and no colour.

The viewer looks along −z from far away (orthographic); x points right and y up on the screen, the sphere is the unit
disc. Three lights of one direction each, of irradiance 1 on a surface that faces them, and an environment are there
one after the other. The sphere casts no shadow on itself and no light is reflected twice. An anisotropic surface lies
with its x axis along the parallels about the vertical axis y, as if turned on a lathe.
"""

import dataclasses
import functools

import numpy as np
from jaxtyping import Bool, Float

from fitmat.maths.directions import zenith
from fitmat.maths.quadrature import Rule, facets, gauss, lobe_rule, stepped
from fitmat.text import brief

LIGHTS = {"front light": (20.0, 120.0), "side light": (60.0, 150.0), "rim light": (140.0, 45.0)}
"""Name → angle from the viewer and direction on the screen (counter-clockwise from the right), degrees."""

ENVIRONMENT = "sky and windows"

GROUND = 0.2 * 7.0 / 9.0
"""Radiance of ground of albedo 0.2 below the overcast sky, whose irradiance is 7π/9; the zenith's radiance is 1."""

WINDOWS = ((50.0, 135.0, 20.0, 10.0), (120.0, 20.0, 20.0, 10.0))
"""Angle from the viewer and direction on the screen (degrees), sharpness κ, radiance added at the centre."""

LIGHT_RINGS, LIGHT_PIXELS = 96, 12
"""Rings of pixels about the normal that mirrors a light, and pixels on each side of a ring."""

SKY_RINGS, SKY_PIXELS, SKY_NODES = 24, 16, (64, 24)
"""The same in the environment, about the viewer; nodes of `lobe_rule` for each ring, on one side."""

COARSE_RINGS, COARSE_PIXELS, COARSE_NODES = 12, 8, (32, 12)
"""The same for anisotropic models, which need their own rule for each pixel."""

GRAZING = 0.052336
"""cos 87°: pixels are left out where a light falls or the viewer looks at a flatter angle than 3°."""


@dataclasses.dataclass(frozen=True, eq=False)
class Screen:
    """Pixels of the sphere, on rings about some normal, on one side of its meridian and then on the other.

    Attributes:
        axes: Rows: two tangents and the normal in the middle of the rings, in the viewer's axes.
        half: Half the angle between the viewer and the light, both in the plane of the first tangent, radians.
        rings: Angles of the rings, radians, increasing, (a,).
        along: Where on one side of a ring, increasing from −1 to 1, (b,).
        area: On the screen, where the sphere covers π, (a, s, b); 0 where unlit or hidden. s is 2, or 1 where both
            sides look the same.
    """

    axes: Float[np.ndarray, "3 3"]
    half: float
    rings: Float[np.ndarray, " a"]
    along: Float[np.ndarray, " b"]
    area: Float[np.ndarray, "a s b"]

    __repr__ = brief

    @property
    def normals(self) -> Float[np.ndarray, "a s b 3"]:
        """Of the pixels, in the viewer's axes."""
        turn = np.pi / 2.0 + reach(self.rings, self.half)[:, None] * self.along
        turn, rings = np.stack([turn, -turn][: self.area.shape[1]], axis=1), self.rings[:, None, None]
        sin = np.sin(rings)
        return np.stack([sin * np.cos(turn), sin * np.sin(turn), np.cos(rings + 0.0 * turn)], axis=-1) @ self.axes


def reach(theta: Float[np.ndarray, "..."], half: float) -> Float[np.ndarray, "..."]:
    """How far a ring can be seen and lit on either side of azimuth ±90°: at most π/2, which is everywhere.

    The viewer is at zenith angle `half` and azimuth 0, the light at azimuth 180°: c_o = c_θ c_h + s_θ s_h cos φ and
    c_i = c_θ c_h − s_θ s_h cos φ are above g = `GRAZING` where |cos φ| < (c_θ c_h − g)/(s_θ s_h).

    Args:
        theta: Angle of the ring, radians.
        half: Half the angle between viewer and light, radians.
    """
    most = (np.cos(theta) * np.cos(half) - GRAZING) / np.maximum(np.sin(theta) * np.sin(half), 1e-300)
    return np.arcsin(np.clip(most, 0.0, 1.0))


SUBPIXELS = 4
"""A pixel of a picture is the mean of so many by so many points."""


@dataclasses.dataclass(frozen=True, eq=False)
class Raster:
    """The points of a square picture that see the sphere, `SUBPIXELS` by `SUBPIXELS` for each pixel, rows from the top.

    Attributes:
        size: Pixels along a side.
        inside: Which points, (SUBPIXELS size, SUBPIXELS size).
        normals: Of the sphere at these, in the viewer's axes, (m, 3).
    """

    size: int
    inside: Bool[np.ndarray, "k k"]
    normals: Float[np.ndarray, "m 3"]

    __repr__ = brief

    @property
    def opacity(self) -> Float[np.ndarray, "h w"]:
        """Share of each pixel that sees the sphere."""
        return self._summed(np.ones((len(self.normals), 1)))[..., 0] / SUBPIXELS**2

    def mean(self, values: Float[np.ndarray, "m c"]) -> Float[np.ndarray, "h w c"]:
        """Of each pixel over its points that see the sphere; NaN where none does."""
        count = self.opacity[..., None] * SUBPIXELS**2
        return np.where(count > 0, self._summed(values) / np.maximum(count, 1.0), np.nan)

    def _summed(self, values: Float[np.ndarray, "m c"]) -> Float[np.ndarray, "h w c"]:
        every = np.zeros((*self.inside.shape, values.shape[1]))
        every[self.inside] = values
        return every.reshape(self.size, SUBPIXELS, self.size, SUBPIXELS, -1).sum(axis=(1, 3))


def raster(size: int) -> Raster:
    """The points of a picture that the sphere fills but for its rim, see `GRAZING`."""
    count = size * SUBPIXELS
    middle = (np.arange(count) + 0.5) * 2.0 / count - 1.0
    x, y = np.meshgrid(middle, -middle)
    inside = x * x + y * y < 1.0 - GRAZING**2
    x, y = x[inside], y[inside]
    return Raster(size, inside, np.stack([x, y, np.sqrt(1.0 - x * x - y * y)], axis=1))


@dataclasses.dataclass(frozen=True, eq=False)
class Lit:
    """Pixels under light of one direction, L = f c_i.

    Attributes:
        screen: m pixels.
        wi: To the light, local frames, (m, 3).
        wo: To the viewer, (m, 3).
    """

    screen: Screen
    wi: Float[np.ndarray, "m 3"]
    wo: Float[np.ndarray, "m 3"]

    __repr__ = brief


@dataclasses.dataclass(frozen=True, eq=False)
class Surrounded:
    """Pixels in the environment, L = Σ_k light f: s pairs of directions each serve j pixels, m = s j.

    Attributes:
        screen: m pixels, in the order of (s, j).
        wi: To the light, local frames, (s, k, 3).
        wo: To the viewer, (s, k, 3).
        light: Radiance times projected solid angle, (s, j, k).
    """

    screen: Screen
    wi: Float[np.ndarray, "s k 3"]
    wo: Float[np.ndarray, "s k 3"]
    light: Float[np.ndarray, "s j k"]

    __repr__ = brief


def radiance(w: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "..."]:
    """L_e of the environment from direction w (viewer's axes): overcast sky, ground, and two soft windows.

    Sky: (1 + 2 sin γ)/3 at the elevation γ over the horizontal plane y = 0 (Moon & Spencer 1942; the CIE standard
    overcast sky). Windows: L exp(κ(w·c − 1)), 6° in standard deviation.
    """
    up = w[..., 1]
    total = np.where(up > 0.0, (1.0 + 2.0 * up) / 3.0, GROUND)
    for angle, azimuth, sharpness, brightness in WINDOWS:
        centre = frame(np.deg2rad(angle), np.deg2rad(azimuth))[2]
        total += brightness * np.exp(sharpness * (w @ centre - 1.0))
    return total


def frame(theta: float, azimuth: float) -> Float[np.ndarray, "3 3"]:
    """Rows: two tangents and the normal, theta away from the viewer, who has azimuth 0 in it.

    Args:
        theta: Angle of the normal from the viewer, radians.
        azimuth: Direction of the normal on the screen, radians.
    """
    sin, cos, across, along = np.sin(theta), np.cos(theta), np.sin(azimuth), np.cos(azimuth)
    return np.array([[-cos * along, -cos * across, sin], [across, -along, 0.0], [sin * along, sin * across, cos]])


def tangents(normals: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m 3 3"]:
    """Rows: the tangent along the parallel about the vertical axis y, the one along the meridian, and the normal."""
    x, y, z = normals.T
    across = np.sqrt(np.maximum(x * x + z * z, 1e-24))
    along = np.stack([z, 0.0 * y, -x], axis=1) / across[:, None]
    return np.stack([along, np.cross(normals, along), normals], axis=1)


def lit(width: float, angle: float, azimuth: float, *, isotropic: bool) -> Lit:
    """Pixels that crowd around the normal that mirrors the light to the viewer, on the scale of the lobe's width.

    The rings are those of `quadrature.facets`, the micro-normals taken for normals of the sphere: a highlight is seen
    by as many pixels whatever its size. On a ring, Gauss over what is seen and lit.

    Args:
        width: Slope-like width of the narrowest lobe.
        angle: Of the light from the viewer, degrees.
        azimuth: Of the light on the screen, degrees.
        isotropic: Whether both models are, so that one side of the plane of light and viewer is enough.
    """
    sides = 1 if isotropic else 2
    half, turn = np.deg2rad(angle / 2.0), np.deg2rad(azimuth)
    spots = facets(0.0, width, nodes=(LIGHT_RINGS, 1))
    rings = zenith(spots.h)
    along, shares = gauss(LIGHT_PIXELS)
    solid = (spots.solid / (sides * np.pi) * reach(rings, half))[:, None, None] * shares
    solid = np.broadcast_to(solid, (LIGHT_RINGS, sides, LIGHT_PIXELS))
    screen = Screen(frame(half, turn), half, rings, along, solid)
    surface = tangents(screen.normals.reshape(-1, 3))
    screen = dataclasses.replace(screen, area=solid * np.maximum(screen.normals[..., 2], 0.0))
    return Lit(screen, surface @ frame(2.0 * half, turn)[2], surface[:, :, 2])


def surrounded(width: float, *, isotropic: bool, finer: int = 1) -> Surrounded:
    """Rings of pixels with a rule over the light that is dense around each pixel's mirror direction.

    The rule of `quadrature.lobe_rule` around the viewer gives the directions to the light. The models of isotropic
    surfaces need one rule a ring, on one side of the plane of view: the light of both sides is averaged.

    Args:
        width: Slope-like width of the narrowest lobe.
        isotropic: Whether both models are.
        finer: How many times as many rings, and pixels on each.
    """
    return _surrounded(stepped(width, 2), isotropic, finer)


@functools.lru_cache(16)
def _surrounded(width: float, isotropic: bool, finer: int) -> Surrounded:
    count, pixels = (finer * n for n in ((SKY_RINGS, SKY_PIXELS) if isotropic else (COARSE_RINGS, COARSE_PIXELS)))
    nodes, weights = gauss(count)
    square = 1.0 - GRAZING**2
    rings, along = np.arcsin(np.sqrt(square * (nodes + 1.0) / 2.0)), (2.0 * np.arange(pixels) + 1.0) / pixels - 1.0
    area = np.pi * square * weights[:, None, None] / (4.0 * pixels) * np.ones((2, pixels))
    screen = Screen(np.eye(3), 0.0, rings, along, area)
    normals = screen.normals.reshape(-1, 3)
    if isotropic:
        rules = [lobe_rule(ring, width, nodes=SKY_NODES) for ring in rings]
        turns = np.arctan2(normals[:, 1], normals[:, 0]).reshape(count, -1)
        light = np.stack([_both_sides(*each) for each in zip(rules, rings, turns, strict=True)])
    else:
        surface = tangents(normals)
        turns, each = np.arctan2(surface[:, 1, 2], surface[:, 0, 2]), np.repeat(rings, 2 * pixels)
        rules = [lobe_rule(t, width, phi_i=turn, nodes=COARSE_NODES) for t, turn in zip(each, turns, strict=True)]
        seen = zip(rules, surface, strict=True)
        light = np.stack([(radiance(rule.wo @ axes) * rule.weight)[None] for rule, axes in seen])
    wi, wo = np.stack([rule.wi for rule in rules]), np.stack([rule.wo for rule in rules])
    return Surrounded(screen, wo, np.broadcast_to(wi[:, None], wo.shape), light)


def _both_sides(rule: Rule, ring: float, turns: Float[np.ndarray, " j"]) -> Float[np.ndarray, "j k"]:
    """The light that pixels of one ring see at the nodes of a rule, those of both sides averaged, with its weight."""
    surface = np.stack([frame(ring, turn) for turn in turns])
    sides = radiance(rule.wo @ surface), radiance(rule.wo * [1.0, -1.0, 1.0] @ surface)
    return (sides[0] + sides[1]) / 2.0 * rule.weight
