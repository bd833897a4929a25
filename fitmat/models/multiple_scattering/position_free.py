"""Multiple scattering on Smith microsurfaces without depths: the mean of `random_walk` with less variance.

Reflection only: light that a facet refracts leaves the half space in which all depths integrate to exponentials.

B. Bitterli & E. d'Eon, A position-free path integral for homogeneous slabs and multiple scattering on Smith
microfacets, Computer Graphics Forum 41(4), 2022: only directions are sampled, depths are integrated analytically. The
last direction of each path is sampled from both ends and weighted by the balance heuristic (E. Veach, 1995).
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float, Int, PRNGKeyArray

from fitmat.errors import ModelError
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
    facet_area,
    mirror_phase,
    mirrored,
    reflectance,
    refuse_kinds,
    smith,
    visible_normal,
)

STAGES = 32
"""Flights downwards of one path; a path that would need more is cut, and the energy that it carried is reported."""


def evaluate_slab(
    surface: Surface, wi: ArrayLike, wo: ArrayLike, *, samples: int, seed: int, order: int | None = None
) -> MonteCarlo:
    """BRDF with all orders of scattering in sr⁻¹ (no cosine); arguments and errors as for `random_walk.evaluate_walk`.

    Light of one collision is exact: it is the Smith BRDF with height-correlated masking, without standard error.

    Raises:
        ModelError: the surface transmits; also what `evaluate_walk` refuses.
    """
    refuse_kinds(surface, samples, seed, order)
    if surface.transmits:
        raise ModelError("the surface transmits, and refracted light leaves the half space: take evaluate_walk.")
    plan = plan_paths(wi, wo, samples=samples, order=order)
    first = np.asarray(_first(surface, plan.wi, plan.wo))[..., 0].T * (order in (None, 1))
    if order == 1:
        return MonteCarlo(first, np.zeros_like(first), np.zeros(len(first)), plan.static.lanes * plan.static.quota)
    found = plan.result(
        _evaluate(surface, plan.wi, plan.wo, plan.orders, jax.random.key(seed, impl=GENERATOR), plan.static), plan.wo[2]
    )
    return MonteCarlo(first + found.value, found.standard_error, found.omitted, found.samples)


@eqx.filter_jit
def _first(surface: Surface, wi: Array, wo: Array) -> Colours:
    """f of one collision, F D/(4 c_i c_o (1 + Λ_i + Λ_o))."""
    density, cos = mirror_phase(surface, wi, wo)
    into, out = 1.0 + smith(surface, wi), smith(surface, wo)
    return reflectance(surface.fresnel, cos) * density * into / (into + out) / wo[2]


class Depths(NamedTuple):
    """Distribution of the depth of a collision: a sum of exponential stages, of which the first few may be missing.

    With the share `shares[i]` the depth is the sum of the stages i … used−1; what is missing from 1 has escaped.
    """

    rates: Float[Array, "k n w"]
    shares: Float[Array, "k n w"]
    used: Int[Array, "n w"]


class Flight(NamedTuple):
    """A direction as its flights see it.

    Attributes:
        up: Whether it leads out.
        rate: Its extinction.
    """

    up: Bool[Array, "n w"]
    rate: Walker


def flight(surface: Surface, away: Walkers3) -> Flight:
    """Λ(ω) upwards, 1 + Λ(−ω) downwards."""
    up = away[2] >= 0.0
    return Flight(up, smith(surface, away) + ~up)


def fly(depths: Depths, on: Flight, other: Flight, out: Walker) -> tuple[Depths, Walker, Walker, Walker]:
    """Depths of the next collision, the share that reaches it, and ∫ e(t) exp(−out·t) dt for it and another flight.

    Downwards a stage is added. Upwards an exponential flight of rate s ends within a stage of rate r with probability
    s/(s+r), and what is left of that stage is again exponential with rate r; else the stage is used up and the flight
    goes on into the next. All terms are positive: nothing cancels, unlike in sums of exponentials.
    """

    def stage(i: Array, carry: tuple[Array, ...]) -> tuple[Array, ...]:
        rates, shares, flux, flux_other, total, reach, reach_other = carry
        live, r = i < depths.used, rates[i]
        share = jnp.where(live, shares[i], 0.0)
        passes = jnp.where(live, r / (r + out), 1.0)
        left, flux = _within(on, share, flux, r)
        left_other, flux_other = _within(other, share, flux_other, r)
        added = ~on.up & (i == depths.used)
        rates = rates.at[i].set(jnp.where(added, on.rate, r))
        left, left_other = jnp.where(live, left, 0.0), jnp.where(live, left_other, 0.0)
        reach, reach_other = (reach + left) * passes, (reach_other + left_other) * passes
        return rates, shares.at[i].set(left), flux, flux_other, total + left, reach, reach_other

    zero = jnp.zeros_like(out)
    last = jnp.minimum(depths.used.max() + 1, STAGES)
    rates, shares, _, _, total, reach, reach_other = jax.lax.fori_loop(
        0, last, stage, (depths.rates, depths.shares, zero, zero, zero, zero, zero)
    )
    reach, reach_other = (
        jnp.where(f.up, x, x * f.rate / (f.rate + out)) for f, x in ((on, reach), (other, reach_other))
    )
    return Depths(rates, shares, depths.used + ~on.up), total, reach, reach_other


def _within(on: Flight, share: Walker, flux: Walker, rate: Walker) -> tuple[Walker, Walker]:
    """Of the flights that end or come into a stage: those that end within it, those that come out of it."""
    into = share + flux
    return jnp.where(on.up, into * on.rate / (on.rate + rate), share), into * rate / (on.rate + rate)


class _Walkers(NamedTuple):
    """At a collision: where the light comes from, depths, throughput, collisions so far, paths begun by the lane."""

    w: Walkers3
    depths: Depths
    weight: Colours
    bounces: Int[Array, "n w"]
    path: Int[Array, "n w"]


_PLASTIC = 1.324717957244746
# Root of x³ = x + 1; multiples of its inverse powers fill the square evenly (M. Roberts's R2 sequence).


def _regular(shift: Float[Array, "4 n w"], path: Int[Array, "n w"]) -> Float[Array, "4 n w"]:
    """Two points of the unit square for each path: lattices that each lane shifts at random (Cranley & Patterson)."""
    step = jnp.array([1.0 / _PLASTIC, 1.0 / _PLASTIC**2] * 2)
    return (shift + path * step[:, None, None]) % 1.0


def _bridge(surface: Surface, w: Walkers3, away: Walkers3, wo: Walkers3) -> Colours:
    """p(w → away) p(−away → ω_o) over the sum of the densities with which the two ends sample that direction.

    The densities are a = D/(4 area) from w, and b from ω_o; p(−away → ω_o) = b area(ω_o)/area(−away), as D is the same.
    """
    a, cos = mirror_phase(surface, w, away)
    b, cos_o = mirror_phase(surface, wo, -away)
    both = a + b
    harmonic = a * b / jnp.where(both > 0.0, both, 1.0)
    fresnel = reflectance(surface.fresnel, cos) * reflectance(surface.fresnel, cos_o)
    return fresnel * harmonic * facet_area(surface, wo) / facet_area(surface, -away)


@eqx.filter_jit
def _evaluate(surface: Surface, wi: Array, wo: Array, orders: Orders, key: PRNGKeyArray, static: Static) -> Sums:
    """Scores f·cosθ_o of all orders above the first."""
    shape = (wi.shape[1], static.lanes)
    wi, wo = (jnp.broadcast_to(w, (3, *shape)) for w in (wi, wo))
    out, entering = smith(surface, wo), 1.0 + smith(surface, wi)
    white = jnp.ones_like(reflectance(surface.fresnel, out))
    stages, none = jnp.zeros((STAGES, *shape)), jnp.zeros(shape, int)
    key, key_shift = jax.random.split(key)
    shift = jax.random.uniform(key_shift, (4, *shape))

    def begin(_: PRNGKeyArray, old: _Walkers, ended: Bool[Array, "n w"]) -> _Walkers:
        rates, shares, count = old.depths
        first = [a.at[0].set(jnp.where(ended, x, a[0])) for a, x in ((rates, entering), (shares, 1.0))]
        depths = Depths(first[0], first[1], jnp.where(ended, 1, count))
        w, weight = jnp.where(ended, wi, old.w), jnp.where(ended, 1.0, old.weight)
        return _Walkers(w, depths, weight, jnp.where(ended, 1, old.bounces), old.path + ended)

    def step(key: PRNGKeyArray, old: _Walkers) -> Step:
        u = jax.random.uniform(key, (5, *shape))
        v = jnp.where(old.bounces == 1, _regular(shift, old.path), u[:4])
        m = visible_normal(surface, old.w, (v[0], v[1]))
        ahead = mirrored(old.w, m)
        back = -mirrored(wo, visible_normal(surface, wo, (v[2], v[3])))
        depths, survive, reach, reach_back = fly(old.depths, flight(surface, ahead), flight(surface, back), out)
        bridges = _bridge(surface, old.w, ahead, wo) * reach + _bridge(surface, old.w, back, wo) * reach_back
        weight = old.weight * reflectance(surface.fresnel, dot(old.w, m))
        survival, lost = roulette(weight * survive, u[4])
        bounces, weight = old.bounces + 1, weight / survival
        cut = ~lost & ((bounces > orders.last) | (depths.used >= STAGES))
        score = old.weight * bridges * orders.include(bounces)
        omitted = weight.max(0) * survive * (cut & (orders.counted == 0))
        return Step(_Walkers(-ahead, depths, weight, bounces, old.path), score, lost | cut, omitted)

    fresh = _Walkers(wi, Depths(stages, stages, none), white, none, none)
    return follow(fresh, begin, step, key, static.quota)
