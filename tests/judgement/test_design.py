"""Designs: against a closed form, and against what refits with the proposed samples find."""

import dataclasses
import functools
import json
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image

import fitmat as fm
from fitmat.cli import design as plan
from fitmat.errors import FitmatError, OutputError
from fitmat.fitting.result import Fit
from fitmat.judgement.design.candidates import Limits, proposed
from fitmat.judgement.design.design import Design, Proposal
from fitmat.judgement.design.filters import _assimilated, news
from fitmat.judgement.design.likeness import Likeness
from fitmat.reports.pictures import refuse_picture

CATALOGUE = Path(__file__).parents[2] / "data" / "synthetic"

HOLDS = 0.25
"""Relative: a standard deviation after a measurement is predicted at least so well."""

CLOSED = 5e-3
"""Relative: 32 Gaussians over ±4 standard deviations stand for one."""

SEEDS = range(4)


def joined(one: fm.Measurements, other: fm.Measurements) -> fm.Measurements:
    assert one.sigma is not None
    assert other.sigma is not None
    parts = {n: np.concatenate([getattr(one, n), getattr(other, n)]) for n in ("wi", "wo", "value", "sigma", "valid")}
    return dataclasses.replace(one, **parts)


def taken(truth: np.ndarray, p: Proposal, seed: int) -> fm.Measurements:
    """The proposal measured on lambert+ggx of the given parameters, with the noise of the catalogue."""
    material = fm.model("lambert+ggx", **dict(zip(("kd", "ks", "alpha", "eta"), truth, strict=True)))
    place = functools.partial(fm.simulate, material, [p.theta_i], p.theta_o, phi=p.phi)
    once = [place(relative_noise=0.02, absolute_noise=1e-3, seed=100 * seed + k) for k in range(p.repeats)]
    found = once[0]
    for more in once[1:]:
        found = joined(found, more)
    return found


def refitted(m: fm.Measurements, truth: np.ndarray, p: Proposal) -> np.ndarray:
    """Root-mean-square sd of ln η over refits with the proposal."""
    fits = [fm.fit(joined(m, taken(truth, p, seed)), "lambert+ggx") for seed in SEEDS]
    return np.sqrt(np.mean([f.covariance[3, 3] / f.values[3] ** 2 for f in fits]))


@pytest.fixture(scope="module")
def lambert() -> Fit:
    """60 samples of albedo 0.5 with σ = 0.01, exactly on the model, so that s is 0."""
    m = fm.from_arrays(np.linspace(0, 1.2, 60), 0.3, np.full(60, 0.5 / np.pi), sigma=np.full(60, 0.01))
    return fm.fit(m, "lambert")


@pytest.fixture(scope="module")
def blind() -> Fit:
    return fm.fit(fm.read(CATALOGUE / "normal-incidence.csv"), "lambert+ggx")


@pytest.fixture(scope="module")
def for_eta(blind: Fit) -> Design:
    return fm.next_angles(fm.laplace(blind, seed=1), target="eta", count=2)


@pytest.mark.parametrize("target", [None, "kd"])
def test_a_sample_of_a_lambert_surface_adds_what_every_other_does(lambert: Fit, target: str | None) -> None:
    """f = kd/π with constant σ: var(kd) = π²σ²/n wherever the n samples are."""
    design = fm.next_angles(fm.laplace(lambert, seed=1), target=target, count=2, repeats=3)
    assert design.sd == pytest.approx([np.pi * 0.01 / np.sqrt(60)], rel=CLOSED)
    np.testing.assert_allclose(design.gains, np.sqrt(63 / 60), rtol=CLOSED)
    assert design.proposals[1].sd == pytest.approx([np.pi * 0.01 / np.sqrt(66)], rel=CLOSED)


def test_a_filter_is_the_gaussian_posterior() -> None:
    """Five data one after the other, against the normal equations and the density of all five together."""
    rng = np.random.default_rng(1)
    root, slopes, data = rng.normal(size=(3, 3)), rng.normal(size=(5, 3)), rng.normal(size=5)
    prior = root @ root.T
    state = (jnp.zeros((1, 1)), jnp.zeros((1, 1, 3)), jnp.asarray(prior)[None], jnp.zeros((1, 1)))
    for slope, datum in zip(slopes, data, strict=True):
        state = _assimilated(state, jnp.asarray(slope)[None], jnp.full((1, 1), datum))
    logs, shift, covariance, squares = (np.asarray(part).squeeze() for part in state)
    after = np.linalg.inv(np.linalg.inv(prior) + slopes.T @ slopes)
    np.testing.assert_allclose(covariance, after, rtol=1e-9)  # rounding
    np.testing.assert_allclose(shift, after @ slopes.T @ data, rtol=1e-9)
    joint = np.eye(5) + slopes @ prior @ slopes.T
    assert squares == pytest.approx(data @ np.linalg.solve(joint, data))
    assert logs == pytest.approx(-0.5 * (squares + np.linalg.slogdet(joint)[1]))


@pytest.mark.parametrize(("beside", "repeats"), [(0.0, 1.0), (1.0, 1.0), (4.0, 3.0)])
def test_readings_of_one_misfit_tell_what_they_do_together(beside: float, repeats: float) -> None:
    """1ᵀΣ⁻¹1 of readings with Σ = σ² I + s² 1 1ᵀ, those beside taken off, over that of one reading."""
    x, noise, s = 0.3, 0.01, 0.02
    root = noise / (3.0 * (x + noise) ** (2.0 / 3.0))  # σ of ∛x

    def information(n: int) -> float:
        return np.linalg.inv(root**2 * np.eye(n) + s**2).sum()

    expected = (information(int(beside + repeats)) - information(int(beside))) * (root**2 + s**2)
    assert float(news(jnp.array(x), jnp.array(noise), jnp.array(s), jnp.array(beside), jnp.array(repeats))) == (
        pytest.approx(expected)
    )
    assert float(news(jnp.array(x), jnp.array(noise), jnp.array(0.0), jnp.array(beside), jnp.array(repeats))) == repeats


def test_what_is_measured_counts_beside_a_candidate(blind: Fit) -> None:
    """At normal incidence all lies in the file; what is taken counts once more at its own place, and less far off."""
    looked = proposed(blind, "sample", Limits(in_plane=True))
    found = Likeness(blind, looked, 2)
    before = found.beside.copy()
    chosen = int(np.argmin(before))
    assert before.min() < 0.1 * before.max()
    found.take(chosen)
    more = found.beside - before
    assert more[chosen] == pytest.approx(2.0)
    assert more.min() < 0.1
    scans = proposed(blind, "curve", Limits())
    np.testing.assert_array_equal(Likeness(blind, scans, 1).beside < 0.0, ~scans.used)


@pytest.mark.study
def test_a_blind_file_is_sent_to_an_angle_that_sees(blind: Fit, for_eta: Design) -> None:
    """At normal incidence nothing tells η; near grazing reflectance does. The promise holds whatever the truth is."""
    first = for_eta.proposals[0]
    assert np.rad2deg(first.theta_i) > 60
    assert first.theta_o[0] == pytest.approx(first.theta_i, abs=np.deg2rad(10))
    for k in (4, 11):
        truth = for_eta.truths[k]
        found = refitted(blind.measurements, np.array([truth[0], truth[1], np.exp(truth[2]), np.exp(truth[3])]), first)
        shrinks = for_eta.sd[3] / found
        assert shrinks > 30
        assert for_eta.sd[3] / first.sd_if[k, 3] == pytest.approx(shrinks, rel=HOLDS)


@pytest.mark.study
def test_the_catalogues_truth_is_told_as_promised(blind: Fit, for_eta: Design) -> None:
    first = for_eta.proposals[0]
    promised = np.interp(np.log(1.5), for_eta.truths[::-1, 3], first.sd_if[::-1, 3])
    found = refitted(blind.measurements, np.array([0.3, 1.0, 0.05, 1.5]), first)
    assert for_eta.sd[3] / promised == pytest.approx(for_eta.sd[3] / found, rel=HOLDS)


@pytest.mark.study
def test_an_ordinary_file_gains_what_is_promised() -> None:
    m = fm.read(CATALOGUE / "one-curve.csv")
    posterior = fm.laplace(fm.fit(m, "lambert+ggx"), seed=1)
    design = fm.next_angles(posterior, target="eta", count=1, repeats=4)
    found = refitted(m, np.array([0.3, 1.0, 0.2, 1.5]), design.proposals[0])
    assert design.proposals[0].gain > 1.3
    assert design.sd[3] / found == pytest.approx(design.proposals[0].gain, rel=HOLDS)
    assert design.sd[3] == pytest.approx(posterior.fit.covariance[3, 3] ** 0.5 / posterior.fit.values[3], rel=0.05)


@pytest.mark.study
def test_the_match_is_asked_where_the_models_differ(blind: Fit) -> None:
    """By the fitted models alone: |f − f'| over the noise is near its largest at the proposal."""
    rival = fm.fit(blind.measurements, "lambert")
    one, other = fm.laplace(blind, seed=1), fm.laplace(rival, seed=1)
    design = fm.next_angles(one, target="match", against=other, count=1)
    wi, wo = (w[:, 0] for w in design.candidates.directions())
    first, second = fm.evaluate(blind.model, wi, wo)[:, 0], fm.evaluate(rival.model, wi, wo)[:, 0]
    apart = np.cbrt(wi[:, 2]) * np.abs(np.cbrt(first) - np.cbrt(second))
    chosen = np.argmax(design.gains)
    assert apart[chosen] > np.quantile(apart, 0.95)
    assert design.rival is rival
    assert "To tell lambert+ggx from lambert," in plan.as_text(design)


def test_what_an_instrument_cannot_do_is_left_out(lambert: Fit) -> None:
    for kind in ("sample", "curve"):
        looked = proposed(lambert, kind, Limits(steepest=60, retro=10))
        wi, wo = (w[looked.used] for w in looked.directions())
        assert np.rad2deg(np.arccos(np.minimum(wi[:, 2], wo[:, 2]).min())) < 60.001
        assert np.rad2deg(np.arccos((wi * wo).sum(axis=1).max())) > 9.999


@pytest.mark.study
def test_proposals_differ(for_eta: Design) -> None:
    (wi, wo), both = for_eta.candidates.directions(), for_eta.proposals
    assert len(wi) == len(wo) == len(for_eta.gains)
    assert max(abs(both[0].theta_i - both[1].theta_i), abs(both[0].theta_o - both[1].theta_o)[0]) > np.deg2rad(4.8)


def test_what_cannot_be_planned_is_refused(lambert: Fit) -> None:
    posterior = fm.laplace(lambert, seed=1)
    with pytest.raises(FitmatError, match="'eta' is no free parameter of lambert: expected kd"):
        fm.next_angles(posterior, target="eta")
    with pytest.raises(FitmatError, match="asked of two only: give a second model"):
        fm.next_angles(posterior, target="match")
    with pytest.raises(FitmatError, match="count 9, repeats 1: expected 1 to 8"):
        fm.next_angles(posterior, count=9)
    held = dataclasses.replace(lambert, held={"kd": np.array([0.5])})
    with pytest.raises(FitmatError, match="every parameter is fixed"):
        fm.next_angles(dataclasses.replace(posterior, fit=held))
    with pytest.raises(FitmatError, match="there is nothing to plan from"):
        fm.next_angles(dataclasses.replace(posterior, fit=dataclasses.replace(lambert, log_likelihood=np.nan)))


def test_a_plan_is_shown_as_text_as_json_and_drawn(lambert: Fit, tmp_path: Path) -> None:
    posterior, picture = fm.laplace(lambert, seed=1), tmp_path / "plan.png"
    found = plan.propose([posterior], "kd", count=2)
    plan.draw(found, picture)
    with Image.open(picture) as image:
        assert min(image.size) > 300
    assert "For kd of lambert, the sample that tells most: light at" in plan.as_text(found)
    assert "kd ± 0.0041 → ± 0.004" in plan.as_text(found)
    told = json.loads(plan.as_json(found))
    assert [len(p["theta_o_deg"]) for p in told["proposals"]] == [1, 1]
    assert told["sd_before"]["kd"] == {"sd": pytest.approx(found.sd[0]), "of": "value"}
    with pytest.raises(OutputError, match=r"plan.png: already exists; choose another name, or --force"):
        refuse_picture(picture, force=False)
    with pytest.raises(OutputError, match=r"plan.txt: no picture, expected a name that ends in png, svg, pdf"):
        refuse_picture(tmp_path / "plan.txt", force=False)
    curves = fm.next_angles(posterior, kind="curve", count=1)
    samples = curves.candidates.used.sum(axis=1)
    np.testing.assert_allclose(curves.gains, np.sqrt(1 + samples / 60), rtol=CLOSED)
    ax = fm.plot.design(curves)
    assert ax.get_xlabel() == "incidence θᵢ / °"
