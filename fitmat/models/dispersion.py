"""Dispersion: n and k of a dataset as functions of the wavelength, and the datasets that come with fitmat.

Tables and the formulas of the literature as refractiveindex.info holds them; nothing is fitted, nothing extrapolated.
"""

import dataclasses
import functools
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Complex, Float

FILE = Path(__file__).with_name("refractive_indices.json")
"""Dataset → its parts: tables over µm, and formulas with the range in µm where they hold; `benchmarks/indices.py`."""

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


def sellmeier(um: np.ndarray, first: float, pairs: Sequence[tuple[float, float]]) -> np.ndarray:
    """n² = 1 + A + Σ B λ²/(λ² − C²)."""
    return np.sqrt(1.0 + first + sum(b * um**2 / (um**2 - c**2) for b, c in pairs))


def sellmeier_2(um: np.ndarray, first: float, pairs: Sequence[tuple[float, float]]) -> np.ndarray:
    """n² = 1 + A + Σ B λ²/(λ² − C)."""
    return np.sqrt(1.0 + first + sum(b * um**2 / (um**2 - c) for b, c in pairs))


def cauchy(um: np.ndarray, first: float, pairs: Sequence[tuple[float, float]]) -> np.ndarray:
    """N = A + Σ B λ^C."""
    return np.asarray(first + sum(b * um**c for b, c in pairs))


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
    return {"n": lambda nm: FORMULAS[part["formula"]](1e-3 * nm, first, pairs)}


def _tables(part: dict[str, Any]) -> dict[str, Curve]:
    """Each column of a table, linear between its rows."""
    return {name: _linear(part["um"], part[name]) for name in ("n", "k") if name in part}


def _linear(um: Sequence[float], value: Sequence[float]) -> Curve:
    return lambda nm: np.interp(1e-3 * nm, um, value)
