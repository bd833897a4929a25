"""Shows how fast a fit is: one converged fit of Lambert + GGX beside scipy.optimize.least_squares(method="lm").

Both minimise the same residuals of the same simulated data in the same unbounded coordinates from the same start and
must end at the same parameters. Ours is compiled and warm; scipy's model is plain vectorised numpy (`peer.py`).
The whole `fitmat.fit` (grid, 6 starts, discrepancy, covariance), warm, stands beside scipy's single start.

Run: python benchmarks/fit.py [--rows 500 100000] [--repeats 15]
"""

import argparse
import itertools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import machine
import numpy as np
import scipy.optimize
from peer import Problem, from_sine

import fitmat as fm
from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.discrepancy import first_discrepancy
from fitmat.fitting.likelihood import Data, every_residual, prepare, transformed
from fitmat.fitting.refining import LITTLE_DAMPING, MANY_ROWS
from fitmat.maths.grams import Normal
from fitmat.maths.least_squares import Minimum, least_squares, normal_equations
from fitmat.measurements.noise import measured_noise
from fitmat.measurements.samples import Measurements
from fitmat.models.parameters import vector, with_vector

TRUTH = {"kd": 0.3, "ks": 1.0, "alpha": 0.2, "eta": 1.5}
START = {"kd": 0.45, "ks": 0.7, "alpha": 0.28, "eta": 1.9}
"""27 to 50 % away from the truth."""

INCIDENCES = {500: 5, 100_000: 100}
OURS, PEER, HOISTED = "fitmat, one start", "scipy lm, one start", "scipy lm, geometry hoisted"
WHOLE, PASS = "fitmat.fit, whole", "one pass"
"""The rivals, and what stands beside them."""

SAME = 1e-5
"""Largest relative difference of the parameters that two converged fits may have."""


def measured(rows: int, seed: int = 1) -> Measurements:
    """About `rows` simulated samples, 2 % noise: several incidences, outgoing angles over ±80°."""
    count = INCIDENCES.get(rows, max(5, round(np.sqrt(rows / 10))))
    theta_i, theta_o = np.linspace(10, 75, count), np.linspace(-80, 80, rows // count)
    truth = fm.model("lambert+ggx", channels=1, **TRUTH)
    noise = {"relative_noise": 0.02, "absolute_noise": 1e-3}
    return fm.simulate(truth, np.deg2rad(theta_i), np.deg2rad(theta_o), seed=seed, **noise)


def problem(m: Measurements, *, hoisted: bool) -> Problem:
    """The same samples for numpy."""
    assert m.sigma is not None
    return Problem(m.wi, m.wo, m.value[:, 0], m.sigma[:, 0], hoisted=hoisted)


def ours(data: Data, s: np.ndarray) -> tuple[Callable[[], Minimum], Callable[[Minimum], np.ndarray]]:
    """One warm fit, to call; and its parameters. Of many rows first a part, as `fitmat.fit` does."""
    template = fm.model("lambert+ggx", channels=1, **START)
    moved, values = coordinates(template), vector(template)

    def residual(u: jax.Array, args: tuple) -> tuple[jax.Array, None]:
        return every_residual(with_vector(template, moved.from_unbounded(jnp.asarray(values), u)), *args), None

    def minimum(u: jax.Array, data: Data, s: jax.Array, damping: float) -> Minimum:
        return least_squares(residual, u, (data, s, transformed(data, s)), damping=damping)

    solve = jax.jit(minimum)
    start, whole = moved.unbounded(values), jax.device_put(data)
    rows = data.x.shape[0]
    part = jax.device_put(data.every(-(-rows // (MANY_ROWS // 2))))

    def run() -> Minimum:
        if rows <= MANY_ROWS:
            return jax.block_until_ready(solve(start, whole, s, 1.0))
        return jax.block_until_ready(solve(solve(start, part, s, 1.0).x, whole, s, LITTLE_DAMPING))

    return run, lambda end: np.asarray(moved.from_unbounded(values, np.asarray(end.x)))


def one_pass(data: Data, s: np.ndarray) -> Callable[[], object]:
    """Residuals, Jacobian and JᵀJ of all rows once, to call."""
    template = fm.model("lambert+ggx", channels=1, **START)
    moved, values = coordinates(template), vector(template)

    def point(u: jax.Array, data: Data, s: jax.Array) -> Normal:
        return normal_equations(
            lambda u: every_residual(with_vector(template, moved.from_unbounded(jnp.asarray(values), u)), data, s), u
        )

    run, start, whole = jax.jit(point), moved.unbounded(values), jax.device_put(data)
    return lambda: jax.block_until_ready(run(start, whole, s))


def scipys(peer: Problem, s: float, start: np.ndarray) -> Callable[[], scipy.optimize.OptimizeResult]:
    """One fit by MINPACK with finite differences, scipy's defaults, to call."""

    def run() -> scipy.optimize.OptimizeResult:
        data, calls = peer.stabilised(peer.x, s), itertools.count()

        def residual(u: np.ndarray) -> np.ndarray:
            next(calls)
            return peer.residuals(from_sine(u), data, s)

        solution = scipy.optimize.least_squares(residual, start, method="lm")
        solution["calls"] = next(calls)  # nfev leaves out the finite differences
        return solution

    return run


def main() -> None:
    """Time, check and print."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rows", type=int, nargs="+", default=[500, 100_000], help="numbers of samples")
    options.add_argument("--repeats", type=int, default=15, help="timed runs of each rival")
    options.add_argument("--no-whole", action="store_true", help="leave out the whole fitmat.fit")
    chosen = options.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(machine.described(), "\n")
    for rows in chosen.rows:
        race(rows, chosen.repeats, whole=not chosen.no_whole)


def race(rows: int, repeats: int, *, whole: bool) -> dict[str, np.ndarray]:
    """Both fits of `rows` samples, in turn: seconds of each rival, (repeats,)."""
    m = measured(rows)
    data = prepare(m, measured_noise(m))
    s = first_discrepancy(data)
    template = fm.model("lambert+ggx", channels=1, **START)
    start = np.asarray(coordinates(template).unbounded(vector(template)))
    one, values = ours(data, s)
    other, hoisted = (scipys(problem(m, hoisted=by_hand), float(s), start) for by_hand in (False, True))
    end, solution = one(), other()
    found = values(end), from_sine(solution.x)
    difference = float(np.max(np.abs(found[0] / found[1] - 1.0)))
    print(f"{m.n_samples} rows, s = {float(s):.3g} sr^(-1/3)")
    print("parameters  " + "  ".join(TRUTH))
    print("truth       " + "  ".join(f"{v:.10g}" for v in TRUTH.values()))
    print("fitmat      " + "  ".join(f"{v:.10g}" for v in found[0]))
    print("scipy lm    " + "  ".join(f"{v:.10g}" for v in found[1]))
    print(f"largest relative difference {difference:.1e}")
    assert difference < SAME, "the two fits do not agree: no race"
    rivals: dict[str, Callable[[], object]] = {OURS: one, PEER: other, HOISTED: hoisted}
    evaluations = f"{solution.nfev} steps, {solution.calls} evaluations"
    work = {OURS: f"{int(end.steps)} iterations", PEER: evaluations, HOISTED: evaluations}
    rivals[PASS], work[PASS] = one_pass(data, s), "residuals, Jacobian and JᵀJ of all rows"
    if whole:
        fitted = fm.fit(m, "lambert+ggx")
        rivals[WHOLE] = lambda: fm.fit(m, "lambert+ggx")
        work[WHOLE] = f"{fitted.n_starts} starts, best {fitted.steps} iterations, {fitted.result}"
    seconds = machine.interleaved(rivals, repeats)
    median = {name: float(np.median(taken)) for name, taken in seconds.items()}
    machine.show(
        f"{m.n_samples} rows, medians of {repeats}",
        ["", "median", "fastest", "scipy takes", "work"],
        [
            [name, machine.duration(median[name]), machine.duration(seconds[name].min()),
             f"{median[PEER] / median[name]:.2f} ×", work[name]]
            for name in rivals
        ],
    )  # fmt: skip
    return seconds


if __name__ == "__main__":
    main()
