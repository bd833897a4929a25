"""Blocked: readings of exactly 0 amid readings far above 0, where something stood before the light or the sensor.

It judges exact zeros only, by their neighbours on the curve: no small value, and no zero to which a curve falls.
"""

import dataclasses

import numpy as np
from jaxtyping import Bool, Float

from fitmat.measurements.neighbours import curves, leave_one_out
from fitmat.measurements.noise import at_level, law, least_floor
from fitmat.measurements.samples import Measurements

REASON = "exactly 0 amid readings far above 0: blocked, or cut off below what the instrument tells"

FAR = 5.0
"""Standard deviations above which a reading is not 0 by chance or by rounding."""


def without_blocked(m: Measurements) -> Measurements:
    """The measurements with `blocked` values masked and counted."""
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is far above no zero
        found = blocked(m)
    if not found.any():
        return m
    sigma = None if m.sigma is None else np.where(found, 1.0, m.sigma)
    masked = {**m.masked, REASON: int(found.any(axis=1).sum())}
    return dataclasses.replace(m, valid=m.valid & ~found, sigma=sigma, masked=masked)


def blocked(m: Measurements) -> Bool[np.ndarray, "n c"]:
    """Which valid zeros cannot be readings of the curve they stand in, (n, c).

    A run of zeros is blocked where the curve on either side, continued to it, is far above the noise; a curve that
    falls to 0, and a noise that reaches it, are left alone. So is a channel of which most is 0.
    """
    zero = m.valid & (m.value == 0)
    found = np.zeros_like(zero)
    asked = np.flatnonzero(zero.any(axis=0) & (2 * zero.sum(axis=0) < m.valid.sum(axis=0)))
    if not len(asked):
        return found
    compared = leave_one_out(dataclasses.replace(m, valid=m.valid & ~zero))
    for k in asked:
        rows, curve, angle = curves(m, int(k))
        reached = _reached(m.value[rows, k], curve, angle)
        if m.sigma is None:
            lit = m.value[m.valid[:, k] & ~zero[:, k], k]
            scatter = law(compared[:, :, k], lit)
            sigma = at_level(scatter[None], reached[:, None], np.abs(lit).max(keepdims=True))[:, 0]
            sigma = np.maximum(sigma, least_floor(lit))
        else:
            sigma = m.sigma[rows, k]
        found[rows, k] = zero[rows, k] & (reached > FAR * sigma)
    return found


def _reached(y: Float[np.ndarray, " n"], curve: np.ndarray, x: np.ndarray) -> Float[np.ndarray, " n"]:
    """What the readings on either side of a run of zeros come to at its ends, the lesser of both; 0 elsewhere."""
    lit, zeros = np.flatnonzero(y != 0), np.flatnonzero(y == 0)
    after = np.searchsorted(lit, zeros)
    padded = np.r_[[-1, -1], lit, [-1, -1]]  # the last row stands for none; its curve is none of those asked
    found = np.zeros_like(y)
    curve, x, y = np.append(curve, -1), np.append(x, 0.0), np.append(y, 0.0)
    sides = []
    for one, other, towards in ((padded[after + 1], padded[after], 1), (padded[after + 2], padded[after + 3], -1)):
        second = curve[other] == curve[zeros]
        gap = np.where(second & (x[other] != x[one]), x[one] - x[other], np.inf)
        way = (x[np.clip(one + towards, 0, len(x) - 1)] - x[one]) / gap
        with np.errstate(over="ignore"):  # of two readings that rise the nearer one counts
            rise = np.where(y[other] > 0, np.maximum(y[one], 0.0) / np.where(y[other] > 0, y[other], 1.0), 1.0)
            line, power = y[one] + (y[one] - y[other]) * way, y[one] * np.minimum(rise, 1.0) ** way
        met = np.maximum(np.minimum(np.minimum(line, power), y[one]), 0.0)
        sides.append(np.where(curve[one] == curve[zeros], met, np.nan))
    found[zeros] = np.nan_to_num(np.fmin(*sides))
    return found
