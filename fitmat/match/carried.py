"""Carried intervals: what the posterior of a model says of the parameters with which another imitates it.

It samples nothing and imitates nothing: an imitation is where its distance has no slope, and what is known of the
imitated model moves that place in proportion.
"""

import numpy as np
from jaxtyping import Float

from fitmat.fitting.coordinates import AT_BOUND
from fitmat.match.imitation import Imitation, Target, quadrature
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF
from fitmat.models.metrics import METRICS
from fitmat.models.parameters import bounds, vector
from fitmat.models.values import values

STEP = 1e-3
"""Of the second differences, as a fraction of a parameter, or of its range where that is smaller than a tenth of it."""


def carried(found: Imitation, source: AbstractBRDF, draws: Float[np.ndarray, "m p"]) -> Float[np.ndarray, "m q"]:
    """The imitating model's parameters at each draw of the imitated one's.

    With Q(t, s) the squared distance of the imitating model at t from the imitated at s, the imitation moves by
    −(∂²Q/∂t²)⁻¹ ∂²Q/∂t∂s · (s − s₀) (implicit function theorem). A parameter on its bound stays there.

    Args:
        found: The imitation of `source`.
        source: The imitated model at s₀.
        draws: Its parameters.
    """
    source = surface(source)
    t, s = np.array(vector(found.model), float), np.array(vector(source), float)
    lower, upper = bounds(found.model)
    free = np.flatnonzero(np.minimum(t - lower, upper - t) > AT_BOUND * (upper - lower))
    moved = np.flatnonzero(np.ptp(draws, axis=0) > 0.0)
    result = np.tile(t, (len(draws), 1))
    if len(free) and len(moved):
        own, other = _curvatures(found, source, quadrature(source, found.metric, found.weight), free, moved)
        slope = -np.linalg.lstsq(own, other, rcond=1e-9)[0]
        result[:, free] += (draws[:, moved] - s[moved]) @ slope.T
    return np.clip(result, lower, upper)


def _curvatures(
    found: Imitation, source: AbstractBRDF, at: Target, free: np.ndarray, moved: np.ndarray
) -> tuple[Float[np.ndarray, "q q"], Float[np.ndarray, "q p"]]:
    """∂²Q/∂t² of the free parameters and ∂²Q/∂t∂s, by central differences."""
    transform, cosines = METRICS[found.metric].transform, (at.wi[:, 2:], at.wo[:, 2:])

    def seen(model: AbstractBRDF, points: np.ndarray) -> np.ndarray:
        return transform(values(model, points, at.wi, at.wo), *cosines) * at.root

    here, there = (_offsets(model, places) for model, places in ((found.model, free), (source, moved)))
    t, s = np.array(vector(found.model), float), np.array(vector(source), float)
    target = seen(source, s[None])[0]
    ends = [seen(found.model, t + sign * here) - target for sign in (1.0, -1.0)]  # residuals at t ± h
    middle = seen(found.model, t[None])[0] - target
    first = ((ends[0] - ends[1]) / 2.0).reshape(len(free), -1)
    own = first @ first.T + _bent(lambda points: seen(found.model, points) - target, t, here, middle, ends)
    shown = (seen(source, s + there) - seen(source, s - there)) / 2.0
    scale = here[np.arange(len(free)), free], there[np.arange(len(moved)), moved]
    other = -first @ shown.reshape(len(moved), -1).T
    return own / np.outer(scale[0], scale[0]), other / np.outer(*scale)


def _bent(seen, t: np.ndarray, here: np.ndarray, middle: np.ndarray, ends: list[np.ndarray]) -> np.ndarray:
    """Σ r ∂²r/∂t_i∂t_j h_i h_j: what the curvature of the imitating model adds where it is not the imitated one."""
    count = len(here)
    bent = np.empty((count, count))
    for i in range(count):
        bent[i, i] = np.vdot(middle, ends[0][i] + ends[1][i] - 2.0 * middle)
        if i:
            corners = [seen(t + sign * (here[i] + here[:i])) for sign in (1.0, -1.0)]
            sides = [ends[k][i] + ends[k][:i] for k in range(2)]
            second = (corners[0] + corners[1] - sides[0] - sides[1] + 2.0 * middle) / 2.0
            bent[i, :i] = bent[:i, i] = second.reshape(i, -1) @ middle.ravel()
    return bent


def _offsets(model: AbstractBRDF, places: np.ndarray) -> Float[np.ndarray, "k p"]:
    """One step a row, small enough to stay within the bounds."""
    here, (lower, upper) = np.array(vector(model), float), bounds(model)
    size = STEP * np.maximum(np.abs(here), np.minimum(0.1 * (upper - lower), 1.0))
    size = np.minimum(size, np.maximum(np.minimum(here - lower, upper - here), 0.0) / 2.0 + AT_BOUND)
    return np.diag(size)[places]
