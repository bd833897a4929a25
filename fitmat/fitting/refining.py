"""Refining: from starts to the optima in which they end, by Levenberg–Marquardt and the best discrepancy in turn.

It chooses no start and names no outcome.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from fitmat.fitting.channelwise import Part, divides, layout
from fitmat.fitting.coordinates import Coordinates, coordinates
from fitmat.fitting.discrepancy import best_discrepancy, first_discrepancy
from fitmat.fitting.ends import AGREE, Ends, behind, home
from fitmat.fitting.likelihood import Data, every_residual, log_density, predicted, transformed
from fitmat.maths.grams import Layout
from fitmat.maths.least_squares import Residuals, least_squares
from fitmat.maths.mapping import mapped
from fitmat.maths.programs import program
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import entries, with_vector

STARTS = 6
"""How many of the best grid points are refined."""

ROUNDS = 4
"""So many times as many at most, where no two of them find the best optimum."""

BURST = 3
"""Looks at all residuals between two updates of the discrepancy."""

MANY_ROWS = 8192
"""Above this many rows a fit converges on an evenly spread part first, then on all of them."""

LITTLE_DAMPING = 1e-3
"""How much smaller the first damping is on all rows than on the part."""

MAX_STEPS = 512
"""Levenberg–Marquardt iterations per start."""

SAME = 1e-3
"""Ends of the part whose unbounded coordinates differ by less are one start for all rows."""

STEADY = 1e-4
"""Relative offset (Bates & Watts 1981, who ask for 1e-3) at which a fit has converged even if its last digits move."""

SETTLED = 1e-6
"""Relative change of the discrepancy at which the alternation ends."""


def confirmed(
    template: AbstractBRDF, data: Data, starts: np.ndarray, moved: Coordinates, max_steps: int = MAX_STEPS
) -> Ends:
    """`optima` of the first `STARTS` starts; of more where only one of them found the best.

    An optimum that a single start found may be one of many: before each further round the best end is a start itself,
    nudged off the bounds and turned home, where the solver may have stopped for the flat ends of its chart.

    Args:
        template: Gives shapes, bounds and static choices.
        data: The samples.
        starts: Physical parameter vectors, best first, (k, p).
        moved: The parameters that are fitted.
        max_steps: Levenberg–Marquardt iterations per start.
    """
    ends = optima(template, data, starts[:STARTS], moved, max_steps)
    for done in range(STARTS, len(starts), STARTS - 1):
        apart = behind(ends, data)
        best = int(np.argmin(apart))
        if np.count_nonzero(apart < AGREE) != 1:
            break
        tried = np.vstack([home(data, moved, ends.values[best]), starts[done : done + STARTS - 1]])
        found = optima(template, data, tried, moved, max_steps)
        ends = Ends(*(np.concatenate([old, column[1:]]) for old, column in zip(ends, found, strict=True)))
        if found.log_likelihood[0] > ends.log_likelihood[best]:
            for column, one in zip(ends, found, strict=True):
                column[best] = one[0]
    return ends


def optima(
    template: AbstractBRDF, data: Data, starts: np.ndarray, moved: Coordinates, max_steps: int = MAX_STEPS
) -> Ends:
    """Where the starts end, as `refine` has it; of many rows or channels first on a part of them, then on all.

    Args:
        template: Gives shapes, bounds and static choices.
        data: The samples.
        starts: Physical parameter vectors, (k, p).
        moved: The parameters that are fitted.
        max_steps: Levenberg–Marquardt iterations per start.
    """
    rows, channels = data.x.shape
    if divides(template, channels):
        coarse, damping = _of_some_channels(template, data, starts, moved, max_steps), 1.0
    elif rows > MANY_ROWS:
        part, damping = data.every(-(-rows // (MANY_ROWS // 2))), LITTLE_DAMPING
        coarse = _refined(template, part, starts, first_discrepancy(part), moved, max_steps)
    else:
        return _refined(template, data, starts, first_discrepancy(data), moved, max_steps)
    which = _distinct(coarse, moved)
    distinct = np.unique(which)
    begin = max(float(coarse.discrepancy[distinct[0]]), 1e-2 * float(first_discrepancy(data)))
    fine = _refined(template, data, coarse.values[distinct], np.asarray(begin), moved, max_steps, damping)
    place = np.searchsorted(distinct, which)
    return Ends(*(column[place] for column in fine[:-1]), steps=fine.steps[place] + coarse.steps)


def _of_some_channels(
    template: AbstractBRDF, data: Data, starts: np.ndarray, moved: Coordinates, max_steps: int
) -> Ends:
    """Where the starts end on some of the channels, as parameters of all."""
    part = Part(template, data.x.shape[1])
    held = [e.name for e in entries(template) if e.place.start not in moved.places]
    found = optima(
        part.model,
        data.of_channels(part.which, part.places),
        starts[:, part.places],
        coordinates(part.model, dict.fromkeys(held)),
        max_steps,
    )
    return found._replace(values=part.spread(starts, found.values, moved.places))


def _distinct(ends: Ends, moved: Coordinates) -> np.ndarray:
    """For each end, the best one that is the same, (k,)."""
    u = np.asarray(moved.unbounded(ends.values))
    better = np.argsort(-np.nan_to_num(ends.log_likelihood, nan=-np.inf), kind="stable")
    same = np.abs(u[:, None] - u).max(axis=2, initial=0.0) < SAME
    return np.array([next(j for j in better if j == k or same[j, k]) for k in range(len(u))])


def _refined(
    template: AbstractBRDF,
    data: Data,
    starts: np.ndarray,
    first: np.ndarray,
    moved: Coordinates,
    max_steps: int,
    damping: float = 1.0,
) -> Ends:
    """`refine` of at most `STARTS` starts, by one program however many there are."""
    count = len(starts)
    filled = np.concatenate([starts, np.repeat(starts[:1], STARTS - count, axis=0)])
    counts, scalars = np.array([count, max_steps]), np.array([first, damping])
    found = refine(template, data, filled, counts, scalars, moved, layout(template, moved, data.x.shape[1]))
    return Ends(*(np.asarray(part)[:count] for part in found))


@program
def refine(
    template: AbstractBRDF,
    data: Data,
    starts: ArrayLike,
    counts: ArrayLike,
    scalars: ArrayLike,
    moved: Coordinates,
    of: Layout | None,
) -> tuple[Array, Array, Array, Array, Array]:
    """Alternate Levenberg–Marquardt over the parameters and the best discrepancy, from every start.

    In a location–scale family the two are information-orthogonal, so that a few rounds settle both.

    Args:
        template: Gives shapes, bounds and static choices.
        data: The samples, with their loss and prior.
        starts: Physical parameter vectors, (k, p), which also hold what is fixed.
        counts: How many of the starts are refined, and how many iterations each may take.
        scalars: A first guess of the discrepancy, and of λ as `least_squares` has it.
        moved: The parameters that are fitted.
        of: Which of them count in one channel; None where that is not known.

    Returns:
        The fields of `Ends`.
    """
    count, max_steps = jnp.asarray(counts)
    first, damping = jnp.asarray(scalars)

    def at(base: Array, u: Array) -> AbstractBRDF:
        return with_vector(template, moved.from_unbounded(base, u))

    def one(base: Array) -> tuple[Array, ...]:
        def residual(u: Array, args: tuple[Array, Array]) -> tuple[Residuals, Array]:
            model = at(base, u)
            x = predicted(model, data)
            return every_residual(model, data, *args, x, moved.index), x

        def body(state: _Stand) -> _Stand:
            s = state.discrepancy
            left = jnp.minimum(BURST, max_steps - state.steps)
            args = (s, transformed(data, s))
            told = {"layout": of, "max_steps": left, "damping": state.damping, "bend": moved.bend}
            end = least_squares(residual, state.u, args, **told)
            updated = best_discrepancy(end.beside, data, s)
            settled = jnp.abs(updated - s) <= SETTLED * s
            ended, steady = settled & end.solved, settled & (end.offset < STEADY)
            return _Stand(end.x, updated, end.damping, end.beside, ended, steady, state.steps + end.steps)

        begin, no = first if data.loss.infers_discrepancy else 0.0 * first, jnp.array(False)
        start = _Stand(moved.unbounded(base), begin, damping, jnp.zeros_like(data.x), no, no, jnp.array(0))
        end = jax.lax.while_loop(lambda state: ~state.ended & (state.steps < max_steps), body, start)
        best = moved.from_unbounded(base, end.u)
        value = log_density(at(base, end.u), data, end.discrepancy, end.x)
        return best, end.discrepancy, value, end.ended | end.steady, end.steps

    return mapped(one, jnp.asarray(starts), count)


class _Stand(NamedTuple):
    """Where one start stands."""

    u: Array
    discrepancy: Array
    damping: Array
    x: Array
    ended: Array
    steady: Array
    steps: Array
