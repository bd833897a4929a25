"""Predictions: bands hold 95 % of new measurements, curves and sections follow the sign of theta_o."""

import dataclasses

import numpy as np
import pytest
from oracles import ggx

import fitmat as fm
from fitmat.fitting.result import Fit
from fitmat.judgement.prediction import Section, curve, predictive_band, sections
from fitmat.uncertainty.posterior import Posterior

FRESH = 40

HELD = 0.015
"""Of 0.95, and 3.1 standard errors √(0.95·0.05/2040) of a share of 2040 new values, all rows in one."""

EDGE = 0.08
"""In σ: 200 evenly spaced normal quantiles place their 2.5 % quantile this close to −1.96."""

ROUNDING = 1e-9

TRUTH = fm.model("lambert+ggx", kd=0.3, alpha=0.3, eta=1.5)
LIGHT, SENSOR = np.deg2rad([20, 45, 70]), np.deg2rad(np.arange(-80, 81, 10))


def seen(seed: int) -> fm.Measurements:
    return fm.simulate(TRUTH, LIGHT, SENSOR, relative_noise=0.02, absolute_noise=1e-3, seed=seed)


@pytest.fixture(scope="module")
def fit() -> Fit:
    return fm.fit(seen(1), "lambert+ggx")


def certain(fit: Fit, s: float, count: int = 200) -> Posterior:
    """Draws that all say the best fit, with one discrepancy."""
    return Posterior(fit, "laplace", np.tile(fit.values, (count, 1)), np.full(count, s))


def test_bands_hold_what_is_measured_next(fit: Fit) -> None:
    low, high = predictive_band(fm.laplace(fit, seed=1, corrected=False), np.arange(51))
    fresh = np.stack([seen(100 + seed).value for seed in range(FRESH)])
    assert np.mean((low <= fresh) & (fresh <= high)) == pytest.approx(0.95, abs=HELD)


def test_without_discrepancy_the_band_is_gaussian(fit: Fit) -> None:
    """f ± 1.96 σ."""
    rows = np.array([3, 20, 40])
    low, high = predictive_band(certain(fit, 0.0), rows)
    f, sigma = fm.evaluate(fit.model, fit.measurements.wi, fit.measurements.wo)[rows], fit.noise.sigma[rows]
    np.testing.assert_allclose((low - f) / sigma, -1.96, atol=EDGE)
    np.testing.assert_allclose((high - f) / sigma, 1.96, atol=EDGE)


def test_with_discrepancy_alone_the_band_is_gaussian_in_the_cube_root(fit: Fit) -> None:
    """(∛(f κ) ± 1.96 s)³/κ, through zero where s is larger than the root."""
    noiseless, s = dataclasses.replace(fit.noise, sigma=1e-12 * fit.noise.sigma), 0.3
    low, high = predictive_band(certain(dataclasses.replace(fit, noise=noiseless), s), np.arange(51))
    kappa = fit.measurements.wi[:, 2:3]
    root = np.cbrt(fm.evaluate(fit.model, fit.measurements.wi, fit.measurements.wo) * kappa)
    np.testing.assert_allclose((np.cbrt(low * kappa) - root) / s, -1.96, atol=EDGE)
    np.testing.assert_allclose((np.cbrt(high * kappa) - root) / s, 1.96, atol=EDGE)
    assert low.min() < 0


def test_curves_are_the_model_along_a_section(fit: Fit) -> None:
    """Against GGX in numpy; the lobe is on the side of positive theta_o."""
    theta_o = np.deg2rad([-60.0, -20.0, 0.0, 45.0, 70.0])
    kd, ks, alpha, eta = fit.values
    wi, wo = ggx.hemisphere(np.full(5, np.pi / 4), 0.0), ggx.hemisphere(theta_o, np.pi)
    expected = kd / np.pi + ks * ggx.brdf(wi, wo, alpha, eta)
    found = curve(fit, Section(np.pi / 4, 0.0, np.arange(5), theta_o), theta_o)
    np.testing.assert_allclose(found[:, 0], expected, rtol=ROUNDING)
    assert found[3, 0] > 1.5 * found[1, 0]


def test_sections_are_sorted_curves_in_the_plane() -> None:
    """Two incidences in the plane; too few samples, masked samples and samples beside the plane are left out."""
    theta_i = np.deg2rad([30, 30, 30, 30, 50, 50, 50, 50, 60, 60, 60])
    theta_o = np.deg2rad([20, -10, 40, 0, 10, -30, 5, 60, 10, 20, 30])
    phi = np.deg2rad([180, 180, 180, 180, 180, 180, 180, 180, 90, 180, 180])
    m = fm.from_arrays(theta_i, theta_o, np.ones(11), phi=phi)
    m = dataclasses.replace(m, valid=np.arange(11)[:, None] != 7)
    first, second = sections(m)
    assert (first.theta_i, second.theta_i) == pytest.approx(np.deg2rad([30, 50]))
    assert first.rows.tolist() == [1, 3, 0, 2]
    np.testing.assert_allclose(np.rad2deg(first.theta_o)[[0, 2, 3]], [-10, 20, 40])
    assert second.rows.tolist() == [5, 6, 4]


def test_sections_keep_azimuths_of_incidence_apart() -> None:
    """A brushed sample measured along and across; 360° is 0°, and light along the normal has no azimuth."""
    theta_i, phi_i, theta_o = (
        np.deg2rad([30.0] * 9),
        np.deg2rad([0, 0, 360, 90, 90, 90, 0, 0, 0]),
        np.deg2rad([10.0, 20, 30] * 3),
    )
    theta_i[6:] = 0.0
    table = {"theta_i": np.rad2deg(theta_i), "phi_i": np.rad2deg(phi_i), "theta_o": np.rad2deg(theta_o)}
    m = fm.read(table | {"phi_o": np.rad2deg(phi_i) % 360.0 + 180.0, "brdf": np.ones(9)})
    found = [(round(np.rad2deg(s.theta_i)), round(np.rad2deg(s.phi_i)), len(s.rows)) for s in sections(m)]
    assert found == [(0, 0, 3), (30, 0, 3), (30, 90, 3)]


def test_many_sections_are_thinned_evenly() -> None:
    theta_i, theta_o = (
        np.ravel(p) for p in np.meshgrid(np.deg2rad(np.arange(0, 80, 5)), [-0.2, 0.1, 0.3], indexing="ij")
    )
    m = fm.from_arrays(theta_i, theta_o, np.ones(48))
    assert len(sections(m, most=16)) == 16
    chosen = [round(np.rad2deg(s.theta_i)) for s in sections(m, most=4)]
    assert chosen == [0, 25, 50, 75]
