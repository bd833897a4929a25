"""Noisy: a surface and the noise with which it was measured, where that is to be inferred beside it.

It changes no value: the likelihood reads the noise.
"""

import jax.numpy as jnp

from fitmat._types import Samples, Scalar, Spectrum, Vec3
from fitmat.maths.arrays import library
from fitmat.models.around.shown import AbstractShown
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import param

LEAST_ABSOLUTE, LEAST_RELATIVE = 1e-9, 1e-5
"""Lower bounds of the two parts of the noise."""


class Noisy(AbstractShown):
    """A base whose measurements scatter with σ² = a² + (b ȳ)², ȳ the level that neighbouring angles show.

    Parameters: absolute noise a in sr⁻¹, relative noise b; and those of the base.

    Reference: D. W. Hogg, J. Bovy, D. Lang, Data analysis recipes: fitting a model to data, 2010, section 8.
    """

    base: AbstractBRDF
    absolute: Scalar = param(
        LEAST_ABSOLUTE, 1e3, symbol="a", unit="1/sr", scale="log", default=1e-3, starts=(1e-3,),
        doc="noise that every value has",
    )  # fmt: skip
    relative: Scalar = param(
        LEAST_RELATIVE, 10.0, symbol="b", scale="log", default=0.03, starts=(0.03,),
        doc="noise as a fraction of the value",
    )  # fmt: skip

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """That of the base."""
        return self.base(wi, wo)

    def sigma(self, level: Samples) -> Samples:
        """σ in sr⁻¹ at the levels ȳ, (n, c)."""
        return library(level, self.absolute).sqrt(self.absolute**2 + (self.relative * level) ** 2)

    @staticmethod
    def least_sigma(level: Samples) -> Samples:
        """What σ stays above whatever the parameters, (n, c)."""
        return 0.5 * jnp.sqrt(LEAST_ABSOLUTE**2 + (LEAST_RELATIVE * level) ** 2)
