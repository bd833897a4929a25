"""Stream: more measurements than are fitted at once, block by block, wherever they come from.

It reads no file and fits nothing.
"""

import dataclasses
from collections.abc import Iterator
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Int

from fitmat.measurements.samples import Measurements
from fitmat.text import brief

CHUNK = 200_000
"""Most rows of a block."""

PART = 8_000
"""Most rows of the part that stands for all of them; few enough to be fitted at once."""

_GOLDEN = 0x9E3779B97F4A7C15
# 2⁶⁴/φ: the multiples of it modulo 2⁶⁴ fill the range evenly, in step with no grid of angles.


@runtime_checkable
class Stream(Protocol):
    """Measurements that are passed over again and again.

    Attributes:
        n_samples: Rows, masked ones included.
        n_valid: Values (rows × channels) that can be fitted.
        part: Rows spread evenly over all; their source, counts and notes are those of all.
    """

    @property
    def n_samples(self) -> int:
        """See above."""
        ...

    @property
    def n_valid(self) -> int:
        """See above."""
        ...

    @property
    def part(self) -> Measurements:
        """See above."""
        ...

    def __iter__(self) -> Iterator[Measurements]: ...

    def in_part(self, first: int, count: int) -> Bool[np.ndarray, " count"]:
        """Which of `count` rows, from row `first` (from 0) on, are in `part`."""
        ...


@dataclasses.dataclass(frozen=True, eq=False)
class Held:
    """Measurements in memory as a `Stream`.

    Attributes:
        n_samples: See `Stream`.
        n_valid: See `Stream`.
        part: See `Stream`.
        thinning: One row in so many is in `part`.
    """

    whole: Measurements
    n_samples: int
    n_valid: int
    part: Measurements
    thinning: int

    __repr__ = brief

    def __iter__(self) -> Iterator[Measurements]:
        for first in range(0, self.n_samples, CHUNK):
            yield self.whole.rows(np.arange(first, min(first + CHUNK, self.n_samples)))

    def in_part(self, first: int, count: int) -> Bool[np.ndarray, " count"]:
        """See `Stream`."""
        return is_kept(np.arange(first, first + count), self.thinning)


def hold(m: Measurements) -> Held:
    """All rows with a valid value, and a part of them for starts and pictures."""
    m = m.rows(np.flatnonzero(m.valid.any(axis=1)))
    thinning = -(-m.n_samples // PART)
    kept = np.flatnonzero(is_kept(np.arange(m.n_samples), thinning))
    note = f"Shown: one row in {thinning:,}, evenly spread over the {m.n_samples:,} usable rows; all are fitted."
    part = dataclasses.replace(m.rows(kept), notes=(*m.notes, note))
    return Held(m, m.n_samples, m.n_valid, part, thinning)


def is_kept(index: Int[np.ndarray, " n"], thinning: int) -> Bool[np.ndarray, " n"]:
    """One row in `thinning`, by Weyl's sequence: spread evenly, and nested from one thinning to its double."""
    return index.astype(np.uint64) * np.uint64(_GOLDEN) <= np.uint64((2**64 - 1) // thinning)
