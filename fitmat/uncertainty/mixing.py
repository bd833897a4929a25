"""Mixing: whether walkers agree with each other, and how many independent draws stand behind the limits of intervals.

Arrays of draws only; what is enough, `diagnostics` says.
"""

import numpy as np
from jaxtyping import Float

from fitmat.maths import normal

LIMITS = 0.025, 0.975
"""Quantiles whose draws count."""

WINDOW = 5.0
"""Autocorrelation times over which autocorrelations are summed (Sokal 1997, as emcee has it)."""


def split_rhat(chain: Float[np.ndarray, "steps walkers d"]) -> Float[np.ndarray, " d"]:
    """Rank-normalised split-R̂, of the bulk or of the tails, whichever is larger; walkers count as chains.

    Vehtari, Gelman, Simpson, Carpenter & Bürkner 2021, Bayesian Analysis 16, eqs. 1–4 and 14.

    Args:
        chain: Draws; NaN comes of fewer than 4 steps or 2 walkers, of a NaN among them, and where no walker moved.
    """
    steps, walkers, d = chain.shape
    if steps < 4 or walkers < 2:
        return np.full(d, np.nan)
    halves = np.concatenate([chain[: steps // 2], chain[-(steps // 2) :]], axis=1)
    bulk = _rhat(_normal_scores(halves))
    tails = _rhat(_normal_scores(np.abs(halves - np.median(halves, axis=(0, 1)))))
    return np.where(np.isnan(chain).any(axis=(0, 1)), np.nan, np.fmax(bulk, tails))


def _normal_scores(x: Float[np.ndarray, "steps chains d"]) -> Float[np.ndarray, "steps chains d"]:
    """Each parameter's values replaced by normal quantiles of their ranks, Φ⁻¹((r − 3/8)/(S + 1/4)) (eq. 14).

    Equal values share the mean of their ranks.
    """
    found, size = np.empty(x.shape), x.shape[0] * x.shape[1]
    for k in range(x.shape[2]):
        _, place, count = np.unique(x[..., k], return_inverse=True, return_counts=True)
        rank = np.cumsum(count) - (count - 1) / 2
        found[..., k] = normal.quantile((rank - 3 / 8) / (size + 1 / 4))[place.reshape(x.shape[:2])]
    return found


def _rhat(x: Float[np.ndarray, "steps chains d"]) -> Float[np.ndarray, " d"]:
    """√((N − 1)/N + B/(N W)) with the variances between and within chains (eqs. 1–4)."""
    between = np.var(x.mean(axis=0), axis=0, ddof=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.sqrt(between / np.var(x, axis=0, ddof=1).mean(axis=0) + 1.0 - 1.0 / len(x))


def tail_ess(chain: Float[np.ndarray, "steps walkers d"]) -> Float[np.ndarray, " d"]:
    """Effective number of independent draws behind both limits of a central 95 % interval, whichever has fewer.

    That of whether a draw lies below the limit (Vehtari et al. 2021, sec. 4.3, there for 5 and 95 %): walks that linger
    in a tail know less of it than of the middle. Autocovariances are averaged over the walkers about the mean of all,
    since in a short walk hardly any draw is beyond a limit.

    Args:
        chain: Draws; NaN comes of fewer than 4 steps, and where no walker moved.
    """
    steps, walkers, d = chain.shape
    if steps < 4:
        return np.full(d, np.nan)
    below = np.concatenate([chain <= limit for limit in np.quantile(chain, LIMITS, axis=(0, 1))], axis=2)
    apart = below - below.mean(axis=(0, 1))
    spectrum = np.abs(np.fft.rfft(apart, 2 * steps, axis=0)) ** 2
    covariance = np.fft.irfft(spectrum, axis=0)[:steps].mean(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        tau = 2.0 * np.cumsum(covariance / covariance[0], axis=0) - 1.0
    reached = np.arange(steps)[:, None] >= WINDOW * tau
    end = np.where(reached.any(axis=0), reached.argmax(axis=0), steps - 1)
    return (steps * walkers / tau[end, np.arange(2 * d)]).reshape(2, d).min(axis=0)
