"""Model choice: leave-one-out densities and errors against closed forms, and sentences that say what was found."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from scipy import stats

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.fitting.result import Fit
from fitmat.judgement.choice import choice
from fitmat.judgement.choice.choice import Candidate, Choice
from fitmat.judgement.choice.evidence import MOST_LEFT_OUT, Evidence, weigh
from fitmat.judgement.choice.left_out import MOST_REFITTED, leave_incidences_out
from fitmat.judgement.plausibility import broken_laws, doubts
from fitmat.models.lobes.lambert import Lambert
from fitmat.uncertainty.posterior import Posterior

DENSITY = 0.02
"""Nats: of a Gaussian posterior of one parameter, 1000 draws give each value's log density to about its share of p_loo,
1/60, times √(2/1000), far below; values of high leverage are worse."""

SUM = 0.25
"""Nats: four standard errors of the sum of 60 such values, which share their draws: √60 · 0.02 would be 0.15."""

REFIT = 1e-6
"""Relative: optima of a linear problem to the solver's tolerance of 1e-8, and cube roots of them."""

INCIDENCES, SENSOR = np.deg2rad([0.0, 30.0, 50.0, 70.0]), np.deg2rad(np.arange(-70, 71, 10))


def seen(name: str, seed: int, **truth: Any) -> fm.Measurements:
    """60 values with 5 % noise and σ stated."""
    return fm.simulate(
        fm.model(name, **truth), INCIDENCES, SENSOR, relative_noise=0.05, absolute_noise=0.0, seed=seed
    )  # fmt: skip


@pytest.fixture(scope="module")
def linear() -> Fit:
    """y = k_d/π + σ ε with σ known: everything about it is known in closed form."""
    return fm.fit(seen("lambert", 1, kd=0.3), "lambert", loss="gaussian")


def left_out_mean(fit: Fit, keep: np.ndarray) -> tuple[float, float]:
    """The Gaussian posterior of the level k_d/π by the values that are kept: mean and variance."""
    m = fit.measurements
    assert m.sigma is not None
    weight = np.where(keep, m.sigma[:, 0] ** -2.0, 0.0)
    return float(np.average(m.value[:, 0], weights=weight)), float(1.0 / weight.sum())


def test_the_density_of_each_value_is_that_of_the_refit_without_it(linear: Fit) -> None:
    """Exact leave-one-out of a linear Gaussian model: y_i ~ N(mean of the others, σ_i² + variance of that mean)."""
    m, found = linear.measurements, weigh(fm.laplace(linear, seed=1))
    assert found is not None
    assert m.sigma is not None
    exact = np.zeros(60)
    for k in range(60):
        mean, variance = left_out_mean(linear, np.arange(60) != k)
        exact[k] = stats.norm.logpdf(m.value[k, 0], mean, np.hypot(m.sigma[k, 0], np.sqrt(variance)))
    assert np.abs(found.pointwise - exact).max() < DENSITY
    assert abs(found.elpd - exact.sum()) < SUM
    assert found.se == pytest.approx(np.sqrt(60) * exact.std(), rel=0.02)
    mean, variance = left_out_mean(linear, np.ones(60, bool))
    draws = np.random.default_rng(1).normal(mean, np.sqrt(variance), (4000, 1))
    density = stats.norm.pdf(m.value[:, 0], draws, m.sigma[:, 0]).mean(axis=0)
    assert found.p_loo == pytest.approx(np.sum(np.log(density)) - exact.sum(), abs=SUM)
    assert found.bad == 0.0


def test_an_incidence_is_predicted_by_the_mean_of_all_others(linear: Fit) -> None:
    m, found = linear.measurements, leave_incidences_out(linear)
    assert found is not None
    assert m.sigma is not None
    assert found.names == ("0°", "30°", "50°", "70°")
    assert found.settled.all()
    kappa = np.cos(m.theta_i)
    for k, angle in enumerate(INCIDENCES):
        here = np.isclose(m.theta_i, angle)
        mean, _ = left_out_mean(linear, ~here)
        cube = np.cbrt(m.value[here, 0] * kappa[here]) - np.cbrt(mean * kappa[here])
        assert found.cube_root[k] == pytest.approx(np.sqrt(np.mean(cube**2)), rel=REFIT)
        z = (m.value[here, 0] - mean) / m.sigma[here, 0]
        assert found.z[k] == pytest.approx(np.sqrt(np.mean(z**2)), rel=REFIT)
    assert found.error == pytest.approx(np.sqrt(np.mean(found.cube_root**2)))
    assert found.surprise == pytest.approx(np.sqrt(np.mean(found.z**2)))
    assert found.worst == found.names[int(np.argmax(found.z))]


def test_leaving_out_compiles_nothing_again(linear: Fit) -> None:
    """The program of the fit serves its refits: only the errors are compiled, once."""
    compiled: list[str] = []

    def heard(event: str, duration_secs: float, **_: str | int) -> None:
        compiled.append(event)

    jax.monitoring.register_event_duration_secs_listener(heard)
    leave_incidences_out(linear)
    compiled.clear()
    leave_incidences_out(dataclasses.replace(linear, measurements=linear.measurements))
    assert not [event for event in compiled if "backend_compile" in event]
    fm.fit(seen("lambert", 9, kd=0.3).rows(np.arange(40)), "lambert", loss="gaussian", fixed={"kd": 0.2})
    assert [event for event in compiled if "backend_compile" in event]  # the listener hears compilation


def test_criteria_by_hand(linear: Fit) -> None:
    """Akaike and Schwarz of one Gaussian parameter: k = 1, n = 60."""
    m = linear.measurements
    assert m.sigma is not None
    mean, _ = left_out_mean(linear, np.ones(60, bool))
    best = stats.norm.logpdf(m.value[:, 0], mean, m.sigma[:, 0]).sum()
    line = str(fm.choose([fm.laplace(linear, seed=1)], predicting=False)).splitlines()[-1].split()
    assert line[1:3] == [f"{2 - 2 * best + 4 / 58:.1f}", f"{np.log(60) - 2 * best:.1f}"]


def test_a_single_incidence_and_large_files_are_not_refitted(linear: Fit) -> None:
    m = linear.measurements
    assert leave_incidences_out(fm.fit(m.rows(np.isclose(m.theta_i, 0.0)), "lambert", loss="gaussian")) is None
    assert leave_incidences_out(dataclasses.replace(linear, n_values=MOST_REFITTED + 1)) is None
    large = dataclasses.replace(linear, n_values=MOST_LEFT_OUT + 1)
    assert weigh(fm.laplace(large, seed=1, corrected=False)) is None


def laplace(m: fm.Measurements, name: str) -> Posterior:
    return fm.laplace(fm.fit(m, name), seed=1)


@pytest.fixture(scope="module")
def rough() -> Choice:
    """Measured on a rough diffuse surface, which Lambert is not."""
    m = seen("oren-nayar", 1, kd=0.4, sigma_n=40.0)
    return fm.choose([laplace(m, name) for name in ("lambert", "oren-nayar")])


def test_the_model_that_made_the_data_is_clearly_preferred(rough: Choice) -> None:
    assert [c.name for c in rough.candidates] == ["oren-nayar", "lambert"]
    assert rough.candidates[1].clearly_behind
    assert rough.verdict.startswith("The data prefer oren-nayar, and clearly: lambert, the next, is behind by ")
    assert "An angle of incidence that was left out is predicted best by oren-nayar" in rough.verdict
    assert rough.best.left_out is not None
    assert rough.best.left_out.surprise == pytest.approx(1.0, abs=3 / np.sqrt(2 * 60))  # three errors of an rms of 60
    assert "elpd" in rough._repr_html_()


def test_a_model_within_another_is_not_told_from_it() -> None:
    m = seen("lambert", 2, kd=0.4)
    found = fm.choose([laplace(m, name) for name in ("oren-nayar", "lambert")], predicting=False)
    assert len(found.equals) == 2
    assert found.verdict.startswith("The data do not decide between ")


class Lopsided(Lambert):
    """A surface that reflects less of oblique light, and does not see obliquely as little."""

    def __call__(self, wi: Array, wo: Array) -> Array:
        return self.kd / jnp.pi * wi[2]


def candidate(rough: Choice, behind: float, se: float, **changes: object) -> Candidate:
    return dataclasses.replace(rough.best, behind=behind, behind_se=se, **changes)  # pyright: ignore[reportArgumentType]


def test_a_difference_counts_from_four_on_and_beyond_two_errors(rough: Choice) -> None:
    assert not candidate(rough, 3.9, 0.1).clearly_behind
    assert candidate(rough, 4.1, 2.0).clearly_behind
    assert not candidate(rough, 4.1, 2.1).clearly_behind


def weighed_as(monkeypatch: pytest.MonkeyPatch, rough: Choice, elpd: dict[str, float | None]) -> Choice:
    """The same posteriors, with these elpd; None for a candidate without evidence."""

    def weigh(posterior: Posterior) -> Evidence | None:
        known, given = rough.best.evidence, elpd[posterior.fit.name]
        assert known is not None
        pointwise = np.full(60, np.nan if given is None else given / 60)
        return None if given is None else dataclasses.replace(known, elpd=given, pointwise=pointwise)

    monkeypatch.setattr("fitmat.judgement.choice.choice.weigh", weigh)
    return fm.choose([c.posterior for c in reversed(rough.candidates)], predicting=False)


@pytest.mark.parametrize("lost", [np.nan, np.inf, -np.inf, None])
def test_a_candidate_without_a_number_is_never_first(
    rough: Choice, monkeypatch: pytest.MonkeyPatch, lost: float | None
) -> None:
    """NaN is no maximum, and half of an AICc (about 100 here) stands on another scale than an elpd of −500."""
    found = weighed_as(monkeypatch, rough, {"lambert": lost, "oren-nayar": -500.0})
    assert [c.name for c in found.candidates] == ["oren-nayar", "lambert"]
    assert [c.weighed for c in found.candidates] == [True, False]
    assert found.equals == (found.best,)
    assert found.verdict.startswith(
        "Only oren-nayar could be weighed. Not weighed: lambert, of which what it predicts "
    )
    assert "not weighed" in str(found)
    assert "nan" not in str(found)
    assert not found.candidates[1].reliable


def test_where_nothing_is_a_number_aicc_decides(rough: Choice, monkeypatch: pytest.MonkeyPatch) -> None:
    for lost in (np.nan, None):
        found = weighed_as(monkeypatch, rough, {"lambert": lost, "oren-nayar": lost})
        assert [c.name for c in found.candidates] == ["oren-nayar", "lambert"]
        behind = (found.candidates[1].fit.aicc - found.best.fit.aicc) / 2
        assert found.candidates[1].behind == pytest.approx(behind, rel=1e-12)


def test_what_speaks_against_the_best_is_said(rough: Choice, monkeypatch: pytest.MonkeyPatch) -> None:
    laws = {"oren-nayar": ("is not reciprocal",)}
    monkeypatch.setattr(choice, "broken_laws", lambda fit: laws.get(fit.name, ()))
    impossible = candidate(rough, 0.0, 0.0, doubts=("kd at its upper bound",))
    lawful = dataclasses.replace(rough.candidates[1])
    words = Choice((impossible, lawful)).verdict
    assert "But oren-nayar is not reciprocal. The best of those that break no law is lambert." in words
    assert "Of oren-nayar: kd at its upper bound." in words
    assert rough.best.evidence is not None
    unsure: Evidence = dataclasses.replace(rough.best.evidence, bad=0.02)
    assert (
        "The comparison is rough for oren-nayar: its draws"
        in Choice((candidate(rough, 0.0, 0.0, evidence=unsure),)).verdict
    )
    assert "the only model that was tried" in Choice((rough.best,)).verdict
    few = [candidate(rough, behind, 0.0, evidence=None, left_out=None) for behind in (0.0, 50.0)]
    assert "is behind by 50 (half of AICc)." in Choice(tuple(few)).verdict


def test_broken_laws_and_doubts_are_found(rough: Choice) -> None:
    fit = rough.best.fit

    def with_model(name: str, **values: Any) -> Fit:
        return dataclasses.replace(fit, model=fm.model(name, **values))

    assert broken_laws(with_model("lambert", kd=1.0)) == ()
    (said,) = broken_laws(with_model("abg", a=1.0, b=1.0, g=2.0))
    assert "of the light at" in said
    assert float(said.split()[1]) >= 2.17  # πA ln(1 + 1/B) = 2.18 at normal incidence, and more beyond
    assert broken_laws(with_model("tilt-over-lambert", tilt_x=5.0)) == ()  # the mount is not the material
    assert broken_laws(dataclasses.replace(fit, model=Lopsided())) == ("is not reciprocal",)
    on_bound = dataclasses.replace(with_model("lambert", kd=1.0), undetermined=(), held={}, result="max_steps")
    assert doubts(on_bound) == ("kd at its upper bound", "the fit ran out of steps")
    assert doubts(dataclasses.replace(on_bound, held={"kd": np.ones(1)}, result="converged")) == ()
    assert doubts(dataclasses.replace(on_bound, undetermined=("kd",), result="")) == ("kd not determined",)


def test_every_model_can_be_built_and_anisotropy_needs_a_turned_sample(linear: Fit) -> None:
    flat, every = fm.every_model(linear.measurements), fm.every_model()
    assert all(fm.model(name).name == name for name in every)
    assert set(every) - set(flat) == {name for name in every if "aniso" in name}
    assert {"lambert", "lambert+blinn-phong", "lambert+ggx", "plastic", "disney-2015"} <= set(flat)
    turned = fm.simulate(fm.model("lambert"), [0.5], [0.5], relative_noise=0.1, absolute_noise=0.0, seed=1,
        phi_i=[0.0, 1.0])  # fmt: skip
    assert fm.every_model(turned) == every


def test_what_cannot_be_weighed_is_refused(linear: Fit, rough: Choice) -> None:
    with pytest.raises(FitmatError, match="a choice needs fits to the same Measurements object under the same loss"):
        fm.choose([rough.best.posterior, fm.laplace(linear, seed=1, corrected=False)])
    lost = dataclasses.replace(rough.best.posterior, fit=dataclasses.replace(rough.best.fit, log_likelihood=np.nan))
    with pytest.raises(FitmatError, match="no fit is finite, there is nothing to choose from; check the data"):
        fm.choose([lost])
    eyes = fm.fit(linear.measurements, "lambert", loss="cube-root")
    with pytest.raises(FitmatError, match="the loss cube-root is no likelihood, so that it weighs no models"):
        fm.choose([Posterior(eyes, "laplace", eyes.values[None], np.zeros(1))])


def test_the_density_of_an_incidence_is_that_of_the_fit_to_all_others(linear: Fit) -> None:
    """Each value of it is N(mean of the others, σ² + variance of that mean), by 100 draws."""
    m, found = linear.measurements, leave_incidences_out(linear, densities=True)
    assert found is not None
    assert m.sigma is not None
    for k, angle in enumerate(INCIDENCES):
        here = np.isclose(m.theta_i, angle)
        mean, variance = left_out_mean(linear, ~here)
        exact = stats.norm.logpdf(m.value[here, 0], mean, np.hypot(m.sigma[here, 0], np.sqrt(variance))).sum()
        assert found.elpd[k] == pytest.approx(exact, abs=SUM)
    plain = leave_incidences_out(linear)
    assert plain is not None
    assert np.isnan(plain.elpd).all()


def test_of_models_that_are_as_good_the_one_with_fewer_parameters_is_first(linear: Fit) -> None:
    """Oren–Nayar of σ = 0 is Lambert: the elpd differs by chance only."""
    more = fm.fit(linear.measurements, "oren-nayar", loss="gaussian")
    found = fm.choose([fm.laplace(more, seed=1), fm.laplace(linear, seed=1)], predicting=False)
    assert [c.name for c in found.candidates] == ["lambert", "oren-nayar"]
    assert min(c.behind for c in found.candidates) == 0.0
    assert found.verdict.startswith("The data do not decide between lambert and oren-nayar")
