"""Losses by name: what a fit minimises, where it comes from, and whether it is a likelihood.

A loss compares T(y κ) with T(f κ), κ = cosθ_i. Where the spread of the data about the model is part of it, the loss is
the logarithm of a probability density and supports a posterior; the objectives of the literature are not and do not.
Formulas only: nothing is fitted here.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from fitmat import arguments
from fitmat.errors import ModelError
from fitmat.fitting.stabilising import spread, stabilised
from fitmat.maths.arrays import library
from fitmat.measurements.samples import Measurements
from fitmat.models.metrics import DARKEST, above_minus_one, cube_root, log_radiance, within

Transform = Callable[[Any, Any, Any, Any], Any]
"""(x, noise, kappa, s) → T(x): x = f κ, noise = σ κ, kappa = cosθ_i, s the discrepancy; elementwise,
of JAX or NumPy arrays."""

T_DOF = 4.0
"""Degrees of freedom of "student-t": heavy tails with a finite variance (Lange, Little & Taylor 1989 suggest 4)."""

BAD_SHARE, BAD_SPREAD = 0.05, 10.0
"""In "mixture" one value in twenty is bad, with ten times the spread of the others."""

_GAUSSIAN_PEAK = float(-0.5 * np.log(2.0 * np.pi))


def _same(r: Any) -> Any:
    return r


@dataclasses.dataclass(frozen=True)
class Loss:
    """What a fit minimises: ½ Σ shrink(T(y κ) − T(f κ))², and for a likelihood the logarithm of the spread.

    Attributes:
        name: How it is asked for.
        formula: Of the residual, for the manual.
        doc: What it is good for.
        source: Who proposed it.
        transform: T.
        spread: dx/dT at the data, which makes a density of it; None for an objective.
        shrink: What makes large residuals count less; its square is −2 ln of the density relative to its peak.
        log_peak: ln of the density of a residual of 0 in units of the spread.
        infers: "discrepancy", "noise" or "" for what is inferred beside the parameters.
        usable: Measurements → which values it can be applied to, (n, c); None for all.
        unusable: Why the others are left out, in words.
    """

    name: str
    formula: str
    doc: str
    source: str
    transform: Transform
    spread: Transform | None = None
    shrink: Callable[[Any], Any] = _same
    log_peak: float = _GAUSSIAN_PEAK
    infers: str = ""
    usable: Callable[[Measurements], np.ndarray] | None = None
    unusable: str = ""

    @property
    def posterior(self) -> bool:
        """Whether it is a likelihood, so that parameters have a posterior."""
        return self.spread is not None

    @property
    def infers_discrepancy(self) -> bool:
        """Whether the model's discrepancy s is inferred beside the parameters; else s is 0."""
        return self.infers == "discrepancy"

    @property
    def infers_noise(self) -> bool:
        """Whether absolute and relative noise are inferred beside the parameters."""
        return self.infers == "noise"

    @property
    def needs_noise(self) -> bool:
        """Whether it is of no use where the noise is not known."""
        return self.posterior and not self.infers

    @property
    def robust(self) -> bool:
        """Whether large residuals count less."""
        return self.shrink is not _same

    @property
    def linear(self) -> bool:
        """Whether half the sum of squared residuals is −ln of the density, but for what no parameter changes."""
        return not (self.robust or self.infers_noise)


def _default(x: Any, noise: Any, kappa: Any, s: Any) -> Any:
    del kappa
    return stabilised(x, noise, s)


def _default_spread(x: Any, noise: Any, kappa: Any, s: Any) -> Any:
    del kappa
    return spread(x, noise, s)


def _gaussian(x: Any, noise: Any, kappa: Any, s: Any) -> Any:
    del kappa, s
    return x / noise


def _gaussian_spread(x: Any, noise: Any, kappa: Any, s: Any) -> Any:
    del kappa, s
    return library(noise, x).broadcast_to(noise, np.broadcast_shapes(np.shape(x), np.shape(noise)))


def _student(r: Any) -> Any:
    """sign(r) √((ν + 1) ln(1 + r²/ν)), smooth at 0."""
    xp, u = library(r), r**2 / T_DOF
    small = u < 1e-8
    safe = xp.where(small, 1.0, u)
    return r * xp.sqrt((T_DOF + 1.0) / T_DOF * xp.where(small, 1.0 - 0.5 * u, xp.log1p(safe) / safe))


_STUDENT_PEAK = float(np.log(0.75 / 2.0))
# Γ(5/2)/(Γ(2) √(4π)) = 3/8, the density of t with 4 degrees of freedom at 0.


def _mixed(r: Any) -> Any:
    """sign(r) √(2(L(r) − L(0))), −L the log density of the mixture of two Gaussians, smooth at 0."""
    xp, square = library(r), r**2
    good, bad = 1.0 - BAD_SHARE, BAD_SHARE / BAD_SPREAD
    small = square < 1e-8
    safe = xp.where(small, 1.0, square)
    logs = xp.logaddexp(math.log(good) - 0.5 * safe, math.log(bad) - 0.5 * safe / BAD_SPREAD**2)
    curvature = (good + bad / BAD_SPREAD**2) / (good + bad)
    return r * xp.sqrt(xp.where(small, curvature, 2.0 * (math.log(good + bad) - logs) / safe))


_MIXED_PEAK = float(np.log((1.0 - BAD_SHARE + BAD_SHARE / BAD_SPREAD) / np.sqrt(2.0 * np.pi)))


def bad_probability(r: np.ndarray) -> np.ndarray:
    """How probable it is under "mixture" that a value with residual r (in spreads) is a bad one."""
    good = np.log(1.0 - BAD_SHARE) - 0.5 * r**2
    bad = np.log(BAD_SHARE / BAD_SPREAD) - 0.5 * (r / BAD_SPREAD) ** 2
    return 1.0 / (1.0 + np.exp(np.clip(good - bad, -700.0, 700.0)))


def _log10(x: Any, noise: Any, kappa: Any, s: Any) -> Any:
    del noise, s
    return library(x).log10(library(x).maximum(x / kappa, DARKEST))


def _log1p(x: Any, noise: Any, kappa: Any, s: Any) -> Any:
    del noise, kappa, s
    return log_radiance(x)


def _cube_root(x: Any, noise: Any, kappa: Any, s: Any) -> Any:
    del noise, kappa, s
    return cube_root(x)


def _radiance(x: Any, noise: Any, kappa: Any, s: Any) -> Any:
    del noise, kappa, s
    return x


def _brdf(x: Any, noise: Any, kappa: Any, s: Any) -> Any:
    del noise, s
    return x / kappa


def _by_ring(of: Transform) -> Transform:
    """Weighted with sinθ_i."""

    def weighted(x: Any, noise: Any, kappa: Any, s: Any) -> Any:
        xp = library(kappa)
        return xp.sqrt(xp.sqrt(xp.maximum(1.0 - kappa**2, 0.0))) * of(x, noise, kappa, s)

    return weighted


_low_e1, _low_e2 = _by_ring(_radiance), _by_ring(_log1p)


def _is_positive(m: Measurements) -> np.ndarray:
    return m.value > 0


def _above_minus_one(m: Measurements) -> np.ndarray:
    return above_minus_one(m.value * m.wi[:, 2:])


def _off_normal(m: Measurements) -> np.ndarray:
    return np.broadcast_to((m.theta_i > np.deg2rad(0.01))[:, None], m.value.shape)


def _up_to_80(m: Measurements) -> np.ndarray:
    return np.broadcast_to(within(m.theta_i, m.theta_o)[:, None], m.value.shape)


DEFAULT = Loss("default", "z(y c_i) − z(f c_i)", "measurement noise and the model's own misfit, inferred together",
    "fitmat.fitting.stabilising", _default, _default_spread, infers="discrepancy")  # fmt: skip

_EVERY = (
    DEFAULT,
    Loss("gaussian", "(y − f)/σ", "noise as given, the model taken as exact", "Gauss 1809", _gaussian,
        _gaussian_spread),
    Loss("gaussian-inferred", "(y − f)/σ, σ² = a² + (b ȳ)²",
        "noise inferred as absolute plus relative, the model taken as exact; ȳ is the level of the neighbouring angles",
        "Hogg, Bovy & Lang 2010, sec. 8", _gaussian, _gaussian_spread, infers="noise"),
    Loss("student-t", "as default, t with 4 degrees of freedom", "some values are off by more than the noise",
        "Lange, Little & Taylor 1989", _default, _default_spread, _student, _STUDENT_PEAK, infers="discrepancy"),
    Loss("mixture", "as default, 5 % of the values with 10 × the spread", "some values are bad, and to be named",
        "Hogg, Bovy & Lang 2010, sec. 3", _default, _default_spread, _mixed, _MIXED_PEAK, infers="discrepancy"),
    Loss("log10", "log₁₀ y − log₁₀ f", "equal ratios count alike, over all decades; values above 0 only",
        "Greenwood et al. 2002; Holzschuch & Pacanowski 2017", _log10, usable=_is_positive,
        unusable="not above 0, of no use to the loss log10"),
    Loss("log1p-cos", "ln(1 + y c_i) − ln(1 + f c_i)", "logarithmic in the peak, linear in the dark",
        "Löw et al. 2012", _log1p, usable=_above_minus_one, unusable="f cosθ_i below −1, of no use to log1p-cos"),
    Loss("cube-root", "∛(y c_i) − ∛(f c_i)", "closest to what eyes judge", "Fores, Ferwerda & Gu 2012", _cube_root),
    Loss("ngan", "(y − f) c_i", "the peak decides; angles up to 80°", "Ngan, Durand & Matusik 2005, eq. 1", _radiance,
        usable=_up_to_80, unusable="beyond 80°, left out by the loss ngan"),
    Loss("low-e1", "√sinθ_i (y − f) c_i", "the peak decides; weighted by rings of incidence", "Löw et al. 2012, E1",
        _low_e1, usable=_off_normal, unusable="at normal incidence, which low-e1 gives no weight"),
    Loss("low-e2", "√sinθ_i (ln(1 + y c_i) − ln(1 + f c_i))", "as log1p-cos, weighted by rings of incidence",
        "Löw et al. 2012, E2", _low_e2, usable=lambda m: _off_normal(m) & _above_minus_one(m),
        unusable="at normal incidence, or f cosθ_i below −1: of no use to low-e2"),
    Loss("l2", "y − f", "plain least squares: the peak at grazing incidence decides", "Gauss 1809", _brdf),
    Loss("l2-cos", "(y − f) c_i", "least squares of the reflected radiance", "Lafortune et al. 1997", _radiance),
)  # fmt: skip

LOSSES: Mapping[str, Loss] = MappingProxyType({loss.name: loss for loss in _EVERY})
"""Every loss by its name."""

ALIASES: Mapping[str, str] = MappingProxyType({"log": "log10", "l2-cosine": "l2-cos", "t": "student-t"})
"""Other names."""


def loss(name: str) -> Loss:
    """A loss by name.

    Raises:
        ModelError: there is none of that name.
    """
    arguments.kind("loss", name, str)
    known = ALIASES.get(name.lower(), name.lower())
    if known not in LOSSES:
        raise ModelError(f"unknown loss {name!r}: choose from {', '.join(LOSSES)}.")
    return LOSSES[known]
