"""Linear: a fit near its optimum, residuals and their slopes, for what is propagated through it to first order.

It judges nothing; where the optimum is on a bound, that parameter is held there.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from fitmat.fitting.coordinates import Coordinates
from fitmat.fitting.likelihood import Data, inferred_noise, misfits
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import vector
from fitmat.models.values import values

ROWS = 4096
"""Of more rows an evenly spread part stands for all."""

STEP = 1e-3
"""Of the differences that give the slopes, in standard deviations."""


class Linear(NamedTuple):
    """A fit near its optimum, in natural coordinates of the i parameters that lie on no bound.

    Attributes:
        data: The n rows.
        inside: Which of the fitted parameters these are, by position, (i,).
        bounded: 12/range² of each parameter whose prior is flat, the precision that its bounds are worth, (i,); else 0.
        known: H, the information of all values, with that of the bounds, (i, i).
        factor: Its Cholesky factor.
        r: Residuals as the likelihood counts them, (n, c).
        slopes: −∂r/∂t, (n, c, i); 0 where masked.
        used: Which values are fitted, (n, c).
        more: How many values were fitted for each of these.
    """

    data: Data
    inside: np.ndarray
    bounded: Float[np.ndarray, " i"]
    known: Float[np.ndarray, "i i"]
    factor: Float[np.ndarray, "i i"]
    r: Float[np.ndarray, "n c"]
    slopes: Float[np.ndarray, "n c i"]
    used: Bool[np.ndarray, "n c"]
    more: float


def linearise(
    best: AbstractBRDF, data: Data, s: float, moved: Coordinates, information: Float[np.ndarray, "p p"], count: int
) -> Linear | None:
    """A fit near its optimum; None under an objective, where nothing is finite, and where all sits on bounds.

    Args:
        best: The model at the optimum.
        data: The samples; of a large file a part.
        s: Discrepancy.
        moved: The parameters that were fitted.
        information: Of the natural coordinates of all parameters, all values counted, (p, p).
        count: Values that were fitted, of which `data` may hold a part.
    """
    centre = np.asarray(vector(best))
    if not (data.loss.posterior and np.isfinite(information).all() and np.isfinite(centre).all()):
        return None
    inside = np.flatnonzero(moved.side(centre) == 0)
    if not len(inside):
        return None
    bounded = np.where(data.told(moved.index[inside]), 0.0, 12.0 / moved.extent[inside] ** 2)
    known, h = _known(information[np.ix_(*2 * (moved.index[inside],))], bounded)
    data = data.every(-(-len(data.x) // ROWS))
    r, slopes = _linearised(best, data, s, moved, inside, STEP / np.sqrt(np.diagonal(known)))
    used = np.asarray(data.weight) > 0
    slopes = np.where(used[:, :, None], slopes, 0.0)
    return Linear(data, inside, bounded, known, h, r, slopes, used, count / max(np.count_nonzero(used), 1))


def _known(
    information: Float[np.ndarray, "i i"], bounded: Float[np.ndarray, " i"]
) -> tuple[Float[np.ndarray, "i i"], Float[np.ndarray, "i i"]]:
    """H and its Cholesky factor."""
    known = information + np.diag(bounded)
    unit = np.sqrt(np.abs(np.diagonal(known)))
    w, v = np.linalg.eigh(known / np.outer(unit, unit))
    known = (v * np.maximum(w, 1e-12)) @ v.T * np.outer(unit, unit)
    return known, unit[:, None] * np.linalg.cholesky(known / np.outer(unit, unit))


def _linearised(
    best: AbstractBRDF, data: Data, s: float, moved: Coordinates, inside: np.ndarray, step: np.ndarray
) -> tuple[Float[np.ndarray, "n c"], Float[np.ndarray, "n c i"]]:
    """Residuals at the optimum and their slopes along natural coordinates, by central differences."""
    centre, k = np.asarray(vector(best)), len(inside)
    points = around(moved, centre, inside, step)
    x = values(best, moved.filled(centre, points), data.wi, data.wo) * data.kappa
    noise = np.asarray(inferred_noise(best, data) if data.loss.infers_noise else data.noise)
    r = misfits(x, noise, data, np.asarray(s))
    apart = points[np.arange(k), inside] - points[np.arange(k, 2 * k), inside]
    return r[-1], np.moveaxis((r[k : 2 * k] - r[:k]) / apart[:, None, None], 0, -1)


def around(
    moved: Coordinates, centre: Float[np.ndarray, " p"], inside: np.ndarray, step: Float[np.ndarray, " i"]
) -> Float[np.ndarray, "m k"]:
    """Natural coordinates above and below a point along each of `inside`, and the point: 2 i + 1 rows."""
    here, moves = moved.natural(centre), np.zeros((len(inside), moved.count))
    moves[np.arange(len(inside)), inside] = np.minimum(step, 0.01 * moved.span[inside])
    return np.clip(np.concatenate([here + moves, here - moves, here[None]]), moved.low, moved.high)
