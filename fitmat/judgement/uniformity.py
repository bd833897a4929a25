"""Uniformity of ranks: how far their cumulative distribution strays from a straight line, and whether by chance.

Säilynoja, Bürkner & Vehtari, "Graphical test for discrete uniformity and its applications in goodness-of-fit evaluation
and multiple sample comparison", Statistics and Computing 32, 32 (2022), section 2: at z_j = j/(L + 1) the number of
ranks below j is binomial, and the smallest of all pointwise two-sided probabilities is compared with the smallest of
sets that are uniform. Nothing here knows where the ranks come from.
"""

import functools

import numpy as np
from jaxtyping import Float, Int

SETS = 20_000
"""Simulated sets of uniform ranks: a probability of 0.001 is known to a fifth of itself."""


def p_values(ranks: Int[np.ndarray, "n q"], draws: int) -> Float[np.ndarray, " q"]:
    """How probable so large a deviation from uniformity is by chance, for each column.

    Args:
        ranks: How many of the draws lie below the truth, 0 to `draws`.
        draws: L, how many there are.

    Returns:
        Monte Carlo p-values (1 + k)/(1 + `SETS`), k sets being as far off (Davison & Hinkley 1997, eq. 4.11).
    """
    counts = np.stack([np.bincount(column, minlength=draws + 1) for column in ranks.T])
    found = _smallest(counts, _pointwise(len(ranks), draws + 1))
    return (1.0 + np.searchsorted(_by_chance(len(ranks), draws + 1), found, side="right")) / (1.0 + SETS)


def band(count: int, draws: int, level: float) -> tuple[Float[np.ndarray, " z"], Float[np.ndarray, "2 z"]]:
    """The band in which the whole cumulative distribution of uniform ranks lies with probability `level`.

    Args:
        count: n, how many ranks.
        draws: L, the largest rank.
        level: Simultaneous coverage, 0 to 1.

    Returns:
        Where it is evaluated, z = 1/(L + 1) … L/(L + 1), and its lower and upper limit there, as fractions.
    """
    from scipy.stats import binom

    z = np.arange(1, draws + 1) / (draws + 1)
    gamma = np.quantile(_by_chance(count, draws + 1), 1.0 - level, method="lower")
    return z, np.stack([binom.ppf(gamma / 2, count, z), binom.isf(gamma / 2, count, z)]) / count


def _pointwise(count: int, bins: int) -> Float[np.ndarray, "z k"]:
    """Two-sided probability of k = 0 … n ranks below each z."""
    from scipy.stats import binom

    z, k = np.arange(1, bins)[:, None] / bins, np.arange(count + 1)
    return 2.0 * np.minimum(binom.cdf(k, count, z), binom.sf(k - 1, count, z))


def _smallest(counts: Int[np.ndarray, "m bins"], pointwise: np.ndarray) -> Float[np.ndarray, " m"]:
    below = np.cumsum(counts, axis=1)[:, :-1]
    return pointwise[np.arange(below.shape[1]), below].min(axis=1)


@functools.lru_cache(maxsize=64)
def _by_chance(count: int, bins: int) -> Float[np.ndarray, " m"]:
    """The smallest pointwise probabilities of `SETS` uniform sets, sorted."""
    rng = np.random.default_rng(0)
    counts = rng.multinomial(count, np.full(bins, 1.0 / bins), size=SETS)
    return np.sort(_smallest(counts, _pointwise(count, bins)))
