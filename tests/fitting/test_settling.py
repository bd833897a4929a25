"""Settling: bounded optima against SciPy's, normal equations against a dense Jacobian, and walks that meet a bound."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

import fitmat as fm
from fitmat.fitting import settling
from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.likelihood import Data, every_residual, prepare
from fitmat.fitting.settling import AT_ONCE, MOST_ITERATIONS, PRECISE, STEPS, Frame, Walks, settle_of
from fitmat.maths.directions import from_angles
from fitmat.measurements.noise import measured_noise
from fitmat.models.parameters import vector, with_vector

TRUTH = fm.model("lambert+ggx", kd=0.3, ks=0.6, alpha=0.25, eta=1.6)

S = 0.01


@pytest.fixture(scope="module")
def data() -> Data:
    theta_i, theta_o = (part.ravel() for part in np.deg2rad(np.meshgrid([10.0, 40.0, 65.0], np.arange(0.0, 81.0, 4.0))))
    exact = fm.evaluate(TRUTH, from_angles(theta_i, 0.0 * theta_i), from_angles(theta_o, np.pi + 0.0 * theta_o))[:, 0]
    value = exact * (1.0 + 0.02 * np.random.default_rng(0).normal(size=len(exact)))
    m = fm.from_arrays(theta_i, theta_o, value, sigma=0.02 * exact)
    return prepare(m, measured_noise(m))


def every(data: Data, natural: np.ndarray) -> np.ndarray:
    """All residuals, by a function of its own."""
    moved = coordinates(TRUTH)
    found = every_residual(with_vector(TRUTH, moved.physical(jnp.asarray(natural))), data, jnp.asarray(S))
    return np.asarray(jnp.concatenate([found.columns.ravel(), found.single]))


def bounded(high_ks: float, back: np.ndarray | None = None) -> Frame:
    """The model's bounds, with a lower upper one of ks."""
    moved = coordinates(TRUTH)
    high = moved.high.copy()
    high[1] = high_ks
    turned = np.eye(4) if back is None else back
    return Frame(moved.natural(vector(TRUTH)), moved.low, high, moved.span, turned, np.ones(4, bool))


def test_normal_equations_are_those_of_a_dense_jacobian(data: Data) -> None:
    """Of more points than one call takes."""
    here = coordinates(TRUTH).natural(vector(TRUTH))
    points = here + 0.01 * np.random.default_rng(1).normal(size=(AT_ONCE + 3, 4))
    found = settle_of(TRUTH, data, S, bounded(np.inf))(Walks.standing(points, np.zeros(len(points), int)), 1, 0)
    moved = coordinates(TRUTH)

    def flat(t: jax.Array) -> jax.Array:
        parts = every_residual(with_vector(TRUTH, moved.physical(t)), data, jnp.asarray(S))
        return jnp.concatenate([parts.columns.ravel(), parts.single])

    for k in (0, AT_ONCE - 1, AT_ONCE + 2):
        r, jacobian = np.asarray(flat(jnp.asarray(points[k]))), np.asarray(jax.jacrev(flat)(jnp.asarray(points[k])))
        np.testing.assert_allclose(found.squares[k, 0], r @ r, rtol=1e-11)
        np.testing.assert_allclose(found.slope[k], jacobian.T @ r, rtol=1e-9)
        np.testing.assert_allclose(found.gram[k], jacobian.T @ jacobian, rtol=1e-9)
    np.testing.assert_array_equal(found.points[:, 0], points)


def test_optima_on_a_bound_are_those_of_scipy(data: Data) -> None:
    """alpha held, ks against a bound below its best value."""
    frame, held = bounded(0.4), 2
    start = frame.centre.copy()
    start[1], start[held] = 0.3, np.log(0.27)
    found = settle_of(TRUTH, data, S, frame)(Walks.standing(start[None], np.array([held])), 1, MOST_ITERATIONS)
    others = np.delete(np.arange(4), held)

    def residual(t: np.ndarray) -> np.ndarray:
        whole = start.copy()
        whole[others] = t
        return every(data, whole)

    solved = least_squares(residual, start[others], bounds=(frame.low[others], frame.high[others]), x_scale="jac")
    assert found.points[0, 0, 1] == 0.4
    assert found.points[0, 0, held] == start[held]
    assert 0.5 * found.squares[0, 0] == pytest.approx(solved.cost, abs=2 * PRECISE)


def test_walks_leave_evenly_and_end_at_bounds(data: Data) -> None:
    """From the optimum of all on: √(2Δ) grows about evenly to four, and a bound that comes first is not passed."""
    frame = bounded(np.inf)
    settle = settle_of(TRUTH, data, S, frame)
    best = settle(Walks.standing(frame.centre[None], np.array([-1])), 1, MOST_ITERATIONS)  # none is held
    start, least = best.points[0, 0], best.squares[0, 0]
    sd = np.sqrt(np.diagonal(np.linalg.inv(best.gram[0])))
    up = Walks(
        *(np.tile(part, (2, 1)) if np.ndim(part) else np.full(2, part) for part in (start, 0, 1.0)),
        reach=np.array([np.inf, 1.5 * sd[0]]),
        first=np.full(2, sd[0] / 4.0 / settling.GROWTH),
        least=np.full(2, least),
        gram=np.tile(best.gram, (2, 1, 1)),
    )
    found = settle(up._replace(held=up.held.astype(int)), STEPS, MOST_ITERATIONS)
    root = np.sqrt(found.squares - least)
    np.testing.assert_allclose(root[0], np.linspace(0.25, 4.0, STEPS), rtol=0.1)
    assert found.points[1, -1, 0] == pytest.approx(start[0] + 1.5 * sd[0], rel=1e-12)
    assert root[1, -1] == pytest.approx(1.5, rel=0.05)


def test_a_step_without_a_solution_is_no_step() -> None:
    """Rounding that leaves JᵀJ indefinite damps the next look; readings that are no numbers end it."""
    gram, slope, free, span = np.array([[1.0, 2.0], [2.0, 1.0]]), np.ones(2), np.ones(2, bool), np.ones(2)
    step, promised = settling._step(*(jnp.asarray(part) for part in (slope, gram, free, 1e-6, span)))
    np.testing.assert_array_equal(step, 0.0)
    assert promised == np.inf
    _, promised = settling._step(*(jnp.asarray(part) for part in (np.nan * slope, gram, free, 1e-6, span)))
    assert np.isnan(promised)
