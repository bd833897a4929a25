"""Passes: the fit of a file too large for memory, by passes over its chunks.

It ends where `fitting.fit` of all rows at once would end, and it keeps no rows but a part of them for the pictures and
some to find its way by. It looks for no other optimum than the one that the part shows.
"""

import dataclasses
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple, TypeVar

import jax
import numpy as np
from jaxtyping import ArrayLike

from fitmat._types import Progress
from fitmat.errors import ModelError
from fitmat.fitting import fitting
from fitmat.fitting.concluding import named_outcome
from fitmat.fitting.information import FOLLOWS, covariance, is_positive
from fitmat.fitting.likelihood import Data
from fitmat.fitting.result import Fit
from fitmat.fitting.streamed.steps import Range
from fitmat.fitting.streamed.sums import Sums, block_curvature, block_sums, blocks, prior_sums
from fitmat.measurements.large.noise import Scatter, scatter
from fitmat.measurements.large.stream import Held, Stream, is_kept
from fitmat.measurements.noise import Noise, measured_noise
from fitmat.measurements.samples import Measurements
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import vector
from fitmat.text import brief

T = TypeVar("T")

PASSES = 20
"""At most this many passes over the file; three or four are usual."""

FEW = 150_000
"""Rows, evenly spread over the file, with which Newton's method finds its way before it passes over all.

What residuals × their curvature add to the information is taken from them: 1 % of a covariance at most."""

SETTLED = 1e-4
"""A Newton step of this many standard errors is the last one."""

NEAR = 0.1
"""Standard errors from which on a Newton step tells where a small discrepancy ends."""

DAMPING = 1e-2
"""The first damping after a step that made things worse, relative to the diagonal of the curvature."""

ROUNDING = 1e-13
"""Relative error of a sum over all rows: a cost that rose by less did not rise."""


@dataclasses.dataclass(frozen=True, eq=False)
class Rows:
    """A file's rows as the likelihood sees them, for fits of several models.

    Attributes:
        chunks: The file.
        known: Its noise.
        prepared: Blocks of all rows, where these are in memory; else None, and they are made in each pass.
        few: `FEW` of the rows, evenly spread, in memory; None of a file that has hardly more.
    """

    chunks: Stream
    known: Scatter
    prepared: tuple[Data, ...] | None
    few: "Rows | None" = None
    __repr__ = brief


def rows(chunks: Stream, progress: Progress | None = None) -> Rows:
    """The rows of a file, its noise estimated.

    Args:
        chunks: A file, from `large.chunks.scan`, or measurements in memory, from `large.stream.hold`.
        progress: Called after each chunk.
    """
    if not isinstance(chunks, Held):
        known = scatter(chunks, progress)
        return Rows(chunks, known, None, _few(chunks, known, ((chunk, known.of(chunk)) for chunk in chunks)))
    seen: list[np.ndarray] = []
    known = scatter(chunks, progress, seen)
    pairs = [(chunk, known.at(chunk, level)) for chunk, level in zip(chunks, seen, strict=True)]
    prepared = tuple(data for chunk, noise in pairs for data in blocks(chunk, noise))
    return Rows(chunks, known, prepared, _few(chunks, known, pairs))


def _few(chunks: Stream, known: Scatter, pairs: Iterable[tuple[Measurements, Noise]]) -> Rows | None:
    """Some of the rows of chunks with their noise."""
    thinning = -(-chunks.n_samples // FEW)
    if thinning == 1:
        return None
    some, sigmas, done = [], [], 0
    for chunk, noise in pairs:
        kept = np.flatnonzero(is_kept(np.arange(done, done + chunk.n_samples), thinning))
        some.append(chunk.rows(kept))
        sigmas.append(noise.sigma[kept])
        done += chunk.n_samples
    wi, wo, value, valid = (np.concatenate([getattr(m, name) for m in some]) for name in ("wi", "wo", "value", "valid"))
    sigma = np.concatenate(sigmas)
    m = dataclasses.replace(chunks.part, wi=wi, wo=wo, value=value, valid=valid, sigma=sigma, horizontal=None)
    held = Held(m, m.n_samples, m.n_valid, chunks.part, thinning)
    return Rows(held, known, tuple(blocks(m, measured_noise(m))))


def fit_chunks(
    chunks: Stream | Rows,
    to: str | AbstractBRDF,
    *,
    fixed: Mapping[str, ArrayLike] | None = None,
    priors: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    masking: str | None = None,
    dispersion: str | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Fit a model to a large file.

    The part of the file is fitted first. From there, Newton's method moves the free parameters and the discrepancy
    together to the maximum of the likelihood of all rows; bounds are kept by projection (Bertsekas 1982, eq. 32).

    Args:
        chunks: A file, from `large.chunks.scan`, or measurements in memory, from `large.stream.hold`; or `rows` of one.
        to: A model name ("lambert+ggx"), or a model whose shapes and static choices are used.
        fixed: Parameters to hold, by name: `{"ks": 1.0}`.
        priors: What is known beforehand, by name, as in `fitting.fit`.
        masking: Static masking choice for the microfacet lobes of a named model.
        dispersion: As in `fitting.fit`.
        progress: Called after each chunk of each pass.

    Returns:
        A `Fit` whose numbers are those of all rows; its `measurements`, `noise` and `data` are the part.

    Raises:
        FitmatError: as `fitting.fit`, and ReadError where the file changed since `scan`.
    """
    every = chunks if isinstance(chunks, Rows) else rows(chunks, progress)
    told = {"fixed": fixed, "priors": priors, "masking": masking, "dispersion": dispersion}
    return fit_from(every, fit_part(every, to, **told), progress)


def fit_part(
    every: Rows,
    to: str | AbstractBRDF,
    *,
    fixed: Mapping[str, ArrayLike] | None = None,
    priors: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    masking: str | None = None,
    dispersion: str | None = None,
) -> Fit:
    """The fit of the part, with the noise that all rows show; as `fit_chunks`."""
    part = every.chunks.part
    if part.instrument.angle_error:
        got = (
            f"angle_error = {np.rad2deg(part.instrument.angle_error):g}° (--angle-error) on {every.chunks.n_samples:,}"
        )
        raise ModelError(f"{got} rows, expected few enough to be fitted at once. Leave it out, or take fewer rows.")
    noise = every.known.of_part(part)
    told = {"fixed": fixed, "priors": priors, "masking": masking, "dispersion": dispersion}
    start = fitting.fit(dataclasses.replace(part, sigma=noise.sigma), to, **told)
    return dataclasses.replace(start, measurements=part, noise=noise)


def fit_from(every: Rows, start: Fit, progress: Progress | None = None) -> Fit:
    """The fit of all rows from that of the part."""
    if not start.finite:
        return start
    around, file = Range(start), _File(every, start, progress)
    if every.few is None:
        top = _climb(file, around, around.begin, around.second_order)
        return _concluded(file, around, top, _second_order(file, around, top))
    few = _File(every.few, start, progress)
    near = _climb(few, around, around.begin, around.second_order)
    more, around = _second_order(few, around, near), Range(start)
    begin = near.x if near.x[-1] > 0.0 else np.append(near.x[:-1], start.discrepancy)
    top = _climb(file, around, begin, lambda *_: more)
    return _concluded(file, around, top, more)


class _File(NamedTuple):
    """What a pass needs: the rows, the fit of the part, and whom to tell."""

    rows: Rows
    start: Fit
    progress: Progress | None

    def added(self, of: Callable[[Data], T], what: str) -> T:
        """The sum of `of` over all rows, a few blocks at a time side by side, added in their order."""
        total, done = None, 0
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for count, some in self._parts():
                for found in pool.map(of, some):
                    total = found if total is None else jax.tree.map(np.add, total, found)
                done += count
                if self.progress is not None:
                    self.progress(what, done, self.rows.chunks.n_samples)
        assert total is not None
        return total

    def _parts(self) -> Iterator[tuple[int, Sequence[Data]]]:
        """How many rows, and their blocks."""
        every = self.rows
        if every.prepared is not None:
            yield every.chunks.n_samples, every.prepared
        else:
            for chunk in every.chunks:
                yield chunk.n_samples, list(blocks(chunk, every.known.of(chunk)))

    def sums(self, best: AbstractBRDF, s: float, what: str) -> Sums:
        """The sums of all rows and of the prior."""
        rows = self.added(lambda data: block_sums(best, data, s), what)
        return jax.tree.map(np.add, rows, prior_sums(best, self.start.data, s))


class _Top(NamedTuple):
    """Where the passes ended: x, the sums there, how many passes, and whether more would change nothing."""

    x: np.ndarray
    sums: Sums
    passes: int
    settled: bool


def _climb(file: _File, around: Range, x: np.ndarray, second_order: Callable[..., np.ndarray]) -> _Top:
    """Newton's method with damping after steps that made things worse (Levenberg 1944).

    Args:
        file: The rows.
        around: Where x may go.
        x: Where to begin.
        second_order: What residuals × their curvature add to JᵀJ for each value, of a model and s.
    """
    damping, n_valid = 0.0, file.rows.chunks.n_valid
    kept = file.sums(around.model(x), x[-1], "pass 1")
    more = n_valid * second_order(around.model(x), x[-1])
    for k in range(2, PASSES + 1):
        step, length = around.step(x, kept, more, damping)
        tried = x + step
        negligible = length < NEAR and 0.0 < tried[-1] < around.negligible
        if length < SETTLED and not negligible:
            return _Top(tried, kept, k - 1, True)
        if negligible:
            around.upper[-1] = tried[-1] = 0.0
        sums = file.sums(around.model(tried), tried[-1], f"pass {k}")
        better = negligible or sums.cost <= kept.cost + ROUNDING * abs(kept.cost)
        damping = (damping / 3.0 if damping > DAMPING else 0.0) if better else max(10.0 * damping, DAMPING)
        if better:
            x, kept = tried, sums
            more = n_valid * second_order(around.model(x), x[-1])
    return _Top(x, kept, PASSES, False)


def _second_order(file: _File, around: Range, top: _Top) -> np.ndarray:
    """What residuals × their curvature add to JᵀJ for each value at the top of `file`; 0 if negligible."""
    best, s = around.model(top.x), float(top.x[-1])
    if s < FOLLOWS * float(file.start.data.typical):
        return np.zeros_like(top.sums.gram)
    observed = file.added(lambda data: block_curvature(best, data, s), "curvature")
    return (observed + prior_sums(best, file.start.data, s).gram - top.sums.gram) / file.rows.chunks.n_valid


def _concluded(file: _File, around: Range, top: _Top, more: np.ndarray) -> Fit:
    """The fit of the part with the numbers of all rows."""
    start, best, s = file.start, around.model(top.x), float(top.x[-1])
    information, free = np.asarray(top.sums.gram), start.free
    if s >= FOLLOWS * float(start.data.typical):
        observed = information + file.rows.chunks.n_valid * more
        information = observed if is_positive(observed[np.ix_(free, free)]) else information
    spread, undetermined = covariance(best, information, start.coordinates, start.data.told(free))
    on_bound = bool(start.coordinates.side(np.asarray(vector(best))).any())
    return dataclasses.replace(
        start,
        model=best,
        discrepancy=s,
        result=named_outcome(bool(np.isfinite(top.sums.cost)), top.settled, on_bound, undetermined),
        steps=start.steps + top.passes,
        log_likelihood=-float(top.sums.cost),
        information=information,
        likelihood_covariance=spread,
        undetermined=undetermined,
        n_values=file.rows.chunks.n_valid,
        misfit=s,
        discrepancy_sd=_discrepancy_sd(top.sums),
    )


def _discrepancy_sd(sums: Sums) -> float:
    """Half of how far s must rise for the log-likelihood to fall by 2, as `laplace` has it, from its parabola."""
    slope, curvature = max(float(sums.slope), 0.0), max(float(sums.curvature), 1e-300)
    return float((np.sqrt(slope**2 + 4.0 * curvature) - slope) / (2.0 * curvature))
