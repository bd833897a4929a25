"""Implied albedo: the fraction of the light that the measured values themselves add up to, without any model.

What it takes of directions beyond all samples is in the error as a whole.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from fitmat.judgement.examination.coverage import SAME, Incidence
from fitmat.measurements.samples import IN_PLANE, Measurements
from fitmat.text import brief

AZIMUTHS = 3
"""Of samples at fewer relative azimuths, left and right taken as alike, the curve in the plane tells more."""

ENOUGH = 0.3
"""Share of the projected hemisphere between samples from which they are added up without an assumption."""

OUTSIDE = 2000
"""Directions, even in projected solid angle, at which the part of the hemisphere beyond all samples is looked at."""

FEWEST = 5
"""A curve of fewer samples is not added up."""

PARTS = 4
"""Each side of a triangle, and twice this each interval of a curve, is divided into so many parts."""

CERTAIN = 2.0
"""An albedo is called larger than 1, or another than the file says, if it is so by this many times its uncertainty."""


class Rule(NamedTuple):
    """Σ weight g(corners, shares) ≈ ∫ f cosθ_o dω_o, with g interpolated between samples.

    Attributes:
        corners: Samples between which each node lies, (q, k).
        shares: Their barycentric weights, (q, k).
        weight: Projected solid angle of each node, (q,).
        covered: Share of the whole projected hemisphere that lies between samples.
        beyond: Which nodes lie beyond all samples and have the value of the nearest, (q,).
    """

    corners: Int[np.ndarray, "q k"]
    shares: Float[np.ndarray, "q k"]
    weight: Float[np.ndarray, " q"]
    covered: float
    beyond: Bool[np.ndarray, " q"]


@dataclasses.dataclass(frozen=True, eq=False)
class ImpliedAlbedo:
    """What the samples of one incidence add up to.

    Attributes:
        theta_i: Incidence, radians.
        value: Per channel, (c,); NaN where a channel has too few samples.
        error: Its uncertainty: the difference of two interpolations, the noise, and all that is taken of directions
            beyond the samples, (c,).
        covered: Share of the projected hemisphere between samples.
        assumed: Whether the lobe was taken to be round about the mirror direction, and the rest to be dark.
        stated: What the file itself says of it, the mean over its rotations, (c,); NaN where it says nothing.
    """

    theta_i: float
    value: Float[np.ndarray, " c"]
    error: Float[np.ndarray, " c"]
    covered: float
    assumed: bool
    stated: Float[np.ndarray, " c"]

    __repr__ = brief

    @property
    def too_large(self) -> np.ndarray:
        """Which channels reflect more than they receive, (c,)."""
        return np.nan_to_num(self.value - CERTAIN * self.error) > 1.0

    @property
    def contradicted(self) -> np.ndarray:
        """Of which channels the file says another sum than theirs, (c,)."""
        return np.abs(self.value - self.stated) > CERTAIN * self.error


def implied_albedo(m: Measurements, sigma: Float[np.ndarray, "n c"], incidence: Incidence) -> ImpliedAlbedo | None:
    """Add up the samples of one incidence; None where they are too few to say anything.

    ∫ f cosθ_o dω_o is ∫ f dx dy over the unit disc of (x, y) = sinθ_o (cosφ, sinφ). Where samples at `AZIMUTHS` or more
    surround at least `ENOUGH` of it, f is interpolated over a Delaunay triangulation, left and right taken as alike,
    and beyond it is that of the nearest sample. Else the in-plane curve is turned about the mirror direction: f depends
    on the distance from it in (x, y) only (the shift invariance of Harvey 1976, which a microfacet lobe keeps to first
    order in its width), the mean of the curve's two sides; where one side ends the other stands in for it, and where
    both have ended nothing is added.

    Values are interpolated in asinh(f/median), which is linear for the floor and logarithmic in the peak; the
    distance to linear interpolation is the uncertainty, because the two differ where a lobe is not resolved.

    Args:
        m: The measurements.
        sigma: Noise in sr⁻¹, (n, c).
        incidence: One of their incidences.
    """
    channels = m.value.shape[1]
    value, error, best = np.full(channels, np.nan), np.full(channels, np.nan), None
    usable = m.valid[incidence.rows]
    for pattern in np.unique(usable, axis=1).T:
        rule = _rule(incidence, pattern)
        if rule is None:
            continue
        same = np.flatnonzero((usable == pattern[:, None]).all(axis=0))
        rows = incidence.rows[pattern]
        value[same], error[same] = _added(rule[0], m.value[np.ix_(rows, same)], sigma[np.ix_(rows, same)])
        if best is None or rule[0].covered > best[0].covered:
            best = rule
    stated = _stated(m, incidence.theta_i)
    return best and ImpliedAlbedo(incidence.theta_i, value, error, best[0].covered, best[1], stated)


def _stated(m: Measurements, theta_i: float) -> Float[np.ndarray, " c"]:
    """What the file says of an incidence, per channel, the mean over the azimuths of the light."""
    said = {
        name: [s.value for s in m.stated if s.channel == name and abs(s.theta_i - theta_i) < SAME]
        for name in m.channels
    }
    return np.array([np.mean(values) if values else np.nan for values in said.values()])


def _rule(incidence: Incidence, usable: np.ndarray) -> tuple[Rule, bool] | None:
    local = incidence.wo[usable]
    full = _triangles(local) if incidence.azimuths >= AZIMUTHS else None
    if full is not None and full.covered >= ENOUGH:
        return full, False
    turned = _turned(local, np.sin(incidence.theta_i))
    return None if turned is None else (turned, True)


def _added(rule: Rule, f: np.ndarray, sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The integral and its uncertainty, per channel."""
    scale = np.median(np.abs(f), axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    value, linear, beyond = np.zeros((3, f.shape[1]))
    curved = np.arcsinh(f / scale)
    for k in range(f.shape[1]):
        each = scale[k] * rule.weight * np.sinh((curved[rule.corners, k] * rule.shares).sum(axis=1))
        value[k], beyond[k] = each.sum(), each[rule.beyond].sum()
        linear[k] = rule.weight @ (f[rule.corners, k] * rule.shares).sum(axis=1)
    share = np.bincount(rule.corners.ravel(), (rule.weight[:, None] * rule.shares).ravel(), minlength=len(f))
    return value, np.sqrt((linear - value) ** 2 + share**2 @ sigma**2 + beyond**2)


def _triangles(local: np.ndarray) -> Rule | None:
    """A rule over the whole disc from scattered samples and their mirror images; None in one plane."""
    folded = np.round(np.stack([local[:, 0], np.abs(local[:, 1])], axis=1), 4)
    points, first = np.unique(folded, axis=0, return_index=True)
    aside = points[:, 1] > 0
    if aside.sum() < 2 or len(points) < FEWEST:
        return None
    both = np.concatenate([points, points[aside] * [1.0, -1.0]])
    sample = np.concatenate([first, first[aside]])
    from scipy.spatial import Delaunay, KDTree, QhullError

    try:
        mesh = Delaunay(both)
    except QhullError:
        return None
    a, b, c = (both[mesh.simplices[:, k]] for k in range(3))
    area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2.0
    centres = _centres()
    inside, count = len(area) * len(centres), np.arange(OUTSIDE) + 0.5
    disc = np.sqrt(count / OUTSIDE)[:, None] * np.column_stack(
        [f(np.pi * (1 + 5**0.5) * count) for f in (np.cos, np.sin)]
    )
    disc = disc[mesh.find_simplex(disc) < 0]
    nearest = sample[KDTree(both).query(disc)[1]]
    rest = max(np.pi - area.sum(), 0.0) / max(len(disc), 1)
    return Rule(
        np.concatenate(
            [np.repeat(sample[mesh.simplices], len(centres), axis=0), np.repeat(nearest[:, None], 3, axis=1)]
        ),
        np.concatenate([np.tile(centres, (len(area), 1)), np.tile([1.0, 0.0, 0.0], (len(disc), 1))]),
        np.concatenate([np.repeat(area / len(centres), len(centres)), np.full(len(disc), rest)]),
        float(area.sum() / np.pi),
        np.arange(inside + len(disc)) >= inside,
    )


def _centres() -> Float[np.ndarray, "q 3"]:
    """Barycentric coordinates of the centres of PARTS² equal triangles that a triangle is divided into."""
    found = []
    for i in range(PARTS):
        for j in range(PARTS - i):
            found.append([i + 1 / 3, j + 1 / 3])
            if i + j < PARTS - 1:
                found.append([i + 2 / 3, j + 2 / 3])
    two = np.array(found) / PARTS
    return np.column_stack([two, 1.0 - two.sum(axis=1)])


def _turned(local: np.ndarray, centre: float) -> Rule | None:
    """The in-plane curve turned about the mirror direction at x = `centre`; a side that is missing is the other's."""
    across = np.hypot(local[:, 0], local[:, 1])
    rows = np.flatnonzero(np.abs(local[:, 1]) <= np.sin(IN_PLANE) * across + 1e-12)
    x, first = np.unique(np.round(local[rows, 0], 5), return_index=True)
    if len(x) < FEWEST:
        return None
    reach = 1.0 + centre
    marks = np.unique(np.concatenate([np.abs(x - centre), np.linspace(0.0, reach, 40)]))
    parts = np.linspace(0.0, 1.0, 2 * PARTS, endpoint=False) + 0.25 / PARTS
    widths = np.diff(marks)
    r = (marks[:-1, None] + widths[:, None] * parts).ravel()
    ring = np.repeat(widths / len(parts), len(parts)) * r
    cos = np.clip((1.0 - centre**2 - r**2) / np.maximum(2.0 * centre * r, 1e-12), -1.0, 1.0)
    hidden = np.arccos(cos)  # below this azimuth about the mirror direction, the horizon lies nearer than r
    half = ring * (np.pi - hidden)
    where = np.stack([centre + r, centre - r])
    measured = (where >= x[0]) & (where <= x[-1])
    where = np.where(measured, where, where[::-1])
    weight = half * (measured | measured[::-1])
    at = np.clip(np.searchsorted(x, where), 1, len(x) - 1)
    share = np.clip((where - x[at - 1]) / (x[at] - x[at - 1]), 0.0, 1.0)
    samples = rows[first]
    corners = np.stack([samples[at - 1], samples[at]], axis=-1).reshape(-1, 2)
    shares = np.stack([1.0 - share, share], axis=-1).reshape(-1, 2)
    return Rule(corners, shares, weight.ravel(), float(weight.sum() / np.pi), np.zeros(weight.size, bool))
