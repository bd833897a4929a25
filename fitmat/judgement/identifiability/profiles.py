"""Profile likelihoods: how well the data are fitted where one parameter is held and all others follow.

Judges nothing: what a flat profile means, `verdicts` says. The discrepancy s is held at its best value.
"""

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat.fitting.coordinates import Coordinates
from fitmat.fitting.information import expected_information, inverse_information
from fitmat.fitting.likelihood import Data, every_residual, mapped
from fitmat.fitting.result import Fit
from fitmat.maths.least_squares import least_squares
from fitmat.models.base import AbstractBRDF, evaluate_pairs
from fitmat.models.parameters import vector, with_vector

STEPS = 16
"""Points on either side of the best value."""

FARTHEST = 4.0
"""Where a side ends unless a bound comes first, as √(2Δ): four standard deviations of a Gaussian."""

LONGEST = 0.1
"""Longest step, as a fraction of the range of whatever parameter moves most: 16 of them cross any range."""

GROWTH = 3.0
"""A step is at most so many times as long as the last one, and at least as much shorter."""

LEVEL = 1.959964
"""√(2Δ) at the ends of a 95 % interval: 2Δ follows χ² with one degree of freedom (Wilks 1938)."""

PRECISE = 1e-5
"""Tolerance of the inner optima in units of the problem: Δ is then right to far better than 0.01."""

_INSIDE = 1e-6
# Starts are this fraction of the range away from a bound, where the sine has no slope.

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

    @property
    def sd(self) -> float:
        """The width of the 95 % interval over that of a Gaussian of standard deviation 1, natural."""
        return (self.interval[1] - self.interval[0]) / (2 * LEVEL)


def profiles(fit: Fit) -> tuple[Profile, ...]:
    """The profile likelihood of every free parameter, in one compiled program.

    From the best fit outwards on both sides, each point starts where the last one ended; steps are chosen so that
    √(2Δ) grows evenly to `FARTHEST` (Venzon & Moolgavkar 1988; Raue et al. 2009). Holding s narrows the intervals by
    about 1/n of themselves for n values, and by less where s is 0.

    Args:
        fit: A fit with a finite optimum.

    Returns:
        One `Profile` per free parameter, in the order of `fit.free`; none where all are fixed.
    """
    if not len(fit.free) or not fit.finite:
        return ()
    moved, places = fit.coordinates, fit.free
    low, high = moved.low, moved.high
    best = np.clip(moved.natural(fit.values), low, high)
    sides = [(k, sign) for k in range(len(places)) for sign in (-1.0, 1.0)]
    ends = _run(fit, np.array(sides), np.tile(best, (len(sides), 1)), np.full((len(sides), STEPS), np.nan))
    known = expected_information(fit.model, representative(fit), jnp.asarray(fit.discrepancy))
    here = Points(best, np.zeros(()), best, np.asarray(known)[np.ix_(places, places)])
    found = []
    for k, name in enumerate(moved.names):
        parts = zip(ends, (best[k], *here[1:]), strict=True)
        points = Points(*(np.concatenate([a[2 * k][::-1], [centre], a[2 * k + 1]]) for a, centre in parts))
        limits, opened = _interval(points.at, points.rise, STEPS, (low[k], high[k]))
        found.append(Profile(name, k, points, limits, opened))
    return tuple(found)


def along(fit: Fit, place: int, held: Float[np.ndarray, " m"], guess: Float[np.ndarray, "m f"]) -> Points:
    """The profile of one parameter at given natural values, by the program that `profiles` runs.

    Args:
        fit: As for `profiles`.
        place: Of the parameter among the free ones.
        held: Its values, in order; at most 2 f `STEPS` of them.
        guess: Roughly where the free parameters are there, natural, (m, f).
    """
    sides, most = 2 * len(fit.free), 2 * len(fit.free) * STEPS
    which = np.minimum(np.arange(most), len(held) - 1).reshape(sides, STEPS)
    found = _run(fit, np.tile([place, 1.0], (sides, 1)), guess[which[:, 0]], held[which])
    return Points(*(part.reshape(most, *part.shape[2:])[: len(held)] for part in found))


def _run(fit: Fit, sides: np.ndarray, start: np.ndarray, held: np.ndarray) -> Points:
    span = fit.coordinates.span
    known = fit.information[np.ix_(fit.free, fit.free)]
    unit = np.minimum(np.sqrt(np.diagonal(inverse_information(known, span))), span)
    released = np.linalg.inv(known + np.diag(12.0 / span**2))
    slopes = released / np.diagonal(released)[:, None]
    tasks = tuple(jnp.asarray(part) for part in (unit, slopes, sides, start, held))
    s, values = jnp.asarray(fit.discrepancy), jnp.asarray(fit.values)
    traced = _traced(fit.model, representative(fit), s, values, fit.coordinates, tasks)
    return Points(*(np.asarray(part) for part in traced))


def representative(fit: Fit) -> Data:
    """The fit's data, or of more than `ROWS` rows a part that weighs as much.

    The part holds what the best model predicts, so that it has the same optimum (the Asimov data of Cowan, Cranmer,
    Gross & Vitells 2011).
    """
    stride = -(-fit.data.x.shape[0] // ROWS)
    if stride == 1:
        return fit.data
    part = fit.data.every(stride)
    exact = evaluate_pairs(fit.model, part.wi, part.wo) * part.kappa
    return dataclasses.replace(part, x=exact, weight=part.weight * np.sqrt(stride))


@eqx.filter_jit
def _traced(
    template: AbstractBRDF, data: Data, s: Array, values: Array, moved: Coordinates, tasks: tuple[Array, ...]
) -> tuple[Array, Array, Array, Array]:
    """What `Points` holds, for each task: a parameter and side, where to start, and the values to hold.

    Where these are NaN, they are chosen on the way. All arrays begin with (tasks, STEPS).
    """
    count, places = moved.count, moved.index
    unit, slopes, sides, starts, given = tasks
    low, high = jnp.asarray(moved.low), jnp.asarray(moved.high)
    span = high - low

    def sine(t: Array) -> Array:
        return jnp.arcsin(jnp.clip(2.0 * (t - low) / span - 1.0, -1.0, 1.0))

    def model(v: Array, k: Array, held: Array) -> AbstractBRDF:
        """With the free coordinates v of the others and the natural value of the held one."""
        u = jnp.zeros(count).at[_others(k, count)].set(v).at[k].set(sine(jnp.zeros(count).at[k].set(held))[k])
        return with_vector(template, moved.from_unbounded(values, u))

    def residual(v: Array, args: tuple[Data, Array, Array]) -> Array:
        data, k, held = args
        return every_residual(model(v, k, held), data, s)

    first = every_residual(with_vector(template, values), data, s)

    def one(task: Any) -> tuple[Array, ...]:
        (k, sign), start, schedule = (task[0][0].astype(int), task[0][1]), task[1], task[2]
        reach = jnp.where(sign > 0, high[k] - start[k], start[k] - low[k])

        def point(state: tuple, step: tuple[Array, Array]) -> tuple[tuple, tuple]:
            offset, last, v, root, slope = state
            target, wanted = step
            offset, last = _ahead(offset, last, root, target, LONGEST / jnp.max(jnp.abs(slope) / span))
            offset = jnp.minimum(offset, reach)
            held = jnp.where(jnp.isnan(wanted), start[k] + sign * offset, wanted)
            args = (data, k, held)
            v = least_squares(residual, v, args, tolerance=PRECISE, max_steps=64).x if count > 1 else v
            here, r = model(v, k, held), residual(v, args)
            rise = 0.5 * (jnp.vdot(r, r) - jnp.vdot(first, first))
            matrix = expected_information(here, data, s)[np.ix_(places, places)]
            root = jnp.sqrt(2.0 * jnp.maximum(rise, 0.0))
            found = (held, rise, moved.natural(vector(here)), matrix)
            return (offset, last, v, root, _tangent(matrix, k, span)), found

        v = sine(jnp.clip(start, low + _INSIDE * span, high - _INSIDE * span))[_others(k, count)]
        begin = (jnp.zeros(()), unit[k] * FARTHEST / STEPS, v, jnp.zeros(()), slopes[k])
        return jax.lax.scan(point, begin, (jnp.linspace(0.0, FARTHEST, STEPS + 1)[1:], schedule))[1]

    items: Any = (sides, starts, given)
    return mapped(one, items)


def _ahead(offset: Array, last: Array, root: Array, target: Array, longest: Array) -> tuple[Array, Array]:
    """The next distance from the best value, and the step to it, for √(2Δ) = target if that grows as before."""
    growing = root > 0
    wanted = jnp.where(growing, offset * (target / jnp.where(growing, root, 1.0) - 1.0), GROWTH * last)
    step = jnp.minimum(jnp.clip(wanted, last / GROWTH, last * GROWTH), longest)
    return offset + step, step


def _others(k: Array, count: int) -> Array:
    """All places but k, (count − 1,)."""
    every = jnp.arange(count - 1)
    return jnp.where(every >= k, every + 1, every)


def _tangent(known: Array, k: Array, span: Array) -> Array:
    """dt/dt_k along the ridge, (f,): the others follow so that the residuals change least."""
    count = len(span)
    if count == 1:
        return jnp.ones(1)
    others = _others(k, count)
    stiff = known + jnp.diag(12.0 / span**2)
    follow = -jnp.linalg.solve(stiff[others][:, others], stiff[others, k])
    return jnp.ones(count).at[others].set(follow)


def _interval(
    at: np.ndarray, rise: np.ndarray, centre: int, bounds: tuple[float, float]
) -> tuple[tuple[float, float], tuple[bool, bool]]:
    """Where √(2Δ) crosses `LEVEL` on either side, by linear interpolation; the bound where it does not."""
    root = np.sqrt(2.0 * np.maximum(rise - rise.min(), 0.0))
    limits, opened = [], []
    for side, bound in ((slice(centre, None, -1), bounds[0]), (slice(centre, None), bounds[1])):
        x, r = at[side], root[side]
        beyond = np.flatnonzero(r > LEVEL)
        opened.append(len(beyond) == 0)
        if len(beyond) == 0 or beyond[0] == 0:
            limits.append(float(bound if len(beyond) == 0 else x[0]))
            continue
        j = beyond[0]
        part = (LEVEL - r[j - 1]) / (r[j] - r[j - 1])
        limits.append(float(x[j - 1] + part * (x[j] - x[j - 1])))
    return (limits[0], limits[1]), (opened[0], opened[1])
