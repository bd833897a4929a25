"""Propagation: the law of propagation of uncertainty (JCGM 100:2008, 5.2) through a fit, by sources.

The inputs are the readings y and what was stated before them, the centres m of the priors with precision P:
calibration, half-angles, offsets of the angles. Near the optimum t̂ moves with them by

    δt̂ = H⁻¹ Jᵀ δz(y) + H⁻¹ P δm,   H = JᵀJ + P,

z being the readings as the likelihood counts them, of unit variance. A quantity q of slopes c has the variance
cᵀ H⁻¹ c = Σ_rows (J H⁻¹ c)² + Σ_k P_k (H⁻¹ c)²_k; each row's share is divided among the noise of its value, the jitter
of its angles and the misfit, as the squares of what these add to its standard deviation. What the correlation of the
misfit adds to the covariance (`fitting.correlation`) is the misfit's too, and the readings' what their drift does. So
the parts sum to the variance.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from fitmat.fitting.likelihood import inferred_noise
from fitmat.fitting.linear import Linear
from fitmat.fitting.priors import told_of
from fitmat.fitting.result import Fit

OF_INSTRUMENT = {
    "scale": "calibration",
    "aperture": "aperture",
    "theta_i_offset": "angle offsets",
    "theta_o_offset": "angle offsets",
}
"""Parameter of an instrument → the source that its prior is."""

BOUNDS = 0.01
"""Of the precision that bounds are worth: enough to limit what readings leave open, nothing beside what they tell."""

Slopes = Float[np.ndarray, "m i"]
"""Of m quantities along the natural coordinates of the parameters that lie on no bound."""


def propagated(each: Sequence[tuple[Fit, Linear, Slopes]]) -> dict[str, Float[np.ndarray, " m"]]:
    """Source → variance of quantities that follow from one or more fits.

    Fits count as independent but for what one instrument does not know of itself.

    Args:
        each: The fits, what they are near their optimum, and the slopes of the quantities.
    """
    square, shared = {}, {}
    for fit, near, along in each:
        moves = np.linalg.solve(_information(near), along.T).T
        whole = np.sum(moves * along, axis=1)
        stated = _stated(fit, near, moves)
        for name, part in stated.items():
            shared[name] = shared.get(name, 0.0) + part
        for source, part in _readings(fit, near, along, moves, whole, stated).items():
            square[source] = square.get(source, 0.0) + part
    for name, part in shared.items():
        source = OF_INSTRUMENT[name]
        square[source] = square.get(source, 0.0) + part**2
    return square


def coefficients(fit: Fit, near: Linear, along: Slopes) -> Float[np.ndarray, "m m"]:
    """Coefficients of correlation of quantities; NaN where one does not move."""
    moves = along @ fit.correlation.stretch[np.ix_(near.inside, near.inside)]
    covariance = moves @ np.linalg.solve(_information(near), moves.T)
    scale = np.sqrt(np.diagonal(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        return covariance / np.outer(scale, scale)


def _information(near: Linear) -> Float[np.ndarray, "i i"]:
    """H, in which the bounds count by `BOUNDS`."""
    return near.known - np.diag((1.0 - BOUNDS) * near.bounded)


def _precision(fit: Fit, near: Linear) -> tuple[list[str], Float[np.ndarray, " i"]]:
    """Names of the parameters, and P."""
    names = [fit.coordinates.names[k].partition(" ")[0] for k in near.inside]
    prior = fit.data.prior
    return names, np.zeros(len(names)) if prior is None else np.asarray(prior.precision)[fit.free[near.inside]] ** 2


def _stated(fit: Fit, near: Linear, moves: Slopes) -> dict[str, Float[np.ndarray, " m"]]:
    """Parameter of the instrument → what one standard uncertainty of it moves, with its sign."""
    names, precision = _precision(fit, near)
    told = told_of(fit.measurements.instrument)
    return {name: np.sqrt(precision[k]) * moves[:, k] for k, name in enumerate(names) if name in told}


def _readings(
    fit: Fit, near: Linear, along: Slopes, moves: Slopes, whole: np.ndarray, stated: dict[str, np.ndarray]
) -> dict[str, Float[np.ndarray, " m"]]:
    """Source → variance, of all but what the instrument does not know of itself."""
    names, precision = _precision(fit, near)
    others = np.array([0.0 if name in stated else p for name, p in zip(names, precision, strict=True)])
    square = {"priors": np.sum((others + BOUNDS * near.bounded) * moves**2, axis=1)}
    told = np.maximum(whole - square["priors"] - sum(part**2 for part in stated.values()), 0.0)
    rows = np.einsum("nci,mi->mnc", near.slopes, moves) ** 2
    rows /= np.maximum(rows.sum(axis=(1, 2), keepdims=True), 1e-300)
    square |= {name: told * np.einsum("mnc,nc->m", rows, share) for name, share in _shares(fit, near).items()}
    wide = along @ fit.correlation.stretch[np.ix_(near.inside, near.inside)]
    more = np.sum(np.linalg.solve(_information(near), wide.T).T * wide, axis=1) - whole
    drift = np.minimum(more, (fit.correlation.drift - 1.0) * whole)
    square["readings"] += np.maximum(drift, 0.0)
    square["misfit"] += np.maximum(more - drift, 0.0)
    return square


def _shares(fit: Fit, near: Linear) -> dict[str, Float[np.ndarray, "n c"]]:
    """What noise, jitter and misfit are of the variance of each row; the misfit all that it adds to the noise's."""
    data = near.data
    noise = np.asarray(inferred_noise(fit.model, data) if data.loss.infers_noise else data.noise)
    spread, given = data.loss.spread, data.loss.infers_discrepancy
    whole = np.asarray(spread(data.x, noise, data.kappa, fit.discrepancy)) if given and spread else noise
    jitter = np.zeros_like(noise) if data.jitter is None else np.asarray(data.jitter)
    return {
        "readings": (noise**2 - jitter**2) / whole**2,
        "angle jitter": jitter**2 / whole**2,
        "misfit": 1.0 - (noise / whole) ** 2,
    }
