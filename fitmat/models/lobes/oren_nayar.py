"""Rough diffuse surfaces: Oren and Nayar's two formulas of 1994 and their energy-preserving successor of 2025.

No specular lobe stands here.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar

import jax.numpy as jnp

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import COS_MIN, above
from fitmat.models.base import AbstractDiffuse
from fitmat.models.parameters import param

C1_FON = 0.5 - 2.0 / (3.0 * jnp.pi)
C2_FON = 2.0 / 3.0 - 28.0 / (15.0 * jnp.pi)
"""Portsmouth, Kutz & Hill's constants: the albedo of Fujii's s/t at grazing incidence, and its average."""


VARIANCE = "const float variance = radians(sigma_n) * radians(sigma_n);\n"
"""σ² in GLSL."""


def _kd() -> Any:
    return param(
        0.0, 1.0, symbol="k_d", per_channel=True, weight=True, default=0.5, doc="albedo of a facet"
    )  # fmt: skip


def _sigma() -> Any:
    return param(
        0.0, 90.0, symbol="σ", unit="°", default=10.0, starts=(2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 65.0),
        doc="standard deviation of the facets' slope angle; 0 is Lambert, 10 paper, 30 plaster or clay",
    )  # fmt: skip


class OrenNayar(AbstractDiffuse):
    """Oren & Nayar 1994, the qualitative model: rough diffuse as renderers have it.

    f = kd/π (A + B max(0, cosΔφ) sinα tanβ),  A = 1 − ½σ²/(σ² + 0.33),  B = 0.45σ²/(σ² + 0.09)

    with σ in radians, α the larger and β the smaller of the two zenith angles.

    Parameters: kd, the albedo of a facet, 0 to 1, per channel; sigma_n, the standard deviation σ of the facets' slope
    angle, 0° to 90°, shared: 0.1° is Lambert, 10° paper, 30° plaster.

    Limits: σ = 0 is Lambert. Brighter than Lambert towards the light and flatter over the surface. At normal incidence
    it reflects kd A. Positive and reciprocal. With kd = 1 it reflects up to 1.5 % **more** than it receives at grazing
    incidence (A + B/2, largest at σ = 11.4°), and a rough surface less. It has a crease at Δφ = 90°.

    References: M. Oren & S. K. Nayar, Generalization of Lambert's reflectance model, SIGGRAPH 1994, "qualitative
    model"; its albedo from the integrals of J. Portsmouth, P. Kutz & S. Hill, EON, JCGT 14(1), 2025.

    Example: `fm.model("oren-nayar", kd=0.5, sigma_n=20)`
    """

    label: ClassVar[str] = "oren-nayar"
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType(
        {"energy": "with kd = 1 and σ = 11.4° it reflects 1.015 of the light at grazing incidence: A + B/2"}
    )

    kd: Spectrum = _kd()
    sigma_n: Scalar = _sigma()

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """kd/π (A + B max(0, s)/max(c_i, c_o)), s = sinθ_i sinθ_o cosΔφ."""
        a, b = self._coefficients()
        lobe = a + b * jnp.maximum(_shadow(wi, wo), 0.0) / _larger_cos(wi, wo)
        return jnp.where(above(wi, wo), self.kd / jnp.pi * lobe, 0.0)

    def glsl(self) -> str:
        """The same."""
        return (
            VARIANCE
            + """
const float A = 1.0 - 0.5 * variance / (variance + 0.33);
const float B = 0.45 * variance / (variance + 0.09);

vec3 lobe(vec3 wi, vec3 wo) {
    float s = dot(wi.xy, wo.xy);  // sin(theta_i) sin(theta_o) cos(phi_i - phi_o)
    return kd / PI * (A + B * max(s, 0.0) / larger_cosine(wi, wo));
}
"""
        )

    def _coefficients(self) -> tuple[Scalar, Scalar]:
        """A and B."""
        variance = jnp.deg2rad(self.sigma_n) ** 2
        return 1.0 - 0.5 * variance / (variance + 0.33), 0.45 * variance / (variance + 0.09)


class OrenNayarFull(AbstractDiffuse):
    """Oren & Nayar 1994, the full functional approximation with interreflection.

    f = kd/π (C1 + cosΔφ C2 tanβ + (1 − |cosΔφ|) C3 tan((α+β)/2)) + 0.17 kd²/π σ²/(σ²+0.13) (1 − cosΔφ (2β/π)²)

    C1 = 1 − ½σ²/(σ²+0.33);  C2 = 0.45σ²/(σ²+0.09) (sinα − [cosΔφ < 0](2β/π)³);  C3 = ⅛σ²/(σ²+0.09) (4αβ/π²)²

    with σ in radians, α the larger and β the smaller of the two zenith angles.

    Parameters: kd, the albedo of a facet, 0 to 1, per channel; sigma_n, the standard deviation σ of the facets' slope
    angle, 0° to 90°, shared: 0.1° is Lambert, 10° paper, 30° plaster.

    Limits: σ = 0 is Lambert. The albedo of the whole is not kd but 0.6 to 1 of it, less where rough and dark. Above
    σ = 38° the formula of dark facets turns negative towards the mirror direction near grazing incidence (beyond 76°
    at σ = 60° and kd → 0) and is cut at 0. With kd = 1 it reflects up to 5 % **more** than it receives at grazing
    incidence, most near σ = 18°. Positive and reciprocal. kd is nearly, not quite, a factor.

    Reference: M. Oren & S. K. Nayar, Generalization of Lambert's reflectance model, SIGGRAPH 1994, functional
    approximation with interreflection.

    Example: `fm.model("oren-nayar-full", kd=0.5, sigma_n=20)`
    """

    label: ClassVar[str] = "oren-nayar-full"
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType(
        {"energy": "with kd = 1 and σ = 18° it reflects 1.050 of the light at 89.9°"}
    )

    kd: Spectrum = _kd()
    sigma_n: Scalar = _sigma()

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """kd/π (L1 + 0.17 kd L2), at least 0."""
        once, twice = _direct(wi, wo, self.sigma_n), _interreflected(wi, wo, self.sigma_n)
        return jnp.where(above(wi, wo), self.kd / jnp.pi * jnp.maximum(once + 0.17 * self.kd * twice, 0.0), 0.0)

    def glsl(self) -> str:
        """The same, with α and β by their halves of the tangent."""
        return (
            VARIANCE
            + """
vec3 lobe(vec3 wi, vec3 wo) {
    float ti = zenith(wi), to = zenith(wo), s = dot(wi.xy, wo.xy), top = larger_cosine(wi, wo);
    float product = sine(wi) * sine(wo), azimuth = product > 0.0 ? clamp(s / product, -1.0, 1.0) : 0.0;
    float lean = 2.0 / PI * min(ti, to), tan_beta = min(sine(wi), sine(wo)) / top;
    float tan_half = (sine(wi) + sine(wo)) / max(wi.z + wo.z, 1e-7);
    float wide = 4.0 * ti * to / (PI * PI), rough = variance / (variance + 0.09);
    float C1 = 1.0 - 0.5 * variance / (variance + 0.33), C3 = 0.125 * rough * wide * wide;
    float shadowed = min(azimuth, 0.0) * tan_beta * lean * lean * lean;
    float once = C1 + 0.45 * rough * (s / top - shadowed) + (1.0 - abs(azimuth)) * C3 * tan_half;
    float twice = variance / (variance + 0.13) * (1.0 - azimuth * lean * lean);
    return kd / PI * max(once + 0.17 * kd * twice, 0.0);
}
"""
        )


class EnergyPreservingOrenNayar(AbstractDiffuse):
    """EON, the energy-preserving Oren–Nayar of Portsmouth, Kutz & Hill 2025.

    f = kd A/π (1 + r s/t) + kd_ms/π (1 − E(c_i))(1 − E(c_o))/(1 − Ē),  kd_ms = kd² Ē/(1 − kd (1 − Ē))

    with A = 1/(1 + r (½ − 2/(3π))), s = ω_i·ω_o − c_i c_o, t = max(c_i, c_o) where s > 0 and 1 elsewhere, and E and Ē
    the albedo of the first term with kd = 1, for one direction and for all, both in closed form.

    Parameters: kd, the albedo of a facet, 0 to 1, per channel; r, roughness, 0 to 1, shared: 0 is Lambert, 0.1 paper,
    0.5 plaster, 1 the roughest.

    Limits: kd = 1 reflects all light at every angle and roughness. Darker facets reflect less than kd, because light
    that meets two of them is absorbed twice. Positive, reciprocal, conserves energy. It has a crease at Δφ = 90°.

    Reference: J. Portsmouth, P. Kutz & S. Hill, EON: a practical energy-preserving rough diffuse BRDF, JCGT 14(1),
    2025, listing 1 with its exact albedo.

    Example: `fm.model("eon", kd=0.5, r=0.5)`
    """

    label: ClassVar[str] = "eon"

    kd: Spectrum = _kd()
    r: Scalar = param(
        0.0, 1.0, symbol="r", default=0.5, starts=(0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 0.95),
        doc="roughness; 0 is Lambert, 1 the roughest",
    )  # fmt: skip

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """kd/π A (1 + r s/t) plus the light that meets several facets."""
        once, more = self.bounces(wi, wo)
        return self.kd * once + self.multiple() * more

    def bounces(self, wi: Vec3, wo: Vec3) -> tuple[Scalar, Scalar]:
        """A/π (1 + r s/t), and what kd_ms is a factor of; r cancels from 1 − Ē and both stay finite at 0."""
        a = 1.0 / (1.0 + C1_FON * self.r)
        s = _shadow(wi, wo)
        once = a * (1.0 + self.r * jnp.where(s > 0.0, s / _larger_cos(wi, wo), s))
        lost = self.r * a * _missing(wi) * _missing(wo) / (C1_FON - C2_FON)
        up = above(wi, wo)
        return jnp.where(up, once / jnp.pi, 0.0), jnp.where(up, lost / jnp.pi, 0.0)

    def glsl(self) -> str:
        """The same."""
        return """
const float C1 = 0.5 - 2.0 / (3.0 * PI);
const float C2 = 2.0 / 3.0 - 28.0 / (15.0 * PI);
const float A = 1.0 / (1.0 + C1 * r);
const float mean = (1.0 + C2 * r) / (1.0 + C1 * r);
const vec3 kd_ms = kd * kd * mean / (1.0 - kd * (1.0 - mean));

// (1 - E(c))/(r A): what the first term loses
float missing(vec3 w) {
    float s = sine(w), c = w.z;
    float G = s * (zenith(w) - s * c) + 2.0 / 3.0 * s * (c * (1.0 + s + s * s) / (1.0 + s) - 1.0);
    return C1 - G / PI;
}

vec3 lobe(vec3 wi, vec3 wo) {
    float s = dot(wi.xy, wo.xy);
    vec3 once = kd * A * (1.0 + r * (s > 0.0 ? s / larger_cosine(wi, wo) : s));
    return (once + kd_ms * r * A * missing(wi) * missing(wo) / (C1 - C2)) / PI;
}
"""

    def _average(self) -> Scalar:
        """Ē = A (1 + (2/3 − 28/(15π)) r)."""
        return (1.0 + C2_FON * self.r) / (1.0 + C1_FON * self.r)

    def multiple(self) -> Spectrum:
        """kd_ms."""
        mean = self._average()
        return self.kd**2 * mean / (1.0 - self.kd * (1.0 - mean))


def _shadow(wi: Vec3, wo: Vec3) -> Scalar:
    """s = sinθ_i sinθ_o cosΔφ: the product of the two projections on the surface."""
    return wi[0] * wo[0] + wi[1] * wo[1]


def _larger_cos(wi: Vec3, wo: Vec3) -> Scalar:
    return jnp.maximum(jnp.maximum(wi[2], wo[2]), COS_MIN)


def _sin(w: Vec3) -> Scalar:
    """sinθ, 0 with no slope along the normal."""
    square = w[0] ** 2 + w[1] ** 2
    tilted = square > 1e-24
    return jnp.where(tilted, jnp.sqrt(jnp.where(tilted, square, 1.0)), 0.0)


def _zenith(w: Vec3) -> Scalar:
    """θ from sine and cosine, whose slopes are finite everywhere."""
    return jnp.arctan2(_sin(w), w[2])


def _cos_azimuth(wi: Vec3, wo: Vec3) -> Scalar:
    """cosΔφ; 0 where an azimuth is undefined, and there every term that contains it vanishes."""
    product = _sin(wi) * _sin(wo)
    defined = product > 0.0
    return jnp.where(defined, jnp.clip(_shadow(wi, wo) / jnp.where(defined, product, 1.0), -1.0, 1.0), 0.0)


def _direct(wi: Vec3, wo: Vec3, sigma_n: Scalar) -> Scalar:
    """C1 + cosΔφ C2 tanβ + (1 − |cosΔφ|) C3 tan((α+β)/2), with cosΔφ sinα tanβ = s/max(c_i, c_o)."""
    variance, azimuth = jnp.deg2rad(sigma_n) ** 2, _cos_azimuth(wi, wo)
    ti, to, top = _zenith(wi), _zenith(wo), _larger_cos(wi, wo)
    c1, rough = 1.0 - 0.5 * variance / (variance + 0.33), variance / (variance + 0.09)
    tan_beta = jnp.minimum(_sin(wi), _sin(wo)) / top
    shadowed = jnp.where(azimuth < 0.0, azimuth * tan_beta * (2.0 / jnp.pi * jnp.minimum(ti, to)) ** 3, 0.0)
    tan_half = (_sin(wi) + _sin(wo)) / jnp.maximum(wi[2] + wo[2], COS_MIN)
    c3 = 0.125 * rough * (4.0 * ti * to / jnp.pi**2) ** 2
    return c1 + 0.45 * rough * (_shadow(wi, wo) / top - shadowed) + (1.0 - jnp.abs(azimuth)) * c3 * tan_half


def _interreflected(wi: Vec3, wo: Vec3, sigma_n: Scalar) -> Scalar:
    """σ²/(σ² + 0.13) (1 − cosΔφ (2β/π)²)."""
    variance = jnp.deg2rad(sigma_n) ** 2
    lean = (2.0 / jnp.pi * jnp.minimum(_zenith(wi), _zenith(wo))) ** 2
    return variance / (variance + 0.13) * (1.0 - _cos_azimuth(wi, wo) * lean)


def _missing(w: Vec3) -> Scalar:
    """½ − 2/(3π) − G(c)/π: 1 − E of the first term over r A; 0 at grazing incidence."""
    sin, cos = _sin(w), w[2]
    g = sin * (_zenith(w) - sin * cos) + 2.0 / 3.0 * sin * (cos * (1.0 + sin + sin**2) / (1.0 + sin) - 1.0)
    return C1_FON - g / jnp.pi
