"""Noise of the measurements, estimated from the scatter of repeats and of neighbouring angles.

The estimate looks at the data only, never at a model.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.measurements.samples import IN_PLANE, Measurements

MIN_RESIDUALS = 12
"""Fewer neighbour comparisons than this say nothing about the noise."""

NEIGHBOURED = 0.05
"""Fraction of the samples that must have neighbours; where fewer meet on a curve, they do so by chance."""

UNKNOWN_RELATIVE = 1e-3
"""Placeholder noise where none can be estimated: small, so that the inferred discrepancy takes its place."""

UNKNOWN = (
    "Noise unknown: too few repeats or neighbouring angles, or exact copies; all scatter is counted as model misfit."
)
"""What is said where no noise can be estimated."""

COPIED = 1e-12
"""A scatter below this fraction of the maximum is that of copied rows, not of repeated measurements."""

LEAST_SIGMA = 1e-9
"""Of the largest σ: what is smaller counts as this where a law of the noise is sought."""

_DIGITS = 4
_TOGETHER = np.deg2rad(0.01)
# Angles are rounded to this to tell curves apart, so that samples closer than it are no neighbours.
_UNEVEN = 12.0
# Ratio of the gaps between five angles from which they are no curve but samples that meet by chance.
_T_DOF = 4.0
# Scale of a t distribution with 4 degrees of freedom that fits Gaussian data best: the root s of
# E[5 x²/(4 s² + x²)] = 1 for x ~ N(0, 1).
_T_SCALE = 0.8310


@dataclasses.dataclass(frozen=True)
class Noise:
    """Measurement noise σ² = a² + (b f)².

    Attributes:
        sigma: Standard deviation per sample and channel in sr⁻¹, (n, c).
        known: False where nothing could be said and `sigma` is a placeholder.
        words: One sentence for the report.
    """

    sigma: Float[np.ndarray, "n c"]
    known: bool
    words: str


def measured_noise(m: Measurements) -> Noise:
    """The given σ, or an estimate per channel from repeats and neighbouring angles.

    Neighbours: each sample is predicted from two neighbours on either side in its own curve (same incidence, same
    azimuth) by cubic interpolation in asinh(f/median), which is linear for the floor and logarithmic in the peak;
    the leave-one-out errors give a and b by a Student-t likelihood, so that a few badly predicted peak samples do
    not count. σ is evaluated at the prediction, not at the sample itself: weights that depend on the sample's own
    noise bias every fit.
    """
    if m.sigma is not None:
        return Noise(np.where(m.valid, m.sigma, 1.0), True, "Measurement noise as given in the file.")
    compared = leave_one_out(m)
    smooth = np.where(np.isfinite(compared[0]), np.abs(compared[0]), np.abs(m.value))
    tops = np.max(np.abs(m.value), axis=0, where=m.valid, initial=0.0)
    counts = np.count_nonzero(m.valid, axis=0)
    parts = zip(compared[1].T, smooth.T, compared[2].T, tops, counts, strict=True)
    laws = np.stack([law(error, level, factor, top, int(n)) for error, level, factor, top, n in parts])
    return Noise(at_level(laws, smooth, tops), bool(np.isfinite(laws).all()), law_words(laws, m.channels))


def law(error: np.ndarray, level: np.ndarray, factor: np.ndarray, top: float, count: int) -> Float[np.ndarray, " 2"]:
    """a and b of one channel from `leave_one_out`; NaN where too few values have neighbours or they are copies.

    Args:
        error: Of the prediction from neighbours, NaN where there are none, (n,).
        level: |f| there, (n,).
        factor: Variance of the error in units of σ², (n,).
        top: The largest value of the channel.
        count: How many values there are in all.
    """
    used = np.isfinite(error)
    if used.sum() < max(MIN_RESIDUALS, NEIGHBOURED * count) or np.median(np.abs(error[used])) <= COPIED * top:
        return np.full(2, np.nan)
    return np.array(components(error[used], level[used], factor[used]))


def at_level(
    laws: Float[np.ndarray, "c 2"], level: Float[np.ndarray, "n c"], tops: Float[np.ndarray, " c"]
) -> Float[np.ndarray, "n c"]:
    """σ of each value by its channel's law; a small placeholder where there is none."""
    a, b = laws.T
    little = UNKNOWN_RELATIVE * np.maximum(level, UNKNOWN_RELATIVE * np.maximum(tops, 1e-12))
    return np.where(np.isfinite(a), np.hypot(np.nan_to_num(a), np.nan_to_num(b) * level), little)


def law_words(laws: Float[np.ndarray, "c 2"], channels: tuple[str, ...]) -> str:
    """The laws of all channels in one sentence."""
    if not np.isfinite(laws).all():
        return UNKNOWN
    named = [f" ({channel})" if len(channels) > 1 else "" for channel in channels]
    parts = (f"{100 * b:.2g} % + {a:.2g} sr⁻¹{name}" for (a, b), name in zip(laws, named, strict=True))
    return f"Noise estimated from neighbouring angles: {'; '.join(parts)}."


def levels(m: Measurements) -> Float[np.ndarray, "n c"]:
    """|f| as the neighbours of each value show it, in sr⁻¹; its own size where it has none."""
    found = leave_one_out(m)[0]
    return np.where(np.isfinite(found), np.abs(found), np.abs(m.value))


def noise_law(value: Float[np.ndarray, " n"], sigma: Float[np.ndarray, " n"]) -> tuple[float, float]:
    """a (sr⁻¹) and b of σ² = a² + (b f)² by non-negative least squares on relative residuals; a is never 0."""
    from scipy.optimize import nnls

    unit = float(sigma.max())
    value, sigma = value / unit, np.maximum(sigma / unit, LEAST_SIGMA)
    squares = np.stack([np.ones_like(value), value**2], axis=1) / sigma[:, None] ** 2
    scale = np.abs(squares).max(axis=0) + 1e-300
    (a2, b2), _ = nnls(squares / scale, np.ones_like(value)) if len(value) > 1 else ((sigma[0] ** 2 * scale[0], 0.0), 0)
    lowest = 1e-3 * float(sigma.min())
    return unit * float(max(np.sqrt(a2 / scale[0]), lowest)), float(np.sqrt(b2 / scale[1]))


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


def leave_one_out(m: Measurements) -> Float[np.ndarray, "3 n c"]:
    """Per value: the level predicted without it, its error, and the variance of that error in units of σ².

    NaN where a value has neither repeats nor two neighbours on either side.
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
    repeated = count[group] > 1
    level[repeated] = mean[group[repeated]]
    error[repeated] = y[repeated] - level[repeated]
    factor[repeated] = (1.0 - 1.0 / count[group[repeated]])[:, None]
    x, curve = x[new], curve[new]
    inner = np.arange(2, len(x) - 2)
    inner = inner[(curve[inner - 2] == curve[inner + 2])] if len(x) > 4 else inner[:0]
    near = inner[:, None] + np.array([-2, -1, 1, 2])
    gaps = np.diff(x[inner[:, None] + np.arange(-2, 3)], axis=1)
    even = gaps.max(axis=1, initial=0.0) <= _UNEVEN * gaps.min(axis=1, initial=np.inf)
    even &= gaps.min(axis=1, initial=np.inf) > _TOGETHER
    even &= count[inner] == 1
    inner, near = inner[even], near[even]
    weights = _lagrange(x[near], x[inner])
    scale = np.median(np.abs(y), axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    logs = np.arcsinh(mean / scale)
    at = first[inner]
    level[at] = scale * np.sinh(sum(weights[:, [k]] * logs[near[:, k]] for k in range(4)))
    error[at] = mean[inner] - level[at]
    factor[at] = (1.0 + (weights**2 / count[near]).sum(axis=1))[:, None]
    return found


def _lagrange(nodes: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Weights of the cubic through four nodes (m, 4), evaluated at (m,)."""
    others = [[j for j in range(4) if j != k] for k in range(4)]
    return np.stack(
        [np.prod((at[:, None] - nodes[:, o]) / (nodes[:, [k]] - nodes[:, o]), axis=1) for k, o in enumerate(others)],
        axis=1,
    )


def components(error: np.ndarray, level: np.ndarray, factor: np.ndarray) -> tuple[float, float]:
    """a (sr⁻¹) and b (relative) of σ² = a² + (b f)² by maximum likelihood under a t distribution."""
    from scipy.optimize import minimize

    typical = np.median(np.abs(error)) / 0.6745 + 1e-300
    relative = np.median(np.abs(error) / np.maximum(level, 1e-300)) / 0.6745 + 1e-12

    def cost(logs: np.ndarray) -> float:
        a, b = np.exp(logs)
        scale = _T_SCALE * np.sqrt(factor) * np.hypot(a, b * level)
        t = (_T_DOF + 1.0) / 2.0 * np.log1p((error / scale) ** 2 / _T_DOF)
        return float(np.sum(t + np.log(scale)))

    starts = [np.log([typical * p, relative * q]) for p, q in ((0.7, 0.7), (0.02, 1.0), (1.0, 0.02))]
    best = min((minimize(cost, s, method="Nelder-Mead") for s in starts), key=lambda result: result.fun)
    a, b = np.exp(best.x)
    return float(a), float(b)
