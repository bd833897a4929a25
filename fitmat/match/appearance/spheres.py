"""What an eye sees: a sphere of each model under the same lights, and how different its colours look.

It fits nothing and judges no measurement; lights and pixels are those of `scene`.

A pixel with normal n shows L = f max(n·l, 0), in the environment L = ∫ f L_e (n·ω) dω. The exposure makes the mean
luminance of the microfacet model's best fit `MIDDLE_GREY`, for each light anew: both models and all draws are seen by
the same camera.
"""

import bisect
import dataclasses
import functools
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from fitmat.colour.channels import colouring
from fitmat.colour.differences import (
    CLEARLY_VISIBLE,
    JUST_NOTICEABLE,
    delta_e_2000,
    delta_e_itp,
    greys_2000,
    greys_itp,
)
from fitmat.colour.spaces import FROM_SRGB, shown, to_srgb
from fitmat.match.appearance import finer, scene
from fitmat.match.appearance.scene import Raster, Screen
from fitmat.match.appearance.spread import Seen, Spread, spread, worst_twentieth
from fitmat.match.distances import PairedDraws
from fitmat.maths.directions import zenith
from fitmat.models.base import AbstractBRDF
from fitmat.models.values import Draws, blocks, surfaces, values, widths
from fitmat.text import brief

SPHERE_DRAWS = 20
"""Pairs of posterior draws behind every interval."""

MIDDLE_GREY = 0.18
"""Mean luminance of the lit part of the reference, white being 1: that of a photographer's grey card."""

SEES = ("see no difference", "hardly see a difference", "clearly see a difference")
"""What is said below, between and above `JUST_NOTICEABLE` and `CLEARLY_VISIBLE`."""

SIZE = 72
"""Pictures are so many pixels wide."""

Part = tuple[Float[np.ndarray, "... k"], Float[np.ndarray, "... k"], Float[np.ndarray, " m"]]
"""XYZ of both spheres, or the luminances of greys, and the share of each place in the lit area."""


@dataclasses.dataclass(frozen=True, eq=False)
class Lighting:
    """Both spheres in one light.

    Attributes:
        name: Of the light.
        exposure: Factor from radiance (irradiance 1 on a surface that faces the light; sky zenith 1) to display.
        parts: What is seen: of d draws at the pixels, and of the best fits at parts of pixels, twice; see `Seen`.
        pictures: Of the best fits; None where they were not asked for.
    """

    name: str
    exposure: float
    parts: tuple[Part, Part, Part]
    pictures: "Pictures | None"

    __repr__ = brief

    @functools.cached_property
    def seen_2000(self) -> Seen:
        """CIEDE2000 at the pixels."""
        return _seen(self.parts, _shown_apart)

    @functools.cached_property
    def seen_itp(self) -> Seen:
        """ΔE_ITP at the pixels."""
        return _seen(self.parts, _apart)

    @functools.cached_property
    def delta_e_2000(self) -> Spread:
        """CIEDE2000 of what an sRGB display shows, which clips what is brighter than white."""
        return spread([self.seen_2000])

    @functools.cached_property
    def delta_e_itp(self) -> Spread:
        """ΔE_ITP with white at `differences.WHITE_LUMINANCE`, highlights up to 10,000 cd/m²."""
        return spread([self.seen_itp])


@dataclasses.dataclass(frozen=True, eq=False)
class Pictures:
    """Both spheres as pictures, rows from the top; NaN beside the sphere.

    Attributes:
        empirical: In sRGB from 0 to 1, (h, w, 3).
        microfacet: The same of the microfacet model.
        difference: ΔE2000 of the two, (h, w).
    """

    empirical: Float[np.ndarray, "h w 3"]
    microfacet: Float[np.ndarray, "h w 3"]
    difference: Float[np.ndarray, "h w"]

    __repr__ = brief


@dataclasses.dataclass(frozen=True, eq=False)
class Perceived:
    """What an eye sees of the difference between two models.

    Attributes:
        names: Of the empirical and of the microfacet model.
        lightings: Light by light.
        colours: In words, what the channels were taken for.
    """

    names: tuple[str, str]
    lightings: tuple[Lighting, ...]
    colours: str

    __repr__ = brief

    @functools.cached_property
    def delta_e_2000(self) -> Spread:
        """Of all lightings together, each with the same share."""
        return spread([lighting.seen_2000 for lighting in self.lightings])

    @functools.cached_property
    def delta_e_itp(self) -> Spread:
        """The same."""
        return spread([lighting.seen_itp for lighting in self.lightings])

    @property
    def words(self) -> str:
        """One sentence; the thresholds are `JUST_NOTICEABLE` and `CLEARLY_VISIBLE`, for the worst twentieth."""
        by_light = sorted(self.lightings, key=lambda lighting: worst_twentieth(lighting.seen_2000))
        every, least, most = self.delta_e_2000, by_light[0], by_light[-1]
        worst = every.worst_twentieth
        least_seen, limit = worst.ci95 if worst.has_interval else (worst.value, worst.value)
        low, high = (bisect.bisect_right((JUST_NOTICEABLE, CLEARLY_VISIBLE), end) for end in (least_seen, limit))
        sees = SEES[low] if low == high else f"{SEES[low]} or {SEES[high]}, which the data leave open"
        where = f", most under the {most.name}, least under the {least.name}" if limit >= JUST_NOTICEABLE else ""
        numbers = f"ΔE2000 {every.mean.value:.1f} on average, {every.worst_twentieth.value:.1f} in the worst twentieth"
        return f"On a lit sphere an eye would {sees}{where} ({numbers})."


def perceived(
    empirical: AbstractBRDF,
    microfacet: AbstractBRDF,
    draws: PairedDraws,
    channels: tuple[str, ...],
    *,
    pictures: bool = True,
) -> Perceived:
    """Both models' spheres in every light, and what an eye sees of their difference.

    Lobes of any width are resolved: the pixels of a light crowd around the normal that mirrors it to the viewer
    (`quadrature.facets`), the incident directions of the environment around the mirror direction (`lobe_rule`), both
    on the scale of the narrowest lobe of all draws.

    Args:
        empirical: The fitted model; only its surface counts, not the instrument.
        microfacet: The reference.
        draws: Parameter vectors of both, paired, rows: the best fits, then posterior draws, (d, p) and (d, q); at
            most `SPHERE_DRAWS` of these are used, evenly spread.
        channels: Names of the channels.
        pictures: Whether to make pictures as well.

    Example:
        >>> import fitmat as fm
        >>> from fitmat.models.parameters import vector
        >>> one, other = fm.model("lambert+phong", kd=0.3), fm.model("lambert+ggx", kd=0.3)
        >>> found = perceived(one, other, (vector(one)[None], vector(other)[None]), ("value",))
        >>> found.colours
        'one channel, drawn grey'
    """
    colours, count = colouring(channels), len(draws[0])
    used = np.unique(np.r_[0, np.linspace(min(1, count - 1), count - 1, min(SPHERE_DRAWS, count)).round().astype(int)])
    pair = surfaces(empirical, draws[0][used]), surfaces(microfacet, draws[1][used])
    screens, computed = _rendered(pair, colours.weights[:, 1:2] if colours.grey else colours.weights)
    names = [*scene.LIGHTS, scene.ENVIRONMENT]
    each = zip(names, screens, computed, strict=True)
    return Perceived(
        names=(pair[0][0].name, pair[1][0].name),
        lightings=tuple(_lighting(name, screen, xyz, pictures) for name, screen, xyz in each),
        colours=colours.words,
    )


def _rendered(
    pair: tuple[Draws, Draws], weights: Float[np.ndarray, "c k"]
) -> tuple[list[Screen], list[Float[np.ndarray, "d 2 m k"]]]:
    """The pixels of each lighting, and XYZ radiances there, or luminances, of both models for d pairs of draws."""
    width = float(min(widths(*part).min() for part in pair))
    isotropic = all(model.isotropic for model, _ in pair)
    spots = [scene.lit(width, *where, isotropic=isotropic) for where in scene.LIGHTS.values()]
    around = scene.surrounded(width, isotropic=isotropic)
    found = [np.stack([under_light(part, spot.wi, spot.wo, weights) for part in pair], axis=1) for spot in spots]
    sky = np.stack([under_sky(part, around, weights) for part in pair], axis=1)
    return [*(spot.screen for spot in spots), around.screen], [*found, sky]


def under_light(
    part: Draws, wi: Float[np.ndarray, "m 3"], wo: Float[np.ndarray, "m 3"], weights: Float[np.ndarray, "c k"]
) -> Float[np.ndarray, "d m k"]:
    """Weighted radiances of every draw in a light of one direction, of irradiance 1 on a surface that faces it."""
    return _coloured(values(*part, wi, wo), weights) * wi[:, 2:]


def under_sky(part: Draws, around: scene.Surrounded, weights: Float[np.ndarray, "c k"]) -> Float[np.ndarray, "d m k"]:
    """Weighted radiances of every draw in the environment."""
    found = np.zeros((len(part[1]), *around.light.shape[:2], weights.shape[1]))
    for rows, k, (f,) in blocks([part], list(zip(around.wi, around.wo, strict=True))):
        found[rows, k] = np.tensordot(_coloured(f, weights), around.light[k], axes=(1, 1)).transpose(0, 2, 1)
    return found.reshape(len(found), -1, weights.shape[1])


def _coloured(f: Float[np.ndarray, "d m c"], weights: Float[np.ndarray, "c k"]) -> Float[np.ndarray, "d m k"]:
    """Values in the channels, weighted; of a model with one value for all where there are several."""
    if f.shape[2] == len(weights) == 1:
        return f * weights[0]  # as good as a product of matrices, and ten times as fast
    return np.broadcast_to(f, (*f.shape[:2], len(weights))) @ weights


def _lighting(name: str, screen: Screen, xyz: Float[np.ndarray, "d 2 m k"], pictures: bool) -> Lighting:
    share = np.asarray(screen.area / screen.area.sum()).ravel()
    size = xyz.shape[-1]
    exposure = float(MIDDLE_GREY / max(share @ xyz[0, 1, :, size // 2], 1e-300))
    one, other = np.moveaxis(exposure * xyz, 1, 0)
    both = np.concatenate([one[0], other[0]], axis=1)
    fine, half = finer.divided(screen, both), finer.divided(*finer.halved(screen, both))
    finer_parts = [(v[:, :size], v[:, size:], area / area.sum()) for v, area in (fine, half)]
    return Lighting(
        name=name,
        exposure=exposure,
        parts=((one, other, share), finer_parts[0], finer_parts[1]),
        pictures=_both(screen, one[0], other[0]) if pictures else None,
    )


def _seen(parts: tuple[Part, Part, Part], apart: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Seen:
    (delta, share), fine, half = ((apart(one, other), share) for one, other, share in parts)
    return Seen(delta, share, fine, half)


def _shown_apart(one: Float[np.ndarray, "... k"], other: Float[np.ndarray, "... k"]) -> Float[np.ndarray, "..."]:
    """ΔE2000 of what a display shows, of XYZ or of the luminances of greys."""
    if one.shape[-1] == 1:
        return greys_2000(np.clip(one[..., 0], 0.0, 1.0), np.clip(other[..., 0], 0.0, 1.0))
    return delta_e_2000(shown(one), shown(other))


def _apart(one: Float[np.ndarray, "... k"], other: Float[np.ndarray, "... k"]) -> Float[np.ndarray, "..."]:
    """ΔE_ITP of the same."""
    if one.shape[-1] == 1:
        return greys_itp(one[..., 0], other[..., 0])
    return delta_e_itp(np.maximum(one, 0.0), np.maximum(other, 0.0))


def _both(screen: Screen, one: Float[np.ndarray, "m k"], other: Float[np.ndarray, "m k"]) -> Pictures:
    if one.shape[1] == 1:
        one, other = one * FROM_SRGB.sum(axis=1), other * FROM_SRGB.sum(axis=1)
    drawn = pictured(screen, np.concatenate([one, other], axis=1), scene.raster(SIZE))
    one, other = drawn[..., :3], drawn[..., 3:]
    return Pictures(to_srgb(one), to_srgb(other), delta_e_2000(shown(one), shown(other)))


def pictured(screen: Screen, values: Float[np.ndarray, "m k"], raster: Raster) -> Float[np.ndarray, "h w k"]:
    """Values of a screen's pixels as a picture: between them by linear interpolation; NaN beside the sphere."""
    from scipy.ndimage import map_coordinates

    normals = raster.normals @ np.asarray(screen.axes).T
    theta, turn = zenith(normals), np.arctan2(normals[:, 1], normals[:, 0])
    along = (np.abs(turn) - np.pi / 2) / np.maximum(scene.reach(theta, screen.half), 1e-9)
    ends = np.asarray(screen.along)
    ends = np.r_[-2.0 - ends[0], ends, 2.0 - ends[-1]]  # the next pixel is on the other side of the meridian
    grid = values.reshape(*screen.area.shape, -1)
    grid = np.concatenate([grid[:, ::-1, :1], grid, grid[:, ::-1, -1:]], axis=2)
    middle = np.broadcast_to(grid[:1].mean(axis=(1, 2), keepdims=True), grid[:1].shape)
    grid, rings = np.concatenate([middle, grid]), np.r_[0.0, screen.rings]
    at = np.stack([np.interp(theta, rings, np.arange(len(rings))), np.interp(along, ends, np.arange(len(ends)))])
    found = np.zeros((len(normals), grid.shape[3]))
    for k in range(grid.shape[3]):
        sides = [map_coordinates(grid[:, side, :, k], at, order=1, mode="nearest") for side in (0, -1)]
        found[:, k] = np.where(np.abs(along) <= 1.0, np.where(turn >= 0.0, *sides), 0.0)
    return raster.mean(found)
