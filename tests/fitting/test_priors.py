"""Priors against conjugate closed forms and SciPy's distributions: stated, drawn, shown, refused."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

import fitmat as fm
from fitmat.errors import ModelError
from fitmat.fitting import priors
from fitmat.fitting.coordinates import coordinates
from fitmat.measurements.instrument import IDEAL
from fitmat.models.parameters import entries

EXACT = 1e-5
"""Relative; the solver's tolerance and the Gaussian's second order are far below."""

ANGLES = np.deg2rad([20.0, 60.0]), np.deg2rad(np.arange(-80.0, 81.0, 10.0))


@pytest.fixture(scope="module")
def made() -> fm.Measurements:
    return fm.simulate(fm.model("lambert", kd=0.5), *ANGLES, relative_noise=0.0, absolute_noise=0.02, seed=3)


@pytest.mark.parametrize(("centre", "sd"), [(0.5, 1e3), (0.3, 0.02), (0.8, 1e-4)])
def test_a_stated_prior_and_the_data_join_by_their_precision(made: fm.Measurements, centre: float, sd: float) -> None:
    """Lambert is linear in kd and the loss is Gaussian: mean and variance of the posterior have a closed form."""
    assert made.sigma is not None
    found = fm.fit(made, "lambert", loss="gaussian", priors={"kd": (centre, sd)})
    data = np.sum(1.0 / (np.pi * made.sigma) ** 2)
    mean = (np.sum(made.value / (np.pi * made.sigma**2)) + centre / sd**2) / (data + sd**-2)
    np.testing.assert_allclose(found.values, [mean], rtol=EXACT)
    np.testing.assert_allclose(found.covariance[0, 0], 1.0 / (data + sd**-2), rtol=EXACT)


def test_a_log_parameter_has_a_log_normal_prior() -> None:
    """Median and relative sd as stated: the density of ln α is Gaussian."""
    model = fm.model("ggx")
    found = priors.prepare_prior(model, IDEAL, {"alpha": (0.2, 0.05)})
    assert found is not None
    at = next(e.place.start for e in entries(model) if e.name == "alpha")
    np.testing.assert_allclose([found.mean[at], found.precision[at]], [np.log(0.2), 4.0], rtol=1e-12)


def test_draws_follow_the_truncated_prior() -> None:
    """kd ~ N(0.02, 0.03) within 0 … 1, α flat in its logarithm, s half-normal: Kolmogorov–Smirnov."""
    model = fm.model("lambert+ggx")
    prior = priors.prepare_prior(model, IDEAL, {"kd": (0.02, 0.03), "discrepancy": (0.0, 0.1)})
    places = {e.name: e.place.start for e in entries(model)}
    free = np.array([places["kd"], places["alpha"]])
    values, s = priors.draw(model, prior, free, 4000, np.random.default_rng(0))
    every = coordinates(model)
    low, high = every.low[places["alpha"]], every.high[places["alpha"]]
    kd = stats.truncnorm(-0.02 / 0.03, 0.98 / 0.03, 0.02, 0.03)
    p = [
        stats.kstest(values[:, places["kd"]], kd.cdf).pvalue,
        stats.kstest(np.log(values[:, places["alpha"]]), stats.uniform(low, high - low).cdf).pvalue,
        stats.kstest(s, stats.halfnorm(scale=0.1).cdf).pvalue,
    ]
    assert min(p) > 1e-3  # one in 300 for three tests together
    np.testing.assert_array_equal(values[:, places["eta"]], 1.5)


def test_nothing_is_drawn_from_a_flat_discrepancy() -> None:
    with pytest.raises(ModelError, match="cannot draw from a flat prior of discrepancy"):
        priors.draw(fm.model("lambert"), None, np.array([0]), 1, np.random.default_rng(0))


def test_the_discrepancy_can_be_held_down(made: fm.Measurements) -> None:
    """A wrong model inflates s; a prior of sd 10⁻⁴ keeps it there."""
    truth = fm.model("lambert+ggx", kd=0.3, alpha=0.3)
    m = fm.simulate(truth, *ANGLES, relative_noise=0.01, absolute_noise=1e-3, seed=3)
    free = fm.fit(m, "lambert").discrepancy
    held = fm.fit(m, "lambert", priors={"discrepancy": (0.0, 1e-4)}).discrepancy
    assert free > 0.05
    assert held < 0.1 * free


def test_words_say_what_was_believed() -> None:
    model = fm.model("lambert+ggx")
    prior = priors.prepare_prior(model, IDEAL, {"eta": (1.5, 0.05)})
    said = priors.words(model, prior)
    assert said["eta"] == ("1.500 ± 0.050",)
    assert said["kd"] == ("0 – 1",)
    assert said["alpha"][0].endswith(", in the logarithm")
    assert priors.natural_sd(model, prior)[0] == pytest.approx(12**-0.5)
    assert float(jnp.sum(prior.precision > 0)) == 1  # pyright: ignore[reportOptionalMemberAccess]


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"zeta": (1.0, 1.0)}, "prior of 'zeta': lambert\\+ggx has kd, ks, alpha, eta; also discrepancy"),
        ({"alpha": (3.0, 1.0)}, "prior of alpha: centre .*3.* expected a value from"),
        ({"discrepancy": (0.1, 0.01)}, r"prior of discrepancy: centre 0\.1, expected 0, from which its sd is counted"),
        ({"alpha": (0.3, 0.0)}, "prior of alpha: standard deviation .* expected a positive number"),
    ],
)
def test_impossible_priors_are_refused(given: dict, sentence: str) -> None:
    with pytest.raises(ModelError, match=sentence):
        priors.prepare_prior(fm.model("lambert+ggx"), IDEAL, given)


def test_texts_of_the_command_line() -> None:
    assert priors.assignments(["eta=1.5,0.05"]) == {"eta": (1.5, 0.05)}
    with pytest.raises(ModelError, match=r"--prior 'eta=1\.5': expected NAME=CENTRE,SD, for example eta=1\.5,0\.05"):
        priors.assignments(["eta=1.5"])
    with pytest.raises(ModelError, match=r"--prior eta is given twice, expected one value of it\. Leave one out"):
        priors.assignments(["eta=1.5,0.05", " eta =1.4,0.1"])


@pytest.mark.parametrize(
    ("told", "sentence"),
    [
        (
            {"fixed": {"kd": 0.5}, "priors": {"kd": (0.5, 0.1)}},
            r"kd is fixed and has a prior \(--fix or --ior, and --prior\), expected one of the two",
        ),
        (
            {"loss": "gaussian", "priors": {"discrepancy": (0.0, 0.1)}},
            r"prior of discrepancy \(--prior\) under the loss gaussian \(--loss\), expected none",
        ),
    ],
)
def test_priors_that_could_change_nothing_are_refused(made: fm.Measurements, told: dict, sentence: str) -> None:
    with pytest.raises(ModelError, match=sentence):
        fm.fit(made, "lambert", **told)


def test_a_model_has_its_own_masking(made: fm.Measurements) -> None:
    with pytest.raises(ModelError, match="masking = 'separable' beside a model, expected it with a name"):
        fm.fit(made, fm.model("ggx"), masking="separable")


def test_a_calibration_is_the_prior_of_the_scale(made: fm.Measurements) -> None:
    known = dataclasses.replace(made, instrument=fm.Instrument(calibration=0.03))
    with pytest.raises(ModelError, match=r"prior of scale beside the instrument's calibration = 0\.03, expected one"):
        fm.fit(known, "lambert", priors={"scale": (1.0, 0.1)})
