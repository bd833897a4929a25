"""A number with its interval: how every result that rests on posterior draws is told.

It computes no result and knows no posterior.
"""

import dataclasses

import numpy as np
from jaxtyping import Float


@dataclasses.dataclass(frozen=True)
class Estimate:
    """A number with its 95 % posterior interval.

    Attributes:
        value: At the best fit, or at the two best fits.
        ci95: 2.5 % and 97.5 % quantiles over posterior draws.
    """

    value: float
    ci95: tuple[float, float]

    @property
    def has_interval(self) -> bool:
        """Whether draws spread about it; those of an objective do not."""
        return self.ci95[0] < self.ci95[1]


def estimate(values: Float[np.ndarray, " d"]) -> Estimate:
    """The first entry with the 2.5 % and 97.5 % quantiles of the others; without others, the entry alone.

    Args:
        values: At the best fit, then at each posterior draw, (1 + draws,), in any unit.

    Example:
        >>> estimate(np.array([2.0, 1.0, 3.0])).ci95
        (1.05, 2.95)
    """
    low, high = np.quantile(values[1:] if len(values) > 1 else values, [0.025, 0.975])
    return Estimate(float(values[0]), (float(low), float(high)))


def band(curves: Float[np.ndarray, "d ..."]) -> Float[np.ndarray, "3 ..."]:
    """Rows low, best, high of curves at the best fit and at each draw: the same quantiles as `estimate`, pointwise."""
    low, high = np.quantile(curves[1:] if len(curves) > 1 else curves, [0.025, 0.975], axis=0)
    return np.stack([low, curves[0], high])
