"""Searching: where many fits end, from the starts of a grid, in the numbers of a precision.

It names no outcome.
"""

import contextlib
import dataclasses
from typing import Any, TypeVar

import jax
import numpy as np
from jaxtyping import Float

from fitmat.fitting.many.lanes import Samples, Shared
from fitmat.fitting.many.solving import Ends, solve_many
from fitmat.fitting.many.table import Table, begin_many
from fitmat.fitting.refining import LITTLE_DAMPING
from fitmat.maths.parts import slices
from fitmat.models.parameters import vector
from fitmat.text import brief

PRECISIONS = {"double": (np.dtype(float), np.dtype(int)), "single": (np.dtype(np.float32), np.dtype(np.int32))}
"""Types of the numbers, and of what counts them."""

MOST_SINGLE = 64
"""Iterations per start in single precision, at most: the best end of a surface goes on in double anyway."""

Tree = TypeVar("Tree")


@dataclasses.dataclass(frozen=True, eq=False)
class Search:
    """How fits are looked for.

    Attributes:
        shared: The model and the directions.
        known: The grid from which fits begin.
        starts: From how many of its valleys, at most.
        max_steps: Iterations per start.
        precision: One of `PRECISIONS`, in whose numbers all of that is, and all is computed; what goes in and comes out
            is float64.
        final: In double precision, where this one is in single: goes on from its ends.
    """

    shared: Shared
    known: Table
    starts: int
    max_steps: int
    precision: str = "double"
    final: "Search | None" = None

    __repr__ = brief

    def rough(self) -> "Search":
        """The same in single precision, and this one after it."""
        shared, known = _cast((self.shared, self.known), "single")
        return Search(shared, known, self.starts, min(self.max_steps, MOST_SINGLE), "single", self)

    def ends(self, samples: Samples, first: np.ndarray, usable: np.ndarray, block: int) -> tuple[Ends, np.ndarray]:
        """Where the fits of usable surfaces end, and of which surface each is.

        They begin in the valleys of the grid. Where parameters trade off, the way from there may lead to a bound, or
        never settle: such surfaces begin again at the best nodes, wherever these lie. Those whose values are out of the
        range of single precision begin in double.

        Args:
            samples: Of every surface.
            first: A first guess of the discrepancy of every surface.
            usable: Which have enough samples.
            block: Fits side by side.
        """
        with _exact(self.precision):
            begun, cost = _cast(begin_many(self.known, *_cast((samples, first), self.precision), self.starts), "double")
        there = np.isfinite(cost) & usable[:, None]
        surface, start = np.nonzero(there[:, : self.starts])
        ends, surface = self._ended(samples, surface, begun[surface, start], first, block)
        found = [(ends, surface)]
        best = best_of(ends, surface, len(usable))
        bounded = self.shared.moved.side(self.values(ends)).any(axis=1)
        doubtful = np.append(~ends.solved | bounded, False)[best]
        again, node = np.nonzero(there[:, self.starts :] & doubtful[:, None])
        if len(again):
            found.append(self._ended(samples, again, begun[again, self.starts + node], first, block))
        lost = usable & ~there.any(axis=1)
        if self.final is not None and lost.any():
            found.append(self.final.ends(samples, first, lost, block))
        every, of = zip(*found, strict=True)
        return Ends(*map(np.concatenate, zip(*every, strict=True))), np.concatenate(of)

    def _ended(
        self, samples: Samples, surface: np.ndarray, starts: Float[np.ndarray, "L p"], first: np.ndarray, block: int
    ) -> tuple[Ends, np.ndarray]:
        """Where the fits end that begin at these starts, and of which surface each is: one of each where they go on.

        Args:
            samples: Of every surface.
            surface: Of which each start is.
            starts: Parameter vectors.
            first: A first guess of the discrepancy of every surface.
            block: Fits side by side.
        """
        ends = self._solved(samples, surface, self.shared.moved.unbounded(starts), first, block)
        if self.final is None:
            return ends, surface
        best = best_of(ends, surface, len(first))
        alone = np.flatnonzero(best >= 0)
        rough = Ends(*(part[best[alone]] for part in ends))
        s = np.array(first)
        s[alone] = np.where(np.isfinite(rough.discrepancy), rough.discrepancy, first[alone])
        found = self.final._solved(samples, alone, rough.u, s, block, LITTLE_DAMPING)
        return found._replace(steps=rough.steps + found.steps), alone

    def values(self, ends: Ends) -> Float[np.ndarray, "L p"]:
        """The parameters there."""
        moved = self.shared.moved
        return moved.filled(np.asarray(vector(self.shared.template), float), moved.natural_of(ends.u))

    def _solved(
        self,
        samples: Samples,
        surface: np.ndarray,
        u: Float[np.ndarray, "L k"],
        first: np.ndarray,
        block: int,
        damping: float = 1.0,
    ) -> Ends:
        """Where the fits end that begin here, of these surfaces, so many in a call as are compiled for."""
        capacity, found = len(samples.x) * self.starts, []
        samples, first = _cast((samples, first), self.precision)
        for part in list(slices(len(surface), capacity)) or [slice(0, 0)]:
            count = part.stop - part.start
            begun, of = np.zeros((capacity, u.shape[1])), np.zeros(capacity, int)
            begun[:count], of[:count] = u[part], surface[part]
            of, begun, counts, first_damping = _cast(
                (of, begun, np.array([count, self.max_steps]), np.array(damping)), self.precision
            )
            with _exact(self.precision):
                ended = solve_many(self.shared, samples, of, begun, first, counts, first_damping, block)
            found.append([np.asarray(one)[:count] for one in ended])
        return _cast(Ends(*map(np.concatenate, zip(*found, strict=True))), "double")


def best_of(ends: Ends, surface: np.ndarray, size: int) -> np.ndarray:
    """Which end of every surface is the best; −1 where it has none."""
    score = np.where(np.isfinite(ends.log_likelihood), ends.log_likelihood, -np.inf)
    order = np.lexsort((-score, surface))
    which, place = np.unique(surface[order], return_index=True)
    best = np.full(size, -1)
    best[which] = order[place]
    return best


def _exact(precision: str) -> contextlib.AbstractContextManager[None]:
    """Products of 32 bits with all of them, of which a GPU would leave out some."""
    return contextlib.nullcontext() if precision == "double" else jax.default_matmul_precision("highest")


def _cast(tree: Tree, precision: str) -> Tree:
    """Its arrays of numbers and of counts in the types of a precision; what is out of its range is infinite."""
    numbers, counts = PRECISIONS[precision]

    def one(part: Any) -> Any:
        kind = getattr(getattr(part, "dtype", None), "kind", "")
        return np.asarray(part, {"f": numbers, "i": counts}[kind]) if kind in ("f", "i") else part

    with np.errstate(over="ignore"):
        return jax.tree.map(one, tree)
