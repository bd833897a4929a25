"""Table: where many fits begin, from one grid for all of them, in which the weights (kd, ks) are solved exactly.

As `starts` has it for one fit, but for two things: nodes are ranked by the squares that are linear in the weights, and
one from each valley of the grid comes first. It refines none of them.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from fitmat.fitting.many.lanes import Samples, Shared
from fitmat.fitting.refining import STARTS
from fitmat.fitting.stabilising import spread
from fitmat.fitting.starts import lit, nodes
from fitmat.maths.programs import program_run_often
from fitmat.models.parameters import entries

NODES = STARTS
"""Best nodes of the grid, wherever they lie, from which a fit begins again; as many as those of a single fit."""


class Table(eqx.Module):
    """A grid over the shape parameters, m nodes, and what the model is there.

    Attributes:
        dark: Parameter vectors with all weights 0, (m, p).
        offset: f κ there, (m, n, c).
        columns: What a weight of 1 adds, (m, w, n, c).
        grid: How many nodes the grid has along each axis.
        places: Where each of the w weights stands in the vector: first and last number.
    """

    dark: Any
    offset: Any
    columns: Any
    grid: tuple[int, ...] = eqx.field(static=True)
    places: tuple[tuple[int, int], ...] = eqx.field(static=True)


def table(shared: Shared, held: Mapping[str, np.ndarray]) -> Table:
    """The grid of a model at the shared directions.

    Args:
        shared: The model and the directions.
        held: Fixed parameters by name.
    """
    free = [e for e in entries(shared.template) if e.name not in held]
    shapes, weights = [e for e in free if not e.param.weight], [e for e in free if e.param.weight]
    seen = lit(shared.template, nodes(shared.template, shapes, held), weights, shared.wi, shared.wo)
    grid = tuple(len(e.param.starts) for e in shapes)
    count = len(seen.dark)
    offset, columns = (
        np.broadcast_to(part, (*part.shape[:-1], shared.channels)) for part in (seen.offset, seen.columns)
    )
    axes = grid if np.prod(grid, dtype=int) == count else (count,)
    return Table(seen.dark, offset, columns, axes, tuple((e.place.start, e.place.stop) for e in weights))


@program_run_often
def begin_many(
    known: Table, samples: Samples, first: ArrayLike, count: int
) -> tuple[Float[Array, "T N p"], Float[Array, "T N"]]:
    """The starts of every surface, and the cost of each: of `count` valleys of the grid, then of its best `NODES`.

    The cost is infinite where the grid has fewer valleys, and of a node that is one of them.

    Args:
        known: The grid.
        samples: Of the T surfaces.
        first: Discrepancy under which the nodes are ranked, (T,).
        count: Most valleys, S; N is S + `NODES`, or less of a smaller grid.
    """
    x, weight = jnp.asarray(samples.x), jnp.asarray(samples.weight)
    importance = weight / spread(x, jnp.asarray(samples.noise), jnp.asarray(first)[:, None, None]) ** 2
    solved = [_weights(known, x[:, :, c], importance[:, :, c], c) for c in range(x.shape[2])]
    whole = sum(part for _, part in solved[1:]) + solved[0][1]
    cost = jnp.where(jnp.isnan(whole), jnp.inf, whole)
    least, place = jax.lax.top_k(-_valleys(cost, known.grid), min(count, cost.shape[1]))
    others, beside = jax.lax.top_k(-cost, min(NODES, cost.shape[1]))
    known_already = jnp.any((beside[:, :, None] == place[:, None]) & jnp.isfinite(least)[:, None], axis=2)
    least = jnp.concatenate([least, jnp.where(known_already, -jnp.inf, others)], axis=1)
    place = jnp.concatenate([place, beside], axis=1)
    chosen = jnp.asarray(known.dark)[place]
    for k, (start, stop) in enumerate(known.places):
        each = [jnp.take_along_axis(weights[k], place, 1) for weights, _ in solved]
        own = jnp.stack(each if stop - start > 1 else [sum(each[1:]) + each[0]], -1)
        chosen = chosen.at[:, :, start:stop].set(own if stop - start > 1 else own / len(each))
    return chosen, -least


def _weights(
    known: Table, x: Float[Array, "T n"], importance: Float[Array, "T n"], channel: int
) -> tuple[list[Float[Array, "T m"]], Float[Array, "T m"]]:
    """Of one channel: the weights at every node, each at least 0, and the sum of squares that is left."""
    offset = jnp.asarray(known.offset)[:, :, channel]
    columns = jnp.moveaxis(jnp.asarray(known.columns)[..., channel], 1, 0)
    target = importance * x
    gram = [[importance @ (a * b).T for b in columns[: k + 1]] for k, a in enumerate(columns)]
    moment = [target @ a.T - importance @ (a * offset).T for a in columns]
    left = jnp.sum(target * x, axis=1, keepdims=True) - 2.0 * target @ offset.T + importance @ (offset**2).T
    found, best = [jnp.zeros_like(left) for _ in columns], jnp.zeros_like(left)
    for size in range(1, len(columns) + 1):
        for some in itertools.combinations(range(len(columns)), size):
            w = _eliminated([[gram[max(i, j)][min(i, j)] for j in some] for i in some], [moment[i] for i in some])
            gain = sum((part * moment[i] for i, part in zip(some[1:], w[1:], strict=True)), w[0] * moment[some[0]])
            better = jnp.all(jnp.stack(w) >= 0, axis=0) & (gain > best)
            best = jnp.where(better, gain, best)
            by_place = dict(zip(some, w, strict=True))
            found = [jnp.where(better, by_place.get(k, 0.0), old) for k, old in enumerate(found)]
    return found, left - best


def _eliminated(matrix: Sequence[Sequence[Array]], right: Sequence[Array]) -> list[Array]:
    """The solution of positive definite systems side by side; not finite where one is singular."""
    if len(right) == 1:
        return [right[0] / matrix[0][0]]
    ratio = [row[0] / matrix[0][0] for row in matrix[1:]]
    smaller = [
        [a - r * b for a, b in zip(row[1:], matrix[0][1:], strict=True)]
        for row, r in zip(matrix[1:], ratio, strict=True)
    ]
    rest = _eliminated(smaller, [b - r * right[0] for b, r in zip(right[1:], ratio, strict=True)])
    taken = [a * w for a, w in zip(matrix[0][1:], rest, strict=True)]
    return [(right[0] - sum(taken[1:]) - taken[0]) / matrix[0][0], *rest]


def _valleys(cost: Float[Array, "T m"], grid: tuple[int, ...]) -> Float[Array, "T m"]:
    """The costs at nodes that are no higher than their neighbours along the axes of the grid, infinite elsewhere."""
    cost = cost.reshape(-1, *grid)
    lowest = jnp.ones(cost.shape, bool)
    for axis in range(1, cost.ndim):
        edge = jnp.full_like(jnp.take(cost, jnp.array([0]), axis=axis), jnp.inf)
        size = cost.shape[axis]
        walled = jnp.concatenate([edge, cost, edge], axis=axis)
        for start in (0, 2):
            lowest &= cost <= jax.lax.slice_in_dim(walled, start, start + size, axis=axis)
    return jnp.where(lowest, cost, jnp.inf).reshape(len(cost), -1)
