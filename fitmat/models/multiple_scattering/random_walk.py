"""Multiple scattering on Smith microsurfaces by Heitz's random walk: unbiased values with their standard errors.

Evaluates, never fits: there are no gradients and no closed forms, and nothing below the micro-surface scatters.

E. Heitz, J. Hanika, E. d'Eon & C. Dachsbacher, Multiple-scattering microfacet BSDFs with the Smith model, ACM TOG
35(4), 2016, as in the authors' supplemental code (MicrosurfaceScattering.cpp: sampleHeight, eval, sample).
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Int, PRNGKeyArray

from fitmat.models.multiple_scattering.paths import (
    GENERATOR,
    MonteCarlo,
    Orders,
    Static,
    Step,
    Sums,
    follow,
    plan_paths,
    roulette,
)
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


def albedo_walk(surface: Surface, wi: ArrayLike, *, samples: int, seed: int, order: int | None = None) -> Escaped:
    """Fractions of the light from each direction that leave the surface on either side.

    A surface that absorbs nothing gives 1 in total without any noise: each path ends on one side or the other.
    Arguments and errors as for `evaluate_walk`.
    """
    refuse_kinds(surface, samples, seed, order)
    plan = plan_paths(wi, wi, samples=samples, order=order)
    both = plan.result(
        _evaluate(surface, plan.wi, None, plan.orders, jax.random.key(seed, impl=GENERATOR), plan.static)
    )
    sides = [(a[:, :-1], a[:, -1:]) for a in (both.value, both.standard_error)]
    return Escaped(*(MonteCarlo(value, error, both.omitted, both.samples) for value, error in zip(*sides, strict=True)))


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
            leaves = ~lost & ~goes_on & orders.include(bounces)
            score = jnp.concatenate([weight * ~inside, weight[:1] * inside]) * leaves
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
