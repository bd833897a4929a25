"""Assumed noise: what would follow for a fit if noise that is not known were some per cent of each value.

It fits nothing again: the best parameters stay, and the widths come from the curvature there.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.fitting.concluding import discrepancy_of
from fitmat.fitting.discrepancy import first_discrepancy
from fitmat.fitting.information import covariance, information
from fitmat.fitting.losses import DEFAULT
from fitmat.fitting.result import Fit
from fitmat.models.values import at

ASSUMED = 0.01, 0.03, 0.1
"""Fractions of each value: a careful laboratory, a usual one, a rough one."""

LEAST = 1e-4
"""Of the brightest value: the noise is nowhere assumed to be less than this much of its fraction."""


def consequences(fit: Fit) -> Float[np.ndarray, "3 2"]:
    """For each of `ASSUMED`: the misfit in units of that noise, and how much wider the intervals would be, (3, 2).

    Args:
        fit: Under a likelihood, of measurements whose noise is not known.

    Returns:
        Ratio of the discrepancy to the noise of the typical value; median over the parameters of the standard deviation
        by that of the fit. NaN where there is none.
    """
    data, own = fit.data, np.sqrt(np.diagonal(fit.likelihood_covariance))
    x = np.abs(at(fit.model, data.wi, data.wo) * data.kappa)
    level = np.maximum(x, LEAST * np.max(x, where=np.asarray(data.weight) > 0, initial=0.0))
    found = []
    for fraction in ASSUMED:
        noise = np.where(np.asarray(data.weight) > 0, fraction * level, data.noise)
        typical = np.median((noise / (3.0 * np.cbrt(level) ** 2))[np.asarray(data.weight) > 0])
        assumed = dataclasses.replace(data, noise=noise, loss=DEFAULT, level=None, typical=np.asarray(typical))
        s = float(discrepancy_of(at(fit.model, data.wi, data.wo) * data.kappa, assumed, first_discrepancy(assumed)))
        known = information(fit.model, assumed, s, fit.free)
        spread, _ = covariance(fit.model, known, fit.coordinates, assumed.told(fit.free))
        with np.errstate(all="ignore"):
            wider = np.sqrt(np.diagonal(spread)) / own
        usable = wider[np.isfinite(wider)]
        found.append((s / typical, np.median(usable) if len(usable) else np.nan))
    return np.array(found)


def words(fit: Fit) -> str:
    """That as a sentence; "" where nothing follows."""
    if fit.noise.known or not (fit.finite and fit.loss.infers_discrepancy):
        return ""
    found = consequences(fit)
    if not np.isfinite(found).all():
        return ""
    shares, misfits, widths = (
        _three(column, unit)
        for column, unit in ((100 * np.array(ASSUMED), " %"), (found[:, 0], " ×"), (found[:, 1], ""))
    )
    return (
        f"If it were {shares} of each value, the misfit would be {misfits} the noise, and the intervals {widths} times "
        "as wide as they are."
    )


def _three(numbers: Float[np.ndarray, "3"], unit: str) -> str:
    first, second, third = (f"{x:.2g}" for x in numbers)
    return f"{first}, {second} or {third}{unit}"
