"""Scatter: the noise of a file too large for memory, from the neighbours of its rows chunk by chunk.

It is `noise.measured_noise` in two steps: what is to be known once, and σ of each chunk. It looks at no model.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat._types import Progress
from fitmat.measurements.large.stream import Stream
from fitmat.measurements.neighbours import leave_one_out
from fitmat.measurements.noise import Noise, law, measured_noise, of_laws, seen_levels
from fitmat.measurements.samples import Measurements
from fitmat.text import brief


@dataclasses.dataclass(frozen=True, eq=False)
class Scatter:
    """What is known of a file's noise.

    Attributes:
        given: Whether the file gives σ; then nothing else is needed.
        laws: For each channel, a (sr⁻¹) and b of σ² = a² + (b f)²; NaN where they cannot be estimated.
        tops: The largest value of each channel, sr⁻¹.
        levels: f at the rows of the part as their neighbours say it, (n, c).
    """

    given: bool
    laws: Float[np.ndarray, "c 2"]
    tops: Float[np.ndarray, " c"]
    levels: Float[np.ndarray, "n c"]

    __repr__ = brief

    def of(self, chunk: Measurements) -> Noise:
        """σ of a chunk's rows."""
        return self.at(chunk, np.zeros(0) if self.given else leave_one_out(chunk)[0])

    def of_part(self, part: Measurements) -> Noise:
        """σ of the rows of the part, whose neighbours were in their chunks."""
        return self.at(part, self.levels)

    def at(self, m: Measurements, levels: np.ndarray) -> Noise:
        """σ of rows whose f as their neighbours say it is known, (n, c)."""
        if self.given:
            return measured_noise(m)
        return of_laws(self.laws, seen_levels(m, levels), self.tops, m.channels)


def scatter(chunks: Stream, progress: Progress | None = None, seen: list[np.ndarray] | None = None) -> Scatter:
    """The noise of a large file: one pass, unless the file gives σ.

    Neighbours are sought in all rows of a chunk, a and b come from the rows of the part. Rows at either end of a chunk
    have fewer neighbours than in one piece; a file in random order, in which neighbours are far apart, shows more noise
    than there is.

    Args:
        chunks: The file.
        progress: Called after each chunk.
        seen: Filled with f at all rows of each chunk as their neighbours say it, (n, c), where σ is not given.
    """
    part, count = chunks.part, len(chunks.part.channels)
    if part.sigma is not None:
        none = np.full((count, 2), np.nan)
        if seen is not None:
            seen.extend(np.zeros(0) for _ in chunks)
        return Scatter(True, none, none[:, 0], np.full(part.value.shape, np.nan))
    found, tops, done = [], np.zeros(count), 0
    for chunk in chunks:
        kept = chunks.in_part(done, chunk.n_samples)
        compared = leave_one_out(chunk)
        found.append(compared[:, kept])
        if seen is not None:
            seen.append(compared[0])
        tops = np.maximum(tops, np.max(np.abs(chunk.value), axis=0, where=chunk.valid, initial=0.0))
        done += chunk.n_samples
        if progress is not None:
            progress("noise", done, chunks.n_samples)
    compared = np.concatenate(found, axis=1)
    laws = np.stack([law(compared[:, :, k], part.value[part.valid[:, k], k]) for k in range(count)])
    return Scatter(False, laws, tops, compared[0])
