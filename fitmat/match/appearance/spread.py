"""Spread: how far apart colours are over the pixels of one light or of several: mean, worst twentieth, largest.

It knows neither light nor colour; pixels and parts of them come from `scene` and `finer`.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.text import brief
from fitmat.uncertainty.estimate import Estimate, estimates

RIM = 0.005
"""Share of a quantile that may be lost where pixels end, at the rim and where light grazes."""


@dataclasses.dataclass(frozen=True)
class Spread:
    """How far apart the colours of two spheres are, over the pixels that are seen and lit.

    Attributes:
        mean: Mean over the area on the screen.
        worst_twentieth: What 5 % of the area exceed.
        largest: Of any pixel.
        rule: By how much `worst_twentieth` may be off since pixels are finite: what changes with half of the rings, and
            what interpolation does to the mean, and `RIM`.
    """

    mean: Estimate
    worst_twentieth: Estimate
    largest: Estimate
    rule: float


@dataclasses.dataclass(frozen=True, eq=False)
class Seen:
    """Differences of colour in one light.

    Attributes:
        delta: Of d draws at m pixels, the best fits first, (d, m).
        share: Of each pixel in the lit area, (m,).
        fine: Of the best fits at parts of pixels, and their shares, (n,) each.
        half: The same from half as many rings.
    """

    delta: Float[np.ndarray, "d m"]
    share: Float[np.ndarray, " m"]
    fine: tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]
    half: tuple[Float[np.ndarray, " h"], Float[np.ndarray, " h"]]

    __repr__ = brief


def spread(lights: list[Seen]) -> Spread:
    """Weighted by area; the quantile of the best fits counts parts of pixels, and draws move with it."""
    delta, share = np.concatenate([each.delta for each in lights], axis=1), _joined([each.share for each in lights])
    lit = share > 0
    delta, share = delta[:, lit], share[lit] / share[lit].sum()
    coarse = np.array([_quantile(row, share) for row in delta])
    (fine, mean), (half, _) = (
        _quantile_and_mean(np.concatenate([each[0] for each in part]), _joined([each[1] for each in part]))
        for part in ([each.fine for each in lights], [each.half for each in lights])
    )
    largest, means = delta.max(axis=1), delta @ share
    rule = abs(fine - half) + fine * (RIM + abs(mean / max(means[0], 1e-300) - 1.0))
    twentieth = np.clip(coarse + fine - coarse[0], 0.0, largest)
    of_area, worst, most = estimates(np.stack([means, twentieth, largest], axis=1))
    return Spread(of_area, worst, most, float(rule))


def worst_twentieth(light: Seen) -> float:
    """Of the best fits in one light: the value that `spread` has of it alone."""
    delta, share = light.fine
    return min(_quantile_and_mean(delta, share)[0], float(light.delta[0, light.share > 0].max()))


def _joined(shares: list[np.ndarray]) -> np.ndarray:
    """Shares of several lights, each with the same."""
    return np.concatenate(shares) / len(shares)


def _quantile(delta: Float[np.ndarray, " m"], share: Float[np.ndarray, " m"]) -> float:
    """What 5 % of the area exceed; between the ranks of two pixels it is interpolated."""
    order = np.argsort(delta)
    return float(np.interp(0.95, np.cumsum(share[order]) - 0.5 * share[order], delta[order]))


def _quantile_and_mean(delta: Float[np.ndarray, " m"], share: Float[np.ndarray, " m"]) -> tuple[float, float]:
    lit = share > 0
    return _quantile(delta[lit], share[lit]), float(delta @ share)
