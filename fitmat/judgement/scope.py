"""Scope: what the intervals of a fit are about, as plain sentences: which incidences, and how many readings.

It widens nothing; `fitting.correlation` does.
"""

import numpy as np

from fitmat.fitting.result import Fit
from fitmat.measurements.incidences import incidence_range


def describe_scope(fit: Fit) -> str:
    """What the intervals are about; empty where there are none."""
    if not (fit.finite and fit.loss.posterior):
        return ""
    data, found, count = fit.data, fit.correlation, fit.n_values
    low, high = np.rad2deg(incidence_range(np.asarray(data.wi), np.any(np.greater(data.weight, 0.0), axis=1)))
    over = f"{low:.3g}°" if high - low < 0.05 else f"{low:.3g}–{high:.3g}°"
    about = f"The intervals of {fit.name} are about the incidences measured ({over}); beyond, they extrapolate."
    if found.outcome == "not judged":
        return (
            f"{about} Whether neighbouring angles share a misfit cannot be judged from {count:,} readings: they "
            "hold only if the model is right."
        )
    if not found.found:
        return about
    shared = found.shared or "errors of neighbouring angles are alike"
    shared = shared[0].upper() + shared[1:]
    return (
        f"{about} {shared}: {count:,} readings count as {_counted(found.independent)} independent ones. The intervals "
        f"allow for that: they are up to {np.sqrt(found.inflation.max()):.2g} times wider."
    )


def _counted(independent: float) -> str:
    return f"{independent:,.0f}" if independent >= 10 else f"{independent:.2g}"
