"""The reflection side of Disney's BSDF of 2015, of a solid surface. Nothing is transmitted: spec_trans = 0."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import Pair, above
from fitmat.models.base import AbstractLobe
from fitmat.models.lobes.disney_terms import (
    Clearcoat,
    Perceptual,
    Sheen,
    base_color,
    fraction,
    narrowest,
    specular,
    tint,
)
from fitmat.models.parameters import param
from fitmat.models.terms.fresnel import dielectric, f0_from_eta, schlick


class Disney2015(AbstractLobe):
    """What Disney's BSDF of 2015 reflects: the model of 2012 with exact Fresnel and the masking of its own normals.

    f = (1 − metallic) (base_color/π · (f_d + f_retro) + f_sheen) + F D G/(4 c_i c_o) + f_coat

    - f_d = (1 − ½F_i)(1 − ½F_o), F_i = (1 − c_i)⁵: Lambert's lobe behind the Fresnel of entering and leaving.
    - f_retro = R (F_i + F_o + F_i F_o (R − 1)), R = 2 roughness c_d². With f_d it is the diffuse lobe of 2012.
    - f_sheen = sheen (1 − c_d)⁵ · mix(1, hue, sheen_tint), hue = base_color over its luminance.
    - F = (1 − metallic)((1 − t) F_d(η) + t Schlick(F0(η) hue)) + metallic Schlick(base_color), t = specular_tint; F_d
      is the exact Fresnel term of a dielectric.
    - D: GGX with α_x = r²/a, α_y = r² a, a = √(1 − 0.9 anisotropic), each at least 0.001; r is the roughness.
    - G: Smith, separable, with the slopes of D.
    - f_coat: as in `disney-2012`.

    Parameters: base_color, linear, 0 to 1, per channel, 0.1 dark grey; the rest shared, 0 to 1 unless said:
    metallic, 0.1 a mixture that no clean surface has; eta, index of refraction, 1 to 2.5, 1.1 is F0 = 0.002;
    specular_tint; roughness, 0.1 nearly a mirror, 0.5 satin; anisotropic; rotation of the tangent, −180° to 180°;
    sheen, 0.1 dusty; sheen_tint; clearcoat, 0.1 a faint second highlight; clearcoat_gloss, 0.1 satin. The luminance is
    0.3 R + 0.6 G + 0.1 B for three channels and the mean for any other number; with one channel there is no hue, and
    the tints do nothing.

    Limits: a solid surface, without specular and diffuse transmission (spec_trans = diff_trans = 0), without
    subsurface scattering and the `flatness` of thin surfaces. eta = 1 and metallic = 0 have no highlight. Programs
    blend the Fresnel terms differently: this is Mitsuba 3's blend; pbrt-v3 mixes F0 by metallic as well, so that its
    specular_tint acts on mixtures only. base_color, metallic, eta and specular_tint can hardly be told apart: a fit
    should fix metallic at 0 or 1, and with one channel the tints as well. Below roughness 0.03 the slopes stand at
    their floor, and the highlight no longer depends on the roughness. Positive and reciprocal; the lobes do not share
    the light, so a bright surface reflects **more** than it receives at grazing angles.

    References: B. Burley, Extending the Disney BRDF to a BSDF with integrated subsurface scattering, SIGGRAPH 2015
    course, eq. 4 for the diffuse lobe; M. Pharr, pbrt-v3, src/materials/disney.cpp; W. Jakob et al., Mitsuba 3,
    src/bsdfs/principled.cpp.

    Example: `fm.model("disney-2015", base_color=[0.6, 0.3, 0.2], roughness=0.4, eta=1.5)`
    """

    label: ClassVar[str] = "disney-2015"
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType(
        {
            "energy": "white and rough (base_color = roughness = 1) it reflects 1.05 of the light at 0° and 1.44 at "
            "85°; with full sheen, clearcoat and eta = 2.5 it is 1.63 at 85°, and 3.15 of a pure blue with full tints"
        }
    )

    base_color: Spectrum = base_color()
    metallic: Scalar = fraction(
        "m", 0.0, (0.1, 0.9), "0 a dielectric, 1 a metal; 0.1 is a mixture that no clean surface has"
    )
    eta: Scalar = param(
        1.0, 2.5, symbol="η", scale="log", default=1.5, starts=(1.3, 1.7),
        doc="index of refraction of the dielectric; 1.1 is F0 = 0.002, plastics and varnish 1.4–1.6",
    )  # fmt: skip
    specular_tint: Scalar = fraction(
        "t", 0.0, (0.1,), "how much of the base colour's hue the highlight takes; 0.1 is nearly white"
    )
    shape: Perceptual = eqx.field(default_factory=Perceptual)
    fabric: Sheen = eqx.field(default_factory=Sheen)
    coat: Clearcoat = eqx.field(default_factory=Clearcoat)

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """(1 − metallic)(diffuse + retro-reflection + sheen) + F D G/(4 c_i c_o) + coat."""
        p, base, slopes = self.shape.pair(wi, wo), self.base_color, self.shape.slopes
        body = base / jnp.pi * (lambert(p) + retro(p, self.shape.roughness)) + self.fabric(base, p)
        gloss = self._fresnel(p.cos_d) * specular(p, slopes, slopes)
        return jnp.where(above(wi, wo), (1.0 - self.metallic) * body + gloss + self.coat(p), 0.0)

    def glsl(self) -> str:
        """The same."""
        return """
const float f0 = (eta - 1.0) * (eta - 1.0) / ((eta + 1.0) * (eta + 1.0));

vec3 fresnel(float c) {
    vec3 plain = mix(dielectric(c, vec3(eta)), schlick(c, f0 * hue(base_color)), specular_tint);
    return mix(plain, schlick(c, base_color), metallic);
}

vec3 lobe(vec3 wi, vec3 wo) {
    Pair p = facets(wi, wo);
    float F_i = pow5(1.0 - wi.z), F_o = pow5(1.0 - wo.z), R = 2.0 * roughness * p.cos_d * p.cos_d;
    float f_d = (1.0 - 0.5 * F_i) * (1.0 - 0.5 * F_o), f_retro = R * (F_i + F_o + F_i * F_o * (R - 1.0));
    vec3 body = base_color / PI * (f_d + f_retro) + cloth(p);
    float D_G = D_ggx(p.h, slopes) / (masked_ggx(p.wi, slopes) * masked_ggx(p.wo, slopes));
    return (1.0 - metallic) * body + fresnel(p.cos_d) * D_G / 4.0 + coat(p);
}
"""

    def _fresnel(self, cos_d: Scalar) -> Spectrum:
        """Exact for the dielectric, Schlick where tinted and for the metal."""
        t, hue = self.specular_tint, tint(self.base_color)
        plain = (1.0 - t) * dielectric(cos_d, self.eta) + t * schlick(cos_d, f0_from_eta(self.eta) * hue)
        return (1.0 - self.metallic) * plain + self.metallic * schlick(cos_d, self.base_color)

    def width(self) -> Scalar:
        """The smaller slope, or the coat's alpha where that is smaller."""
        return narrowest(self.shape, self.coat)


def lambert(p: Pair) -> Scalar:
    """(1 − ½F_i)(1 − ½F_o): Lambert's lobe, times π, behind the surface (Burley 2015, eq. 4)."""
    fi, fo = schlick(p.wi[2], 0.0), schlick(p.wo[2], 0.0)
    return (1.0 - 0.5 * fi) * (1.0 - 0.5 * fo)


def retro(p: Pair, roughness: Scalar) -> Scalar:
    """R (F_i + F_o + F_i F_o (R − 1)), R = 2 r c_d²: what a rough surface sends back (Burley 2015, eq. 4)."""
    fi, fo, r = schlick(p.wi[2], 0.0), schlick(p.wo[2], 0.0), 2.0 * roughness * p.cos_d**2
    return r * (fi + fo + fi * fo * (r - 1.0))
