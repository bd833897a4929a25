"""Lattices: moments are those of the whole inverse, written from the definition, by elimination and by draws."""

import numpy as np
import pytest

from fitmat.maths.lattice import DRAW_ERROR, MEAN_ERROR, Lattice, Moments, eliminated, sampled


def grid(rows: int, columns: int, seed: int) -> tuple[Lattice, np.ndarray]:
    """Unequal data and edges over five decades, with a hole."""
    rng = np.random.default_rng(seed)
    precision, right, down = np.exp(rng.uniform(-6.0, 6.0, (3, rows, columns)))
    precision[1:3, 2:5], right[:, -1], down[-1] = 0.0, 0.0, 0.0
    return Lattice(precision, right, down), rng.normal(size=(rows, columns))


def whole(lattice: Lattice, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance: of ½ Σ p (x − y)² + ½ Σ c d², edge by edge."""
    rows, columns = y.shape
    number = np.arange(y.size).reshape(y.shape)
    matrix = np.diag(np.ravel(np.asarray(lattice.precision)))
    for row in range(rows):
        for column in range(columns):
            for c, i, j in ((lattice.right, row, column + 1), (lattice.down, row + 1, column)):
                if i < rows and j < columns:
                    d = np.zeros(y.size)
                    d[number[row, column]], d[number[i, j]] = 1.0, -1.0
                    matrix += np.asarray(c)[row, column] * np.outer(d, d)
    covariance = np.linalg.inv(matrix)
    return (covariance @ np.ravel(lattice.precision * y)).reshape(y.shape), covariance


def of_whole(lattice: Lattice, y: np.ndarray) -> Moments:
    mean, covariance = whole(lattice, y)
    variance = np.diag(covariance)
    apart = variance[:, None] + variance - 2.0 * covariance
    number = np.arange(y.size).reshape(y.shape)
    right, down = np.zeros(y.shape), np.zeros(y.shape)
    right[:, :-1] = apart[number[:, :-1], number[:, 1:]]
    down[:-1] = apart[number[:-1], number[1:]]
    return Moments(mean, variance.reshape(y.shape), right, down)


@pytest.mark.parametrize("shape", [(6, 7), (7, 6), (5, 1), (1, 5), (4, 4)])
def test_elimination_gives_the_moments_of_the_whole_inverse(shape: tuple[int, int]) -> None:
    """The worst of conditions of these matrices, 1e7, leaves 1e-9."""
    lattice, y = grid(*shape, seed=3)
    for found, expected in zip(eliminated(lattice, y), of_whole(lattice, y), strict=True):
        there = expected != 0  # of the last column and row no edge goes on
        np.testing.assert_allclose(found[there], expected[there], rtol=1e-8)


@pytest.mark.parametrize("shape", [(6, 7), (13, 9), (1, 11)])
def test_draws_give_the_same_within_their_error(shape: tuple[int, int]) -> None:
    """A variance from k normal draws is off by √(2/k), what neighbours fix by nothing; five of them, for ~350 numbers.

    The mean is off by what ends the iterations, in the norm of the energy, as the V-cycle takes it: to a factor of 2.
    """
    draws, (lattice, y) = 2000, grid(*shape, seed=4)
    given = np.zeros((1 + draws, *shape)), np.arange(1 + draws)
    found, *spread = (np.asarray(part) for part in sampled(lattice, y, *given))
    expected, (mean, covariance) = of_whole(lattice, y), whole(lattice, y)
    off = np.ravel(found[0] - mean)
    assert off @ np.linalg.solve(covariance, off) < 4.0 * MEAN_ERROR**2 * y.size
    for part, true in zip(spread, expected[1:], strict=True):
        there = true > 0
        assert np.abs(part[there] / true[there] - 1.0).max(initial=0.0) < 5.0 * np.sqrt(2.0 / draws) + 2.0 * DRAW_ERROR
    scaled = np.linalg.solve(np.linalg.cholesky(covariance), found[1:].reshape(draws, -1).T)
    assert np.abs(scaled @ scaled.T / draws - np.eye(y.size)).max() < 5.0 * np.sqrt(2.0 / draws) + 2.0 * DRAW_ERROR


def test_conjugate_gradients_solve_a_wide_grid() -> None:
    """What is left of the equations, of 150 × 201 points with a hole and a cut, is as small as was asked."""
    rng = np.random.default_rng(5)
    shape = 150, 201
    precision, right, down = rng.gamma(2.0, 0.5, shape), *(1e4 * rng.gamma(1.0, 1.0, (2, *shape)))
    precision[40:90, 40:90], right[:, 100], right[:, -1], down[-1] = 0.0, 1e-3, 0.0, 0.0
    lattice, y = Lattice(precision, right, down), rng.normal(size=shape)
    x = np.asarray(sampled(lattice, y, np.zeros((2, *shape)), np.arange(2))[0])[0]
    left = precision * (y - x)
    for c, axis in ((right, 1), (down, 0)):
        flow = c * (np.roll(x, -1, axis) - x)
        left += flow - np.roll(flow, 1, axis)
    # The energy norm of the error is rᵀ Q⁻¹ r, at most rᵀ r over the least eigenvalue; the mean of all is exact to it.
    assert abs(np.sum(left)) < MEAN_ERROR * np.sqrt(y.size * precision.sum())
    diagonal = precision + right + np.roll(right, 1, 1) + down + np.roll(down, 1, 0)
    assert np.sum(left**2 / diagonal) < 2.0 * MEAN_ERROR**2 * y.size
