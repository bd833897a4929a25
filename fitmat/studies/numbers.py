"""Numbers as a page draws them: few digits, few points, and no more of either than an eye can see.

It knows no study.
"""

import itertools
from typing import Any

import numpy as np
from jaxtyping import ArrayLike, Float

DIGITS = 5
"""Significant digits of what is drawn: a screen has four."""

STEPS = 9999
"""Steps between the least and the largest of what is quantised."""

NEAR, NEAR_RATIO = 2e-3, 1e-2
"""Between points that are kept a curve may be off by this part of its range in the cube root, and by this ratio."""

_EVERY, _ROUNDS = 12, 8
# The points to begin with, and how often those are added that the others miss.


def short(values: ArrayLike | list[float], digits: int = DIGITS) -> Any:
    """Lists of numbers of `digits` significant digits, in the shape of the array; None for what is not finite."""
    array = np.asarray(values, float)
    if array.ndim:
        return [short(row, digits) for row in array]
    return float(f"{array:.{digits}g}") if np.isfinite(array) else None


def needed(x: Float[np.ndarray, " n"], y: Float[np.ndarray, "n c"]) -> np.ndarray:
    """Which points of curves over x are needed to draw straight lines between them, indices, rising."""
    bent = np.concatenate([np.cbrt(y), np.log(np.maximum(np.abs(y), 1e-12))], axis=1)
    near = np.r_[NEAR * np.maximum(np.ptp(bent[:, : y.shape[1]], axis=0), 1e-12), np.full(y.shape[1], NEAR_RATIO)]
    kept = np.zeros(len(x), bool)
    kept[::_EVERY] = kept[-1] = True
    for _ in range(_ROUNDS):
        places = np.flatnonzero(kept)
        drawn = np.stack([np.interp(x, x[places], column[places]) for column in bent.T], axis=1)
        off = np.nan_to_num(np.abs(drawn - bent) / near, nan=0.0).max(axis=1)
        if not (off > 1.0).any():
            break
        for first, last in itertools.pairwise(places):
            if last > first + 1 and off[first + 1 : last].max() > 1.0:
                kept[first + 1 + int(off[first + 1 : last].argmax())] = True
    return np.flatnonzero(kept)


def quantised(values: Float[np.ndarray, "m k"]) -> dict[str, Any]:
    """Columns as whole numbers: value = low + step · number; a constant column has step 0."""
    low, high = values.min(axis=0), values.max(axis=0)
    step = (high - low) / STEPS
    whole = np.round((values - low) / np.where(step > 0, step, 1.0)).astype(int)
    return {"low": short(low, 8), "step": short(step, 8), "values": [column.tolist() for column in whole.T]}
