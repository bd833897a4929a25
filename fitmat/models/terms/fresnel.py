"""Fresnel reflectance of a smooth interface: exact dielectric and conductor, Schlick, Hoffman's F82; F0 ↔ η, averages.

Each is a small module with its own parameters, so that any microfacet model can carry any of them. Indices of named
materials and the fitted basis of Belcour live elsewhere; there are no thin films and no polarisation.
"""

from abc import abstractmethod
from typing import Any, ClassVar, TypeVar, overload

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from fitmat._types import Scalar, Spectrum
from fitmat.maths.arrays import library
from fitmat.models.glsl import AbstractShaded
from fitmat.models.parameters import param

Numbers = TypeVar("Numbers", Array, np.ndarray)
"""JAX or NumPy arrays; what goes in comes out."""

COS_82 = 1.0 / 7.0
"""Cosine of Hoffman's second angle, 81.79°: where c(1−c)⁶ peaks."""

_PEAK_82 = COS_82 * (1.0 - COS_82) ** 6

_TINY = 1e-300


class AbstractFresnel(AbstractShaded):
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

    def glsl(self) -> str:
        """See `dielectric`."""
        return fresnel_glsl("dielectric(c, vec3(eta))")

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

    def glsl(self) -> str:
        """See `conductor`."""
        return fresnel_glsl("conductor(c, eta, kappa)")

    def normal_reflectance(self) -> Spectrum:
        """((η−1)² + κ²)/((η+1)² + κ²)."""
        return f0_from_ior(self.eta, self.kappa)


def _f0() -> Any:
    return param(
        1e-4, 0.999, symbol="F0", scale="log", per_channel=True, starts=(0.02, 0.05, 0.15, 0.5, 0.9),
        default=0.04, doc="reflectance at normal incidence; plastics 0.04, metals 0.5–0.98",
    )  # fmt: skip


class Schlick(AbstractFresnel):
    """Schlick's approximation with the reflectance at normal incidence f0."""

    suffix: ClassVar[str] = "-schlick"
    f0: Spectrum = _f0()

    def __call__(self, cos_d: Scalar) -> Spectrum:
        """See `schlick`."""
        return schlick(cos_d, self.f0)

    def glsl(self) -> str:
        """See `schlick`."""
        return fresnel_glsl("schlick(c, f0)")

    def normal_reflectance(self) -> Spectrum:
        """The parameter itself."""
        return self.f0


class F82(AbstractFresnel):
    """Hoffman's form of Schlick's approximation: the reflectances at normal incidence and near 82°, each a parameter.

    Metals dip before they rise to 1 at grazing; Schlick's curve cannot. See `hoffman` for the limits.
    """

    suffix: ClassVar[str] = "-f82"
    f0: Spectrum = _f0()
    f82: Spectrum = param(
        1e-4, 1.0, symbol="F82", per_channel=True, starts=(0.45, 0.85), default=0.45,
        doc="reflectance at 81.8° (c = 1/7); plastics 0.45, iron and chromium 0.6, silver 0.98",
    )  # fmt: skip

    def __call__(self, cos_d: Scalar) -> Spectrum:
        """See `hoffman`."""
        return hoffman(cos_d, self.f0, self.f82)

    def glsl(self) -> str:
        """See `hoffman`."""
        return fresnel_glsl("hoffman(c, f0, f82)")

    def normal_reflectance(self) -> Spectrum:
        """The parameter f0 itself."""
        return self.f0


class White(AbstractFresnel):
    """An interface that reflects everything: the white furnace."""

    suffix: ClassVar[str] = "-white"

    def __call__(self, cos_d: Scalar) -> Spectrum:
        """1."""
        return library(cos_d).ones_like(cos_d)

    def normal_reflectance(self) -> Spectrum:
        """1."""
        return jnp.ones(())


def dielectric(cos_d: Numbers | float, eta: Numbers) -> Numbers:
    """F = ½((g−c)/(g+c))²(1 + ((c(g+c)−1)/(c(g−c)+1))²), g = √(η² + c² − 1); 1 beyond total reflection.

    Cook & Torrance 1982, eq. 15 with the square root of the original (some course slides drop it). At η = 1 nothing
    is reflected for c > 0, and c = 0 counts as total reflection.
    """
    xp, c = library(cos_d, eta), cos_d
    square = (eta - 1.0) * (eta + 1.0) + c**2  # η² + c² − 1 without its cancellation near η = 1
    total = square <= 0.0
    g = xp.sqrt(xp.where(total, 1.0, square))
    first = (g - c) / (g + c)
    second = (c * (g + c) - 1.0) / (c * (g - c) + 1.0)
    return xp.where(total, 1.0, 0.5 * first**2 * (1.0 + second**2))


def conductor(cos_d: Numbers | float, eta: Numbers, kappa: Numbers) -> Numbers:
    """Unpolarised reflectance (R_s + R_p)/2 of a conductor in vacuum; κ = 0 is the dielectric.

    Born & Wolf, Principles of Optics, sec. 14.2, in the real form of Lagarde, "Memo on Fresnel equations" (2013).
    """
    xp = library(cos_d, eta, kappa)
    cos2 = cos_d**2
    sin2 = 1.0 - cos2
    t0 = eta**2 - kappa**2 - sin2
    a2_b2 = xp.sqrt(xp.maximum(t0**2 + 4.0 * (eta * kappa) ** 2, _TINY))
    a = xp.sqrt(xp.maximum(0.5 * (a2_b2 + t0), _TINY))
    rs = (a2_b2 + cos2 - 2.0 * a * cos_d) / (a2_b2 + cos2 + 2.0 * a * cos_d)
    t3 = cos2 * a2_b2 + sin2**2
    t4 = 2.0 * a * cos_d * sin2
    rp = rs * (t3 - t4) / (t3 + t4)
    return 0.5 * (rs + rp)


def fresnel_glsl(call: str) -> str:
    """The reflectance at a cosine, c, in GLSL."""
    return f"\nvec3 fresnel(float c) {{\n    return {call};\n}}\n"


@overload
def schlick(cos_d: Numbers, f0: Numbers | float) -> Numbers: ...
@overload
def schlick(cos_d: float, f0: Numbers) -> Numbers: ...
def schlick(cos_d: Any, f0: Any) -> Any:
    """F0 + (1−F0)(1−c)⁵ (Schlick 1994)."""
    return f0 + (1.0 - f0) * (1.0 - cos_d) ** 5


def hoffman(cos_d: Numbers | float, f0: Numbers, f82: Numbers) -> Numbers:
    """Schlick − a c(1−c)⁶ with a = (F0 + (1−F0)(6/7)⁵ − F82)/((1/7)(6/7)⁶), clipped to [0, 1].

    N. Hoffman, "Fresnel equations considered harmful", MAM 2019; with F82 itself as the parameter, of which the tint
    of Kutz, Hašan & Edmondson, "Novel aspects of the Adobe Standard Material" (2021), is the ratio to Schlick's.

    The curve passes through F82 at c = 1/7. It is cut at 0 only where F82 < (6/7)⁵ − 4(1/7)(6/7)⁶ = 0.236, and at 1
    only where F82 > F0 + 0.746(1−F0) (near grazing); real materials need neither. A cut value has zero gradient.
    """
    xp = library(cos_d, f0, f82)
    a = (schlick(COS_82, f0) - f82) / _PEAK_82
    return xp.clip(schlick(cos_d, f0) - a * cos_d * (1.0 - cos_d) ** 6, 0.0, 1.0)


def average(fresnel: AbstractFresnel) -> Any:
    """F_avg = 2∫₀¹ F(c) c dc, the reflectance under uniform diffuse light, one value per channel.

    Gauss–Legendre in the angle, 32 nodes: to 1e-12 for |η + iκ| < 10, to 3e-8 up to 50; where total reflection makes
    F kink (η < 1, κ → 0) to 0.01 only: take `average_inside` there.
    """
    if library(*jax.tree.leaves(fresnel)) is np:
        return np.tensordot(_AVERAGE, np.stack([np.asarray(fresnel(cos)) for cos in _COSINES]), 1)
    return jnp.tensordot(_AVERAGE, jax.vmap(fresnel)(jnp.asarray(_COSINES)), 1)


def average_inside(outside: Numbers, eta: Numbers) -> Numbers:
    """1 − (1 − F_avg)/η²: the diffuse reflectance from inside a dielectric, given that from outside.

    What enters is what leaves, per étendue η² (D. B. Judd, Fresnel reflection of diffusely incident light, Journal of
    Research NBS 29, 1942).
    """
    return 1.0 - (1.0 - outside) / eta**2


def f0_from_eta(eta: Numbers) -> Numbers:
    """((η−1)/(η+1))²."""
    return ((eta - 1.0) / (eta + 1.0)) ** 2


def eta_from_f0(f0: Numbers) -> Numbers:
    """(1+√F0)/(1−√F0), the dielectric with that reflectance at normal incidence; needs F0 < 1."""
    root = f0**0.5
    return (1.0 + root) / (1.0 - root)


def f0_from_ior(eta: Numbers, kappa: Numbers) -> Numbers:
    """((η−1)² + κ²)/((η+1)² + κ²), the reflectance at normal incidence of η + iκ."""
    return ((eta - 1.0) ** 2 + kappa**2) / ((eta + 1.0) ** 2 + kappa**2)


def f0_f82_from_ior(eta: Numbers, kappa: Numbers) -> tuple[Numbers, Numbers]:
    """The parameters of `F82` that agree with the exact curve of η + iκ at c = 1 and at c = 1/7."""
    return f0_from_ior(eta, kappa), conductor(COS_82, eta, kappa)


def tint_from_ior(eta: Numbers, kappa: Numbers) -> tuple[Numbers, Numbers]:
    """Gulbrandsen's reflectivity F0 and edge tint g of η + iκ; the inverse of `ior_from_tint`.

    g = (η_max − η)/(η_max − η_min): 1 is the smallest η with that F0, 0 the largest, without absorption. Not defined
    where F0 = 0 (η = 1, κ = 0).
    """
    f0 = f0_from_ior(eta, kappa)
    largest = eta_from_f0(f0)
    return f0, (largest - eta) / (largest - _smallest_eta(f0))


def ior_from_tint(f0: Numbers, tint: Numbers) -> tuple[Numbers, Numbers]:
    """η and κ from a reflectivity F0 in [0, 1) and an edge tint g in [0, 1].

    η = g(1−F0)/(1+F0) + (1−g)(1+√F0)/(1−√F0), κ² = (F0(η+1)² − (η−1)²)/(1−F0): O. Gulbrandsen, Artist friendly
    metallic Fresnel, JCGT 3(4), 2014. At g = 0 κ vanishes like √g; its gradient there is given as 0.
    """
    xp = library(f0, tint)
    eta = tint * _smallest_eta(f0) + (1.0 - tint) * eta_from_f0(f0)
    square = (f0 * (eta + 1.0) ** 2 - (eta - 1.0) ** 2) / (1.0 - f0)
    absorbs = square > 0.0
    return eta, xp.where(absorbs, xp.where(absorbs, square, 1.0) ** 0.5, 0.0)


def _smallest_eta(f0: Numbers) -> Numbers:
    """(1−F0)/(1+F0): the smallest η that reaches F0 with some κ."""
    return (1.0 - f0) / (1.0 + f0)


def angle_nodes(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Cosines and weights of Gauss–Legendre in the angle: ∫ f(cos θ) dθ over 0 to π/2, each of shape (count,)."""
    x, weights = np.polynomial.legendre.leggauss(count)
    return np.cos((x + 1.0) * np.pi / 4.0), weights * np.pi / 4.0


_COSINES, _ANGLES = angle_nodes(32)
_AVERAGE = 2.0 * _COSINES * np.sqrt(1.0 - _COSINES**2) * _ANGLES
