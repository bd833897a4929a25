"""The ABg scatter of optical designers: a plateau and a power law in the distance from the mirror direction.

It holds the scattered light only; the mirror beam itself is no BRDF.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

import jax.numpy as jnp

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import above
from fitmat.models.base import AbstractSpecular
from fitmat.models.parameters import param

NARROWEST = 1e-4
"""Smallest lobe width that is reported: a quadrature need not resolve the tip of a power law any finer."""

_TINY = 1e-300


class ABg(AbstractSpecular):
    """ABg, the three-parameter scatter of ASAP, FRED and Zemax OpticStudio.

    f = A/(B + |β − β₀|^g),  β − β₀ = the projection of ω_i + ω_o on the surface

    β and β₀ are the projections of ω_o and of the mirror direction of ω_i on the surface, so that |β − β₀| is 0 in
    the mirror direction, about twice the slope of h near it, and at most 2.

    Parameters: a, the level A, 10⁻⁹ to 10 (log), per channel; b, 10⁻¹² to 10, shared: the plateau A/B ends where
    |β − β₀| = B^(1/g), so that at g = 2 b = 0.01 is a lobe of 0.1, satin, and 10⁻⁶ a polished mirror; g, the slope
    of the wing in a log-log plot, 0.1 to 6, shared: 0.1 is nearly Lambert's A/(B + 1), 1 to 3 polished optics.

    Limits: positive and reciprocal. Energy depends on A: at normal incidence the lobe scatters
    TIS = (πA/B) ₂F₁(1, 2/g; 1 + 2/g; −1/B), which at g = 2 is πA ln(1 + 1/B); nothing holds it below 1. The default
    values scatter 1.45 %. Parameters of one wavelength are not those of another.

    References: R. N. Pfisterer, Approximated scatter models for stray light analysis, Optics & Photonics News 22(10),
    2011; Zemax OpticStudio user guide, "ABg model scattering" (A ≥ 0, B > 10⁻¹², g typically 0 to 3); J. E. Harvey,
    Light-scattering characteristics of optical surfaces, University of Arizona, 1976, for the wing's shift invariance.

    Example: `fm.model("lambert+abg", kd=0.01, a=1e-3, b=1e-4, g=2)`
    """

    label: ClassVar[str] = "abg"
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType(
        {"energy": "A is free: at normal incidence and g = 2 it scatters πA ln(1 + 1/B), 2.18 at A = B = 1"}
    )

    a: Spectrum = param(
        1e-9, 10.0, symbol="A", scale="log", per_channel=True, weight=True, default=1e-3, unit="sr⁻¹",
        doc="level; the BRDF one unit away from the mirror direction is A/(B + 1)",
    )  # fmt: skip
    b: Scalar = param(
        1e-12, 10.0, symbol="B", scale="log", default=1e-2,
        starts=(1e-10, 1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0),
        doc="shoulder; the plateau A/B ends at |β − β₀| = B^(1/g)",
    )  # fmt: skip
    g: Scalar = param(
        0.1, 6.0, symbol="g", default=2.0, starts=(0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0),
        doc="slope of the wing; polished optics 1–3",
    )  # fmt: skip

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """A/(B + |β − β₀|^g); the plateau A/B, without slope, at the mirror direction itself."""
        square = (wi[0] + wo[0]) ** 2 + (wi[1] + wo[1]) ** 2
        apart = square > _TINY
        power = jnp.where(apart, jnp.exp(0.5 * self.g * jnp.log(jnp.where(apart, square, 1.0))), 0.0)
        return jnp.where(above(wi, wo), self.a / (self.b + power), 0.0)

    def glsl(self) -> str:
        """The same."""
        return """
vec3 lobe(vec3 wi, vec3 wo) {
    float apart = length((wi + wo).xy);  // |beta - beta_0|
    return a / (b + pow(apart, g));
}
"""

    def width(self) -> Scalar:
        """Half of B^(1/g), because |β − β₀| is about twice the slope of h; at least 10⁻⁴."""
        return jnp.clip(0.5 * self.b ** (1.0 / self.g), NARROWEST, 1.0)
