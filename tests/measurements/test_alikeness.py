"""Errors that are alike along a curve: found where they are, with the noise behind them, and not where they are not."""

import numpy as np
import pytest

from fitmat.measurements.alikeness import NOT_JUDGED, alike, stencil_variance
from fitmat.measurements.noise import measured_noise
from fitmat.measurements.samples import Measurements, from_arrays

RELATIVE, FLOOR = 0.02, 6e-4


def scan(step: float, rho: float, seed: int) -> tuple[Measurements, np.ndarray]:
    """Four curves of a Gaussian lobe on a base, with noise of an AR(1) along the curve; and the true σ."""
    rng, theta_o = np.random.default_rng(seed), np.deg2rad(np.arange(-80.0, 80.01, step))
    theta_i = np.deg2rad([10.0, 30.0, 50.0, 70.0])[:, None]
    f = 0.1 + 0.8 * np.exp(-(((theta_o - theta_i) / 0.3) ** 2))
    error = rng.normal(size=f.shape)
    for k in range(1, f.shape[1]):
        error[:, k] = rho * error[:, k - 1] + np.sqrt(1.0 - rho**2) * error[:, k]
    sigma = np.hypot(FLOOR, RELATIVE * f)
    light, sensor = (part.ravel() for part in np.broadcast_arrays(theta_i, theta_o))
    return from_arrays(light, sensor, (f + sigma * error).ravel(), source="scan"), sigma.ravel()


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.7])
def test_the_variance_of_a_cubics_error_is_that_of_simulated_processes(rho: float) -> None:
    rng = np.random.default_rng(1)
    y = rng.normal(size=(200_000, 5))
    for k in range(1, 5):
        y[:, k] = rho * y[:, k - 1] + np.sqrt(1.0 - rho**2) * y[:, k]
    error = y @ (np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / 6.0)
    assert float(stencil_variance(rho)) == pytest.approx(error.var(), rel=0.02)  # √(2/200,000) is 0.3 %


@pytest.mark.parametrize(("step", "least"), [(1.0, 0.95), (2.0, 0.6)])
def test_alike_errors_are_found_and_the_noise_behind_them(step: float, least: float) -> None:
    """ρ 0.7, of which neighbours show 0.45 of σ; medians over 15 draws within 30 %, false alarms in one of 15."""
    found, ratio, false = [], [], []
    for seed in range(15):
        m, sigma = scan(step, 0.7, seed)
        noise = measured_noise(m)
        found.append(noise.rho > 0)
        ratio.append(np.median(noise.sigma[:, 0] / sigma))
        false.append(measured_noise(scan(step, 0.0, seed)[0]).rho > 0)
    assert np.mean(found) >= least
    assert 0.7 < np.median(ratio) < 1.3
    assert np.mean(false) < 0.1


def test_what_was_found_is_said() -> None:
    words = measured_noise(scan(1.0, 0.7, 1)[0]).words
    assert "Errors of neighbouring angles are alike (correlation 0." in words
    assert "independent" not in words
    plain = measured_noise(scan(1.0, 0.0, 1)[0]).words
    assert plain.endswith("It is known to about 5 %.")  # 1/√(2 · 0.38 · 628)
    assert measured_noise(scan(5.0, 0.0, 1)[0]).words.endswith("if errors of neighbouring angles are independent.")


def test_wide_steps_are_not_judged() -> None:
    m, _ = scan(5.0, 0.7, 1)
    assert alike(m, np.array([[FLOOR, RELATIVE]])) == NOT_JUDGED
