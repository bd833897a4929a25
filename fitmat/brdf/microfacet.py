"""Walter's microfacet reflection with GGX or Beckmann normals."""

import equinox as eqx
import jax.numpy as jnp

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.brdf.base import AbstractBRDF
from fitmat.fresnel import AbstractFresnel, Dielectric
from fitmat.geometry import above, cos_difference, half_vector
from fitmat.microfacet import GGX, AbstractDistribution, Masking, visibility
from fitmat.params import param


class Microfacet(AbstractBRDF):
    """Walter et al. 2007, reflection: a surface of tiny mirrors with GGX (`ggx`) or Beckmann (`beckmann`) normals.

    f = ks F(c_d) D(h) G(ω_i, ω_o)/(4 c_i c_o)

    Parameters: ks, weight of the lobe, 0 to 10 (1 for a bare surface; fix it with `--fix ks=1`), per channel with the
    exact dielectric, shared with Schlick and conductor; alpha, slope parameter, 0.0001 to 1, shared: 0.05 is
    glossy plastic, 0.1 satin, 0.5 dull; and the Fresnel level: eta (exact dielectric, shared), or f0
    (`-schlick`, per channel), or eta and kappa (`-conductor`, per channel).

    Static choice: masking = "correlated" (Smith height-correlated, the default), "separable" (Smith, as in Walter
    2007 and Mitsuba 3), "v-cavity" (Cook & Torrance).

    Limits: alpha → 0 is a mirror; single scattering only, so a rough surface (alpha > 0.5) reflects less than it
    should. Positive, reciprocal, conserves energy for ks ≤ 1 with Smith masking.

    References: B. Walter, S. Marschner, H. Li & K. Torrance, Microfacet models for refraction through rough
    surfaces, EGSR 2007; masking: E. Heitz, Understanding the masking-shadowing function, JCGT 3(2), 2014.

    Example: `fm.model("lambert+ggx", kd=0.3, alpha=0.2, eta=1.5)`
    """

    ks: Spectrum = param(0.0, 10.0, symbol="k_s", per_channel=True, weight=True, default=1.0, doc="specular weight")
    alpha: Scalar = param(
        1e-4, 1.0, symbol="α", scale="log", default=0.3,
        starts=(0.002, 0.005, 0.01, 0.02, 0.04, 0.08, 0.15, 0.25, 0.4, 0.7),
        doc="slope parameter of the micro-normals (not its square root, the artists' roughness)",
    )  # fmt: skip
    fresnel: AbstractFresnel = eqx.field(default_factory=Dielectric)
    distribution: AbstractDistribution = eqx.field(default_factory=GGX)
    masking: Masking = eqx.field(static=True, default="correlated")

    @property
    def name(self) -> str:
        """`ggx` or `beckmann` with the Fresnel suffix."""
        return type(self.distribution).__name__.lower() + self.fresnel.suffix

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """ks F D G/(4 c_i c_o)."""
        h, cos_d = half_vector(wi, wo), cos_difference(wi, wo)
        density = self.distribution.density(h, self.alpha)
        g_cc = visibility(self.distribution, self.masking, self.alpha, (wi[2], wo[2], h[2], cos_d))
        return jnp.where(above(wi, wo), self.ks * self.fresnel(cos_d) * density * g_cc / 4.0, 0.0)

    def width(self) -> Scalar:
        """Alpha itself."""
        return self.alpha
