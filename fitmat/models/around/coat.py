"""Coats: a smooth or rough dielectric layer, with absorption, over any base."""

from abc import abstractmethod
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import COS_MIN, above
from fitmat.maths.quadrature import curve, facets
from fitmat.models.base import AbstractBRDF
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.parameters import param
from fitmat.models.terms.distributions import GGX, Isotropic, Masking
from fitmat.models.terms.fresnel import Dielectric, dielectric

NODES = (32, 16)
"""Of the integrals over the facets of a rough coat, zenith and azimuth.

T is then off by at most 1e-4 (for eta below 1.1 and alpha below 0.01, by 0.003), R by 0.001.
"""


def _gauss(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, 1]."""
    x, weights = np.polynomial.legendre.leggauss(count)
    return (x + 1) / 2, weights / 2


_GAUSS = _gauss(16)


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


class AbstractCoat(eqx.Module):
    """A dielectric layer: what it mirrors, lets through and sends back down."""

    name: ClassVar[str]
    eta: eqx.AbstractVar[Scalar]
    depth: eqx.AbstractVar[Spectrum]

    @abstractmethod
    def mirrored(self, wi: Vec3, wo: Vec3) -> Scalar:
        """BRDF of its upper face, sr⁻¹."""

    @abstractmethod
    def transmitted(self, wi: Vec3, wo: Vec3) -> Scalar:
        """Fraction that enters from ω_i times the fraction that leaves towards ω_o, without absorption."""

    @abstractmethod
    def returned(self) -> Spectrum:
        """Fraction of evenly spread light from below that comes back down, absorbed on both passages."""

    @abstractmethod
    def width(self) -> Scalar:
        """Of its lobe; 1 where it has none."""


class SmoothCoat(AbstractCoat):
    """A coat with a polished face, whose mirror image no BRDF value holds."""

    name: ClassVar[str] = "varnish"
    eta: Scalar = _eta()
    depth: Spectrum = _depth()

    def mirrored(self, wi: Vec3, wo: Vec3) -> Scalar:
        """0 in all but one direction."""
        return jnp.zeros(())

    def transmitted(self, wi: Vec3, wo: Vec3) -> Scalar:
        """(1 − F(c_i))(1 − F(c_o))."""
        enter, leave = (1.0 - dielectric(jnp.clip(w[2], 0.0, 1.0), self.eta) for w in (wi, wo))
        return enter * leave

    def returned(self) -> Spectrum:
        """2∫ R(c′) exp(−2τ/c′) c′ dc′ over the inner cosine c′.

        Total reflection below the critical cosine is one part; the other is integrated over the outer cosine c, with
        c′ dc′ = c dc/η².
        """
        cos, share = (jnp.asarray(part) for part in _GAUSS)
        critical = _critical(self.eta)
        inner = jnp.sqrt(1.0 - (1.0 - cos**2) / self.eta**2)
        total = 2.0 * critical**2 * share * cos
        partial = 2.0 * share * cos * dielectric(cos, self.eta) / self.eta**2
        return _absorbed(critical * cos, self.depth) @ total + _absorbed(inner, self.depth) @ partial

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
        face = Microfacet(jnp.ones(()), Isotropic(self.alpha), Dielectric(self.eta), GGX(), self.masking)
        return face(wi, wo)

    def transmitted(self, wi: Vec3, wo: Vec3) -> Scalar:
        """T(c_i) T(c_o), T(c) = ∫ (1 − F) G1(ω_t) over the visible normals."""
        through = curve(lambda cos: self.crossing(cos, self.eta))
        return jnp.clip(through(wi[2]), 0.0, 1.0) * jnp.clip(through(wo[2]), 0.0, 1.0)

    def returned(self) -> Spectrum:
        """2∫ (1 − T′(c′)) exp(−2τ/c′) c′ dc′: what does not cross from inside comes back."""
        part, share = (jnp.asarray(half) for half in _GAUSS)
        edge = jax.lax.stop_gradient(_critical(self.eta))
        cos = jnp.concatenate([edge * part, edge + (1.0 - edge) * part])
        shares = jnp.concatenate([edge * share, (1.0 - edge) * share])
        inside = 1.0 - jax.vmap(lambda c: self.crossing(c, 1.0 / self.eta))(jnp.maximum(cos, COS_MIN))
        return _absorbed(cos, self.depth) @ (2.0 * shares * cos * inside)

    def crossing(self, cos: Scalar, eta: Scalar) -> Scalar:
        """Share of the light from a cosine that crosses the face at one facet and is not masked behind it.

        ∫ D_ω(h) (1 − F) G1(ω_t) dω_h, with the visible normals D_ω(h) = G1(ω) (ω·h) D(h)/c; Walter et al. 2007,
        eq. 40 for ω_t. `eta` is the index behind the face over that before it.
        """
        slopes, normals = (self.alpha, self.alpha), facets(jnp.arccos(cos), self.alpha, nodes=NODES)
        w = normals.wi

        def one(h: Vec3) -> Scalar:
            c = jnp.clip(w @ h, 0.0, 1.0)
            seen = c * GGX().density(h, slopes) / GGX().masked_cos(w, slopes)
            inner = jnp.sqrt(jnp.maximum(1.0 - (1.0 - c**2) / eta**2, 1e-16))
            through = w / eta - (c / eta - inner) * h
            leaving = jnp.where(through[2] > 0.0, through[2] / GGX().masked_cos(through, slopes), 0.0)
            return seen * leaving * (1.0 - dielectric(c, eta))

        return normals.solid @ jax.vmap(one)(normals.h)

    def width(self) -> Scalar:
        """Alpha itself."""
        return self.alpha


def _critical(eta: Scalar) -> Scalar:
    """Cosine of the angle of total reflection inside, √(1 − 1/η²)."""
    return jnp.sqrt(jnp.maximum(1.0 - 1.0 / eta**2, 1e-16))


def _absorbed(cos: Spectrum, depth: Spectrum) -> Spectrum:
    """exp(−2τ/c), the light left after going up and down at cosines (k,); (k,) or (c, k) as τ is one or c numbers."""
    return jnp.exp(-2.0 * depth[..., None] / jnp.maximum(cos, COS_MIN))


class Varnish(AbstractBRDF):
    """A dielectric coat over a base: `varnish-over-BASE` (polished), `rough-varnish-over-BASE` (GGX face).

    f = f_c + T(c_i) T(c_o)/η² · exp(−τ/c_i′ − τ/c_o′) · (f_b(ω_i′, ω_o′) + ρ² R/(π(1 − ρR)))

    ω′ are the directions refracted into the coat, f_b is the base and ρ its diffuse albedo, R the share of diffuse
    light that the coat's underside returns: for a Lambert base the last term sums up to ρ/(π(1 − ρR)).

    Parameters: eta, index of the coat, 1 to 3, shared; depth, absorption coefficient times thickness, 0 to 10, per
    channel: 0.1 is yellowed varnish; alpha, slope of the face, rough coat only, 0.001 to 1: 0.03 is glossy; and those
    of the base.

    Limits: the mirror image in a polished coat is a single direction, which no BRDF value holds: peaks that were
    measured need the rough coat. The base is seen along directions refracted at the mean normal; what is lost
    between facets is not given back; only the diffuse part of the base exchanges light with the coat. Positive,
    reciprocal, conserves energy where the base does.

    References: J. Saunderson, Calculation of the color of pigmented plastics, JOSA 32, 1942; B. Walter et al., EGSR
    2007; A. Weidlich & A. Wilkie, Arbitrarily layered micro-facet surfaces, GRAPHITE 2007 (refracted directions and
    absorption); W. Jakob et al., Mitsuba 3, plugins `plastic` and `roughplastic`.

    Example: `fm.model("rough-varnish-over-lambert", kd=0.4, alpha=0.05, depth=0.1)`
    """

    coat: AbstractCoat
    base: AbstractBRDF

    @property
    def name(self) -> str:
        """The coat's name, "-over-", the base's name."""
        return f"{self.coat.name}-over-{self.base.name}"

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """What the coat mirrors, and what the base sends through it."""
        coat = self.coat
        down, up = _refracted(wi, coat.eta), _refracted(wo, coat.eta)
        rho, back = self.base.diffuse_albedo(), coat.returned()
        again = rho**2 * back / (jnp.pi * (1.0 - rho * back))
        left = jnp.exp(-coat.depth * (1.0 / down[2] + 1.0 / up[2]))
        inner = coat.transmitted(wi, wo) / coat.eta**2 * left * (self.base(down, up) + again)
        return jnp.where(above(wi, wo), coat.mirrored(wi, wo) + inner, 0.0)

    def width(self) -> Scalar:
        """Of the narrower of coat and base."""
        return jnp.minimum(self.coat.width(), self.base.width())

    @property
    def isotropic(self) -> bool:
        """Where the base is."""
        return self.base.isotropic

    def diffuse_albedo(self) -> Spectrum:
        """At most that of the base."""
        return self.base.diffuse_albedo()


def _refracted(w: Vec3, eta: Scalar) -> Vec3:
    """The direction inside the coat, still pointing up: sin θ′ = sin θ/η, cos θ′ = √(η² − 1 + cos² θ)/η."""
    square = (eta - 1.0) * (eta + 1.0) + jnp.maximum(w[2], 0.0) ** 2  # without the cancellation of 1 − sin² θ/η²
    return jnp.stack([w[0], w[1], jnp.sqrt(jnp.maximum(square, COS_MIN**2))]) / eta
