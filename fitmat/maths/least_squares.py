"""The least-squares core: the normal equations of residuals, and the minimum of their squares.

The steps are those of `levenberg_marquardt`. Knows no model, no bounds and no noise.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from fitmat.maths.grams import Arrow, Layout, Normal, Whole, joined, rounding

RTOL = 1e-8
"""Relative tolerance of the steps in units of each parameter's own scale, SciPy's default; convergence is quadratic."""

FEW = 8
"""Parameters of which each has its own code for its column of J: twice as fast to run as one code for all of them, but
longer to compile."""


class Residuals(NamedTuple):
    """Residuals r of which it is known what each depends on.

    Attributes:
        columns: Those of one column depend on the shared parameters and on its own, (m, c).
        single: Each depends on the parameter in its place only, (p,); or there are none, (0,).
    """

    columns: Float[Array, "m c"]
    single: Float[Array, " p"]


class Minimum(eqx.Module):
    """Where a solve ended.

    Attributes:
        x: Parameters, (p,).
        square: Σ residual² there.
        solved: Whether the steps became small before they ran out.
        steps: Iterations used.
        damping: λ at the end, relative to the diagonal of JᵀJ at the start; to go on from here.
        offset: Relative offset of Bates & Watts (1981): the next Gauss–Newton step in units of the standard errors.
        beside: What the residuals came with there.
    """

    x: Float[Array, " p"]
    square: Float[Array, ""]
    solved: Bool[Array, ""]
    steps: Int[Array, ""]
    damping: Float[Array, ""]
    offset: Float[Array, ""]
    beside: Any = None


def normal_equations(
    residual: Callable[[Float[Array, " p"]], Any], x: Float[Array, " p"], layout: Layout | None = None
) -> Normal:
    """Of the residuals at x: of any shape, or `Residuals`, of whose `layout` use is made where it is given."""
    return _seen(lambda at: (residual(at), None), x, layout)[0]


def jacobian(of: Callable[[Float[Array, " p"]], Array], x: Float[Array, " p"]) -> tuple[Array, Float[Array, "p n"]]:
    """A function's value at x, of any shape, and the slope of its n numbers along each parameter."""
    value, columns, _ = _along(lambda at: (of(at), None), x)
    return value, columns


def _along(of: Callable[[Float[Array, " p"]], tuple[Array, Any]], x: Float[Array, " p"]) -> tuple[Array, Array, Any]:
    """`jacobian`, and what the values come with."""
    value, along, beside = jax.linearize(of, x, has_aux=True)
    ways = jnp.eye(len(x))
    columns = jnp.stack([along(e) for e in ways]) if 0 < len(x) <= FEW else jax.vmap(along)(ways)
    return value, columns.reshape(len(x), value.size), beside


def _seen(
    residual: Callable[[Float[Array, " p"]], tuple[Any, Any]], x: Float[Array, " p"], layout: Layout | None
) -> tuple[Normal, Any, float]:
    """The normal equations at x, what the residuals come with, and how many they are."""
    if layout is not None:
        return _seen_by_kind(residual, x, layout)
    r, columns, beside = _along(lambda at: _flat(residual(at)), x)
    return Normal(r @ r, columns @ r, Whole(columns @ columns.T)), beside, float(r.size)


def _flat(seen: tuple[Any, Any]) -> tuple[Array, Any]:
    parts = [part.ravel() for part in jax.tree.leaves(seen[0])]
    return parts[0] if len(parts) == 1 else jnp.concatenate(parts), seen[1]


def _seen_by_kind(
    residual: Callable[[Float[Array, " p"]], tuple[Residuals, Any]], x: Float[Array, " p"], layout: Layout
) -> tuple[Normal, Any, float]:
    """The same of `Residuals`: one slope for each kind of parameter, all columns at once (Curtis, Powell & Reid 1974).

    A. R. Curtis, M. J. D. Powell & J. K. Reid, On the estimation of sparse Jacobian matrices, J. Inst. Math. Appl. 13.
    """
    r, along, beside = jax.linearize(residual, x, has_aux=True)
    slopes = [along(jnp.asarray(kind)) for kind in layout.kinds]
    tall = jnp.stack([*(slope.columns for slope in slopes), r.columns])
    table, of_all = jnp.einsum("qmc,tmc->cqt", tall, tall), len(layout.shared)
    of_columns, own = jnp.sum(table, axis=0), slice(of_all, -1)
    slope = joined(layout, of_columns[:of_all, -1], table[:, own, -1])
    gram = Arrow(of_columns[:of_all, :of_all], table[:, own, :of_all], table[:, own, own], layout)
    square = of_columns[-1, -1]
    if r.single.size:
        change = jnp.sum(jnp.stack([slope.single for slope in slopes]) * layout.kinds, axis=0)
        square, slope, gram = square + r.single @ r.single, slope + change * r.single, gram.plus(change**2)
    return Normal(square, slope, gram), beside, float(r.columns.size + r.single.size)


def least_squares(
    residual: Callable[[Float[Array, " p"], Any], tuple[Any, Any]],
    x0: Float[Array, " p"],
    args: Any = None,
    *,
    layout: Layout | None = None,
    tolerance: float = RTOL,
    max_steps: Any = 256,
    damping: Any = 1.0,
    bend: Callable[[Array, Array], Array] | None = None,
) -> Minimum:
    """Minimise ½Σ residual² from x0.

    Args:
        residual: `residual(x, args)`, as `normal_equations` takes it, and arrays that come with it, or None.
        x0: Start, (p,).
        args: Passed on.
        layout: Of `Residuals` that many columns share few parameters of.
        tolerance: Both the relative and the absolute tolerance in the scaled units.
        max_steps: Looks at all residuals before giving up.
        damping: The first λ, as a fraction of the usual one; smaller where the start is known to be close.
        bend: What the curvature of x's own chart adds to the diagonal of JᵀJ, at least 0, of x and Jᵀr.

    Returns:
        The last iterate and how the solve ended; never raises for numerical reasons.
    """
    from fitmat.maths.levenberg_marquardt import LevenbergMarquardt  # which what is kept on disk does not need

    @jax.jit  # its shapes and its values by one trace
    def point(x: Array, args: Any) -> tuple[Array, tuple[Normal, Any, float]]:
        here, beside, count = _seen(lambda at: residual(at, args), x, layout)
        if bend is not None:
            here = here._replace(gram=here.gram.plus(bend(x, here.slope)))
        return jnp.sqrt(here.square), (here, beside, count)

    solver = LevenbergMarquardt(rtol=tolerance, atol=tolerance, limit=max_steps, damping=damping)
    unused: tuple[Any, frozenset[object]] = ({}, frozenset())
    length, seen = jax.eval_shape(point, x0, args)
    begin = x0, solver.init(point, x0, args, unused[0], length, seen, unused[1])

    def unfinished(at: tuple[Array, Any]) -> Array:
        return ~solver.terminate(point, at[0], args, unused[0], at[1], unused[1])[0]

    def step(at: tuple[Array, Any]) -> tuple[Array, Any]:
        return solver.step(point, at[0], args, unused[0], at[1], unused[1])[:2]

    x, state = jax.lax.while_loop(unfinished, step, begin)
    here, beside, count = state.here
    offset = relative_offset(here, count / max(len(x0), 1) - 1.0)
    return Minimum(x, here.square, state.settled, state.steps, state.damping, offset, beside)


def relative_offset(here: Normal, freedom: Any) -> Float[Array, ""]:
    """Length of the Gauss–Newton step in units of the standard errors: √(‖Qᵀr‖²/p ÷ (‖r‖² − ‖Qᵀr‖²)/(n − p)).

    Args:
        here: At the point.
        freedom: (n − p)/p.
    """
    size = jnp.sqrt(here.gram.diagonal())
    scale = jnp.where(size > 0, 1.0 / jnp.where(size > 0, size, 1.0), 0.0)
    gram = here.gram.scaled(scale).plus(jnp.full(len(size), rounding(size) * len(size), size.dtype))
    along = here.slope @ (scale * gram.solve(here.slope * scale))
    return jnp.sqrt(freedom * along / jnp.maximum(here.square - along, jnp.finfo(along.dtype).tiny))
