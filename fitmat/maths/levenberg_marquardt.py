"""Levenberg–Marquardt by the normal equations, as a solver of Optimistix, in units of its own.

Each step looks at all residuals once.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool

from fitmat.maths.grams import Normal, rounding

FIRST_DAMPING = 1e-3
"""The first λ relative to the diagonal of JᵀJ: starts from a grid are close, and a bad step is taken back."""

GOOD, BAD = 0.75, 0.01
"""Gains, relative to what the linear model promised, from which λ falls, and below which a step is taken back."""

FALL, RISE = 0.1, 4.0
"""What λ is multiplied with after a good step, and after one that was taken back."""


Seen = tuple[Normal, Any, Any]
"""What a function to be minimised returns as its aux: its normal equations, arrays beside them, and how many
residuals there are."""


class _State(eqx.Module):
    """Where an iteration stands.

    Attributes:
        trial: The point to look at next.
        here: Of the point that the iteration stands at, what the function returned as its aux.
        promised: By how much ½ Σ r² falls at `trial` where the residuals are linear.
        damping: λ in the scaled units.
        scale: Unit of each parameter.
        steps: Points looked at.
        settled: Whether the last step was small.
    """

    trial: Array
    here: Seen
    promised: Array
    damping: Array
    scale: Array
    steps: Array
    settled: Array


class LevenbergMarquardt(optx.AbstractLeastSquaresSolver):
    """Levenberg 1944, Marquardt 1963, with an eye for rounding.

    The function returns ‖r‖ and, as its aux, `Seen`. Each parameter is measured in units of the inverse norm of its
    column of the Jacobian at the start (Moré 1978), the residuals in units of their norm, so that one first damping
    suits any problem. The last steps, whose gain is lost in rounding, count as successes.
    """

    rtol: float
    atol: float
    limit: Any
    damping: Any = 1.0
    norm: Callable[[Any], Any] = optx.max_norm

    def init(self, fn: Any, y: Array, args: Any, options: Any, f_struct: Any, aux_struct: Any, tags: Any) -> _State:
        """Nothing is looked at."""
        del fn, args, options, f_struct, tags
        nothing = jax.tree.map(lambda part: jnp.full(part.shape, jnp.inf, part.dtype), aux_struct)
        damping = jnp.asarray(self.damping, y.dtype)
        return _State(y, nothing, jnp.zeros((), y.dtype), damping, jnp.ones_like(y), jnp.array(0), jnp.array(False))

    def step(self, fn: Any, y: Array, args: Any, options: Any, state: _State, tags: Any) -> tuple[Array, _State, Seen]:
        """Look at the trial point, go there or not, and choose the next."""
        del options, tags
        return self.judged(y, state, fn(state.trial, args)[1])

    def judged(self, y: Array, state: _State, seen: Seen) -> tuple[Array, _State, Seen]:
        """`step` with what was seen at the trial point."""
        there, old = seen[0], state.here[0]
        first = state.steps == 0
        lengths = jnp.sqrt(there.gram.diagonal() * FIRST_DAMPING)
        first_unit = jnp.sqrt(there.square)
        natural = jnp.where(lengths > 0, first_unit / jnp.where(lengths > 0, lengths, 1.0), 1.0)
        scale = jnp.where(first, jnp.where(first_unit > 0, natural, 1.0), state.scale)
        before, after = 0.5 * old.square, 0.5 * there.square
        gain = before - after
        rounding = 16.0 * jnp.finfo(y.dtype).eps * before
        accept = first | (gain >= BAD * state.promised - rounding)
        grows = ~first & (gain >= GOOD * state.promised - rounding)
        damping = state.damping * jnp.where(accept, jnp.where(grows, jnp.asarray(FALL, y.dtype), 1.0), RISE)
        new_y = jnp.where(accept, state.trial, y)
        here = jax.tree.map(lambda new, old: jnp.where(accept, new, old), seen, state.here)
        moved, size = jnp.abs(state.trial - y) / scale, jnp.abs(y) / scale
        small = jnp.all(moved <= self.atol + self.rtol * size)
        same = jnp.abs(gain) <= self.atol * 0.5 * here[0].square + self.rtol * before
        settled = ~first & accept & small & same
        step, promised = _ahead(here[0], scale, damping)
        return new_y, _State(new_y + step, here, promised, damping, scale, state.steps + 1, settled), here

    def terminate(
        self, fn: Any, y: Array, args: Any, options: Any, state: _State, tags: Any
    ) -> tuple[Bool[Array, ""], optx.RESULTS]:
        """Where the last step was small, the steps ran out, or there is nothing finite to start from."""
        del fn, y, args, options, tags
        lost = (state.steps > 0) & ~jnp.isfinite(state.here[0].square)
        outcome = optx.RESULTS.where(lost, optx.RESULTS.nonfinite, optx.RESULTS.successful)
        return state.settled | (state.steps >= self.limit) | lost, outcome

    def postprocess(
        self, fn: Any, y: Array, aux: Any, args: Any, options: Any, state: _State, tags: Any, result: optx.RESULTS
    ) -> tuple[Array, Any, dict[str, Any]]:
        """The iterate as it is."""
        del fn, args, options, state, tags, result
        return y, aux, {}


def _ahead(here: Normal, scale: Array, damping: Array) -> tuple[Array, Array]:
    """The damped step from a point, and by how much ½ Σ r² falls there where the residuals are linear."""
    unit = jnp.where(here.square > 0, here.square, 1.0)
    slope, gram = here.slope * scale / unit, here.gram.scaled(scale / jnp.sqrt(unit))
    least = rounding(scale) * jnp.sum(gram.diagonal())
    step = -gram.plus(jnp.full(len(scale), damping + least)).solve(slope)
    return step * scale, -unit * (slope @ step + 0.5 * step @ gram.times(step))
