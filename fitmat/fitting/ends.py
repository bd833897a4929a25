"""Ends: where the starts of a fit ended, and how far each is behind the best.

They are found by `refining`; what they mean, `result` says.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from fitmat.fitting.coordinates import Coordinates
from fitmat.fitting.likelihood import Data
from fitmat.maths.normal import Z95

AGREE = 0.1
"""Starts whose log-likelihood is within this of the best have found the same optimum."""

AS_GOOD = Z95**2 / 2.0
"""Nats within which an end is as good as the best: that of a parameter at its 95 % limit (Wilks 1938)."""


class Ends(NamedTuple):
    """Where k starts ended; every array begins with k."""

    values: np.ndarray
    discrepancy: np.ndarray
    log_likelihood: np.ndarray
    solved: np.ndarray
    steps: np.ndarray


def behind(ends: Ends, data: Data) -> Float[np.ndarray, " k"]:
    """How far each end is behind the best, in nats; infinite where it is not finite.

    An objective does not say how far the data scatter: the mean square of what its best end leaves over does.
    """
    usable = np.isfinite(ends.log_likelihood) & np.isfinite(ends.values).all(axis=1)
    scores = np.where(usable, ends.log_likelihood, -np.inf)
    if not usable.any():
        return np.full(len(scores), np.inf)
    apart = scores.max() - scores
    if data.loss.posterior:
        return apart
    left = -2.0 * scores.max() / max(np.count_nonzero(data.weight), 1)
    return apart / max(left, 1e-300)


def home(data: Data, moved: Coordinates, values: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
    """A parameter vector with what is periodic within half a period of 0, but for what a prior tells of."""
    centre = np.zeros_like(values)
    told = moved.index[data.told(moved.index)]
    centre[told] = values[told]
    return moved.near(values, centre)
