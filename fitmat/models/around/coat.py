"""Coats: a smooth or rough dielectric layer, with absorption, over any base."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from fitmat._types import Array, Scalar, Spectrum, Vec3
from fitmat.maths.directions import above
from fitmat.models.around.exchange import exchange, light_glsl, mirrored
from fitmat.models.around.face import face_albedo, face_curve
from fitmat.models.around.layer import Layer
from fitmat.models.base import AbstractBRDF
from fitmat.models.glsl import EVERY, AbstractShaded, table
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.parameters import param
from fitmat.models.terms.distributions import GGX, Isotropic, Masking
from fitmat.models.terms.fresnel import Dielectric, dielectric


def _eta() -> Any:
    return param(
        1.0, 3.0, symbol="η_c", scale="log", default=1.5, starts=(1.5,),
        doc="index of refraction of the coat; varnish and polymers 1.45–1.6",
    )  # fmt: skip


def _depth() -> Any:
    return param(
        0.0, 10.0, symbol="τ", per_channel=True, default=0.0, starts=(0.1,),
        doc="absorption coefficient times thickness of the coat; 0.1 takes a tenth of the light on one passage",
    )  # fmt: skip


class AbstractCoat(AbstractShaded):
    """A dielectric layer: what its upper face mirrors, and how much."""

    name: ClassVar[str]
    eta: eqx.AbstractVar[Scalar]
    depth: eqx.AbstractVar[Spectrum]

    @abstractmethod
    def mirrored(self, wi: Vec3, wo: Vec3) -> Scalar:
        """BRDF of its upper face, sr⁻¹."""

    @abstractmethod
    def mirror(self, cos: Scalar) -> Scalar:
        """Fraction that its upper face reflects in the mirror direction alone."""

    @abstractmethod
    def reflectance(self) -> Callable[[Array], Array]:
        """Cosine → fraction of the light from there that its upper face reflects; the rest enters."""

    @abstractmethod
    def width(self) -> Scalar:
        """Of its lobe; 1 where it has none."""

    def layer(self) -> Layer:
        """The coat as the light within it sees it."""
        return Layer(self.eta, self.depth, self.reflectance())


class SmoothCoat(AbstractCoat):
    """A coat with a polished face, whose mirror image no BRDF value holds."""

    name: ClassVar[str] = "varnish"
    eta: Scalar = _eta()
    depth: Spectrum = _depth()

    def mirrored(self, wi: Vec3, wo: Vec3) -> Scalar:
        """0 in all but one direction."""
        return jnp.zeros(())

    def mirror(self, cos: Scalar) -> Scalar:
        """F(c)."""
        return dielectric(cos, self.eta)

    def reflectance(self) -> Callable[[Array], Array]:
        """F(c)."""
        return lambda cos: dielectric(cos, self.eta)

    def glsl(self) -> str:
        """What it reflects; its image no value holds."""
        return """
float reflected(float c) {
    return dielectric(c, vec3(eta)).x;
}

vec3 mirrored(vec3 wi, vec3 wo) {
    return vec3(0.0);
}
"""

    def width(self) -> Scalar:
        """None."""
        return jnp.array(1.0)


class RoughCoat(AbstractCoat):
    """A coat whose face is a GGX surface."""

    name: ClassVar[str] = "rough-varnish"
    eta: Scalar = _eta()
    alpha: Scalar = param(
        1e-3, 1.0, symbol="α_c", scale="log", default=0.1, starts=(0.01, 0.03, 0.1, 0.3),
        doc="slope parameter of the coat's face; 0.03 is glossy, 0.3 matt",
    )  # fmt: skip
    depth: Spectrum = _depth()
    masking: Masking = eqx.field(static=True, default="correlated")

    def mirrored(self, wi: Vec3, wo: Vec3) -> Scalar:
        """The GGX lobe with the exact dielectric."""
        return self._face()(wi, wo)

    def _face(self) -> Microfacet:
        return Microfacet(jnp.ones(()), Isotropic(self.alpha), Dielectric(self.eta), GGX(), self.masking)

    def mirror(self, cos: Scalar) -> Scalar:
        """0: its image is a lobe."""
        return jnp.zeros_like(cos)

    def reflectance(self) -> Callable[[Array], Array]:
        """The albedo of its lobe."""
        return face_albedo(self.alpha, Dielectric(self.eta), self.masking)

    def glsl(self) -> str:
        """Its lobe, and the albedo of that as the polynomial in √c that the model has."""
        face = self._face()
        known = jax.jit(lambda: face_curve(self.alpha, Dielectric(self.eta), self.masking).coefficients)()
        lobe = face.glsl().replace("vec3 lobe(", "vec3 mirrored(").replace("return ks * ", "return ")
        parts = face.roughness.glsl(), face.fresnel.glsl(), face.distribution.glsl(), lobe
        return (
            table("albedo", known)
            + "".join(parts)
            + """
// Share of the light from a cosine that the face reflects.
float reflected(float c) {
    return clamp(chebyshev(albedo, 2.0 * sqrt(max(c, 1e-8)) - 1.0), 0.0, 1.0);
}
"""
        )

    def width(self) -> Scalar:
        """Alpha itself."""
        return self.alpha


class Varnish(AbstractBRDF):
    """A dielectric coat over a base: `varnish-over-BASE` (polished), `rough-varnish-over-BASE` (GGX face).

    f = f_c + T(c_i) T(c_o)/η² · exp(−τ/c_i′ − τ/c_o′) · (f_b(ω_i′, ω_o′) h(c_i) h(c_o) + η² e(c_i) e(c_o)/(π ē))

    ω′ are the directions refracted into the coat, f_b is the base, T(c) what the face does not reflect: 1 − F, or 1 −
    the albedo of the lobe of a rough face. What the underside returns meets the base again, any number of times: h and
    e come from the adding equation for energies, solved with the base's own values. h² = 1/(1 − s), s being what one
    more bounce adds to the base in the mirror direction, relative, raises the base's lobe; e is the energy that leaves
    besides, spread as Kulla & Conty spread it, ē = 2∫ e T exp(−τ/c′) c dc. For a Lambert base all of it is
    Saunderson's kd/(π(1 − kd R)), R the share of even light that the underside returns.

    Parameters: eta, index of the coat, 1 to 3, shared; depth, absorption coefficient times thickness, 0 to 10, per
    channel: 0.1 is yellowed varnish; alpha, slope of the face, rough coat only, 0.001 to 1: 0.03 is glossy; and those
    of the base.

    Limits: the mirror image in a polished coat is a single direction, which no BRDF value holds: peaks that were
    measured need the rough coat. The albedo with the mirror is that of photons within 0.8 % for smooth coats; for
    rough ones over a diffuse base within 1 % up to 60°, 3 % at 80°; and 1 over a base that keeps all. Where light goes
    that came back several times is approximate: the peak over a metal (F0 0.9) is right to 1 % at normal incidence,
    5 % at 60°. Under a rough face the base is seen along directions refracted at the mean normal: its lobe is not
    widened, and a metal is too bright, its albedo by 0.01 at alpha 0.1, 0.04 at 0.3, 0.09 at 1. eta = 1 is the base.
    Positive, reciprocal, conserves energy where the base does.

    References: J. Saunderson, Calculation of the color of pigmented plastics, JOSA 32, 1942; K. N. Liou, An
    Introduction to Atmospheric Radiation, 2002, sec. 6.4 (adding); C. Kulla & A. Conty, SIGGRAPH course 2017; A.
    Weidlich & A. Wilkie, Arbitrarily layered micro-facet surfaces, GRAPHITE 2007 (refracted directions and
    absorption); W. Jakob et al., Mitsuba 3, plugin `plastic`.

    Example: `fm.model("rough-varnish-over-lambert", kd=0.4, alpha=0.05, depth=0.1)`
    """

    numbers: ClassVar[tuple[str, ...]] = (EVERY,)

    coat: AbstractCoat
    base: AbstractBRDF

    @property
    def name(self) -> str:
        """The coat's name, "-over-", the base's name."""
        return f"{self.coat.name}-over-{self.base.name}"

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """What the coat mirrors, and what the base sends through it."""
        layer = self.coat.layer()
        light = exchange(self.base, layer)
        down, up = layer.refracted(wi), layer.refracted(wo)
        enter, leave = layer.crossing(wi[2], down[2])[0], layer.crossing(wo[2], up[2])[0]
        body = self.base(down, up) * light.raised(wi[2]) * light.raised(wo[2]) + light.spread(wi[2], wo[2])
        return jnp.where(above(wi, wo), self.coat.mirrored(wi, wo) + enter * leave / layer.eta**2 * body, 0.0)

    def glsl(self) -> str:
        """The same; what goes back and forth between coat and base is numbers, unless the base has a polished coat."""
        if any(isinstance(part, SmoothCoat) for part in jax.tree.leaves(self.base, is_leaf=_is_smooth)):
            return ""
        light = jax.jit(lambda: exchange(self.base, self.coat.layer()).numbers())()
        return (
            light_glsl(*light)
            + """
vec3 refracted(vec3 w) {
    return vec3(w.xy / eta, sqrt(max((eta - 1.0) * (eta + 1.0) + w.z * w.z, 1e-14)) / eta);
}

// What enters, or leaves, and is left of it after the way through the coat.
vec3 passed(float outer, float inner) {
    return (1.0 - reflected(outer)) * exp(-depth / max(inner, 1e-7));
}

vec3 lobe(vec3 wi, vec3 wo) {
    vec3 down = refracted(wi), up = refracted(wo);
    vec3 body = base(down, up) * raised(wi.z) * raised(wo.z);
    vec3 spread = eta * eta * later(wi.z) * later(wo.z) / (PI * whole);
    return mirrored(wi, wo) + passed(wi.z, down.z) * passed(wo.z, up.z) / (eta * eta) * (body + spread);
}
"""
        )

    def mirror(self, wi: Vec3) -> Spectrum:
        """That of the polished face, and of a polished coat below it through this one."""
        return self.coat.mirror(wi[2]) + mirrored(self.base, self.coat.layer(), wi)

    def width(self) -> Scalar:
        """Of the narrower of coat and base."""
        return jnp.minimum(self.coat.width(), self.base.width())

    @property
    def isotropic(self) -> bool:
        """Where the base is."""
        return self.base.isotropic


def _is_smooth(part: object) -> bool:
    return isinstance(part, SmoothCoat)
