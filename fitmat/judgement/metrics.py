"""How far a fitted model is from its measurements, by the metrics of the literature.

Compares no models with each other; `comparison` does.
"""

import numpy as np

from fitmat.fitting.result import Fit
from fitmat.measurements.samples import Measurements
from fitmat.models.base import evaluate


def fit_metrics(fit: Fit) -> dict[str, float | None]:
    """How far a fitted model is from its measurements, by the metrics of the literature.

    Returns:
        cube_root: √(mean (∛(M κ) − ∛(f κ))²), κ = cosθ_i; log_ratio: rms of ln((M κ + ε)/(f κ + ε)), κ = cosθ_i cosθ_o,
        ε = 10⁻³; ngan: √(mean (M − f)² κ²) up to 80° (Ngan et al. 2005); low_e2: mean of
        (ln(1 + M κ) − ln(1 + f κ))² sinθ_i (Löw et al. 2012, E2); peak_ratio: fitted over measured maximum, median over
        incidences and channels; misfit_ratio: discrepancy over noise.
    """
    m = fit.measurements
    predicted = evaluate(fit.model, m.wi, m.wo)
    ci, co, valid = m.wi[:, 2:3], m.wo[:, 2:3], m.valid
    measured = np.where(valid, m.value, 0.0)

    def mean(term: np.ndarray, keep: np.ndarray | bool = True) -> float | None:
        used = term[valid & keep]
        return float(used.mean()) if used.size else None

    def root(value: float | None) -> float | None:
        return None if value is None else value**0.5

    cubes = (np.cbrt(measured * ci) - np.cbrt(predicted * ci)) ** 2
    kappa = np.maximum(ci * co, 1e-3)
    logs = np.log(np.maximum(measured * kappa, 0) + 1e-3) - np.log(predicted * kappa + 1e-3)
    high = (np.maximum(m.theta_i, m.theta_o) <= np.deg2rad(80.0))[:, None]
    low = (np.log1p(np.maximum(measured * ci, 0)) - np.log1p(predicted * ci)) ** 2
    return {
        "cube_root": root(mean(cubes)),
        "log_ratio": root(mean(logs**2)),
        "ngan": root(mean(((measured - predicted) * ci) ** 2, high)),
        "low_e2": mean(low * np.sin(m.theta_i)[:, None]),
        "peak_ratio": _peak_ratio(m, predicted),
        "misfit_ratio": fit.misfit_ratio if fit.noise.known else None,
    }


def _peak_ratio(m: Measurements, predicted: np.ndarray) -> float | None:
    """Fitted over measured maximum, median over incidence angles and channels."""
    groups = np.unique(np.round(np.rad2deg(m.theta_i), 2), return_inverse=True)[1]
    peaks = [np.full((groups.max() + 1, m.value.shape[1]), -np.inf) for _ in range(2)]
    for peak, f in zip(peaks, (m.value, predicted), strict=True):
        np.maximum.at(peak, groups, np.where(m.valid, f, -np.inf))
    usable = np.isfinite(peaks[0]) & (peaks[0] > 0)
    return float(np.median(peaks[1][usable] / peaks[0][usable])) if usable.any() else None
