"""Paths: followed side by side until each lane has had its share, and the estimate that they make up.

What a collision does to a path, its caller knows: `random_walk` and `position_free`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float, Int, PRNGKeyArray

from fitmat.errors import ModelError
from fitmat.models.base import MonteCarlo, direction_pairs
from fitmat.models.multiple_scattering.surface import Colours, Walker
from fitmat.text import brief

MOST_BOUNCES = 256
"""A path is cut after so many collisions; the energy that it still carried is reported."""

ROULETTE = 0.25
"""Paths below this throughput survive with probability throughput/ROULETTE, and gain what the others lose."""

GENERATOR = "rbg"
"""JAX's name of the random numbers: they compile in half the time of its default, and are as independent."""

LANES = 2**13
"""Walkers that are followed at the same time, shared among the pairs."""

FEWEST = 32
"""Walkers per pair, at least: the standard error is found from their scatter."""


class Static(NamedTuple):
    """What a program is compiled for: walkers per pair, paths of each."""

    lanes: int
    quota: int


class Orders(NamedTuple):
    """Which orders of scattering count (0: all), and how many collisions are followed."""

    counted: Int[Array, ""]
    last: Int[Array, ""]

    def include(self, order: Int[Array, "n w"]) -> Bool[Array, "n w"]:
        """Whether light of that order counts."""
        return (order <= self.last) & ((self.counted == 0) | (order == self.counted))


class Sums(NamedTuple):
    """Of each lane: scores, and energy cut off."""

    score: Colours
    cut: Walker


@dataclass(frozen=True, eq=False)
class Plan:
    """Checked directions, components first; the orders to count; and how many walkers follow how many paths."""

    wi: Float[Array, "3 n 1"]
    wo: Float[Array, "3 n 1"]
    orders: Orders
    static: Static
    __repr__ = brief

    def result(self, sums: Sums, divisor: Float[Array, "n 1"] | float = 1.0) -> MonteCarlo:
        """Means over the lanes and their standard errors; lanes are independent, the paths of one need not be."""
        lanes, quota = self.static
        score = np.asarray(sums.score / divisor) / quota
        error = score.std(axis=-1, ddof=1) / np.sqrt(lanes)
        return MonteCarlo(score.mean(axis=-1).T, error.T, np.asarray(sums.cut).mean(axis=-1) / quota, lanes * quota)


def plan_paths(wi: ArrayLike, wo: ArrayLike, *, samples: int, order: int | None) -> Plan:
    """Check the inputs of an estimator and share its paths among lanes; see `evaluate_walk`."""
    pair = direction_pairs(wi, wo)
    for label, w in zip(("wi", "wo"), pair, strict=True):
        for row in np.flatnonzero(~(w[:, 2] > 0.0))[:1]:
            raise ModelError(f"{label} row {row} is {w[row]}: expected a unit vector above the surface, z > 0.")
    if order is not None and not 1 <= order <= MOST_BOUNCES:
        raise ModelError(f"order = {order}: expected 1 to {MOST_BOUNCES}, or None for all orders.")
    lanes = min(max(LANES // len(pair[0]), FEWEST), samples)
    columns = [jnp.asarray(w.T[:, :, None]) for w in pair]
    orders = Orders(jnp.array(order or 0), jnp.array(order or MOST_BOUNCES))
    return Plan(columns[0], columns[1], orders, Static(lanes, -(-samples // lanes)))


State = Any
"""What walkers carry from one collision to the next: a tuple of arrays whose last axes are (n, w)."""


class Step(NamedTuple):
    """After a collision: the walkers, what each scored, which paths ended, and the energy that those were cut of."""

    state: State
    score: Colours
    ended: Bool[Array, "n w"]
    cut: Walker


class _Loop(NamedTuple):
    key: PRNGKeyArray
    state: State
    sums: Sums
    done: Int[Array, "n w"]


def follow(
    fresh: State,
    begin: Callable[[PRNGKeyArray, State, Bool[Array, "n w"]], State],
    step: Callable[[PRNGKeyArray, State], Step],
    key: PRNGKeyArray,
    quota: int,
) -> Sums:
    """Let each lane follow `quota` paths one after another; a lane whose path ended begins the next one at once.

    From walkers `fresh` of which none has begun a path, `begin` makes those that are told to ready for their first
    collision; `step` is one collision of all.
    """
    key, first = jax.random.split(key)
    ended = jnp.ones(jax.tree.leaves(fresh)[0].shape[-2:], bool)
    state = begin(first, fresh, ended)
    score = jax.eval_shape(step, key, state).score
    sums = Sums(jnp.zeros(score.shape), jnp.zeros(ended.shape))

    def body(loop: _Loop) -> _Loop:
        key, one, two = jax.random.split(loop.key, 3)
        moved, active = step(one, loop.state), loop.done < quota
        score = loop.sums.score + jnp.where(active, moved.score, 0.0)
        cut = loop.sums.cut + jnp.where(active & moved.ended, moved.cut, 0.0)
        return _Loop(key, begin(two, moved.state, moved.ended), Sums(score, cut), loop.done + moved.ended)

    loop = _Loop(key, state, sums, jnp.zeros(ended.shape, int))
    return jax.lax.while_loop(lambda loop: (loop.done < quota).any(), body, loop).sums


def roulette(weight: Colours, u: Walker) -> tuple[Walker, Bool[Array, "n w"]]:
    """The probability to survive, by which survivors are to be divided, and which paths do not survive."""
    survival = jnp.clip(weight.max(0) / ROULETTE, 1e-300, 1.0)
    return survival, u >= survival
