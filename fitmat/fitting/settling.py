"""Settling: Σ residual² at many points of the natural coordinates, and where it is least with one of them held.

One program does both, and walks along a parameter in one call. It knows no likelihood ratio and no interval.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from fitmat.fitting.channelwise import layout
from fitmat.fitting.coordinates import Coordinates, coordinates
from fitmat.fitting.likelihood import Data, every_residual
from fitmat.maths.grams import Layout, solve
from fitmat.maths.least_squares import normal_equations
from fitmat.maths.mapping import mapped
from fitmat.maths.parts import slices
from fitmat.maths.programs import program
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import vector

AT_ONCE = 16
"""Points for which the program is compiled."""

STEPS = 16
"""Of a walk, at most."""

FARTHEST = 4.0
"""√(2Δ) where a walk of `STEPS` ends unless a bound comes first: four standard deviations of a Gaussian."""

LONGEST = 0.1
"""Longest step, as a fraction of the range of whatever parameter moves most: 16 of them cross any range."""

GROWTH = 3.0
"""A step is at most so many times as long as the last one, and at least as much shorter."""

PRECISE = 1e-5
"""Inner optima end where Δ would fall by less."""

MOST_ITERATIONS = 40
"""Of the inner optima."""


class Frame(NamedTuple):
    """How the p coordinates may move.

    Attributes:
        centre: Natural coordinates about which `back` turns and from which walks set out, (p,).
        low: Lower bounds, (p,).
        high: Upper bounds, (p,).
        span: Widths that set the scale of each, (p,).
        back: A⁻¹ where Σ residual² is asked for at centre + A⁻¹(t − centre) in place of t, (p, p).
        free: Which move, (p,).
    """

    centre: Float[np.ndarray, " p"]
    low: Float[np.ndarray, " p"]
    high: Float[np.ndarray, " p"]
    span: Float[np.ndarray, " p"]
    back: Float[np.ndarray, "p p"]
    free: Bool[np.ndarray, " p"]


class Walks(NamedTuple):
    """m points, and how each goes on.

    Attributes:
        start: Where they begin, (m, p).
        held: Which coordinate is held, or walked along, (m,).
        sign: In which direction it is walked along, (m,); 0 for points that stay.
        reach: How far away its bound is, (m,).
        first: Length of the step before the first, (m,).
        least: Σ residual² from which Δ counts, (m,).
        gram: JᵀJ there, (m, p, p), along whose ridge the first step goes.
    """

    start: Float[np.ndarray, "m p"]
    held: Int[np.ndarray, " m"]
    sign: Float[np.ndarray, " m"]
    reach: Float[np.ndarray, " m"]
    first: Float[np.ndarray, " m"]
    least: Float[np.ndarray, " m"]
    gram: Float[np.ndarray, "m p p"]

    @classmethod
    def standing(cls, points: Float[np.ndarray, "m p"], held: Int[np.ndarray, " m"]) -> "Walks":
        """Points that stay."""
        none, count = np.zeros(len(points)), points.shape[1]
        return cls(points, held, none, none, none + 1.0, none, np.zeros((len(points), count, count)))


class Reached(NamedTuple):
    """Where walks came by, and the normal equations at their ends.

    Attributes:
        points: After each step, (m, `STEPS`, p).
        squares: Σ residual² there, (m, `STEPS`).
        slope: Jᵀr at the end, (m, p).
        gram: JᵀJ at the end, (m, p, p).
    """

    points: Float[np.ndarray, "m s p"]
    squares: Float[np.ndarray, "m s"]
    slope: Float[np.ndarray, "m p"]
    gram: Float[np.ndarray, "m p p"]


Settle = Callable[[Walks, int, int], Reached]
"""Walks, their number of steps, and the most iterations of each inner optimum, to where they lead."""


def settle_of(template: AbstractBRDF, data: Data, s: float, frame: Frame) -> Settle:
    """Walks over ½ Σ residual², the prior's rows included, s held: each step ends in the optimum of the others.

    A step is as long as makes √(2Δ) grow evenly to `FARTHEST` if it grows as before (Venzon & Moolgavkar 1988).
    Optima are found by Levenberg–Marquardt, projected onto the bounds (Bertsekas 1982).

    Args:
        template: Gives shapes, bounds and static choices.
        data: The samples.
        s: Discrepancy.
        frame: How the coordinates of all parameters may move.
    """
    every = coordinates(template)
    of = layout(template, every, data.x.shape[1])
    example = _packed(Walks.standing(np.zeros((1, every.count)), np.zeros(1, int)), slice(0, 1))
    fixed = template, every, of, data, np.asarray(float(s)), frame
    run = _settled.bound(fixed, example, np.zeros(3, int))

    def settle(walks: Walks, steps: int, iterations: int) -> Reached:
        found = []
        for part in slices(len(walks.start), AT_ONCE):
            size = part.stop - part.start
            given = run(_packed(walks, part), np.array([size, steps, iterations]))
            found.append([np.asarray(one)[:size] for one in given])
        return Reached(*(one[0] if len(found) == 1 else np.concatenate(one) for one in zip(*found, strict=True)))

    return settle


def _packed(walks: Walks, part: slice) -> Float[np.ndarray, "m q"]:
    """Some of the walks as rows of one array, the last repeated up to `AT_ONCE`: each array of a call takes time."""
    rows = np.minimum(np.arange(part.start, part.start + AT_ONCE), part.stop - 1)
    return np.column_stack([one[rows].reshape(AT_ONCE, -1) for one in walks])


class _Place(NamedTuple):
    """A point with its normal equations, and the step from there that is tried next."""

    t: Array
    square: Array
    slope: Array
    gram: Array
    step: Array
    damping: Array
    looks: Array
    moving: Array


class _Stand(NamedTuple):
    """Where a walk stands, and where it came by."""

    t: Array
    offset: Array
    last: Array
    root: Array
    points: Array
    squares: Array
    slope: Array
    gram: Array


@program
def _settled(
    template: AbstractBRDF,
    every: Coordinates,
    of: Layout | None,
    data: Data,
    s: ArrayLike,
    frame: Frame,
    walks: ArrayLike,
    counts: ArrayLike,
) -> tuple[Array, Array, Array, Array]:
    """Fields of `Reached` of what is `_packed`; `counts` are those of walks, of steps, and of iterations."""
    base, (count, steps, most) = vector(template), jnp.asarray(counts)
    centre, low, high, span, back, free = (jnp.asarray(part) for part in frame)

    def equations(t: Array) -> tuple[Array, Array, Array]:
        at = jnp.clip(centre + back @ (t - centre), low, high)
        found = normal_equations(
            lambda natural: every_residual(every.model(template, base, natural), data, jnp.asarray(s)), at, of
        )
        return found.square, found.slope @ back, back.T @ found.gram.dense() @ back

    def settled(t: Array, place: Array) -> _Place:
        moves = free & (jnp.arange(len(t)) != place)

        def look(here: _Place) -> _Place:
            begin = here.looks == 0
            tried = jnp.clip(here.t + here.step, low, high)
            square, slope, gram = equations(tried)
            better = begin | (square < here.square)
            eased = jnp.where(better, here.damping * 0.1, jnp.maximum(here.damping * 10.0, 1e-3))
            damping = jnp.where(begin, here.damping, eased)
            t, square, slope, gram = (
                jnp.where(better, new, old) for new, old in zip((tried, square, slope, gram), here[:4], strict=True)
            )
            blocked = ~moves | ((t <= low) & (slope > 0)) | ((t >= high) & (slope < 0))
            step, promised = _step(slope, gram, ~blocked, damping, span)
            moving = (promised > PRECISE) & (damping <= 1e6)
            return _Place(t, square, slope, gram, step, damping, here.looks + 1, moving)

        zero = jnp.zeros(len(t))
        begin = _Place(
            t, jnp.array(jnp.inf), zero, jnp.outer(zero, zero), zero, jnp.array(1e-6), jnp.array(0), jnp.array(True)
        )
        return jax.lax.while_loop(lambda here: here.moving & (here.looks <= most), look, begin)

    def one(walk: Array) -> tuple[Array, ...]:
        t0, (place, sign, reach, first, least), square = jnp.split(walk, [every.count, every.count + 5])
        k, gram0 = place.astype(int), square.reshape(every.count, every.count)

        def step(j: Array, at: _Stand) -> _Stand:
            tangent = _tangent(at.gram, k, free, span)
            longest = LONGEST / jnp.max(jnp.abs(tangent) / span)
            growing, target = at.root > 0, FARTHEST * (j + 1) / STEPS
            wanted = jnp.where(growing, at.offset * (target / jnp.where(growing, at.root, 1.0) - 1.0), GROWTH * at.last)
            last = jnp.minimum(jnp.clip(wanted, at.last / GROWTH, at.last * GROWTH), longest)
            ahead = jnp.minimum(at.offset + last, reach)
            t = jnp.clip(at.t + tangent * sign * (ahead - at.offset), low, high)
            end = settled(t.at[k].set(t0[k] + sign * ahead), k)
            root = jnp.sqrt(jnp.maximum(end.square - least, 0.0))
            points, squares = at.points.at[j].set(end.t), at.squares.at[j].set(end.square)
            return _Stand(end.t, ahead, last, root, points, squares, end.slope, end.gram)

        none = jnp.zeros(())
        kept = jnp.zeros((STEPS, len(t0))), jnp.zeros(STEPS)
        begin = _Stand(t0, none, first, none, *kept, jnp.zeros(len(t0)), gram0)
        end = jax.lax.fori_loop(0, steps, step, begin)
        return end.points, end.squares, end.slope, end.gram

    return mapped(one, jnp.asarray(walks), count)


def _step(slope: Array, gram: Array, free: Array, damping: Array, span: Array) -> tuple[Array, Array]:
    """A damped Gauss–Newton step of the parameters that are free, and how far ½ Σ residual² falls by it.

    Where rounding leaves the system without a solution the step is 0, which is no better and raises the damping.
    """
    unit = jnp.sqrt(jnp.maximum(jnp.diagonal(gram), 1e-12 / span**2))
    scaled = jnp.where(free[:, None] & free, gram / (unit[:, None] * unit), 0.0)
    system = scaled + jnp.diag(jnp.where(free, damping, 1.0) + 1e-14)
    against = jnp.where(free, -slope / unit, 0.0)
    z = solve(system, against)
    promised, solved = against @ z - 0.5 * z @ scaled @ z, jnp.isfinite(z).all()
    return jnp.where(solved, z / unit, 0.0), jnp.where(solved | ~jnp.isfinite(against).all(), promised, jnp.inf)


def _tangent(gram: Array, held: Array, free: Array, span: Array) -> Array:
    """dt/dt_held along the ridge: the others follow so that the residuals change least."""
    released = jnp.where(free[:, None] & free, gram, 0.0) + jnp.diag(jnp.where(free, 12.0 / span**2, 1.0))
    alone = (jnp.arange(len(span)) == held).astype(float)
    column = solve(released, alone)
    along = column / column[held]
    return jnp.where(jnp.isfinite(along).all(), along, alone)
