"""The least-squares core: Levenberg–Marquardt from Optimistix's parts, in units of the problem's own.

Knows no model, no bounds and no noise.
"""

import functools
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Float, Int

RTOL = 1e-8
"""Relative tolerance of the steps in units of each parameter's own scale, SciPy's default; convergence is quadratic."""

FIRST_DAMPING = 1e-3
"""The first λ relative to the diagonal of JᵀJ: starts from a grid are close, and a bad step is taken back."""

TALL = 20_000
"""From this many residuals on, JᵀJ is formed instead of a QR factorisation of J."""


class Units(eqx.Module):
    """In what a problem is measured: `x` for each parameter, `residual` for all residuals together."""

    x: Float[Array, " p"]
    residual: Float[Array, ""]


class Minimum(eqx.Module):
    """Where a solve ended.

    Attributes:
        x: Parameters, (p,).
        result: An `optimistix.RESULTS` member.
        steps: Iterations used.
        units: The problem's units, to reuse for a similar problem.
        offset: Relative offset of Bates & Watts (1981): the next Gauss–Newton step in units of the standard errors.
    """

    x: Float[Array, " p"]
    result: optx.RESULTS
    steps: Int[Array, ""]
    offset: Float[Array, ""]
    units: Units


class TrustRegion(optx.AbstractSearch):
    """The classical trust region (Conn, Gould & Toint 2000, alg. 6.1.1) with an eye for rounding.

    Optimistix's own grows only where the quadratic model is right to 1 %, and takes the last steps, whose gain is lost
    in rounding, for failures; together that doubles the iterations here.
    """

    good: float = 0.75
    bad: float = 0.01
    grow: float = 10.0
    shrink: float = 0.25

    def init(self, y: Any, f_info_struct: Any) -> Array:
        """The first step size; λ is its inverse."""
        del y, f_info_struct
        return jnp.array(1.0)

    def step(
        self, first_step: Array, y: Any, y_eval: Any, f_info: Any, f_eval_info: Any, state: Array
    ) -> tuple[Array, Array, optx.RESULTS, Array]:
        """New step size, whether `y_eval` is accepted, outcome, state."""
        before, after = f_info.as_min(), f_eval_info.as_min()
        linear = f_info.jac.mv(y_eval - y) + f_info.residual
        gain, expected = before - after, before - 0.5 * (linear @ linear)
        rounding = 16.0 * jnp.finfo(before.dtype).eps * before
        accept = first_step | (gain >= self.bad * expected - rounding)
        grows = ~first_step & (gain >= self.good * expected - rounding)
        size = state * jnp.where(accept, jnp.where(grows, self.grow, 1.0), self.shrink)
        return size, accept, optx.RESULTS.successful, size


class LevenbergMarquardt(optx.AbstractGaussNewton):
    """Optimistix's Gauss–Newton iteration with its damped Newton descent, in `TrustRegion`."""

    rtol: float
    atol: float
    norm: Callable[[Any], Any] = optx.max_norm
    descent: optx.AbstractDescent = eqx.field(default_factory=optx.DampedNewtonDescent)
    search: optx.AbstractSearch = eqx.field(default_factory=TrustRegion)
    verbose: Callable[..., None] = eqx.field(static=True, default=lambda **_: None)


def least_squares(
    residual: Callable[[Float[Array, " p"], Any], Array],
    x0: Float[Array, " p"],
    args: Any = None,
    *,
    tolerance: float = RTOL,
    max_steps: int = 256,
    units: Units | None = None,
) -> Minimum:
    """Minimise ½Σ residual² from x0.

    Each parameter is measured in units of the inverse norm of its column of the Jacobian at x0 and the residuals in
    units of their norm there (Marquardt 1963, Moré 1978), so that one first damping suits any problem.

    Args:
        residual: `residual(x, args)`, any shape.
        x0: Start, (p,).
        args: Passed on.
        tolerance: Both the relative and the absolute tolerance in the scaled units.
        max_steps: Iterations before giving up.
        units: Those of a similar problem, which saves one look at all residuals.

    Returns:
        The last iterate and how the solve ended; never raises for numerical reasons.
    """
    # Jitted, so that the several places of the solver's program that need it trace it once.
    point = jax.jit(functools.partial(_compressed_point, residual))
    if units is None:
        units = _natural_units(*point(x0, args))
    small, by = _compressed(point), units
    solver = LevenbergMarquardt(rtol=tolerance, atol=tolerance)
    solution = optx.least_squares(
        lambda u, a: small(u * by.x, a) / by.residual, solver, x0 / by.x, args, max_steps=max_steps, throw=False
    )
    last = solution.state.f_info.residual
    freedom = jax.eval_shape(residual, x0, args).size / max(len(x0), 1) - 1.0
    offset = jnp.sqrt(freedom * (last[:-1] @ last[:-1])) / jnp.maximum(last[-1], jnp.finfo(last.dtype).tiny)
    return Minimum(solution.value * by.x, solution.result, solution.stats["num_steps"], offset, units)


def _natural_units(value: Float[Array, " p+1"], triangle: Float[Array, "p p"]) -> Units:
    """Columns of the Jacobian of the length that makes λ = 1 the first damping, and residuals of norm 1."""
    norm = jnp.sqrt(value @ value)
    unit = jnp.where(norm > 0, norm, 1.0)
    lengths = jnp.sqrt(jnp.sum(triangle**2, axis=0) * FIRST_DAMPING)
    return Units(jnp.where(lengths > 0, unit / jnp.where(lengths > 0, lengths, 1.0), 1.0), unit)


def _compressed_point(
    residual: Callable[[Array, Any], Array], x: Array, args: Any
) -> tuple[Float[Array, " p+1"], Float[Array, "p p"]]:
    """What a least-squares step needs of all residuals: Qᵀr with what r has outside of Q, and R, where J = QR."""

    def flat(at: Array) -> Array:
        return jnp.ravel(residual(at, args))

    r, columns = jax.vmap(lambda e: jax.jvp(flat, (x,), (e,)), out_axes=(None, 0))(jnp.eye(len(x)))
    if r.size >= TALL:
        gram = columns @ columns.T
        # A ridge at the level of rounding keeps the factor finite where parameters act alike.
        ridge = jnp.finfo(gram.dtype).eps * r.size**0.5 * jnp.diagonal(gram) + jnp.finfo(gram.dtype).tiny
        triangle = jnp.linalg.cholesky(gram + jnp.diag(ridge)).T
        inside = jax.scipy.linalg.solve_triangular(triangle, columns @ r, trans=1)
    else:
        q, triangle = jnp.linalg.qr(columns.T)
        flip = jnp.where(jnp.diagonal(triangle) < 0, -1.0, 1.0)
        inside, triangle = flip * (q.T @ r), flip[:, None] * triangle
    outside = jnp.sqrt(jnp.maximum(jnp.vdot(r, r) - inside @ inside, 0.0))
    return jnp.append(inside, outside), triangle


def _compressed(point: Callable[[Array, Any], tuple[Array, Array]]) -> Callable[[Array, Any], Array]:
    """The p + 1 numbers with the same norm and the same Gauss–Newton step as all residuals.

    The solver then carries p × p numbers through its loop however many rows there are.
    """

    @jax.custom_jvp
    def small(x: Array, args: Any) -> Array:
        return point(x, args)[0]

    @small.defjvp
    def _(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
        value, triangle = point(*primals)
        return value, jnp.append(triangle @ tangents[0], 0.0)

    return small
