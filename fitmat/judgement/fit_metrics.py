"""How far a fitted model is from its measurements, by the metrics of the literature.

Compares no models with each other; `match` does.
"""

import numpy as np
from jaxtyping import Float

from fitmat.fitting.result import Fit
from fitmat.measurements.incidences import incidences
from fitmat.models.metrics import METRICS, above_minus_one, within
from fitmat.models.values import at


def fit_metrics(fit: Fit) -> dict[str, float | None]:
    """How far a fitted model is from its measurements, by the metrics of the literature.

    Returns:
        cube_root, log_ratio, ngan and low_e2: the `METRICS` of those names over the measured values instead of all
        directions, κ = cosθ_i cosθ_o in the log ratio, E2 of values above −1/cosθ_i as the loss of that name has it;
        peak_ratio: fitted over measured maximum, median over incidences and channels; misfit_ratio: discrepancy over
        noise. None where no value is left.
    """
    m = fit.measurements
    predicted, measured = at(fit.model, m.wi, m.wo), np.where(m.valid, m.value, 0.0)
    kept = {
        "cube-root": m.valid,
        "log-ratio": m.valid,
        "ngan": m.valid & within(m.theta_i, m.theta_o)[:, None],
        "low-e2": m.valid & above_minus_one(measured * m.wi[:, 2:]),
    }
    found: dict[str, float | None] = {}
    for name, keep in kept.items():
        metric, cosines = METRICS[name], (m.wi[:, 2:], m.wo[:, 2:])
        square = (metric.transform(measured, *cosines) - metric.transform(predicted, *cosines)) ** 2
        rings = np.sin(m.theta_i)[:, None] if metric.kind == "mean square" else 1.0
        mean = float((square * rings)[keep].mean()) if keep.any() else None
        found[name.replace("-", "_")] = mean if mean is None or metric.kind == "mean square" else mean**0.5
    misfit = fit.misfit_ratio if fit.noise.known else None
    return found | {"peak_ratio": _peak_ratio(fit, predicted), "misfit_ratio": misfit}


def _peak_ratio(fit: Fit, predicted: Float[np.ndarray, "n c"]) -> float | None:
    """Fitted over measured maximum, median over incidence angles and channels."""
    m, ratios = fit.measurements, []
    for group in incidences(m.wi, np.any(m.valid, axis=1), most=None):
        measured, fitted = (
            np.where(m.valid[group.rows], f[group.rows], -np.inf).max(axis=0) for f in (m.value, predicted)
        )
        usable = np.isfinite(measured) & (measured > 0)
        ratios.append(fitted[usable] / measured[usable])
    found = np.concatenate(ratios) if ratios else np.zeros(0)
    return float(np.median(found)) if found.size else None
