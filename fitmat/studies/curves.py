"""Curves: what a fitted model makes of each in-plane section of the measurements, with the band of new measurements.

It draws nothing.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from fitmat.judgement.prediction import Section, curve, predictive_band
from fitmat.text import brief
from fitmat.uncertainty.posterior import Posterior

EVERY_DEG, NEAR_DEG = np.linspace(-89.0, 89.0, 357), np.linspace(-3.0, 3.0, 121)
"""Angles at which a curve is known: over the whole plane, and more about the mirror direction, degrees."""


@dataclasses.dataclass(frozen=True, eq=False)
class Curve:
    """One model along one section.

    Attributes:
        name: Of the model.
        section: Where.
        theta_o: Signed angles of `value`, radians, rising, (k,).
        value: The fitted BRDF in sr⁻¹, (k, c).
        band: Lower and upper limit between which 95 % of new measurements at the section's rows would fall, (2, r, c).
    """

    name: str
    section: Section
    theta_o: Float[np.ndarray, " k"]
    value: Float[np.ndarray, "k c"]
    band: Float[np.ndarray, "2 r c"]

    __repr__ = brief


def predict_curves(posterior: Posterior, along: Sequence[Section]) -> tuple[Curve, ...]:
    """The curve of a posterior's fit, and its band, along each section."""
    return tuple(_predicted(posterior, section) for section in along)


def _predicted(posterior: Posterior, section: Section) -> Curve:
    degrees = np.sort(np.r_[EVERY_DEG, np.rad2deg(section.theta_i) + NEAR_DEG])
    theta_o = np.deg2rad(np.clip(degrees, EVERY_DEG[0], EVERY_DEG[-1]))
    fit = posterior.fit
    return Curve(fit.name, section, theta_o, curve(fit, section, theta_o), predictive_band(posterior, section.rows))
