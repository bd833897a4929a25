"""Range of values: from where to where a channel's numbers reach, and whether they were cut off below.

It judges no value by its direction.
"""

import dataclasses
import math

import numpy as np
from jaxtyping import Float

CLIPPED = 3
"""A smallest value that occurs exactly so many times is a limit at which values were cut off."""


@dataclasses.dataclass(frozen=True)
class ValueRange:
    """The range of one channel's valid values, sr⁻¹.

    Attributes:
        count: How many are valid.
        lowest: The smallest positive one; None where there is none.
        highest: The largest; None for an empty channel.
        negative: How many are negative.
        clipped: How many times the smallest value occurs, if at least `CLIPPED` times, else 0.
    """

    count: int
    lowest: float | None
    highest: float | None
    negative: int
    clipped: int

    @property
    def decades(self) -> float | None:
        """Powers of ten between the smallest positive and the largest value."""
        if self.lowest is None or self.highest is None:
            return None
        return math.log10(self.highest / self.lowest)


def value_range(used: Float[np.ndarray, " n"]) -> ValueRange:
    """The range of valid values, sr⁻¹; a constant is not taken for cut off."""
    if not used.size:
        return ValueRange(0, None, None, 0, 0)
    positive, smallest = used[used > 0], used.min()
    repeats = int(np.count_nonzero(used == smallest))
    return ValueRange(
        count=int(used.size),
        lowest=float(positive.min()) if positive.size else None,
        highest=float(used.max()),
        negative=int(np.count_nonzero(used < 0)),
        clipped=repeats if CLIPPED <= repeats <= used.size // 2 else 0,
    )
