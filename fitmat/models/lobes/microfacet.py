"""The microfacet reflection of today's renderers: GGX or Beckmann normals, any roughness, Fresnel and masking."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import above
from fitmat.models.base import AbstractSpecular, specular_weight
from fitmat.models.terms.distributions import (
    GGX,
    VISIBILITY,
    AbstractDistribution,
    AbstractRoughness,
    Isotropic,
    Masking,
    visibility,
)
from fitmat.models.terms.fresnel import AbstractFresnel, Dielectric


class AbstractMicrofacet(AbstractSpecular):
    """A lobe of tiny mirrors: what single scattering reflects, and what a lobe may make of it."""

    ks: Spectrum = specular_weight()
    roughness: AbstractRoughness = eqx.field(default_factory=Isotropic)
    fresnel: AbstractFresnel = eqx.field(default_factory=Dielectric)
    distribution: AbstractDistribution = eqx.field(default_factory=GGX)
    masking: Masking = eqx.field(static=True, default="correlated")

    def single(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """ks F D G/(4 c_i c_o)."""
        p, slopes = self.roughness.pair(wi, wo), self.roughness.slopes
        density = self.distribution.density(p.h, slopes)
        g_cc = visibility(self.distribution, self.masking, slopes, p)
        return jnp.where(above(wi, wo), self.ks * self.fresnel(p.cos_d) * density * g_cc / 4.0, 0.0)

    def single_glsl(self) -> str:
        """The same."""
        return (
            VISIBILITY[self.masking]
            + """
vec3 single(vec3 wi, vec3 wo) {
    Pair p = facets(wi, wo);
    return ks * fresnel(p.cos_d) * density(p.h) * visibility(p) / 4.0;  // visibility is G/(c_i c_o)
}
"""
        )

    def width(self) -> Scalar:
        """The smaller slope."""
        return self.roughness.width()


class Microfacet(AbstractMicrofacet):
    """A surface of tiny mirrors with GGX (`ggx`) or Beckmann (`beckmann`) normals.

    f = ks F(c_d) D(h) G(ω_i, ω_o)/(4 c_i c_o)

    Parameters: ks, weight of the lobe, 0 to 10 (1 for a bare surface; fix it with `--fix ks=1`), per channel with the
    exact dielectric, shared with the other Fresnel terms; alpha, slope parameter, 0.0001 to 1, shared: 0.05 is
    glossy plastic, 0.1 satin, 0.5 dull; with `-aniso` alpha_x and alpha_y along and across a tangent at the azimuth
    `rotation` (degrees); and the Fresnel level: eta (exact dielectric, shared), f0 (`-schlick`, per channel), f0 and
    f82 (`-f82`, per channel), eta and kappa (`-conductor`, `-belcour`, per channel), or substrate_eta and
    substrate_kappa (per channel) under a thin film (`-film`, M. Born & E. Wolf, Principles of Optics) of thickness,
    film_eta, film_b and film_kappa (shared).

    Static choice: masking = "correlated" (Smith height-correlated, the default), "separable" (Smith, as in Walter
    2007 and Mitsuba 3), "v-cavity" (Cook & Torrance).

    Limits: alpha → 0 is a mirror; single scattering only, so a rough surface (alpha > 0.5) reflects less than it
    should: `ggx-kc` gives that energy back. Positive, reciprocal, conserves energy for ks ≤ 1.

    References: B. Walter, S. Marschner, H. Li & K. Torrance, Microfacet models for refraction through rough
    surfaces, EGSR 2007; masking and anisotropy: E. Heitz, Understanding the masking-shadowing function, JCGT 3(2),
    2014.

    Example: `fm.model("lambert+ggx", kd=0.3, alpha=0.2, eta=1.5)`
    """

    label: ClassVar[str] = "{distribution.label}{roughness.suffix}{fresnel.suffix}"

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """Single scattering."""
        return self.single(wi, wo)

    def glsl(self) -> str:
        """The same."""
        return self.single_glsl().replace("vec3 single(", "vec3 lobe(")
