"""Dispersion: n and k as functions of the wavelength: the formulas of the literature, and the datasets of fitmat.

Tables and formulas as refractiveindex.info holds them; nothing is fitted, nothing extrapolated.
"""

import dataclasses
import functools
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Complex, Float

from fitmat.maths.arrays import library

FILE = Path(__file__).with_name("refractive_indices.json")
"""Dataset → its parts: tables over µm, and formulas with the range in µm where they hold; `benchmarks/indices.py`."""

SHORTEST, LONGEST = 250.0, 20_000.0
"""Wavelengths in nm for which fitted laws are meant: below, glass absorbs; above, what is read is no nm."""

Curve = Callable[[Float[np.ndarray, "..."]], Float[np.ndarray, "..."]]
"""Wavelength → n or k."""


@dataclasses.dataclass(frozen=True)
class Dispersion:
    """n and k of one dataset over the wavelength in nm.

    Attributes:
        n: Refractive index.
        k: Extinction coefficient; None where the dataset has none (transparent dielectrics).
        low: Shortest wavelength of both, nm.
        high: Longest, nm.
    """

    n: Curve
    k: Curve | None
    low: float
    high: float

    def __call__(self, nm: Float[np.ndarray, "..."]) -> Complex[np.ndarray, "..."]:
        """N + ik."""
        kappa = 0.0 if self.k is None else self.k(nm)
        return np.asarray(self.n(nm) + 1j * kappa)


def sellmeier(um: np.ndarray, first: Any, pairs: Sequence[tuple[Any, Any]]) -> Any:
    """n² = 1 + A + Σ B λ²/(λ² − C²) (W. Sellmeier, Ann. Phys. 219, 272, 1871)."""
    return (1.0 + first + sum(b * um**2 / (um**2 - c**2) for b, c in pairs)) ** 0.5


def sellmeier_2(um: np.ndarray, first: Any, pairs: Sequence[tuple[Any, Any]]) -> Any:
    """n² = 1 + A + Σ B λ²/(λ² − C)."""
    return (1.0 + first + sum(b * um**2 / (um**2 - c) for b, c in pairs)) ** 0.5


def cauchy(um: np.ndarray, first: Any, pairs: Sequence[tuple[Any, Any]]) -> Any:
    """N = A + Σ B λ^C (A. L. Cauchy, Mémoire sur la dispersion de la lumière, 1836)."""
    return first + sum(b * um**c for b, c in pairs)


def drude_lorentz(um: np.ndarray, first: Any, oscillators: Sequence[tuple[Any, Any, Any]]) -> tuple[Any, Any]:
    """η and κ of ε = A + Σ Ω²/(E_j² − E² − iEΓ), E = hc/λ; free electrons are the term of E_j = 0.

    P. Drude, Ann. Phys. 306, 566 (1900), and H. A. Lorentz, The theory of electrons (1909), as A. D. Rakić et al.,
    Appl. Opt. 37, 5271 (1998), eqs. 1–3, write them (with the conjugate, for waves e^{+iωt}), where Ω² = f ω_p².

    Args:
        um: Wavelength in vacuum, µm.
        first: ε far above all resonances that are written out; 1 where all are.
        oscillators: Ω, E_j and Γ of each, eV.
    """
    energy = EV_UM / um
    real, imaginary = first, 0.0
    for strength, resonance, width in oscillators:
        away, loss = resonance**2 - energy**2, energy * width
        share = strength**2 / (away**2 + loss**2)
        real, imaginary = real + share * away, imaginary + share * loss
    # The root without cancellation: of a metal ε is near the negative axis, of a dielectric near the positive one.
    xp = library(real, imaginary)
    larger = (0.5 * ((real**2 + imaginary**2) ** 0.5 + abs(real))) ** 0.5
    smaller = 0.5 * imaginary / larger
    return xp.where(real < 0.0, smaller, larger), xp.where(real < 0.0, larger, smaller)


EV_UM = 1.2398419843320026
"""hc, in eV µm (exact in the SI of 2019)."""


def gas(um: np.ndarray, first: float, pairs: Sequence[tuple[float, float]]) -> np.ndarray:
    """N = 1 + A + Σ B/(C − λ⁻²)."""
    return np.asarray(1.0 + first + sum(b / (c - um**-2) for b, c in pairs))


FORMULAS: dict[int, Callable[..., np.ndarray]] = {1: sellmeier, 2: sellmeier_2, 5: cauchy, 6: gas}
"""By the number that refractiveindex.info gives them; its coefficients are A, then B and C in turn."""


def shipped(dataset: str) -> Dispersion | None:
    """A dataset that comes with fitmat, by shelf/book/page; None for any other."""
    parts = _file()["datasets"].get(dataset)
    return None if parts is None else _dispersion(parts)


@functools.cache
def _file() -> dict[str, Any]:
    return json.loads(FILE.read_text(encoding="utf-8"))


def _dispersion(parts: Sequence[dict[str, Any]]) -> Dispersion:
    curves: dict[str, Curve] = {}
    for part in parts:
        curves |= _formula(part) if "formula" in part else _tables(part)
    low, high = max(min(part["um"]) for part in parts), min(max(part["um"]) for part in parts)
    return Dispersion(curves["n"], curves.get("k"), 1e3 * low, 1e3 * high)


def _formula(part: dict[str, Any]) -> dict[str, Curve]:
    first, *rest = part["coefficients"]
    pairs = list(zip(rest[::2], rest[1::2], strict=True))
    return {"n": lambda nm: np.asarray(FORMULAS[part["formula"]](1e-3 * nm, first, pairs))}


def _tables(part: dict[str, Any]) -> dict[str, Curve]:
    """Each column of a table, linear between its rows."""
    return {name: _linear(part["um"], part[name]) for name in ("n", "k") if name in part}


def _linear(um: Sequence[float], value: Sequence[float]) -> Curve:
    return lambda nm: np.interp(1e-3 * nm, um, value)
