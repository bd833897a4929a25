"""Solving: Levenberg–Marquardt of many fits in blocks that stay in the cache, each place refilled once its fit is done.

So the slowest fits hold up none of the others. The steps, the updates of the discrepancy and the ends are those of
`refining`. It chooses no start and names no outcome.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from fitmat.fitting.discrepancy import best_discrepancy
from fitmat.fitting.likelihood import log_pointwise
from fitmat.fitting.many.lanes import Samples, Shared, alone, from_unbounded, looked, summed
from fitmat.fitting.refining import BURST, SETTLED, STEADY
from fitmat.maths.grams import Normal, Whole
from fitmat.maths.least_squares import RTOL, relative_offset
from fitmat.maths.levenberg_marquardt import LevenbergMarquardt
from fitmat.maths.programs import program_run_often

TOLERANCE = {"float64": 1e-2 * RTOL, "float32": 1e-4}
"""Of the steps, by the type of the numbers: a hundredth of a single fit's, so that what is between the two is mostly
that one's last step; in 32 bits what can be told from rounding."""

STILL = {"float64": SETTLED, "float32": 1e-4}
"""Relative change of the discrepancy at which the alternation ends, likewise."""

PATIENCE = 24
"""Looks after which a fit is given up that is far behind another start of its surface, which has ended: on the way to a
bound it would take hundreds more, for nothing."""

BEHIND = 10.0
"""How far: in the log-likelihood; of an objective, twice the other's squares."""

NEWTON = 3
"""Newton steps of the discrepancy between two bursts: all bursts together settle it."""


class Ends(NamedTuple):
    """Where L fits ended.

    Attributes:
        u: Unbounded coordinates, (L, k).
        discrepancy: s, (L,).
        log_likelihood: Of the values, (L,); −½ Σ residual² where the discrepancy is not inferred.
        solved: Whether the steps became small, (L,).
        steps: Looks at all residuals, (L,).
    """

    u: Any
    discrepancy: Any
    log_likelihood: Any
    solved: Any
    steps: Any


class _Block(NamedTuple):
    """B fits side by side; they are the last axis.

    Attributes:
        fit: Which fit each lane works on; L where it has none.
        data: Its samples.
        measured: T(y κ).
        u: Where it stands, (k, B).
        state: Of Levenberg–Marquardt.
        s: Its discrepancy.
        steps: Looks at all residuals.
    """

    fit: Int[Array, " B"]
    data: Samples
    measured: Array
    u: Float[Array, "k B"]
    state: Any
    s: Float[Array, " B"]
    steps: Int[Array, " B"]


@program_run_often
def solve_many(
    shared: Shared,
    samples: Samples,
    of: ArrayLike,
    starts: ArrayLike,
    first: ArrayLike,
    counts: ArrayLike,
    damping: ArrayLike,
    block: int,
) -> tuple[Array, ...]:
    """The fields of `Ends`, in numbers of the type of the starts.

    Args:
        shared: The model and the directions.
        samples: Of every surface, that axis first: (T, n, c), and (T,) of `typical`.
        of: Which surface each of the L fits is of, (L,).
        starts: Unbounded coordinates, (L, k).
        first: A first guess of the discrepancy, (T,).
        counts: How many of the fits are wanted, and how many looks each may take.
        damping: The first λ, as `least_squares` has it.
        block: B.
    """
    work = _Work(shared, samples, *(jnp.asarray(part) for part in (of, starts, first, damping)), *jnp.asarray(counts))
    (many, k), kind = work.starts.shape, work.starts.dtype
    numbers = jnp.zeros(many + 1, kind)
    none = Ends(jnp.zeros((many + 1, k), kind), numbers, numbers, jnp.zeros(many + 1, bool), jnp.zeros(many + 1, int))
    begun = work.filled(work.empty(block), jnp.ones(block, bool), jnp.array(0))
    best = jnp.full(len(work.samples.x), -jnp.inf, kind)
    found = jax.lax.while_loop(lambda state: jnp.any(work.busy(state[0])), work.passed, (*begun, none, best))[2]
    return tuple(part[:many] for part in found)


class _Work(NamedTuple):
    """The arguments of `solve_many`, and what is done to a block."""

    shared: Shared
    samples: Samples
    of: Array
    starts: Array
    first: Array
    damping: Array
    wanted: Array
    most: Array

    @property
    def kind(self) -> str:
        """The type of the numbers."""
        return self.starts.dtype.name

    @property
    def infers(self) -> bool:
        return self.shared.loss.infers_discrepancy

    def busy(self, at: _Block) -> Bool[Array, " B"]:
        """Which lanes have a fit."""
        return at.fit < len(self.starts)

    def passed(self, state: tuple[_Block, Array, Ends, Array]) -> tuple[_Block, Array, Ends, Array]:
        """A few steps of every lane; what has ended is noted, and the next fits take its place.

        The last of the state is the best log-likelihood in which a fit of each surface ended.
        """
        at, following, found, best = state
        at = jax.lax.fori_loop(0, BURST, lambda _, at: self.stepped(at), at)
        normal, solved = at.state.here[0], at.state.settled
        settled, steady, after = jnp.ones_like(solved), self.steady(normal), at
        score = -0.5 * normal.square
        if self.infers:
            s = self.updated(at)
            score = self.log_likelihood(at, s)
            settled = jnp.abs(s - at.s) <= STILL[self.kind] * at.s
            state = self.begun_again(at.state, at.u, ~(settled & solved), at.state.damping)
            after = at._replace(s=s, measured=self.transformed(at.data, s), state=state)
        done = (settled & solved) | ~jnp.isfinite(normal.square) | (at.steps >= self.most)
        surface = self.of[jnp.minimum(at.fit, len(self.starts) - 1)]
        ended_there = done & self.busy(at) & jnp.isfinite(score)
        best = best.at[surface].max(jnp.where(ended_there, score, -jnp.inf))
        done |= (at.steps >= PATIENCE) & self.is_behind(score, best[surface])
        row = jnp.where(done, at.fit, len(self.starts))
        ended = (at.u.T, after.s, score, settled & (solved | steady), at.steps)
        found = Ends(*(whole.at[row].set(part) for whole, part in zip(found, ended, strict=True)))
        return *self.filled(after, done | ~self.busy(at), following), found, best

    def is_behind(self, score: Float[Array, " B"], best: Float[Array, " B"]) -> Bool[Array, " B"]:
        """Which log-likelihoods are far below the best, where one is known."""
        far = BEHIND if self.shared.loss.posterior else jnp.abs(best)
        return jnp.isfinite(best) & (score < best - far)

    def stepped(self, at: _Block) -> _Block:
        """One step of every lane that moves."""
        lost = (at.state.steps > 0) & ~jnp.isfinite(at.state.here[0].square)
        moving = self.busy(at) & ~at.state.settled & ~lost & (at.steps < self.most)
        moved = self.shared.moved
        trial = at.state.trial
        normal, x = looked(
            self.shared, at.data, at.s, at.measured, lambda: from_unbounded(moved, trial), jnp.any(moving)
        )
        bent = jnp.eye(len(trial), dtype=trial.dtype)[:, :, None] * moved.bend(trial, normal.slope)
        seen = (
            normal._replace(gram=Whole(normal.gram.dense() + bent)),
            (x if self.infers else None),
            jnp.zeros_like(at.s),
        )
        u, state, _ = jax.vmap(self.solver.judged, in_axes=-1, out_axes=-1)(at.u, at.state, seen)
        u, state = jax.tree.map(lambda new, old: jnp.where(moving, new, old), (u, state), (at.u, at.state))
        return at._replace(u=u, state=state, steps=at.steps + moving)

    def filled(self, at: _Block, done: Bool[Array, " B"], following: Array) -> tuple[_Block, Array]:
        """The block with the next fits in the lanes that are done, and which follows them."""
        place = jnp.where(done, following + jnp.cumsum(done) - 1, at.fit)
        fit = jnp.where(place < self.wanted, place, len(self.starts))
        safe = jnp.minimum(fit, len(self.starts) - 1)
        of = self.of[safe]
        new = jax.tree.map(lambda part: jnp.moveaxis(jnp.asarray(part)[of], 0, -1), self.samples)
        data = jax.tree.map(lambda part, old: jnp.where(done, part, old), new, at.data)
        u = jnp.where(done, self.starts[safe].T, at.u)
        s = jnp.where(done, self.first[of] if self.infers else 0.0, at.s)
        steps = jnp.where(done, 0, at.steps)
        state = self.begun_again(at.state, u, done, self.damping)
        return _Block(fit, data, self.transformed(data, s), u, state, s, steps), following + jnp.sum(done)

    def empty(self, block: int) -> _Block:
        """A block without fits."""
        k, (n, c), kind = self.starts.shape[1], self.samples.x.shape[1:], self.starts.dtype
        data = jax.tree.map(lambda part: jnp.ones((*jnp.shape(part)[1:], block), kind), self.samples)
        zero, x = jnp.zeros(block, kind), jnp.zeros((n, c, block), kind)
        normal = Normal(zero, jnp.zeros((k, block), kind), Whole(jnp.zeros((k, k, block), kind)))
        state = jax.vmap(lambda u, here: self.solver.init(None, u, None, None, None, here, None), -1, -1)(
            normal.slope, (normal, x if self.infers else None, zero)
        )
        nothing = jnp.full(block, len(self.starts))
        return _Block(nothing, data, x, normal.slope, state, zero, jnp.zeros(block, int))

    def transformed(self, data: Samples, s: Array) -> Array:
        """T(y κ)."""
        return self.shared.loss.transform(data.x, data.noise, self.shared.kappa, s)

    def steady(self, normal: Normal) -> Bool[Array, " B"]:
        """Whether the next step would be small beside the standard errors."""
        freedom = float(self.samples.x[0].size) / max(self.starts.shape[1], 1) - 1.0
        return jax.vmap(lambda here: relative_offset(here, freedom), in_axes=-1)(normal) < STEADY

    def updated(self, at: _Block) -> Float[Array, " B"]:
        """The best discrepancy of every lane."""
        some = jnp.any(self.busy(at))

        def total(weight: Array, part: Array) -> Array:
            return summed(alone(some, lambda: weight * part))

        return best_discrepancy(at.state.here[1], self.shared.data(at.data), at.s, total, NEWTON)

    def log_likelihood(self, at: _Block, s: Float[Array, " B"]) -> Float[Array, " B"]:
        """Of every lane's values, with these discrepancies."""
        terms = log_pointwise(at.state.here[1], at.data.noise, self.shared.data(at.data), s)
        return summed(at.data.weight * terms)

    @property
    def solver(self) -> LevenbergMarquardt:
        tolerance = TOLERANCE[self.kind]
        return LevenbergMarquardt(rtol=tolerance, atol=tolerance, limit=None)

    def begun_again(self, state: Any, u: Array, which: Bool[Array, " B"], damping: Any) -> Any:
        """Levenberg–Marquardt from its beginning at u, in some lanes."""
        new = jax.vmap(lambda u, here: self.solver.init(None, u, None, None, None, here, None), -1, -1)(u, state.here)
        new = type(state)(*(damping if name == "damping" else getattr(new, name) for name in new.__dataclass_fields__))
        return jax.tree.map(lambda begun, old: jnp.where(which, begun, old), new, state)
