"""Portraits: a picture of a material on a ball, from our own values, without a measurement and without a GPU.

It fits nothing and compares nothing; lights and pixels are those of `match.appearance`.
"""

import dataclasses
import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from fitmat import arguments
from fitmat.colour.channels import colouring
from fitmat.colour.spaces import FROM_SRGB, to_srgb
from fitmat.errors import ModelError, OutputError
from fitmat.exports.material import Material, chosen
from fitmat.extras import needed
from fitmat.files import write_bytes
from fitmat.match.appearance import scene, spheres
from fitmat.match.appearance.scene import Raster
from fitmat.maths.parts import slices
from fitmat.measurements.samples import default_channels
from fitmat.models.base import AbstractBRDF, AbstractEstimated, Sum
from fitmat.models.parameters import entries, vector
from fitmat.text import brief

Light = str | tuple[float, float]
"""A key of `LIGHTS`; or degrees from the viewer, and on the screen, counter-clockwise from the right."""

SKY = "sky"
LIGHTS = {name.removesuffix(" light"): place for name, place in scene.LIGHTS.items()}
"""Lights of one direction, each of irradiance π on a surface that faces it; the zenith of the sky has radiance 1."""

SIZES = (16, 512)
"""Pixels along a side."""

POINTS = 2**18
"""As many are computed at a time."""

FINER = 2
"""How much finer than for the comparison of two models the sky is resolved."""

KIND, LINEAR = ".png", ".exr"


@dataclasses.dataclass(frozen=True, eq=False)
class Portrait:
    """A picture of a material.

    Attributes:
        name: Of the model.
        words: In which light, and what the channels were taken for, as sentences.
        radiance: Linear sRGB, (h, w, 3), rows from the top; 0 beside the ball.
        opacity: Share of each pixel that sees the ball, (h, w).
        exposure: Factor from radiance to display, where 1 is white and what is brighter is cut.
    """

    name: str
    words: str
    radiance: Float[np.ndarray, "h w 3"]
    opacity: Float[np.ndarray, "h w"]
    exposure: float

    __repr__ = brief

    def __str__(self) -> str:
        """What it shows, and how it is displayed."""
        return f"{self.name}: {self.words} Exposure {self.exposure:.3g}; cut at white; sRGB."

    def png(self) -> bytes:
        """The picture in sRGB, the background transparent."""
        from PIL import Image

        shown = to_srgb(self.exposure * self.radiance @ FROM_SRGB.T)
        picture = np.round(255.0 * np.concatenate([shown, self.opacity[..., None]], axis=2)).astype(np.uint8)
        file = io.BytesIO()
        Image.fromarray(picture).save(file, "PNG", optimize=True)
        return file.getvalue()

    def _repr_png_(self) -> bytes:
        return self.png()

    def save(self, path: str | os.PathLike[str], *, hdr: bool = False) -> tuple[Path, ...]:
        """Write the picture, and beside it the linear radiances as OpenEXR.

        Args:
            path: Where to; it ends in .png.
            hdr: Whether to write NAME.exr too, radiances without exposure.

        Raises:
            OutputError: another ending, or it cannot be written.
            FitmatError: `hdr` without the package OpenEXR.
        """
        arguments.kind("path", path, str, os.PathLike)
        arguments.flags(hdr=hdr)
        file, *linear = picture_files(Path(path), hdr=hdr, force=True)
        for beside in linear:
            self._save_linear(beside)
        return write_bytes(file, self.png()), *linear

    def _save_linear(self, file: Path) -> None:
        writer = needed("OpenEXR", "A picture with --hdr")
        pixels = np.concatenate([self.radiance * self.opacity[..., None], self.opacity[..., None]], axis=2)
        header = {"compression": writer.ZIP_COMPRESSION, "type": writer.scanlineimage}
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            writer.File(header, {"RGBA": pixels.astype(np.float32)}).write(str(file))
        except (OSError, RuntimeError) as error:
            raise OutputError(f"{file}: cannot be written ({error}); choose another place.") from error


def render(
    material: Material,
    light: Light | Sequence[Light] = ("side", SKY),
    *,
    model: str | None = None,
    size: int = 256,
    exposure: float | None = None,
) -> Portrait:
    """A picture of a material: a ball, seen from far away, under one or several lights.

    L = Σ π f c_i of the lights that have one direction, and ∫ f L_e c_i dω of the sky: overcast, over ground of albedo
    0.2, with two soft windows. No shadow, no light is reflected twice. A brushed surface is turned about the vertical
    axis. What a polished coat mirrors is no value of f, and is not in the picture.

    Args:
        material: A model, a fit, a study, or the result of one from `fitmat.load`.
        light: "front", "side", "rim", "sky", two angles in degrees (from the viewer; on the screen, counter-clockwise
            from the right), or several of these.
        model: Which model of a study; None for the one that the data prefer.
        size: Pixels along a side, 16 to 512.
        exposure: Factor from radiance to display; None for the one that makes the mean luminance of what is lit 0.18.

    Raises:
        ModelError: the model has no formula, or there is no such model.
        FitmatError: an argument is none of these.

    Example:
        >>> import fitmat as fm
        >>> picture = render(fm.model("lambert", kd=0.5), "front", size=16)
        >>> picture.radiance.shape, len(picture.save("ball.png"))  # doctest: +SKIP
        ((16, 16, 3), 1)
    """
    arguments.kind("light", light, str, tuple, list)
    lights = _lights(light)
    arguments.whole("size", size, SIZES[0])
    if size > SIZES[1]:
        arguments.refuse("size", size, f"at most {SIZES[1]} pixels")
    arguments.real("exposure", exposure, optional=True)
    if exposure is not None and exposure <= 0.0:
        arguments.refuse("exposure", exposure, "a factor above 0")
    one = chosen(material, model)
    surface = one.model
    if any(isinstance(part, AbstractEstimated) for part in (surface.lobes if isinstance(surface, Sum) else (surface,))):
        raise ModelError(f"{surface.name} is estimated and has no formula to draw it with; ggx-kc has.")
    count = max((e.size for e in entries(surface)), default=1)
    colours = colouring(one.channels or default_channels(count))
    points = scene.raster(size)
    xyz = sum(_lit(surface, each, points, colours.weights) for each in lights)
    xyz = np.nan_to_num(np.asarray(xyz))
    luminance = xyz[..., 1][xyz[..., 1] > 0.0]
    found = spheres.MIDDLE_GREY / luminance.mean() if luminance.size else 1.0
    linear = np.where(points.opacity[..., None] > 0.0, xyz @ np.linalg.inv(FROM_SRGB).T, 0.0)
    words = f"{_listed(lights)}; {colours.words}."
    return Portrait(surface.name, words, linear, points.opacity, float(found if exposure is None else exposure))


def picture_files(path: Path, *, hdr: bool, force: bool) -> list[Path]:
    """Where a portrait is written: the picture, and the linear radiances if they are wanted.

    Raises:
        OutputError: a file exists and `force` is off, or the picture has another ending than .png.
    """
    if path.suffix.lower() != KIND:
        raise OutputError(f"{path}: no picture, expected a name that ends in {KIND}. Rename it.")
    found = [path, path.with_suffix(LINEAR)] if hdr else [path]
    for file in found:
        if os.path.lexists(file) and not force:
            raise OutputError(f"{file}: already exists; choose another name, or --force to replace it.")
    return found


def _lights(light: Light | Sequence[Light]) -> list[Light]:
    """Each light, checked."""
    one = isinstance(light, str) or any(isinstance(part, int | float) for part in light)
    several: list[Any] = [light] if one else list(light)
    for each in several or [light]:
        if not _is_light(each):
            wanted = f"one of {', '.join(LIGHTS)}, {SKY}, or two angles in degrees, the first up to 180"
            raise ModelError(f"light is {each!r}, expected {wanted}.")
    return several


def _is_light(given: object) -> bool:
    if isinstance(given, str):
        return given in LIGHTS or given == SKY
    if not isinstance(given, tuple | list) or len(given) != 2:
        return False
    return all(isinstance(a, int | float) and np.isfinite(a) for a in given) and 0.0 <= given[0] <= 180.0


def _listed(lights: Sequence[Light]) -> str:
    places = [LIGHTS[each] if isinstance(each, str) and each in LIGHTS else each for each in lights]
    words = [f"a light {p[0]:g}° from the viewer at {p[1]:g}° on the screen" for p in places if not isinstance(p, str)]
    return " and ".join([*words, *(["a sky with two windows"] if SKY in lights else [])]).capitalize()


def _lit(
    model: AbstractBRDF, light: Light, points: Raster, weights: Float[np.ndarray, "c 3"]
) -> Float[np.ndarray, "h w 3"]:
    """XYZ radiances in one light."""
    part = model, np.asarray(vector(model), float)[None]
    if light == SKY:
        around = scene.surrounded(float(model.width()), isotropic=model.isotropic, finer=FINER)
        return spheres.pictured(around.screen, spheres.under_sky(part, around, weights)[0], points)
    angle, direction = LIGHTS[light] if isinstance(light, str) else light
    towards, found = scene.frame(np.deg2rad(angle), np.deg2rad(direction))[2], []
    for some in slices(len(points.normals), POINTS):
        surface = scene.tangents(points.normals[some])
        wi, wo = surface @ towards, surface[:, :, 2]
        lit = np.flatnonzero(wi[:, 2] > 0.0)
        xyz = np.zeros((len(wi), 3))
        if len(lit):
            xyz[lit] = np.pi * spheres.under_light(part, wi[lit], wo[lit], weights)[0]
        found.append(xyz)
    return points.mean(np.concatenate(found))
