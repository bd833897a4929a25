"""Where a fit begins: a grid over the shape parameters in which the weights (kd, ks) are solved exactly.

Gives starts; refines none of them.
"""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat.fitting.likelihood import Data
from fitmat.fitting.stabilising import spread, stabilised
from fitmat.models.base import AbstractBRDF, evaluate_pairs
from fitmat.models.parameters import Entry, entries, vector, with_vector

MAX_ROWS = 4000
"""The grid looks at no more rows than this, evenly spread over the file."""

SWEEPS = 300
"""Coordinate-descent sweeps of the non-negative least squares; two lobes need far fewer."""


def starting_points(
    model: AbstractBRDF, data: Data, s: Array, held: dict[str, np.ndarray], count: int
) -> Float[np.ndarray, "k p"]:
    """The `count` best parameter vectors of the grid, best first.

    Args:
        model: Gives the parameters, their grid values and their shapes; its values fill what the grid leaves open.
        data: The samples.
        s: Discrepancy under which the candidates are weighted and ranked.
        held: Fixed parameters by name.
        count: How many to return.

    Returns:
        Physical parameter vectors; fewer than `count` rows where the grid is smaller.
    """
    every = entries(model)
    stride = max(1, -(-data.x.shape[0] // MAX_ROWS))
    thinned = data.every(stride)
    free = [e for e in every if e.name not in held]
    nodes = np.array(_nodes(model, [e for e in free if not e.param.weight], held), float)
    weights = np.concatenate([np.arange(e.place.start, e.place.stop) for e in free if e.param.weight] or [[]])
    ranked, cost = _solve_nodes(model, thinned, s, jnp.asarray(nodes), tuple(int(w) for w in weights))
    order = np.argsort(np.nan_to_num(np.asarray(cost), nan=np.inf))
    return np.asarray(ranked)[order[:count]]


def _nodes(model: AbstractBRDF, shapes: list[Entry], held: dict[str, np.ndarray]) -> list[np.ndarray]:
    base = np.array(vector(model))
    for entry in entries(model):
        if entry.name in held:
            base[entry.place] = held[entry.name]
    result = []
    for values in itertools.product(*(e.param.starts for e in shapes)):
        node = base.copy()
        for entry, value in zip(shapes, values, strict=True):
            node[entry.place] = value
        result.append(node)
    return result


@eqx.filter_jit
def _solve_nodes(
    model: AbstractBRDF, data: Data, s: Array, nodes: Float[Array, "k p"], weights: tuple[int, ...]
) -> tuple[Float[Array, "k p"], Float[Array, " k"]]:
    """For every node: the vector with its weights solved, and its cost in the transform of the likelihood."""
    places = jnp.array(weights, int)
    root_weight = jnp.sqrt(data.weight) / spread(data.x, data.noise, s)

    def value(p: Array) -> Array:
        return evaluate_pairs(with_vector(model, p), data.wi, data.wo) * data.kappa

    def one(node: Array) -> tuple[Array, Array]:
        if weights:
            dark = node.at[places].set(0.0)
            offset = value(dark)
            columns = jax.vmap(lambda k: value(dark.at[k].set(1.0)) - offset)(places)
            columns = (columns * root_weight).reshape(len(weights), -1)
            target = ((data.x - offset) * root_weight).ravel()
            node = dark.at[places].set(nonnegative(columns @ columns.T, columns @ target))
        z = stabilised(data.x, data.noise, s) - stabilised(value(node), data.noise, s)
        return node, jnp.sum(data.weight * z**2)

    return jax.vmap(one)(nodes)


def nonnegative(gram: Float[Array, "k k"], moment: Float[Array, " k"]) -> Float[Array, " k"]:
    """The w ≥ 0 that minimises ½wᵀGw − mᵀw, by cyclic coordinate descent (Franc, Hlaváč & Navara 2005).

    Descent crawls where columns are almost alike: in the end the weights that are not 0 are solved for at once, and
    that is taken where it is better.

    Args:
        gram: G = AᵀA, (k, k).
        moment: m = Aᵀb, (k,).
    """
    diagonal = jnp.diagonal(gram)
    safe = jnp.where(diagonal > 0, diagonal, 1.0)

    def coordinate(k: int, w: Array) -> Array:
        best = w[k] + (moment[k] - gram[k] @ w) / safe[k]
        return w.at[k].set(jnp.where(diagonal[k] > 0, jnp.maximum(best, 0.0), 0.0))

    def sweep(_: int, w: Array) -> Array:
        return jax.lax.fori_loop(0, len(moment), coordinate, w)

    crawled = jax.lax.fori_loop(0, SWEEPS, sweep, jnp.zeros_like(moment))
    used = crawled > 0
    among = jnp.where(used[:, None] & used, gram, jnp.eye(len(moment)))
    solved = jnp.linalg.solve(among, jnp.where(used, moment, 0.0))

    def cost(w: Array) -> Array:
        return 0.5 * w @ gram @ w - moment @ w

    better = jnp.isfinite(solved).all() & (solved >= 0).all() & (cost(solved) < cost(crawled))
    return jnp.where(better, solved, crawled)
