"""Fresnel terms of an index that follows a law over the wavelength: few numbers for all channels of a spectrum.

Each channel is a line, one wavelength; what a band of light makes of a law is not known here.
"""

import dataclasses
import functools
from abc import abstractmethod
from typing import Any, ClassVar, TypeVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from fitmat._types import Scalar, Spectrum
from fitmat.maths.arrays import library
from fitmat.models.dispersion import cauchy, drude_lorentz, sellmeier_2
from fitmat.models.parameters import AbstractOfChannels, param
from fitmat.models.terms.fresnel import AbstractFresnel, conductor, dielectric, f0_from_ior

F = TypeVar("F", bound="AbstractDispersive")
S = TypeVar("S", bound="AbstractSmooth")

NUMBERS = 5
"""Of a smooth curve: from 400 to 700 nm glass to 0.0005 in η, F0 of Al, Fe, Cr, Ti and W to 0.004; the edges of gold
and copper, which it rounds off, to 0.05 and 0.03."""


class AbstractDispersive(AbstractFresnel, AbstractOfChannels):
    """The exact equations of an index η + iκ that follows a law.

    Attributes:
        um: Wavelength of each channel in vacuum, µm.
    """

    um: eqx.AbstractVar[tuple[float, ...]]

    @abstractmethod
    def index(self) -> tuple[Spectrum, Spectrum]:
        """η and κ of each channel."""

    def of_channels(self: F, which: np.ndarray) -> F:
        """The same law at some of the wavelengths."""
        return dataclasses.replace(self, um=tuple(self.um[k] for k in which))

    def normal_reflectance(self) -> Spectrum:
        """((η−1)² + κ²)/((η+1)² + κ²)."""
        return f0_from_ior(*self.index())

    @property
    def _um(self) -> np.ndarray:
        return np.array(self.um)


class Cauchy(AbstractDispersive):
    """η = A + B/λ² of a transparent solid far from its resonances (A. L. Cauchy 1836), B ≥ 0: blue is refracted more.

    Priors: A is as likely anywhere from 1 to 3, B from 0 to 0.1 µm².
    """

    suffix: ClassVar[str] = ""
    cauchy_a: Scalar = param(
        1.0, 3.0, symbol="A", starts=(1.3, 1.5, 1.8), default=1.5,
        doc="index of long waves, η = A + B/λ²; plastics and varnish 1.4–1.6",
    )  # fmt: skip
    cauchy_b: Scalar = param(
        0.0, 0.1, symbol="B", unit="µm²", starts=(0.005,), default=0.005,
        doc="dispersion, η = A + B/λ²; acrylic 0.004, dense flint 0.013",
    )  # fmt: skip
    um: tuple[float, ...] = eqx.field(static=True, kw_only=True)

    def __call__(self, cos_d: Scalar) -> Spectrum:
        """See `dielectric`."""
        return dielectric(cos_d, self.index()[0])

    def index(self) -> tuple[Spectrum, Spectrum]:
        """See `dispersion.cauchy`."""
        eta = cauchy(self._um, self.cauchy_a, [(self.cauchy_b, -2)])
        return eta, jnp.zeros_like(eta)


class Sellmeier(AbstractDispersive):
    """η² = 1 + B λ²/(λ² − C) of one resonance in the ultraviolet (W. Sellmeier 1871).

    Priors: ln B is as likely anywhere from ln 0.05 to ln 9, C from 0 to 0.06 µm², a resonance of 245 nm at most. For
    channels of 250 nm and more.
    """

    suffix: ClassVar[str] = ""
    sellmeier_b: Scalar = param(
        0.05, 9.0, symbol="B", scale="log", starts=(0.7, 1.25, 2.2), default=1.25,
        doc="strength of the resonance, η² = 1 + B λ²/(λ² − C); plastics and varnish 1.0–1.5",
    )  # fmt: skip
    sellmeier_c: Scalar = param(
        0.0, 0.06, symbol="C", unit="µm²", starts=(0.01,), default=0.01,
        doc="square of the resonance's wavelength, η² = 1 + B λ²/(λ² − C); acrylic 0.011",
    )  # fmt: skip
    um: tuple[float, ...] = eqx.field(static=True, kw_only=True)

    def __call__(self, cos_d: Scalar) -> Spectrum:
        """See `dielectric`."""
        return dielectric(cos_d, self.index()[0])

    def index(self) -> tuple[Spectrum, Spectrum]:
        """See `dispersion.sellmeier_2`."""
        eta = sellmeier_2(self._um, 0.0, [(self.sellmeier_b, self.sellmeier_c)])
        return eta, jnp.zeros_like(eta)


def _constant() -> Scalar:
    return param(
        1.0, 20.0, symbol="ε∞", scale="log", starts=(1.5, 5.0), default=3.0,
        doc="permittivity that higher resonances leave; silver 4, gold 9",
    )  # fmt: skip


def _plasma() -> Scalar:
    return param(
        1.0, 25.0, symbol="E_p", unit="eV", scale="log", starts=(5.0, 9.0, 14.0), default=9.0,
        doc="plasma energy of the free electrons; silver and gold 9, aluminium 11–15",
    )  # fmt: skip


def _damping() -> Scalar:
    return param(
        0.005, 5.0, symbol="Γ", unit="eV", scale="log", starts=(0.05, 0.5), default=0.1,
        doc="damping of the free electrons; silver 0.02–0.05, aluminium 0.1–0.6",
    )  # fmt: skip


class Drude(AbstractDispersive):
    """(η + iκ)² = ε∞ − E_p²/(E² + iEΓ) of free electrons (P. Drude 1900), E = hc/λ.

    Priors: the logarithm of each is as likely anywhere: ε∞ from 1 to 20, E_p from 1 to 25 eV, Γ from 0.005 to 5 eV.
    """

    suffix: ClassVar[str] = "-conductor"
    epsilon: Scalar = _constant()
    plasma: Scalar = _plasma()
    damping: Scalar = _damping()
    um: tuple[float, ...] = eqx.field(static=True, kw_only=True)

    def __call__(self, cos_d: Scalar) -> Spectrum:
        """See `conductor`."""
        return conductor(cos_d, *self.index())

    def index(self) -> tuple[Spectrum, Spectrum]:
        """See `dispersion.drude_lorentz`."""
        return drude_lorentz(self._um, self.epsilon, [(self.plasma, 0.0, self.damping)])


class DrudeLorentz(AbstractDispersive):
    """Drude's metal with one resonance of bound electrons, E_l²/(E_0² − E² − iEΓ_0) (H. A. Lorentz; Rakić et al. 1998).

    Priors: as `Drude`; of the resonance the logarithm of each is as likely anywhere: E_l from 0.1 to 25 eV, E_0 from
    0.5 to 10 eV, Γ_0 from 0.05 to 10 eV.
    """

    suffix: ClassVar[str] = "-conductor"
    epsilon: Scalar = _constant()
    plasma: Scalar = _plasma()
    damping: Scalar = _damping()
    bound_plasma: Scalar = param(
        0.1, 25.0, symbol="E_l", unit="eV", scale="log", starts=(3.0,), default=3.0,
        doc="strength of the bound electrons' resonance, as an energy; gold 2–7",
    )  # fmt: skip
    bound_energy: Scalar = param(
        0.5, 10.0, symbol="E_0", unit="eV", scale="log", starts=(1.5, 3.0), default=3.0,
        doc="energy of the bound electrons' resonance; gold 3, aluminium 1.5",
    )  # fmt: skip
    bound_width: Scalar = param(
        0.05, 10.0, symbol="Γ_0", unit="eV", scale="log", starts=(0.8,), default=0.8,
        doc="width of the bound electrons' resonance; gold 0.9",
    )  # fmt: skip
    um: tuple[float, ...] = eqx.field(static=True, kw_only=True)

    def __call__(self, cos_d: Scalar) -> Spectrum:
        """See `conductor`."""
        return conductor(cos_d, *self.index())

    def index(self) -> tuple[Spectrum, Spectrum]:
        """See `dispersion.drude_lorentz`."""
        bound = self.bound_plasma, self.bound_energy, self.bound_width
        return drude_lorentz(self._um, self.epsilon, [(self.plasma, 0.0, self.damping), bound])


def _curve(k: int, symbol: str, lower: float, upper: float, default: float, doc: str) -> Scalar:
    """One of the `NUMBERS` that a smooth curve follows."""
    scale = "linear" if symbol == "η" and lower == 1.0 else "log"
    return param(
        lower, upper, symbol=f"{symbol}_{k}", scale=scale, starts=(default,), default=default,
        doc=f"{doc} towards which the curve is drawn, {k} of {NUMBERS} from the shortest wavelength to the longest",
    )  # fmt: skip


class AbstractSmooth(AbstractDispersive):
    """An index that is smooth over the wavelength and follows no formula: cubic B-splines, weighted by `NUMBERS`.

    Attributes:
        ends: Shortest and longest wavelength of the whole spectrum, µm; None for those of `um`.
    """

    ends: eqx.AbstractVar[tuple[float, float] | None]

    def of_channels(self: S, which: np.ndarray) -> S:
        """The same curve at some of the wavelengths."""
        some: dict[str, Any] = {"um": tuple(self.um[k] for k in which), "ends": self._ends}
        return dataclasses.replace(self, **some)

    @property
    def _ends(self) -> tuple[float, float]:
        return self.ends or (min(self.um), max(self.um))

    def _along(self, *weights: Scalar) -> Spectrum:
        return splines(self.um, self._ends) @ library(*weights).stack(weights)


@functools.cache
def splines(um: tuple[float, ...], ends: tuple[float, float]) -> np.ndarray:
    """Cubic B-splines at some wavelengths, (c, `NUMBERS`), knots even and the ends clamped; each row adds to 1.

    C. de Boor, A Practical Guide to Splines (1978), ch. IX; what is drawn lies within what the weights span.

    Args:
        um: Wavelengths, µm.
        ends: Where the curve begins and ends, µm.
    """
    from scipy.interpolate import BSpline

    inner = np.linspace(*ends, NUMBERS - 2)[1:-1]
    knots = np.concatenate([np.full(4, ends[0]), inner, np.full(4, ends[1])])
    return BSpline.design_matrix(np.clip(um, *ends), knots, 3).toarray()


class Smooth(AbstractSmooth):
    """A smooth η of a transparent solid, of no formula: a cubic spline over λ of five numbers.

    Priors: each number is as likely anywhere from 1 to 3, and so η lies there.
    """

    suffix: ClassVar[str] = ""
    eta_1: Scalar = _curve(1, "η", 1.0, 3.0, 1.5, "index")
    eta_2: Scalar = _curve(2, "η", 1.0, 3.0, 1.5, "index")
    eta_3: Scalar = _curve(3, "η", 1.0, 3.0, 1.5, "index")
    eta_4: Scalar = _curve(4, "η", 1.0, 3.0, 1.5, "index")
    eta_5: Scalar = _curve(5, "η", 1.0, 3.0, 1.5, "index")
    um: tuple[float, ...] = eqx.field(static=True, kw_only=True)
    ends: tuple[float, float] | None = eqx.field(static=True, kw_only=True, default=None)

    def __call__(self, cos_d: Scalar) -> Spectrum:
        """See `dielectric`."""
        return dielectric(cos_d, self.index()[0])

    def index(self) -> tuple[Spectrum, Spectrum]:
        """See `splines`."""
        eta = self._along(self.eta_1, self.eta_2, self.eta_3, self.eta_4, self.eta_5)
        return eta, jnp.zeros_like(eta)


class SmoothMetal(AbstractSmooth):
    """Smooth η and κ of a metal, of no formula: the logarithm of each is a cubic spline over λ of five numbers.

    Priors: the logarithm of each number is as likely anywhere, of η from 0.01 to 50, of κ from 0.1 to 50.
    """

    suffix: ClassVar[str] = "-conductor"
    eta_1: Scalar = _curve(1, "η", 0.01, 50.0, 1.0, "real part of the index")
    eta_2: Scalar = _curve(2, "η", 0.01, 50.0, 1.0, "real part of the index")
    eta_3: Scalar = _curve(3, "η", 0.01, 50.0, 1.0, "real part of the index")
    eta_4: Scalar = _curve(4, "η", 0.01, 50.0, 1.0, "real part of the index")
    eta_5: Scalar = _curve(5, "η", 0.01, 50.0, 1.0, "real part of the index")
    kappa_1: Scalar = _curve(1, "κ", 0.1, 50.0, 3.0, "imaginary part of the index")
    kappa_2: Scalar = _curve(2, "κ", 0.1, 50.0, 3.0, "imaginary part of the index")
    kappa_3: Scalar = _curve(3, "κ", 0.1, 50.0, 3.0, "imaginary part of the index")
    kappa_4: Scalar = _curve(4, "κ", 0.1, 50.0, 3.0, "imaginary part of the index")
    kappa_5: Scalar = _curve(5, "κ", 0.1, 50.0, 3.0, "imaginary part of the index")
    um: tuple[float, ...] = eqx.field(static=True, kw_only=True)
    ends: tuple[float, float] | None = eqx.field(static=True, kw_only=True, default=None)

    def __call__(self, cos_d: Scalar) -> Spectrum:
        """See `conductor`."""
        return conductor(cos_d, *self.index())

    def index(self) -> tuple[Spectrum, Spectrum]:
        """The exponential of `splines` with the logarithms of the numbers as weights."""
        eta = self.eta_1, self.eta_2, self.eta_3, self.eta_4, self.eta_5
        kappa = self.kappa_1, self.kappa_2, self.kappa_3, self.kappa_4, self.kappa_5
        return jnp.exp(self._along(*map(jnp.log, eta))), jnp.exp(self._along(*map(jnp.log, kappa)))


LAWS: dict[str, type[AbstractDispersive]] = {
    "cauchy": Cauchy,
    "sellmeier": Sellmeier,
    "drude": Drude,
    "drude-lorentz": DrudeLorentz,
    "smooth": Smooth,
    "smooth-metal": SmoothMetal,
}
"""Name → law."""
