"""Smoothing: what neighbouring points of a texture tell of one another through a parameter in which they differ little.

Each point's value and deviation stand for its likelihood, a normal in the natural coordinate, in which the prior of a
fit is flat; `maths.smoothness` does the rest. A point whose own data say little is drawn to its neighbours, one that is
well determined stays, and so does one on either side of an edge. It fits nothing.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from fitmat.maths.hierarchy import FEWEST
from fitmat.maths.normal import Z95
from fitmat.maths.smoothness import smoothness
from fitmat.models.parameters import Entry
from fitmat.text import brief


@dataclasses.dataclass(frozen=True, eq=False)
class Smoothed:
    """A parameter of points in rows and columns, smoothed; the last axis, of channels, only where each has its own.

    Attributes:
        name: Of the parameter.
        labels: The name of each of its k fields, with the channel where there are several.
        value: Posterior medians, (rows, columns) or (rows, columns, c); NaN where fewer than three points had an
            interval.
        sd: Posterior standard deviations, likewise, given the scale that was learnt.
        inferred: Points that had no interval, and were inferred from their neighbours, likewise.
        step: Standard deviation of the difference of neighbours, where no two materials meet, (k,); of the logarithm
            where equal ratios matter.
        before: Median standard deviation of the points that had one, (k,), as `step`.
        after: The same of these points once they are smoothed, (k,).
        ratio: Whether equal ratios matter.
        bounds: Of the parameter.
    """

    name: str
    labels: tuple[str, ...]
    value: Float[np.ndarray, "..."]
    sd: Float[np.ndarray, "..."]
    inferred: Bool[np.ndarray, "..."]
    step: Float[np.ndarray, " k"]
    before: Float[np.ndarray, " k"]
    after: Float[np.ndarray, " k"]
    ratio: bool
    bounds: tuple[float, float]

    __repr__ = brief

    @property
    def ci95(self) -> Float[np.ndarray, "... 2"]:
        """95 % intervals, normal in the natural coordinate."""
        reach = Z95 * (self.sd / self.value if self.ratio else self.sd)
        ends = [self.value * np.exp(side * reach) if self.ratio else self.value + side * reach for side in (-1, 1)]
        return np.clip(np.stack(ends, axis=-1), *self.bounds)

    def __str__(self) -> str:
        """Of each field how far neighbours differ, how much better points are known, and how many were inferred."""
        return "\n".join(map(self._told, range(len(self.labels))))

    def _told(self, k: int) -> str:
        inferred = self.inferred.reshape(-1, len(self.labels))[:, k]
        count, others = inferred.size, int(np.count_nonzero(inferred))
        if not np.isfinite(self.step[k]):
            return (
                f"{self.labels[k]} not smoothed: {count - others} have an interval of it, expected at least {FEWEST}."
            )
        step, before, after = (_size(float(part[k]), self.ratio) for part in (self.step, self.before, self.after))
        more = f"; inferred at {others} of {count} points" if others else ""
        return (
            f"{self.labels[k]}, smoothed: neighbours are taken to differ by {step} (sd; more where materials meet), "
            f"and the median sd of a point falls from {before} to {after}{more}."
        )


def _size(sd: float, ratio: bool) -> str:
    """A standard deviation, of logarithms in per cent while that means the same."""
    if not ratio:
        return f"{sd:.2g}"
    return f"{100.0 * sd:.2g} %" if sd < 0.5 else f"a factor of {np.exp(min(sd, 700.0)):.2g}"


def smoothed(
    labels: Sequence[str],
    entry: Entry,
    value: Float[np.ndarray, "rows columns k"],
    sd: Float[np.ndarray, "rows columns k"],
) -> Smoothed:
    """A parameter of neighbouring points.

    Args:
        labels: The name of each field, with its channel where there are several.
        entry: The parameter.
        value: At the points' optima, by posteriors under the flat prior.
        sd: Their standard deviations; NaN or 0 of a point that has none, which is inferred.
    """
    ratio, param = entry.param.scale == "log", entry.param
    with np.errstate(invalid="ignore", divide="ignore"):
        natural, spread = (np.log(value), sd / value) if ratio else (value, sd)
        used = np.isfinite(natural) & (spread > 0) & np.isfinite(1.0 / spread**2)
    middle, deviation = np.full(value.shape, np.nan), np.full(value.shape, np.nan)
    numbers = np.full((3, len(labels)), np.nan)
    for k in range(len(labels)):
        those = used[..., k]
        if np.count_nonzero(those) >= FEWEST:
            found = smoothness(natural[..., k], np.where(those, spread[..., k], np.nan))
            middle[..., k], deviation[..., k] = found.mean, found.sd
            numbers[:, k] = found.step, np.median(spread[..., k][those]), np.median(found.sd[those])
    physical = np.clip(np.exp(middle) if ratio else middle, param.lower, param.upper)
    shape = value.shape if entry.shape else value.shape[:-1]
    return Smoothed(
        entry.name,
        tuple(labels),
        physical.reshape(shape),
        (deviation * (physical if ratio else 1.0)).reshape(shape),
        ~used.reshape(shape),
        numbers[0],
        numbers[1],
        numbers[2],
        ratio,
        (param.lower, param.upper),
    )
