"""Fit a model to measurements: many starts, Levenberg–Marquardt, the discrepancy inferred, the outcome named.

Gives the best parameters, how sure the data are of them locally (covariance), and what to think of the result.
"""

import dataclasses
from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, ArrayLike

from fitmat.errors import FitmatError, ModelError
from fitmat.fitting.coordinates import Coordinates, coordinates
from fitmat.fitting.likelihood import (
    Data,
    best_discrepancy,
    every_residual,
    first_discrepancy,
    log_density,
    mapped,
    prepare,
    transformed,
)
from fitmat.fitting.losses import DEFAULT
from fitmat.fitting.losses import loss as find_loss
from fitmat.fitting.priors import prepare_prior
from fitmat.fitting.result import Ends, Fit, conclude
from fitmat.fitting.starts import starting_points
from fitmat.maths.least_squares import Minimum, Units, least_squares
from fitmat.measurements.noise import measured_noise
from fitmat.measurements.samples import Measurements
from fitmat.models.around.instrument import Seen
from fitmat.models.around.noise import LEAST_ABSOLUTE, Noisy
from fitmat.models.base import AbstractBRDF, evaluate_pairs
from fitmat.models.parameters import check_range, entries, vector, with_vector
from fitmat.models.registry import model

STARTS = 6
"""How many of the best grid points are refined."""

ROUNDS = 12
"""At most this many alternations between parameters and discrepancy."""

MANY_ROWS = 8000
"""Above this many rows a fit converges on an evenly spread part first, then on all of them."""

LITTLE_DAMPING = 1e-3
"""How much smaller the first damping is on all rows than on the part."""

STEADY = 1e-4
"""Relative offset (Bates & Watts 1981, who ask for 1e-3) at which a fit has converged even if its last digits move."""

SETTLED = 1e-5
"""Relative change of the discrepancy at which the alternation ends."""


def fit(
    measurements: Measurements,
    to: str | AbstractBRDF,
    *,
    fixed: Mapping[str, ArrayLike] | None = None,
    priors: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    loss: str = DEFAULT.name,
    masking: str | None = None,
    max_steps: int = 256,
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
        max_steps: Levenberg–Marquardt iterations per start and round.

    Returns:
        A `Fit`; a numerical failure is its `result`, not an exception.

    Raises:
        FitmatError: float64 is off, the model is unknown, a prior is not of this model, or there are too few valid
            samples.

    Example:
        >>> fit(read("measurements.csv"), "lambert+ggx", fixed={"ks": 1.0})  # doctest: +SKIP
    """
    if not jax.config.read("jax_enable_x64"):
        raise FitmatError(
            'fitmat needs 64-bit floats: run jax.config.update("jax_enable_x64", True) before building arrays.'
        )
    channels = len(measurements.channels)
    template = model(to, channels=channels, masking=masking) if isinstance(to, str) else to
    chosen = find_loss(loss)
    shown = _seen(template, measurements)
    known = dict(priors or {})
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
    ends = jax.device_get(refine(shown, data, jnp.asarray(starts), first, moved, max_steps))
    return conclude(measurements, shown, held, (found_noise, data), ends)


def _seen(template: AbstractBRDF, m: Measurements) -> AbstractBRDF:
    """The model as the measurements' instrument shows it, with what is to be fitted of the instrument at its start."""
    if m.instrument.ideal:
        return template
    dark = np.quantile((m.value * m.wo[:, 2:])[m.valid], 0.01)
    return Seen(
        template,
        dataclasses.replace(m.instrument, calibration=0.0),  # static: each value would be compiled for
        scale=jnp.ones(()) if m.instrument.calibration else None,
        dark=jnp.clip(0.5 * dark, 1e-6, 0.5) if m.instrument.dark is None else None,
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
        given = np.atleast_1d(np.asarray(value, float))
        if given.shape not in ((1,), (sizes[name].size,)):
            raise ModelError(f"fixed {name} has {given.size} values: expected 1 or {sizes[name].size}.")
        values[sizes[name].place] = given
        held[name] = values[sizes[name].place].copy()
    check_range(with_vector(template, jnp.asarray(values)))
    return held


@eqx.filter_jit
def refine(template: AbstractBRDF, data: Data, starts: Array, first: Array, moved: Coordinates, max_steps: int) -> Ends:
    """Alternate Levenberg–Marquardt over the parameters and the best discrepancy, from every start.

    In a location–scale family the two are information-orthogonal, so that a few rounds settle both.

    Args:
        template: Gives shapes, bounds and static choices.
        data: The samples, with their loss and prior.
        starts: Physical parameter vectors, (k, p), which also hold what is fixed.
        first: A first guess of the discrepancy.
        moved: The parameters that are fitted.
        max_steps: Levenberg–Marquardt iterations per start and round.
    """

    def at(base: Array, u: Array) -> AbstractBRDF:
        return with_vector(template, moved.from_unbounded(base, u))

    def settle(data: Data, base: Array, u: Array, s: Array) -> tuple[Array, ...]:
        def body(state: tuple) -> tuple:
            u, s, _, _, steps, rounds = state
            end = descend((template, moved), data, base, u, s, max_steps=max_steps)
            predicted = evaluate_pairs(at(base, end.x), data.wi, data.wo) * data.kappa
            updated = best_discrepancy(predicted, data, s)
            settled = jnp.abs(updated - s) <= SETTLED * s
            solved = (end.result == optx.RESULTS.successful) | (end.offset < STEADY)
            return end.x, updated, settled, solved, steps + end.steps, rounds + 1

        begin = (u, s, jnp.array(False), jnp.array(False), jnp.array(0), jnp.array(0))
        return jax.lax.while_loop(lambda state: ~state[2] & (state[5] < ROUNDS), body, begin)

    def one(base: Array) -> Ends:
        begin = first if data.loss.infers_discrepancy else jnp.zeros(())
        u, s, settled, solved, steps, _ = settle(data, base, moved.unbounded(base), begin)
        best = at(base, u)
        return Ends(vector(best), s, log_density(best, data, s), settled & solved, steps)

    return mapped(one, starts)


def descend(
    what: tuple[AbstractBRDF, Coordinates], data: Data, base: Array, u: Array, s: Array, *, max_steps: int = 256
) -> Minimum:
    """Levenberg–Marquardt over unbounded coordinates with the discrepancy held; first on a part of many rows.

    Args:
        what: The model and which of its parameters are fitted.
        data: The samples.
        base: Physical parameter vector that holds what is fixed, (p,).
        u: Where to start, unbounded coordinates.
        s: Discrepancy.
        max_steps: Iterations allowed on all rows.
    """
    template, moved = what

    def residual(u: Array, args: tuple[Data, Array, Array, Array]) -> Array:
        data, base, s, measured = args
        return every_residual(with_vector(template, moved.from_unbounded(base, u)), data, s, measured)

    def minimum(data: Data, u: Array, units: Units | None) -> Minimum:
        measured = transformed(data, s)
        return least_squares(residual, u, (data, base, s, measured), max_steps=max_steps, units=units)

    rows = data.x.shape[0]
    if rows <= MANY_ROWS:
        return minimum(data, u, None)
    stride = rows // (MANY_ROWS // 2)
    coarse = minimum(data.every(stride), u, None)
    # So close to the end hardly any damping is needed: λ is relative to the square of the unit.
    return minimum(data, coarse.x, Units(coarse.units.x * LITTLE_DAMPING**-0.5, coarse.units.residual * stride**0.5))
