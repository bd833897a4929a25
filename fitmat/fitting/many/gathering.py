"""Gathering: values from shared directions as the samples of many fits, as `likelihood.prepare` has it for one fit.

Noise that is not given is not looked for: all scatter then counts as the model's misfit.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from fitmat.fitting.discrepancy import first_scales, noise_scales
from fitmat.fitting.losses import Loss
from fitmat.fitting.many.lanes import Samples, Shared
from fitmat.measurements.noise import at_level
from fitmat.measurements.samples import Measurements
from fitmat.models.base import padded_length

UP = np.array([0.0, 0.0, 1.0])


def padded(w: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "m 3"]:
    """Directions with the normal at their end, so that numbers of samples that are close share a program."""
    return np.concatenate([w, np.tile(UP, (padded_length(len(w)) - len(w), 1))])


def gathered(
    shared: Shared, value: Float[np.ndarray, "T n c"], sigma: Float[np.ndarray, "T n c"] | None, count: int
) -> Samples:
    """The samples of some surfaces; rows of weight 0 fill up the directions, and surfaces without samples to `count`.

    Args:
        shared: The model and the directions, m.
        value: f in sr⁻¹; what is not finite is masked.
        sigma: Standard deviation of its noise; None where unknown.
        count: How many surfaces to return.
    """
    rows = value.shape[1]
    wi, wo = shared.wi[:rows], shared.wo[:rows]
    valid = np.isfinite(value) & ((wi[:, 2] > 0) & (wo[:, 2] > 0))[:, None]
    if sigma is not None:
        valid &= np.isfinite(sigma) & (sigma > 0)
    value = np.where(valid, value, 0.0)
    valid &= _usable(shared.loss, wi, wo, value, valid)
    if sigma is None:
        tops = np.max(np.abs(value), axis=1, keepdims=True)
        sigma = at_level(np.full((value.shape[2], 2), np.nan), np.abs(value), tops)
    kappa = wi[:, 2:]
    x, noise = value * kappa, np.where(valid, sigma, 1.0) * kappa
    rows = len(shared.wi)
    x, noise = _filled(x, 0.0, count, rows), _filled(noise, 1.0, count, rows)
    weight = _filled(valid.astype(float), 0.0, count, rows)
    return Samples(x, noise, weight, _typical(x, noise, weight) if shared.loss.posterior else np.ones(count))


def counted(samples: Samples) -> Int[np.ndarray, " T"]:
    """How many values of every surface are fitted."""
    return np.asarray(np.count_nonzero(np.asarray(samples.weight), axis=(1, 2)))


def first_discrepancies(samples: Samples) -> Float[np.ndarray, " T"]:
    """`discrepancy.first_discrepancy` of every surface; 1 where nothing is valid, or all is 0."""
    found = _median(first_scales(samples.x), samples.weight)
    return np.where(found > 0.0, found, 1.0)


def _usable(
    loss: Loss, wi: np.ndarray, wo: np.ndarray, value: Float[np.ndarray, "T n c"], valid: np.ndarray
) -> Bool[np.ndarray, "T n c"]:
    """To which values the loss can be applied."""
    if loss.usable is None:
        return np.ones(value.shape, bool)
    rows, shape = len(wi), value.shape
    columns = [np.moveaxis(part, 0, 1).reshape(rows, -1) for part in (value, valid)]
    many = Measurements(wi, wo, columns[0], None, columns[1], tuple(map(str, range(columns[0].shape[1]))))
    return np.moveaxis(loss.usable(many).reshape(rows, shape[0], shape[2]), 0, 1)


def _filled(part: Float[np.ndarray, "T n c"], fill: float, surfaces: int, rows: int) -> Float[np.ndarray, "S m c"]:
    found = np.full((surfaces, rows, part.shape[2]), fill)
    found[: len(part), : part.shape[1]] = part
    return found


def _typical(x: np.ndarray, noise: np.ndarray, weight: np.ndarray) -> Float[np.ndarray, " T"]:
    """`discrepancy.noise_scale` of every surface; 1 where nothing is valid."""
    found = _median(noise_scales(x, noise), weight)
    return np.where(np.isfinite(found), found, 1.0)


def _median(part: np.ndarray, weight: np.ndarray) -> Float[np.ndarray, " T"]:
    """Over the valid samples of each surface; NaN where there is none."""
    every, counts = part.reshape(len(part), -1), np.count_nonzero(weight, axis=(1, 2))
    ordered = np.sort(np.where(weight.reshape(len(part), -1) > 0, every, np.inf), axis=1)
    rows = np.arange(len(part))
    middle = 0.5 * (
        ordered[rows, np.maximum(counts - 1, 0) // 2] + ordered[rows, np.minimum(counts // 2, every.shape[1] - 1)]
    )
    return np.where(counts > 0, middle, np.nan)
