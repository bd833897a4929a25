"""Completing: held-out readings are inferred better than by the model or by what is nearest, as well as they say."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.measurements.samples import Measurements


def surface(seed: int = 1) -> tuple[Measurements, np.ndarray]:
    """Two lobes, which no single one follows, with 2 % noise; and its true values."""
    i, o, phi = np.meshgrid(
        [5.0, 20.0, 40.0, 60.0], np.arange(0.0, 80.0, 7.5), np.arange(0.0, 181.0, 30.0), indexing="ij"
    )
    wi, wo = fm.directions(i.ravel(), 0.0, degrees=True), fm.directions(o.ravel(), phi.ravel(), degrees=True)
    sharp = fm.model("lambert+ggx", channels=2, kd=np.array([0.2, 0.1]), ks=0.6, alpha=0.12, eta=1.5)
    broad = fm.model("lambert+ggx", channels=2, kd=0.0, ks=1.0, alpha=0.6, eta=1.5)
    truth = np.asarray(fm.evaluate(sharp, wi, wo)) + np.asarray(fm.evaluate(broad, wi, wo))
    sigma = 0.02 * truth + 1e-3
    value = truth + sigma * np.random.default_rng(seed).normal(size=truth.shape)
    return Measurements(wi, wo, value, sigma, np.ones(truth.shape, bool), ("a", "b")), truth


@pytest.fixture(scope="module")
def holes() -> tuple[Measurements, np.ndarray, np.ndarray, fm.Posterior]:
    """The surface, its true values, which rows are held out, and the posterior of the rest."""
    m, truth = surface()
    held = np.random.default_rng(3).random(m.n_samples) < 0.3
    return m, truth, held, fm.laplace(fm.fit(m.rows(np.flatnonzero(~held)), "lambert+ggx"), seed=0)


def cubic(error: np.ndarray, truth: np.ndarray) -> float:
    """Root mean square of ∛f's error."""
    return float(np.sqrt(np.mean((np.cbrt(error) - np.cbrt(truth)) ** 2)))


def test_held_out_readings_are_as_near_as_they_say(holes: Any) -> None:
    m, truth, held, posterior = holes
    found = posterior.complete(m.wi[held], m.wo[held])
    value, sd = (part[found.inferred.all(axis=1)] for part in (found.value, found.sigma))
    true = truth[held]
    assert 0.9 < np.mean(np.abs(value - true) <= 2.0 * sd) <= 1.0
    apart = np.linalg.norm(
        np.concatenate([m.wi, m.wo], axis=1)[held][:, None] - np.concatenate([m.wi, m.wo], axis=1)[~held], axis=-1
    )
    nearest = m.value[~held][apart.argmin(axis=1)]
    model = fm.evaluate(posterior.fit.model, m.wi[held], m.wo[held])
    error = cubic(value, true)
    assert error < 0.8 * cubic(np.asarray(model), true)
    assert error < 0.5 * cubic(nearest, true)
    assert np.median(sd / value) < 0.1


def test_what_was_measured_stays_and_is_told_apart(holes: Any) -> None:
    m, _, held, posterior = holes
    known = m.rows(np.flatnonzero(~held))
    found = posterior.complete(m.wi[held], m.wo[held])
    count = known.n_samples
    assert not found.inferred[:count].any()
    assert found.inferred[count:].all()
    for name in ("wi", "wo", "value", "sigma"):
        assert (getattr(found, name)[:count] == getattr(known, name)).all()
    assert found.valid.all()


@pytest.mark.study
def test_a_row_with_one_channel_masked_keeps_the_other(holes: Any) -> None:
    m, truth, held, _ = holes
    known = m.rows(np.flatnonzero(~held))
    valid = np.array(known.valid)
    valid[7, 1] = False
    valid[11] = False
    some = Measurements(known.wi, known.wo, np.where(valid, known.value, 0.0), known.sigma, valid, known.channels)
    posterior = fm.laplace(fm.fit(some, "lambert+ggx"), seed=0)
    found = posterior.complete(m.wi[held][:1], m.wo[held][:1])
    assert found.inferred is not None
    assert found.sigma is not None
    assert not found.inferred[:-2].any()
    assert found.inferred[-2:].tolist() == [[False, True], [True, True]]
    assert found.value[-2, 0] == known.value[7, 0]
    assert found.sigma[-2, 0] == known.sigma[7, 0]
    row = np.flatnonzero(~held)[7]
    assert abs(found.value[-2, 1] - truth[row, 1]) < 4.0 * found.sigma[-2, 1]


@pytest.mark.study
def test_a_model_that_follows_leaves_its_own_uncertainty() -> None:
    """Nothing to carry over: the values are the model's, and the sd covers the truth without being much wider."""
    truth = fm.model("lambert+ggx", kd=0.3, ks=1.0, alpha=0.3, eta=1.5)
    theta_i, theta_o = np.deg2rad(np.meshgrid([10.0, 40.0, 70.0], np.arange(-75.0, 76.0, 5.0)))
    m = fm.simulate(truth, theta_i.ravel(), theta_o.ravel(), relative_noise=0.02, absolute_noise=1e-3, seed=2)
    rows = np.arange(m.n_samples) % 3 == 0
    posterior = fm.laplace(fm.fit(m.rows(np.flatnonzero(~rows)), "lambert+ggx"), seed=0)
    found = posterior.complete(m.wi[rows], m.wo[rows])
    assert found.inferred is not None
    assert found.sigma is not None
    value, sd = (part[found.inferred.all(axis=1)] for part in (found.value, found.sigma))
    true = np.asarray(fm.evaluate(truth, m.wi[rows], m.wo[rows]))
    assert np.mean(np.abs(value - true) <= 2.0 * sd) > 0.9
    assert np.median(sd / true) < 0.02


def test_what_cannot_be_inferred_is_said(holes: Any) -> None:
    m, _, held, posterior = holes
    with pytest.raises(FitmatError, match=r"wi is an array of shape \(3, 2\), expected unit vectors above the surface"):
        posterior.complete(np.zeros((3, 2)), m.wo[:3])
    with pytest.raises(FitmatError, match=r"wo row 1 has length 2: expected unit vectors"):
        posterior.complete(m.wi[:2], m.wo[:2] * [[1.0], [2.0]])
    with pytest.raises(FitmatError, match=r"2 rows of wi and 3 of wo, expected as many"):
        posterior.complete(m.wi[:2], m.wo[:3])
    with pytest.raises(FitmatError, match=r"no value is masked, and wi has no row, expected one to infer"):
        posterior.complete(m.wi[:0], m.wo[:0])
    aim = fm.laplace(fm.fit(m.rows(np.flatnonzero(~held)), "lambert", loss="log10"), seed=0)
    with pytest.raises(FitmatError, match=r"nothing can be inferred, for the loss log10 gives no interval; exp"):
        aim.complete(m.wi[:1], m.wo[:1])


@pytest.mark.study
def test_gaps_of_a_laboratorys_reading(shared_data: Path) -> None:
    """Black anodise, three of ten readings held out at random."""
    m = fm.read(shared_data / "ua-loft" / "zemax" / "AnoBlackEC1onAlum.bsdf")
    m = m.rows(np.flatnonzero(m.valid.all(axis=1)))
    held = np.random.default_rng(0).random(m.n_samples) < 0.3
    posterior = fm.laplace(fm.fit(m.rows(np.flatnonzero(~held)), "lambert+ggx"), seed=0)
    found = posterior.complete(m.wi[held], m.wo[held])
    assert found.inferred is not None
    assert found.sigma is not None
    value, sd = (part[found.inferred.all(axis=1)] for part in (found.value, found.sigma))
    assert np.mean(np.abs(value - m.value[held]) <= 2.0 * sd) > 0.9
    model = np.asarray(fm.evaluate(posterior.fit.model, m.wi[held], m.wo[held]))
    assert cubic(value, m.value[held]) < 0.9 * cubic(model, m.value[held])
