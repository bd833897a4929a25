"""Proportional: noise that nobody stated, where the scatter about a fitted model is one share of every value.

A misfit that is of one size in the cube root swamps the faint values of a scan over several decades, where an
instrument that errs by a share of what it reads measures them as well as the bright ones. Which of the two the
residuals follow, the likelihood says. Noise that is given, or seen in repeats and neighbours, is not touched; nor are
residuals that are alike, for those are a misfit.
"""

import numpy as np

from fitmat.fitting.concluding import discrepancy_of
from fitmat.fitting.coordinates import Coordinates
from fitmat.fitting.discrepancy import first_discrepancy
from fitmat.fitting.ends import Ends, behind
from fitmat.fitting.likelihood import Data, log_pointwise, prepare
from fitmat.fitting.process import FEWEST
from fitmat.fitting.refining import optima
from fitmat.measurements.neighbours import curves
from fitmat.measurements.noise import Noise
from fitmat.measurements.samples import Measurements
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import with_vector
from fitmat.models.values import at

DECADES = 2.0
"""Over so many powers of ten the values must range: over fewer, a share of each is hardly told from one size."""

MOST = 0.2
"""Of each value: a larger share is no noise that an instrument has."""

FAINT = 0.1
"""Share of the values that lie below what counts as faint."""

LEAST = 1e-6
"""Of the brightest value of the model: what is fainter counts as this."""

ALIKE = 2.0
"""Standard errors by which neighbouring residuals may be correlated by chance."""

ASKED = 3.0
"""Nats by which a share of each value must describe the values better than one size of all."""

AGAIN = 4
"""How often a fit is repeated with the noise that its own values make; the share then moves by less than 1 %."""

SETTLED = 1e-2
"""Relative change of the share at which that ends."""


def proportional(
    m: Measurements, shown: AbstractBRDF, given: tuple[Noise, Data], ends: Ends, moved: Coordinates, max_steps: int
) -> tuple[Noise, Data, Ends]:
    """The noise, the samples and the ends with a share of each value as noise, or all as they are.

    Iterated weights (Carroll & Ruppert, Transformation and Weighting in Regression, 1988, sec. 2.4): σ is that share
    of the fitted model's value, so that no model gains by larger values. The share counts the fitted parameters.

    Args:
        m: The measurements.
        shown: Gives shapes, bounds and static choices.
        given: Noise that is not known, and the samples with its placeholder.
        ends: Of the fit to them.
        moved: The parameters that are fitted.
        max_steps: Levenberg–Marquardt iterations per start.
    """
    noise, data = given
    if not _ranging(data, moved.count):
        return noise, data, ends
    found, tried, share = (noise, data), ends, 0.0
    for _ in range(AGAIN):
        best = with_vector(shown, tried.values[int(np.argmin(behind(tried, data)))])
        before, share = share, _share(best, data, moved.count)
        if not share or _alike(m, best):
            return noise, data, ends
        found = _shared(m, best, share, data)
        tried = optima(shown, found[1], tried.values, moved, max_steps)
        if abs(share - before) < SETTLED * share or not np.isfinite(behind(tried, data)).any():
            break
    better = np.nanmax(tried.log_likelihood) - np.nanmax(ends.log_likelihood) >= ASKED
    return (*found, tried) if better else (noise, data, ends)


def _ranging(data: Data, parameters: int) -> bool:
    """Whether there are enough values, and over decades."""
    x = np.abs(data.x[data.weight > 0])
    enough = len(x) >= parameters + FEWEST
    return enough and bool(x.max() >= 10.0**DECADES * np.quantile(x, FAINT) > 0.0)


def _level(x: np.ndarray) -> np.ndarray:
    return np.maximum(np.abs(x), LEAST * np.max(np.abs(x)))


def _share(best: AbstractBRDF, data: Data, parameters: int) -> float:
    """The share of the model's values by which the data scatter; 0 where the default describes them as well."""
    x, used = at(best, data.wi, data.wo) * data.kappa, data.weight > 0
    if not np.isfinite(x).all():
        return 0.0
    level, count = _level(x), int(np.count_nonzero(used))
    share = float(np.sqrt(np.sum(((data.x - x) / level) ** 2, where=used) / (count - parameters)))

    def likelihood(noise: np.ndarray, s: float) -> float:
        return float(np.sum(log_pointwise(x, noise, data, np.asarray(s)), where=used))

    other = likelihood(data.noise, float(discrepancy_of(x, data, first_discrepancy(data))))
    better = likelihood(np.where(used, share * level, 1.0), 0.0) - other >= ASKED
    return share if better and share <= MOST else 0.0


def _alike(m: Measurements, best: AbstractBRDF) -> bool:
    """Whether relative residuals of neighbours on a curve are alike, in any channel."""
    value = at(best, m.wi, m.wo)
    r = (m.value - value) / _level(value)
    for k in range(r.shape[1]):
        rows, curve, _ = curves(m, k)
        ahead, behind_it = r[rows[1:], k], r[rows[:-1], k]
        same = np.diff(curve) == 0
        power = np.sum(r[rows, k] ** 2) * np.count_nonzero(same) / max(len(rows), 1)
        if np.sum(ahead[same] * behind_it[same]) > ALIKE * power / np.sqrt(max(np.count_nonzero(same), 1)):
            return True
    return False


def _shared(m: Measurements, best: AbstractBRDF, share: float, data: Data) -> tuple[Noise, Data]:
    """The noise and the samples with it."""
    sigma = np.where(m.valid, share * _level(at(best, m.wi, m.wo)), 1.0)
    words = (
        f"Noise unknown: too few repeats or neighbouring angles; faint values scatter about {best.name} as bright ones "
        f"do, by {100 * share:.2g} % of themselves, which is counted as noise."
    )
    found = Noise(sigma, False, words)
    return found, prepare(m, found, data.prior, data.loss)
