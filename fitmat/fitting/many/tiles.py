"""Tiles: so many surfaces at a time as a call of the programs takes, from their values to all that is found of them.

It checks nothing; the door does.
"""

import dataclasses
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed

import jax
import numpy as np
from jaxtyping import Float

from fitmat._types import Progress
from fitmat.fitting.many.concluding import judged
from fitmat.fitting.many.gathering import counted, first_discrepancies, gathered
from fitmat.fitting.many.lanes import Samples, Shared
from fitmat.fitting.many.solving import Ends, solve_many
from fitmat.fitting.many.table import Table, begin_many
from fitmat.maths.parts import slices
from fitmat.models.parameters import vector
from fitmat.text import brief

SIZES = (256, 1024, 4096)
"""Surfaces that a call takes."""

EACH = 2
"""Calls that each thread should have at least, so that none waits long for another."""

MOST_NUMBERS = 1 << 23
"""Numbers of an array with an entry for each surface of a call and each sample, or each node of the grid."""

CACHED = 1 << 13
"""Values of a block of fits, so that all of it stays in the cache of a core."""

BLOCKS = (16, 128)
"""The smallest and the largest block on a CPU; elsewhere all surfaces of a call are one."""

Found = dict[str, np.ndarray]
"""What is found of some surfaces, by the names of the fields of `Fits`."""


@dataclasses.dataclass(frozen=True, eq=False)
class Work:
    """What is done to every tile.

    Attributes:
        shared: The model and the directions.
        known: The grid from which fits begin.
        starts: From how many of its valleys, at most.
        max_steps: Iterations per start.
    """

    shared: Shared
    known: Table
    starts: int
    max_steps: int

    __repr__ = brief

    def size(self, surfaces: int, threads: int) -> int:
        """How many surfaces a tile takes where there are so many, and so many threads."""
        rows, channels = len(self.shared.wi), self.shared.channels
        most = MOST_NUMBERS // max(rows * channels, len(self.known.dark))
        usable = [size for size in SIZES if size <= most] or SIZES[:1]
        if jax.default_backend() != "cpu":
            return next((size for size in usable if size * threads >= surfaces), usable[-1])
        return next((size for size in reversed(usable) if size * threads * EACH <= surfaces), usable[0])

    def block(self, size: int) -> int:
        """Fits side by side, of a tile of such a size."""
        if jax.default_backend() != "cpu":
            return size
        fitting = CACHED // (len(self.shared.wi) * self.shared.channels)
        return int(np.clip(1 << max(fitting, 1).bit_length() - 1, *BLOCKS))

    def fitted(self, value: Float[np.ndarray, "T n c"], sigma: Float[np.ndarray, "T n c"] | None, size: int) -> Found:
        """All that is found of a tile's surfaces.

        Args:
            value: f in sr⁻¹.
            sigma: Its noise.
            size: For how many surfaces the programs are compiled.
        """
        shared, moved = self.shared, self.shared.moved
        samples = gathered(shared, value, sigma, size)
        counts = counted(samples)
        first = first_discrepancies(samples)
        ends, surface = self._ends(samples, first, counts >= moved.count + 2)
        best = _best(ends, surface, size)
        values = np.full((size, len(self.known.dark[0])), np.nan)
        s, solved, steps = np.zeros(size), np.zeros(size, bool), np.zeros(size, int)
        there = np.flatnonzero(best >= 0)
        end = Ends(*(part[best[there]] for part in ends))
        values[there] = self._values(end)
        s[there], solved[there], steps[there] = end.discrepancy, end.solved, end.steps
        known = judged(
            shared, samples, np.where(np.isfinite(values), values, self.known.dark[0]), s, solved, self.block(size)
        )
        lost = np.any(~np.isfinite(values), axis=1)
        sd = np.zeros(values.shape)
        sd[:, moved.index] = known.sd
        found = {
            "values": values,
            "sd": np.where(np.expand_dims(lost, 1), np.nan, sd),
            "outcome": known.outcome,
            "discrepancy": s,
            "log_likelihood": np.where(lost, np.nan, known.log_likelihood),
            "steps": steps,
            "n_values": counts,
        }
        return {name: part[: len(value)] for name, part in found.items()}

    def _values(self, ends: Ends) -> Float[np.ndarray, "L p"]:
        """The parameters there."""
        moved = self.shared.moved
        return moved.filled(np.asarray(vector(self.shared.template)), moved.natural_of(ends.u))

    def _ends(self, samples: Samples, first: np.ndarray, usable: np.ndarray) -> tuple[Ends, np.ndarray]:
        """Where the fits of usable surfaces end, and of which surface each is.

        They begin in the valleys of the grid. Where parameters trade off, the way from there may lead to a bound, or
        never settle: such surfaces begin again at the best nodes, wherever these lie.
        """
        begun, cost = (np.asarray(part) for part in begin_many(self.known, samples, first, self.starts))
        there = np.isfinite(cost) & usable[:, None]
        surface, start = np.nonzero(there[:, : self.starts])
        ends = self._solved(samples, surface, begun[surface, start], first)
        best = _best(ends, surface, len(usable))
        bounded = self.shared.moved.side(self._values(ends)).any(axis=1)
        doubtful = np.append(~ends.solved | bounded, False)[best]
        again, node = np.nonzero(there[:, self.starts :] & doubtful[:, None])
        if not len(again):
            return ends, surface
        more = self._solved(samples, again, begun[again, self.starts + node], first)
        return Ends(*map(np.concatenate, zip(ends, more, strict=True))), np.concatenate([surface, again])

    def _solved(
        self, samples: Samples, surface: np.ndarray, starts: Float[np.ndarray, "L p"], first: np.ndarray
    ) -> Ends:
        """Where the fits end that begin at these starts of these surfaces, so many in a call as are compiled for."""
        size, moved = len(samples.x), self.shared.moved
        capacity, found = size * self.starts, []
        for part in list(slices(len(surface), capacity)) or [slice(0, 0)]:
            count = part.stop - part.start
            u, of = np.zeros((capacity, moved.count)), np.zeros(capacity, int)
            u[:count], of[:count] = moved.unbounded(starts[part]), surface[part]
            ended = solve_many(self.shared, samples, of, u, first, np.array([count, self.max_steps]), self.block(size))
            found.append([np.asarray(one)[:count] for one in ended])
        return Ends(*map(np.concatenate, zip(*found, strict=True)))


def _best(ends: Ends, surface: np.ndarray, size: int) -> np.ndarray:
    """Which end of every surface is the best; −1 where it has none."""
    score = np.where(np.isfinite(ends.log_likelihood), ends.log_likelihood, -np.inf)
    order = np.lexsort((-score, surface))
    which, place = np.unique(surface[order], return_index=True)
    best = np.full(size, -1)
    best[which] = order[place]
    return best


def each(one: Callable[[slice], Found], count: int, size: int, threads: int, say: Progress | None) -> Found:
    """Of all surfaces, in their order; after Ctrl-C or an error nothing is waited for that has begun.

    Args:
        one: Of some.
        count: How many there are.
        size: How many at a time.
        threads: How many work side by side.
        say: Called as they are done.
    """
    parts = [slice(start, min(start + size, count)) for start in range(0, count, size)]
    found: list[Found] = [{}] * len(parts)
    pool = ThreadPoolExecutor(min(threads, len(parts)))
    try:
        given = {pool.submit(one, part): k for k, part in enumerate(parts)}
        done = 0
        for ended in as_completed(given):
            k = given[ended]
            found[k] = ended.result()
            done += parts[k].stop - parts[k].start
            if say is not None:
                say(f"fitting {count} surfaces", done, count)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
    return {name: np.concatenate([some[name] for some in found]) for name in found[0]}
