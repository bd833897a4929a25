"""Tilt: a sample that is not quite level in its mount."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

import jax.numpy as jnp

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import COS_MIN, above
from fitmat.models.around.shown import AbstractShown
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import param


def _tilt(symbol: str, axis: str) -> Scalar:
    return param(
        -15.0, 15.0, symbol=symbol, unit="°", default=0.0, starts=(0.0,),
        doc=f"angle by which the normal leans towards +{axis}; a careful mount stays below 0.5°",
    )  # fmt: skip


class Tilted(AbstractShown):
    """A base whose normal leans: `tilt-over-BASE`, what `fitmat fit --tilt` fits.

    f = f_b(R ω_i, R ω_o) (n′·ω_i)/c_i,  n′ = (tan t_x, tan t_y, 1) normalised

    R turns the sample's true normal n′ into +z by the shortest way. The cosine ratio is there because the instrument
    divides by the irradiance on a level sample. In the words of the surface gradient, the height h has the slope
    ∇h = −(tan t_x, tan t_y) and n′ = (n − ∇h) normalised.

    Parameters: tilt_x and tilt_y, −15° to 15°, shared; and those of the base. x is the azimuth 0 of the measurements.

    Limits: at tilt 0 the base itself. Measurements in one plane only determine the tilt within that plane: fix the
    other one (`--fix tilt_y=0`). Positive; neither reciprocal nor bounded by 1 in albedo, since only the
    illumination's cosine is corrected for.

    Reference: M. Mikkelsen, Surface gradient-based bump mapping framework, JCGT 9(3), 2020.

    Example: `fm.model("tilt-over-lambert+ggx", kd=0.3, alpha=0.05, tilt_x=0.4)`
    """

    breaks: ClassVar[Mapping[str, str]] = MappingProxyType(
        {
            "reciprocal": "the value is per irradiance of a level sample: only the light's cosine is corrected for",
            "energy": "a slope of 15° to the light catches more than a level one: at 85° cos 70°/cos 85° = 3.92",
        }
    )

    prefix: ClassVar[str] = "tilt-over-"
    level: ClassVar[bool] = False

    base: AbstractBRDF
    tilt_x: Scalar = _tilt("t_x", "x")
    tilt_y: Scalar = _tilt("t_y", "y")

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """The base in the tilted frame, per irradiance of the level one."""
        light, sensor = (self._local(w) for w in (wi, wo))
        ratio = light[2] / jnp.maximum(wi[2], COS_MIN)
        return jnp.where(above(wi, wo), self.base(light, sensor) * ratio, 0.0)

    def mirror(self, wi: Vec3) -> Spectrum:
        """That of the base in the tilted frame, per irradiance of the level one."""
        light = self._local(wi)
        seen = jnp.where(light[2] > 0.0, self.base.mirror(light), 0.0)
        return seen * light[2] / jnp.maximum(wi[2], COS_MIN)

    def _local(self, w: Vec3) -> Vec3:
        """w turned so that n′ becomes e = +z: w − ((n′+e)·w)/(1 + n′·e) (n′+e) + 2 (n′·w) e, two reflections."""
        n = jnp.stack([jnp.tan(jnp.deg2rad(self.tilt_x)), jnp.tan(jnp.deg2rad(self.tilt_y)), jnp.ones(())])
        n = n / jnp.sqrt(n @ n)
        between = n + jnp.array([0.0, 0.0, 1.0])
        turned = w - (between @ w) / (1.0 + n[2]) * between
        return turned + jnp.array([0.0, 0.0, 2.0]) * (n @ w)
