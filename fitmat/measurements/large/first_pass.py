"""FirstPass: what one pass over a large file finds out about all of it, and the rows that are kept to stand for it.

It converts nothing and reads no file.
"""

import dataclasses
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Bool, Int

from fitmat.measurements.large.stream import is_kept
from fitmat.measurements.parsing.recording import Recording, is_sentinel, mask, named, sentinels
from fitmat.measurements.parsing.table import Table


class FirstPass:
    """What the first look finds out, chunk by chunk.

    Attributes:
        n_samples: Rows seen.
        notes: Of all recordings.
        thinning: One row in so many is kept.
        kept: The rows kept.
    """

    def __init__(self, most: int) -> None:
        self.notes = dict[str, None]()
        self.n_samples, self.thinning = 0, 1
        self.kept: list[Recording] = []
        self._most, self._index = most, list[np.ndarray]()
        self._extremes = dict[tuple[str, bool], tuple[float, Table]]()
        self._counts, self._valid, self._negative = Counter[str](), 0, _Negatives()

    def add(self, recording: Recording, table: Table, angles: Mapping[str, int]) -> None:
        """Count a chunk's rows and keep some of them; `angles` are the columns that hold any."""
        valid, masked = mask(magnitudes(recording, {}))
        self.notes |= dict.fromkeys(recording.notes)
        self._counts.update(masked)
        self._valid += int(np.count_nonzero(valid))
        self._negative = self._negative.with_those(recording.value, valid)
        for name, column in angles.items():
            self._reach(name, table, table.numbers(column))
        self._keep(np.arange(self.n_samples, self.n_samples + len(valid)), recording)
        self.n_samples += len(valid)

    def _reach(self, name: str, table: Table, angle: np.ndarray) -> None:
        for highest in (False, True):
            size = np.nan_to_num(angle if highest else -angle, nan=-np.inf)
            row = int(size.argmax())
            if size[row] > self._extremes.get((name, highest), (-np.inf, table))[0]:
                cells, lines = table.cells.slice(row, 1), table.lines[row : row + 1]
                found = dataclasses.replace(table, cells=cells, lines=lines)
                self._extremes[name, highest] = float(size[row]), found

    @property
    def extremes(self) -> Table | None:
        """The rows with the smallest and the largest of each angle; None where there is no angle."""
        rows = [row for _, row in self._extremes.values()]
        if not rows:
            return None
        cells = pl.concat([row.cells for row in rows], how="vertical_relaxed")
        return dataclasses.replace(rows[0], cells=cells, lines=np.concatenate([row.lines for row in rows]))

    def _keep(self, index: Int[np.ndarray, " n"], recording: Recording) -> None:
        self.kept.append(recording)
        self._index.append(index)
        at = len(self.kept) - 1
        while True:
            for k in range(at, len(self.kept)):
                chosen = is_kept(self._index[k], self.thinning)
                self._index[k], self.kept[k] = self._index[k][chosen], _rows(self.kept[k], chosen)
            if sum(map(len, self._index)) <= self._most:
                return
            self.thinning, at = 2 * self.thinning, 0

    @property
    def sentinel(self) -> float | None:
        """The one negative value, where there are several of it and no other."""
        return self._negative.lowest if self._negative.alike else None

    @property
    def negatives(self) -> int:
        """Negative values that are not masked."""
        return 0 if self._negative.alike else self._negative.values

    @property
    def n_valid(self) -> int:
        """Values that can be used."""
        return self._valid - (self._negative.values if self._negative.alike else 0)

    @property
    def masked(self) -> dict[str, int]:
        """Reason → rows masked for it."""
        alike = {named(self._negative.lowest): self._negative.rows} if self._negative.alike else {}
        return {reason: count for reason, count in {**self._counts, **alike}.items() if count}


@dataclasses.dataclass(frozen=True)
class _Negatives:
    """The negative numbers seen: how many, their extremes, and how many values and rows with them are valid."""

    count: int = 0
    lowest: float = np.inf
    highest: float = -np.inf
    values: int = 0
    rows: int = 0

    @property
    def alike(self) -> bool:
        return self.count > 1 and self.lowest == self.highest

    def with_those(self, value: np.ndarray, valid: np.ndarray) -> "_Negatives":
        below = (value < 0) & ~is_sentinel(value)
        negative, used = value[below], valid & below
        return _Negatives(
            self.count + len(negative),
            float(np.min(negative, initial=self.lowest)),
            float(np.max(negative, initial=self.highest)),
            self.values + int(np.count_nonzero(used)),
            self.rows + int(np.count_nonzero(used.any(axis=1))),
        )


def _rows(recording: Recording, keep: Bool[np.ndarray, " n"]) -> Recording:
    """Some rows of a recording."""
    return dataclasses.replace(
        recording,
        wi=recording.wi[keep],
        wo=recording.wo[keep],
        value=recording.value[keep],
        sigma=None if recording.sigma is None else recording.sigma[keep],
        doubts={reason: doubt[keep] for reason, doubt in recording.doubts.items()},
    )


def joined_rows(recordings: Sequence[Recording]) -> Recording:
    """The rows of recordings of the same columns, one after the other."""
    first = recordings[0]

    def along(of: Callable[[Recording], Any]) -> np.ndarray:
        return np.concatenate([of(recording) for recording in recordings])

    return dataclasses.replace(
        first,
        wi=along(lambda r: r.wi),
        wo=along(lambda r: r.wo),
        value=along(lambda r: r.value),
        sigma=None if first.sigma is None else along(lambda r: r.sigma),
        doubts={reason: along(lambda r, key=reason: _doubt(r, key)) for r in recordings for reason in r.doubts},
    )


def _doubt(recording: Recording, reason: str) -> Bool[np.ndarray, "n c"]:
    """Where a recording has a doubt that others of its file have."""
    return recording.doubts.get(reason, np.zeros(recording.value.shape, bool))


def magnitudes(recording: Recording, doubts: Mapping[str, np.ndarray]) -> Recording:
    """The recording without its signs, in which `mask` finds no negative number that stands for nothing by itself."""
    known = {**recording.doubts, **sentinels(recording.value), **doubts}
    return dataclasses.replace(recording, value=np.abs(recording.value), doubts=known)
