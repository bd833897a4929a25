"""Information: how sharply the data determine the parameters near an optimum, and the covariance that follows.

It finds no optimum and names no outcome.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float

from fitmat.fitting.coordinates import Coordinates, coordinates
from fitmat.fitting.left_blocks import of_few
from fitmat.fitting.likelihood import Data, Prior, misfits
from fitmat.fitting.priors import natural_sd
from fitmat.fitting.settling import Frame, Walks, settle_of
from fitmat.maths.normal import Z95
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import entries, vector
from fitmat.models.values import at

UNDETERMINED = {"log": 1.0, "linear": 0.3}
"""A parameter whose standard deviation exceeds this (in ln p, or as a fraction of its range) is not determined."""

CONTRACTED = 0.5
"""Contraction 1 − var_post/var_prior below which a parameter is not determined: its standard deviation is more than
0.7 of what it was before any datum."""

FOLLOWS, MISSES = 0.5, 2.0
"""Ratios of discrepancy to noise up to which a model follows the data, and from which it is inadequate."""


DIFFERENCE = 3e-4
"""Steps of the finite differences in standard deviations: errors of 1e-8 from curvature and from rounding."""

SIDES = (-1.0, 0.0, 1.0)
"""Where the slopes of such a difference are taken, in steps from its middle."""

Equations = Callable[[Float[np.ndarray, "m p"]], tuple[np.ndarray, np.ndarray, np.ndarray]]
"""Natural coordinates of all parameters, (m, p), to Σ residual², (m,), Jᵀr, (m, p), and JᵀJ, (m, p, p)."""


def normal_equations_of(template: AbstractBRDF, data: Data, s: float) -> Equations:
    """Σ residual², Jᵀr and JᵀJ in the natural coordinates of all parameters, the prior's rows included.

    Args:
        template: Gives shapes, bounds and static choices.
        data: The samples.
        s: Discrepancy.
    """
    size = coordinates(template).count
    none, all_ = np.zeros(size), np.full(size, np.inf)
    frame = Frame(none, -all_, all_, none + 1.0, np.eye(size), none > 0)
    settle = settle_of(template, data, s, frame)

    def at(points: Float[np.ndarray, "m p"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        found = settle(Walks.standing(points, np.zeros(len(points), int)), 1, 0)
        return found.squares[:, 0], found.slope, found.gram

    return at


def expected_information(best: AbstractBRDF, data: Data, s: float) -> Float[np.ndarray, "p p"]:
    """JᵀJ in natural coordinates."""
    return normal_equations_of(best, data, s)(coordinates(best).natural(np.asarray(vector(best)))[None])[2][0]


def observed_information(best: AbstractBRDF, data: Data, s: float, expected: np.ndarray) -> Float[np.ndarray, "p p"]:
    """The Hessian of ½Σ residual² in natural coordinates, by central differences of Jᵀr; one-sided at a bound.

    Args:
        best: Where.
        data: The samples.
        s: Discrepancy.
        expected: `expected_information` there.
    """
    every = coordinates(best)
    here, count = every.natural(vector(best)), every.count
    h, shift = difference_steps(every, expected, here)
    points = here + np.concatenate([np.diag(h * (shift + side)) for side in SIDES])
    slopes = normal_equations_of(best, data, s)(points)[1].reshape(3, count, count)
    return hessian(slopes, h, shift)


def difference_steps(
    moved: Coordinates, expected: Float[np.ndarray, "... k k"], here: Float[np.ndarray, "... k"]
) -> tuple[Float[np.ndarray, "... k"], Float[np.ndarray, "... k"]]:
    """Steps of central differences in natural coordinates, and by how many of them a bound shifts their middle.

    Args:
        moved: The k parameters.
        expected: JᵀJ of one fit, or of many.
        here: Natural coordinates.
    """
    with np.errstate(divide="ignore"):
        sd = 1.0 / np.sqrt(np.maximum(np.diagonal(expected, axis1=-2, axis2=-1), 0.0))
    h = DIFFERENCE * np.minimum(sd, moved.span)
    return h, np.where(here - h < moved.low, 1.0, np.where(here + h > moved.high, -1.0, 0.0))


def hessian(
    slopes: Float[np.ndarray, "3 ... k k"], h: Float[np.ndarray, "... k"], shift: Float[np.ndarray, "... k"]
) -> Float[np.ndarray, "... k k"]:
    """Of slopes at `SIDES` of each parameter, a row for each, and of `difference_steps`."""
    before, middle, after = slopes
    slope = (after - before) / (2.0 * h[..., None])
    bend = (after - 2.0 * middle + before) / h[..., None]
    found = slope - shift[..., None] * bend  # of the parabola through the three, at the best point
    return 0.5 * (found + found.swapaxes(-1, -2))


def information(best: AbstractBRDF, data: Data, s: float, free: np.ndarray) -> Float[np.ndarray, "p p"]:
    """The expected information where the model follows the data, else the observed one if it is positive definite.

    For a model that is right they differ by chance only. For one that is not, the residuals are large and their
    curvature counts: it may determine what the Jacobian alone does not (Efron & Hinkley 1978). Under a loss that
    shrinks residuals or infers the noise, JᵀJ is not the information at all. An objective does not say how far the
    data scatter: the mean square of its residuals does.
    """
    expected = expected_information(best, data, s)
    if data.loss.spread is None:
        return expected / _mean_square(best, data, len(free))
    if data.loss.linear and s < FOLLOWS * float(data.typical):
        return expected
    observed = observed_information(best, data, s, expected)
    return observed if is_positive(observed[np.ix_(free, free)]) else expected


def is_positive(information: Float[np.ndarray, "... k k"]) -> np.ndarray:
    """Whether information matrices are finite and, with a unit diagonal, positive definite beyond rounding."""
    finite = np.asarray(np.isfinite(information).all(axis=(-2, -1)))
    safe = np.where(finite[..., None, None], information, np.eye(information.shape[-1]))
    scale = np.sqrt(np.abs(np.diagonal(safe, axis1=-2, axis2=-1)) + 1e-300)
    return finite & (np.linalg.eigvalsh(safe / _squared(scale)).min(axis=-1, initial=1.0) > 1e-9)


def _mean_square(best: AbstractBRDF, data: Data, parameters: int) -> float:
    r = misfits(at(best, data.wi, data.wo) * data.kappa, data.noise, data, np.zeros(()))
    return max(float(np.sum(r**2)) / max(np.count_nonzero(data.weight) - parameters, 1), 1e-300)


def inverse_information(information: np.ndarray, span: np.ndarray) -> np.ndarray:
    """The inverse of information matrices, huge but finite along directions that the data do not determine.

    Args:
        information: In natural coordinates, (…, k, k).
        span: Widths of the bounds in the same coordinates, (k,); they set the scale of "huge".
    """
    scaled = np.nan_to_num(information * np.outer(span, span))
    unit = np.sqrt(np.maximum(np.diagonal(scaled, axis1=-2, axis2=-1), 1e-12))
    eigenvalues, vectors = np.linalg.eigh(scaled / _squared(unit))
    size = span / unit
    return (vectors / np.maximum(eigenvalues, 1e-14)[..., None, :]) @ vectors.swapaxes(-1, -2) * _squared(size)


def _squared(size: np.ndarray) -> np.ndarray:
    """The outer product of vectors, (…, k), with themselves."""
    return size[..., :, None] * size[..., None, :]


def limits(moved: Coordinates) -> Float[np.ndarray, " k"]:
    """Standard deviations, natural, beyond which a parameter is not determined: `UNDETERMINED`."""
    return np.where(moved.ratio, UNDETERMINED["log"], UNDETERMINED["linear"] * moved.extent)


def widest(model: AbstractBRDF, prior: Prior | None) -> Float[np.ndarray, " p"]:
    """Of all parameters: `limits`, or what `CONTRACTED` asks where that is less."""
    return np.minimum(limits(coordinates(model)), np.sqrt(1.0 - CONTRACTED) * natural_sd(model, prior))


def spreads(model: AbstractBRDF, ci95: Float[np.ndarray, "p 2"]) -> Float[np.ndarray, " p"]:
    """Standard deviations, natural, of Gaussians with these 95 % intervals, physical; NaN where there is none."""
    low, high = coordinates(model).natural(ci95.T)
    return (high - low) / (2.0 * Z95)


def wide(model: AbstractBRDF, prior: Prior | None, ci95: Float[np.ndarray, "p 2"]) -> Bool[np.ndarray, " p"]:
    """Which intervals are beyond `widest`, but for parameters of which a prior tells."""
    told = False if prior is None else np.asarray(prior.precision) > 0
    return (spreads(model, ci95) > widest(model, prior)) & ~np.asarray(told)


def unknown_spread(known: bool, count: int, parameters: int) -> float:
    """Factor of variances where the size of all scatter is inferred with the parameters, as s is; 1 where σ is known.

    As in linear regression: n/(n − p), by which s at the maximum of the likelihood is too small, and Student's
    quantile of n − p degrees of freedom for the normal's.

    Args:
        known: Whether the noise is, given or estimated from repeats and neighbours.
        count: n.
        parameters: p.
    """
    freedom = max(count - parameters, 1)
    return 1.0 if known else of_few(freedom) * count / freedom


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
    limit = limits(moved)
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
