"""Metrics: the formulas by which the literature compares two BRDFs, or a BRDF with readings, each written once.

It integrates nothing, fits nothing and judges nothing. Formulas take JAX or NumPy arrays.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from fitmat.maths.arrays import library

DARKEST = 1e-12
"""What logarithms and roots take smaller values for: sr⁻¹, or above a bound where they end."""

EPSILON = 1e-3
"""What the log ratio adds to both values, and the floor of its cosines (sr⁻¹; 1)."""

NGAN_DEG = 80.0
"""Ngan et al. 2005 drop what lies beyond, in θ_i or θ_o."""


def reflectance(f: Any, ci: Any, co: Any) -> Any:
    """f."""
    del ci, co
    return f


def radiance(f: Any, ci: Any, co: Any) -> Any:
    """f c_i: what a surface shows under light of irradiance 1 on a plane that faces it."""
    del co
    return f * ci


def log_radiance(x: Any) -> Any:
    """ln(1 + x) of x = f c_i (Löw et al. 2012): logarithmic in the peak, linear in the dark.

    It ends at x = −1, not at 0. Readings below 0 are noise about a dark value as those above it are; were they taken
    for 0, the noise that is left would have a mean above 0, and the smallest sum would ask for too bright a model.
    """
    return library(x).log1p(library(x).maximum(x, DARKEST - 1.0))


def cube_root(x: Any) -> Any:
    """∛x of x = f c_i, of either sign (Fores, Ferwerda & Gu 2012); straight below `DARKEST`, where it has no slope."""
    xp = library(x)
    tiny = xp.abs(x) < DARKEST
    return xp.where(tiny, x * DARKEST ** (-2.0 / 3.0), xp.cbrt(xp.where(tiny, 1.0, x)))


def log_reflectance(f: Any, ci: Any, co: Any) -> Any:
    """ln(f κ + ε) with κ = c_i c_o of at least ε = `EPSILON`; f below 0 counts as 0, since −ε is where it would end."""
    xp = library(f, ci, co)
    return xp.log(xp.maximum(f * xp.maximum(ci * co, EPSILON), 0.0) + EPSILON)


def _log_radiance(f: Any, ci: Any, co: Any) -> Any:
    return log_radiance(radiance(f, ci, co))


def _cube_root(f: Any, ci: Any, co: Any) -> Any:
    return cube_root(radiance(f, ci, co))


def above_minus_one(x: np.ndarray) -> np.ndarray:
    """Which x = f c_i `log_radiance` can be taken of."""
    return x > -1.0


def within(theta_i: np.ndarray, theta_o: np.ndarray) -> np.ndarray:
    """Which pairs of zenith angles (radians) Ngan et al. 2005 keep."""
    return np.maximum(theta_i, theta_o) <= np.deg2rad(NGAN_DEG)


Weight = Literal["solid", "within", "projected"]
"""Of pairs of directions, see `Metric`."""


@dataclass(frozen=True)
class Metric:
    """How the values of two BRDFs are compared: T = ∫∫ |t(f₁) − t(f₂)|ᵖ w over V = ∫∫ w, the same pairs of directions.

    Attributes:
        transform: t(f, c_i, c_o) of values (…, c) and cosines that broadcast with them.
        weight: w: "solid" dω_i dω_o, "within" the same up to `NGAN_DEG`, "projected" c_i c_o dω_i dω_o.
        kind: "relative" √(T/∫∫ f₂² w), "rms" √(T/V), "mean square" T/V, all with p = 2; "light" T/π with p = 1.
        words: What it measures, and its unit.
    """

    transform: Callable[[Any, Any, Any], Any]
    weight: Weight
    kind: Literal["relative", "rms", "mean square", "light"]
    words: str


METRICS = {
    "relative": Metric(
        reflectance, "projected", "relative",
        "√(∫∫ (f₁ − f₂)² c_i c_o / ∫∫ f₂² c_i c_o): a fraction of the second model, weighted as light is",
    ),
    "ngan": Metric(
        radiance, "within", "rms",
        f"rms of (f₁ − f₂) cosθ_i up to {NGAN_DEG:g}°, sr⁻¹ (Ngan et al. 2005): what the peak of the highlight says",
    ),
    "low-e1": Metric(
        radiance, "solid", "mean square",
        "mean of ((f₁ − f₂) cosθ_i)² sinθ_i, sr⁻² (Löw et al. 2012, E1)",
    ),
    "low-e2": Metric(
        _log_radiance, "solid", "mean square",
        "mean of (ln(1 + f₁ cosθ_i) − ln(1 + f₂ cosθ_i))² sinθ_i (Löw et al. 2012, E2): bright parts count less",
    ),
    "cube-root": Metric(
        _cube_root, "solid", "rms",
        "rms of ∛(f₁ cosθ_i) − ∛(f₂ cosθ_i), sr^(−1/3): closest to what eyes judge",
    ),
    "log-ratio": Metric(
        log_reflectance, "solid", "rms",
        f"rms of ln((f₁κ + ε)/(f₂κ + ε)), κ = max(cosθ_i cosθ_o, {EPSILON:g}), ε = {EPSILON:g} sr⁻¹: faint parts count",
    ),
    "albedo": Metric(
        reflectance, "projected", "light",
        "∫∫ |f₁ − f₂| c_i c_o/π: light that leaves in another direction, or not at all, as a fraction of what arrives",
    ),
}  # fmt: skip
"""Metric → definition. Averages are over solid angle of ω_o and ω_i, Löw's over θ_i evenly in angle; f is averaged over
the channels after |·|ᵖ. What is known of eyes: Fores et al. 2012; Lavoué et al. 2021 (README of the design)."""
