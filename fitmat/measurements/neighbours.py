"""Neighbours: what each value would be by its repeats and by its neighbours on its curve.

They compare values with values and know no model and no noise.
"""

import numpy as np
from jaxtyping import Float

from fitmat.measurements.samples import IN_PLANE, Measurements

_DIGITS = 4
_TOGETHER = np.deg2rad(0.01)
# Angles are rounded to this to tell curves apart, so that samples closer than it are no neighbours.
_UNEVEN = 12.0
# Ratio of the gaps between five angles from which they are no curve but samples that meet by chance.
_STEEP = 4.0
# Ratio of neighbouring values from which an error of interpolation is no noise, and of what one beyond them may be.
_DIP = 1.5
# Ratio of neighbouring values from which a fall before a rise is no noise on a plateau.
_NEAR = np.array([-2, -1, 1, 2])


def curves(m: Measurements, channel: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Valid rows sorted by curve and angle: their indices, their curve's number, the angle along the curve.

    A curve has one rotation of the sample and one relative azimuth. It is taken along the sensor's angle, or, where the
    light's took more values, along that.
    """
    rows = np.flatnonzero(m.valid[:, channel])
    still, moving = m.theta_i, m.theta_o
    if len(np.unique(np.round(still[rows], _DIGITS))) > len(np.unique(np.round(moving[rows], _DIGITS))):
        still, moving = moving, still
    # About the normal every azimuth is in the plane, but only at the normal itself are all the same.
    signed = m.signed_phi
    phi = np.abs(signed)
    flat = np.minimum(phi, np.pi - phi) < IN_PLANE
    flat |= np.minimum(m.theta_i, m.theta_o) < _TOGETHER
    side = np.where(flat & (phi < np.pi / 2), -1.0, 1.0)
    # Neither another side of the plane of incidence nor another rotation of the sample is a repeat.
    across = np.where(flat, 0.0, signed)
    hundredths = np.round(100.0 * np.rad2deg(np.stack([m.rotation, still, across])[:, rows]))
    curve = np.unique(hundredths.T @ [1e10, 1e5, 1.0], return_inverse=True)[1].reshape(-1)
    angle = (side * moving)[rows]
    order = np.lexsort((angle, curve))
    return rows[order], curve[order], angle[order]


def spacing(m: Measurements) -> float:
    """Median angle between neighbours on a curve, radians; NaN where there is no curve."""
    gaps = []
    for k in range(m.valid.shape[1]):
        _, curve, angle = curves(m, k)
        apart = np.diff(angle)
        gaps.append(apart[(np.diff(curve) == 0) & (apart > _TOGETHER)])
    every = np.concatenate(gaps)
    return float(np.median(every)) if every.size else float("nan")


def leave_one_out(m: Measurements) -> Float[np.ndarray, "3 n c"]:
    """Per value: the level predicted without it, its error, and the variance of that error in units of σ².

    The level comes from two neighbours on either side by cubic interpolation in asinh(f/median), which is linear for
    the floor and logarithmic in the peak; at the end of a curve from those that are nearest. The error is that of
    repeats and of the cubic, NaN where there are neither, or where the neighbours differ so much in one rise and fall
    that the cubic's own error is no noise. The level is NaN where a curve has too few values to be one.
    """
    found = np.full((3, *m.value.shape), np.nan)
    same: dict[bytes, list[int]] = {}  # channels that are valid in the same rows have the same curves
    for k in range(m.valid.shape[1]):
        same.setdefault(m.valid[:, k].tobytes(), []).append(k)
    for alike in same.values():
        rows, curve, angle = curves(m, alike[0])
        if len(rows):
            found[:, rows[:, None], alike] = _left_out(m.value[rows[:, None], alike], curve, angle)
    return found


def _left_out(y: Float[np.ndarray, "n c"], curve: np.ndarray, x: np.ndarray) -> Float[np.ndarray, "3 n c"]:
    """`leave_one_out` of values in the order of `curves`."""
    level, error, factor = found = np.full((3, *y.shape), np.nan)
    new = np.r_[True, (np.diff(curve) != 0) | (np.diff(x) > 1e-6)]
    first, group = np.flatnonzero(new), np.cumsum(new) - 1
    count = np.diff(np.r_[first, len(y)])
    mean = np.add.reduceat(y, first, axis=0) / count[:, None]
    x, curve = x[new], curve[new]
    scale = np.median(np.abs(y), axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    logs = np.arcsinh(mean / scale)
    level[:] = scale * np.sinh(_nearest(logs, curve, x))[group]
    repeated = count[group] > 1
    level[repeated] = mean[group[repeated]]
    error[repeated] = y[repeated] - level[repeated]
    factor[repeated] = (1.0 - 1.0 / count[group[repeated]])[:, None]
    inner = _inner(curve, x)
    inner = inner[count[inner] == 1]
    near, at = inner[:, None] + _NEAR, first[inner]
    weights = _lagrange(x[near], x[inner])
    level[at] = scale * np.sinh(sum(weights[:, [k]] * logs[near[:, k]] for k in range(4)))
    error[at] = np.where(_steep(mean[near]), np.nan, mean[inner] - level[at])
    factor[at] = (1.0 + (weights**2 / count[near]).sum(axis=1))[:, None]
    return found


def _inner(curve: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Which points of curves have two neighbours on either side, at angles that do not meet by chance."""
    inner = np.arange(2, len(x) - 2)
    inner = inner[(curve[inner - 2] == curve[inner + 2])] if len(x) > 4 else inner[:0]
    gaps = np.diff(x[inner[:, None] + np.arange(-2, 3)], axis=1)
    least = gaps.min(axis=1, initial=np.inf)
    return inner[(gaps.max(axis=1, initial=0.0) <= _UNEVEN * least) & (least > _TOGETHER)]


def _steep(near: Float[np.ndarray, "n 4 c"]) -> np.ndarray:
    """Where four neighbours, all above 0, differ by more than `_STEEP` times in one rise and one fall, (n, c)."""
    lowest, highest = near.min(axis=1, initial=np.inf), near.max(axis=1, initial=0.0)
    falls, rises = near[:, 1:] * _DIP < near[:, :-1], near[:, :-1] * _DIP < near[:, 1:]
    valley = (falls[:, 0] & (rises[:, 1] | rises[:, 2])) | (falls[:, 1] & rises[:, 2])
    return (lowest > 0) & (highest > _STEEP * lowest) & ~valley


def _nearest(y: Float[np.ndarray, "n c"], curve: np.ndarray, x: np.ndarray) -> Float[np.ndarray, "n c"]:
    """Each point as a line through its two nearest shows it: between them, or beyond them at the end of a curve."""
    at = np.arange(len(x))
    near = np.clip(at[:, None] + _NEAR, 0, len(x) - 1)
    second, before, after, fourth = ((curve[near] == curve[:, None]) & (near == at[:, None] + _NEAR)).T
    between = before & after
    one = np.where(before, near[:, 1], near[:, 2])
    other = np.select([between, second, fourth], [near[:, 2], near[:, 0], near[:, 3]], one)
    gap = np.where(other == one, np.inf, x[other] - x[one])
    step = (y[other] - y[one]) * ((x - x[one]) / gap)[:, None]
    most = np.where(between, np.inf, np.log(_STEEP) / 2)[:, None]
    curved = np.bincount(curve, minlength=1)[curve] > len(_NEAR)
    return np.where(curved[:, None], y[one] + np.clip(step, -most, most), np.nan)


def _lagrange(nodes: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Weights of the cubic through four nodes (m, 4), evaluated at (m,)."""
    others = [[j for j in range(4) if j != k] for k in range(4)]
    return np.stack(
        [np.prod((at[:, None] - nodes[:, o]) / (nodes[:, [k]] - nodes[:, o]), axis=1) for k, o in enumerate(others)],
        axis=1,
    )
