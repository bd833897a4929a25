"""Remakes what a rough dielectric face does with light from either side, every order of scattering there.

`fitmat/models/around/faces.npz` holds shares of Heitz's walk with reflection and refraction (2016) on a GGX surface, at
`ALPHAS` × `ETAS` and the cosines of the adding equation; see `fitmat/models/around/passage.py`. The facets are those
of `fitmat/models/multiple_scattering/surface.py`; `tests/models/around/test_exchange.py` compares coats with a walk of
its own.

Run: python benchmarks/faces.py [PHOTONS]
"""

import itertools
import sys
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PRNGKeyArray

from fitmat.models.around.nodes import KEPT, LEAVING, again_cosines, cardinal, cosines
from fitmat.models.around.passage import ALPHAS, ETAS, FILE, smooth_passage
from fitmat.models.multiple_scattering.surface import (
    Surface,
    dot,
    flown,
    mirrored,
    other_side,
    refracted,
    smith,
    visible_normal,
)
from fitmat.models.terms.fresnel import dielectric

LANES = 256
"""Walkers that start at each cosine."""

SEED = 1


class Photons(NamedTuple):
    """Walkers before a collision: where light comes from, in the frame of its side; depth; side; collisions so far."""

    w: Array
    depth: Array
    inside: Array
    met: Array


class Sums(NamedTuple):
    """Per walker: cardinal functions of where photons went inside, how many were reflected again, and all."""

    inside: Array
    again: Array
    done: Array


def collided(surface: Surface, at: Photons, u: Array) -> Photons:
    """After one facet and the flight from there; a depth below 0 is outside of the surface on that side."""
    m = visible_normal(surface, at.w, (u[0], u[1]))
    eta = surface.eta(at.inside)
    passes = u[2] >= dielectric(jnp.clip(dot(at.w, m), 0.0, 1.0), eta)
    away = jnp.where(passes, -refracted(at.w, m, eta), mirrored(at.w, m))
    depth = flown(surface, away, jnp.where(passes, other_side(at.depth), at.depth), u[3])
    return Photons(-away, depth, at.inside ^ passes, at.met + 1)


@eqx.filter_jit
def walked(surface: Surface, start: Array, side: Array, key: PRNGKeyArray, quota: Array) -> Sums:
    """`quota` photons for each of `LANES` walkers from every cosine, on the outer side or the inner one."""
    eta = surface.eta(jnp.array(False))
    start, side = jnp.repeat(start, LANES), jnp.repeat(side, LANES)
    first = jnp.stack([jnp.sqrt(1.0 - start**2), 0.0 * start, start])

    def fresh(u: Array) -> Photons:
        return Photons(first, -jnp.log1p(-u) / (1.0 + smith(surface, first)), side, jnp.zeros(len(start), int))

    def body(loop: tuple[PRNGKeyArray, Photons, Sums]) -> tuple[PRNGKeyArray, Photons, Sums]:
        key, one = jax.random.split(loop[0])
        u = jax.random.uniform(one, (5, len(start)))
        at, sums = collided(surface, loop[1], u[:4]), loop[2]
        out, counts = at.depth <= 0.0, sums.done < quota
        found = cardinal(eta, jnp.abs(at.w[2])) * (out & at.inside & counts)[:, None]
        again = out & ~at.inside & counts & (at.met > 1)
        sums = Sums(sums.inside + found, sums.again + again, sums.done + (out & counts))
        return key, jax.tree.map(lambda a, b: jnp.where(out, a, b), fresh(u[4]), at), sums

    zero = jnp.zeros(len(start))
    key, one = jax.random.split(key)
    loop = key, fresh(jax.random.uniform(one, zero.shape)), Sums(jnp.zeros((len(start), LEAVING + KEPT)), zero, zero)
    return jax.lax.while_loop(lambda loop: (loop[2].done < quota).any(), body, loop)[2]


def from_cosines(surface: Surface, start: Array, side: Array, key: PRNGKeyArray, count: int) -> list[np.ndarray]:
    """Sums over the walkers of each cosine, each over their number: inside, again."""
    *found, done = walked(surface, start, side, key, jnp.asarray(-(-count // LANES)))
    total = np.asarray(done).reshape(-1, LANES).sum(axis=1)[:, None]
    return [np.asarray(part).reshape(len(start), LANES, -1).sum(axis=1) / total for part in found]


def shares(alpha: float, eta: float, key: PRNGKeyArray, count: int) -> dict[str, np.ndarray]:
    """Of `count` photons from every cosine: what the file holds."""
    surface, (outer, inner) = Surface("ggx", alpha, eta, transmits=True), cosines(jnp.asarray(eta))
    start, side = jnp.concatenate([outer[:LEAVING], inner]), jnp.arange(2 * LEAVING + KEPT) >= LEAVING
    inside, _ = from_cosines(surface, start, side, key, count)
    smooth = smooth_passage(jnp.asarray(eta))
    entering = inside[:LEAVING] / inside[:LEAVING].sum(axis=1, keepdims=True)
    start = again_cosines(jnp.asarray(alpha))
    _, again = from_cosines(surface, start, jnp.zeros(LEAVING, bool), jax.random.fold_in(key, 1), count)
    return {
        "entering": entering - np.asarray(smooth.entering),
        "returning": inside[LEAVING:] - np.asarray(smooth.returning),
        "again": again[:, 0],
    }


def main(count: int) -> None:
    """Writes the file."""
    jax.config.update("jax_enable_x64", True)
    key, found = jax.random.key(SEED, impl="rbg"), []
    for alpha, eta in itertools.product(ALPHAS, ETAS):
        key, one = jax.random.split(key)
        found.append(shares(alpha, eta, one, count))
        print(f"alpha {alpha:g}, eta {eta:g}", flush=True)
    tables = {name: np.stack([part[name] for part in found]).astype(np.float32) for name in found[0]}
    every: dict[str, Any] = {name: t.reshape(len(ALPHAS), len(ETAS), *t.shape[1:]) for name, t in tables.items()}
    np.savez_compressed(FILE, **every)
    print(f"{FILE}: {FILE.stat().st_size} bytes.")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200_000)
