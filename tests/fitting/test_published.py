"""Published fits, made again: data, objective and numbers are their authors' (tests/published/README.md).

Beside the printed digits stands the authors' own method: SciPy's curve_fit of log₁₀ f, written from their formulas.
"""

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import curve_fit

import fitmat as fm

FOLDER = Path(__file__).parents[1] / "published"
pytestmark = pytest.mark.study

COLUMNS = "theta_i=1,phi_i=2,theta_o=3,phi_o=4,brdf=5"


def directions(zenith: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    zenith, azimuth = np.deg2rad(zenith), np.deg2rad(azimuth)
    return np.stack([np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), np.cos(zenith)], axis=1)


def rows(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """ω_i, ω_o and f of all rows."""
    with gzip.open(FOLDER / f"{name}.csv.gz", "rt") as file:
        table = np.loadtxt(file)
    return directions(table[:, 0], table[:, 1]), directions(table[:, 2], table[:, 3]), table[:, 4]


def least_squares(name: str, formula: Any, start: tuple[float, ...], most: float) -> np.ndarray:
    wi, wo, f = rows(name)
    mirrored = wi * [-1.0, -1.0, 1.0]
    given = np.sum(mirrored * wo, axis=1), np.linalg.norm((wo - mirrored)[:, :2], axis=1)
    found, _ = curve_fit(
        lambda _, *p: np.log10(formula(*given, *p)), np.arange(len(f)), np.log10(f), p0=start, bounds=(0, most)
    )
    return found


def phong(cos: np.ndarray, _: np.ndarray, kd: float, ks: float, n: float) -> np.ndarray:
    return kd / np.pi + ks * (n + 2) / (2 * np.pi) * np.clip(cos, 0, 1) ** n


def abg(_: np.ndarray, beta: np.ndarray, a: float, b: float, g: float) -> np.ndarray:
    return a / (b + beta**g)


def fitted(name: str, model: str) -> fm.Fit:
    return fm.fit(fm.read(FOLDER / f"{name}.csv.gz", columns=COLUMNS), model, loss="log10")


def test_abg_of_aluminium() -> None:
    fit = fitted("aluminium", "abg")
    a, b, g = fit.values.tolist()
    assert [f"{a:.3e}", f"{b:.3e}", f"{g:.3f}"] == ["3.362e-03", "4.309e-06", "2.068"]
    np.testing.assert_allclose(fit.values, least_squares("aluminium", abg, (1, 1, 1), 1e4), rtol=2e-3)


@pytest.mark.parametrize(
    ("name", "printed", "horizontal"), [("vegetation", [0.53, 0.28, 7.31], 66), ("water", [0.48, 0.08, 16.45], 43)]
)
def test_phong_from_the_air(name: str, printed: list[float], horizontal: int) -> None:
    """Without the rows at θ_o = 90° the exponents are 7.33 and 16.28."""
    fit = fitted(name, "lambert+phong")
    assert fit.measurements.masked == {"at or below the horizon": horizontal}
    assert fit.n_values == fit.measurements.n_samples
    assert np.round(fit.values, 2).tolist() == printed
    np.testing.assert_allclose(fit.values, least_squares(name, phong, (1, 1, 1), 200), rtol=1e-4)
