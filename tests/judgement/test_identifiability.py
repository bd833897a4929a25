"""Identifiability: profiles against SciPy, the ridge against a closed form, labels against the catalogue's truths."""

import dataclasses
import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

import fitmat as fm
from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.information import CONTRACTED
from fitmat.fitting.likelihood import every_residual
from fitmat.fitting.priors import natural_sd
from fitmat.fitting.result import Fit
from fitmat.judgement.identifiability.profiles import Profile, profiles
from fitmat.judgement.identifiability.ridge import ridge
from fitmat.judgement.identifiability.verdicts import STATES, Identifiability, identify
from fitmat.maths.directions import from_angles
from fitmat.models.parameters import with_vector
from fitmat.uncertainty.posterior import Posterior

CATALOGUE = Path(__file__).parents[2] / "data" / "synthetic"

LOCAL = 0.05
"""Relative: how far a profile's width may be from Laplace's where the noise is 2 %, so that curvature hardly counts."""

MOMENT = 0.05
"""Relative: the closed form of the ridge neglects that the data prefer some of it by 0.07 in ln L."""


@pytest.fixture(scope="module")
def blind() -> Fit:
    return fm.fit(fm.read(CATALOGUE / "normal-incidence.csv"), "lambert+ggx")


@pytest.fixture(scope="module")
def blind_profiles(blind: Fit) -> tuple[Profile, ...]:
    return profiles(blind)


@pytest.fixture(scope="module")
def ordinary() -> Fit:
    """As many rows as `blind`, so that both share their programs."""
    return fm.fit(fm.read(CATALOGUE / "one-curve.csv"), "lambert+ggx")


@pytest.fixture(scope="module")
def identified(blind: Fit) -> Identifiability:
    return identify(fm.laplace(blind, seed=1))


def test_the_label_of_the_catalogue_is_found(identified: Identifiability) -> None:
    truth = json.loads((CATALOGUE / "normal-incidence.truth.json").read_text(encoding="utf-8"))
    assert {v.name for v in identified.verdicts if v.state == STATES[2]} == set(truth["not_determined"])
    assert {v.name for v in identified.verdicts if v.state == STATES[0]} == {"kd", "alpha"}
    assert identified.spectrum[0] < 1.0 < identified.spectrum[1]  # one direction is lost, and one only


def test_what_a_misfit_leaves_open_is_not_put_down_to_the_angles() -> None:
    """Blinn–Phong of a microfacet surface: were every misfit its own, the exponent would be known to 3 %."""
    fit = fm.fit(fm.read(CATALOGUE / "normal-incidence.csv"), "lambert+blinn-phong")
    found = identify(fm.laplace(fit, seed=1))
    (exponent,) = (v for v in found.verdicts if v.name == "exponent")
    assert np.sqrt(fit.likelihood_covariance[2, 2]) / fit.values[2] < 0.03
    assert exponent.state == STATES[2]
    assert exponent.misfit
    assert "exponent is not determined, because the model misses the data: these angles would do." in found.words
    assert "by these angles" not in found.words


def test_what_sits_on_a_bound_is_not_called_determined() -> None:
    """A surface brighter than white: kd = 1, which is all that is said of it."""
    wo = np.deg2rad(np.arange(-60.0, 61.0, 10.0))
    m = fm.from_arrays(np.full(13, 0.5), wo, np.full(13, 0.5), sigma=np.full(13, 0.005))
    found = identify(fm.laplace(fm.fit(m, "lambert"), seed=1))
    assert found.words == "kd sits on its bound."


def test_what_is_determined_of_a_lost_pair_is_named(identified: Identifiability) -> None:
    (group,) = identified.groups
    assert set(group.names) == {"ks", "eta"}
    combination = group.combination
    assert combination is not None
    assert combination.name == "ks·F0"
    true = 0.04  # ((1.5 − 1)/(1.5 + 1))², with ks = 1
    assert abs(combination.value[0] - true) < 3 * combination.sd[0]
    assert combination.relative < 0.02
    assert combination.ci95[0, 0] < true < combination.ci95[0, 1]
    assert "ks and eta are not determined by these angles." in identified.words
    assert "ks and eta trade off: only ks·F0 (the strength of the highlight seen head on) is determined: 0.04" in str(
        identified
    )


def test_a_combination_is_as_sharp_as_its_weight_with_the_index_known(blind: Fit, identified: Identifiability) -> None:
    """Where ks and F0 act as a product, σ(ks·F0) is F0 σ(ks) with η fixed: a row and column of the information less."""
    combination = identified.groups[0].combination
    assert combination is not None
    f0 = ((blind.values[3] - 1) / (blind.values[3] + 1)) ** 2
    known = np.sqrt(np.linalg.inv(blind.information[:3, :3])[1, 1])
    assert combination.sd[0] == pytest.approx(f0 * known, rel=2 * LOCAL)


def test_the_ridge_has_the_moments_of_its_closed_form(blind: Fit, blind_profiles: tuple[Profile, ...]) -> None:
    """On ks F0(η) = c with flat priors in ks ≤ 10 and ln η ≤ ln 50, ln η has the density 1/F0(η)."""
    found, c = ridge(blind, blind_profiles), 0.0402
    lowest = (1 + np.sqrt(c / 10)) / (1 - np.sqrt(c / 10))
    log_eta = np.linspace(np.log(lowest), np.log(50.0), 200_001)
    density = ((np.exp(log_eta) + 1) / (np.exp(log_eta) - 1)) ** 2
    density /= density.sum()
    mean = density @ log_eta
    sd = np.sqrt(density @ (log_eta - mean) ** 2)
    centre, covariance = found.total()
    assert centre[3] == pytest.approx(mean, abs=MOMENT * sd * 2)
    assert np.sqrt(covariance[3, 3]) == pytest.approx(sd, rel=MOMENT)
    ks = c * ((np.exp(log_eta) + 1) / (np.exp(log_eta) - 1)) ** 2
    assert np.sqrt(covariance[1, 1]) == pytest.approx(np.sqrt(density @ ks**2 - (density @ ks) ** 2), rel=MOMENT)


def test_profiles_are_the_minima_that_scipy_finds(ordinary: Fit) -> None:
    """η held, the others and nothing else free, by SciPy's trust region in the natural coordinates."""
    profile = profiles(ordinary)[3]
    whole = coordinates(ordinary.model)
    s = jnp.asarray(ordinary.discrepancy)

    @jax.jit
    def every(t: jax.Array) -> jax.Array:
        found = every_residual(with_vector(ordinary.model, whole.physical(t)), ordinary.data, s)
        return jnp.concatenate([found.columns.ravel(), found.single])

    best = 0.5 * np.sum(np.asarray(every(jnp.asarray(whole.natural(ordinary.values)))) ** 2)
    for k in (2, 10, 22, 30):
        at = profile.points.at[k]
        start = whole.natural(ordinary.values)[:3]
        solved = least_squares(lambda t, at=at: np.asarray(every(jnp.asarray([*t, at]))), start, x_scale=[1, 1, 0.1])
        assert profile.points.rise[k] == pytest.approx(solved.cost - best, abs=1e-3)  # of Δ, which is judged at 1.92


def test_profiles_agree_with_laplace_where_all_is_determined(ordinary: Fit) -> None:
    found = profiles(ordinary)
    scale = np.where(coordinates(ordinary.model).ratio, ordinary.values, 1.0)
    np.testing.assert_allclose([p.sd for p in found], np.sqrt(np.diagonal(ordinary.covariance)) / scale, rtol=LOCAL)
    assert not any(any(p.open) for p in found)
    spread = np.sqrt(np.diagonal(ridge(ordinary, found).total()[1]))
    np.testing.assert_allclose(spread, [p.sd for p in found], rtol=LOCAL)
    verdicts = identify(fm.laplace(ordinary, seed=1))
    assert {v.state for v in verdicts.verdicts} == {"determined"}
    assert verdicts.groups == ()
    assert "kd, ks, alpha and eta are determined." in str(verdicts)


def test_a_prior_that_tells_all_is_not_the_data() -> None:
    """A scale known to 3 % only beforehand: its posterior is its prior, and kd·g is what the data determine."""
    rng, theta = np.random.default_rng(1), np.linspace(0.0, 1.2, 60)
    value = 0.3 / np.pi * (1 + 0.01 * rng.normal(size=60))
    m = fm.from_arrays(theta, 0.5, value, sigma=np.full(60, 0.003 / np.pi), instrument=fm.Instrument(calibration=0.03))
    found = fm.fit(m, "lambert")
    assert natural_sd(found.model, found.data.prior)[found.free] == pytest.approx([1 / np.sqrt(12), 0.03])
    verdicts = identify(fm.laplace(found, seed=1))
    scale = next(v for v in verdicts.verdicts if v.name == "scale")
    assert scale.state == STATES[2]
    assert abs(scale.contraction) < CONTRACTED / 2
    assert verdicts.state("kd") == "determined"  # to 3 %
    (group,) = verdicts.groups
    assert group.combination is not None
    assert group.combination.name == "kd·g"
    assert group.combination.relative == pytest.approx(0.01 / np.sqrt(60), rel=0.2)  # σ is known to 1/√(2·60)


@pytest.mark.study
def test_what_is_determined_is_quoted_narrowly() -> None:
    """Random surfaces of two lobes, which neither model follows: what is determined is quoted to better than a tenth.

    Of the value, or of its range; what is weakly determined, to better than what √½ of a flat prior's sd leaves.
    """
    told = set()
    for seed in range(10):
        rng = np.random.default_rng(seed)
        at, alpha, share = rng.choice([0.0, 20.0, 40.0]), rng.uniform(0.05, 0.3), rng.uniform(0.0, 0.6)
        incidences = at + rng.choice([0.1, 10.0]) * np.arange(3)
        lobes = [fm.model("lambert+ggx", kd=rng.uniform(0.05, 0.8), alpha=a) for a in (alpha, min(3 * alpha, 0.9))]
        theta_i, theta_o = (p.ravel() for p in np.deg2rad(np.meshgrid(incidences, np.arange(-75, 76, 5))))
        wi, wo = from_angles(theta_i, 0.0 * theta_i), from_angles(np.abs(theta_o), np.where(theta_o < 0, 0.0, np.pi))
        exact = sum(w * fm.evaluate(m, wi, wo)[:, 0] for w, m in zip((1.0 - share, share), lobes, strict=True))
        sigma = 10.0 ** rng.uniform(-2.5, -1.0) * exact
        m = fm.from_arrays(theta_i, theta_o, exact + sigma * rng.normal(size=len(sigma)), sigma=sigma)
        fit = fm.fit(m, ("lambert+ggx", "lambert+blinn-phong")[seed % 2])
        posterior = fm.laplace(fit, seed=seed)
        for verdict in identify(posterior).verdicts:
            quantity, param = posterior[verdict.name], next(e.param for e in fit.entries if e.name == verdict.name)
            low, high = np.log(quantity.ci95[0]) if param.scale == "log" else quantity.ci95[0]
            span = np.log(param.upper / param.lower) if param.scale == "log" else param.upper - param.lower
            tenth = 0.1 if param.scale == "log" else 0.1 * max(abs(quantity.value[0]), 0.01 * span)
            most = {"determined": tenth, "weakly determined": span / np.sqrt(24.0), "not determined": np.inf}
            assert (high - low) / (2 * 1.96) <= most[verdict.state], (seed, quantity, verdict)
            told.add((verdict.state, quantity.remarks[0]))
    assert {state for state, _ in told} == set(STATES)
    assert ("determined", "not determined") not in told


def test_nothing_free_is_said(ordinary: Fit) -> None:
    fixed = dataclasses.replace(ordinary, held={name: np.ones(1) for name in ("kd", "ks", "alpha", "eta")})
    held = identify(Posterior(fixed, "laplace", ordinary.values[None], np.zeros(1)))
    assert held.words == "lambert+ggx has no free parameter to determine."
    assert str(held) == "lambert+ggx: lambert+ggx has no free parameter to determine."
    with pytest.raises(KeyError, match="kd"):
        held.state("kd")
