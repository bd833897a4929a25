"""Disney's principled BRDF of 2012, complete. No subsurface transport: its subsurface term is a BRDF as well."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import COS_MIN, Pair, above
from fitmat.models.base import AbstractLobe
from fitmat.models.lobes.disney_terms import (
    Clearcoat,
    Perceptual,
    Sheen,
    base_color,
    fraction,
    narrowest,
    specular,
    tinted,
)
from fitmat.models.terms.distributions import Slopes
from fitmat.models.terms.fresnel import schlick


class Disney2012(AbstractLobe):
    """Disney's principled BRDF of 2012: what artists want to say of a surface, in twelve numbers.

    f = (1 − metallic) (base_color/π · mix(f_d, f_ss, subsurface) + f_sheen) + F D G/(4 c_i c_o) + f_coat

    - f_d = (1 + (F90 − 1) F_i)(1 + (F90 − 1) F_o), F90 = ½ + 2 roughness c_d², F_i = (1 − c_i)⁵: diffuse light that
      falls off at grazing angles when smooth and returns to the light when rough.
    - f_ss = 1.25 (F_ss (1/(c_i + c_o) − ½) + ½), F_ss as f_d with F90 = roughness c_d²: after Hanrahan & Krueger.
    - f_sheen = sheen (1 − c_d)⁵ · mix(1, hue, sheen_tint), hue = base_color over its luminance.
    - F: Schlick with F0 = mix(0.08 specular · mix(1, hue, specular_tint), base_color, metallic).
    - D: GGX with α_x = r²/a, α_y = r² a, a = √(1 − 0.9 anisotropic), each at least 0.001; r is the roughness.
    - G: Smith, separable, GGX with α_g = (½ + r/2)² in all directions.
    - f_coat = ¼ clearcoat · Schlick with F0 = 0.04 · GTR1 with α from 0.1 (gloss 0) to 0.001 (gloss 1) · Smith GGX
      with α = 0.25, /(4 c_i c_o).

    Parameters, all 0 to 1: base_color, **linear** (disney.brdf takes a display value and raises it to 2.2), per
    channel, 0.1 dark grey; the rest shared: metallic, 0.1 a mixture that no clean surface has; subsurface, 0.1 hardly
    seen; specular, 0.5 is F0 = 0.04 and 0.1 is 0.008; specular_tint; roughness, 0.1 nearly a mirror, 0.5 satin;
    anisotropic; sheen, 0.1 dusty; sheen_tint; clearcoat, 0.1 a faint second highlight; clearcoat_gloss, 0.1 satin;
    and rotation of the tangent, −180° to 180°. The luminance is 0.3 R + 0.6 G + 0.1 B for three channels and the mean
    for any other number; with one channel there is no hue, and the tints do nothing.

    Static choice: remap = True (the notes of 2012 and disney.brdf until February 2017, the default), False
    (disney.brdf since: G with the slopes of D, the notes' addendum of 2014).

    Limits: specular = 0 still reflects at grazing angles; below roughness 0.03 the slopes stand at their floor, and
    the highlight no longer depends on the roughness; 1/(c_i + c_o) is cut at 10⁷. The diffuse level and F0 cannot tell
    base_color, metallic, specular and specular_tint apart: a fit should fix metallic at 0 or 1, and with one channel
    the tints as well. Positive and reciprocal; the lobes do not share the light, so a bright surface reflects **more**
    than it receives at grazing angles.

    References: B. Burley, Physically-based shading at Disney, SIGGRAPH 2012 course, notes v3; Walt Disney Animation
    Studios, BRDF Explorer, src/brdfs/disney.brdf, and its pull request 14 (2017), which removed the remap.

    Example: `fm.model("disney-2012", base_color=[0.6, 0.3, 0.2], roughness=0.4, clearcoat=0.5)`
    """

    label: ClassVar[str] = "disney-2012"
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType(
        {
            "energy": "white and rough (base_color = roughness = 1) it reflects 1.05 of the light at 0° and 1.44 at "
            "85°; with full sheen, specular and clearcoat 1.57 at 85°, and 2.58 of a pure blue with full tints"
        }
    )

    base_color: Spectrum = base_color()
    metallic: Scalar = fraction(
        "m", 0.0, (0.1, 0.9), "0 a dielectric, 1 a metal; 0.1 is a mixture that no clean surface has"
    )
    subsurface: Scalar = fraction("k_ss", 0.0, (0.2,), "how flat the diffuse lobe is; 0.1 is hardly seen, 1 is waxy")
    specular: Scalar = fraction("k_s", 0.5, (0.2, 0.8), "F0/0.08 of the dielectric; 0.1 is F0 = 0.008, 0.5 plastic")
    specular_tint: Scalar = fraction(
        "t", 0.0, (0.1,), "how much of the base colour's hue the highlight takes; 0.1 is nearly white"
    )
    shape: Perceptual = eqx.field(default_factory=Perceptual)
    fabric: Sheen = eqx.field(default_factory=Sheen)
    coat: Clearcoat = eqx.field(default_factory=Clearcoat)
    remap: bool = eqx.field(static=True, default=True)

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """(1 − metallic)(diffuse + sheen) + F D G/(4 c_i c_o) + coat."""
        p, base = self.shape.pair(wi, wo), self.base_color
        mixed = (1.0 - self.subsurface) * diffuse(p, self._roughness) + self.subsurface * flat(p, self._roughness)
        body = base / jnp.pi * mixed + self.fabric(base, p)
        f0 = (1.0 - self.metallic) * 0.08 * self.specular * tinted(base, self.specular_tint) + self.metallic * base
        gloss = schlick(p.cos_d, f0) * specular(p, self.shape.slopes, self._masking())
        return jnp.where(above(wi, wo), (1.0 - self.metallic) * body + gloss + self.coat(p), 0.0)

    def glsl(self) -> str:
        """The same."""
        alpha = "vec2((0.5 + roughness / 2.0) * (0.5 + roughness / 2.0))"
        return f"""
const vec2 masking = {alpha if self.remap else "slopes"};

float rise(Pair p, float f90) {{
    return (1.0 + (f90 - 1.0) * pow5(1.0 - p.wi.z)) * (1.0 + (f90 - 1.0) * pow5(1.0 - p.wo.z));
}}

vec3 lobe(vec3 wi, vec3 wo) {{
    Pair p = facets(wi, wo);
    float f90 = roughness * p.cos_d * p.cos_d;
    float f_d = rise(p, 0.5 + 2.0 * f90), f_ss = 1.25 * (rise(p, f90) * (1.0 / max(wi.z + wo.z, 1e-7) - 0.5) + 0.5);
    vec3 body = base_color / PI * mix(f_d, f_ss, subsurface) + cloth(p);
    vec3 f0 = mix(0.08 * specular * mix(vec3(1.0), hue(base_color), specular_tint), base_color, metallic);
    float D_G = D_ggx(p.h, slopes) / (masked_ggx(p.wi, masking) * masked_ggx(p.wo, masking));
    return (1.0 - metallic) * body + schlick(p.cos_d, f0) * D_G / 4.0 + coat(p);
}}
"""

    @property
    def _roughness(self) -> Scalar:
        return self.shape.roughness

    def _masking(self) -> Slopes:
        """(½ + r/2)² for both slopes, or those of the distribution."""
        alpha = (0.5 + self._roughness / 2.0) ** 2
        return (alpha, alpha) if self.remap else self.shape.slopes

    def width(self) -> Scalar:
        """The smaller slope, or the coat's alpha where that is smaller."""
        return narrowest(self.shape, self.coat)


def diffuse(p: Pair, roughness: Scalar) -> Scalar:
    """Burley's diffuse lobe times π: (1 + (F90 − 1) F_i)(1 + (F90 − 1) F_o), F90 = ½ + 2 r c_d² (2012, sec. 5.3)."""
    return _rise(p, 0.5 + 2.0 * roughness * p.cos_d**2)


def flat(p: Pair, roughness: Scalar) -> Scalar:
    """1.25 (F_ss (1/(c_i + c_o) − ½) + ½), after Hanrahan & Krueger; F_ss with F90 = r c_d² (disney.brdf, `ss`)."""
    cosines = jnp.maximum(p.wi[2] + p.wo[2], COS_MIN)
    return 1.25 * (_rise(p, roughness * p.cos_d**2) * (1.0 / cosines - 0.5) + 0.5)


def _rise(p: Pair, f90: Scalar) -> Scalar:
    """From 1 at normal incidence to `f90` at grazing, for either direction."""
    fi, fo = schlick(p.wi[2], 0.0), schlick(p.wo[2], 0.0)
    return (1.0 + (f90 - 1.0) * fi) * (1.0 + (f90 - 1.0) * fo)
