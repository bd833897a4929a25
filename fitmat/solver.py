"""The least-squares core: Optimistix's Levenberg–Marquardt, made independent of the units of parameters and residuals.

Knows no model, no bounds and no noise.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import optimistix as optx
from jaxtyping import Array, Float, Int

RTOL = 1e-10
"""Relative tolerance of the steps, in units of each parameter's own scale."""

TALL = 20_000
"""From this many residuals on, steps solve the normal equations: p × p instead of a QR of all rows."""


class Minimum(eqx.Module):
    """Where a solve ended.

    Attributes:
        x: Parameters, (p,).
        result: An `optimistix.RESULTS` member.
        steps: Iterations used.
    """

    x: Float[Array, " p"]
    result: optx.RESULTS
    steps: Int[Array, ""]


def least_squares(
    residual: Callable[[Float[Array, " p"], Any], Array],
    x0: Float[Array, " p"],
    args: Any = None,
    *,
    tolerance: float = RTOL,
    max_steps: int = 256,
) -> Minimum:
    """Minimise ½Σ residual² from x0.

    Each parameter is measured in units of the inverse norm of its column of the Jacobian at x0 and the residuals in
    units of their norm there (Marquardt 1963, Moré 1978), so that the first damping, 1, suits any problem.

    Args:
        residual: `residual(x, args)`, any shape.
        x0: Start, (p,).
        args: Passed on.
        tolerance: Both the relative and the absolute tolerance in the scaled units.
        max_steps: Iterations before giving up.

    Returns:
        The last iterate and how the solve ended; never raises for numerical reasons.
    """

    def flat(x: Array) -> Array:
        return jnp.ravel(residual(x, args))

    start, linear = jax.linearize(flat, x0)
    norm = jnp.sqrt(start @ start)
    unit = jnp.where(norm > 0, norm, 1.0)
    columns = jax.vmap(linear)(jnp.eye(len(x0)))
    lengths = jnp.sqrt(jnp.sum(columns**2, axis=1))
    scale = jnp.where(lengths > 0, unit / jnp.where(lengths > 0, lengths, 1.0), 1.0)
    factoring = lx.Normal(lx.Cholesky()) if start.size >= TALL else lx.QR()
    solver = optx.LevenbergMarquardt(rtol=tolerance, atol=tolerance, linear_solver=factoring)
    solution = optx.least_squares(
        lambda u, _: flat(u * scale) / unit, solver, x0 / scale, max_steps=max_steps, throw=False
    )
    return Minimum(solution.value * scale, solution.result, solution.stats["num_steps"])
