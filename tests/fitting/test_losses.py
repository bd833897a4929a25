"""The losses: objectives against SciPy's `curve_fit`, densities against `scipy.stats`, and what bad values do."""

import dataclasses
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from scipy.optimize import curve_fit
from selection import always

import fitmat as fm
from fitmat.errors import FitmatError, ModelError
from fitmat.fitting.likelihood import Data, log_likelihood, prepare
from fitmat.fitting.losses import BAD_SHARE, BAD_SPREAD, LOSSES, T_DOF, bad_probability, loss
from fitmat.judgement.fit_metrics import fit_metrics
from fitmat.measurements.noise import measured_noise
from fitmat.models.around.noise import Noisy
from fitmat.models.base import AbstractBRDF, evaluate
from fitmat.models.parameters import vector, with_vector

SIX_DIGITS = 1e-6
"""Relative; both solvers are asked for more."""

ROUNDING = 1e-9
"""Relative error of a sum of some hundred logarithms."""

ANGLES = np.deg2rad([20.0, 45.0, 70.0]), np.deg2rad(np.arange(-80.0, 81.0, 4.0))

OBJECTIVES = {
    "log10": lambda f, ci, si: np.log10(f),
    "log1p-cos": lambda f, ci, si: np.log1p(f * ci),
    "cube-root": lambda f, ci, si: np.cbrt(f * ci),
    "ngan": lambda f, ci, si: f * ci,
    "low-e1": lambda f, ci, si: np.sqrt(si) * f * ci,
    "low-e2": lambda f, ci, si: np.sqrt(si) * np.log1p(f * ci),
    "l2": lambda f, ci, si: f,
    "l2-cos": lambda f, ci, si: f * ci,
}
"""What each objective compares, written out; f, cosθ_i, sinθ_i."""


def fitted_by_scipy(m: fm.Measurements, name: str, start: fm.Fit) -> np.ndarray:
    """The parameters at which `curve_fit` ends under an objective, from a start next to ours."""
    used = (m.value > 0) & m.valid
    if name == "ngan":
        used &= (np.maximum(m.theta_i, m.theta_o) <= np.deg2rad(80.0))[:, None]
    ci = np.broadcast_to(m.wi[:, 2:], m.value.shape)
    si = np.sqrt(1.0 - ci**2)
    free = start.free

    def compared(f: np.ndarray) -> np.ndarray:
        return OBJECTIVES[name](f[used], ci[used], si[used])

    def predicted(_: object, *p: float) -> np.ndarray:
        values = start.values.copy()
        values[free] = p
        return compared(evaluate(with_vector(start.model, jnp.asarray(values)), m.wi, m.wo))

    target = compared(m.value)
    begin = start.values[free] * 1.02
    found, _ = curve_fit(
        predicted, np.zeros(len(target)), target, begin, xtol=1e-14, ftol=1e-14, gtol=1e-14, x_scale=np.abs(begin),
        method="trf",
    )  # fmt: skip
    return found


@pytest.fixture(scope="module")
def made() -> fm.Measurements:
    """Lambert + GGX with 2 % and 10⁻³ sr⁻¹ of noise, σ given."""
    truth = fm.model("lambert+ggx", kd=0.2, alpha=0.25)
    return fm.simulate(truth, *ANGLES, relative_noise=0.02, absolute_noise=1e-3, seed=5)


@pytest.mark.parametrize("name", always({"log10", "ngan", "low-e2"}, OBJECTIVES))
def test_an_objective_is_the_one_of_the_literature(made: fm.Measurements, name: str) -> None:
    """The formula written out above, minimised by `curve_fit`, ends at the same parameters."""
    ours = fm.fit(made, "lambert+blinn-phong", loss=name)
    np.testing.assert_allclose(ours.values[ours.free], fitted_by_scipy(made, name, ours), rtol=SIX_DIGITS)


def test_the_reported_e2_is_the_one_that_its_loss_minimises() -> None:
    """A dark surface with readings below 0; were they taken for 0, E2 would ask for more light."""
    theta_o = np.tile(ANGLES[1], 3)
    theta_i, dark = np.repeat(ANGLES[0], len(ANGLES[1])), 0.05
    m = fm.from_arrays(theta_i, theta_o, dark + 0.1 * np.random.default_rng(3).normal(size=len(theta_i)))
    fit = fm.fit(m, "lambert", loss="low-e2")
    least, less, more = (
        fit_metrics(dataclasses.replace(fit, model=with_vector(fit.model, jnp.asarray(share * fit.values))))["low_e2"]
        for share in (1.0, 0.98, 1.02)
    )
    assert least is not None
    assert less is not None
    assert more is not None
    assert least < min(less, more)


def test_what_e2_is_not_defined_for_does_not_count() -> None:
    """Readings at and below −1/cosθ_i, which the loss of that name leaves out as well."""
    theta_o = np.deg2rad([0.0, 10.0, 20.0, 30.0])
    m = fm.from_arrays(np.full(4, np.deg2rad(60.0)), theta_o, np.array([0.1, 0.2, -2.0, -5.0]))
    fit = dataclasses.replace(fm.fit(m, "lambert", loss="cube-root"), model=fm.model("lambert", kd=0.1 * np.pi))
    by_hand = np.log1p(0.2 * 0.5) - np.log1p(0.1 * 0.5)
    assert fit_metrics(fit)["low_e2"] == pytest.approx(by_hand**2 / 2 * np.sin(np.deg2rad(60.0)))


@pytest.mark.study
def test_log10_on_a_real_sample_ends_where_curve_fit_does(shared_data: Path) -> None:
    """Black anodise, four incidences out of the plane; the objective is written out above."""
    m = fm.read(shared_data / "ua-loft" / "zemax" / "AnoBlackEC1onAlum.bsdf")
    for name in ("lambert+blinn-phong", "lambert+ggx"):
        ours = fm.fit(m, name, loss="log10", fixed={"ks": 1.0} if name == "lambert+ggx" else None)
        np.testing.assert_allclose(ours.values[ours.free], fitted_by_scipy(m, "log10", ours), rtol=SIX_DIGITS)


def noise_of(m: fm.Measurements) -> np.ndarray:
    """σ in sr⁻¹ of a file that gives it."""
    assert m.sigma is not None
    return m.sigma


def density(m: fm.Measurements, model: AbstractBRDF, name: str, s: float = 0.0) -> float:
    """Our log density of all values."""
    data: Data = prepare(m, measured_noise(m), None, loss(name))
    return float(eqx.filter_jit(log_likelihood)(model, data, jnp.asarray(s)))


@pytest.mark.parametrize("name", ["gaussian", "student-t", "mixture"])
def test_a_likelihood_is_a_density(made: fm.Measurements, name: str) -> None:
    """Without discrepancy each is a density of (y − f)/σ that SciPy has."""
    model = fm.model("lambert+ggx", kd=0.22, alpha=0.27)
    sigma = noise_of(made)
    z = ((made.value - evaluate(model, made.wi, made.wo)) / sigma).ravel()
    wide = stats.norm.logpdf(z, scale=BAD_SPREAD)
    expected = {
        "gaussian": stats.norm.logpdf(z),
        "student-t": stats.t.logpdf(z, T_DOF),
        "mixture": np.logaddexp(np.log(1 - BAD_SHARE) + stats.norm.logpdf(z), np.log(BAD_SHARE) + wide),
    }[name]
    total = expected.sum() - np.log(sigma).sum()
    np.testing.assert_allclose(density(made, model, name), total, rtol=ROUNDING)


def test_inferred_noise_enters_the_density(made: fm.Measurements) -> None:
    base = fm.model("lambert+ggx", kd=0.22, alpha=0.27)
    model = Noisy(base, jnp.asarray(0.002), jnp.asarray(0.04))
    data = prepare(made, measured_noise(made), None, loss("gaussian-inferred"))
    rows = slice(0, made.n_samples)
    sigma = np.hypot(0.002, 0.04 * np.asarray(data.level)[rows])
    total = stats.norm.logpdf(made.value, evaluate(base, made.wi, made.wo), sigma).sum()
    np.testing.assert_allclose(density(made, model, "gaussian-inferred"), total, rtol=ROUNDING)


@pytest.mark.study
def test_inferred_noise_is_that_of_the_simulation() -> None:
    """2 % and 10⁻³ sr⁻¹, not told to the fit: both within three standard deviations."""
    truth = fm.model("lambert+ggx", kd=0.05, alpha=0.25)
    m = fm.simulate(truth, *ANGLES, relative_noise=0.02, absolute_noise=1e-3, seed=6)
    found = fm.fit(dataclasses.replace(m, sigma=None), "lambert+ggx", loss="gaussian-inferred")
    names = {e.name: e.place.start for e in found.entries}
    for name, true in (("absolute", 1e-3), ("relative", 0.02)):
        at = names[name]
        sd = np.sqrt(found.covariance[at, at])
        assert abs(found.values[at] - true) < 3 * sd
        assert sd < 0.5 * true


@pytest.mark.study
def test_bad_values_move_robust_losses_less(made: fm.Measurements) -> None:
    """Five values three times too large: the truth stays within 4 sd under t and mixture, not under the Gaussian."""
    value = made.value.copy()
    bad = np.arange(5, made.n_samples, 25)
    value[bad] *= 3.0
    spoilt = dataclasses.replace(made, value=value)
    pull = {}
    for name in ("gaussian", "student-t", "mixture"):
        found = fm.fit(spoilt, "lambert+ggx", loss=name)
        pull[name] = float(
            np.max(np.abs(found.values - [0.2, 1.0, 0.25, 1.5]) / np.sqrt(np.diagonal(found.covariance)))
        )
    assert pull["gaussian"] > 10
    assert max(pull["student-t"], pull["mixture"]) < 4


@pytest.mark.parametrize("r", [0.0, 2.0, 5.0])
def test_the_probability_of_a_bad_value_is_bayes(r: float) -> None:
    good = (1 - BAD_SHARE) * stats.norm.pdf(r)
    bad = BAD_SHARE * stats.norm.pdf(r, scale=BAD_SPREAD)
    np.testing.assert_allclose(bad_probability(np.array(r)), bad / (good + bad), rtol=ROUNDING)


@pytest.mark.parametrize("name", always({"default", "student-t", "mixture", "log10", "ngan"}, LOSSES))
def test_slopes_are_finite(made: fm.Measurements, name: str) -> None:
    """At a residual of 0, at a model value of 0, at negative data."""
    value = made.value.copy()
    value[:3] = [[-0.01], [0.0], [1e-9]]
    m = dataclasses.replace(made, value=value)
    base = fm.model("lambert+ggx", kd=0.0, ks=0.0)
    model = Noisy(base) if LOSSES[name].infers_noise else base
    data = prepare(m, measured_noise(m), None, LOSSES[name])

    def cost(p: jax.Array) -> jax.Array:
        return log_likelihood(with_vector(model, p), data, jnp.asarray(0.01))

    assert np.isfinite(np.asarray(jax.jit(jax.grad(cost))(vector(model)))).all()


def test_only_likelihoods_support_a_posterior(made: fm.Measurements) -> None:
    names = {name for name, known in LOSSES.items() if known.posterior}
    assert names == {"default", "gaussian", "gaussian-inferred", "student-t", "mixture"}
    found = fm.laplace(fm.fit(made, "lambert+ggx", loss="log10"), seed=0)
    assert found.verdict == "no posterior"
    assert not found.usable
    assert len(found.values) == 1
    with pytest.raises(FitmatError, match="log10 is an objective, not a likelihood"):
        fm.sample(found.fit, seed=0)


def test_values_that_a_loss_cannot_take_are_left_out(made: fm.Measurements) -> None:
    value = made.value.copy()
    value[:7] = -1e-3
    found = fm.fit(dataclasses.replace(made, value=value), "lambert+ggx", loss="log")
    assert found.loss.name == "log10"
    assert found.n_values == made.n_valid - 7


def test_an_unknown_loss_is_refused(made: fm.Measurements) -> None:
    with pytest.raises(ModelError, match=r"unknown loss 'lg10': choose from default, gaussian"):
        fm.fit(made, "lambert", loss="lg10")


def test_a_gaussian_needs_the_noise(made: fm.Measurements) -> None:
    few = dataclasses.replace(made.rows(np.arange(0, made.n_samples, 12)), sigma=None)
    with pytest.raises(FitmatError, match="the loss gaussian needs the noise, and it is not known"):
        fm.fit(few, "lambert", loss="gaussian")
