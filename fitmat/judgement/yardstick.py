"""Yardstick: how much of what the readings hold any model could explain, and what share of that a fitted one does.

A Gaussian process over the geometry knows no formula of reflection: its posterior mean is what the readings themselves
say of the surface, its noise what no model can follow (Rasmussen & Williams, Gaussian Processes for Machine Learning,
2006, ch. 2). All is counted in ∛(f cosθ_i), so that the highlight and the base both matter. It fits no parameter of a
model and quotes no interval.

K is Matérn's as in `fitting.correlation`; the width w on which half vectors are told apart is the one of `WIDTHS` that
the readings make most likely.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from fitmat.fitting.process import ASKED, FEWEST, factor, sizes
from fitmat.fitting.result import Fit
from fitmat.maths.directions import zenith
from fitmat.maths.matern import matern
from fitmat.measurements.samples import Measurements
from fitmat.models.metrics import cube_root
from fitmat.models.values import at

WIDTHS = 0.02, 0.06, 0.2, 0.6
"""Angles of the half vector, radians, up to which the scale is even; it is logarithmic beyond."""

LENGTHS = 1.0, 1.0, 0.8
"""Of K, in asinh(θ_h/w) along and across the plane of incidence, and in θ_d, radians."""

MOST, CHANNELS = 300, 3
"""Rows and channels that are looked at, evenly spread."""

REPEATED = 1e-10
"""Of K's diagonal, which keeps it positive definite where a geometry occurs twice."""


class Yardstick(NamedTuple):
    """What the readings themselves say of ∛(f cosθ_i).

    Attributes:
        rows: Of the measurements, (n,).
        mean: Posterior mean, (n, c); NaN where a value is masked, or a channel tells nothing.
        variance: Posterior variance, (n, c).
    """

    rows: np.ndarray
    mean: Float[np.ndarray, "n c"]
    variance: Float[np.ndarray, "n c"]


def yardstick(m: Measurements) -> Yardstick:
    """The process that describes the readings of each channel best; NaN where none does by `ASKED` nats.

    Args:
        m: Measurements; of many rows an evenly spread part.
    """
    rows = np.flatnonzero(m.valid.any(axis=1))
    rows = rows[:: max(-(-len(rows) // MOST), 1)]
    some = m.rows(rows)
    t = cube_root(some.value * some.wi[:, 2:])
    mean, variance = np.full(t.shape, np.nan), np.full(t.shape, np.nan)
    places = [_places(some, width) for width in WIDTHS]
    looked = np.unique(np.linspace(0, t.shape[1] - 1, CHANNELS).round().astype(int))
    for k in looked:
        used = some.valid[:, k]
        if np.count_nonzero(used) >= FEWEST:
            mean[used, k], variance[used, k] = _smoothed(t[used, k], [place[used] for place in places])
    return Yardstick(rows, mean, variance)


def explained(found: Yardstick, fit: Fit) -> float | None:
    """Share of what can be explained that a fit does, 0 to 1; None where the readings do not say what that is.

    1 − Σ ((g − t)² − v)/Σ ((g − ḡ)² + v), g and v the posterior mean and variance, t = ∛(f cosθ_i) of the model: a
    right model is as far from g as g is from the truth. A constant explains nothing.
    """
    m = fit.measurements.rows(found.rows)
    known = np.isfinite(found.mean)
    if not (known.any() and fit.finite):
        return None
    t = cube_root(at(fit.model, m.wi, m.wo) * m.wi[:, 2:])
    middle = np.nanmean(np.where(known, found.mean, np.nan)[:, known.any(axis=0)], axis=0)
    centre = np.zeros(found.mean.shape[1])
    centre[known.any(axis=0)] = middle
    left = float(np.sum((found.mean - t) ** 2 - found.variance, where=known))
    whole = float(np.sum((found.mean - centre) ** 2 + found.variance, where=known))
    return float(np.clip(1.0 - left / whole, 0.0, 1.0)) if whole > 0 and np.isfinite(left) else None


def _smoothed(t: Float[np.ndarray, " n"], places: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance by the likeliest of the kernels: chosen with few columns of K, then by all of it."""
    one, every = np.full((len(t), 1), len(t) ** -0.5), np.ones(len(t), bool)
    gains = [sizes(t, one, [factor(place, every)]).gain for place in places]
    near = places[int(np.argmax(gains))]
    k = matern(np.linalg.norm(near[:, None] - near, axis=2))
    root = np.linalg.cholesky(k + REPEATED * np.eye(len(t)))
    found = sizes(t, one, [root])
    if max(gains) < ASKED or not found.process[0] > 0:
        return np.full(len(t), np.nan), np.full(len(t), np.nan)
    level, process = float(t.mean()), float(found.process[0])
    known = np.linalg.solve(k + max(found.white / process, REPEATED) * np.eye(len(t)), np.column_stack([k, t - level]))
    return level + k @ known[:, -1], process * (1.0 - np.sum(k * known[:, :-1].T, axis=1))


def _places(m: Measurements, width: float) -> Float[np.ndarray, "n 3"]:
    """Half vector and difference angle, in lengths of K."""
    h = m.wi + m.wo
    h = h / np.linalg.norm(h, axis=1, keepdims=True)
    far = np.arcsinh(zenith(h) / width)
    turn = np.arctan2(h[:, 1], h[:, 0]) - np.arctan2(m.wi[:, 1], m.wi[:, 0])
    theta_d = np.arccos(np.clip(np.sum(m.wi * h, axis=1), -1.0, 1.0))
    return np.stack([far * np.cos(turn), far * np.sin(turn), theta_d], axis=1) / LENGTHS
