"""A lacquered metal: its reflectance below the lacquer, from values that photons made and not fitmat's formula."""

from typing import Any

import numpy as np
import pytest
from oracles import coat_photons

import fitmat as fm
from fitmat.maths.directions import from_angles

GOLD = (0.95, 0.73, 0.36)
"""F0 of the channels, Schlick's curve; close to gold's."""

ALPHA, ETA = 0.15, 1.5

NOISE = 0.02
"""Relative; added to the photons' own error."""

SIGMAS, WIDEST = 2.0, 0.08
"""What the estimates may be off, in their standard deviations, and how wide these may be, relative."""


@pytest.mark.study
def test_the_metal_below_a_lacquer_is_recovered() -> None:
    """In the plane of incidence, 10°, 35° and 60°; eta is known, as is that nothing is absorbed."""
    theta_i, theta_o = (part.ravel() for part in np.meshgrid([10.0, 35.0, 60.0], np.arange(-70.0, 71.0, 5.0)))
    theta_i, theta_o = np.deg2rad(theta_i), np.deg2rad(theta_o)
    wi, wo = from_angles(theta_i, 0 * theta_i), from_angles(theta_o, 0 * theta_o + np.pi)
    rng, columns, errors = np.random.default_rng(5), [], []
    for seed, f0 in enumerate(GOLD):
        base = coat_photons.Facets(ALPHA, coat_photons.schlick(f0))
        mean, error = coat_photons.value(base, wi, wo, ETA, count=8000, seed=seed)
        sigma = np.hypot(NOISE * mean, error)
        columns.append(mean * (1 + NOISE * rng.normal(size=len(mean))))
        errors.append(sigma)
    value, sigma = np.stack(columns, axis=1), np.stack(errors, axis=1)
    measured = fm.from_arrays(theta_i, theta_o, value, sigma=sigma, channels=["R", "G", "B"])
    held: dict[str, Any] = {"eta": ETA, "depth": 0.0, "ks": 1.0}
    found = fm.fit(measured, "varnish-over-ggx-schlick", fixed=held)
    assert found.result == "converged"
    place = {entry.name: entry.place for entry in found.entries}
    sd = np.sqrt(np.diagonal(found.covariance))
    for name, truth in (("f0", np.array(GOLD)), ("alpha", np.array([ALPHA]))):
        got, spread = found.values[place[name]], sd[place[name]]
        assert np.all(np.abs(got - truth) < SIGMAS * spread), (got, spread)
        assert np.all(spread < WIDEST * truth)
