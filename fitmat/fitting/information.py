"""Information: how sharply the data determine the parameters near an optimum, and the covariance that follows.

It finds no optimum and names no outcome.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat.fitting.coordinates import Coordinates, coordinates
from fitmat.fitting.likelihood import Data, every_residual, noise_scale, residuals
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import entries, vector

UNDETERMINED = {"log": 1.0, "linear": 0.3}
"""A parameter whose standard deviation exceeds this (in ln p, or as a fraction of its range) is not determined."""

FOLLOWS, MISSES = 0.5, 2.0
"""Ratios of discrepancy to noise up to which a model follows the data, and from which it is inadequate."""


def _cost_terms(best: AbstractBRDF, data: Data, s: Array) -> tuple[Callable[[Array], Array], Array]:
    """The residuals as a function of the natural coordinates, and those of `best`."""
    every, values = coordinates(best), vector(best)
    return lambda t: every_residual(every.model(best, values, t), data, s), every.natural(values)


@eqx.filter_jit
def expected_information(best: AbstractBRDF, data: Data, s: Array) -> Array:
    """JᵀJ in natural coordinates, (p, p)."""
    residual, at = _cost_terms(best, data, s)
    jacobian = jax.jacfwd(residual)(at)
    return jacobian.T @ jacobian


@eqx.filter_jit
def observed_information(best: AbstractBRDF, data: Data, s: Array) -> Array:
    """The Hessian of ½Σ residual² in natural coordinates, (p, p); compiles three times as long as JᵀJ."""
    residual, at = _cost_terms(best, data, s)
    return jax.jacfwd(jax.jacfwd(lambda t: 0.5 * jnp.sum(residual(t) ** 2)))(at)


def information(best: AbstractBRDF, data: Data, s: float, free: np.ndarray) -> Float[np.ndarray, "p p"]:
    """The expected information where the model follows the data, else the observed one if it is positive definite.

    For a model that is right they differ by chance only. For one that is not, the residuals are large and their
    curvature counts: it may determine what the Jacobian alone does not (Efron & Hinkley 1978). Under a loss that
    shrinks residuals or infers the noise, JᵀJ is not the information at all. An objective does not say how far the
    data scatter: the mean square of its residuals does.
    """
    expected = np.asarray(expected_information(best, data, jnp.asarray(s)))
    if data.loss.spread is None:
        return expected / _mean_square(best, data, len(free))
    if data.loss.linear and s < FOLLOWS * float(noise_scale(data)):
        return expected
    observed = np.asarray(observed_information(best, data, jnp.asarray(s)))
    return observed if is_positive(observed[np.ix_(free, free)]) else expected


def is_positive(information: np.ndarray) -> bool:
    """Whether an information matrix is finite and, with a unit diagonal, positive definite beyond rounding."""
    scale = np.sqrt(np.abs(np.diagonal(information)) + 1e-300)
    if not np.isfinite(information).all():
        return False
    return bool(np.linalg.eigvalsh(information / np.outer(scale, scale)).min(initial=1.0) > 1e-9)


def _mean_square(best: AbstractBRDF, data: Data, parameters: int) -> float:
    r = np.asarray(_residuals(best, data, jnp.zeros(())))
    return max(float(np.sum(r**2)) / max(np.count_nonzero(data.weight) - parameters, 1), 1e-300)


_residuals = eqx.filter_jit(residuals)


def inverse_information(information: np.ndarray, span: np.ndarray) -> np.ndarray:
    """The inverse of an information matrix, huge but finite along directions that the data do not determine.

    Args:
        information: In natural coordinates, (k, k).
        span: Widths of the bounds in the same coordinates, (k,); they set the scale of "huge".
    """
    scaled = np.nan_to_num(information * np.outer(span, span))
    unit = np.sqrt(np.maximum(np.diagonal(scaled), 1e-12))
    eigenvalues, vectors = np.linalg.eigh(scaled / np.outer(unit, unit))
    size = span / unit
    return (vectors / np.maximum(eigenvalues, 1e-14)) @ vectors.T * np.outer(size, size)


def covariance(
    best: AbstractBRDF, information: np.ndarray, moved: Coordinates, told: np.ndarray
) -> tuple[Float[np.ndarray, "p p"], tuple[str, ...]]:
    """The covariance in physical parameters, and what is not determined.

    What is determined is judged with every fitted parameter released, those on a bound as well: a fit that slid along a
    degenerate direction until it met a bound knows no more for that. Only where all are determined are the parameters
    on a bound held there. Parameters of which a prior tells (`told`, one for each fitted) count as known in the
    judgement.
    """
    values, free, span = np.asarray(vector(best)), moved.index, moved.span
    known = information[np.ix_(free, free)]
    released = inverse_information(known, span)
    limit = np.where(moved.ratio, UNDETERMINED["log"], UNDETERMINED["linear"] * span)
    apart = released if not told.any() else inverse_information(known[np.ix_(~told, ~told)], span[~told])
    loose = set(free[~told][~(np.sqrt(np.diagonal(apart)) <= limit[~told])])
    inside = moved.side(values) == 0
    if loose:
        natural = released[np.ix_(inside, inside)]
    else:
        natural = inverse_information(known[np.ix_(inside, inside)], span[inside])
    slope = moved.slope(values)[inside]
    covariance = np.zeros((len(values), len(values)))
    covariance[np.ix_(free[inside], free[inside])] = natural * np.outer(slope, slope)
    covariance[free[~inside], :] = covariance[:, free[~inside]] = np.nan
    names = tuple(e.name for e in entries(best) if loose & set(range(e.place.start, e.place.stop)))
    return covariance, names
