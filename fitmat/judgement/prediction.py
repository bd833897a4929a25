"""What a fit predicts: curves of the best model, and bands in which a new measurement would fall.

Gives arrays; draws nothing.
"""

import dataclasses
from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from fitmat.fitting.likelihood import misfits
from fitmat.fitting.losses import DEFAULT
from fitmat.fitting.result import Fit
from fitmat.fitting.stabilising import from_stabilised, stabilised
from fitmat.maths import normal
from fitmat.maths.directions import from_angles
from fitmat.maths.parts import slices
from fitmat.measurements.samples import Measurements
from fitmat.models.around.noise import Noisy
from fitmat.models.parameters import with_vector
from fitmat.models.values import at, values
from fitmat.text import brief
from fitmat.uncertainty.posterior import Posterior

BAND_DRAWS = 200

MOST_NUMBERS = 1_000_000
"""Draws × values that are held at a time."""


@dataclasses.dataclass(frozen=True, eq=False)
class Section:
    """The in-plane samples of one direction of incidence, sorted by signed theta_o.

    Attributes:
        theta_i: Incidence, radians.
        phi_i: Its azimuth, radians.
        rows: Indices into the measurements, (k,).
        theta_o: Signed, positive on the mirror side, radians, (k,).
    """

    theta_i: float
    phi_i: float
    rows: np.ndarray
    theta_o: np.ndarray

    __repr__ = brief


def sections(m: Measurements, most: int = 8) -> list[Section]:
    """In-plane curves with at least three valid samples, by direction of incidence; `most` of them, evenly spread.

    Unlike `incidences`, which looks at the angle only, each azimuth is a curve of its own: a band is drawn along one.
    """
    usable = np.flatnonzero(m.in_plane & m.valid.any(axis=1))
    light = np.round(np.rad2deg(np.stack([m.theta_i, m.phi_i], axis=1)[usable]), 2) % 360.0
    found = []
    for theta_i, phi_i in np.unique(light, axis=0):
        rows = usable[(light == [theta_i, phi_i]).all(axis=1)]
        if len(rows) >= 3:
            rows = rows[np.argsort(m.signed_theta_o[rows])]
            found.append(Section(np.deg2rad(theta_i), np.deg2rad(phi_i), rows, m.signed_theta_o[rows]))
    if len(found) <= most:
        return found
    return [found[k] for k in np.linspace(0, len(found) - 1, most).astype(int)]


def curve(fit: Fit, section: Section, theta_o: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k c"]:
    """The fitted BRDF in sr⁻¹ along the plane of a section; signed theta_o, radians."""
    wi = from_angles(np.full_like(theta_o, section.theta_i), np.full_like(theta_o, section.phi_i))
    wo = from_angles(np.abs(theta_o), section.phi_i + np.where(theta_o >= 0, np.pi, 0.0))
    return at(fit.model, wi, wo)


def standardised_residuals(fit: Fit, *, misfit: bool = True) -> Float[np.ndarray, "n c"]:
    """What the best fit leaves over, in standard deviations of noise and misfit; rows as in `fit.data`.

    Args:
        fit: Under any loss: the transform is the default's, so that all are comparable.
        misfit: Whether the misfit counts; else in standard deviations of the noise alone.
    """
    data = fit.data.under(DEFAULT)
    s = np.asarray(fit.misfit if misfit else 0.0)
    return misfits(fit.predicted, data.noise, data, s)


def predictive_band(posterior: Posterior, rows: np.ndarray) -> Float[np.ndarray, "2 k c"]:
    """95 % band of a new measurement at the given rows, in sr⁻¹: parameters, noise and discrepancy together.

    Every posterior draw is paired with one standard normal quantile, shuffled, and the same for all rows: each row's
    band is right and neighbouring rows do not jitter.

    Args:
        posterior: Of the fit.
        rows: Indices into the fit's measurements, each with at least one valid channel, (k,).

    Returns:
        Lower and upper limit, (2, k, c).
    """
    fit, m = posterior.fit, posterior.fit.measurements.rows(rows)
    draws, s = posterior.thinned(BAND_DRAWS)
    levels = np.random.default_rng(0).permutation((np.arange(len(s)) + 0.5) / len(s))
    kappa = m.wi[:, 2:3]
    noise, at_once = fit.noise.sigma[rows] * kappa, max(1, MOST_NUMBERS // (len(s) * m.value.shape[1]))
    limits = np.empty((2, *noise.shape))
    for part in slices(len(rows), at_once):
        x = values(fit.model, draws, m.wi[part], m.wo[part]) * kappa[part]
        new = replicated(x, noise[part], s[:, None, None], normal.quantile(levels)[:, None, None])
        limits[:, part] = np.quantile(new, [0.025, 0.975], axis=0)
    return limits / kappa


def replicated(x: np.ndarray, noise: np.ndarray, s: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """New measurements of x = f κ, as the likelihood says: z of them is z(x) + N(0, 1); elementwise."""
    return from_stabilised(stabilised(x, noise, s) + normal, noise, s)


def predictions(
    fit: Fit, draws: Float[np.ndarray, "d p"], s: Float[np.ndarray, " d"]
) -> Iterator[tuple[slice, np.ndarray, np.ndarray, np.ndarray]]:
    """What draws predict of the samples that a fit saw, a few draws at a time.

    Args:
        fit: Its model and its `data`.
        draws: Parameter vectors.
        s: Discrepancies.

    Yields:
        Which draws, f κ and σ κ, (k, n, c) each or (n, c) where the noise is given, and s as (k, 1, 1).
    """
    data = fit.data
    for part in slices(len(draws), max(1, MOST_NUMBERS // data.x.size)):
        x, noise = values(fit.model, draws[part], data.wi, data.wo) * data.kappa, data.noise
        if isinstance(fit.model, Noisy):
            assert data.level is not None
            noise = data.kappa * np.stack([with_vector(fit.model, draw).sigma(data.level) for draw in draws[part]])
        yield part, x, noise, s[part, None, None]
