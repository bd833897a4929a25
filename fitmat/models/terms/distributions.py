"""Microfacet statistics: roughness, distributions of normals, and masking and shadowing.

A roughness gives the slopes (alpha_x, alpha_y) and the frame they are meant in; a distribution gives D(h) and
c·(1+Λ(ω)), the one form of Smith's Λ that stays finite at grazing angles; a masking function turns these into
G/(c_i c_o). Fresnel and the assembly into a BRDF live elsewhere.
"""

from abc import abstractmethod
from typing import Any, ClassVar, Literal, get_args

import jax.numpy as jnp
from jax.scipy.special import erf

from fitmat._types import Scalar, Vec3
from fitmat.maths.directions import COS_MIN, Pair, pair, rotated
from fitmat.models.base import LEVEL, TURNED, AbstractShape
from fitmat.models.glsl import AbstractShaded
from fitmat.models.parameters import param

Masking = Literal["correlated", "separable", "v-cavity"]
"""Smith height-correlated (Heitz 2014), Smith separable (Walter 2007), V-cavity (Cook & Torrance 1982)."""

MASKINGS: tuple[str, ...] = get_args(Masking)

Slopes = tuple[Scalar, Scalar]
"""(alpha_x, alpha_y): slope parameters along the tangent and across it."""


class AbstractRoughness(AbstractShape):
    """How rough a surface is; alpha_x is meant along the tangent."""

    @property
    @abstractmethod
    def slopes(self) -> Slopes:
        """(alpha_x, alpha_y)."""

    def pair(self, wi: Vec3, wo: Vec3) -> Pair:
        """Two directions and their half vector in the local frame; h is turned, not made of turned directions."""
        level = pair(wi, wo)
        return Pair(self.local(wi), self.local(wo), self.local(level.h), level.cos_d)

    def width(self) -> Scalar:
        """The smaller slope."""
        return jnp.minimum(*self.slopes)


def added_slopes(alpha: Scalar, slope: Scalar) -> Scalar:
    """As variances of slopes are."""
    return jnp.minimum(jnp.sqrt(alpha**2 + slope**2), 1.0)


class Isotropic(AbstractRoughness):
    """The same slope in all directions."""

    suffix: ClassVar[str] = ""
    isotropic: ClassVar[bool] = True
    alpha: Scalar = param(
        1e-4, 1.0, symbol="α", scale="log", default=0.3,
        starts=(0.002, 0.005, 0.01, 0.02, 0.04, 0.08, 0.15, 0.25, 0.4, 0.7),
        doc="slope parameter of the micro-normals (not its square root, the artists' roughness); 0.1 is satin",
    )  # fmt: skip

    @property
    def slopes(self) -> Slopes:
        """(alpha, alpha)."""
        return self.alpha, self.alpha

    def widened(self, slope: Scalar) -> "Isotropic":
        """√(α² + slope²), at most 1."""
        return Isotropic(added_slopes(self.alpha, slope))

    def local(self, w: Vec3) -> Vec3:
        """The direction itself."""
        return w

    def glsl(self) -> str:
        """The slopes and the level frame."""
        return "const vec2 slopes = vec2(alpha);\n" + LEVEL


def _slope(symbol: str, along: str, default: float) -> Any:
    return param(
        1e-4, 1.0, symbol=symbol, scale="log", default=default, starts=(0.01, 0.05, 0.15, 0.4),
        doc=f"slope parameter {along} the tangent; a brushed metal has 0.05 along one axis and 0.3 along the other",
    )  # fmt: skip


class Anisotropic(AbstractRoughness):
    """Two slopes, along and across a tangent that lies `rotation` degrees from the x axis of the sample.

    (alpha_x, alpha_y, rotation) and (alpha_y, alpha_x, rotation ± 90°) are the same surface.
    """

    suffix: ClassVar[str] = "-aniso"
    isotropic: ClassVar[bool] = False
    exchanged: ClassVar[tuple[str, ...]] = ("alpha_x", "alpha_y")
    alpha_x: Scalar = _slope("α_x", "along", 0.1)
    alpha_y: Scalar = _slope("α_y", "across", 0.3)
    rotation: Scalar = param(
        -180.0, 180.0, symbol="φ_t", unit="°", default=0.0, starts=(0.0, 45.0), period=180.0,
        doc="azimuth of the tangent in the frame of the measured azimuths; half a turn changes nothing",
    )  # fmt: skip

    @property
    def slopes(self) -> Slopes:
        """(alpha_x, alpha_y)."""
        return self.alpha_x, self.alpha_y

    def widened(self, slope: Scalar) -> "Anisotropic":
        """√(α² + slope²), at most 1, along and across."""
        return Anisotropic(added_slopes(self.alpha_x, slope), added_slopes(self.alpha_y, slope), self.rotation)

    def local(self, w: Vec3) -> Vec3:
        """The direction turned by −rotation about the normal."""
        return rotated(w, -jnp.deg2rad(self.rotation))

    def glsl(self) -> str:
        """The slopes and the turned frame."""
        return "const vec2 slopes = vec2(alpha_x, alpha_y);\n" + TURNED


class AbstractDistribution(AbstractShaded):
    """Statistics of micro-normals for given slopes; directions are in the frame of the tangent.

    Attributes:
        label: What names of models call it.
    """

    label: ClassVar[str]

    @abstractmethod
    def density(self, h: Vec3, slopes: Slopes) -> Scalar:
        """D(h) in sr⁻¹, normalised so that ∫ D(h) c_h dω_h = 1."""

    @abstractmethod
    def masked_cos(self, w: Vec3, slopes: Slopes) -> Scalar:
        """c·(1 + Λ(ω)): the cosine divided by Smith's G1(ω)."""


class GGX(AbstractDistribution):
    """Trowbridge–Reitz, "GGX" (Walter et al. 2007, eqs. 33–34; anisotropic: Heitz 2014, eqs. 85–87)."""

    label: ClassVar[str] = "ggx"

    def density(self, h: Vec3, slopes: Slopes) -> Scalar:
        """1/(π α_x α_y (h_x²/α_x² + h_y²/α_y² + h_z²)²), multiplied out so that nothing overflows."""
        ax, ay = slopes
        stretched = h[0] ** 2 * (ay / ax) + h[1] ** 2 * (ax / ay) + ax * ay * h[2] ** 2
        return ax * ay / (jnp.pi * stretched**2)

    def masked_cos(self, w: Vec3, slopes: Slopes) -> Scalar:
        """½(c + √(c² + α_x² ω_x² + α_y² ω_y²))."""
        return 0.5 * (_cos(w) + jnp.sqrt(_cos(w) ** 2 + _spread(w, slopes)))

    def glsl(self) -> str:
        """Both, for the lobe's slopes."""
        return _functions("D_ggx", "masked_ggx")


class Beckmann(AbstractDistribution):
    """Gaussian slopes (Beckmann & Spizzichino 1963; Walter et al. 2007, eqs. 25–26; Heitz 2014, eqs. 80–84)."""

    label: ClassVar[str] = "beckmann"

    def density(self, h: Vec3, slopes: Slopes) -> Scalar:
        """exp(−(h_x²/α_x² + h_y²/α_y²)/h_z²)/(π α_x α_y h_z⁴)."""
        ax, ay = slopes
        cos2 = jnp.maximum(h[2], COS_MIN) ** 2
        tan2 = ((h[0] / ax) ** 2 + (h[1] / ay) ** 2) / cos2
        return jnp.exp(-tan2) / (jnp.pi * ax * ay * cos2**2)

    def masked_cos(self, w: Vec3, slopes: Slopes) -> Scalar:
        """½c(1 + erf a) + s exp(−a²)/(2√π), a = c/s, s = √(α_x² ω_x² + α_y² ω_y²)."""
        cos, s = _cos(w), jnp.sqrt(_spread(w, slopes))
        a = cos / s
        return 0.5 * cos * (1.0 + erf(a)) + s * jnp.exp(-(a**2)) / (2.0 * jnp.sqrt(jnp.pi))

    def glsl(self) -> str:
        """Both, for the lobe's slopes."""
        return _functions("D_beckmann", "masked_beckmann")


class BeckmannRational(AbstractDistribution):
    """Beckmann's distribution with Walter's rational approximation of its masking, off by at most 0.35 %."""

    label: ClassVar[str] = "beckmann"

    def density(self, h: Vec3, slopes: Slopes) -> Scalar:
        """Beckmann's own."""
        return Beckmann().density(h, slopes)

    def masked_cos(self, w: Vec3, slopes: Slopes) -> Scalar:
        """c (1 + 2.276a + 2.577a²)/(3.535a + 2.181a²) below a = c/s = 1.6, c above (Walter et al. 2007, p. 6)."""
        cos, s = _cos(w), jnp.sqrt(_spread(w, slopes))
        a = cos / s
        near = a < 1.6
        small = jnp.where(near, a, 1.0)
        return jnp.where(near, s * (1.0 + small * (2.276 + 2.577 * small)) / (3.535 + 2.181 * small), cos)

    def glsl(self) -> str:
        """Both, for the lobe's slopes."""
        return _functions("D_beckmann", "masked_beckmann_rational")


def _functions(density: str, masked: str) -> str:
    return f"""
float density(vec3 h) {{
    return {density}(h, slopes);
}}

float masked_cos(vec3 w) {{
    return {masked}(w, slopes);
}}
"""


def _cos(w: Vec3) -> Scalar:
    return jnp.maximum(w[2], COS_MIN)


def _spread(w: Vec3, slopes: Slopes) -> Scalar:
    """α_x² ω_x² + α_y² ω_y², kept off zero so that its root has a gradient."""
    ax, ay = slopes
    return jnp.maximum((ax * w[0]) ** 2 + (ay * w[1]) ** 2, 1e-16 * ax * ay)


def visibility(distribution: AbstractDistribution, masking: Masking, slopes: Slopes, pair: Pair) -> Scalar:
    """G/(c_i c_o), finite on the closed hemisphere.

    Args:
        distribution: Gives Smith's Λ.
        masking: "correlated" 1/(1+Λ_i+Λ_o); "separable" 1/((1+Λ_i)(1+Λ_o)); "v-cavity"
            min(1, 2c_h c_i/c_d, 2c_h c_o/c_d), which does not depend on the slopes.
        slopes: alpha_x, alpha_y.
        pair: The two directions with their half vector, in the frame of the tangent.
    """
    ci, co = _cos(pair.wi), _cos(pair.wo)
    if masking == "v-cavity":
        ch, cd = jnp.maximum(pair.h[2], COS_MIN), jnp.maximum(pair.cos_d, COS_MIN)
        return jnp.minimum(1.0 / (ci * co), 2.0 * ch / cd / jnp.maximum(ci, co))
    ai, ao = distribution.masked_cos(pair.wi, slopes), distribution.masked_cos(pair.wo, slopes)
    if masking == "separable":
        return 1.0 / (ai * ao)
    return 1.0 / (ai * co + ao * ci - ci * co)


VISIBILITY: dict[Masking, str] = {
    "correlated": """
// G/(c_i c_o) = 1/(c_i c_o (1 + Lambda_i + Lambda_o)), heights correlated (Heitz 2014).
float visibility(Pair p) {
    float ci = cosine(p.wi), co = cosine(p.wo);
    return 1.0 / (masked_cos(p.wi) * co + masked_cos(p.wo) * ci - ci * co);
}
""",
    "separable": """
// G/(c_i c_o) = 1/(c_i (1 + Lambda_i) c_o (1 + Lambda_o)), Smith.
float visibility(Pair p) {
    return 1.0 / (masked_cos(p.wi) * masked_cos(p.wo));
}
""",
    "v-cavity": """
// G/(c_i c_o), G = min(1, 2 c_h c_i/c_d, 2 c_h c_o/c_d) (Cook & Torrance 1982).
float visibility(Pair p) {
    float ci = cosine(p.wi), co = cosine(p.wo);
    return min(1.0 / (ci * co), 2.0 * cosine(p.h) / max(p.cos_d, 1e-7) / max(ci, co));
}
""",
}
"""`visibility` in GLSL."""
