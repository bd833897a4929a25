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
        ci95: By `limits`, over posterior draws.
    """

    value: float
    ci95: tuple[float, float]

    @property
    def has_interval(self) -> bool:
        """Whether draws spread about it; those of an objective do not."""
        return self.ci95[0] < self.ci95[1]


def limits(
    best: Float[np.ndarray, "..."], draws: Float[np.ndarray, "d ..."], level: float = 0.95
) -> Float[np.ndarray, "2 ..."]:
    """An interval that holds the best value: between the 2.5 % and 97.5 % quantiles of the draws, else one-sided.

    The best value lies beyond these where the posterior is a ridge or leans on a bound. Then it takes the place of one
    end, or the outermost draw does, and the other end leaves out 5 %.

    Args:
        best: Of the best fit.
        draws: Of each posterior draw.
        level: Share of the draws in the interval.
    """
    out = 1.0 - level
    shares = [0.0, out / 2, out, 1.0 - out, 1.0 - out / 2, 1.0]
    lowest, low, fifth, rest, high, highest = np.quantile(draws, shares, axis=0)
    below, above = best < low, best > high
    return np.stack(
        [
            np.where(below, np.minimum(best, lowest), np.where(above, fifth, low)),
            np.where(above, np.maximum(best, highest), np.where(below, rest, high)),
        ]
    )


def estimate(values: Float[np.ndarray, " d"]) -> Estimate:
    """The first entry with the `limits` of the others; without others, the entry alone.

    Args:
        values: At the best fit, then at each posterior draw, (1 + draws,), in any unit.

    Example:
        >>> estimate(np.array([2.0, 1.0, 3.0])).ci95
        (1.05, 2.95)
    """
    low, high = limits(values[0], values[1:] if len(values) > 1 else values)
    return Estimate(float(values[0]), (float(low), float(high)))


def estimates(values: Float[np.ndarray, "d k"]) -> list[Estimate]:
    """`estimate` of each column."""
    low, high = limits(values[0], values[1:] if len(values) > 1 else values).tolist()
    return [Estimate(*parts) for parts in zip(values[0].tolist(), zip(low, high, strict=True), strict=True)]


def band(curves: Float[np.ndarray, "d ..."]) -> Float[np.ndarray, "3 ..."]:
    """Rows low, best, high of curves at the best fit and at each draw: the same limits as in `estimate`, pointwise."""
    low, high = limits(curves[0], curves[1:] if len(curves) > 1 else curves)
    return np.stack([low, curves[0], high])
