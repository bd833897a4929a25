"""Pooling: what surfaces of one kind tell of one another through a parameter that they share.

Each surface's interval stands for its likelihood, a normal in the natural coordinate, in which the prior of a fit is
flat; `maths.hierarchy` does the rest. A surface whose own data say little is drawn to the others, one that is well
determined stays. It fits nothing, and the other parameters of a surface stay as they were.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.maths.hierarchy import FEWEST, population
from fitmat.maths.normal import Z95
from fitmat.models.parameters import Param
from fitmat.text import brief, interval

SMALL = 1.5
"""Factors below it are told in per cent."""


@dataclasses.dataclass(frozen=True, eq=False)
class Pooled:
    """A parameter of many surfaces, pooled; … stands for the axes of the surfaces.

    Attributes:
        name: Of the parameter, with its channel where there are several.
        value: Posterior medians, (…); NaN of surfaces that took no part.
        sd: Posterior standard deviations, (…).
        ci95: 95 % intervals, (…, 2).
        centre: Low, median and high of what all share, (3,).
        spread: Of the standard deviation between surfaces, in the unit of the parameter, or as a factor where equal
            ratios matter, (3,).
        following: Where a further surface of the kind is expected, (3,).
        ratio: Whether the spread is a factor.
        count: Surfaces that took part; below three there is no more.
        left_out: Surfaces on a bound, held, or without an interval.
    """

    name: str
    value: Float[np.ndarray, "..."]
    sd: Float[np.ndarray, "..."]
    ci95: Float[np.ndarray, "... 2"]
    centre: Float[np.ndarray, " 3"]
    spread: Float[np.ndarray, " 3"]
    following: Float[np.ndarray, " 3"]
    ratio: bool
    count: int
    left_out: int

    __repr__ = brief

    def __str__(self) -> str:
        """What all share, how far they differ, and who took no part."""
        out = f" {self.left_out} left out: on a bound, held, or without an interval." if self.left_out else ""
        if self.count < FEWEST:
            return f"{self.name} not pooled: {self.count} have an interval of it, expected at least {FEWEST}.{out}"
        low, middle, high = self.centre
        least, typical, most = self.spread
        if not self.ratio:
            differ = f"by {typical:.2g} (sd; 95 % {interval(least, most, typical)})"
        elif most < SMALL:
            differ = "by {:.2g} % (sd; 95 % {:.2g} – {:.2g} %)".format(*(100.0 * (self.spread - 1.0))[[1, 0, 2]])
        else:
            differ = f"by a factor of {typical:.3g} (95 % {least:.3g} – {most:.3g})"
        shared = f"{middle:.4g} (95 % {interval(low, high, (high - low) / (2 * Z95))})"
        return f"{self.name}, pooled over {self.count}: {shared}, from which each differs {differ}.{out}"


def pooled(name: str, param: Param, low: Float[np.ndarray, "..."], high: Float[np.ndarray, "..."]) -> Pooled:
    """A parameter of surfaces that are taken to be of one kind.

    Args:
        name: Of the parameter, with its channel where there are several.
        param: Its bounds and scale, in which the results stay.
        low: Lower ends of the 95 % intervals, (…), by posteriors under the flat prior; NaN of what takes no part.
        high: Upper ends.
    """
    ratio = param.scale == "log"
    with np.errstate(invalid="ignore", divide="ignore"):
        ends = np.stack([np.log(end) if ratio else end for end in (np.asarray(low, float), np.asarray(high, float))])
    middle, sd = 0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0]) / Z95
    used = np.isfinite(middle) & (sd > 0)
    count, shape = int(np.count_nonzero(used)), used.shape
    limits, spread, none = np.full((*shape, 3), np.nan), np.full(shape, np.nan), np.full(3, np.nan)
    parts = none, none, none
    if count >= FEWEST:
        found = population(middle[used], sd[used])
        limits[used], spread[used] = found.members, found.sd
        parts = found.centre, found.spread, found.following

    def physical(natural: np.ndarray) -> np.ndarray:
        return np.clip(np.exp(natural) if ratio else natural, param.lower, param.upper)

    of_members = physical(limits)
    return Pooled(
        name,
        of_members[..., 1],
        spread * (of_members[..., 1] if ratio else 1.0),
        of_members[..., ::2],
        physical(parts[0]),
        np.exp(parts[1]) if ratio else parts[1],
        physical(parts[2]),
        ratio,
        count,
        used.size - count,
    )
