"""Consistency: whether measurements of one sample agree where a level, isotropic, reciprocal surface makes them equal.

It names no cause: what differs may be the sample, its mount or the instrument.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.judgement.examination.coverage import settled
from fitmat.measurements.samples import IN_PLANE, SCANNED, Measurements
from fitmat.text import brief

TOLERANCE = (np.deg2rad(0.01), np.deg2rad(0.5))
"""Two geometries count as the same within a quarter of the angular step, but not less or more than this."""

FEWEST = 4
"""Fewer pairs than this are no evidence of anything."""

MOST_ROWS = 5000
"""At most this many rows look for their partner, evenly chosen."""

MOST_AZIMUTHS = 24
"""Azimuths of incidence that are compared with the first one, evenly chosen."""

SURE = 1e-6
"""Probability below which a disagreement is not chance."""

CLEAR = 1.5
"""Mean square of the differences, in units of noise, below which a disagreement is not called one: σ is an estimate."""

CUT = 5.0
"""Differences are cut at so many standard deviations: a single bad sample must not decide."""

PRACTICAL = 0.1
"""Relative difference that counts where the noise is not known."""


@dataclasses.dataclass(frozen=True, eq=False)
class Agreement:
    """Pairs of values that should be equal.

    Attributes:
        pairs: How many, channels counted once.
        median: Median |ln(a/b)| of the pairs whose values are positive; None where there are none.
        worst: The largest.
        noise: Root mean square of a − b in units of its standard deviation, each cut at `CUT`; 1 is what noise alone
            gives. None if the noise is unknown.
        differ: Whether they differ by more than the noise.
    """

    pairs: int
    median: float | None = None
    worst: float | None = None
    noise: float | None = None
    differ: bool = False

    __repr__ = brief

    @property
    def judged(self) -> bool:
        """Whether there are enough pairs to say anything."""
        return self.pairs >= FEWEST


@dataclasses.dataclass(frozen=True, eq=False)
class Consistency:
    """The three comparisons.

    Attributes:
        reciprocity: f(ω_i, ω_o) against f(ω_o, ω_i).
        sides: Left against right of the plane of incidence.
        azimuths: One azimuth of incidence against the others, all else equal.
    """

    reciprocity: Agreement
    sides: Agreement
    azimuths: Agreement

    __repr__ = brief


def consistency(
    m: Measurements, sigma: Float[np.ndarray, "n c"], frame: Float[np.ndarray, "n 3"], *, known: bool, step: float
) -> Consistency:
    """Compare values that symmetry makes equal.

    Args:
        m: The measurements.
        sigma: Their noise in sr⁻¹, (n, c).
        frame: wo in the frame of `coverage.mirror_frame`.
        known: Whether the noise is known.
        step: Typical angular step in radians, which sets how well directions must match.
    """
    tolerance = float(np.clip(step / 4.0, *TOLERANCE))
    usable = np.flatnonzero(m.valid.any(axis=1))
    aside = usable[(np.abs(frame[:, 1]) > 2 * tolerance)[usable] & (m.theta_i[usable] > IN_PLANE)]
    with_light = np.concatenate([m.wi, frame], axis=1)
    place = np.column_stack([np.sin(m.theta_i), np.cos(m.theta_i), frame])
    sides = _agreement(m, sigma, _pairs(with_light, with_light * _FLIP, aside, aside, tolerance), known)
    azimuths = _agreement(m, sigma, _turned(m, place, usable, tolerance), known)
    exchanged = _exchanged(m, frame, usable, tolerance, isotropic=not (sides.differ or azimuths.differ))
    return Consistency(_agreement(m, sigma, exchanged, known), sides, azimuths)


_FLIP = np.array([1.0, 1.0, 1.0, 1.0, -1.0, 1.0])
# Left and right exchanged: y of the mirror frame turned round, the light where it is.


def _exchanged(m: Measurements, frame: np.ndarray, usable: np.ndarray, tolerance: float, *, isotropic: bool) -> tuple:
    """Pairs with light and sensor exchanged; on an isotropic surface up to a turn, and left for right."""
    apart = usable[np.abs(m.theta_i - m.theta_o)[usable] > 4 * tolerance]
    if not isotropic:
        light, sensor = np.concatenate([m.wi, m.wo], axis=1), np.concatenate([m.wo, m.wi], axis=1)
        return _pairs(light, sensor, usable, apart, tolerance)
    across = np.hypot(frame[:, 0], frame[:, 1])
    safe = np.where(across > 0, across, 1.0)
    cos, sin = np.where(across > 0, frame[:, 0] / safe, 1.0), np.abs(frame[:, 1]) / safe
    reach, height = np.sin(m.theta_i), np.cos(m.theta_i)
    place = np.column_stack([reach, height, across * cos, across * sin, m.wo[:, 2]])
    target = np.column_stack([across, m.wo[:, 2], reach * cos, reach * sin, height])
    return _pairs(place, target, usable, apart, tolerance)


def _pairs(place: np.ndarray, target: np.ndarray, among: np.ndarray, asking: np.ndarray, tolerance: float) -> tuple:
    """Rows a and b with b's place where a's target is, each pair once, and the distance of those places."""
    if len(among) == 0 or len(asking) == 0:
        return np.zeros(0, int), np.zeros(0, int), np.zeros(0)
    from scipy.spatial import KDTree

    asking = asking[:: -(-len(asking) // MOST_ROWS)]
    asked = KDTree(place[among]).query(target[asking], distance_upper_bound=tolerance)
    distance, found = (np.atleast_1d(part) for part in asked)
    met = np.isfinite(distance)
    a, b = asking[met], among[found[met]]
    first = np.unique(np.sort(np.stack([a, b]), axis=0), axis=1, return_index=True)[1]
    different = first[(a != b)[first]]
    return a[different], b[different], distance[met][different]


def _turned(m: Measurements, place: np.ndarray, usable: np.ndarray, tolerance: float) -> tuple:
    """Pairs of rows that differ in the azimuth of incidence only, each azimuth against the first one."""
    tilted = usable[m.theta_i[usable] > IN_PLANE]
    azimuths = settled(m.phi_i[tilted], turn=2 * np.pi)
    if not 2 <= len(azimuths) <= len(tilted) / SCANNED:  # else each row has an azimuth of its own
        return np.zeros(0, int), np.zeros(0, int), np.zeros(0)
    edges = (azimuths + np.append(azimuths[1:], azimuths[0] + 2 * np.pi)) / 2
    group = np.searchsorted(edges, m.phi_i[tilted] % (2 * np.pi)) % len(azimuths)
    first = tilted[group == 0]
    chosen = np.unique(np.linspace(1, len(azimuths) - 1, MOST_AZIMUTHS).round().astype(int))
    found = [_pairs(place, place, first, tilted[group == k], tolerance) for k in chosen]
    return tuple(np.concatenate(parts) for parts in zip(*found, strict=True))


def _agreement(m: Measurements, sigma: np.ndarray, found: tuple, known: bool) -> Agreement:
    """Judge pairs of rows, all channels together."""
    a, b, distance = found
    both = m.valid[a] & m.valid[b]
    pairs = int(both.any(axis=1).sum())
    if pairs < FEWEST:
        return Agreement(pairs)
    y, z = m.value[a], m.value[b]
    positive = both & (y > 0) & (z > 0)
    logs = np.abs(np.log(np.where(positive, y, 1.0) / np.where(positive, z, 1.0)))[positive]
    median, worst = (float(np.median(logs)), float(logs.max())) if logs.size else (None, None)
    if not known:
        return Agreement(pairs, median, worst, None, differ=median is not None and median > PRACTICAL)
    # A lobe a few steps wide changes by about its own value within a step: where directions do not quite match,
    # the mismatch over the tolerance, times the value, is added to the noise.
    slack = np.where(distance > _EXACT, distance / TOLERANCE[1], 0.0)[:, None] * np.maximum(np.abs(y), np.abs(z))
    with np.errstate(over="ignore"):
        spread = np.maximum(np.hypot(np.hypot(sigma[a], sigma[b]), slack), np.finfo(float).tiny)
        squares = np.minimum(np.abs((y - z) / spread), CUT) ** 2
    from scipy.special import chdtrc

    # Channels share what is wrong with a direction: they count as one measurement, by their mean square.
    each = both.sum(axis=1)
    square = (squares * both).sum(axis=1)[each > 0] / each[each > 0]
    differ = bool(chdtrc(pairs, square.sum()) < SURE and square.mean() > CLEAR)
    return Agreement(pairs, median, worst, float(np.sqrt(square.mean())), differ)


_EXACT = 1e-5
# Radians; directions closer than this differ by rounding only.
