"""The second sampler: against closed forms, beside emcee, and what it says where they differ."""

import dataclasses
import sys

import numpy as np
import pytest
from scipy import stats

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.uncertainty.posterior import Posterior
from fitmat.uncertainty.second_sampler import AGREEING, SecondOpinion, compare_chains


def cut_off(loss: str) -> Posterior:
    """Albedo 0.98 ± 0.02, which ends at 1, sampled by emcee."""
    theta = np.linspace(0.0, 1.2, 31)
    value = 0.98 / np.pi * (1 + 0.1 * np.random.default_rng(3).normal(size=31))
    m = fm.from_arrays(theta, 0.3, value, sigma=np.full(31, 0.1 * 0.98 / np.pi))
    return fm.sample(fm.fit(m, "lambert", loss=loss), seed=1)


@pytest.fixture(scope="module")
def exact() -> SecondOpinion:
    """Without discrepancy the posterior of the albedo is a Gaussian that ends at the bounds."""
    return fm.check_posterior(cut_off("gaussian"), seed=2)


@pytest.fixture(scope="module")
def inferred() -> SecondOpinion:
    """With the discrepancy inferred."""
    return fm.check_posterior(cut_off("default"), seed=2)


@pytest.mark.study
def test_both_samplers_find_the_truncated_gaussian(exact: SecondOpinion) -> None:
    """y = k_d/π + σ ε: the posterior of k_d is Gaussian with the weighted mean, cut off at 1."""
    m = exact.posterior.fit.measurements
    assert m.sigma is not None
    sd = np.pi * np.sum(m.sigma[:, 0] ** -2.0) ** -0.5
    mean = np.pi * np.average(m.value[:, 0], weights=m.sigma[:, 0] ** -2.0)
    truth = stats.truncnorm(-mean / sd, (1.0 - mean) / sd, loc=mean, scale=sd)
    numbers = np.array([truth.mean(), *truth.ppf([0.025, 0.975])])
    (albedo,) = exact.agreements  # no discrepancy is inferred, so that none is compared
    for found in (albedo.first, albedo.second):
        assert np.all(np.abs(found - numbers) < AGREEING * albedo.error)
    assert albedo.error.max() < 0.1 * truth.std()  # sharp enough to notice
    assert exact.verdict == "agree"


@pytest.mark.study
def test_nuts_agrees_with_emcee_where_the_discrepancy_is_inferred(inferred: SecondOpinion) -> None:
    assert [a.name for a in inferred.agreements] == ["kd", "discrepancy"]
    assert inferred.verdict == "agree"
    assert inferred.words == "lambert: two samplers that share no move agree on all means and 95 % limits."
    assert "kd" in str(inferred)
    assert inferred._repr_html_().count("agree") >= 3


def chains(posterior: Posterior) -> np.ndarray:
    """The posterior's own walkers as if they were another sampler's."""
    assert posterior.chain is not None
    return np.swapaxes(posterior.chain, 0, 1)


@pytest.mark.study
def test_a_shifted_mean_and_a_narrow_tail_are_noticed(inferred: SecondOpinion) -> None:
    posterior = inferred.posterior
    other = chains(posterior)
    assert compare_chains(posterior, other).verdict == "agree"
    shifted = other - [0.3 * other[..., 0].std(), 0.0]
    found = compare_chains(posterior, shifted)
    assert found.verdict == "disagree"
    assert "do not agree (kd: disagree: the " in found.words
    assert found.agreements[1].agrees
    centre = other.mean(axis=(0, 1))
    narrow = compare_chains(posterior, centre + 0.7 * (other - centre))
    assert narrow.verdict == "disagree"
    assert "limit differs by" in narrow.words


@pytest.mark.study
def test_a_second_sampler_that_did_not_converge_has_no_say(inferred: SecondOpinion) -> None:
    posterior = inferred.posterior
    other = chains(posterior)
    apart = other + np.linspace(0.0, 3.0 * other[..., 0].std(), len(other))[:, None, None] * [1.0, 0.0]
    for opinion in (compare_chains(posterior, apart), compare_chains(posterior, other, diverging=0.02)):
        assert opinion.verdict == "unsure"
        assert "no second opinion, the second sampler did not converge" in opinion.words
    assert compare_chains(posterior, other[:, :20]).verdict == "unsure"  # too few draws


def test_a_missing_sampler_is_said_before_anything_is_sampled(
    inferred: SecondOpinion, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "blackjax", None)
    with pytest.raises(FitmatError, match=r"NUTS needs the package blackjax, .* pip install 'fitmat\[nuts\]'\.$"):
        fm.check_posterior(dataclasses.replace(inferred.posterior, chain=None), seed=1)


@pytest.mark.study
def test_without_a_chain_there_is_nothing_to_check(inferred: SecondOpinion) -> None:
    bare = dataclasses.replace(inferred.posterior, chain=None)
    with pytest.raises(FitmatError, match=r"lambert: was not sampled, so that there is no chain to check; sample it "):
        fm.check_posterior(bare, seed=1)
    with pytest.raises(FitmatError, match=r"lambert: was not sampled, so that there is no chain to compare"):
        compare_chains(bare, np.zeros((4, 10, 2)))
