"""Predictive statistics: numbers of measured data beside what replicated data would show.

It judges one number at a time; `predictive_check` joins them and says what they mean.
"""

import dataclasses
from collections.abc import Callable, Iterator

import numpy as np
from jaxtyping import Float

from fitmat.fitting.result import Fit
from fitmat.judgement.prediction import replicated
from fitmat.maths import binomial, normal
from fitmat.maths.directions import mirror
from fitmat.measurements.incidences import Incidence
from fitmat.measurements.neighbours import curves
from fitmat.text import brief

REPLICATES = 4000
"""Patterns that are drawn to judge one."""

MANY_PAIRS = 400
"""Neighbouring pairs from which on a sum of their products counts as Gaussian."""

ENOUGH = 8
"""A place with fewer values, or fewer neighbouring pairs, is not judged."""

NEAR_MIRROR = np.deg2rad(20.0)
"""Directions closer to the mirror direction than this are around it."""

SURPRISING = 0.05
"""Adjusted p-value below which a check counts as failed: one in twenty files of a right model has any such."""

PEAKS = 200
"""Highest values of replicated data behind the range that is shown of one: several a draw where draws are fewer."""

TOP = 16
"""Directions of one incidence among which replicated peaks are sought for display."""

NAMES = {
    "largest": "largest residual / sd",
    "outliers": "share of residuals beyond 2 sd",
    "peak": "highest value / sr⁻¹",
    "pattern": "mean product of neighbouring residuals",
    "side": "mean residual / sd",
}
"""What is looked at."""


@dataclasses.dataclass(frozen=True)
class Statistic:
    """One number of the data beside what the model makes of it.

    Attributes:
        kind: Key of `NAMES`.
        place: Where: "everywhere", an incidence, or a part of one.
        observed: In the data, under the mean of the draws.
        expected: 95 % range of replicated data.
        p: Two-sided posterior-predictive p-value (Gelman, Meng & Stern 1996, eq. 6).
        adjusted: p by Holm (1979) for how many were looked at.
        sign: 1 where the data have more than the replicates, else −1.
    """

    kind: str
    place: str
    observed: float
    expected: tuple[float, float]
    p: float
    adjusted: float
    sign: int

    @property
    def name(self) -> str:
        """What it is, in words."""
        return NAMES[self.kind]

    @property
    def surprising(self) -> bool:
        """Whether the model fails this check."""
        return self.adjusted < SURPRISING


@dataclasses.dataclass(frozen=True, eq=False)
class Replicates:
    """Residuals z, ln P(y_rep ≤ highest), model x and noise of d draws, (d, n, c), and what belongs together."""

    fit: Fit
    used: np.ndarray
    groups: tuple[Incidence, ...]
    rng: np.random.Generator
    z: Float[np.ndarray, "d n c"]
    below: Float[np.ndarray, "d n c"]
    x: Float[np.ndarray, "d n c"]
    noise: Float[np.ndarray, "d n c"]

    __repr__ = brief

    def whole(self) -> Iterator[Statistic]:
        """The largest residual, and how many are beyond 2 sd."""
        z, n = np.abs(self.z[:, self.used]), int(self.used.sum())
        largest = z.max(axis=1)
        tail = -np.expm1(n * np.log1p(-2.0 * normal.cdf(-largest)))
        ends = -normal.quantile(-np.expm1(np.log([0.025, 0.975]) / n) / 2.0)
        yield _statistic("largest", "everywhere", largest.mean(), ends, tail, 1.0 - tail)
        count = (z > 2.0).sum(axis=1)
        chance = binomial.masses(n, 2.0 * float(normal.cdf(-2.0)))
        half, to, since = 0.5 * chance[count], np.cumsum(chance), np.cumsum(chance[::-1])[::-1]
        ends = np.searchsorted(to, [0.025, 0.975]) / n
        yield _statistic("outliers", "everywhere", count.mean() / n, ends, since[count] - half, to[count] - half)

    def peaks(self, highest: np.ndarray, s: np.ndarray) -> Iterator[Statistic]:
        """The highest value of each incidence; its expected range is sought among the brightest directions only."""
        kappa, again = np.asarray(self.fit.data.kappa), -(-PEAKS // len(s))
        spread = np.repeat(s, again)[:, None, None]
        for group, peak in zip(self.groups, highest, strict=True):
            under = np.exp(self.below[:, group.rows].sum(axis=(1, 2)))
            order = np.argsort(-(self.x[0] / kappa)[group.rows].max(axis=1))
            bright = group.rows[np.resize(order, TOP)]
            x, noise = (np.repeat(part[:, bright], again, axis=0) for part in (self.x, self.noise))
            drawn = replicated(x, noise, spread, self.rng.standard_normal(x.shape)) / kappa[bright]
            ends = np.quantile(np.where(self.used[bright], drawn, -np.inf).max(axis=(1, 2)), [0.025, 0.975])
            yield _statistic("peak", group.name, peak, ends, 1.0 - under, under)

    def patterns(self) -> Iterator[Statistic]:
        """The mean product of neighbours along curves, 0 by chance, for each incidence that has enough."""
        pairs = _neighbours(self.fit, self.used)
        for group in self.groups:
            inside = np.isin(pairs[:, 0], group.rows) & np.isin(pairs[:, 1], group.rows)
            one, other, channel = pairs[inside].T
            if len(one) < ENOUGH:
                continue
            product = np.sum(self.z[:, one, channel] * self.z[:, other, channel], axis=1)
            above = self._pair_sum(pairs[inside])(product)
            ends = np.array([-1.96, 1.96]) / np.sqrt(len(one))
            yield _statistic("pattern", group.name, product.mean() / len(one), ends, above, 1.0 - above)

    def _pair_sum(self, pairs: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """P(Σ ε ε′ > t) over the pairs, ε N(0, 1): of mean 0 and variance their number."""
        if len(pairs) >= MANY_PAIRS:
            return lambda t: normal.cdf(-t / np.sqrt(len(pairs)))
        places = pairs[:, :2] * self.z.shape[2] + pairs[:, 2:]
        which, index = np.unique(places, return_inverse=True)
        index = index.reshape(places.shape)
        drawn = self.rng.standard_normal((REPLICATES, len(which)))
        sums = np.sort(np.sum(drawn[:, index[:, 0]] * drawn[:, index[:, 1]], axis=1))
        # The products' signs are as often + as −, so that the distribution is symmetric: both halves count.
        both = np.sort(np.concatenate([sums, -sums]))
        return lambda t: 1.0 - (np.searchsorted(both, t) + 0.5) / (len(both) + 1.0)

    def sides(self) -> Iterator[Statistic]:
        """The mean residual around the mirror direction, on the light's side and on the far side of each incidence."""
        wi, wo = np.asarray(self.fit.data.wi), np.asarray(self.fit.data.wo)
        near = np.sum(mirror(wi) * wo, axis=1) > np.cos(NEAR_MIRROR)
        light = np.sum(wi[:, :2] * wo[:, :2], axis=1) > 0
        parts = {"around the mirror direction": near, "towards the light": light & ~near,
            "away from the light": ~light & ~near}  # fmt: skip
        for group in self.groups:
            for name, part in parts.items():
                rows = group.rows[part[group.rows]]
                n = int(self.used[rows].sum())
                if n < ENOUGH:
                    continue
                mean = self.z[:, rows].sum(axis=(1, 2)) / n
                above = normal.cdf(-mean * np.sqrt(n))
                ends = np.array([-1.96, 1.96]) / np.sqrt(n)
                yield _statistic("side", f"{group.name} {name}", mean.mean(), ends, above, 1.0 - above)


def _statistic(
    kind: str, place: str, observed: float, ends: np.ndarray, above: np.ndarray, under: np.ndarray
) -> Statistic:
    """From the probabilities, of each draw, that replicated data have more, and less."""
    high, low = float(np.mean(above)), float(np.mean(under))
    p = min(1.0, 2.0 * min(high, low))
    sign = 1 if high <= low else -1
    return Statistic(kind, place, float(observed), (float(ends[0]), float(ends[1])), p, p, sign)


def _neighbours(fit: Fit, used: np.ndarray) -> np.ndarray:
    """Neighbours along curves: rows of the data and channel, (k, 3)."""
    m, found = fit.measurements, [np.zeros((0, 3), int)]
    place = np.cumsum(m.valid.any(axis=1)) - 1
    for channel in range(len(m.channels)):
        rows, curve, _ = curves(m, channel)
        rows = place[rows]
        near = (np.diff(curve) == 0) & used[rows[:-1], channel] & used[rows[1:], channel]
        one, other = rows[:-1][near], rows[1:][near]
        found.append(np.column_stack([one, other, np.full(len(one), channel)]))
    return np.concatenate(found)
