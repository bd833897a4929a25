"""Linear: a fit near its optimum, residuals and their slopes, for what is propagated through it to first order.

It judges nothing; where the optimum is on a bound, that parameter is held there.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from fitmat.fitting.channelwise import layout
from fitmat.fitting.coordinates import Coordinates
from fitmat.fitting.likelihood import Data, inferred_noise, misfits
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import vector
from fitmat.models.values import values

ROWS = 4096
"""Of more rows an evenly spread part stands for all."""

MOST = 50_000_000
"""Slopes that are held; where there would be more, of hundreds of channels, fewer rows stand for all."""

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
    data = data.every(-(-len(data.x) // max(1, min(ROWS, MOST // (data.x.shape[1] * len(inside))))))
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
    """Residuals at the optimum and their slopes along natural coordinates, by central differences.

    Parameters that count in one channel each are moved together.
    """
    centre, together = np.asarray(vector(best)), _together(best, moved, inside, data.x.shape[1])
    k = len(together)
    points = around(moved, centre, inside, step, together)
    x = values(best, moved.filled(centre, points), data.wi, data.wo) * data.kappa
    noise = np.asarray(inferred_noise(best, data) if data.loss.infers_noise else data.noise)
    r = misfits(x, noise, data, np.asarray(s))
    slopes = np.zeros((*data.x.shape, len(inside)))
    for row, (members, columns) in enumerate(together):
        apart = points[row, inside[members]] - points[k + row, inside[members]]
        found = r[k + row] - r[row]
        if columns is None:
            slopes[:, :, members[0]] = found / apart
        else:
            slopes[:, columns, members] = found[:, columns] / apart
    return r[-1], slopes


Together = list[tuple[np.ndarray, np.ndarray | None]]
"""Positions among `inside`, and the channel of each; None where it counts in all."""


def _together(best: AbstractBRDF, moved: Coordinates, inside: np.ndarray, channels: int) -> Together:
    """Which parameters can be moved at once, since no channel sees more than one of them."""
    of = layout(best, moved, channels)
    if of is None:
        return [(np.array([k]), None) for k in range(len(inside))]
    at = {place: k for k, place in enumerate(inside.tolist())}
    single: Together = [(np.array([at[place]]), None) for place in of.shared if place in at]
    several = [[(at[place], channel) for channel, place in enumerate(row) if place in at] for row in of.own]
    return single + [(np.array(row)[:, 0], np.array(row)[:, 1]) for row in several if row]


def around(
    moved: Coordinates,
    centre: Float[np.ndarray, " p"],
    inside: np.ndarray,
    step: Float[np.ndarray, " i"],
    together: "Together | None" = None,
) -> Float[np.ndarray, "m k"]:
    """Natural coordinates above and below a point along each of `inside`, or of `together`, and the point itself."""
    groups = [np.array([k]) for k in range(len(inside))] if together is None else [members for members, _ in together]
    here, moves = moved.natural(centre), np.zeros((len(groups), moved.count))
    least = np.minimum(step, 0.01 * moved.span[inside])
    for row, members in zip(moves, groups, strict=True):
        row[inside[members]] = least[members]
    return np.clip(np.concatenate([here + moves, here - moves, here[None]]), moved.low, moved.high)
