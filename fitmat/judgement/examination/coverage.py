"""Coverage: from where a file was lit, where its sensor stood, and what of the hemisphere it leaves out.

It looks at the directions only, never at a value.
"""

import dataclasses

import numpy as np
from jaxtyping import Bool, Float

from fitmat.maths.directions import mirror, zenith
from fitmat.measurements.samples import IN_PLANE, Measurements
from fitmat.text import brief

SAME = np.deg2rad(0.15)
"""Incidence angles closer than this are one setting of the instrument."""

MOST_SETTINGS = 100
"""A file with more incidence angles than this was not measured incidence by incidence, but scattered over them."""

MOST = 12
"""At most this many incidences are described one by one, evenly chosen."""

MOST_ROWS = 3000
"""Of one incidence at most this many rows are looked at, evenly chosen."""

BIN = np.deg2rad(0.5)
"""Half width of an incidence in scattered files."""

CENTRES = np.deg2rad(np.arange(5.0, 90.0, 10.0))
"""Incidences that scattered files are described at."""

NEAR = np.deg2rad(10.0)
"""A direction within this angle of a sample counts as covered."""

DIRECTIONS = 2000
"""Directions, even in solid angle, at which coverage is asked for."""


@dataclasses.dataclass(frozen=True, eq=False)
class Incidence:
    """The samples of one angle of incidence, whatever its azimuth; angles in radians.

    Unlike `measurements.incidences`, which shares all samples out among groups, these are settings of the instrument
    that a file is described at: of many some are left out, and of a scattered file what lies between them.

    Attributes:
        theta_i: Zenith angle of incidence.
        rows: Indices into the measurements, (k,).
        wo: Directions to the sensor in the frame of `mirror_frame`, (k, 3).
        phi_i: Distinct azimuths of incidence, (a,).
        azimuths: How many distinct relative azimuths were measured, 1 for the plane of incidence.
        in_plane: How many samples lie in the plane of incidence.
        theta_o: Smallest and largest zenith angle of the sensor.
        step: Median distance of neighbours in the plane of incidence; None for less than two samples.
        gap: Largest such distance.
        nearest: Angle from the mirror direction to the closest sample.
        covered: Share of the hemisphere's solid angle within `NEAR` of a sample, left and right taken as alike.
    """

    theta_i: float
    rows: np.ndarray
    wo: Float[np.ndarray, "k 3"]
    phi_i: np.ndarray
    azimuths: int
    in_plane: int
    theta_o: tuple[float, float]
    step: float | None
    gap: float | None
    nearest: float
    covered: float

    __repr__ = brief

    @property
    def flat(self) -> bool:
        """Whether all samples lie in the plane of incidence."""
        return self.in_plane == len(self.rows)

    def as_dict(self) -> dict[str, object]:
        """Degrees and JSON types."""
        degrees = {"theta_i": self.theta_i, "theta_o_min": self.theta_o[0], "theta_o_max": self.theta_o[1]}
        degrees |= {"nearest_to_mirror": self.nearest}
        found: dict[str, object] = {f"{key}_deg": float(np.rad2deg(value)) for key, value in degrees.items()}
        for key, value in (("step", self.step), ("largest_gap", self.gap)):
            found[f"{key}_deg"] = None if value is None else float(np.rad2deg(value))
        counts = {"samples": len(self.rows), "in_plane": self.in_plane, "relative_azimuths": self.azimuths}
        return found | counts | {"azimuths_of_incidence": len(self.phi_i), "covered": self.covered}


@dataclasses.dataclass(frozen=True, eq=False)
class Coverage:
    """Where a file was measured; angles in radians.

    Attributes:
        theta_i: All distinct angles of incidence; for scattered files the smallest and the largest.
        scattered: Whether incidence varies from row to row instead of in settings.
        incidences: At most `MOST` of them, evenly chosen.
        phi_i: Distinct azimuths of incidence of the whole file, at most `MOST_SETTINGS`.
        in_plane: Whether all samples lie in the plane of incidence.
        grazing: Largest zenith angle of light or sensor.
    """

    theta_i: np.ndarray
    scattered: bool
    incidences: tuple[Incidence, ...]
    phi_i: np.ndarray
    in_plane: bool
    grazing: float

    __repr__ = brief


def coverage(m: Measurements) -> Coverage:
    """Describe the geometry of all rows in which something is valid."""
    usable = np.flatnonzero(m.valid.any(axis=1))
    theta_i, phi_i = m.theta_i[usable], m.phi_i[usable]
    settings = settled(theta_i)
    scattered = len(settings) > MOST_SETTINGS
    if scattered:
        groups = [usable[np.abs(theta_i - centre) < BIN] for centre in CENTRES]
    else:
        chosen = settings[_evenly(len(settings), MOST)]
        groups = [usable[np.abs(theta_i - setting) < SAME] for setting in chosen]
    incidences = tuple(_incidence(m, rows[_evenly(len(rows), MOST_ROWS)]) for rows in groups if len(rows))
    azimuths = settled(phi_i, turn=2 * np.pi)
    return Coverage(
        theta_i=np.array([theta_i.min(initial=np.pi / 2), theta_i.max(initial=0.0)]) if scattered else settings,
        scattered=scattered,
        incidences=incidences,
        phi_i=azimuths[_evenly(len(azimuths), MOST_SETTINGS)],
        in_plane=bool(m.in_plane[usable].all()),
        grazing=float(max(theta_i.max(initial=0.0), m.theta_o[usable].max(initial=0.0))),
    )


def settled(angles: np.ndarray, turn: float | None = None) -> Float[np.ndarray, " k"]:
    """Distinct values of many angles, those closer than `SAME` taken as one unless they run on; radians, sorted.

    Args:
        angles: Radians, (n,).
        turn: Period of the angles: values just below it are those at 0.
    """
    found = np.unique(np.round(angles, 6))
    if len(found) == 0:
        return found
    groups = np.split(found, np.flatnonzero(np.diff(found) > SAME) + 1)
    parts = [group if np.ptp(group) > 2 * SAME else group.mean(keepdims=True) for group in groups]
    distinct = np.concatenate(parts)
    if turn is not None and len(distinct) > 1 and distinct[0] + turn - distinct[-1] < SAME:
        distinct = distinct[:-1]
    return distinct


def mirror_frame(wi: np.ndarray, wo: np.ndarray) -> Float[np.ndarray, "n 3"]:
    """wo with x towards the mirror side of wi, z along the normal, y to the left as seen by the light.

    The mirror direction is (sinθ_i, 0, cosθ_i). For light along the normal x is where it is in the lab, turned round.
    """
    across = np.hypot(wi[:, 0], wi[:, 1])
    tilted = across > np.sin(IN_PLANE)
    safe = np.where(tilted, across, 1.0)
    cos, sin = (np.where(tilted, wi[:, k] / safe, default) for k, default in ((0, 1.0), (1, 0.0)))
    x, y = -(cos * wo[:, 0] + sin * wo[:, 1]), sin * wo[:, 0] - cos * wo[:, 1]
    return np.stack([x, y, wo[:, 2]], axis=1)


def from_mirror(wi: np.ndarray, wo: np.ndarray) -> Float[np.ndarray, " n"]:
    """Angle between wo and the mirror direction of wi, radians, exact for small angles."""
    chord = np.linalg.norm(wo - mirror(wi), axis=1)
    return 2.0 * np.arcsin(np.clip(chord / 2.0, 0.0, 1.0))


def _evenly(count: int, most: int) -> np.ndarray:
    """At most `most` indices into `count` things, evenly spread, first and last included."""
    return np.arange(count) if count <= most else np.unique(np.linspace(0, count - 1, most).round().astype(int))


def _incidence(m: Measurements, rows: np.ndarray) -> Incidence:
    wi, wo = m.wi[rows], m.wo[rows]
    local = mirror_frame(wi, wo)
    flat = _in_plane(local, float(zenith(wi).mean()))
    zeniths = zenith(wo)
    steps: np.ndarray = np.diff(np.unique(np.round(np.sign(local[flat, 0] + 1e-12) * zeniths[flat], 6)))
    aside = np.abs(np.arctan2(local[~flat, 1], local[~flat, 0]))
    relative = len(settled(aside)) + int(flat.any())
    return Incidence(
        theta_i=float(np.median(zenith(wi))),
        rows=rows,
        wo=local,
        phi_i=settled(m.phi_i[rows], turn=2 * np.pi),
        azimuths=relative,
        in_plane=int(flat.sum()),
        theta_o=(float(zeniths.min()), float(zeniths.max())),
        step=float(np.median(steps)) if len(steps) else None,
        gap=float(steps.max()) if len(steps) else None,
        nearest=float(from_mirror(wi, wo).min()),
        covered=covered(local),
    )


def _in_plane(local: np.ndarray, theta_i: float) -> Bool[np.ndarray, " n"]:
    """As `Measurements.in_plane`, but at normal incidence only where y is 0: one plane, not all of them."""
    across = np.hypot(local[:, 0], local[:, 1])
    return (np.abs(local[:, 1]) <= np.sin(IN_PLANE) * across) | (across < np.sin(IN_PLANE))


def covered(local: Float[np.ndarray, "k 3"]) -> float:
    """Share of the hemisphere's solid angle within `NEAR` of a sample; left and right are taken as alike.

    Asked at `DIRECTIONS` points of a Fibonacci lattice (Swinbank & Purser 2006), which are even in solid angle.
    """
    k = np.arange(DIRECTIONS) + 0.5
    z, azimuth = k / DIRECTIONS, np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - z**2)
    asked = np.stack([across * np.cos(azimuth), np.abs(across * np.sin(azimuth)), z], axis=1)
    folded = local * np.where(local[:, 1:2] < 0, [1.0, -1.0, 1.0], 1.0)
    from scipy.spatial import KDTree

    distance = KDTree(folded).query(asked)[0]
    return float(np.mean(distance <= 2.0 * np.sin(NEAR / 2.0)))
