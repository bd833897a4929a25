"""Coats: a smooth or rough dielectric layer, with absorption; what it mirrors and how the light within sees it.

What goes back and forth between a coat and its base is the business of `exchange`, the whole that of `varnish`.
"""

import dataclasses
from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from fitmat._types import Array, Scalar, Spectrum, Vec3
from fitmat.maths.directions import above
from fitmat.maths.quadrature import cosine_mean
from fitmat.models.around.face import face_albedo, face_curve
from fitmat.models.around.layer import Layer, rough_layer, smooth_layer
from fitmat.models.around.nodes import LEAVING, again_coefficients, again_series
from fitmat.models.around.passage import rough_again, rough_passage
from fitmat.models.base import AbstractBRDF
from fitmat.models.glsl import AbstractShaded, spectrum, table
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.parameters import param
from fitmat.models.terms.distributions import GGX, Isotropic, Masking, added_slopes
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

    @abstractmethod
    def layer(self) -> Layer:
        """The coat as the light within it sees it."""

    @abstractmethod
    def seen(self, base: AbstractBRDF) -> AbstractBRDF:
        """A base with its lobes as wide as they look through the face."""

    @abstractmethod
    def widened(self, slope: Scalar) -> "RoughCoat":
        """The coat as it looks through the rough face of another."""


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

    def layer(self) -> Layer:
        """Under a smooth face."""
        return smooth_layer(self.eta, self.depth, self.reflectance())

    def seen(self, base: AbstractBRDF) -> AbstractBRDF:
        """As it is."""
        return base

    def widened(self, slope: Scalar) -> "RoughCoat":
        """The mirror image becomes a lobe."""
        return RoughCoat(self.eta, slope, self.depth)

    def glsl(self) -> str:
        """What it reflects; its image no value holds."""
        return """
float reflected(float c) {
    return dielectric(c, vec3(eta)).x;
}

vec3 mirrored(vec3 wi, vec3 wo) {
    return vec3(0.0);
}

// What reaches the base, or leaves from there, after the way through the coat.
vec3 passed(float outer, float inner) {
    return (1.0 - reflected(outer)) * exp(-depth / max(inner, 1e-7));
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
        """The GGX lobe with the exact dielectric, and what facets reflect again."""
        again = self._again()
        multiple = again(wi[2]) * again(wo[2]) / (jnp.pi * jnp.maximum(cosine_mean(again), 1e-16))
        return self._face()(wi, wo) + jnp.where(above(wi, wo), multiple, 0.0)

    def _face(self) -> Microfacet:
        return Microfacet(jnp.ones(()), Isotropic(self.alpha), Dielectric(self.eta), GGX(), self.masking)

    def _again(self) -> Callable[[Array], Array]:
        """Cosine → fraction that facets reflect more than once."""
        known = self._coefficients()
        return lambda cos: jnp.maximum(again_series(known, self.alpha, cos), 0.0)

    def _coefficients(self) -> Array:
        """What other maskings than "correlated" hide enters the coat: the table knows none of them."""
        if self.masking != "correlated":
            return jnp.zeros(LEAVING)
        return again_coefficients(rough_again(self.eta, self.alpha), self.alpha)

    def mirror(self, cos: Scalar) -> Scalar:
        """0: its image is a lobe."""
        return jnp.zeros_like(cos)

    def reflectance(self) -> Callable[[Array], Array]:
        """The albedo of its lobe, and what is reflected after several facets."""
        once, again = face_albedo(self.alpha, Dielectric(self.eta), self.masking), self._again()
        return lambda cos: jnp.minimum(once(cos) + again(cos), 1.0)

    def layer(self) -> Layer:
        """Under a rough face."""
        return rough_layer(self.eta, self.alpha, self.depth, self.reflectance(), rough_passage(self.eta, self.alpha))

    def seen(self, base: AbstractBRDF) -> AbstractBRDF:
        """Refracted at a slope m, light turns by (1 − 1/η) m, and a half vector by half of that, on either way."""
        return base.widened(self.alpha * (1.0 - 1.0 / self.eta) / np.sqrt(2.0))

    def widened(self, slope: Scalar) -> "RoughCoat":
        """Its slopes and the other's."""
        return dataclasses.replace(self, alpha=added_slopes(self.alpha, slope))

    def glsl(self) -> str:
        """Its lobe; the albedo of that as the polynomial in √c that the model has, as what facets reflect again."""
        face = self._face()
        known = jax.jit(lambda: self._numbers())()
        lobe = face.single_glsl().replace("return ks * ", "return ")
        parts = face.roughness.glsl(), face.fresnel.glsl(), face.distribution.glsl(), lobe
        names = zip(("albedo", "again", "absorbed"), known, strict=False)
        return (
            "".join(table(name, values) for name, values in names)
            + spectrum("mean", known[-1])
            + "".join(parts)
            + """
// Share of the light from a cosine that facets reflect more than once.
float several(float c) {
    float u = max(c, 0.0) * (1.0 + 2.0 * alpha) / (c + 2.0 * alpha), v = 2.0 * alpha / (c + 2.0 * alpha);
    return max(v * v * coat_series(again, u * u).x, 0.0);
}

// Share of the light from a cosine that the face reflects.
float reflected(float c) {
    return min(clamp(chebyshev(albedo, 2.0 * sqrt(max(c, 1e-8)) - 1.0), 0.0, 1.0) + several(c), 1.0);
}

vec3 mirrored(vec3 wi, vec3 wo) {
    return single(wi, wo) + several(wi.z) * several(wo.z) / (PI * mean);
}

// What reaches the base, or leaves from there, after the way through the coat.
vec3 passed(float outer, float inner) {
    return (1.0 - reflected(outer)) * (1.0 - clamp(coat_series(absorbed, outer), 0.0, 1.0));
}
"""
        )

    def _numbers(self) -> tuple[Array, Array, Array, Scalar]:
        """Tables of the shader, and the mean of what is reflected again."""
        absorbed, again = self.layer().absorbed, self._again()
        assert absorbed is not None
        once = face_curve(self.alpha, Dielectric(self.eta), self.masking).coefficients
        return once, self._coefficients()[:, None], absorbed, jnp.maximum(cosine_mean(again), 1e-16)

    def width(self) -> Scalar:
        """Alpha itself."""
        return self.alpha
