"""Blocked: readings of 0, or of one tiny value, amid readings far above, where something stood before light or sensor.

It judges exact zeros and a smallest value that occurs several times, by their neighbours on the curve: no single small
value, and none to which a curve falls.
"""

import dataclasses

import numpy as np
from jaxtyping import Bool, Float

from fitmat.measurements.neighbours import curves, leave_one_out
from fitmat.measurements.noise import at_level, law, least_floor
from fitmat.measurements.samples import Measurements

REASON = "exactly 0 amid readings far above 0: blocked, or cut off below what the instrument tells"
EQUAL = "all of one tiny value amid readings far above it: blocked, or cut off below what the instrument tells"

FAR = 5.0
"""Standard deviations above which a reading is not 0 by chance or by rounding."""

SEVERAL = 3
"""A smallest value that occurs exactly so many times may be a limit."""

TINY = 0.1
"""Of what the curve reaches: a limit so far below it."""

PLATEAU = 0.5
"""Of the last reading, to which a curve is continued: one that falls faster may go on to any small value."""


def without_blocked(m: Measurements) -> Measurements:
    """The measurements with `blocked` values masked and counted."""
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is far above no zero
        zero = blocked(m, m.valid & (m.value == 0), 0.0)
        equal = blocked(m, _equal(m), PLATEAU)
    for reason, found in ((REASON, zero), (EQUAL, equal)):
        if found.any():
            sigma = None if m.sigma is None else np.where(found, 1.0, m.sigma)
            masked, value = {**m.masked, reason: int(found.any(axis=1).sum())}, np.where(found, 0.0, m.value)
            m = dataclasses.replace(m, value=value, valid=m.valid & ~found, sigma=sigma, masked=masked)
    return m


def _equal(m: Measurements) -> Bool[np.ndarray, "n c"]:
    """Which valid values are the smallest of their channel, where that is positive and occurs several times."""
    smallest = np.min(m.value, axis=0, where=m.valid, initial=np.inf)
    found = m.valid & (m.value == smallest) & (smallest > 0)
    return found & (found.sum(axis=0) >= SEVERAL)


def blocked(m: Measurements, dark: Bool[np.ndarray, "n c"], least: float) -> Bool[np.ndarray, "n c"]:
    """Which valid dark values cannot be readings of the curve they stand in, (n, c).

    A run of them is blocked where the curve on either side, continued to it, is far above the noise; a curve that
    falls to them, and a noise that reaches them, are left alone. So is a channel of which most is dark.

    Args:
        m: The measurements.
        dark: Values that are 0, or the smallest of their channel.
        least: Of the last reading, the share to which the curve must be continued.
    """
    found = np.zeros_like(dark)
    asked = np.flatnonzero(dark.any(axis=0) & (2 * dark.sum(axis=0) < m.valid.sum(axis=0)))
    if not len(asked):
        return found
    compared = leave_one_out(dataclasses.replace(m, valid=m.valid & ~dark))
    for k in asked:
        rows, curve, angle = curves(m, int(k))
        level = m.value[rows, k]
        reached = _reached(np.where(dark[rows, k], 0.0, level), curve, angle, least)
        if m.sigma is None:
            lit = m.value[m.valid[:, k] & ~dark[:, k], k]
            scatter = law(compared[:, :, k], lit)
            sigma = at_level(scatter[None], reached[:, None], np.abs(lit).max(keepdims=True))[:, 0]
            sigma = np.maximum(sigma, least_floor(lit))
        else:
            sigma = m.sigma[rows, k]
        far = (reached - level > FAR * sigma) & (level <= TINY * reached)
        found[rows, k] = dark[rows, k] & far
    return found


def _reached(y: Float[np.ndarray, " n"], curve: np.ndarray, x: np.ndarray, least: float) -> Float[np.ndarray, " n"]:
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
        judged = (curve[one] == curve[zeros]) & (met >= least * y[one])
        sides.append(np.where(judged, met, np.nan))
    found[zeros] = np.nan_to_num(np.fmin(*sides))
    return found
