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
from fitmat.fitting.many.searching import Search, best_of
from fitmat.fitting.many.solving import Ends
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
        search: How fits are looked for.
    """

    search: Search

    __repr__ = brief

    @property
    def last(self) -> Search:
        """What judges where they end, in double precision."""
        return self.search.final or self.search

    def size(self, surfaces: int, threads: int) -> int:
        """How many surfaces a tile takes where there are so many, and so many threads."""
        rows, channels = len(self.search.shared.wi), self.search.shared.channels
        most = MOST_NUMBERS // max(rows * channels, len(self.search.known.dark))
        usable = [size for size in SIZES if size <= most] or SIZES[:1]
        if jax.default_backend() != "cpu":
            return next((size for size in usable if size * threads >= surfaces), usable[-1])
        return next((size for size in reversed(usable) if size * threads * EACH <= surfaces), usable[0])

    def block(self, size: int) -> int:
        """Fits side by side, of a tile of such a size."""
        if jax.default_backend() != "cpu":
            return size
        fitting = CACHED // (len(self.search.shared.wi) * self.search.shared.channels)
        return int(np.clip(1 << max(fitting, 1).bit_length() - 1, *BLOCKS))

    def fitted(self, value: Float[np.ndarray, "T n c"], sigma: Float[np.ndarray, "T n c"] | None, size: int) -> Found:
        """All that is found of a tile's surfaces.

        Args:
            value: f in sr⁻¹.
            sigma: Its noise.
            size: For how many surfaces the programs are compiled.
        """
        shared, dark, block = self.last.shared, self.last.known.dark[0], self.block(size)
        moved, samples = shared.moved, gathered(shared, value, sigma, size)
        counts = counted(samples)
        first = first_discrepancies(samples)
        ends, surface = self.search.ends(samples, first, counts >= moved.count + 2, block)
        best = best_of(ends, surface, size)
        values = np.full((size, len(dark)), np.nan)
        s, solved, steps = np.zeros(size), np.zeros(size, bool), np.zeros(size, int)
        there = np.flatnonzero(best >= 0)
        end = Ends(*(part[best[there]] for part in ends))
        values[there] = self.last.values(end)
        s[there], solved[there], steps[there] = end.discrepancy, end.solved, end.steps
        known = judged(shared, samples, np.where(np.isfinite(values), values, dark), s, solved, block)
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
