"""Laplace's approximation: the Gaussian around the best fit, and draws from it.

It walks nowhere; `uncertainty` does.
"""

import importlib
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from jaxtyping import Float

from fitmat import fitting
from fitmat.apparent import apparent
from fitmat.density import default_walkers, log_posterior, physical
from fitmat.information import inverse_information
from fitmat.likelihood import noise_scale
from fitmat.measurement import Measurements
from fitmat.outcome import Fit
from fitmat.params import space
from fitmat.posterior import Posterior

LAPLACE_DRAWS = 2000


def laplace(fit: Fit, *, seed: int) -> Posterior:
    """Draws from the Gaussian with the fit's covariance in natural coordinates, folded into the bounds.

    Args:
        fit: A fit with a finite optimum.
        seed: Seed of the draws.

    Returns:
        A `Posterior`; a fit that is not finite gives a single, unusable draw.
    """
    if not fit.finite:
        return Posterior(fit, "laplace", fit.values[None], np.array([fit.discrepancy]))
    values, discrepancy = physical(fit, draws(fit, LAPLACE_DRAWS, np.random.default_rng(seed)))
    return Posterior(fit, "laplace", values, discrepancy)


def laplace_each(measurements: Measurements, jobs: Mapping[str, Mapping[str, Any]], *, seed: int) -> list[Posterior]:
    """`fit` and `laplace` of several models, side by side in threads: most of a first fit is compilation.

    Args:
        measurements: From `fitmat.read`.
        jobs: Model name → keyword arguments of `fit`.
        seed: Of the draws.

    Raises:
        FitmatError: as `fit`, for the first model that cannot be fitted.
    """

    def one(name: str) -> Posterior:
        return laplace(fitting.fit(measurements, name, **jobs[name]), seed=seed)

    with ThreadPoolExecutor() as pool:
        pending = [pool.submit(one, name) for name in jobs]
        importlib.import_module("emcee")  # slow to load, and this thread has nothing else to do
        return [job.result() for job in pending]


def gaussian(fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of the sampled coordinates: the free natural ones, `apparent` weights, and s."""
    whole, free = space(fit.model), fit.free
    span = (whole.natural_upper - whole.natural_lower)[free]
    centre = np.append(whole.natural_array(fit.values)[free], fit.discrepancy)
    covariance = np.zeros((len(centre),) * 2)
    # The flat prior counts with the variance of its range: a direction that no datum determines is no wider than it.
    information = fit.information[np.ix_(free, free)] + np.diag(12.0 / span**2)
    covariance[:-1, :-1] = inverse_information(information, span)
    covariance[-1, -1] = _discrepancy_sd(fit) ** 2
    return apparent(fit).gaussian(centre, covariance)


def draws(fit: Fit, count: int, rng: np.random.Generator) -> Float[np.ndarray, "count d"]:
    """Gaussian draws of the sampled coordinates, folded at the bounds of the parameters."""
    whole, free, where = space(fit.model), fit.free, apparent(fit)
    low, high = whole.natural_lower[free], whole.natural_upper[free]
    natural = where.natural_array(rng.multivariate_normal(*gaussian(fit), size=count, method="eigh"))
    turn = (natural[:, :-1] - low) % (2 * (high - low))
    folded = low + np.where(turn > high - low, 2 * (high - low) - turn, turn)
    return where.sampled(np.column_stack([folded, np.abs(natural[:, -1])]))


def _discrepancy_sd(fit: Fit) -> float:
    """Half of how far s must move from its best value for the log-likelihood to fall by 2.

    That is σ of a Gaussian, and also the mean of the exponential that s follows where its best value is 0.
    """
    if fit.discrepancy_sd is not None:
        return fit.discrepancy_sd
    unit = max(float(noise_scale(fit.data)), 1e-12)
    moves = np.sort(np.concatenate([unit * 2.0 ** np.arange(-12, 12), fit.discrepancy * 2.0 ** np.arange(-6, 2)]))
    moves = moves[moves > 0]
    natural = space(fit.model).natural_array(fit.values)[fit.free]
    along = apparent(fit).sampled(np.vstack([np.append(natural, fit.discrepancy + move) for move in (0.0, *moves)]))
    density = log_posterior(fit, default_walkers(fit))(along)
    drop = density[0] - density[1:]
    crossing = np.flatnonzero(drop > 2.0)
    if len(crossing) == 0:
        return float(moves[-1])
    first = crossing[0]
    return float(moves[first] / np.sqrt(2.0 * drop[first]))
