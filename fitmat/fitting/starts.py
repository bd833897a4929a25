"""Where a fit begins: a grid over the shape parameters in which the weights (kd, ks) are solved exactly.

Gives starts; refines none of them.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from fitmat.fitting.channelwise import Part, divides
from fitmat.fitting.likelihood import Data
from fitmat.fitting.stabilising import spread, stabilised
from fitmat.maths.parts import slices
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import Entry, entries, holding
from fitmat.models.values import SMALL, values

MAX_ROWS = SMALL[1]
"""The grid looks at no more rows than this, evenly spread over the file."""

MOST_NODES = 1 << 13
"""Nodes of a grid that are looked at; three lobes have fewer, seven have 10⁸."""

MOST_NUMBERS = 4_000_000
"""Values of the model that are held at a time."""

SWEEPS = 300
"""Coordinate-descent sweeps of the non-negative least squares; two lobes need far fewer."""

MOST_TRIED = 3
"""Weights of which every choice of those that are not 0 is tried."""

STILL = 1e-12
"""Relative change of the weights at which the sweeps end."""


def starting_points(
    model: AbstractBRDF, data: Data, s: np.ndarray, held: dict[str, np.ndarray], count: int
) -> Float[np.ndarray, "k p"]:
    """The `count` best parameter vectors of the grid, best first; of many channels, of some, and what lies between.

    Args:
        model: Gives the parameters, their grid values and their shapes; its values fill what the grid leaves open.
        data: The samples.
        s: Discrepancy under which the candidates are weighted and ranked.
        held: Fixed parameters by name.
        count: How many to return.

    Returns:
        Physical parameter vectors; fewer than `count` rows where the grid is smaller.
    """
    if divides(model, channels := data.x.shape[1]):
        return _of_some(model, data, s, held, count, channels)
    free = [e for e in entries(model) if e.name not in held]
    grid = nodes(model, [e for e in free if not e.param.weight], held)
    weights = [e for e in free if e.param.weight]
    thinned = data.every(-(-data.x.shape[0] // MAX_ROWS))
    per_node = (2 + len(weights)) * thinned.x.size
    found = [
        _solve_nodes(model, thinned, s, grid[part], weights)
        for part in slices(len(grid), max(1, MOST_NUMBERS // per_node))
    ]
    solved, cost = (np.concatenate(part) for part in zip(*found, strict=True))
    return solved[np.argsort(np.nan_to_num(cost, nan=np.inf), kind="stable")[:count]]


def _of_some(
    model: AbstractBRDF, data: Data, s: np.ndarray, held: dict[str, np.ndarray], count: int, channels: int
) -> Float[np.ndarray, "k p"]:
    """The same by way of the starts of some channels."""
    part = Part(model, channels)
    few = {name: value if len(value) == 1 else value[part.which] for name, value in held.items()}
    found = starting_points(part.model, data.of_channels(part.which, part.places), s, few, count)
    free = [entry.place.start for entry in entries(model) if entry.name not in held]
    return part.spread(np.tile(holding(model, held), (len(found), 1)), found, free)


def nodes(model: AbstractBRDF, shapes: Sequence[Entry], held: Mapping[str, np.ndarray]) -> Float[np.ndarray, "k p"]:
    """Parameter vectors of a grid over these parameters, everything else as in the model or as it is held."""
    axes = [e.param.starts for e in shapes]
    chosen = list(itertools.product(*axes)) if math.prod(map(len, axes)) <= MOST_NODES else _spread_over(axes)
    found = np.tile(holding(model, held), (len(chosen), 1))
    for column, entry in enumerate(shapes):
        found[:, entry.place] = np.array([node[column] for node in chosen], float)[:, None]
    return found


def _spread_over(axes: Sequence[Sequence[float]]) -> list[tuple[float, ...]]:
    """`MOST_NODES` nodes of a larger grid, even along each axis and between any two (Sobol 1967)."""
    from scipy.stats import qmc  # which small grids, those of all usual models, do without

    places = qmc.Sobol(len(axes), scramble=False).random(MOST_NODES)
    return [tuple(axis[int(u * len(axis))] for axis, u in zip(axes, row, strict=True)) for row in places.tolist()]


class Lit(NamedTuple):
    """A model at the nodes of a grid, by what it is linear in.

    Attributes:
        dark: Parameter vectors with all weights 0, (k, p).
        offset: f κ there, (k, n, c).
        columns: What a weight of 1 adds, (k, w, n, c).
    """

    dark: Float[np.ndarray, "k p"]
    offset: Float[np.ndarray, "k n c"]
    columns: Float[np.ndarray, "k w n c"]


def lit(
    model: AbstractBRDF,
    nodes: Float[np.ndarray, "k p"],
    weights: Sequence[Entry],
    wi: Float[np.ndarray, "n 3"],
    wo: Float[np.ndarray, "n 3"],
) -> Lit:
    """The model at every node without its weights, and with each.

    A weight with one number a channel counts in that channel only, so that one look at the model serves all its
    numbers; the tints of Disney's models, which depend on all channels, are those of white in a start.
    """
    dark = nodes.copy()
    for entry in weights:
        dark[:, entry.place] = 0.0
    every = np.repeat(dark[:, None], 1 + len(weights), axis=1)
    for k, entry in enumerate(weights):
        every[:, 1 + k, entry.place] = 1.0
    x = values(model, every.reshape(-1, dark.shape[1]), wi, wo) * wi[:, 2:3]
    x = x.reshape(*every.shape[:2], *x.shape[1:])
    return Lit(dark, x[:, 0], x[:, 1:] - x[:, :1])


def _solve_nodes(
    model: AbstractBRDF, data: Data, s: np.ndarray, nodes: Float[np.ndarray, "k p"], weights: Sequence[Entry]
) -> tuple[Float[np.ndarray, "k p"], Float[np.ndarray, " k"]]:
    """For every node: the vector with its weights solved, and its cost in the transform of the likelihood."""
    dark, offset, columns = lit(model, nodes, weights, data.wi, data.wo)
    predicted = offset
    with np.errstate(all="ignore"):  # a node at which the model is not finite comes last
        if weights:
            root = np.sqrt(data.weight) / spread(data.x, data.noise, s)
            weighted, target = np.moveaxis(columns * root, -1, 1), np.moveaxis((data.x - offset) * root, -1, 1)
            gram, moment = weighted @ weighted.swapaxes(-1, -2), (weighted @ target[..., None])[..., 0]
            found = _weights(gram, moment, [entry.size for entry in weights])
            for k, entry in enumerate(weights):
                dark[:, entry.place] = found[:, : entry.size, k]
            predicted = offset + np.einsum("kcw,kwnc->knc", found, columns)
        z = stabilised(data.x, data.noise, s) - stabilised(predicted, data.noise, s)
        return dark, np.sum(data.weight * z**2, axis=(1, 2))


def _weights(
    gram: Float[np.ndarray, "k c w w"], moment: Float[np.ndarray, "k c w"], sizes: Sequence[int]
) -> Float[np.ndarray, "k c w"]:
    """The weights of each channel: each channel by itself, or all at once where one weight is of several channels.

    Args:
        gram: Of each channel's columns.
        moment: Of each channel's columns with what is measured.
        sizes: How many numbers each weight has: as many as channels, or 1.
    """
    channels = gram.shape[1]
    if all(size == channels for size in sizes):
        return nonnegative(gram, moment)
    begin = np.cumsum([0, *sizes])
    places = np.array([begin[k] + np.arange(channels) * (size > 1) for k, size in enumerate(sizes)]).T
    of_channel = np.eye(int(begin[-1]))[places]
    every = np.einsum("cip,kcij,cjq->kpq", of_channel, gram, of_channel)
    return nonnegative(every, np.einsum("cip,kci->kp", of_channel, moment))[:, places]


def nonnegative(gram: Float[np.ndarray, "... k k"], moment: Float[np.ndarray, "... k"]) -> Float[np.ndarray, "... k"]:
    """The w ≥ 0 that minimises ½wᵀGw − mᵀw; of more than `MOST_TRIED` weights by cyclic coordinate descent.

    Descent (Franc, Hlaváč & Navara 2005) crawls where columns are almost alike: in the end the weights that are not 0
    are solved for at once, and that is taken where it is better.

    Args:
        gram: G = AᵀA, (…, k, k).
        moment: m = Aᵀb, (…, k).
    """
    if moment.shape[-1] <= MOST_TRIED:
        return _best_subset(gram, moment)
    diagonal = np.diagonal(gram, axis1=-2, axis2=-1)
    used = np.asarray(diagonal > 0)
    safe, w = np.where(used, diagonal, 1.0), np.zeros_like(moment)
    for _ in range(SWEEPS):
        before = w.copy()
        for k in range(moment.shape[-1]):
            best = w[..., k] + (moment[..., k] - np.sum(gram[..., k, :] * w, axis=-1)) / safe[..., k]
            w[..., k] = np.where(used[..., k], np.maximum(best, 0.0), 0.0)
        if not (np.abs(w - before) > STILL * np.abs(w)).any():
            break
    with np.errstate(all="ignore"):
        solved = _solved(gram, moment, np.asarray(w > 0))
        better = (solved >= 0).all(axis=-1) & (_cost(gram, moment, solved) < _cost(gram, moment, w))
    return np.where(better[..., None], solved, w)


def _best_subset(gram: Float[np.ndarray, "... k k"], moment: Float[np.ndarray, "... k"]) -> Float[np.ndarray, "... k"]:
    """The same of few weights: the best of all choices of which of them are not 0."""
    used = np.diagonal(gram, axis1=-2, axis2=-1) > 0
    found, least = np.zeros_like(moment), np.zeros(moment.shape[:-1])
    with np.errstate(all="ignore"):
        for lit in itertools.product((False, True), repeat=moment.shape[-1]):
            solved = _solved(gram, moment, np.array(lit) & used)
            cost = _cost(gram, moment, solved)
            better = (solved >= 0).all(axis=-1) & (cost < least)
            found, least = np.where(better[..., None], solved, found), np.where(better, cost, least)
    return found


def _solved(gram: np.ndarray, moment: np.ndarray, lit: np.ndarray) -> Float[np.ndarray, "... k"]:
    """The weights that are `lit` at their optimum, whatever their sign, the others 0; NaN where there is none."""
    # A ridge at the level of rounding: of columns that are alike any solution is one.
    diagonal = np.diagonal(gram, axis1=-2, axis2=-1)
    ridge = np.where(lit, 4.0 * np.finfo(float).eps * diagonal, 1.0)
    among = lit[..., :, None] & lit[..., None, :]
    system = np.where(among, gram, 0.0) + ridge[..., None] * np.eye(moment.shape[-1])
    solvable = np.asarray(np.isfinite(system).all(axis=(-2, -1)) & np.isfinite(moment).all(axis=-1))
    system = np.where(solvable[..., None, None], system, np.eye(moment.shape[-1]))
    solved = np.linalg.solve(system, np.where(lit, moment, 0.0)[..., None])[..., 0]
    return np.where(solvable[..., None], solved, np.nan)


def _cost(gram: np.ndarray, moment: np.ndarray, w: np.ndarray) -> np.ndarray:
    return 0.5 * np.einsum("...i,...ij,...j->...", w, gram, w) - np.sum(moment * w, axis=-1)
