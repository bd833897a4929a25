"""Profile likelihoods: how well the data are fitted where one parameter is held and all others follow.

Judges nothing: what a flat profile means, `verdicts` says. The discrepancy s is held at its best value.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.information import inverse_information, normal_equations_of
from fitmat.fitting.likelihood import Data
from fitmat.fitting.result import Fit
from fitmat.maths.normal import Z95
from fitmat.models.values import at
from fitmat.text import brief

STEPS = 16
"""Points on either side of the best value."""

FARTHEST = 4.0
"""Where a side ends unless a bound comes first, as √(2Δ): four standard deviations of a Gaussian."""

LONGEST = 0.1
"""Longest step, as a fraction of the range of whatever parameter moves most: 16 of them cross any range."""

GROWTH = 3.0
"""A step is at most so many times as long as the last one, and at least as much shorter."""

LEVEL = Z95
"""√(2Δ) at the ends of a 95 % interval: 2Δ follows χ² with one degree of freedom (Wilks 1938)."""

PRECISE = 1e-5
"""Inner optima end where Δ would fall by less."""

MOST_ITERATIONS = 40
"""Of the inner optima."""

ROWS = 4096
"""Of more rows an evenly spread part stands for all, with values that the best model predicts exactly."""


class Points(NamedTuple):
    """Points of a profile.

    Attributes:
        at: Values of the parameter that is held, natural (logarithm where the scale is log), (m,).
        rise: Δ = ln L(best) − ln L(point), (m,), priors included.
        coordinates: The free parameters at each point, natural, (m, f).
        information: JᵀJ there, natural, (m, f, f).
    """

    at: np.ndarray
    rise: np.ndarray
    coordinates: np.ndarray
    information: np.ndarray


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
    low, high, span, best = surface.low, surface.high, moved.span, surface.best
    held = np.repeat(np.arange(moved.count), 2)
    sign, each = np.tile([-1.0, 1.0], moved.count), np.arange(2 * moved.count)
    known = surface.gram
    unit = np.minimum(np.sqrt(np.diagonal(inverse_information(known, span))), span)[held]
    tangent = _tangents(np.broadcast_to(known, (len(held), *known.shape)), held, span)
    reach = np.where(sign > 0, (high - best)[held], (best - low)[held])
    t = np.tile(best, (len(held), 1))
    offset, last, root = np.zeros(len(held)), unit * FARTHEST / STEPS, np.zeros(len(held))
    found = []
    for target in np.linspace(0.0, FARTHEST, STEPS + 1)[1:]:
        longest = LONGEST / np.max(np.abs(tangent) / span, axis=1)
        ahead, last = _ahead(offset, last, root, target, longest)
        ahead = np.minimum(ahead, reach)
        t = np.clip(t + tangent * (sign * (ahead - offset))[:, None], low, high)
        t[each, held] = best[held] + sign * ahead
        offset = ahead
        points = surface.settled(t, held)
        t, root = points.coordinates, np.sqrt(2.0 * np.maximum(points.rise, 0.0))
        tangent = _tangents(points.information, held, span)
        found.append(points)
    sides = Points(*(np.stack(part, axis=1) for part in zip(*found, strict=True)))
    here = Points(best, np.zeros(()), best, known)
    result = []
    for k, name in enumerate(moved.names):
        parts = zip(sides, (best[k], *here[1:]), strict=True)
        points = Points(*(np.concatenate([a[2 * k][::-1], [centre], a[2 * k + 1]]) for a, centre in parts))
        limits, opened = _interval(points.at, points.rise, STEPS, (low[k], high[k]))
        result.append(Profile(name, k, points, limits, opened))
    return tuple(result)


def along(
    fit: Fit, place: int, held: Float[np.ndarray, " m"], guess: Float[np.ndarray, "m f"], *, widened: bool = True
) -> Points:
    """The profile of one parameter at given natural values.

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
        span: Widths of the bounds, (f,).
        gram: JᵀJ there, (f, f).
    """

    def __init__(self, fit: Fit, widened: bool) -> None:
        moved, every = fit.coordinates, coordinates(fit.model)
        self.best, self.span = np.clip(moved.natural(fit.values), moved.low, moved.high), moved.span
        self.low, self.high = moved.around(self.best)
        self._natural, self._free = every.natural(fit.values), fit.free
        self._equations = normal_equations_of(fit.model, representative(fit), fit.discrepancy)
        self._back = np.linalg.inv(fit.correlation.stretch) if widened else np.eye(moved.count)
        square, _, gram = self._at(self.best[None])
        self._square, self.gram = square[0], gram[0]

    def _at(self, t: Float[np.ndarray, "m f"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        t = np.clip(self.best + (t - self.best) @ self._back.T, self.low, self.high)
        natural, free = np.tile(self._natural, (len(t), 1)), self._free
        natural[:, free] = t
        square, slope, gram = self._equations(natural)
        return square, slope[:, free] @ self._back, self._back.T @ gram[:, free[:, None], free] @ self._back

    def settled(self, t: Float[np.ndarray, "m f"], held: np.ndarray) -> Points:
        """The optima of the other parameters from t on, with one parameter of each point held; kept in the bounds.

        Levenberg–Marquardt for all points together, projected onto the bounds (Bertsekas 1982).
        """
        each, span = np.arange(len(t)), self.span
        low, high = self.low, self.high
        square, slope, gram = self._at(t)
        damping, moving = np.full(len(t), 1e-6), np.ones(len(t), bool)
        for _ in range(MOST_ITERATIONS):
            blocked = ((t <= low) & (slope > 0)) | ((t >= high) & (slope < 0))
            blocked[each, held] = True
            step, promised = _steps(slope, gram, blocked, damping, span)
            moving &= promised > PRECISE
            which = np.flatnonzero(moving)
            if len(which) == 0:
                break
            tried = np.clip(t[which] + step[which], low, high)
            found = self._at(tried)
            better = found[0] <= square[which]
            damping[which] = np.where(better, damping[which] * 0.1, np.maximum(damping[which] * 10.0, 1e-3))
            moving[which[damping[which] > 1e6]] = False
            taken = which[better]
            t = t.copy()
            t[taken], square[taken] = tried[better], found[0][better]
            slope[taken], gram[taken] = found[1][better], found[2][better]
        return Points(t[each, held], 0.5 * (square - self._square), t, gram)


def _steps(
    slope: np.ndarray, gram: np.ndarray, blocked: np.ndarray, damping: np.ndarray, span: np.ndarray
) -> tuple[Float[np.ndarray, "m f"], Float[np.ndarray, " m"]]:
    """Damped Gauss–Newton steps of the parameters that are not blocked, and how far ½ Σ residual² falls by them."""
    free = ~blocked
    unit = np.sqrt(np.maximum(np.diagonal(gram, axis1=1, axis2=2), 1e-12 / span**2))
    scaled = np.where(free[:, :, None] & free[:, None, :], gram / (unit[:, :, None] * unit[:, None, :]), 0.0)
    eye = np.eye(slope.shape[1])
    system = scaled + eye * (np.where(free, damping[:, None], 1.0)[:, :, None] + 1e-14)
    against = np.where(free, -slope / unit, 0.0)
    z = np.linalg.solve(system, against[..., None])[..., 0]
    promised = np.einsum("mi,mi->m", against, z) - 0.5 * np.einsum("mi,mij,mj->m", z, scaled, z)
    return z / unit, promised


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


def _ahead(
    offset: np.ndarray, last: np.ndarray, root: np.ndarray, target: float, longest: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The next distance from the best value, and the step to it, for √(2Δ) = target if that grows as before."""
    growing = root > 0
    wanted = np.where(growing, offset * (target / np.where(growing, root, 1.0) - 1.0), GROWTH * last)
    step = np.minimum(np.clip(wanted, last / GROWTH, last * GROWTH), longest)
    return offset + step, step


def _tangents(known: Float[np.ndarray, "m f f"], held: np.ndarray, span: np.ndarray) -> Float[np.ndarray, "m f"]:
    """dt/dt_k along the ridge: the others follow so that the residuals change least."""
    released = np.linalg.inv(known + np.diag(12.0 / span**2))
    column = np.take_along_axis(released, held[:, None, None], axis=2)[..., 0]
    return column / np.take_along_axis(column, held[:, None], axis=1)


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
