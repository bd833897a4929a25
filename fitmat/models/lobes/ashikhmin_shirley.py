"""Ashikhmin and Shirley's anisotropic Phong model: a Fresnel-weighted lobe and the diffuse light that it leaves over.

The two terms are one model and cannot be had apart.
"""

from abc import abstractmethod
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import COS_MIN, above, pair, rotated
from fitmat.models.base import LEVEL, TURNED, AbstractLobe, AbstractShape
from fitmat.models.parameters import param
from fitmat.models.terms.fresnel import Schlick

SERIES = 1e-4
"""Below this sin²θ_h the logarithm is summed as a series, whose first omitted term is 10⁻¹⁷ of it."""


class AbstractExponents(AbstractShape):
    """How sharp the lobe is."""

    @property
    @abstractmethod
    def along(self) -> tuple[Scalar, Scalar]:
        """(n_u, n_v): the exponents along the tangent and across it."""


class OneExponent(AbstractExponents):
    """The same exponent in all directions."""

    suffix: ClassVar[str] = ""
    isotropic: ClassVar[bool] = True
    exponent: Scalar = param(
        0.1, 1e5, symbol="n", scale="log", default=50.0,
        starts=(1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 3e4),
        doc="lobe exponent; 10 is dull, 1000 glossy, 10⁵ nearly a mirror",
    )  # fmt: skip

    @property
    def along(self) -> tuple[Scalar, Scalar]:
        """(exponent, exponent)."""
        return self.exponent, self.exponent

    def local(self, w: Vec3) -> Vec3:
        """The direction itself."""
        return w

    def glsl(self) -> str:
        """The exponents and the level frame."""
        return "const vec2 exponents = vec2(exponent);\n" + LEVEL


def _exponent(symbol: str, along: str, default: float) -> Any:
    return param(
        0.1, 1e5, symbol=symbol, scale="log", default=default, starts=(10.0, 100.0, 1e3, 1e4),
        doc=f"lobe exponent {along} the tangent; 10 is dull, 1000 glossy; unequal ones are brushed",
    )  # fmt: skip


class TwoExponents(AbstractExponents):
    """Two exponents, along and across a tangent that lies `rotation` degrees from the x axis of the sample.

    (exponent_u, exponent_v, rotation) and (exponent_v, exponent_u, rotation ± 90°) are the same surface.
    """

    suffix: ClassVar[str] = "-aniso"
    isotropic: ClassVar[bool] = False
    exchanged: ClassVar[tuple[str, ...]] = ("exponent_u", "exponent_v")
    exponent_u: Scalar = _exponent("n_u", "along", 200.0)
    exponent_v: Scalar = _exponent("n_v", "across", 20.0)
    rotation: Scalar = param(
        -180.0, 180.0, symbol="φ_t", unit="°", default=0.0, starts=(0.0, 45.0), period=180.0,
        doc="azimuth of the tangent in the frame of the measured azimuths; half a turn changes nothing",
    )  # fmt: skip

    @property
    def along(self) -> tuple[Scalar, Scalar]:
        """(exponent_u, exponent_v)."""
        return self.exponent_u, self.exponent_v

    def local(self, w: Vec3) -> Vec3:
        """The direction turned by −rotation about the normal."""
        return rotated(w, -jnp.deg2rad(self.rotation))

    def glsl(self) -> str:
        """The exponents and the turned frame."""
        return "const vec2 exponents = vec2(exponent_u, exponent_v);\n" + TURNED


class AshikhminShirley(AbstractLobe):
    """Ashikhmin & Shirley 2000, specular and diffuse.

    f = √((n_u+1)(n_v+1))/(8π) c_h^((n_u h_u² + n_v h_v²)/(1 − c_h²)) F(c_d)/(c_d max(c_i, c_o))
    + 28 kd/(23π) (1 − F0)(1 − (1 − c_i/2)⁵)(1 − (1 − c_o/2)⁵)

    Parameters: kd, the albedo of the substrate, 0 to 1, per channel; f0, reflectance at normal incidence, 0.0001 to
    0.999, per channel: 0.04 is plastic; exponent, 0.1 to 10⁵, shared: 10 is dull, 1000 glossy; with `-aniso`
    exponent_u and exponent_v along and across a tangent at the azimuth `rotation` (degrees).

    Limits: at normal incidence a sharp lobe reflects f0, a wide one less: (n − 1 + 2^((1−n)/2))/(n + 3) of it. The
    diffuse term reflects kd (1 − f0)(1 − (1 − c_i/2)⁵), which is 31/32 of kd (1 − f0) at normal incidence and
    nothing at grazing. Positive, reciprocal, conserves energy. Across c_i = c_o the lobe has a crease. No masking.

    References: M. Ashikhmin & P. Shirley, An anisotropic Phong BRDF model, JGT 5(2), 2000; Fresnel:
    C. Schlick, An inexpensive BRDF model for physically-based rendering, Eurographics 1994.

    Example: `fm.model("ashikhmin-shirley", kd=0.3, f0=0.05, exponent=200)`
    """

    label: ClassVar[str] = "ashikhmin-shirley{exponents.suffix}"

    kd: Spectrum = param(
        0.0, 1.0, symbol="k_d", per_channel=True, weight=True, default=0.5, doc="albedo of the substrate"
    )  # fmt: skip
    exponents: AbstractExponents = eqx.field(default_factory=OneExponent)
    fresnel: Schlick = eqx.field(default_factory=Schlick)

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """The specular lobe plus the coupled diffuse term."""
        p, (nu, nv) = pair(wi, wo), self.exponents.along
        h = self.exponents.local(p.h)
        ci, co, cd = (jnp.maximum(c, COS_MIN) for c in (wi[2], wo[2], p.cos_d))
        power = jnp.exp((nu * h[0] ** 2 + nv * h[1] ** 2) * _log_cos_over_sin2(h))
        lobe = jnp.sqrt((nu + 1.0) * (nv + 1.0)) / (8.0 * jnp.pi) * power / (cd * jnp.maximum(ci, co))
        diffuse = 28.0 / (23.0 * jnp.pi) * (1.0 - self.fresnel.normal_reflectance()) * _entering(ci) * _entering(co)
        return jnp.where(above(wi, wo), lobe * self.fresnel(p.cos_d) + self.kd * diffuse, 0.0)

    def glsl(self) -> str:
        """The same."""
        return """
float entering(float c) {
    return 1.0 - pow5(1.0 - c / 2.0);
}

vec3 lobe(vec3 wi, vec3 wo) {
    Pair p = facets(wi, wo);
    float sin2 = dot(p.h.xy, p.h.xy), steep = dot(exponents, p.h.xy * p.h.xy);
    float peak = exp(steep * (sin2 > 0.0 ? 0.5 * log_one_minus(min(sin2, 0.9999999)) / sin2 : -0.5));
    float top = sqrt((exponents.x + 1.0) * (exponents.y + 1.0)) / (8.0 * PI);
    vec3 gloss = top * peak * fresnel(p.cos_d) / (max(p.cos_d, 1e-7) * larger_cosine(wi, wo));
    return gloss + 28.0 * kd / (23.0 * PI) * (1.0 - f0) * entering(wi.z) * entering(wo.z);
}
"""

    def width(self) -> Scalar:
        """√(2/(n+2)) of the larger exponent n: the α of the microfacet lobe with the same curvature at its peak."""
        return jnp.minimum(jnp.sqrt(2.0 / (jnp.maximum(*self.exponents.along) + 2.0)), 1.0)


def _entering(cos: Scalar) -> Scalar:
    """1 − (1 − c/2)⁵."""
    return 1.0 - (1.0 - cos / 2.0) ** 5


def _log_cos_over_sin2(h: Vec3) -> Scalar:
    """ln(c_h)/sin²θ_h, smooth through the normal, where it is −½: −½(1 + s/2 + s²/3 + s³/4), s = sin²θ_h."""
    s = h[0] ** 2 + h[1] ** 2
    near = s < SERIES
    series = -0.5 * (1.0 + s * (1.0 / 2.0 + s * (1.0 / 3.0 + s / 4.0)))
    return jnp.where(near, series, jnp.log(jnp.maximum(h[2], COS_MIN)) / jnp.where(near, 1.0, s))
