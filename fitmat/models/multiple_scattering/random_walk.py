"""Multiple scattering on Smith microsurfaces by Heitz's random walk: unbiased values with their standard errors.

Evaluates, never fits: there are no gradients and no closed forms, and nothing below the micro-surface scatters.

E. Heitz, J. Hanika, E. d'Eon & C. Dachsbacher, Multiple-scattering microfacet BSDFs with the Smith model, ACM TOG
35(4), 2016, as in the authors' supplemental code (MicrosurfaceScattering.cpp: sampleHeight, eval, sample).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float, Int, PRNGKeyArray

from fitmat.errors import ModelError
from fitmat.models.base import direction_pairs
from fitmat.models.multiple_scattering.surface import (
    Colours,
    Surface,
    Walker,
    Walkers3,
    dot,
    flown,
    mirror_phase,
    mirrored,
    other_side,
    reflectance,
    refracted,
    refraction_phase,
    refuse_kinds,
    smith,
    visible_normal,
)
from fitmat.models.terms.fresnel import dielectric
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


@dataclass(frozen=True, eq=False)
class MonteCarlo:
    """An estimate.

    Attributes:
        value: Mean over the paths; one row per pair or incidence, one column per channel.
        standard_error: Its standard error, same shape.
        omitted: Fraction of the incident energy in paths that were cut, missing in `value`; one per row.
        samples: Paths followed per row.
    """

    value: Float[np.ndarray, "n c"]
    standard_error: Float[np.ndarray, "n c"]
    omitted: Float[np.ndarray, " n"]
    samples: int
    __repr__ = brief


class Escaped(NamedTuple):
    """Where the light goes: `reflected`, and `transmitted` (0 unless the surface transmits); the rest is absorbed."""

    reflected: MonteCarlo
    transmitted: MonteCarlo


def evaluate_walk(
    surface: Surface, wi: ArrayLike, wo: ArrayLike, *, samples: int, seed: int, order: int | None = None
) -> MonteCarlo:
    """BRDF with all orders of scattering in sr⁻¹ (no cosine), by next-event estimation at each collision.

    Args:
        surface: The rough interface; alpha_x is meant along the x axis.
        wi: Unit vectors to the light, (n, 3), above the surface.
        wo: Unit vectors to the sensor, (n, 3), above the surface.
        samples: Paths per pair, at least 2; rounded up to a multiple of the walkers per pair.
        seed: Of the random numbers.
        order: Light of this number of collisions only; None for all.

    Raises:
        ModelError: the directions, the number of samples or the order are not usable.

    Example:
        >>> import numpy as np
        >>> from fitmat.models.terms.fresnel import White
        >>> from fitmat.models.terms.distributions import GGX
        >>> white = Surface(GGX(), (0.5, 0.5), White())
        >>> up = np.array([[0.0, 0.0, 1.0]])
        >>> evaluate_walk(white, up, up, samples=10_000, seed=1).value.round(1)
        array([[0.4]])
    """
    refuse_kinds(surface, samples, seed, order)
    plan = plan_paths(wi, wo, samples=samples, order=order)
    return plan.result(
        _evaluate(surface, plan.wi, plan.wo, plan.orders, jax.random.key(seed, impl=GENERATOR), plan.static), plan.wo[2]
    )


def albedo_walk(surface: Surface, wi: ArrayLike, *, samples: int, seed: int) -> Escaped:
    """Fractions of the light from each direction that leave the surface on either side.

    A surface that absorbs nothing gives 1 in total without any noise: each path ends on one side or the other.
    Arguments and errors as for `evaluate_walk`.
    """
    refuse_kinds(surface, samples, seed, None)
    plan = plan_paths(wi, wi, samples=samples, order=None)
    both = plan.result(
        _evaluate(surface, plan.wi, None, plan.orders, jax.random.key(seed, impl=GENERATOR), plan.static)
    )
    sides = [(a[:, :-1], a[:, -1:]) for a in (both.value, both.standard_error)]
    return Escaped(*(MonteCarlo(value, error, both.omitted, both.samples) for value, error in zip(*sides, strict=True)))


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
        wrong = ~((np.abs(np.linalg.norm(w, axis=1) - 1.0) < 1e-6) & (w[:, 2] > 0.0))
        if wrong.any():
            row = int(np.argmax(wrong))
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


class _Walkers(NamedTuple):
    """Before a collision: where light comes from (`w`, in the frame of its side), depth, side, throughput, count."""

    w: Walkers3
    depth: Walker
    inside: Bool[Array, "n w"]
    weight: Colours
    bounces: Int[Array, "n w"]


@eqx.filter_jit
def _evaluate(surface: Surface, wi: Array, wo: Array | None, orders: Orders, key: PRNGKeyArray, static: Static) -> Sums:
    """Scores f·cosθ_o of next-event estimation towards ω_o; without ω_o, energies that leave on either side."""
    shape = (wi.shape[1], static.lanes)
    none, zero = jnp.zeros(shape, bool), jnp.zeros(shape, int)
    white = jnp.ones_like(reflectance(surface.fresnel, jnp.ones(shape)))
    fresh = _Walkers(jnp.broadcast_to(wi, (3, *shape)), jnp.zeros(shape), none, white, zero)

    def begin(key: PRNGKeyArray, old: _Walkers, ended: Bool[Array, "n w"]) -> _Walkers:
        first = fresh._replace(depth=jax.random.exponential(key, shape) / (1.0 + smith(surface, wi)))
        return jax.tree.map(lambda a, b: jnp.where(ended, a, b), first, old)

    def step(key: PRNGKeyArray, old: _Walkers) -> Step:
        u = jax.random.uniform(key, (4, *shape))
        bounces = old.bounces + 1
        away, inside, weight = _scatter(surface, old, u)
        survival, lost = (1.0, none) if surface.transmits else roulette(weight, u[2])
        weight = weight / survival
        depth = flown(surface, away, jnp.where(inside == old.inside, old.depth, other_side(old.depth)), u[3])
        goes_on = ~lost & (depth > 0.0)
        cut = goes_on & (bounces >= orders.last)
        if wo is None:
            score = jnp.concatenate([weight * ~inside, weight[:1] * inside]) * (~lost & ~goes_on)
        else:
            score = _next_event(surface, old, wo) * orders.include(bounces)
        omitted = weight.max(0) * (cut & (orders.counted == 0))
        return Step(_Walkers(-away, depth, inside, weight, bounces), score, ~goes_on | cut, omitted)

    return follow(fresh, begin, step, key, static.quota)


def _next_event(surface: Surface, at: _Walkers, wo: Array) -> Colours:
    """Throughput × phase function towards ω_o × probability exp(−Λ(ω_o) t) to get out on that way."""
    density, cos = mirror_phase(surface, at.w, wo)
    phase, depth = reflectance(surface.fresnel, cos) * density, at.depth
    if surface.transmits:
        through = refraction_phase(surface, at.w, -wo, surface.eta(at.inside))
        phase, depth = jnp.where(at.inside, through, phase), jnp.where(at.inside, other_side(depth), depth)
    return at.weight * phase * jnp.exp(-smith(surface, wo) * depth)


def _scatter(surface: Surface, at: _Walkers, u: Array) -> tuple[Walkers3, Bool[Array, "n w"], Colours]:
    """The direction in which light goes on, in the frame of its side; that side; the throughput."""
    m = visible_normal(surface, at.w, (u[0], u[1]))
    back, cos = mirrored(at.w, m), dot(at.w, m)
    if not surface.transmits:
        return back, at.inside, at.weight * reflectance(surface.fresnel, cos)
    eta = surface.eta(at.inside)
    passes = u[2] >= dielectric(jnp.clip(cos, 0.0, 1.0), eta)
    return jnp.where(passes, -refracted(at.w, m, eta), back), at.inside ^ passes, at.weight
