"""What Disney's two models share: roughness with an aspect, the tint, sheen and clearcoat.

Diffuse terms and Fresnel blends, in which the two differ, stand with each model.
"""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import Pair, rotated
from fitmat.models.base import TURNED
from fitmat.models.glsl import AbstractShaded
from fitmat.models.parameters import param
from fitmat.models.terms.distributions import GGX, AbstractRoughness, Slopes, visibility
from fitmat.models.terms.fresnel import schlick

ALPHA_MIN = 1e-3
"""Floor of both slopes, as in disney.brdf; reached where roughness² · √(1 − 0.9 anisotropic) is smaller."""

BLACK = 1e-30
"""A base colour with less luminance than this has no hue."""

_LUMINANCE = np.array([0.3, 0.6, 0.1])
# disney.brdf's approximation, for red, green and blue.

_COAT_MASKING = 0.25
_COAT_F0 = 0.04


def base_color() -> Any:
    """The parameter base_color; both models are affine in it as long as nothing is tinted."""
    return param(
        0.0, 1.0, symbol="c_base", per_channel=True, weight=True, default=0.5,
        doc="linear colour: diffuse albedo of a dielectric, F0 of a metal; 0.1 is dark grey, 0.8 a white wall",
    )  # fmt: skip


def fraction(symbol: str, default: float, starts: tuple[float, ...], doc: str) -> Any:
    """A parameter from 0 to 1, shared by the channels."""
    return param(0.0, 1.0, symbol=symbol, default=default, starts=starts, doc=doc)


class Perceptual(AbstractRoughness):
    """The artists' roughness, squared, stretched along a tangent `rotation` degrees from the x axis of the sample.

    α_x = max(0.001, r²/a), α_y = max(0.001, r² a), a = √(1 − 0.9 anisotropic): disney.brdf, `ax` and `ay`.
    """

    suffix: ClassVar[str] = ""
    isotropic: ClassVar[bool] = False
    roughness: Scalar = fraction(
        "r", 0.5, (0.15, 0.3, 0.5, 0.8), "square root of the slope parameter; 0.1 is nearly a mirror, 0.5 satin"
    )
    anisotropic: Scalar = fraction(
        "a", 0.0, (0.2,), "0 is isotropic, 1 stretches the highlight ten to one along the tangent; 0.1 is hardly seen"
    )
    rotation: Scalar = param(
        -180.0, 180.0, symbol="φ_t", unit="°", default=0.0, starts=(0.0,), period=180.0,
        doc="azimuth of the tangent in the frame of the measured azimuths; half a turn changes nothing",
    )  # fmt: skip

    @property
    def slopes(self) -> Slopes:
        """(alpha_x, alpha_y)."""
        aspect, alpha = jnp.sqrt(1.0 - 0.9 * self.anisotropic), self.roughness**2
        return jnp.maximum(alpha / aspect, ALPHA_MIN), jnp.maximum(alpha * aspect, ALPHA_MIN)

    def local(self, w: Vec3) -> Vec3:
        """The direction turned by −rotation about the normal."""
        return rotated(w, -jnp.deg2rad(self.rotation))

    def glsl(self) -> str:
        """The slopes and the turned frame."""
        return (
            """
const float aspect = sqrt(1.0 - 0.9 * anisotropic);
const vec2 slopes = max(vec2(roughness * roughness / aspect, roughness * roughness * aspect), 0.001);
"""
            + TURNED
        )


def tint(base: Spectrum) -> Spectrum:
    """The base colour over its luminance, 1 where it is black (disney.brdf, `Ctint`).

    The luminance is 0.3 R + 0.6 G + 0.1 B for three channels and the mean for any other number; one channel has no
    hue, and its tint is 1.
    """
    if jnp.size(base) == 1:
        return jnp.ones_like(base)
    luminance = _LUMINANCE.astype(base.dtype) @ base if jnp.size(base) == 3 else jnp.mean(base)
    coloured = luminance > BLACK
    return jnp.where(coloured, base / jnp.where(coloured, luminance, 1.0), 1.0)


def tinted(base: Spectrum, amount: Scalar) -> Spectrum:
    """From 1 to the tint of the base colour."""
    return 1.0 - amount + amount * tint(base)


def specular(p: Pair, slopes: Slopes, masking: Slopes) -> Scalar:
    """D G/(4 c_i c_o): GGX with separable Smith masking, whose slopes may be others than the distribution's."""
    return GGX().density(p.h, slopes) * visibility(GGX(), "separable", masking, p) / 4.0


class Sheen(AbstractShaded):
    """Light at grazing angles to h, as cloth shows it: sheen · (1 − c_d)⁵, tinted (disney.brdf, `Fsheen`)."""

    sheen: Scalar = param(
        0.0, 1.0, symbol="s", weight=True, default=0.0,
        doc="strength at grazing angles; 0.1 is dusty, 1 velvet",
    )  # fmt: skip
    sheen_tint: Scalar = fraction("t_s", 0.5, (0.1,), "how much of the base colour's hue it takes; 0.1 is nearly white")

    def __call__(self, base: Spectrum, p: Pair) -> Spectrum:
        """Sheen in sr⁻¹ for the base colour."""
        return self.sheen * schlick(p.cos_d, 0.0) * tinted(base, self.sheen_tint)

    def glsl(self) -> str:
        """The same."""
        return """
vec3 cloth(Pair p) {
    return sheen * pow5(1.0 - p.cos_d) * mix(vec3(1.0), hue(base_color), sheen_tint);
}
"""


class Clearcoat(AbstractShaded):
    """A thin coat with F0 = 0.04, GTR1 normals and a quarter of the weight (disney.brdf, `Dr`, `Fr`, `Gr`).

    ¼ clearcoat F D_GTR1 G/(4 c_i c_o); G is Smith's for GGX with α = 0.25, whatever the gloss.
    """

    clearcoat: Scalar = param(
        0.0, 1.0, symbol="k_c", weight=True, default=0.0,
        doc="strength of the coat; 0.1 is a faint second highlight, 1 a car's varnish",
    )  # fmt: skip
    clearcoat_gloss: Scalar = fraction(
        "g", 1.0, (0.5,), "width of the coat's highlight: α from 0.1 at 0 (satin) to 0.001 at 1; 0.1 is 0.09"
    )

    @property
    def alpha(self) -> Scalar:
        """0.1 at gloss 0, 0.001 at gloss 1."""
        return 0.1 + (1e-3 - 0.1) * self.clearcoat_gloss

    def __call__(self, p: Pair) -> Scalar:
        """¼ clearcoat F D G/(4 c_i c_o)."""
        masking = jnp.asarray(_COAT_MASKING)
        g_cc = visibility(GGX(), "separable", (masking, masking), p)
        return 0.25 * self.clearcoat * schlick(p.cos_d, _COAT_F0) * gtr1(p.h, self.alpha) * g_cc / 4.0

    def glsl(self) -> str:
        """The same."""
        return """
float coat(Pair p) {
    float D = D_gtr1(p.h, mix(0.1, 0.001, clearcoat_gloss));
    float G_cc = 1.0 / (masked_ggx(p.wi, vec2(0.25)) * masked_ggx(p.wo, vec2(0.25)));
    return 0.25 * clearcoat * schlick(p.cos_d, 0.04) * D * G_cc / 4.0;
}
"""

    def width(self) -> Scalar:
        """Alpha, or 1 where there is no coat."""
        return jnp.where(self.clearcoat > 0.0, self.alpha, 1.0)


def gtr1(h: Vec3, alpha: Scalar) -> Scalar:
    """(α² − 1)/(π ln α² (1 + (α² − 1) c_h²)), 0 < α < 1: Berry's distribution (Burley 2012, app. B.2)."""
    a2 = alpha**2
    return (a2 - 1.0) / (jnp.pi * jnp.log(a2) * (h[0] ** 2 + h[1] ** 2 + a2 * h[2] ** 2))


def narrowest(shape: Perceptual, coat: Clearcoat) -> Scalar:
    """The smallest slope of the two highlights, at most 1."""
    return jnp.minimum(shape.width(), coat.width())
