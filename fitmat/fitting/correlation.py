"""Correlation: how alike the misfits of neighbouring geometries are, and how much wider that makes every interval.

A likelihood that counts the misfit of each sample as independent gets narrower with every reading, however alike the
misfits of neighbours are. Here the residuals of a finished fit are taken as noise plus smooth processes over the
geometry, η² I + Σ τ² K: one within `NEAR` widths of the lobe, one beyond, for a misfit of the highlight says nothing
of the base. All sizes are found by restricted maximum likelihood, which allows for the parameters that were fitted
(Patterson & Thompson, Biometrika 58, 1971), each channel by itself. Where there is a process, the covariance V of the
parameters is that of the jackknife which leaves out ranges of the difference angle θ_d, and of the incidence, in turn
(`left_blocks`), the sum of the two, as misfits run along both (Cameron, Gelbach & Miller, J. Bus. Econ. Stat. 29
(2011), 238): how much a range more or less would move them is seen, not modelled; to first order, and where such a
step would leave the bounds by a fit. It is never narrower than H⁻¹ in any direction. Channels without a process add
what their likelihood says. Draws θ become θ̂ + A(θ − θ̂) with A H⁻¹ Aᵀ = V (Shaby, "The open-faced sandwich adjustment
for MCMC using estimating functions", J. Comp. Graph. Stat. 23, 2014), so that whatever follows from draws follows from
these. The best fit stays.

K is Matérn's of smoothness 3/2 over where the half vector lies about the normal, at distance asinh(θ_h/w) with the
lobe's width w (an even scale up to one width, ratios beyond) and at its azimuth from the plane of incidence, and over
the difference angle θ_d. Its lengths are fixed: free ones follow chance. It knows no sampler and no prior.
"""

import dataclasses
from collections.abc import Sequence
from functools import partial

import numpy as np
from jaxtyping import Bool, Float, Int

from fitmat.fitting.coordinates import Coordinates
from fitmat.fitting.ends import behind
from fitmat.fitting.left_blocks import Again, left_out, of_few, ranges
from fitmat.fitting.likelihood import Data
from fitmat.fitting.linear import Linear
from fitmat.fitting.process import ASKED, Found, counted, find, independent, kernel
from fitmat.fitting.refining import optima
from fitmat.maths.blas import one_thread
from fitmat.maths.directions import zenith
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import vector
from fitmat.models.values import widths
from fitmat.text import brief

LENGTHS = 1.0, 1.0, 0.8
"""Of K, in asinh(θ_h/w) along and across the plane of incidence, and in θ_d, radians.

Those that describe the residuals of six families of wrong surfaces best, all fits of a family taken together.
"""

NEAR = 3.0
"""Widths of the lobe within which a half vector counts as near the highlight; describes the same residuals best."""

PLACES = "near the highlight", "away from the highlight"
"""The parts of the geometry, in the order of `Correlation.size`."""


@dataclasses.dataclass(frozen=True, eq=False)
class Correlation:
    """What the residuals of a fit say of the correlation of its misfit.

    Attributes:
        size: τ of each channel near the highlight and away from it, in standard deviations of its residuals as the
            likelihood counts them, (c, 2).
        near: Share of the readings that lie near the highlight.
        gain: By how many nats the process describes the residuals better, (c,).
        stretch: A, in natural coordinates of the k fitted parameters, (k, k); the identity where nothing was found.
        inflation: Of the variance of each fitted parameter, (k,).
        independent: Effective number of independent readings, (tr Σ)²/tr Σ² of Σ = η² I + τ² K over all values.
        outcome: "independent", "correlated", or "not judged".
        drift: Factor of every variance that alike errors of neighbouring readings make alone.
    """

    size: Float[np.ndarray, "c 2"]
    near: float
    gain: Float[np.ndarray, " c"]
    stretch: Float[np.ndarray, "k k"]
    inflation: Float[np.ndarray, " k"]
    independent: float
    outcome: str
    drift: float = 1.0

    __repr__ = brief

    @property
    def found(self) -> bool:
        """Whether any interval changes."""
        return self.outcome == "correlated"

    @property
    def shared(self) -> str:
        """Where the model misses what neighbours have in common, as part of a sentence; empty where only noise is."""
        asked = np.any(self.size > 0.0, axis=0)
        if not asked.any():
            return ""
        where = f"{PLACES[int(asked[1])]} " if asked.sum() == 1 and 0.0 < self.near < 1.0 else ""
        return f"{where}neighbouring angles share a misfit"


@one_thread()
def correlate(
    best: AbstractBRDF,
    data: Data,
    s: float,
    linear: Linear | None,
    moved: Coordinates,
    count: int,
    rho: float = 0.0,
) -> Correlation:
    """The correlation of a fit's misfit, from its residuals.

    Args:
        best: The model at the optimum.
        data: The samples; of a large file a part.
        s: Discrepancy.
        linear: Residuals and slopes there; None where there are none.
        moved: The parameters that were fitted.
        count: Values that were fitted, of which `data` may hold a part.
        rho: Correlation of the errors of neighbouring readings, where the data show one: no variance is less than
            (1 + ρ)/(1 − ρ) times H⁻¹, as for the mean of an AR(1), as far as the spread is noise and not misfit.
    """
    none = _unchanged(data, moved.count, count)
    if linear is None or not np.isfinite(np.where(linear.used, linear.r, 0.0)).all() or not linear.r[linear.used].any():
        return none
    inside, h = linear.inside, linear.factor
    first, group, r, slopes, used = _apart(linear)
    at, near = places(best, np.asarray(linear.data.wi)[first], np.asarray(linear.data.wo)[first])
    parts = kernel(at, np.stack([near, ~near]))
    found, counts = find(r, slopes, used, parts), counted(used, parts)
    asked = found.gain >= ASKED
    along = at[:, 2], np.round(np.asarray(zenith(np.asarray(linear.data.wi)[first])), 6)
    again = partial(_again, best, linear, moved, asked)
    each = [(blocks, again(blocks[group])) for blocks in map(ranges, along) if blocks.any()]
    ratio, axes = np.linalg.eigh(h.T @ _spread(found, r, slopes, each, linear) @ h)
    least = 1.0 + 2.0 * rho / (1.0 - rho) / (1.0 + s / float(data.typical)) ** 2
    if least == 1.0 and (not asked.any() or ratio[-1] <= 1.0):
        judged = np.isfinite(found.gain).any()
        return dataclasses.replace(none, gain=found.gain, outcome="independent") if judged else none
    stretch, inflation = np.eye(moved.count), np.ones(moved.count)
    wide = np.linalg.solve(h.T, axes * np.sqrt(np.maximum(ratio, least)))
    stretch[np.ix_(inside, inside)] = wide @ axes.T @ h.T
    inflation[inside] = np.sum(wide**2, axis=1) / np.sum(np.linalg.inv(h) ** 2, axis=0)
    share, alone = float(np.mean(near)), min(independent(found, counts, linear.more), count / least)
    return Correlation(found.size, share, found.gain, stretch, inflation, alone, "correlated", least)


def _spread(
    found: Found,
    r: Float[np.ndarray, "n c"],
    slopes: Float[np.ndarray, "n c i"],
    each: Sequence[tuple[Int[np.ndarray, " n"], Again]],
    linear: Linear,
) -> Float[np.ndarray, "i i"]:
    """V: the jackknife along each of some angles, of the channels with a process, and the likelihood's of the others.

    Of a part of the rows the noise of each stands for that of `more`, too much by as many times less one.
    """
    asked, inverse = found.gain >= ASKED, np.linalg.inv(linear.known)
    moved = np.zeros_like(inverse)
    if asked.any():
        for blocks, again in each:
            moved += left_out(r * asked, slopes * asked[:, None], linear.known, blocks, linear.more, again)
    moved *= of_few(max(sum(int(blocks.max()) for blocks, _ in each), 1))
    weight = np.where(asked, -(linear.more - 1.0) * found.white, 1.0)
    rest = linear.more * np.einsum("nci,c,ncj->ij", slopes, weight, slopes, optimize=True)
    return moved + inverse @ rest @ inverse


def _again(
    best: AbstractBRDF, linear: Linear, moved: Coordinates, asked: Bool[np.ndarray, " c"], rows: Int[np.ndarray, " n"]
) -> Again:
    """Fits without the blocks of the data's rows, in the channels with a process.

    They begin at the best values, and where the straight step meets the first bound.
    """
    values, inside = np.asarray(vector(best)), linear.inside
    here = moved.natural(values)
    low, high = ((end - here)[inside] for end in moved.around(here))

    def moves(block: int, step: Float[np.ndarray, " i"]) -> Float[np.ndarray, " i"]:
        gone = (rows == block)[:, None] & asked
        data = dataclasses.replace(linear.data, weight=np.where(gone, 0.0, linear.data.weight))
        begin, most = np.tile(here, (2, 1)), 1.0 / np.max(step / np.where(step < 0.0, low, high))
        begin[1, inside] += most * step
        ends = optima(best, data, moved.filled(values, begin), moved)
        apart = behind(ends, data)
        if not np.isfinite(apart).any():
            return most * step
        return (moved.natural(moved.near(ends.values[np.argmin(apart)], values)) - here)[inside]

    return Again(low, high, moves)


def _unchanged(data: Data, parameters: int, count: int) -> Correlation:
    channels = data.x.shape[1]
    parts = np.zeros((channels, 2)), np.nan, np.full(channels, np.nan), np.eye(parameters), np.ones(parameters)
    return Correlation(*parts, float(count), "not judged")


def _apart(linear: Linear) -> tuple[np.ndarray, ...]:
    """First rows of distinct directions, and at which of these each row lies; their residuals, slopes and use.

    Those of repeats are added up over √m.
    Errors that repeats have in common are no misfit that neighbours share.
    """
    some = np.any(linear.used, axis=1)
    pairs = np.round(np.concatenate([linear.data.wi, linear.data.wo], axis=1)[some], 9)
    _, first, of = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
    group = np.full(len(some), -1)
    group[some] = of.ravel()
    parts = [part[some] for part in (np.where(linear.used, linear.r, 0.0), linear.slopes, linear.used)]
    found = [np.zeros((len(first), *part.shape[1:])) for part in parts]
    for sums, part in zip(found, parts, strict=True):
        np.add.at(sums, of.ravel(), part)
    r, slopes, count = found
    root = np.sqrt(np.maximum(count, 1.0))
    return np.flatnonzero(some)[first], group, r / root, slopes / root[..., None], count > 0


def places(
    best: AbstractBRDF, wi: Float[np.ndarray, "n 3"], wo: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "n 3"], Bool[np.ndarray, " n"]]:
    """Where directions lie, in lengths of K, and which of them near the highlight."""
    width = float(widths(best, np.asarray(vector(best))[None])[0])
    h = wi + wo
    h = h / np.linalg.norm(h, axis=1, keepdims=True)
    theta_d = np.arccos(np.clip(np.sum(wi * h, axis=1), -1.0, 1.0))
    away, turn = np.asarray(zenith(h)) / width, np.arctan2(h[:, 1], h[:, 0]) - np.arctan2(wi[:, 1], wi[:, 0])
    far = np.arcsinh(away)
    return np.stack([far * np.cos(turn), far * np.sin(turn), theta_d], axis=1) / LENGTHS, away <= NEAR
