"""The empirical lobes of Phong and Blinn: a cosine to a power, with a named normalisation."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar

import jax.numpy as jnp

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import above, half_vector, mirror
from fitmat.models.base import AbstractSpecular, specular_weight
from fitmat.models.parameters import param

_ALBEDO = "specular weight; about the lobe's albedo at normal incidence"


def _exponent() -> Any:
    return param(
        0.1, 1e5, symbol="n", scale="log", default=50.0,
        starts=(1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 3e4),
        doc="lobe exponent; 10 is dull, 1000 glossy, 10⁵ nearly a mirror",
    )  # fmt: skip


def _power(cos: Scalar, exponent: Scalar) -> Scalar:
    """max(cos, 0)ⁿ with finite gradients in cos and n."""
    lit = cos > 0.0
    return jnp.where(lit, jnp.exp(exponent * jnp.log(jnp.where(lit, cos, 1.0))), 0.0)


def _blinn_width(exponent: Scalar) -> Scalar:
    """√(2/(n+2)): the α of the microfacet lobe with the same curvature at its peak."""
    return jnp.minimum(jnp.sqrt(2.0 / (exponent + 2.0)), 1.0)


class Phong(AbstractSpecular):
    """Phong 1975, as a BRDF: a lobe around the mirror direction r = 2(n·ω_i)n − ω_i.

    f = ks (n+2)/(2π) max(r·ω_o, 0)ⁿ

    Parameters: ks, specular weight, 0 to 10, per channel; exponent n, 0.1 to 10⁵, shared by the channels.

    Limits: at normal incidence the lobe reflects exactly ks. At grazing incidence part of it falls below the
    horizon, so it reflects less. Positive and reciprocal; no Fresnel, no masking.

    References: B. T. Phong, Illumination for computer generated pictures, CACM 18(6), 1975; normalisation:
    E. Lafortune & Y. Willems, Using the modified Phong reflectance model, CW 197, KU Leuven, 1994.

    Example: `fm.model("lambert+phong", kd=0.3, ks=0.1, exponent=40)`
    """

    label: ClassVar[str] = "phong"

    ks: Spectrum = specular_weight(_ALBEDO)
    exponent: Scalar = _exponent()

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """ks (n+2)/(2π) max(r·ω_o, 0)ⁿ."""
        n = self.exponent
        lobe = (n + 2.0) / (2.0 * jnp.pi) * _power(mirror(wi) @ wo, n)
        return jnp.where(above(wi, wo), self.ks * lobe, 0.0)

    def glsl(self) -> str:
        """The same."""
        return """
vec3 lobe(vec3 wi, vec3 wo) {
    vec3 away = wo - vec3(-wi.xy, wi.z);  // from the mirror direction; its square is 2 (1 - r . wo)
    return ks * (exponent + 2.0) / (2.0 * PI) * power(0.5 * dot(away, away), exponent);
}
"""

    def width(self) -> Scalar:
        """Half that of Blinn's lobe: the angle to the mirror direction is twice the angle to h."""
        return _blinn_width(self.exponent) / 2.0


class BlinnPhong(AbstractSpecular):
    """Blinn–Phong 1976 with the normalisation of real-time shading courses.

    f = ks (n+8)/(8π) max(n·h, 0)ⁿ

    Parameters: ks, specular weight, 0 to 10, per channel; exponent n, 0.1 to 10⁵, shared by the channels.

    Limits: (n+8)/(8π) approximates the exact normalisation (`blinn-phong-exact`). With ks = 1 the lobe reflects up
    to 7.5 % **more** than it receives for small n (albedo 1.063 at n = 4), and 1 for large n. Positive and
    reciprocal; no Fresnel, no masking, loses energy at grazing incidence.

    References: J. F. Blinn, Models of light reflection for computer synthesized pictures, SIGGRAPH 1977;
    normalisation: T. Akenine-Möller, E. Haines & N. Hoffman, Real-Time Rendering, 3rd ed., sec. 7.6.

    Example: `fm.model("lambert+blinn-phong", kd=0.3, ks=0.05, exponent=100)`
    """

    label: ClassVar[str] = "blinn-phong"
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType(
        {"energy": "with ks = 1 it reflects up to 7.5 % more than it receives: albedo 1.063 at n = 4, 1.075 at n = 10"}
    )

    ks: Spectrum = specular_weight(_ALBEDO)
    exponent: Scalar = _exponent()

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """ks (n+8)/(8π) c_hⁿ."""
        n = self.exponent
        lobe = (n + 8.0) / (8.0 * jnp.pi) * _power(half_vector(wi, wo)[2], n)
        return jnp.where(above(wi, wo), self.ks * lobe, 0.0)

    def glsl(self) -> str:
        """The same."""
        return """
vec3 lobe(vec3 wi, vec3 wo) {
    return ks * (exponent + 8.0) / (8.0 * PI) * half_power(pair(wi, wo).h, exponent);
}
"""

    def width(self) -> Scalar:
        """√(2/(n+2))."""
        return _blinn_width(self.exponent)


class BlinnPhongExact(AbstractSpecular):
    """Blinn–Phong 1976 with the exact normalisation at normal incidence.

    f = ks (n+2)(n+4)/(8π(2^(−n/2) + n)) max(n·h, 0)ⁿ

    Parameters: ks, specular weight and exact albedo at normal incidence, 0 to 10, per channel; exponent n, 0.1 to
    10⁵, shared by the channels.

    Limits: at normal incidence the lobe reflects exactly ks. Positive and reciprocal; no Fresnel, no masking, loses
    energy at grazing incidence.

    References: J. F. Blinn, SIGGRAPH 1977; normalisation: F. Giesen, Phong and Blinn–Phong normalization factors, 2009.

    Example: `fm.model("lambert+blinn-phong-exact", kd=0.3, ks=0.05, exponent=100)`
    """

    label: ClassVar[str] = "blinn-phong-exact"

    ks: Spectrum = specular_weight(_ALBEDO)
    exponent: Scalar = _exponent()

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """ks (n+2)(n+4)/(8π(2^(−n/2) + n)) c_hⁿ."""
        n = self.exponent
        norm = (n + 2.0) * (n + 4.0) / (8.0 * jnp.pi * (2.0 ** (-n / 2.0) + n))
        return jnp.where(above(wi, wo), self.ks * norm * _power(half_vector(wi, wo)[2], n), 0.0)

    def glsl(self) -> str:
        """The same."""
        return """
const float norm = (exponent + 2.0) * (exponent + 4.0) / (8.0 * PI * (exp2(-exponent / 2.0) + exponent));

vec3 lobe(vec3 wi, vec3 wo) {
    return ks * norm * half_power(pair(wi, wo).h, exponent);
}
"""

    def width(self) -> Scalar:
        """√(2/(n+2))."""
        return _blinn_width(self.exponent)
