"""Fresnel reflectance of a smooth interface: exact dielectric, exact conductor, Schlick; and F0 ↔ η.

Each is a small module with its own parameters, so that any microfacet model can carry any of them.
"""

from abc import abstractmethod
from typing import ClassVar, TypeVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from fitmat._types import Scalar, Spectrum
from fitmat.params import param

Numbers = TypeVar("Numbers", Array, np.ndarray)
"""JAX or NumPy arrays; what goes in comes out."""

_TINY = 1e-300


class AbstractFresnel(eqx.Module):
    """Reflectance of an interface as a function of the angle to the micro-normal."""

    suffix: ClassVar[str]

    @abstractmethod
    def __call__(self, cos_d: Scalar) -> Spectrum:
        """Reflectance in [0, 1] for `cos_d` = ω_i·h in [0, 1]."""

    @abstractmethod
    def normal_reflectance(self) -> Spectrum:
        """Reflectance at normal incidence."""


class Dielectric(AbstractFresnel):
    """Exact unpolarised Fresnel reflectance of a dielectric with relative index eta."""

    suffix: ClassVar[str] = ""
    eta: Spectrum = param(
        1.0, 50.0, symbol="η", scale="log", starts=(1.1, 1.3, 1.5, 2.0, 4.0, 20.0), default=1.5,
        doc="index of refraction; plastics and varnish 1.4–1.6, F0 = ((η−1)/(η+1))²",
    )  # fmt: skip

    def __call__(self, cos_d: Scalar) -> Spectrum:
        """See `dielectric`."""
        return dielectric(cos_d, self.eta)

    def normal_reflectance(self) -> Spectrum:
        """((η−1)/(η+1))²."""
        return f0_from_eta(self.eta)


class Conductor(AbstractFresnel):
    """Exact unpolarised Fresnel reflectance of a conductor with complex index η + iκ."""

    suffix: ClassVar[str] = "-conductor"
    eta: Spectrum = param(
        0.01, 50.0, symbol="η", scale="log", per_channel=True, starts=(0.2, 1.0, 2.5), default=1.0,
        doc="real part of the index of refraction; gold 0.2 (red), aluminium 1, iron 2.9",
    )  # fmt: skip
    kappa: Spectrum = param(
        0.01, 50.0, symbol="κ", scale="log", per_channel=True, starts=(1.0, 3.0, 7.0), default=3.0,
        doc="imaginary part of the index of refraction; metals 2–8",
    )  # fmt: skip

    def __call__(self, cos_d: Scalar) -> Spectrum:
        """See `conductor`."""
        return conductor(cos_d, self.eta, self.kappa)

    def normal_reflectance(self) -> Spectrum:
        """((η−1)² + κ²)/((η+1)² + κ²)."""
        square = self.kappa**2
        return ((self.eta - 1.0) ** 2 + square) / ((self.eta + 1.0) ** 2 + square)


class Schlick(AbstractFresnel):
    """Schlick's approximation with the reflectance at normal incidence f0."""

    suffix: ClassVar[str] = "-schlick"
    f0: Spectrum = param(
        1e-4, 0.999, symbol="F0", scale="log", per_channel=True, starts=(0.02, 0.05, 0.15, 0.5, 0.9),
        default=0.04, doc="reflectance at normal incidence; plastics 0.04, metals 0.5–0.98",
    )  # fmt: skip

    def __call__(self, cos_d: Scalar) -> Spectrum:
        """See `schlick`."""
        return schlick(cos_d, self.f0)

    def normal_reflectance(self) -> Spectrum:
        """The parameter itself."""
        return self.f0


def dielectric(cos_d: Scalar, eta: Spectrum) -> Spectrum:
    """F = ½((g−c)/(g+c))²(1 + ((c(g+c)−1)/(c(g−c)+1))²), g = √(η² + c² − 1); 1 beyond total reflection.

    Cook & Torrance 1982, eq. 15 with the square root of the original (some course slides drop it).
    """
    c = cos_d
    square = (eta - 1.0) * (eta + 1.0) + c**2  # η² + c² − 1 without its cancellation near η = 1
    total = square <= 0.0
    g = jnp.sqrt(jnp.where(total, 1.0, square))
    first = (g - c) / (g + c)
    second = (c * (g + c) - 1.0) / (c * (g - c) + 1.0)
    return jnp.where(total, 1.0, 0.5 * first**2 * (1.0 + second**2))


def conductor(cos_d: Scalar, eta: Spectrum, kappa: Spectrum) -> Spectrum:
    """Unpolarised reflectance (R_s + R_p)/2 of a conductor in vacuum.

    Born & Wolf, Principles of Optics, sec. 14.2, in the real form of Lagarde, "Memo on Fresnel equations" (2013).
    """
    cos2 = cos_d**2
    sin2 = 1.0 - cos2
    t0 = eta**2 - kappa**2 - sin2
    a2_b2 = jnp.sqrt(jnp.maximum(t0**2 + 4.0 * (eta * kappa) ** 2, _TINY))
    a = jnp.sqrt(jnp.maximum(0.5 * (a2_b2 + t0), _TINY))
    rs = (a2_b2 + cos2 - 2.0 * a * cos_d) / (a2_b2 + cos2 + 2.0 * a * cos_d)
    t3 = cos2 * a2_b2 + sin2**2
    t4 = 2.0 * a * cos_d * sin2
    rp = rs * (t3 - t4) / (t3 + t4)
    return 0.5 * (rs + rp)


def schlick(cos_d: Scalar, f0: Spectrum) -> Spectrum:
    """F0 + (1−F0)(1−c)⁵ (Schlick 1994)."""
    return f0 + (1.0 - f0) * (1.0 - cos_d) ** 5


def f0_from_eta(eta: Numbers) -> Numbers:
    """((η−1)/(η+1))²."""
    return ((eta - 1.0) / (eta + 1.0)) ** 2


def eta_from_f0(f0: Numbers) -> Numbers:
    """(1+√F0)/(1−√F0), the dielectric with that reflectance at normal incidence; needs F0 < 1."""
    root = f0**0.5
    return (1.0 + root) / (1.0 - root)
