"""The Lambert model: a perfectly diffuse surface."""

from typing import ClassVar

import jax.numpy as jnp

from fitmat._types import Spectrum, Vec3
from fitmat.maths.directions import above
from fitmat.models.base import AbstractDiffuse
from fitmat.models.parameters import param


class Lambert(AbstractDiffuse):
    """Lambert: the same radiance in every direction.

    f = kd/π

    Parameters: kd, the albedo, 0 to 1, per channel; 0.1 is dark grey paper, 0.8 a white wall.

    Limits: kd = 0 is black, kd = 1 reflects all light. Positive, reciprocal, conserves energy.

    Reference: J. H. Lambert, Photometria, 1760.

    Example: `fm.model("lambert", kd=0.5)`
    """

    label: ClassVar[str] = "lambert"

    kd: Spectrum = param(
        0.0, 1.0, symbol="k_d", per_channel=True, weight=True, default=0.5, doc="diffuse albedo"
    )  # fmt: skip

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """kd/π."""
        return jnp.where(above(wi, wo), self.kd / jnp.pi, 0.0)

    def glsl(self) -> str:
        """The same."""
        return """
vec3 lobe(vec3 wi, vec3 wo) {
    return kd / PI;
}
"""
