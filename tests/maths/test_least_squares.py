"""The least-squares core against NIST's certified results, and its promises: units, caps, copies of the data."""

import dataclasses
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from oracles.nist_strd import DANWOOD, FORMULAS, MISRA1A, Problem, read_problem

from fitmat.maths.grams import solve
from fitmat.maths.least_squares import Minimum, least_squares

DIGITS = 6.0
"""Correct digits asked for: what NIST calls a good result; half of what float64 Jacobians of these problems allow."""

SAME = 1e-9
"""Relative; Σ r² of two routes to one minimum, each converged to a step below 1e-12 of the parameter's own scale;
solutions of systems whose condition is far below 1e6."""

FAR_FAILURES = {"BoxBOD", "MGH10", "MGH17"}
"""Problems whose far start leads Levenberg–Marquardt to a plateau or another minimum; NIST calls all three hard."""

HARD = ("BoxBOD", "Lanczos1", "MGH09")
"""Problems of every run: a start that fails, residuals that are rounding, and a far start that succeeds."""

NO_NOISE = {"Lanczos1"}
"""Generated without noise: its residuals, 1e-13, are the rounding of the data, and so are its standard errors."""


@dataclasses.dataclass(frozen=True)
class Score:
    """Correct digits of the worst parameter and of the worst standard error, and the steps taken."""

    parameters: float
    errors: float
    steps: int


@eqx.filter_jit
def _solve(problem: Problem, x: Array, y: Array, x0: Array, max_steps: int) -> tuple[Minimum, Array]:
    """The minimum and the standard deviations √diag(s²(JᵀJ)⁻¹)."""

    def residual(b: Array) -> Array:
        return problem.formula(b, x) - y

    end = least_squares(lambda b, _: (residual(b), None), x0, tolerance=1e-12, max_steps=max_steps)
    r, inverse = residual(end.x), jnp.linalg.inv(jnp.linalg.qr(jax.jacfwd(residual)(end.x), mode="r"))
    return end, jnp.sqrt(r @ r / (len(y) - len(x0)) * jnp.sum(inverse**2, axis=1))


def solved(problem: Problem, x0: np.ndarray, max_steps: int = 3000) -> tuple[Minimum, np.ndarray]:
    end, sd = _solve(problem, jnp.asarray(problem.x), jnp.asarray(problem.y), jnp.asarray(x0), max_steps)
    return end, np.asarray(sd)


def digits(found: np.ndarray, certified: np.ndarray) -> float:
    """NIST's log relative error of the worst entry, at most the 11 digits that are certified; 0 for nonsense."""
    error = np.max(np.abs(found - certified) / np.abs(certified))
    return float(np.clip(-np.log10(max(error, 1e-11)), 0.0, 11.0)) if np.isfinite(error) else 0.0


def score(problem: Problem, start: int) -> Score:
    end, sd = solved(problem, problem.starts[start])
    return Score(digits(np.asarray(end.x), problem.certified), digits(sd, problem.sd), int(end.steps))


@pytest.fixture(scope="module", params=[HARD, pytest.param(tuple(FORMULAS), marks=pytest.mark.study)], ids=len)
def scores(request: pytest.FixtureRequest, shared_data: Path) -> dict[str, tuple[Score, Score]]:
    """Problems from the far and the near start: three hard ones, or all 27."""
    folder = shared_data / "nist-strd"
    if not folder.is_dir():
        pytest.skip(f"no NIST datasets at {folder}: download the .dat files from www.itl.nist.gov/div898/strd/nls")
    problems = [read_problem(folder / f"{name}.dat") for name in request.param]
    found = {problem.name: (score(problem, 0), score(problem, 1)) for problem in problems}
    print("\nproblem    far: digits, sd, steps   near: digits, sd, steps")
    for name, pair in found.items():
        print(f"{name:10}", *(f"{s.parameters:10.1f} {s.errors:5.1f} {s.steps:6}" for s in pair))
    return found


def test_nist_from_the_near_start(scores: dict[str, tuple[Score, Score]]) -> None:
    assert set(scores) in ({*HARD}, {*FORMULAS})
    assert len(FORMULAS) == 27
    assert {name: near for name, (_, near) in scores.items() if near.parameters < DIGITS} == {}


def test_nist_from_the_far_start(scores: dict[str, tuple[Score, Score]]) -> None:
    assert {name for name, (far, _) in scores.items() if far.parameters < DIGITS} == FAR_FAILURES & set(scores)


def test_nist_standard_errors(scores: dict[str, tuple[Score, Score]]) -> None:
    assert {name for name, (_, near) in scores.items() if near.errors < DIGITS} == NO_NOISE


@pytest.mark.parametrize("start", [0, 1])
@pytest.mark.parametrize("problem", [MISRA1A, DANWOOD], ids=lambda p: p.name)
def test_certified_values_without_shared_data(problem: Problem, start: int) -> None:
    found = score(problem, start)
    assert found.parameters >= DIGITS
    assert found.errors >= DIGITS


def test_digits_notice_a_wrong_parameter() -> None:
    assert digits(MISRA1A.certified * [1.0, 1.0 + 1e-5], MISRA1A.certified) == pytest.approx(5.0, abs=1e-3)
    assert digits(np.array([np.nan, 1.0]), MISRA1A.certified) == 0.0
    assert digits(MISRA1A.certified, MISRA1A.certified) == 11.0


def test_outcome_says_whether_the_steps_sufficed() -> None:
    end, _ = solved(MISRA1A, MISRA1A.starts[0])
    assert end.solved
    cut, _ = solved(MISRA1A, MISRA1A.starts[0], max_steps=3)
    assert not cut.solved
    assert int(cut.steps) == 3
    assert np.isfinite(cut.x).all()


@pytest.mark.parametrize("max_steps", [4, 3000])
@pytest.mark.parametrize(("of_x", "of_residual"), [([2.0**20, 2.0**-20], 2.0**20), ([2.0**-20, 2.0**20], 2.0**-20)])
def test_units_do_not_matter(of_x: list[float], of_residual: float, max_steps: int) -> None:
    """Other units of the parameters and the residuals: the same path, bit for bit with powers of two."""
    x, y, x0, units = (jnp.asarray(part) for part in (MISRA1A.x, MISRA1A.y, MISRA1A.starts[0], of_x))

    @jax.jit  # one program for both, so that nothing is rounded in another order
    def path(units: Array, of_residual: Array) -> Minimum:
        def residual(b: Array, _: None) -> tuple[Array, None]:
            return of_residual * (MISRA1A.formula(b / units, x) - y), None

        return least_squares(residual, x0 * units, tolerance=1e-12, max_steps=max_steps)

    plain, scaled = path(jnp.ones(2), jnp.array(1.0)), path(units, jnp.array(of_residual))
    assert bool(plain.solved) == (max_steps > 4)
    np.testing.assert_array_equal(scaled.x / units, plain.x)
    assert scaled.square == of_residual**2 * plain.square
    assert (scaled.steps, scaled.damping) == (plain.steps, plain.damping)


def test_copies_of_the_data_have_the_minimum_of_one() -> None:
    """40 copies end at the certified values."""
    x0 = MISRA1A.starts[0]
    copies = dataclasses.replace(MISRA1A, x=np.tile(MISRA1A.x, 40), y=np.tile(MISRA1A.y, 40))
    many, one = solved(copies, x0)[0], solved(MISRA1A, x0)[0]
    assert many.solved
    assert digits(np.asarray(many.x), MISRA1A.certified) >= DIGITS
    assert float(many.square) == pytest.approx(40.0 * float(one.square), rel=SAME)


def test_a_start_at_the_minimum_stays() -> None:
    """Zero residuals and a parameter that nothing depends on would divide by zero if taken as units."""
    end = least_squares(lambda b, _: (jnp.array([b[0] - 2.0, 3.0 * (b[0] - 2.0)]), None), jnp.array([2.0, 5.0]))
    np.testing.assert_array_equal(end.x, [2.0, 5.0])


def test_nothing_to_move_is_a_minimum() -> None:
    """Where all is fixed."""
    end = least_squares(lambda b, _: (jnp.array([3.0, 4.0]), None), jnp.zeros(0))
    assert end.solved
    assert (end.x.shape, float(end.square)) == ((0,), 25.0)


@pytest.mark.parametrize("size", [1, 2, 7])
def test_systems_are_solved_as_numpy_does(size: int) -> None:
    """Condition numbers of some hundred."""
    rng = np.random.default_rng(size)
    root, right = rng.normal(size=(size, size + 3)), rng.normal(size=size)
    matrix = root @ root.T
    np.testing.assert_allclose(
        solve(jnp.asarray(matrix), jnp.asarray(right)), np.linalg.solve(matrix, right), rtol=SAME
    )


@pytest.mark.parametrize("matrix", [[[1.0, 2.0], [2.0, 1.0]], [[0.0, 0.0], [0.0, 1.0]], [[1.0, np.nan], [np.nan, 1.0]]])
def test_what_is_not_positive_definite_has_no_solution(matrix: list[list[float]]) -> None:
    assert np.isnan(solve(jnp.array(matrix), jnp.ones(2))).all()
