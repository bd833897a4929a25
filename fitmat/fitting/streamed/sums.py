"""Sums: the cost of some rows and its derivatives, which add up over the blocks of a file.

It takes no step and reads no file.
"""

import dataclasses
from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.likelihood import Data, log_likelihood, predicted, prepare, residuals
from fitmat.maths.least_squares import jacobian
from fitmat.maths.programs import program, program_run_often
from fitmat.measurements.noise import Noise
from fitmat.measurements.samples import Measurements
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import vector

BLOCK = 2**14
"""Rows for which the program that adds up one block is compiled; its intermediate arrays stay in the cache."""


class Sums(NamedTuple):
    """The cost −ln L of some rows and its derivatives; t are the natural coordinates of all p parameters.

    Attributes:
        cost: −ln L.
        gradient: ∂cost/∂t, (p,).
        gram: JᵀJ of the residuals, (p, p).
        slope: ∂cost/∂s.
        mixed: ∂²cost/∂t∂s, (p,).
        curvature: ∂²cost/∂s².
    """

    cost: Any
    gradient: Any
    gram: Any
    slope: Any
    mixed: Any
    curvature: Any


def block_sums(best: AbstractBRDF, data: Data, s: float) -> Sums:
    """The sums of one block at `best` and s."""
    return Sums(*(np.asarray(part) for part in _block_sums(best, data, np.asarray(s))))


@program_run_often
def _block_sums(best: AbstractBRDF, data: Data, s: ArrayLike) -> tuple[Array, ...]:
    s, one, every, values = jnp.asarray(s), jnp.ones(()), coordinates(best), vector(best)
    x, columns = jacobian(lambda t: predicted(every.model(best, values, t), data), every.natural(values))

    def by_value(s: Array) -> tuple[Array, Array]:
        return jax.jvp(lambda x: residuals(best, data, s, x), (x,), (jnp.ones_like(x),))

    def cost(s: Array) -> Array:
        return -log_likelihood(best, data, s, x)

    (r, by_x), (r_change, by_x_change) = jax.jvp(by_value, (s,), (one,))
    (total, change), (_, curvature) = jax.jvp(lambda s: jax.jvp(cost, (s,), (one,)), (s,), (one,))
    # Made before they are added up: a product that is fused into a dot product is computed number by number.
    weighted, bent, columns, r, r_change = jax.lax.optimization_barrier(
        (columns * by_x.ravel(), (by_x_change * r).ravel(), columns, r.ravel(), r_change.ravel())
    )
    mixed = weighted @ r_change + columns @ bent
    return total, weighted @ r, weighted @ weighted.T, change, mixed, curvature


def block_curvature(best: AbstractBRDF, data: Data, s: float) -> Float[np.ndarray, "p p"]:
    """The Hessian of ½Σ residual² of one block in natural coordinates."""
    return np.asarray(_block_curvature(best, data, np.asarray(s)))


@program
def _block_curvature(best: AbstractBRDF, data: Data, s: ArrayLike) -> Array:
    every, values = coordinates(best), vector(best)

    def cost(t: Array) -> Array:
        r = residuals(every.model(best, values, t), data, jnp.asarray(s))
        return 0.5 * jnp.vdot(r, r)

    return jax.jacfwd(jax.grad(cost))(every.natural(values))


def prior_sums(best: AbstractBRDF, data: Data, s: float) -> Sums:
    """The sums of what is known beforehand; all 0 where the prior is flat."""
    prior, nothing = data.prior, np.zeros(len(vector(best)))
    if prior is None:
        return Sums(0.0, nothing, np.diag(nothing), 0.0, nothing, 0.0)
    precision, squared = np.asarray(prior.precision), float(prior.discrepancy) ** 2
    r = precision * (coordinates(best).natural(vector(best)) - prior.mean)
    cost = 0.5 * float(r @ r + squared * s**2)
    return Sums(cost, precision * r, np.diag(precision**2), squared * s, nothing, squared)


def blocks(chunk: Measurements, noise: Noise) -> Iterator[Data]:
    """A chunk as the likelihood sees it, in blocks of `BLOCK` rows, the last one filled with rows of weight 0."""
    for first in range(0, chunk.n_samples, BLOCK):
        rows = np.arange(first, min(first + BLOCK, chunk.n_samples))
        data = prepare(chunk.rows(rows), dataclasses.replace(noise, sigma=noise.sigma[rows]), scaled=False)
        extra = ((0, BLOCK - len(data.x)), (0, 0))
        parts = (data.wi, data.wo, data.x, data.noise, data.kappa)
        yield Data(*(np.pad(part, extra, mode="edge") for part in parts), weight=np.pad(data.weight, extra))
