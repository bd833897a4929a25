"""Fits: truths are recovered, scipy agrees on the covariance, every outcome is reached, wrong input is refused."""

import dataclasses
from typing import Any

import jax
import numpy as np
import pytest
from scipy.optimize import curve_fit

import fitmat as fm
from fitmat.errors import FitmatError, ModelError
from fitmat.fitting.concluding import RESULTS
from fitmat.fitting.information import inverse_information
from fitmat.fitting.result import Fit

SIGMAS = 3.0
"""Standard deviations that a seeded estimate may be off: 1 in 370 for each of some 40 parameters and fixed seeds."""

SCIPY = 1e-4
"""Relative; curve_fit differentiates by finite differences, which give its Jacobian about 6 digits."""

SAME = 1e-6
"""Relative; another order of rows or an equivalent data set ends within the solver's tolerance of the same optimum."""

LIGHT, SENSOR = np.deg2rad([20, 45, 70]), np.deg2rad(np.arange(-80, 81, 10))
# 51 rows: all files here share the programs compiled for 64.


def seen(truth: Any, seed: int = 1, relative: float = 0.02, absolute: float = 1e-3) -> fm.Measurements:
    return fm.simulate(truth, LIGHT, SENSOR, relative_noise=relative, absolute_noise=absolute, seed=seed)


def same_angles(value: Any, sigma: Any = None) -> fm.Measurements:
    """The angles of the plastic with other values."""
    theta_i, theta_o = (part.ravel() for part in np.meshgrid(LIGHT, SENSOR, indexing="ij"))
    sigma = None if sigma is None else np.broadcast_to(sigma, theta_i.shape)
    return fm.from_arrays(theta_i, theta_o, np.broadcast_to(value, theta_i.shape), sigma=sigma)


def deviations(found: Fit, truth: Any) -> np.ndarray:
    """(estimate − truth)/sd of the free parameters."""
    sd = np.sqrt(np.diagonal(found.covariance))[found.free]
    return (found.values - np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(truth)]))[found.free] / sd


@pytest.fixture(scope="module")
def plastic() -> fm.Measurements:
    return seen(fm.model("lambert+ggx", kd=0.3, alpha=0.3, eta=1.5))


@pytest.fixture(scope="module")
def found(plastic: fm.Measurements) -> Fit:
    return fm.fit(plastic, "lambert+ggx")


def test_a_model_may_be_fixed_altogether(plastic: fm.Measurements) -> None:
    """Then only the discrepancy is found."""
    found = fm.fit(plastic, "lambert", fixed={"kd": 0.25})
    assert found.values.tolist() == [0.25]
    assert found.discrepancy > 0
    assert found.result == "converged"


def test_colours_have_their_own_weights_and_share_their_shape() -> None:
    truth = fm.model(
        "lambert+ggx", channels=3, kd=np.array([0.1, 0.3, 0.6]), ks=np.array([1.0, 0.8, 0.5]), alpha=0.3, eta=1.5
    )
    found = fm.fit(seen(truth), "lambert+ggx")
    assert {e.name: e.size for e in found.entries} == {"kd": 3, "ks": 3, "alpha": 1, "eta": 1}
    assert found.result == "converged"
    assert np.abs(deviations(found, truth)).max() < SIGMAS


def test_covariance_is_scipys_where_the_model_is_right() -> None:
    """Lambert + Blinn–Phong written again in numpy, fitted by curve_fit with absolute sigma."""
    m = seen(fm.model("lambert+blinn-phong", kd=0.3, ks=0.1, exponent=30))
    assert m.sigma is not None
    found = fm.fit(m, "lambert+blinn-phong")
    assert found.discrepancy == 0.0
    h = m.wi + m.wo
    cos = h[:, 2] / np.linalg.norm(h, axis=1)

    def formula(_: np.ndarray, kd: float, ks: float, n: float) -> np.ndarray:
        return kd / np.pi + ks * (n + 8) / (8 * np.pi) * cos**n

    guess = np.array([0.2, 0.2, 20.0])
    values, covariance = curve_fit(formula, cos, m.value[:, 0], guess, m.sigma[:, 0], absolute_sigma=True, ftol=1e-14)
    np.testing.assert_allclose(found.values, values, rtol=SCIPY)
    np.testing.assert_allclose(found.covariance, covariance, rtol=10 * SCIPY)


def test_a_planted_misfit_is_found_and_named() -> None:
    """A spread of 0.05 in ∛(f cosθ_i), some 10 times the noise."""
    truth = seen(fm.model("lambert+ggx", kd=0.3, alpha=0.3, eta=1.5), relative=0.0, absolute=0.0)
    kappa, rng = truth.wi[:, 2:3], np.random.default_rng(1)
    value = (np.cbrt(truth.value * kappa) + 0.05 * rng.normal(size=truth.value.shape)) ** 3 / kappa
    found = fm.fit(dataclasses.replace(truth, value=value, sigma=0.01 * truth.value), "lambert+ggx")
    assert found.discrepancy == pytest.approx(0.05, rel=3 / np.sqrt(2 * (51 - 4)))  # three standard errors of an sd
    assert found.misfit_ratio > 10
    assert found.adequacy.startswith("inadequate: misses the data by ")


@pytest.fixture(scope="module")
def outcomes(plastic: fm.Measurements, found: Fit) -> dict[str, Fit]:
    """One fit for each way to end."""
    assert plastic.sigma is not None
    bright = 0.5 + 0.005 * np.random.default_rng(1).normal(size=51)
    return {
        "converged": found,
        "at_bound": fm.fit(same_angles(bright, 0.005), "lambert"),  # kd = 0.5 π
        "unidentifiable": fm.fit(same_angles(0.2, plastic.sigma[:, 0]), "lambert+ggx"),  # no lobe: no width, no index
        "max_steps": fm.fit(plastic, "lambert", max_steps=1),
        "nonfinite": fm.fit(dataclasses.replace(plastic, sigma=1e-200 * plastic.sigma), "lambert+ggx"),
    }


def test_every_outcome_is_reached(outcomes: dict[str, Fit]) -> None:
    assert {name: fit.result for name, fit in outcomes.items()} == {name: name for name in RESULTS}
    assert [name for name, fit in outcomes.items() if not fit.finite] == ["nonfinite"]


def test_what_the_outcomes_leave_unsaid(outcomes: dict[str, Fit]) -> None:
    assert outcomes["at_bound"].values == pytest.approx([1.0])
    assert np.isnan(outcomes["at_bound"].covariance).all()
    flat = outcomes["unidentifiable"]
    assert {"alpha", "eta"} <= set(flat.undetermined)
    assert flat.values[0] == pytest.approx(0.2 * np.pi, rel=SAME)
    assert outcomes["nonfinite"].adequacy == "cannot be judged: nothing finite was found"
    assert outcomes["nonfinite"].n_starts_agreeing == 0


@pytest.mark.parametrize("value", [0.0, 0.2, -0.2, 1e-300, 1e100])
def test_senseless_values_end_as_outcomes(value: float) -> None:
    """All zero, constant, negative, tiny, huge, σ unknown: no exception, no warning, and no claim to know alpha."""
    found = fm.fit(same_angles(value), "lambert+ggx")
    assert found.result == "unidentifiable"
    assert "alpha" in found.undetermined
    assert "adequacy unknown" in found.adequacy


def test_extreme_contrast_ends_as_an_outcome(plastic: fm.Measurements) -> None:
    value = plastic.value.copy()
    value[::2] *= 1e250
    assert fm.fit(dataclasses.replace(plastic, value=value, sigma=None), "lambert+ggx").result in RESULTS


def test_negative_values_are_data() -> None:
    """A black surface whose noise is mostly what is seen."""
    truth = fm.model("lambert", kd=0.02)
    m = seen(truth, absolute=0.01)
    assert (m.value < 0).sum() > 5
    found = fm.fit(m, "lambert")
    assert found.values[0] == pytest.approx(0.02, abs=SIGMAS * 0.01 * np.pi / np.sqrt(51))


def test_one_angle_of_reflection_determines_no_lobe(plastic: fm.Measurements) -> None:
    """51 samples of two numbers: alike but for the noise."""
    assert plastic.sigma is not None
    m = fm.from_arrays(0.5, np.full(51, 0.3), plastic.value[7, 0] + plastic.sigma[:, 0], sigma=plastic.sigma[:, 0])
    found = fm.fit(m, "lambert+ggx")
    assert found.result == "unidentifiable"
    assert found.finite


def test_repeated_measurements_halve_the_variance(plastic: fm.Measurements) -> None:
    half = plastic.rows(np.arange(51) % 2 == 0)
    twice = half.rows(np.tile(np.arange(26), 2))
    one, two = fm.fit(half, "lambert+ggx"), fm.fit(twice, "lambert+ggx")
    assert one.discrepancy == two.discrepancy == 0.0
    np.testing.assert_allclose(two.values, one.values, rtol=SAME)
    np.testing.assert_allclose(two.covariance, one.covariance / 2, rtol=1e-4)  # optimum to 1e-6, curvature to 1e-5


def test_the_order_of_rows_does_not_matter(plastic: fm.Measurements, found: Fit) -> None:
    other = fm.fit(plastic.rows(np.random.default_rng(1).permutation(51)), "lambert+ggx")
    np.testing.assert_allclose(other.values, found.values, rtol=SAME)


def test_masked_rows_do_not_matter(plastic: fm.Measurements) -> None:
    valid = plastic.valid.copy()
    valid[5:9] = False
    spoilt = np.where(valid, plastic.value, 1e30)
    fits = [fm.fit(dataclasses.replace(plastic, valid=valid, value=v), "lambert+ggx") for v in (plastic.value, spoilt)]
    without = fm.fit(plastic.rows(valid[:, 0]), "lambert+ggx")
    for other in fits:
        np.testing.assert_array_equal(other.values, without.values)
        assert other.log_likelihood == without.log_likelihood


def test_a_model_instead_of_a_name_keeps_its_static_choices(plastic: fm.Measurements) -> None:
    template = fm.model("ggx", masking="v-cavity", channels=1, alpha=0.3, eta=1.6)
    found = fm.fit(seen(template), template, fixed={"ks": 1.0})
    assert np.abs(deviations(found, template)).max() < SIGMAS
    assert fm.fit(seen(template), "ggx", masking="v-cavity", fixed={"ks": 1.0}).values.tolist() == found.values.tolist()


def test_information_criteria_by_hand(found: Fit) -> None:
    """Hurvich & Tsai 1989, Schwarz 1978: four parameters and the discrepancy, 51 values."""
    assert found.aicc == pytest.approx(2 * 5 - 2 * found.log_likelihood + 2 * 5 * 6 / (51 - 5 - 1))
    assert found.bic == pytest.approx(5 * np.log(51) - 2 * found.log_likelihood)


def test_inverse_information_is_the_inverse_or_huge() -> None:
    good = np.array([[4.0, 1.0], [1.0, 9.0]])
    np.testing.assert_allclose(inverse_information(good, np.array([1.0, 7.0])), np.linalg.inv(good))
    precise = np.diag([1e30, 0.0])  # one parameter known to 1e-15 says nothing of the other
    assert inverse_information(precise, np.ones(2))[1, 1] > 1e10
    alike = np.ones((2, 2))
    assert np.diagonal(inverse_information(alike, np.ones(2))).min() > 1e10


@pytest.mark.parametrize(
    ("rows", "name", "options", "error", "message"),
    [
        (5, "lambert+ggx", {}, FitmatError, r"5 valid samples, but lambert\+ggx has 4 free parameters and needs at le"),
        (
            1,
            "lambert",
            {},
            FitmatError,
            r"1 valid samples, but lambert has 1 free parameters and needs at least 3; mea",
        ),
        (51, "lambert", {"fixed": {"ks": 1}}, ModelError, r"cannot fix 'ks': lambert has kd\."),
        (51, "lambert", {"fixed": {"kd": [1, 1]}}, ModelError, r"fixed kd has 2 values: expected 1 or 1\."),
        (51, "lambert", {"fixed": {"kd": 1.5}}, ModelError, r"parameter kd = 1\.5: expected a value from 0 to 1\."),
        (51, "lambert", {"fixed": {"kd": np.nan}}, ModelError, r"parameter kd = nan: expected a value from 0 to 1\."),
        (51, "wood", {}, ModelError, r"model 'wood': no lobe 'wood'; try "),
    ],
)
def test_wrong_input_is_refused(
    plastic: fm.Measurements, rows: int, name: str, options: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        fm.fit(plastic.rows(np.arange(51) < rows), name, **options)


def test_single_precision_is_refused(plastic: fm.Measurements) -> None:
    with (
        jax.enable_x64(False),
        pytest.raises(FitmatError, match=r'needs 64-bit floats: run jax\.config\.update\("jax_enable_x64", True\)'),
    ):
        fm.fit(plastic, "lambert")
