"""Fit a model to measurements: many starts, Levenberg–Marquardt, the discrepancy inferred, the outcome named.

Gives the best parameters, how sure the data are of them locally (covariance), and what to think of the result.
"""

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, ArrayLike

from fitmat.brdf import AbstractBRDF, evaluate_pairs, model
from fitmat.errors import FitmatError, ModelError
from fitmat.instrument import noise
from fitmat.likelihood import (
    Data,
    best_discrepancy,
    first_discrepancy,
    log_likelihood,
    prepare,
    residuals,
)
from fitmat.measurement import Measurements
from fitmat.outcome import Ends, Fit, conclude, free_places
from fitmat.params import Space, check_range, entries, space, vector, with_vector
from fitmat.solver import least_squares
from fitmat.starts import starting_points

STARTS = 6
"""How many of the best grid points are refined."""

ROUNDS = 12
"""At most this many alternations between parameters and discrepancy."""

SETTLED = 1e-5
"""Relative change of the discrepancy at which the alternation ends."""


def fit(
    measurements: Measurements,
    to: str | AbstractBRDF,
    *,
    fixed: Mapping[str, ArrayLike] | None = None,
    masking: str | None = None,
    max_steps: int = 256,
) -> Fit:
    """Fit a model to measurements.

    Args:
        measurements: From `fitmat.read`.
        to: A model name ("lambert+ggx"), or a model whose shapes and static choices are used.
        fixed: Parameters to hold, by name: `{"ks": 1.0}`.
        masking: Static masking choice for the microfacet lobes of a named model.
        max_steps: Levenberg–Marquardt iterations per start and round.

    Returns:
        A `Fit`; a numerical failure is its `result`, not an exception.

    Raises:
        FitmatError: float64 is off, the model is unknown, or there are too few valid samples.

    Example:
        >>> fit(read("measurements.csv"), "lambert+ggx", fixed={"ks": 1.0})  # doctest: +SKIP
    """
    if not jax.config.read("jax_enable_x64"):
        raise FitmatError(
            'fitmat needs 64-bit floats: run jax.config.update("jax_enable_x64", True) before building arrays.'
        )
    channels = len(measurements.channels)
    template = model(to, channels=channels, masking=masking) if isinstance(to, str) else to
    held = _held(template, fixed or {})
    free = free_places(template, held)
    needed = len(free) + 2
    if measurements.n_valid < needed:
        raise FitmatError(
            f"{measurements.source}: {measurements.n_valid} valid samples, but {template.name} has {len(free)} free "
            f"parameters and needs at least {needed}; measure more angles or fix parameters (--fix ks=1)."
        )
    found_noise = noise(measurements)
    data = prepare(measurements, found_noise)
    first = first_discrepancy(data)
    starts = starting_points(template, data, first, held, STARTS)
    ends = jax.device_get(_refine(template, data, starts, first, tuple(int(k) for k in free), max_steps))
    return conclude(measurements, template, held, (found_noise, data), ends)


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
def _refine(
    template: AbstractBRDF, data: Data, starts: Array, first: Array, free: tuple[int, ...], max_steps: int
) -> Ends:
    """Alternate Levenberg–Marquardt over the parameters and the best discrepancy, from every start at once.

    In a location–scale family the two are information-orthogonal, so that a few rounds settle both.
    """
    places = jnp.array(free, int)
    coordinates = _subspace(space(template), np.array(free, int))

    def rebuilt(base: Array, u: Array) -> AbstractBRDF:
        return with_vector(template, base.at[places].set(coordinates.from_free(u)))

    def residual(u: Array, args: tuple[Array, Array]) -> Array:
        base, s = args
        return residuals(rebuilt(base, u), data, s)

    def one(base: Array) -> Ends:
        def body(state: tuple) -> tuple:
            u, s, _, _, steps, rounds = state
            end = least_squares(residual, u, (base, s), max_steps=max_steps)
            predicted = evaluate_pairs(rebuilt(base, end.x), data.wi, data.wo) * data.kappa
            updated = best_discrepancy(predicted, data, s)
            settled = jnp.abs(updated - s) <= SETTLED * s
            return (
                end.x,
                updated,
                settled,
                end.result == optx.RESULTS.successful,
                steps + end.steps,
                rounds + 1,
            )

        def unsettled(state: tuple) -> Array:
            return ~state[2] & (state[5] < ROUNDS)

        zero = jnp.array(0)
        begin = (coordinates.to_free(base[places]), first, jnp.array(False), jnp.array(False), zero, zero)
        u, s, settled, solved, steps, _ = jax.lax.while_loop(unsettled, body, begin)
        best = rebuilt(base, u)
        return Ends(vector(best), s, log_likelihood(best, data, s), settled & solved, steps)

    # One start after the other compiles in half the time and runs as fast on a few cores; an accelerator wants a batch.
    return jax.lax.map(one, starts) if jax.default_backend() == "cpu" else jax.vmap(one)(starts)


def _subspace(whole: Space, places: np.ndarray) -> Space:
    return Space(whole.lower[places], whole.upper[places], whole.log[places])
