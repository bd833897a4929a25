"""Cook and Torrance's model of 1982 with its own constants."""

import equinox as eqx
import jax.numpy as jnp

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.brdf.base import AbstractBRDF
from fitmat.fresnel import AbstractFresnel, Dielectric
from fitmat.geometry import above, cos_difference, half_vector
from fitmat.microfacet import Beckmann, Masking, visibility
from fitmat.params import param


class CookTorrance(AbstractBRDF):
    """Cook & Torrance 1982, with the constants of the paper.

    f = ks F(c_d) D'(h) G(ω_i, ω_o)/(π c_i c_o),  D' = exp(−tan²θ_h/m²)/(m² c_h⁴)

    Parameters: ks, weight of the lobe, 0 to 10, per channel with the exact dielectric, shared with Schlick and
    conductor; alpha, the paper's slope m, 0.0001 to 1, shared: 0.1 is satin, 0.5 dull; and the Fresnel level: eta
    (exact dielectric, shared), or f0 (`-schlick`, per channel), or eta and kappa (`-conductor`, per channel).

    Static choice: masking = "v-cavity" (the paper's, the default), "correlated", "separable".

    Limits: D' lacks the 1/π of a normalised Beckmann distribution and the denominator has π where Walter's has 4, so
    the lobe is **four times** Walter's with the same parameters: with ks = 1 it can reflect more than it receives.
    `beckmann` with masking "v-cavity" is the energy-conserving form. Positive and reciprocal.

    Reference: R. Cook & K. Torrance, A reflectance model for computer graphics, ACM TOG 1(1), 1982.

    Example: `fm.model("lambert+cook-torrance", kd=0.3, ks=0.25, alpha=0.2, eta=1.5)`
    """

    ks: Spectrum = param(0.0, 10.0, symbol="k_s", per_channel=True, weight=True, default=1.0, doc="specular weight")
    alpha: Scalar = param(
        1e-4, 1.0, symbol="m", scale="log", default=0.3,
        starts=(0.002, 0.005, 0.01, 0.02, 0.04, 0.08, 0.15, 0.25, 0.4, 0.7),
        doc="root-mean-square slope of the facets, the paper's m",
    )  # fmt: skip
    fresnel: AbstractFresnel = eqx.field(default_factory=Dielectric)
    masking: Masking = eqx.field(static=True, default="v-cavity")

    @property
    def name(self) -> str:
        """`cook-torrance` with the Fresnel suffix."""
        return "cook-torrance" + self.fresnel.suffix

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """ks F D' G/(π c_i c_o), where D' = π D of the normalised Beckmann distribution."""
        h, cos_d = half_vector(wi, wo), cos_difference(wi, wo)
        density = jnp.pi * Beckmann().density(h, self.alpha)
        g_cc = visibility(Beckmann(), self.masking, self.alpha, (wi[2], wo[2], h[2], cos_d))
        return jnp.where(above(wi, wo), self.ks * self.fresnel(cos_d) * density * g_cc / jnp.pi, 0.0)

    def width(self) -> Scalar:
        """Alpha itself."""
        return self.alpha
