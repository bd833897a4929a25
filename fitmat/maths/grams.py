"""Grams: JᵀJ of some residuals as one matrix, or as an arrow where columns of them meet in a few parameters only.

An arrow is what many channels make of a fit: most parameters count in one channel, a few in all. It takes as many
slopes as there are kinds of parameters, however many channels follow, and is solved channel by channel.
"""

import dataclasses
import functools
from abc import abstractmethod
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

ROUNDING = 1e-15
"""At least this fraction of the largest eigenvalue is added to the diagonal, roughly: the factor stays finite."""


def rounding(like: Array) -> float:
    """`ROUNDING` for numbers of the type of an array: as many units of their last place as it is of float64's."""
    return ROUNDING * float(jnp.finfo(like.dtype).eps) / float(np.finfo(float).eps)


@dataclasses.dataclass(frozen=True)
class Layout:
    """Which of p parameters count in all of c columns of residuals, and which in one.

    Attributes:
        shared: Positions of those that count in all, s.
        own: Positions of the others: of k kinds, one for each column, k × c.
    """

    shared: tuple[int, ...]
    own: tuple[tuple[int, ...], ...]

    @functools.cached_property
    def kinds(self) -> Float[np.ndarray, "q p"]:
        """Directions that are told apart by the columns they count in: each shared one, then each kind; q = s + k."""
        rows = [[place] for place in self.shared] + [list(places) for places in self.own]
        found = np.zeros((len(rows), sum(map(len, rows))))
        for row, places in zip(found, rows, strict=True):
            row[places] = 1.0
        return found

    @property
    def places(self) -> np.ndarray:
        """`own` as an index, (c, k)."""
        return np.array(self.own, int).T


class AbstractGram(eqx.Module):
    """A symmetric matrix A of p rows; positive semidefinite but for rounding."""

    @abstractmethod
    def diagonal(self) -> Float[Array, " p"]:
        """Its diagonal."""

    @abstractmethod
    def scaled(self, by: Float[Array, " p"]) -> "AbstractGram":
        """D A D with D = diag(by)."""

    @abstractmethod
    def plus(self, diagonal: Float[Array, " p"]) -> "AbstractGram":
        """A + diag(diagonal)."""

    @abstractmethod
    def times(self, x: Float[Array, " p"]) -> Float[Array, " p"]:
        """A x."""

    @abstractmethod
    def solve(self, right: Float[Array, " p"]) -> Float[Array, " p"]:
        """x with A x = right; NaN where A is not positive definite."""

    @abstractmethod
    def dense(self) -> Float[Array, "p p"]:
        """The matrix."""


class Normal(NamedTuple):
    """What a Gauss–Newton step needs of all residuals: Σ r², Jᵀr and JᵀJ."""

    square: Float[Array, ""]
    slope: Float[Array, " p"]
    gram: AbstractGram


class Whole(AbstractGram):
    """One matrix."""

    matrix: Float[Array, "p p"]

    def diagonal(self) -> Float[Array, " p"]:
        """Its diagonal."""
        return jnp.diagonal(self.matrix)

    def scaled(self, by: Float[Array, " p"]) -> "Whole":
        """D A D."""
        return Whole(self.matrix * by[:, None] * by)

    def plus(self, diagonal: Float[Array, " p"]) -> "Whole":
        """A + diag(diagonal)."""
        return Whole(self.matrix + jnp.diag(diagonal))

    def times(self, x: Float[Array, " p"]) -> Float[Array, " p"]:
        """A x."""
        return self.matrix @ x

    def solve(self, right: Float[Array, " p"]) -> Float[Array, " p"]:
        """By elimination."""
        return solve(self.matrix, right)

    def dense(self) -> Float[Array, "p p"]:
        """The matrix."""
        return self.matrix


class Arrow(AbstractGram):
    """A matrix that is 0 between what counts in one column and what counts in another.

    Attributes:
        core: Between shared parameters, (s, s).
        edges: Between each column's own and the shared ones, (c, k, s).
        blocks: Between each column's own, (c, k, k).
        layout: Which is which.
    """

    core: Float[Array, "s s"]
    edges: Float[Array, "c k s"]
    blocks: Float[Array, "c k k"]
    layout: Layout = eqx.field(static=True)

    def diagonal(self) -> Float[Array, " p"]:
        """Of the core and of every block."""
        return self._joined(jnp.diagonal(self.core), jnp.diagonal(self.blocks, axis1=1, axis2=2))

    def scaled(self, by: Float[Array, " p"]) -> "Arrow":
        """D A D."""
        shared, own = self._parted(by)
        core, edges = self.core * shared[:, None] * shared, self.edges * own[:, :, None] * shared
        return Arrow(core, edges, self.blocks * own[:, :, None] * own[:, None], self.layout)

    def plus(self, diagonal: Float[Array, " p"]) -> "Arrow":
        """A + diag(diagonal)."""
        shared, own = self._parted(diagonal)
        blocks = self.blocks + own[:, :, None] * jnp.eye(own.shape[1])
        return Arrow(self.core + jnp.diag(shared), self.edges, blocks, self.layout)

    def times(self, x: Float[Array, " p"]) -> Float[Array, " p"]:
        """A x."""
        shared, own = self._parted(x)
        of_shared = self.core @ shared + jnp.einsum("cks,ck->s", self.edges, own)
        return self._joined(of_shared, self.edges @ shared + jnp.einsum("ckl,cl->ck", self.blocks, own))

    def solve(self, right: Float[Array, " p"]) -> Float[Array, " p"]:
        """By Schur's complement of the blocks, each eliminated by itself."""
        shared, own = self._parted(right)
        inner = jax.vmap(solve)(self.blocks, jnp.concatenate([self.edges, own[:, :, None]], axis=2))
        along, alone = inner[:, :, :-1], inner[:, :, -1]
        left = shared - jnp.einsum("cks,ck->s", self.edges, alone)
        of_shared = solve(self.core - jnp.einsum("cks,ckt->st", self.edges, along), left)
        return self._joined(of_shared, alone - along @ of_shared)

    def dense(self) -> Float[Array, "p p"]:
        """The matrix."""
        count, shared, own = self.layout.kinds.shape[1], np.array(self.layout.shared, int), self.layout.places
        filled = jnp.zeros((count, count)).at[np.ix_(shared, shared)].set(self.core)
        filled = filled.at[own[:, :, None], shared].set(self.edges)
        filled = filled.at[shared[:, None, None], own].set(jnp.moveaxis(self.edges, 2, 0))
        return filled.at[own[:, :, None], own[:, None]].set(self.blocks)

    def _parted(self, x: Float[Array, " p"]) -> tuple[Float[Array, " s"], Float[Array, "c k"]]:
        return x[np.array(self.layout.shared, int)], x[self.layout.places]

    def _joined(self, shared: Float[Array, " s"], own: Float[Array, "c k"]) -> Float[Array, " p"]:
        return joined(self.layout, shared, own)


def joined(layout: Layout, shared: Float[Array, " s"], own: Float[Array, "c k"]) -> Float[Array, " p"]:
    """One vector of what is shared and of what each column has of its own."""
    filled = jnp.zeros(layout.kinds.shape[1]).at[np.array(layout.shared, int)].set(shared)
    return filled.at[layout.places].set(own)


def solve(matrix: Float[Array, "p p"], right: Float[Array, "p ..."]) -> Float[Array, "p ..."]:
    """x with A x = b for a positive definite A, by Gauss–Jordan elimination; NaN where A is not.

    Without pivots, which such a matrix needs none of, and without LAPACK, which a program would have to be linked to.
    """

    def eliminated(k: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
        table, positive = state
        pivot = table[k, k]
        row = table[k] / pivot
        return (table - table[:, k, None] * row).at[k].set(row), positive & (pivot > 0)

    count = len(right)
    if not count:
        return right
    begin = jnp.concatenate([matrix, right.reshape(count, -1)], axis=1), jnp.array(True)
    table, positive = jax.lax.fori_loop(0, count, eliminated, begin)
    return jnp.where(positive, table[:, count:].reshape(right.shape), jnp.nan)
