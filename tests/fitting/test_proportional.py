"""Scans over decades whose noise nobody stated: a share of each value is found where there is one, else nothing moves.

The truth is the closed form of ABg, A/(B + |β − β₀|^g) (Church, Takacs & Leonard, Proc. SPIE 1165, 1989).
"""

import numpy as np
import pytest

import fitmat as fm

TRUE = {"a": 0.003, "b": 0.0008, "g": 1.7}
AWAY = np.array([0.5, 1.0, 1.5, 2.5, 4.0, 6.0, 10.0, 15.0, 25.0, 40.0])
SAID = "faint values scatter about abg as bright ones do"


def scan(scatter: str, seed: int) -> fm.Measurements:
    """Two incidences, denser towards the mirror direction by steps too uneven for neighbours; three decades."""
    theta_i = np.repeat([5.0, 45.0], 20)
    theta_o = np.concatenate([at + side * AWAY for at in (5.0, 45.0) for side in (-1, 1)])
    beta = np.abs(np.sin(np.deg2rad(theta_o)) - np.sin(np.deg2rad(theta_i)))
    f, rng = TRUE["a"] / (TRUE["b"] + beta ** TRUE["g"]), np.random.default_rng(seed)
    chance = rng.normal(size=f.shape)
    noisy = {"relative": f * (1 + 0.05 * chance), "floor": f + 0.01 * chance, "root": (np.cbrt(f) + 0.02 * chance) ** 3}
    return fm.from_arrays(np.deg2rad(theta_i), np.deg2rad(theta_o), noisy[scatter])


def closed_form() -> np.ndarray:
    """Standard deviations of A, B and g by weighted least squares: 0.05² (Σ ∇ln f ∇ln fᵀ)⁻¹ (Aitken 1935)."""
    m = scan("floor", 0)
    beta = np.abs(np.sin(m.signed_theta_o) - np.sin(m.theta_i))
    a, b, g = TRUE.values()
    whole = b + beta**g
    slopes = np.stack([np.full(beta.shape, 1 / a), -1 / whole, -(beta**g) * np.log(beta) / whole], axis=1)
    return 0.05 * np.sqrt(np.diagonal(np.linalg.inv(slopes.T @ slopes)))


def test_faint_values_count_where_all_scatter_by_a_share_of_themselves() -> None:
    fits = [fm.fit(scan("relative", seed), "abg") for seed in range(12)]
    found = [fit for fit in fits if SAID in fit.noise.words]
    assert len(found) >= 11
    assert not any(fit.noise.known for fit in fits)
    sd = np.array([np.sqrt(np.diagonal(fit.covariance)) for fit in found])
    np.testing.assert_allclose(sd.mean(axis=0), closed_form(), rtol=0.15)  # a share of 37 degrees of freedom, 12 times
    off = np.array([fit.values for fit in found]) - list(TRUE.values())
    np.testing.assert_array_less(np.abs(off.mean(axis=0)), 3.0 * closed_form() / np.sqrt(len(found)))


@pytest.mark.parametrize("scatter", ["floor", "root"])
def test_other_scatter_stays_a_misfit_of_the_root(scatter: str) -> None:
    assert not any(SAID in fm.fit(scan(scatter, seed), "abg").noise.words for seed in range(6))


def test_a_wrong_model_is_no_noise() -> None:
    fit = fm.fit(scan("relative", 0), "blinn-phong")
    assert "counted as model misfit" in fit.noise.words
