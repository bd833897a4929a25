"""Smoothness: the posterior is that of its definition, learns how far neighbours differ, and holds the truth."""

from typing import Any

import numpy as np
import pytest
from scipy import stats
from scipy.fft import dctn, idctn

from fitmat.maths import smoothness as module
from fitmat.maths.smoothness import FREEDOM, STILL, smoothness


def laplacian(right: np.ndarray, down: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Differences of neighbours as rows, those to the right first; the weight of each; which lie inside the grid."""
    rows, columns = right.shape
    number, differences, weights = np.arange(right.size).reshape(right.shape), [], []
    for row in range(rows):
        for column in range(columns):
            for c, i, j in ((right, row, column + 1), (down, row + 1, column)):
                if i < rows and j < columns:
                    d = np.zeros(right.size)
                    d[number[row, column]], d[number[i, j]] = -1.0, 1.0
                    differences.append(d)
                    weights.append(c[row, column])
    d, w = np.array(differences), np.array(weights)
    return d, w, d.T @ (w[:, None] * d)


def drawn(shape: tuple[int, int], tau: float, rng: np.random.Generator) -> np.ndarray:
    """A normal field whose precision is the Laplacian over τ², exactly, by its cosines (Rue and Held, sec. 2.6)."""
    squares = [2.0 - 2.0 * np.cos(np.pi * np.arange(n) / n) for n in shape]
    values = squares[0][:, None] + squares[1]
    values[0, 0] = np.inf
    return np.asarray(idctn(tau / np.sqrt(values) * rng.normal(size=shape), norm="ortho"))


def apart(x: np.ndarray) -> float:
    """Root mean square of the differences of neighbours."""
    return float(np.sqrt(np.mean(np.concatenate([np.diff(x, axis=k).ravel() ** 2 for k in (0, 1)]))))


def test_the_posterior_is_that_of_its_definition() -> None:
    """By the inverse of the whole matrix, on 6 × 7 points with holes; and weights and scale solve their equations."""
    rng = np.random.default_rng(1)
    sd = rng.uniform(0.2, 1.0, (6, 7))
    y = drawn((6, 7), 1.0, rng) + np.where(np.arange(7) > 3, 30.0, 0.0) + sd * rng.normal(size=(6, 7))
    y[2:4, 1:3], sd[0, 5] = np.nan, np.nan
    found = smoothness(y, sd)
    used = np.isfinite(y) & np.isfinite(sd)
    precision = np.where(used, 1.0 / sd**2, 0.0).ravel()
    d, c, edges = laplacian(np.asarray(found.lattice.right), np.asarray(found.lattice.down))
    covariance = np.linalg.inv(np.diag(precision) + edges)
    mean = covariance @ (precision * np.where(used, y, 0.0).ravel())
    np.testing.assert_allclose(found.mean.ravel(), mean, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.sd.ravel(), np.sqrt(np.diag(covariance)), rtol=1e-9)
    square = found.scale**2
    expected = (d @ mean) ** 2 + np.einsum("ei,ij,ej->e", d, covariance, d)
    student = stats.t.pdf(np.sqrt(expected), FREEDOM, scale=found.scale) * (1.0 - found.cut)
    uniform = found.cut / (2.0 * (np.ptp(y[used]) + 2.0 * np.median(sd[used])))
    off = np.log(c * square * (FREEDOM + expected / square) / (FREEDOM + 1.0) * (1.0 + uniform / student))
    assert found.cut == pytest.approx(np.mean(uniform / (uniform + student)), rel=0.02)
    assert found.cut == pytest.approx(6 / (6 * 6 + 5 * 7), rel=0.1)
    assert np.sqrt(np.mean(off**2)) < 1.1 * STILL
    # d/d ln τ of −(n − 2) ln τ + ln τ − ½ Σ c ⟨d²⟩ is 0: there are two materials.
    determined = np.sum(precision * np.diag(covariance))
    assert np.sum(c * (d @ mean) ** 2) == pytest.approx(determined - 3.0, rel=3.0 * STILL, abs=0.02)


@pytest.mark.parametrize(("noise", "jump"), [(0.5, 0.0), (1.0, 8.0), (3.0, 0.0)])
def test_a_sampler_of_the_whole_posterior_agrees(noise: float, jump: float) -> None:
    """Gibbs' draws of the field given the weights and of these given the field, at the scale that was learnt.

    A product of densities has narrower ones than the whole: deviations are 5 to 12 % less, which the scale makes up
    for in fields that are normal. Monte Carlo errors are a tenth of that.
    """
    rng, shape = np.random.default_rng(4), (8, 9)
    sd = noise * rng.uniform(0.5, 1.5, shape)
    y = drawn(shape, 1.0, rng) + np.where(np.arange(9) > 4, jump, 0.0) + sd * rng.normal(size=shape)
    y[2:4, 1:3] = np.nan
    found = smoothness(y, sd)
    precision, moment = np.where(np.isfinite([y, y]), [sd**-2.0, y / sd**2], 0.0).reshape(2, -1)
    d, weights, _ = laplacian(np.ones(shape), np.ones(shape))
    kept = []
    for _ in range(5000):
        upper = np.linalg.cholesky(np.diag(precision) + d.T @ (weights[:, None] / found.scale**2 * d)).T
        x = np.linalg.solve(upper, np.linalg.solve(upper.T, moment) + rng.normal(size=y.size))
        weights = rng.gamma((FREEDOM + 1.0) / 2.0, 2.0 / (FREEDOM + (d @ x / found.scale) ** 2))
        kept.append(x)
    mean, spread = np.mean(kept[500:], axis=0), np.std(kept[500:], axis=0)
    assert np.sqrt(np.mean(((found.mean.ravel() - mean) / spread) ** 2)) < 0.15
    ratio = found.sd.ravel() / spread
    assert 0.86 < np.mean(ratio) < 1.0
    assert 0.75 < ratio.min() < ratio.max() < 1.03


@pytest.mark.parametrize(
    ("noise", "shape", "fields"), [(0.3, (60, 60), 3), (1.0, (60, 60), 3), (4.0, (60, 60), 12), (1.0, (96, 80), 2)]
)
def test_a_field_is_recovered(noise: float, shape: tuple[int, int], fields: int) -> None:
    """Drawn from the normal prior. Its 95 % intervals hold 93 to 97 % of it, by elimination and by draws.

    Errors are those of the best linear estimate, which knows the scale: mean λ σ²/(λ + σ²) over the variances λ of the
    cosines; 2 % more is left to what is learnt, and four deviations to chance. So far is the scale off: the data
    determine Σ λ/(λ + σ²) numbers, of which each tells τ² to √2; and 10 % is the price of heavy tails.
    """
    rng = np.random.default_rng(7)
    held, errors, steps, true = [], [], [], []
    for _ in range(fields):
        x = drawn(shape, 1.0, rng)
        found = smoothness(x + noise * rng.normal(size=shape), np.full(shape, noise))
        held.append(np.abs(found.mean - x) < 1.959964 * found.sd)
        errors.append(np.mean((found.mean - x) ** 2))
        steps.append(found.step)
        true.append(apart(x))
    squares = [2.0 - 2.0 * np.cos(np.pi * np.arange(n) / n) for n in shape]
    eigenvalues = (squares[0][:, None] + squares[1]).ravel()
    best = 1.0 / (eigenvalues + noise**-2.0)
    determined = fields * np.sum(best) / noise**2
    assert 0.93 < np.mean(held) < 0.97
    chance = 4.0 * np.sqrt(2.0 * np.sum(best**2) / fields) / np.sum(best)
    assert np.mean(errors) / np.mean(best) == pytest.approx(1.02, abs=0.02 + chance)
    assert np.mean(steps) / np.mean(true) == pytest.approx(1.0, abs=0.1 + 4.0 / np.sqrt(2.0 * determined))


@pytest.mark.parametrize("jump", [3.0, 6.0, 30.0])
def test_points_beside_an_edge_are_no_worse(jump: float) -> None:
    """Two materials that differ by so many deviations of a point's own fit; elsewhere the points are much better."""
    rng = np.random.default_rng(8)
    beside, elsewhere, cut = [], [], []
    for _ in range(4):
        x = np.where(np.arange(40) < 20, 0.0, jump) + drawn((40, 40), 0.1, rng)
        found = smoothness(x + rng.normal(size=x.shape), np.ones(x.shape))
        off = (found.mean - x) ** 2
        cut.append(found.cut)
        beside.append(off[:, 19:21])
        elsewhere.append(np.delete(off, (19, 20), axis=1))
    assert np.sqrt(np.mean(beside)) < 0.85
    assert np.sqrt(np.mean(elsewhere)) < 0.4
    if jump == 30.0:  # the two are told apart, and each is known as if it stood alone
        assert np.sqrt(np.mean(beside)) < 0.2
        assert np.mean(cut) == pytest.approx(40 / (2 * 40 * 39), rel=0.05)


@pytest.mark.parametrize("shape", [(20, 25), (60, 90)])
def test_a_constant_field_is_averaged(shape: tuple[int, int]) -> None:
    """Its cosines are normal with variances σ² + τ²/λ; τ is where their density times τ is greatest.

    Given it the mean variance is that of σ²τ²/(τ² + λσ²), with λ = 0 for the mean of all; weights are nearly alike.
    """
    rng = np.random.default_rng(9)
    y = 2.0 + 0.5 * rng.normal(size=shape)
    found = smoothness(y, np.full(shape, 0.5))
    squares = [2.0 - 2.0 * np.cos(np.pi * np.arange(n) / n) for n in shape]
    values, power = (squares[0][:, None] + squares[1]).ravel()[1:], np.asarray(dctn(y, norm="ortho")).ravel()[1:] ** 2
    tau = np.exp(np.linspace(-9.0, 1.0, 2001))
    each = 0.25 + tau[:, None] ** 2 / values
    best = tau[np.argmax(np.log(tau) - 0.5 * np.sum(np.log(each) + power / each, axis=1))]
    expected = (0.25 + np.sum(1.0 / (4.0 + values / best**2))) / y.size
    assert np.mean(found.sd**2) == pytest.approx(expected, rel=0.1)
    assert np.mean((found.mean - 2.0) ** 2) < 2.0 * expected
    assert expected < 0.25 * 30.0 / y.size


@pytest.mark.parametrize("far", [100.0, 1e6])
def test_a_single_point_that_is_far_off_leaves_the_others_alone(far: float) -> None:
    """As of a fit that ended at another optimum: it stays, and what is known of the others is as without it."""
    rng = np.random.default_rng(12)
    y = rng.normal(size=(30, 30))
    without = np.where(np.arange(900).reshape(30, 30) == 400, np.nan, y)
    found, expected = (smoothness(one, np.ones(y.shape)) for one in (np.where(np.isnan(without), far, y), without))
    there = np.isfinite(without)
    np.testing.assert_allclose(found.mean[there], expected.mean[there], atol=0.1)
    assert np.mean(found.sd[there]) == pytest.approx(np.mean(expected.sd[there]), rel=0.25)
    assert found.mean[~there] == pytest.approx(far, abs=0.1)


def test_a_hole_is_inferred() -> None:
    """Of 12 × 12 points in 40 × 40: its intervals hold it, and are as wide as where the scale is known, to 10 %."""
    rng = np.random.default_rng(10)
    held, sd, hole = [], [], np.s_[14:26, 14:26]
    for _ in range(30):
        x = drawn((40, 40), 1.0, rng)
        y = x + 0.3 * rng.normal(size=x.shape)
        y[hole] = np.nan
        found = smoothness(y, np.full(x.shape, 0.3))
        held.append(np.abs(found.mean - x)[hole] < 1.959964 * found.sd[hole])
        sd.append(found.sd)
    each = np.mean(held, axis=(1, 2))
    assert np.mean(held) > 0.95 - 4.0 * np.std(each) / np.sqrt(len(each)) - 0.01
    assert np.mean(held) < 0.99
    precision, ones = np.full((40, 40), 0.3**-2), np.ones((40, 40))
    precision[hole] = 0.0
    known = np.sqrt(np.diag(np.linalg.inv(np.diag(precision.ravel()) + laplacian(ones, ones)[2]))).reshape(40, 40)
    np.testing.assert_allclose(np.mean(sd, axis=0)[hole], known[hole], rtol=0.1)


def test_large_grids_tell_the_same_as_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """By draws what elimination gives: the mean to a tenth of its deviation, deviations as 128 draws have them."""
    rng = np.random.default_rng(11)
    x = drawn((30, 33), 1.0, rng) + np.where(np.arange(33) < 12, 0.0, 9.0)
    y, sd = x + rng.normal(size=x.shape), np.ones(x.shape)
    y[3:9, 3:9] = np.nan
    exact = smoothness(y, sd)
    few: Any = (0, 0)
    monkeypatch.setattr(module, "EXACT", few)
    found = smoothness(y, sd)
    assert np.sqrt(np.mean(((found.mean - exact.mean) / exact.sd) ** 2)) < 0.1
    assert np.sqrt(np.mean((found.sd / exact.sd - 1.0) ** 2)) < np.sqrt(0.5 / 128)
    assert found.scale == pytest.approx(exact.scale, rel=0.05)


def test_data_without_any_difference_have_a_scale() -> None:
    found = smoothness(np.full((9, 9), 3.0), np.full((9, 9), 0.1))
    np.testing.assert_allclose(found.mean, 3.0)
    assert 0.1 / 9.0 < found.sd.max() < 0.1 / 9.0 * 2.0
    assert 0.0 < found.step < 0.05
