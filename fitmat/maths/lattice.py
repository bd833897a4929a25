"""Lattice: a normal field on a grid of points, each tied to data and to its four neighbours.

The density of x is exp(−½ Σ_i p_i (x_i − y_i)² − ½ Σ_e c_e d_e²) over points i and edges e, where d_e is the difference
of the two neighbours: an intrinsic Gaussian Markov random field of first order (H. Rue and L. Held, Gaussian Markov
Random Fields, CRC 2005, ch. 3) with data. Its precision is that of a network of resistors, c_e conductances. Small
grids are eliminated row by row, exactly; of large ones the mean is found by conjugate gradients, and variances from
draws (G. Papandreou and A. Yuille, "Gaussian sampling by local perturbations", NIPS 2010), of each of which only what
its neighbours leave open counts (P. Sidén et al., J. Comput. Graph. Stat. 27 (2018) 898). It learns nothing.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from fitmat.maths.programs import program_run_often

SWEEPS = 2
"""Of relaxation on every grid, on the way down and on the way up."""

DAMPING = 0.7
"""Of a sweep."""

COARSER = 0.5
"""Conductance of an edge between blocks of 2 × 2, of the sum of the two edges that cross: it is twice as long."""

MOST = 300
"""Iterations of conjugate gradients at most; ten are usual."""

MEAN_ERROR, DRAW_ERROR = 1e-4, 0.02
"""Where conjugate gradients end: the error, root mean square, of what has posterior deviation 1 (the energy norm)."""


class Lattice(NamedTuple):
    """A grid.

    Attributes:
        precision: p, 1/σ² of the datum of a point, 0 where there is none, (rows, columns).
        right: c of the edge to the next column, 0 in the last, (rows, columns).
        down: c of the edge to the next row, 0 in the last, (rows, columns).
    """

    precision: Float[ArrayLike, "rows columns"]
    right: Float[ArrayLike, "rows columns"]
    down: Float[ArrayLike, "rows columns"]


class Moments(NamedTuple):
    """What is known of the field; of an edge that is none, no number has a meaning.

    Attributes:
        mean: (rows, columns).
        variance: (rows, columns).
        right: Variance of the difference to the next column, (rows, columns).
        down: To the next row, (rows, columns).
    """

    mean: Float[np.ndarray, "rows columns"]
    variance: Float[np.ndarray, "rows columns"]
    right: Float[np.ndarray, "rows columns"]
    down: Float[np.ndarray, "rows columns"]


def eliminated(lattice: Lattice, y: Float[np.ndarray, "rows columns"]) -> Moments:
    """The moments by block elimination of the rows, and on the way back the blocks of the inverse near the diagonal.

    These are K. Takahashi's equations (H. Rue and S. Martino, J. Stat. Plan. Inference 137 (2007) 3177) by blocks.
    """
    if y.shape[1] > y.shape[0]:
        turned = eliminated(Lattice(*(np.asarray(lattice[k]).T for k in (0, 2, 1))), y.T)
        return Moments(*(turned[k].T for k in (0, 1, 3, 2)))
    precision, right, down = (np.asarray(part) for part in lattice)
    diagonal, one = np.asarray(_diagonal(lattice)), np.arange(y.shape[1] - 1)
    inverses: list[np.ndarray] = []
    given: list[np.ndarray] = []
    for k, row in enumerate(diagonal):
        block, moment = np.diag(row), precision[k] * y[k]
        block[one, one + 1] = block[one + 1, one] = -right[k, :-1]
        if k:
            block -= down[k - 1, :, None] * inverses[-1] * down[k - 1]
            moment += down[k - 1] * (inverses[-1] @ given[-1])
        inverses.append(np.linalg.inv(block))
        given.append(moment)
    found = Moments(*(np.zeros(y.shape) for _ in Moments._fields))
    below, covariance = np.zeros(y.shape[1]), np.zeros(inverses[0].shape)
    for k in reversed(range(len(y))):
        gain = inverses[k] * down[k]  # 0 of the last row
        shared = gain @ covariance
        under = np.diag(covariance)
        below = inverses[k] @ (given[k] + down[k] * below)
        covariance = inverses[k] + shared @ gain.T
        own = np.diag(covariance)
        found.mean[k], found.variance[k] = below, own
        found.right[k, :-1] = own[:-1] + own[1:] - 2.0 * np.diag(covariance, 1)
        found.down[k] = own + under - 2.0 * np.diag(shared)
    return found


def _beyond(part: Array, axis: int, steps: int) -> Array:
    """What lies so many steps further on; around the end, where conductances are 0."""
    return jnp.roll(part, -steps, axis)


def _diagonal(lattice: Lattice) -> Array:
    precision, right, down = (jnp.asarray(part) for part in lattice)
    return precision + right + _beyond(right, 1, -1) + down + _beyond(down, 0, -1)


def _drawn_along(lattice: Lattice, x: Array) -> Array:
    """Σ c x of the neighbours."""
    right, down = jnp.asarray(lattice.right), jnp.asarray(lattice.down)
    along = right * _beyond(x, 1, 1) + _beyond(right * x, 1, -1)
    return along + down * _beyond(x, 0, 1) + _beyond(down * x, 0, -1)


def _coarser(lattice: Lattice) -> Lattice:
    """Blocks of 2 × 2 points as points."""
    blocks = [_in_blocks(jnp.asarray(part)) for part in lattice]
    return Lattice(blocks[0].sum((1, 3)), COARSER * blocks[1][:, :, :, 1].sum(1), COARSER * blocks[2][:, 1].sum(2))


def _in_blocks(part: Array) -> Array:
    rows, columns = part.shape
    whole = jnp.pad(part, ((0, rows % 2), (0, columns % 2)))
    return whole.reshape(whole.shape[0] // 2, 2, whole.shape[1] // 2, 2)


def _preconditioned(grids: list[tuple[Lattice, Array]], residual: Array) -> Array:
    """A V-cycle of multigrid over blocks; D. Braess, Computing 55 (1995) 379, has blocks and what they take too stiff.

    Args:
        grids: Each with one over its diagonal, 0 of points that are none; the finest first.
        residual: On the finest.
    """
    lattice, inverse = grids[0]
    if len(grids) == 1:
        return inverse * residual

    def swept(_: Array, x: Array) -> Array:
        return (1.0 - DAMPING) * x + DAMPING * inverse * (residual + _drawn_along(lattice, x))

    # Loops of their own: else the compiler works the sweeps out anew for every neighbour that asks for them.
    x = jax.lax.fori_loop(1, SWEEPS, swept, DAMPING * inverse * residual)
    left = residual - _diagonal(lattice) * x + _drawn_along(lattice, x)
    coarse = _preconditioned(grids[1:], _in_blocks(left).sum((1, 3)))
    blocks = jnp.broadcast_to(coarse[:, None, :, None], (len(coarse), 2, coarse.shape[1], 2))
    whole = blocks.reshape(2 * len(coarse), -1)[: x.shape[0], : x.shape[1]]
    return jax.lax.fori_loop(0, SWEEPS, swept, x + whole)


def _solved(grids: list[tuple[Lattice, Array]], right_side: Array, guess: Array, error: Array) -> Array:
    """The solution by conjugate gradients, from a guess."""
    lattice = grids[0][0]
    diagonal = _diagonal(lattice)

    def times(x: Array) -> Array:
        return diagonal * x - _drawn_along(lattice, x)

    def goes_on(state: tuple[Array, ...]) -> Array:
        return (state[4] > error**2 * guess.size) & (state[3] < MOST)

    def step(state: tuple[Array, ...]) -> tuple[Array, ...]:
        x, residual, way, count, before = state
        steep = _preconditioned(grids, residual)
        energy = jnp.sum(residual * steep)
        way = steep + energy / before * way
        image = times(way)
        length = energy / jnp.maximum(jnp.sum(way * image), 1e-300)
        return x + length * way, residual - length * image, way, count + 1, energy

    begun = guess, right_side - times(guess), jnp.zeros_like(guess), jnp.array(0), jnp.array(jnp.inf)
    return jax.lax.while_loop(goes_on, step, begun)[0]


@program_run_often
def sampled(lattice: Lattice, y: ArrayLike, guesses: ArrayLike, seeds: ArrayLike) -> tuple[Array, ...]:
    """The mean and draws of what is left of the field without it, each from a guess, and their moments.

    Args:
        lattice: The grid.
        y: The data, (rows, columns).
        guesses: Of the mean, and of every draw, (1 + draws, rows, columns).
        seeds: Numbers of the draws; the first is the mean's, and means nothing.

    Returns:
        Solutions as the guesses, and the variances as `Moments` has them.
    """
    lattice = Lattice(*map(jnp.asarray, lattice))
    grids = [lattice]
    while jnp.size(grids[-1].precision) > 1:
        grids.append(_coarser(grids[-1]))
    inverses = [jnp.where(q > 0, 1.0 / jnp.where(q > 0, q, 1.0), 0.0) for q in map(_diagonal, grids)]
    levels = list(zip(grids, inverses, strict=True))
    diagonal, shape = _diagonal(lattice), jnp.shape(lattice.precision)
    sides = [(lattice.right, 1), (lattice.down, 0)]

    def one(sums: tuple[Array, ...], given: tuple[Array, Array, Array]) -> tuple[tuple[Array, ...], Array]:
        place, guess, seed = given
        noise = jnp.sqrt(jnp.stack(lattice)) * jax.random.normal(jax.random.key(seed), (3, *shape))
        drawn = noise[0] + sum(noise[2 - axis] - _beyond(noise[2 - axis], axis, -1) for _, axis in sides)
        first = place == 0
        right_side = jnp.where(first, lattice.precision * jnp.asarray(y), drawn)
        x = _solved(levels, right_side, guess, jnp.where(first, MEAN_ERROR, DRAW_ERROR))
        of_neighbours = _drawn_along(lattice, x)
        open_ = [of_neighbours / diagonal]
        for c, axis in sides:
            own, other = of_neighbours - c * _beyond(x, axis, 1), _beyond(of_neighbours, axis, 1) - c * x
            beyond = _beyond(diagonal, axis, 1)
            open_.append(((beyond - c) * own - (diagonal - c) * other) / (diagonal * beyond - c**2))
        return tuple(jnp.where(first, s, s + part**2) for s, part in zip(sums, open_, strict=True)), x

    guesses = jnp.asarray(guesses)
    places = jnp.arange(len(guesses))
    sums, found = jax.lax.scan(one, (jnp.zeros(shape),) * 3, (places, guesses, jnp.asarray(seeds)))
    conditional = [1.0 / diagonal]
    for c, axis in sides:
        beyond = _beyond(diagonal, axis, 1)
        conditional.append((diagonal + beyond - 2.0 * c) / (diagonal * beyond - c**2))
    count = len(guesses) - 1
    return found, *(s / count + part for s, part in zip(sums, conditional, strict=True))
