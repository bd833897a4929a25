"""Cook and Torrance's model of 1982 with its own constants."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import above, pair
from fitmat.models.base import AbstractSpecular, specular_weight
from fitmat.models.terms.distributions import VISIBILITY, Beckmann, Isotropic, Masking, visibility
from fitmat.models.terms.fresnel import AbstractFresnel, Dielectric


class CookTorrance(AbstractSpecular):
    """Cook & Torrance 1982, with the constants of the paper.

    f = ks F(c_d) D'(h) G(ω_i, ω_o)/(π c_i c_o),  D' = exp(−tan²θ_h/m²)/(m² c_h⁴)

    Parameters: ks, weight of the lobe, 0 to 10, per channel with the exact dielectric, shared with Schlick and
    conductor; alpha, the paper's slope m, 0.0001 to 1, shared: 0.1 is satin, 0.5 dull; and the Fresnel level: eta
    (exact dielectric, shared), f0 (`-schlick`, per channel), f0 and f82 (`-f82`), or eta and kappa (`-conductor`,
    `-belcour`, per channel).

    Static choice: masking = "v-cavity" (the paper's, the default), "correlated", "separable".

    Limits: D' lacks the 1/π of a normalised Beckmann distribution and the denominator has π where Walter's has 4, so
    the lobe is **four times** Walter's with the same parameters: with ks = 1 it can reflect more than it receives.
    `beckmann` with masking "v-cavity" is the energy-conserving form. Positive and reciprocal.

    Reference: R. Cook & K. Torrance, A reflectance model for computer graphics, ACM TOG 1(1), 1982.

    Example: `fm.model("lambert+cook-torrance", kd=0.3, ks=0.25, alpha=0.2, eta=1.5)`
    """

    label: ClassVar[str] = "cook-torrance{fresnel.suffix}"
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType(
        {"energy": "with ks = 1 it reflects up to 4 F0 of the light: D' = π D, and π where Walter has 4"}
    )

    ks: Spectrum = specular_weight()
    roughness: Isotropic = eqx.field(default_factory=Isotropic)
    fresnel: AbstractFresnel = eqx.field(default_factory=Dielectric)
    masking: Masking = eqx.field(static=True, default="v-cavity")

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """ks F D' G/(π c_i c_o), where D' = π D of the normalised Beckmann distribution."""
        p, slopes = pair(wi, wo), self.roughness.slopes
        density = jnp.pi * Beckmann().density(p.h, slopes)
        g_cc = visibility(Beckmann(), self.masking, slopes, p)
        return jnp.where(above(wi, wo), self.ks * self.fresnel(p.cos_d) * density * g_cc / jnp.pi, 0.0)

    def glsl(self) -> str:
        """The same."""
        return (
            Beckmann().glsl()
            + VISIBILITY[self.masking]
            + """
vec3 lobe(vec3 wi, vec3 wo) {
    Pair p = facets(wi, wo);
    float D = PI * density(p.h);  // exp(-tan^2(theta_h)/m^2)/(m^2 c_h^4): no 1/pi, as printed
    return ks * fresnel(p.cos_d) * D * visibility(p) / PI;  // visibility is G/(c_i c_o)
}
"""
        )

    def width(self) -> Scalar:
        """Alpha itself."""
        return self.roughness.alpha
