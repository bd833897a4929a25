"""Profile likelihoods: how well the data are fitted where one parameter is held and all others follow.

Judges nothing: what a flat profile means, `verdicts` says. The discrepancy s is held at its best value.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.information import inverse_information
from fitmat.fitting.likelihood import Data
from fitmat.fitting.result import Fit
from fitmat.fitting.settling import FARTHEST, MOST_ITERATIONS, STEPS, Frame, Reached, Walks, settle_of
from fitmat.maths.normal import Z95
from fitmat.models.values import at
from fitmat.text import brief

LEVEL = Z95
"""√(2Δ) at the ends of a 95 % interval: 2Δ follows χ² with one degree of freedom (Wilks 1938)."""

ROWS = 4096
"""Of more rows an evenly spread part stands for all, with values that the best model predicts exactly."""


class Points(NamedTuple):
    """Points of a profile.

    Attributes:
        at: Values of the parameter that is held, natural (logarithm where the scale is log), (m,).
        rise: Δ = ln L(best) − ln L(point), (m,), priors included.
        coordinates: The free parameters at each point, natural, (m, f).
    """

    at: np.ndarray
    rise: np.ndarray
    coordinates: np.ndarray


@dataclasses.dataclass(frozen=True, eq=False)
class Profile:
    """The likelihood along one parameter, all other free ones re-optimised.

    Attributes:
        name: Of the parameter, with its channel where there are several.
        place: Its place among the free parameters.
        points: In rising order of the parameter.
        interval: 95 % limits, natural; a bound where the likelihood has not fallen enough there.
        open: Whether the lower and the upper limit are such bounds.
    """

    name: str
    place: int
    points: Points
    interval: tuple[float, float]
    open: tuple[bool, bool]

    __repr__ = brief

    @property
    def missed(self) -> float:
        """By how many nats a point of it is better than the fit; 0 where the fit is the best."""
        return max(-float(self.points.rise.min()), 0.0)

    @property
    def sd(self) -> float:
        """The width of the 95 % interval over that of a Gaussian of standard deviation 1, natural."""
        return (self.interval[1] - self.interval[0]) / (2 * LEVEL)


def profiles(fit: Fit, *, widened: bool = True) -> tuple[Profile, ...]:
    """The profile likelihood of every free parameter.

    From the best fit outwards on both sides, each point starts where the last one ended; steps are chosen so that
    √(2Δ) grows evenly to `FARTHEST` (Venzon & Moolgavkar 1988; Raue et al. 2009). Holding s narrows the intervals by
    about 1/n of themselves for n values, and by less where s is 0.

    Args:
        fit: A fit with a finite optimum.
        widened: Whether the likelihood is as flat as the correlation of the misfit asks, ℓ(θ̂ + A⁻¹(θ − θ̂)), so that it
            falls as the widened draws scatter (Chandler & Bate, Biometrika 94, 2007, "horizontal" adjustment).

    Returns:
        One `Profile` per free parameter, in the order of `fit.free`; none where all are fixed.
    """
    if not len(fit.free) or not fit.finite:
        return ()
    moved, surface = fit.coordinates, _Surface(fit, widened)
    low, high, best = surface.low, surface.high, surface.best
    held, sign = np.repeat(np.arange(moved.count), 2), np.tile([-1.0, 1.0], moved.count)
    sides, here = surface.walked(held, sign), Points(best, np.zeros(()), best)
    result = []
    for k, name in enumerate(moved.names):
        parts = zip(sides, here._replace(at=best[k]), strict=True)
        points = Points(*(np.concatenate([a[2 * k][::-1], [centre], a[2 * k + 1]]) for a, centre in parts))
        limits, opened = _interval(points.at, points.rise, STEPS, (low[k], high[k]))
        result.append(Profile(name, k, points, limits, opened))
    return tuple(result)


def along(
    fit: Fit, place: int, held: Float[np.ndarray, " m"], guess: Float[np.ndarray, "m f"], *, widened: bool = True
) -> tuple[Points, Float[np.ndarray, "m f f"]]:
    """The profile of one parameter at given natural values, and JᵀJ there, natural.

    Args:
        fit: As for `profiles`.
        place: Of the parameter among the free ones.
        held: Its values.
        guess: Roughly where the free parameters are there, natural, (m, f).
        widened: Whether it is as flat as the correlation of the misfit asks.
    """
    t = np.clip(guess, fit.coordinates.low, fit.coordinates.high)
    t[:, place] = held
    return _Surface(fit, widened).settled(t, np.full(len(held), place))


class _Surface:
    """½ Σ residual² over the free natural coordinates of a fit, s held.

    Attributes:
        best: The fit's own, kept within the bounds, (f,).
        low: Bounds as seen from there, (f,).
        high: The others.
    """

    def __init__(self, fit: Fit, widened: bool) -> None:
        moved, every, part = fit.coordinates, coordinates(fit.model), representative(fit)
        self.best, self._span = np.clip(moved.natural(fit.values), moved.low, moved.high), moved.span
        self.low, self.high = moved.around(self.best)
        self._free, self._centre = fit.free, every.natural(fit.values)
        self._centre[self._free] = self.best
        self._inside, back = np.ix_(self._free, self._free), np.eye(every.count)
        if widened:
            back[self._inside] = np.linalg.inv(fit.correlation.stretch)
        free = self._every(np.ones(moved.count), 0.0) > 0
        low, high, span = self._every(self.low, -np.inf), self._every(self.high, np.inf), self._every(self._span, 1.0)
        frame = Frame(self._centre, low, high, span, back, free)
        self._settle = settle_of(fit.model, part, fit.discrepancy, frame)
        here = self._settle(Walks.standing(self._centre[None], self._free[:1]), 1, 0)
        self._least, self._gram = here.squares[0, 0], here.gram[0]

    def _every(self, chosen: Float[np.ndarray, "... f"], other: float | np.ndarray) -> Float[np.ndarray, "... p"]:
        """Of all parameters, those that are fixed with another value."""
        found = np.empty((*chosen.shape[:-1], len(self._centre)))
        found[...] = other
        found[..., self._free] = chosen
        return found

    def walked(self, held: np.ndarray, sign: np.ndarray) -> Points:
        """Walks from the best fit, along one parameter each, (m, `STEPS`)."""
        unit = np.sqrt(np.diagonal(inverse_information(self._gram[self._inside], self._span)))
        first = np.minimum(unit, self._span)[held] * FARTHEST / STEPS
        reach = np.where(sign > 0, (self.high - self.best)[held], (self.best - self.low)[held])
        start, least, gram = (np.stack([one] * len(held)) for one in (self._centre, self._least, self._gram))
        walks = Walks(start, self._free[held], sign, reach, first, least, gram)
        return self._points(self._settle(walks, STEPS, MOST_ITERATIONS), held)

    def settled(self, t: Float[np.ndarray, "m f"], held: np.ndarray) -> tuple[Points, Float[np.ndarray, "m f f"]]:
        """The optima of the other parameters from t on, with one of each point held, and the information there."""
        walks = Walks.standing(self._every(t, self._centre), self._free[held])
        found = self._settle(walks, 1, MOST_ITERATIONS)
        points = Points(*(part[:, 0] for part in self._points(found, held)))
        return points, found.gram[:, self._free[:, None], self._free]

    def _points(self, found: Reached, held: np.ndarray) -> Points:
        natural = found.points[..., self._free]
        at = np.take_along_axis(natural, held[:, None, None], axis=2)[..., 0]
        return Points(at, 0.5 * (found.squares - self._least), natural)


def representative(fit: Fit) -> Data:
    """The fit's data, or of more than `ROWS` rows a part that weighs as much.

    The part holds what the best model predicts, so that it has the same optimum (the Asimov data of Cowan, Cranmer,
    Gross & Vitells 2011).
    """
    stride = -(-fit.data.x.shape[0] // ROWS)
    if stride == 1:
        return fit.data
    part = fit.data.every(stride)
    exact = at(fit.model, part.wi, part.wo) * part.kappa
    return dataclasses.replace(part, x=exact, weight=part.weight * np.sqrt(stride))


def _interval(
    at: np.ndarray, rise: np.ndarray, centre: int, bounds: tuple[float, float]
) -> tuple[tuple[float, float], tuple[bool, bool]]:
    """Where √(2Δ) crosses `LEVEL` last on either side, by linear interpolation; the bound where it does not.

    Δ counts from the lowest point, which lies apart from the best fit where that was missed; both are inside.
    """
    root = np.sqrt(2.0 * np.maximum(rise - rise.min(), 0.0))
    inside = np.union1d(np.flatnonzero(root <= LEVEL), centre)
    limits, opened = [], []
    for last, step, bound in ((inside[0], -1, bounds[0]), (inside[-1], 1, bounds[1])):
        beyond = last + step
        opened.append(not 0 <= beyond < len(at))
        if opened[-1]:
            limits.append(float(bound))
            continue
        part = max(LEVEL - root[last], 0.0) / (root[beyond] - root[last]) if root[beyond] > root[last] else 0.0
        limits.append(float(at[last] + part * (at[beyond] - at[last])))
    return (limits[0], limits[1]), (opened[0], opened[1])
