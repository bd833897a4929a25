"""Telling apart: whether the instrument that took the measurements could tell two models from each other.

The difference of the two predictions at the measured directions is set against the measurement noise. It draws no new
measurement and says nothing of which model is right.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.fitting.result import Fit
from fitmat.match.distances import PairedDraws
from fitmat.measurements.incidences import incidences
from fitmat.models.values import values
from fitmat.text import brief
from fitmat.uncertainty.estimate import Estimate, band, estimate

SEPARATED = 3.92
"""Separation d′ from which either model is mistaken for the other in less than 2.5 % of all measurements, 2 · 1.96."""

VISIBLE = 2.0
"""A difference beyond so many standard deviations of a single reading stands out by itself."""

ROWS = 2000
"""At most so many readings are looked at, evenly spread over the file; sums are scaled to all of them."""

MOST_INCIDENCES = 18
"""More incidence angles than this are taken together, neighbours first."""


@dataclasses.dataclass(frozen=True, eq=False)
class Telling:
    """What an instrument sees of the difference z = (f_P − f_M)/σ; one entry for each incidence angle measured.

    Attributes:
        theta_i_deg: Incidence in degrees, (k,), rising.
        readings: How many values were measured there, (k,).
        rms: Of z: below 1 the difference is hidden in the noise of a single reading; rows low, best, high, (3, k).
        beyond: Fraction of the readings with |z| > `VISIBLE`, (3, k).
        separation: d′ = √(Σ z²) over all readings of that incidence, (3, k): the distance of the two models in standard
            deviations of the best test between them (Neyman–Pearson for known Gaussian noise; Green & Swets 1966).
        repeats: Times the readings of that incidence would have to be taken for d′ = `SEPARATED`, (3, k): below 1 fewer
            would do. The noise would have to fall to `repeats`^(−½) of what it is.
        every: d′ of all readings together.
        known: Whether the noise is known; if not, the numbers say nothing.
    """

    theta_i_deg: Float[np.ndarray, " k"]
    readings: np.ndarray
    rms: Float[np.ndarray, "3 k"]
    beyond: Float[np.ndarray, "3 k"]
    separation: Float[np.ndarray, "3 k"]
    repeats: Float[np.ndarray, "3 k"]
    every: Estimate
    known: bool

    __repr__ = brief

    @property
    def alike_up_to_deg(self) -> float | None:
        """The incidence up to which the instrument cannot tell the two apart (d′ < `SEPARATED`), or None."""
        return self._up_to(self.separation[2] < SEPARATED)

    @property
    def hidden_up_to_deg(self) -> float | None:
        """The incidence up to which the difference stays below the noise of a single reading (rms < 1); or None."""
        return self._up_to(self.rms[2] < 1.0)

    @property
    def repeats_needed(self) -> Estimate:
        """How often all readings together would have to be taken to tell the two apart; below 1 fewer would do."""
        low, high = ((SEPARATED / max(x, 1e-300)) ** 2 for x in reversed(self.every.ci95))
        return Estimate((SEPARATED / max(self.every.value, 1e-300)) ** 2, (low, high))

    def _up_to(self, holds: np.ndarray) -> float | None:
        """The last angle of the unbroken run from the smallest one."""
        count = int(np.argmin(holds)) if not holds.all() else len(holds)
        return float(self.theta_i_deg[count - 1]) if count else None


def tell_apart(empirical: Fit, microfacet: Fit, draws: PairedDraws) -> Telling:
    """How well the measurements' instrument tells two models fitted to them apart.

    Args:
        empirical: Fit of the one; its noise counts.
        microfacet: Fit of the other, to the same measurements.
        draws: Parameters of both, the best fits first, then draws.
    """
    m, sigma = empirical.measurements, empirical.noise.sigma
    usable = np.flatnonzero(m.valid.any(axis=1))
    rows = usable[np.unique(np.linspace(0, len(usable) - 1, ROWS).astype(int))]
    models, directions = (empirical.model, microfacet.model), (m.wi[rows], m.wo[rows])
    one, other = (values(model, part, *directions) for model, part in zip(models, draws, strict=True))
    valid = m.valid[rows]
    z = np.where(valid, (one - other) / np.where(valid, sigma[rows], 1.0), 0.0)
    groups = incidences(m.wi[rows], np.ones(len(rows), bool), MOST_INCIDENCES)
    member = np.stack([np.isin(np.arange(len(rows)), group.rows) for group in groups]).astype(float)
    count = member @ valid.sum(axis=1)
    squares = (z**2).sum(axis=2) @ member.T
    whole = len(usable) / len(rows)
    separation = np.sqrt(whole * squares)
    return Telling(
        theta_i_deg=np.array([group.theta_i_deg for group in groups]),
        readings=np.round(whole * count).astype(int),
        rms=band(np.sqrt(squares / count)),
        beyond=band((np.abs(z) > VISIBLE).sum(axis=2) @ member.T / count),
        separation=band(separation),
        repeats=band((SEPARATED / np.maximum(separation, 1e-300)) ** 2),
        every=estimate(np.sqrt(whole * squares.sum(axis=1))),
        known=empirical.noise.known,
    )
