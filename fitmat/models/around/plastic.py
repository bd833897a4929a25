"""Rough plastic: a GGX face over a coloured diffuse body, with the light that bounces between the two."""

import dataclasses
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import above
from fitmat.maths.quadrature import gauss
from fitmat.models.around.coat import RoughCoat
from fitmat.models.base import AbstractLobe
from fitmat.models.glsl import spectrum
from fitmat.models.parameters import param
from fitmat.models.terms.distributions import Masking, added_slopes


class Plastic(AbstractLobe):
    """A dielectric with a rough face over a diffuse body: one alpha and one eta for gloss and colour.

    f = ks (F D G/(4 c_i c_o) + m(c_i) m(c_o)/(π m_avg)) + T(c_i) T(c_o) kd/(π η² (1 − kd R))

    m(c) is what facets reflect more than once (a table made of photons), m_avg = 2∫ m c dc, T(c) what the rough face
    does not mirror, 1 − its albedo, R what its underside returns of diffuse light. Unlike `lambert+ggx` the terms share
    the light: where the face mirrors more, less colour comes out, and kd is the albedo of the body inside.

    Parameters: ks, weight of the face's reflection, 0 to 10 (1 for a bare dielectric), shared; alpha, slope
    parameter, 0.001 to 1, shared: 0.05 is glossy, 0.3 matt; eta, index of refraction, 1 to 3, shared; kd, albedo of
    the body, 0 to 1, per channel: 0.5 is a mid grey.

    Static choice: masking, as `ggx`; "separable" is Mitsuba's.

    Limits: kd = 0 is black plastic; eta = 1 is `lambert`. The albedo is that of photons within 1 %, and 1 for kd = 1
    at any roughness. Mitsuba's `roughplastic` loses light that meets several facets: ours is brighter up to 78°, for
    kd = 0.5, by up to 3 % at alpha 0.03, 16 % at 0.1, 44 % at 0.3. With other maskings than "correlated" m is 0.
    Positive, reciprocal, conserves energy for ks ≤ 1.

    References: B. Walter et al., EGSR 2007; internal reflection: J. Saunderson, JOSA 32, 1942; as in W. Jakob et al.,
    Mitsuba 3, plugin `roughplastic` with `nonlinear`.

    Example: `fm.model("plastic", kd=0.4, alpha=0.1, eta=1.5)`
    """

    label: ClassVar[str] = "plastic"
    numbers: ClassVar[tuple[str, ...]] = ("alpha", "eta")

    ks: Scalar = param(
        0.0, 10.0, symbol="k_s", weight=True, default=1.0, doc="specular weight; 1 for a bare dielectric"
    )  # fmt: skip
    alpha: Scalar = param(
        1e-3, 1.0, symbol="α", scale="log", default=0.1, starts=(0.005, 0.02, 0.06, 0.15, 0.3, 0.6),
        doc="slope parameter of the face; 0.1 is satin",
    )  # fmt: skip
    eta: Scalar = param(
        1.0, 3.0, symbol="η", scale="log", default=1.5, starts=(1.3, 1.5, 1.8),
        doc="index of refraction; plastics 1.4–1.6",
    )  # fmt: skip
    kd: Spectrum = param(
        0.0, 1.0, symbol="k_d", per_channel=True, default=0.5, starts=(0.05, 0.3, 0.6, 0.9),
        doc="albedo of the body below the face",
    )  # fmt: skip
    masking: Masking = eqx.field(static=True, default="correlated")

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """The face's lobe, and a Lambert body under it: a rough coat over Lambert that absorbs nothing."""
        face, known = self._face(), self._face().reflectance()
        through = (1.0 - known(wi[2])) * (1.0 - known(wo[2]))
        body = through * self.kd / (jnp.pi * self.eta**2 * (1.0 - self.kd * self._returned()))
        return jnp.where(above(wi, wo), self.ks * face.mirrored(wi, wo) + body, 0.0)

    def _face(self) -> RoughCoat:
        return RoughCoat(self.eta, self.alpha, jnp.zeros(()), self.masking)

    def _returned(self) -> Scalar:
        """1 − ∫ (1 − R₁) 2c dc/η² (D. B. Judd, J. Res. NBS 29, 1942)."""
        known = self._face().reflectance()
        x, weights = gauss(16)
        return 1.0 - jnp.asarray(weights * (x + 1.0) / 2.0) @ (1.0 - known(jnp.asarray((x + 1.0) / 2.0))) / self.eta**2

    def glsl(self) -> str:
        """The same."""
        return (
            self._face().glsl()
            + spectrum("returned", jax.jit(lambda: self._returned())())
            + """
vec3 lobe(vec3 wi, vec3 wo) {
    float through = (1.0 - reflected(wi.z)) * (1.0 - reflected(wo.z));
    vec3 body = through * kd / (PI * eta * eta * (1.0 - kd * returned));
    return ks * mirrored(wi, wo) + body;
}
"""
        )

    def widened(self, slope: Scalar) -> "Plastic":
        """The face's slopes and the other's."""
        return dataclasses.replace(self, alpha=added_slopes(self.alpha, slope))

    def width(self) -> Scalar:
        """Alpha itself."""
        return self.alpha
