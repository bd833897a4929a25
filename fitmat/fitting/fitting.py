"""Fit a model to measurements: many starts, Levenberg–Marquardt, the discrepancy inferred, the outcome named.

Gives the best parameters, how sure the data are of them locally (covariance), and what to think of the result.
"""

import dataclasses
from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from fitmat import arguments
from fitmat.errors import FitmatError, ModelError
from fitmat.fitting.coordinates import Coordinates, coordinates
from fitmat.fitting.likelihood import (
    Data,
    best_discrepancy,
    every_residual,
    first_discrepancy,
    log_density,
    predicted,
    prepare,
    transformed,
)
from fitmat.fitting.losses import DEFAULT
from fitmat.fitting.losses import loss as find_loss
from fitmat.fitting.priors import prepare_prior, refuse_idle
from fitmat.fitting.result import Ends, Fit, conclude
from fitmat.fitting.starts import starting_points
from fitmat.maths.least_squares import least_squares
from fitmat.maths.mapping import mapped
from fitmat.maths.programs import program
from fitmat.measurements.noise import measured_noise
from fitmat.measurements.samples import Measurements
from fitmat.models.around.instrument import Seen
from fitmat.models.around.noise import LEAST_ABSOLUTE, Noisy
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import as_parameter, check_range, entries, vector, with_vector
from fitmat.models.registry import model

STARTS = 6
"""How many of the best grid points are refined."""

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


def fit(
    measurements: Measurements,
    to: str | AbstractBRDF,
    *,
    fixed: Mapping[str, ArrayLike] | None = None,
    priors: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    loss: str = DEFAULT.name,
    masking: str | None = None,
    max_steps: int = MAX_STEPS,
) -> Fit:
    """Fit a model to measurements.

    Args:
        measurements: From `fitmat.read`.
        to: A model name ("lambert+ggx"), or a model whose shapes and static choices are used.
        fixed: Parameters to hold, by name: `{"ks": 1.0}`.
        priors: What is known beforehand, by name: centre and standard deviation, `{"eta": (1.5, 0.05)}`; see
            `fitmat.fitting.priors`.
        loss: What is minimised, by name (`fitmat.fitting.losses`); only a likelihood supports a posterior.
        masking: Static masking choice for the microfacet lobes of a named model.
        max_steps: Levenberg–Marquardt iterations per start.

    Returns:
        A `Fit`; a numerical failure is its `result`, not an exception.

    Raises:
        FitmatError: float64 is off, the model is unknown, a prior is not of this model or could change nothing, or
            there are too few valid samples.

    Example:
        >>> fit(read("measurements.csv"), "lambert+ggx", fixed={"ks": 1.0})  # doctest: +SKIP
    """
    if not jax.config.read("jax_enable_x64"):
        raise FitmatError(
            'fitmat needs 64-bit floats: run jax.config.update("jax_enable_x64", True) before building arrays.'
        )
    _refuse_kinds(measurements, to, fixed, priors)
    arguments.whole("max_steps", max_steps, 1)
    channels = len(measurements.channels)
    if masking is not None and not isinstance(to, str):
        raise ModelError(
            f"masking = {masking!r} beside a model, expected it with a name: a model has its own. Leave it out."
        )
    template = model(to, channels=channels, masking=masking) if isinstance(to, str) else to
    chosen = find_loss(loss)
    shown = _seen(template, measurements)
    known = dict(priors or {})
    refuse_idle(known, fixed or {}, chosen)
    if chosen.infers_noise:
        shown, known = Noisy(shown), _noise_priors(measurements) | known
    held = _held(shown, fixed or {})
    moved = coordinates(shown, held)
    needed = moved.count + 2
    found_noise = measured_noise(measurements)
    if chosen.needs_noise and not found_noise.known:
        raise FitmatError(
            f"{measurements.source}: the loss {chosen.name} needs the noise, and it is not known; give a column sigma, "
            f"or choose another loss (default infers what is needed)."
        )
    data = prepare(measurements, found_noise, prepare_prior(shown, measurements.instrument, known), chosen)
    usable = int(np.count_nonzero(data.weight))
    if usable < needed:
        raise FitmatError(
            f"{measurements.source}: {usable} valid samples, but {template.name} has {moved.count} free "
            f"parameters and needs at least {needed}; measure more angles or fix parameters (--fix ks=1)."
        )
    first = first_discrepancy(data)
    starts = starting_points(template, data, first, held, STARTS)
    added = np.asarray(vector(shown))[len(vector(template)) :]
    starts = np.column_stack([starts, np.tile(added, (len(starts), 1))])
    ends = optima(shown, data, starts, moved, max_steps)
    return conclude(measurements, shown, held, (found_noise, data), ends)


def _refuse_kinds(measurements: object, to: object, fixed: object, priors: object) -> None:
    arguments.kind("measurements", measurements, Measurements)
    arguments.kind("to", to, str, AbstractBRDF)
    arguments.named(fixed=fixed, priors=priors)


def _seen(template: AbstractBRDF, m: Measurements) -> AbstractBRDF:
    """The model as the measurements' instrument shows it, with what is to be fitted of the instrument at its start."""
    if m.instrument.ideal:
        return template
    dark = np.quantile((m.value * m.wo[:, 2:])[m.valid], 0.01)
    return Seen(
        template,
        dataclasses.replace(m.instrument, calibration=0.0),  # static: each value would be compiled for
        scale=as_parameter(1.0) if m.instrument.calibration else None,
        dark=np.clip(0.5 * dark, 1e-6, 0.5) if m.instrument.dark is None else None,
    )


def _noise_priors(m: Measurements) -> dict[str, tuple[ArrayLike, ArrayLike]]:
    """Of an inferred noise: either part is known to an order of magnitude, about 3 % and a hundredth of the median."""
    middle = float(np.median(np.abs(m.value[m.valid]))) or 1.0
    centres = {"absolute": np.clip(0.01 * middle, 2.0 * LEAST_ABSOLUTE, 1.0), "relative": 0.03}
    return {name: (centre, np.log(10.0) * centre) for name, centre in centres.items()}


def _held(template: AbstractBRDF, fixed: Mapping[str, ArrayLike]) -> dict[str, np.ndarray]:
    """Fixed values as arrays of each parameter's size, checked against its bounds."""
    sizes = {e.name: e for e in entries(template)}
    held, values = {}, np.array(vector(template))
    for name, value in fixed.items():
        if name not in sizes:
            raise ModelError(f"cannot fix {name!r}: {template.name} has {', '.join(sizes)}.")
        given = np.atleast_1d(arguments.numbers(f"fixed {name}", value))
        if given.shape not in ((1,), (sizes[name].size,)):
            raise ModelError(f"fixed {name} has {given.size} values: expected 1 or {sizes[name].size}.")
        values[sizes[name].place] = given
        held[name] = values[sizes[name].place].copy()
    check_range(with_vector(template, values))
    return held


def optima(
    template: AbstractBRDF, data: Data, starts: np.ndarray, moved: Coordinates, max_steps: int = MAX_STEPS
) -> Ends:
    """Where the starts end, as `refine` has it; of many rows first on a part of them, then on all.

    Args:
        template: Gives shapes, bounds and static choices.
        data: The samples.
        starts: Physical parameter vectors, (k, p).
        moved: The parameters that are fitted.
        max_steps: Levenberg–Marquardt iterations per start.
    """
    rows = data.x.shape[0]
    if rows <= MANY_ROWS:
        return _refined(template, data, starts, first_discrepancy(data), moved, max_steps)
    part = data.every(-(-rows // (MANY_ROWS // 2)))
    coarse = _refined(template, part, starts, first_discrepancy(part), moved, max_steps)
    which = _distinct(coarse, moved)
    distinct = np.unique(which)
    begin = max(float(coarse.discrepancy[distinct[0]]), 1e-2 * float(first_discrepancy(data)))
    fine = _refined(template, data, coarse.values[distinct], np.asarray(begin), moved, max_steps, LITTLE_DAMPING)
    place = np.searchsorted(distinct, which)
    return Ends(*(column[place] for column in fine[:-1]), steps=fine.steps[place] + coarse.steps)


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
    found = refine(template, data, filled, counts, scalars, moved)
    return Ends(*(np.asarray(part)[:count] for part in found))


@program
def refine(
    template: AbstractBRDF,
    data: Data,
    starts: ArrayLike,
    counts: ArrayLike,
    scalars: ArrayLike,
    moved: Coordinates,
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

    Returns:
        The fields of `Ends`.
    """
    count, max_steps = jnp.asarray(counts)
    first, damping = jnp.asarray(scalars)

    def at(base: Array, u: Array) -> AbstractBRDF:
        return with_vector(template, moved.from_unbounded(base, u))

    def one(base: Array) -> tuple[Array, ...]:
        def residual(u: Array, args: tuple[Array, Array]) -> tuple[Array, Array]:
            model = at(base, u)
            x = predicted(model, data)
            return every_residual(model, data, *args, x), x

        def body(state: _Stand) -> _Stand:
            s = state.discrepancy
            left = jnp.minimum(BURST, max_steps - state.steps)
            args = (s, transformed(data, s))
            end = least_squares(residual, state.u, args, max_steps=left, damping=state.damping)
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
