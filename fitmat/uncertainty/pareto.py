"""Pareto-smoothed importance sampling: weights whose largest follow the tail that fits them, and how heavy that is.

It draws nothing, evaluates no density and decides nothing: what k̂ is good enough is for `diagnostics` to say.

Vehtari, Simpson, Gelman, Yao & Gabry, "Pareto smoothed importance sampling", JMLR 25(72), 2024 (PSIS); Zhang &
Stephens, "A new and efficient estimation method for the generalized Pareto distribution", Technometrics 51(3), 2009.
"""

import numpy as np
from jaxtyping import Float

from fitmat.maths.parts import slices

FEWEST_IN_TAIL = 6
"""Weights of a tail, below which nothing is fitted to it: of five the lower quartile is the smallest."""

PRIOR_SHAPE, PRIOR_WEIGHT = 0.5, 10.0
"""What k̂ is pulled towards, and with the weight of how many values, lest few make it jump (PSIS)."""

MOST_NUMBERS = 1_000_000
"""Draws × values that are weighted at a time."""


def smoothed(logs: Float[np.ndarray, "... m"]) -> tuple[Float[np.ndarray, "... m"], Float[np.ndarray, "..."]]:
    """Weights that add to 1, their largest replaced by those of the Pareto tail that fits them, and its shape k̂.

    Args:
        logs: Log importance ratios, up to a constant; finite, or −∞ for a ratio of 0.

    Returns:
        Weights along the last axis, and k̂. Where the tail has fewer than `FEWEST_IN_TAIL` values, or all the same,
        nothing can be fitted to it: the weights are those of the ratios, and k̂ is ∞.
    """
    found, k = _log_weights(logs, 1.0)
    return np.exp(found), k


def leave_one_out(
    log_densities: Float[np.ndarray, "m n"], r_eff: float = 1.0
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"], float]:
    """The predictive density of each value by the posterior of all others, its draws weighted with 1/p(y_i | θ).

    elpd_i = ln Σ_s w_s p(y_i | θ_s), the weights Pareto-smoothed; p_loo = Σ_i (ln Σ_s p(y_i | θ_s)/m − elpd_i)
    (Vehtari, Gelman & Gabry 2017, Statistics and Computing 27, eqs. 3 and 10).

    Args:
        log_densities: ln p(y_i | θ_s) of m posterior draws and n values.
        r_eff: Independent draws in each, at most 1: correlated draws need a longer tail.

    Returns:
        elpd_i in nats, k̂ of each value as in `smoothed`, and p_loo, the effective number of parameters.
    """
    m, n = log_densities.shape
    elpd, mean, k = np.empty((3, n))
    for part in slices(n, max(1, MOST_NUMBERS // m)):
        logs = np.ascontiguousarray(log_densities[:, part].T)
        weights, k[part] = _log_weights(-logs, r_eff)
        elpd[part], mean[part] = _log_sum(weights + logs), _log_sum(logs) - np.log(m)
    return elpd, k, float(np.sum(mean - elpd))


def _log_weights(
    logs: Float[np.ndarray, "... m"], r_eff: float
) -> tuple[Float[np.ndarray, "... m"], Float[np.ndarray, "..."]]:
    """Smoothed log weights, and k̂."""
    *lead, m = logs.shape
    flat = np.reshape(logs, (-1, m))
    found = flat - flat.max(axis=1, keepdims=True)
    k, count = np.full(len(found), np.inf), _tail_length(m, r_eff)
    if count >= FEWEST_IN_TAIL:
        # The last `count` places are of the tail, the one before of the largest ratio below it.
        order = np.argpartition(found, m - count - 1, axis=1)[:, m - count - 1 :]
        cutoff, places = np.exp(np.take_along_axis(found, order[:, :1], axis=1)), order[:, 1:]
        tail = np.take_along_axis(found, places, axis=1)
        rank = np.argsort(tail, axis=1)
        places, tail = (np.take_along_axis(part, rank, axis=1) for part in (places, tail))
        shape, scale = _generalised_pareto(np.exp(tail) - cutoff)
        fitted = np.isfinite(shape) & np.isfinite(scale) & (scale > 0.0) & (tail[:, -1] > tail[:, 0])
        k[fitted] = shape[fitted]
        values = cutoff[fitted] + _quantiles(count, shape[fitted, None], scale[fitted, None])
        # No weight is larger than the largest ratio, as a quantile beyond all numbers would be.
        smooth = np.minimum(np.log(values), 0.0)
        found[np.flatnonzero(fitted)[:, None], places[fitted]] = smooth
    found -= _log_sum(found)[:, None]
    return found.reshape(logs.shape), k.reshape(lead)


def _tail_length(m: int, r_eff: float) -> int:
    """M = min(m/5, 3 √(m/r_eff)) (PSIS)."""
    return int(min(m / 5, 3.0 * np.sqrt(m / r_eff)))


def _generalised_pareto(
    x: Float[np.ndarray, "n t"],
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Shape k and scale σ of exceedances in ascending order, by the empirical Bayes estimate of Zhang & Stephens 2009.

    b = −k/σ is averaged over its profile likelihood on a grid of quantiles of their prior; k = mean ln(1 − b x). The
    shape is then shrunk towards `PRIOR_SHAPE`. Not finite where the lower quartile of the exceedances, which sets the
    scale of that grid, is the smallest of them.
    """
    t = x.shape[1]
    size = 30 + int(np.sqrt(t))
    quartile = x[:, int(t / 4 + 0.5) - 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        grid = 1.0 - np.sqrt(size / (np.arange(1, size + 1) - 0.5))
        b = grid / (3.0 * np.where(quartile > x[:, 0], quartile, np.nan)[:, None]) + 1.0 / x[:, -1:]
        k = np.stack([np.log1p(-one[:, None] * x).mean(axis=1) for one in b.T], axis=1)
        profile = t * (np.log(-b / k) - k - 1.0)
        weights = np.exp(profile - profile.max(axis=1, keepdims=True))
        b_mean = np.sum(weights * b, axis=1) / weights.sum(axis=1)
        shape = np.log1p(-b_mean[:, None] * x).mean(axis=1)
        scale = -shape / b_mean
    return (t * shape + PRIOR_WEIGHT * PRIOR_SHAPE) / (t + PRIOR_WEIGHT), scale


def _quantiles(
    count: int, shape: Float[np.ndarray, "n 1"], scale: Float[np.ndarray, "n 1"]
) -> Float[np.ndarray, "n t"]:
    """Quantiles of the generalised Pareto distribution at (z − ½)/M, z = 1 … M: σ ((1 − p)^(−k) − 1)/k (PSIS)."""
    log_survival = np.log1p(-(np.arange(count) + 0.5) / count)
    curved = np.where(shape == 0.0, 1.0, shape)
    with np.errstate(over="ignore"):  # of a few draws that outweigh all others
        return scale * np.where(shape == 0.0, -log_survival, np.expm1(-curved * log_survival) / curved)


def _log_sum(logs: Float[np.ndarray, "n m"]) -> Float[np.ndarray, " n"]:
    """ln Σ exp over the last axis."""
    top = logs.max(axis=1)
    return top + np.log(np.exp(logs - top[:, None]).sum(axis=1))
