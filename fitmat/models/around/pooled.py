"""Pooled: one surface as several laboratories show it, each in a scale of its own."""

import jax.numpy as jnp

from fitmat._types import Spectrum, Vec3
from fitmat.models.around.shown import AbstractShown
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import param


class Pooled(AbstractShown):
    """A base of one channel, as many channels as there are laboratories: f_l = g_l f_b.

    Parameters: factor g_l of each laboratory. Of the base's weights and the factors only the products are determined;
    a prior of the factors settles it.
    """

    base: AbstractBRDF
    factor: Spectrum = param(
        1e-3, 1e3, symbol="g", scale="log", per_channel=True, starts=(1.0,),
        doc="scale of one laboratory; 1 where its calibration is right",
    )  # fmt: skip

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """That of the base in each scale."""
        return jnp.reshape(self.base(wi, wo), -1) * self.factor
