"""Kriging: predictions are those of all values at once, sizes are found again, and errors are as large as they say."""

import numpy as np
import pytest

from fitmat.maths.kriging import NEIGHBOURS, Kriging, kriging
from fitmat.maths.matern import matern


def field(places: np.ndarray, lengths: np.ndarray, rng: np.random.Generator, kinds: int = 3) -> np.ndarray:
    """Draws of Matérn's process of variance 1, by the root of its whole covariance."""
    apart = np.linalg.norm((places[:, None] - places) / lengths, axis=-1)
    return np.linalg.cholesky(matern(apart) + 1e-9 * np.eye(len(places))) @ rng.normal(size=(len(places), kinds))


def test_predictions_are_those_of_the_whole_covariance() -> None:
    """Of as few as are all neighbours: K* (K + N)⁻¹ y and its variance (Rasmussen & Williams 2006, (2.23), (2.24))."""
    rng = np.random.default_rng(0)
    known, asked = rng.uniform(size=(NEIGHBOURS, 2)), rng.uniform(size=(5, 2))
    noise, y = rng.uniform(0.01, 0.1, NEIGHBOURS), rng.normal(size=(NEIGHBOURS, 1))
    k = Kriging(known, y, noise, np.ones(2), 2.0, 0.3, np.ones((1, 4)))
    (part,) = k.predicted(asked, np.zeros(5, int))

    def covariance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        q = np.sqrt(3.0) * np.sqrt(((a[:, None] - b[None]) ** 2).sum(axis=-1))
        return 2.0 * (1.0 + q) * np.exp(-q)

    whole = np.linalg.inv(covariance(known, known) + np.diag(noise + 0.3))
    across = covariance(asked, known)
    found = np.sum(part.weights * y[part.near, 0], axis=1)
    assert found == pytest.approx((across @ whole @ y)[:, 0], rel=1e-6)
    assert part.sd**2 == pytest.approx(2.3 - np.einsum("ij,jk,ik->i", across, whole, across), rel=1e-6)


def test_sizes_and_errors_are_those_of_the_field() -> None:
    """Held out at random: 95 % within 1.96 errors, which are about as large as the errors that are made."""
    rng, lengths = np.random.default_rng(1), np.array([0.3, 0.8])
    places = rng.uniform(size=(700, 2)) * 2.0
    y = field(places, lengths, rng)
    noise = np.full(500, 0.05**2)
    k = kriging(places[:500], y[:500] + 0.05 * rng.normal(size=(500, 3)), noise, np.zeros(500, int))
    assert k.lengths == pytest.approx(lengths, rel=0.5)
    assert 0.4 < k.process < 2.5  # which trades off with the lengths
    assert k.own < 0.02
    (part,) = k.predicted(places[500:], np.zeros(200, int))
    error = np.einsum("mk,mkc->mc", part.weights, k.rest[part.near]) - y[500:]
    assert 0.92 < np.mean(np.abs(error) < 1.96 * part.sd[:, None]) < 0.995
    assert np.sqrt(np.mean(error**2)) < 0.35 * np.std(y)


def test_errors_are_stretched_where_neighbours_mislead() -> None:
    """A field that no even process describes: quiet on one side, and restless on the other."""
    rng = np.random.default_rng(2)
    places = rng.uniform(size=(600, 1)) * 10.0
    y = field(places, np.ones(1), rng, 1) * np.where(places < 7.5, 0.05, 1.0)
    k = kriging(places[:400], y[:400], np.full(400, 1e-6), np.zeros(400, int))
    assert k.stretch.max() > 1.2
    (part,) = k.predicted(places[400:], np.zeros(200, int))
    error = (part.weights * k.rest[part.near, 0]).sum(axis=1) - y[400:, 0]
    assert np.mean(np.abs(error) < 1.96 * part.sd) > 0.92


def test_each_sort_of_place_has_a_stretch_of_its_own() -> None:
    """Of the same field, errors are stretched on the restless side only; an unknown sort is judged as the last."""
    rng = np.random.default_rng(2)
    places = rng.uniform(size=(600, 1)) * 10.0
    y = field(places, np.ones(1), rng, 1) * np.where(places < 7.5, 0.05, 1.0)
    sorts = (places[:, 0] >= 7.5).astype(int)
    k = kriging(places[:400], y[:400], np.full(400, 1e-6), sorts[:400])
    assert k.stretch[0] == pytest.approx(np.ones(4))
    assert k.stretch[1].max() > 1.4
    (part,) = k.predicted(places[400:], sorts[400:])
    error = np.abs((part.weights * k.rest[part.near, 0]).sum(axis=1) - y[400:, 0])
    assert np.mean((error < 1.96 * part.sd)[sorts[400:] == 1]) > 0.85
    (same,) = k.predicted(places[400:], 5 * sorts[400:])
    assert (same.sd == part.sd).all()
