"""Features of the measured curves: where they peak, how wide, and where they level off.

It fits no model; a curve is what was measured in the plane of incidence at one angle of incidence.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.judgement.examination.coverage import Incidence
from fitmat.measurements.samples import IN_PLANE, Measurements

PROMINENT = 3.0
"""A peak below this many times the curve's median over the angle is no peak."""

TOPS = (0.8, 0.5)
"""Samples above this fraction of the maximum place the peak: the first fraction that has `ENOUGH` of them."""

ENOUGH = 7
"""Samples that place a peak well."""

STEPS = 0.1
"""How well a parabola places a peak that is sampled coarsely, as a fraction of the angular step."""

FAR = np.deg2rad(25.0)
"""From this angle to the mirror direction on, a curve may have left its lobe."""

LEVEL = 2.0
"""Samples within this factor of the lowest tenth belong to the level."""

BELOW_PEAK = 10.0
"""A level must lie at least this factor below the peak."""

WIDE = np.deg2rad(30.0)
"""A level must be seen over at least this range of angles."""

DEEP = 1e5
"""A level this far below the peak is as likely the instrument's as the sample's."""


@dataclasses.dataclass(frozen=True)
class Peak:
    """The largest value of a curve.

    Attributes:
        theta_i: Incidence, radians.
        channel: Number of the channel.
        phi_i: Azimuth of incidence, radians.
        offset: Of the peak from the mirror direction, radians; positive = beyond it, towards grazing.
        error: Standard deviation of the offset.
        width: Full width at half maximum, radians; None where the curve does not fall to half on both sides.
        value: The largest value, sr⁻¹.
        resolved: Whether at least three samples lie above half the maximum.
        at_end: Whether the curve ends there, so that the true peak may lie further out.
    """

    theta_i: float
    channel: int
    phi_i: float
    offset: float
    error: float
    width: float | None
    value: float
    resolved: bool
    at_end: bool


@dataclasses.dataclass(frozen=True)
class Level:
    """A constant that a curve falls to.

    Attributes:
        theta_i: Incidence, radians.
        channel: Number of the channel.
        value: Median of the level, sr⁻¹.
        below: Peak over level.
        power: p of value ∝ cos^−p θ_o over the level: 0 for diffuse reflection, 1 for a constant detector signal.
        error: Standard deviation of p; infinite where the level spans too little to say.
    """

    theta_i: float
    channel: int
    value: float
    below: float
    power: float
    error: float

    @property
    def instrumental(self) -> bool:
        """Whether the level looks like a detector's constant signal rather than like reflection."""
        return bool(abs(self.power - 1.0) < min(0.3, 4 * self.error + 0.1) and self.power > 5 * self.error)


@dataclasses.dataclass(frozen=True)
class Tilt:
    """The lean of the sample in the plane of incidence that the peaks' offsets ask for, radians, and its sd."""

    angle: float
    error: float

    @property
    def certain(self) -> bool:
        """Whether it is not chance."""
        return abs(self.angle) > 5.0 * self.error


def in_plane_curve(
    m: Measurements, incidence: Incidence, channel: int
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"], np.ndarray]:
    """Signed theta_o (radians, sorted), values and rows of the in-plane samples at the first azimuth of incidence."""
    local = incidence.wo
    across = np.hypot(local[:, 0], local[:, 1])
    flat = np.abs(local[:, 1]) <= np.sin(IN_PLANE) * across + 1e-12
    first = incidence.phi_i[0] if len(incidence.phi_i) else 0.0
    turned = np.abs((m.phi_i[incidence.rows] - first + np.pi) % (2 * np.pi) - np.pi) < IN_PLANE
    keep = flat & turned & m.valid[incidence.rows, channel]
    angle = np.arctan2(local[keep, 0], local[keep, 2])
    order = np.argsort(angle, kind="stable")
    rows = incidence.rows[keep][order]
    return angle[order], m.value[rows, channel], rows


def peak(m: Measurements, sigma: Float[np.ndarray, "n c"], incidence: Incidence, channel: int) -> Peak | None:
    """Place the largest value of a curve by a parabola through ln f of the samples near it.

    None where the curve has no prominent peak.
    """
    angle, f, rows = in_plane_curve(m, incidence, channel)
    if len(f) < 5 or np.ptp(angle) < WIDE:
        return None
    typical = float(np.median(np.interp(np.linspace(angle[0], angle[-1], 181), angle, f)))
    if f.max() <= PROMINENT * max(typical, 0.0):
        return None
    top = int(f.argmax())
    at_end = bool(min(top, len(f) - 1 - top) < 1)
    runs = [_run(f > part * f[top], top) for part in TOPS]
    low, high = next((run for run in runs if run[1] - run[0] + 1 >= ENOUGH), runs[-1])
    resolved = high - low >= 2
    near = slice(min(low, max(top - 1, 0)), max(high, top + 1) + 1)
    used = f[near] > 0
    x, y = (angle[near] - angle[top])[used], f[near][used]
    noise = np.maximum(sigma[rows[near], channel][used] / y, 1e-6)
    step = float(np.median(np.diff(np.unique(np.round(angle[max(top - 2, 0) : top + 3], 6)))))
    at, error = (0.0, step) if at_end else _vertex(x, np.log(y), noise)
    if not x[0] <= at <= x[-1] or error > np.ptp(x):
        at, error = 0.0, float(np.ptp(x))
    return Peak(
        theta_i=incidence.theta_i,
        channel=channel,
        phi_i=float(incidence.phi_i[0]),
        offset=float(angle[top] + at - incidence.theta_i),
        error=float(np.hypot(error, STEPS * step)),
        width=_width(angle, f, top),
        value=float(f[top]),
        resolved=resolved,
        at_end=at_end,
    )


def _run(inside: np.ndarray, at: int) -> tuple[int, int]:
    """First and last index of the unbroken run of True around `at`."""
    outside = np.flatnonzero(~inside)
    before, after = outside[outside < at], outside[outside > at]
    return int(before[-1] + 1 if before.size else 0), int(after[0] - 1 if after.size else len(inside) - 1)


def _vertex(x: np.ndarray, y: np.ndarray, noise: np.ndarray) -> tuple[float, float]:
    """The vertex −b/(2a) of a weighted parabola and its sd, which covers what the parabola misses; else infinite."""
    if len(np.unique(np.round(x, 6))) < 3:
        return np.inf, np.inf
    design = np.stack([x**2, x, np.ones_like(x)], axis=1) / noise[:, None]
    solution, _, rank, _ = np.linalg.lstsq(design, y / noise, rcond=None)
    a, b, _ = solution
    if rank < 3 or a >= 0:
        return np.inf, np.inf
    misfit = np.sum((design @ solution - y / noise) ** 2) / max(len(x) - 3, 1) if len(x) > 3 else 1.0
    covariance = np.linalg.inv(design.T @ design) * max(1.0, misfit)
    slope = np.array([b / (2 * a**2), -1 / (2 * a), 0.0])
    return float(-b / (2 * a)), float(np.sqrt(slope @ covariance @ slope))


def _width(angle: np.ndarray, f: np.ndarray, top: int) -> float | None:
    """Full width at half maximum, crossings interpolated linearly in the value."""
    half, ends = f[top] / 2.0, []
    for direction in (-1, 1):
        k = top
        while 0 <= k + direction < len(f) and f[k + direction] > half:
            k += direction
        if not 0 <= k + direction < len(f):
            return None
        drop = (f[k] - half) / (f[k] - f[k + direction])
        ends.append(angle[k] + drop * (angle[k + direction] - angle[k]))
    return float(ends[1] - ends[0])


def tilt(peaks: list[Peak]) -> Tilt | None:
    """The lean that the offsets have in common: offset = 2 lean + b tanθ_i.

    The second term is what a level rough surface has: f ∝ D/cosθ_o peaks beyond the mirror direction, by α² tanθ_i for
    ln D = −θ_h²/(α²/2) (Torrance & Sparrow 1967 describe the effect). None for less than three incidences.
    """
    peaks = [p for p in peaks if not p.at_end]
    angles = np.array([p.theta_i for p in peaks])
    if len(np.unique(np.round(angles, 3))) < 3:
        return None
    error = np.array([p.error for p in peaks])
    design = np.stack([np.full(len(peaks), 2.0), np.tan(angles)], axis=1) / error[:, None]
    solution, _, rank, _ = np.linalg.lstsq(design, np.array([p.offset for p in peaks]) / error, rcond=None)
    if rank < 2:
        return None
    left = np.sum((design @ solution - np.array([p.offset for p in peaks]) / error) ** 2) / (len(peaks) - 2)
    return Tilt(float(solution[0]), float(np.sqrt(np.linalg.inv(design.T @ design)[0, 0] * max(1.0, left))))


def level(m: Measurements, sigma: Float[np.ndarray, "n c"], incidence: Incidence, channel: int) -> Level | None:
    """The constant that a curve falls to away from the mirror direction, if it does and the noise lets it be seen."""
    angle, f, rows = in_plane_curve(m, incidence, channel)
    away = np.abs(angle - incidence.theta_i) > FAR
    if away.sum() < 8:
        return None
    angle, f, noise, top = angle[away], f[away], sigma[rows[away], channel], float(f.max())
    lowest = float(np.quantile(f, 0.1))
    flat = (f > lowest / LEVEL) & (f < LEVEL * lowest)
    if lowest <= 0 or top < BELOW_PEAK * lowest or flat.sum() < max(8, len(f) // 4):
        return None
    if np.ptp(angle[flat]) < WIDE or np.median(noise[flat] / f[flat]) > 0.2:
        return None
    power, error = _power(np.cos(angle[flat]), f[flat], noise[flat] / f[flat])
    value = float(np.median(f[flat]))
    return Level(incidence.theta_i, channel, value, top / value, power, error)


def _power(cos: np.ndarray, f: np.ndarray, noise: np.ndarray) -> tuple[float, float]:
    """p of f ∝ cos^−p and its sd, which covers what the power law misses."""
    x = -np.log(cos)
    design = np.stack([x, np.ones_like(x)], axis=1) / noise[:, None]
    solution, _, rank, _ = np.linalg.lstsq(design, np.log(f) / noise, rcond=None)
    if rank < 2:
        return 0.0, float("inf")
    misfit = np.sum((design @ solution - np.log(f) / noise) ** 2) / (len(f) - 2)
    return float(solution[0]), float(np.sqrt(np.linalg.inv(design.T @ design)[0, 0] * max(1.0, misfit)))
