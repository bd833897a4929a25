"""Concluding: of many fits the best ends, their standard deviations and the names of their outcomes.

The rules are those of `information` and of the fit's own `concluding`, for all at once. It solves nothing.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from fitmat.fitting.concluding import RESULTS, named_outcome
from fitmat.fitting.information import (
    FOLLOWS,
    SIDES,
    difference_steps,
    hessian,
    inverse_information,
    is_positive,
    limits,
)
from fitmat.fitting.likelihood import log_pointwise
from fitmat.fitting.many.gathering import counted
from fitmat.fitting.many.lanes import Samples, Shared, from_natural, looked, summed
from fitmat.maths.programs import program_run_often

TOO_FEW = "too_few"
"""The outcome of a surface with fewer valid samples than a fit needs."""

OUTCOMES = {**RESULTS, TOO_FEW: "There are fewer valid samples than parameters and two more: nothing was fitted."}
"""How one of many fits can end, and what that means; a fit's number is its place here."""

_NUMBER = {name: k for k, name in enumerate(OUTCOMES)}


class Seen(NamedTuple):
    """Many fits at given points: log density of the values, Jᵀr and JᵀJ in natural coordinates, Σ residual²."""

    log_likelihood: Float[np.ndarray, " T"]
    slope: Float[np.ndarray, "T k"]
    gram: Float[np.ndarray, "T k k"]
    square: Float[np.ndarray, " T"]


@program_run_often
def _seen(
    shared: Shared, samples: Samples, natural: ArrayLike, s: ArrayLike, block: int
) -> tuple[Array, Array, Array, Array]:
    """The fields of `Seen`; as many fits as are a multiple of the block."""

    def one(of: tuple[Samples, Array, Array]) -> tuple[Array, ...]:
        data, t, s = jax.tree.map(lambda part: jnp.moveaxis(part, 0, -1), of)
        measured = shared.loss.transform(data.x, data.noise, shared.kappa, s)
        some = jnp.any(s >= 0.0)
        normal, x = looked(shared, data, s, measured, lambda: from_natural(shared.moved, t), some)
        every = summed(data.weight * log_pointwise(x, data.noise, shared.data(data), s))
        return every, normal.slope.T, jnp.moveaxis(normal.gram.dense(), -1, 0), normal.square

    parts = jax.tree.map(
        lambda part: jnp.asarray(part).reshape(-1, block, *part.shape[1:]),
        (samples, jnp.asarray(natural), jnp.asarray(s)),
    )
    return jax.tree.map(lambda part: part.reshape(-1, *part.shape[2:]), jax.lax.map(one, parts))


def seen(shared: Shared, samples: Samples, natural: np.ndarray, s: np.ndarray, block: int) -> Seen:
    """Many fits at points in natural coordinates, (T, k), with discrepancies (T,)."""
    return Seen(*map(np.asarray, _seen(shared, samples, natural, s, block)))


class Judged(NamedTuple):
    """What is known of many fits.

    Attributes:
        sd: Of the fitted parameters, physical, (T, k); NaN on a bound, and where the loss is an objective.
        outcome: Places in `OUTCOMES`, (T,).
        log_likelihood: (T,).
    """

    sd: Float[np.ndarray, "T k"]
    outcome: np.ndarray
    log_likelihood: Float[np.ndarray, " T"]


def judged(
    shared: Shared, samples: Samples, values: Float[np.ndarray, "T p"], s: np.ndarray, solved: np.ndarray, block: int
) -> Judged:
    """The standard deviations and the outcomes of many fits.

    Args:
        shared: The model and the directions.
        samples: Of every surface.
        values: Best parameters, physical.
        s: Discrepancies.
        solved: Whether the steps became small.
        block: Fits side by side.
    """
    moved, here = shared.moved, shared.moved.natural(values)
    found = seen(shared, samples, here, s, block)
    known = _information(shared, samples, found, here, s, block)
    side = moved.side(values)
    spread, loose = _spread(known, shared, side)
    usable = np.isfinite(found.log_likelihood) & np.isfinite(values).all(axis=1)
    names = np.array(
        [
            _NUMBER[named_outcome(*(bool(bit & 8), bool(bit & 4), bool(bit & 2)), ("",) if bit & 1 else ())]
            for bit in range(16)
        ],
        np.uint8,
    )
    outcome = names[8 * usable + 4 * solved + 2 * (side != 0).any(axis=1) + loose]
    sd = (
        np.where(side == 0, spread * moved.slope(values), np.nan)
        if shared.loss.posterior
        else np.full(here.shape, np.nan)
    )
    few = counted(samples) < moved.count + 2
    return Judged(np.where(few[:, None], np.nan, sd), np.where(few, _NUMBER[TOO_FEW], outcome), found.log_likelihood)


def _information(
    shared: Shared, samples: Samples, found: Seen, here: np.ndarray, s: np.ndarray, block: int
) -> Float[np.ndarray, "T k k"]:
    """As `information.information`."""
    loss = shared.loss
    if loss.spread is None:
        count = counted(samples)
        mean = np.maximum(found.square / np.maximum(count - shared.moved.count, 1), 1e-300)
        return found.gram / mean[:, None, None]
    observed = ~(s < FOLLOWS * samples.typical) if loss.linear else np.ones(len(s), bool)
    if not observed.any():
        return found.gram
    h, shift = difference_steps(shared.moved, found.gram, here)
    each = [[here + one * h * (shift + side) for one in np.eye(shared.moved.count)] for side in SIDES]
    slopes = [np.stack([seen(shared, samples, at, s, block).slope for at in some], axis=1) for some in each]
    curved = hessian(np.stack(slopes), h, shift)
    return np.where((observed & is_positive(curved))[:, None, None], curved, found.gram)


def _spread(known: np.ndarray, shared: Shared, side: np.ndarray) -> tuple[Any, Any]:
    """Standard deviations in natural coordinates, and which fits have a parameter that is not determined.

    As `information.covariance`: judged with every parameter released, those on a bound as well.
    """
    moved = shared.moved
    spread = _deviations(known, moved.span)
    loose = ~(spread <= limits(moved)).all(axis=1)
    held = np.flatnonzero(~loose & (side != 0).any(axis=1))
    inside = side[held] == 0
    both = inside[:, :, None] & inside[:, None, :]
    spread[held] = _deviations(np.where(both, known[held], 0.0), moved.span)
    return spread, loose


def _deviations(information: np.ndarray, span: np.ndarray) -> Float[np.ndarray, "T k"]:
    with np.errstate(invalid="ignore", over="ignore"):
        return np.sqrt(np.diagonal(inverse_information(information, span), axis1=1, axis2=2))
