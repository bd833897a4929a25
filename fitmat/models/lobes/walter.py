"""Walter's reflection of 2007 with its own constants: separable masking, and for Beckmann the rational G1."""

from typing import ClassVar

import equinox as eqx

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.models.base import AbstractSpecular, specular_weight
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.terms.distributions import GGX, AbstractDistribution, Isotropic
from fitmat.models.terms.fresnel import AbstractFresnel, Dielectric


class Walter(AbstractSpecular):
    """Walter et al. 2007, reflection, as printed: GGX (`walter-ggx`) or Beckmann (`walter-beckmann`) normals.

    f = ks F(c_d) D(h) G1(ω_i) G1(ω_o)/(4 c_i c_o)

    Parameters: ks, weight of the lobe, 0 to 10, per channel; alpha, the paper's width parameter α_g or α_b, 0.0001
    to 1, shared; eta, index of refraction of the exact dielectric (the paper's eq. 22), shared.

    Limits: the masking is separable (eq. 23), which for rough surfaces at grazing angles is darker than the
    height-correlated form of `ggx` (2 % at 75°/69° for alpha 0.3); Beckmann's G1 is the paper's rational
    approximation, off by at most 0.35 %. Single scattering. Positive, reciprocal, conserves energy for ks ≤ 1.

    Reference: B. Walter, S. Marschner, H. Li & K. Torrance, Microfacet models for refraction through rough surfaces,
    EGSR 2007, eqs. 20, 22, 23, 25–28, 33–34.

    Example: `fm.model("lambert+walter-ggx", kd=0.3, alpha=0.2, eta=1.5)`
    """

    label: ClassVar[str] = "walter-{distribution.label}"

    ks: Spectrum = specular_weight()
    roughness: Isotropic = eqx.field(default_factory=Isotropic)
    fresnel: AbstractFresnel = eqx.field(default_factory=Dielectric)
    distribution: AbstractDistribution = eqx.field(default_factory=GGX)

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """Eq. 20 with separable masking."""
        return self._single()(wi, wo)

    def _single(self) -> Microfacet:
        return Microfacet(self.ks, self.roughness, self.fresnel, self.distribution, "separable")

    def glsl(self) -> str:
        """The same."""
        return self._single().glsl()

    def width(self) -> Scalar:
        """Alpha itself."""
        return self.roughness.alpha
