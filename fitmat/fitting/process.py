"""Process: residuals as noise plus smooth processes over parts of the geometry, Σ = η² I + Σ τ² K, without all pairs.

It knows no model and no fit.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from fitmat.maths.matern import matern

RANK = 160
"""Most columns of the pivoted Cholesky factor that stands for the K of a part."""

LEFT_OVER = 1e-3
"""Mean of the diagonal of K that the factor may leave over."""

FEWEST = 20
"""Values beyond the parameters from which on a process can be told from chance: of twelve readings never was."""

COARSE = np.concatenate([[0.0], np.logspace(-4.0, 6.0, 41)])
"""τ²/η² that are tried of each part."""

FINE = np.logspace(-0.25, 0.25, 13)
"""Times the best of these, that are tried then."""

ASKED = 5.0
"""Nats by which the processes must raise the restricted likelihood; below, they are left out and no interval changes.

So must a second part beside the first, else the first stands alone. Chance alone does that in one right model of 1,300
for each part (½χ₀² + ½χ₁²: Self & Liang 1987). That is rare, for the jackknife widens tenfold and more where a single
range tells most of a parameter, so that one false alarm in a hundred would make the mean width a quarter too large.
"""


class Found(NamedTuple):
    """Of each channel: η², (c,), τ of each part, (c, b), and nats, (c,)."""

    white: np.ndarray
    size: np.ndarray
    gain: np.ndarray


class Kernel(NamedTuple):
    """K of each of b parts of n places.

    Attributes:
        rows: Which places belong to a part, (b, n); no place to two.
        roots: L of K ≈ L Lᵀ, (n, m) each, 0 at the other parts.
    """

    rows: Bool[np.ndarray, "b n"]
    roots: tuple[np.ndarray, ...]


def kernel(places: Float[np.ndarray, "n d"], rows: Bool[np.ndarray, "b n"]) -> Kernel:
    """Matérn's of each part."""
    return Kernel(rows, tuple(factor(places, part) for part in rows))


def find(
    r: Float[np.ndarray, "n c"], slopes: Float[np.ndarray, "n c i"], used: Bool[np.ndarray, "n c"], k: Kernel
) -> Found:
    """The sizes of each channel; one whose residuals ask for no process counts as its likelihood has it."""
    channels, parts = r.shape[1], len(k.roots)
    found = Found(np.ones(channels), np.zeros((channels, parts)), np.full(channels, np.nan))
    for j in range(channels):
        these = used[:, j]
        basis = _basis(slopes[these, j])
        if np.count_nonzero(these) < basis.shape[1] + FEWEST:
            continue
        one = sizes(r[these, j], basis, [root[these] for root in k.roots])
        found.gain[j] = one.gain
        if one.gain >= ASKED:
            found.white[j], found.size[j] = one.white, np.sqrt(one.process)
    return found


class Counts(NamedTuple):
    """How many values there are, and how alike.

    Attributes:
        every: Of each channel, (c,).
        part: Of each channel and part, (c, b), which is tr K.
        alike: tr K² of these, (c, b).
    """

    every: np.ndarray
    part: np.ndarray
    alike: np.ndarray


def counted(used: Bool[np.ndarray, "n c"], k: Kernel) -> Counts:
    """The values in use, and of how many each is like; channels of the same values at once."""
    known: dict[bytes, list[float]] = {}
    for mask in used.T:
        if mask.tobytes() not in known:
            parts = [root[mask] for root in k.roots]
            known[mask.tobytes()] = [float(np.sum((part.T @ part) ** 2)) for part in parts]
    alike = np.array([known[mask.tobytes()] for mask in used.T])
    return Counts(used.sum(axis=0), used.T.astype(float) @ k.rows.T, alike)


def independent(found: Found, counts: Counts, more: float) -> float:
    """(tr Σ)²/tr Σ² of `more` times as many values."""
    process = found.size**2
    trace = more * (counts.every @ found.white + np.sum(counts.part * process))
    square = counts.every @ found.white**2 + 2.0 * found.white @ np.sum(counts.part * process, axis=1)
    return float(trace**2 / (more * square + more**2 * np.sum(counts.alike * process**2)))


def _basis(slopes: Float[np.ndarray, "n i"]) -> Float[np.ndarray, "n k"]:
    """Orthonormal columns that span the slopes."""
    length = np.linalg.norm(slopes, axis=0)
    if not length.any():
        return np.zeros((len(slopes), 0))
    u, w, _ = np.linalg.svd(slopes[:, length > 0] / length[length > 0], full_matrices=False)
    return u[:, w > 1e-8 * w[0]]


def factor(places: Float[np.ndarray, "n d"], rows: Bool[np.ndarray, " n"]) -> Float[np.ndarray, "n m"]:
    """L with K ≈ L Lᵀ by Cholesky's method with pivots.

    Harbrecht, Peters & Schneider, Applied Numerical Mathematics 62 (2012): each column takes the place that is known
    least. Repeated places, of which K is singular, end it early.

    Args:
        places: In lengths.
        rows: Which of them count; the others are 0.
    """
    where = np.flatnonzero(rows)
    near, n = places[where], len(where)
    columns, left, count = np.zeros((min(RANK, n), n)), np.ones(n), 0
    while count < len(columns) and left.max() > 1e-9 and left.mean() > LEFT_OVER:
        pivot = int(np.argmax(left))
        row = matern(np.linalg.norm(near - near[pivot], axis=1)) - columns[:count, pivot] @ columns[:count]
        columns[count] = row / np.sqrt(left[pivot])
        left = np.maximum(left - columns[count] ** 2, 0.0)
        left[pivot], count = 0.0, count + 1
    root = np.zeros((len(places), count))
    root[where] = columns[:count].T
    return root


class Sizes(NamedTuple):
    """Of noise and of the process of each of b parts.

    Attributes:
        white: η².
        process: τ², (b,).
        gain: Nats over no process at all.
    """

    white: float
    process: np.ndarray
    gain: float


def sizes(
    r: Float[np.ndarray, " n"], basis: Float[np.ndarray, "n k"], roots: Sequence[Float[np.ndarray, "n m"]]
) -> Sizes:
    """Noise and processes of residuals, by restricted maximum likelihood; parts that hardly raise it are left out.

    Args:
        r: Residuals.
        basis: Orthonormal columns that span the slopes of the fitted parameters.
        roots: L of K ≈ L Lᵀ of each part, whose rows are 0 at the other parts.
    """
    parts, places = [_Part.of(r, basis, root) for root in roots], range(len(roots))
    tried = [COARSE if len(part.power) else COARSE[:1] for part in parts]
    logs = kept = _likelihood(parts, tried, r, basis)[0]
    without = [logs.take([0], axis=b) for b in places]
    least = max(places, key=lambda b: without[b].max())
    if len(parts) > 1 and logs.max() - without[least].max() < ASKED:
        tried[least], kept = COARSE[:1], without[least]
    tried = [x * FINE if x else COARSE[:1] for x in _best(kept, tried)]
    fine, white = _likelihood(parts, tried, r, basis)
    top = np.unravel_index(np.argmax(fine), fine.shape)
    level = float(white[top])
    best = np.array([ratios[k] for ratios, k in zip(tried, top, strict=True)])
    return Sizes(level, best * level, float(fine[top] - logs.flat[0]))


def _best(logs: np.ndarray, tried: Sequence[np.ndarray]) -> list[float]:
    """The ratio of each part where the likelihood is greatest."""
    return [float(t[j]) for t, j in zip(tried, np.unravel_index(np.argmax(logs), logs.shape), strict=True)]


class _Part(NamedTuple):
    """A process in its own axes: the eigenvalues of K, (m,), and residuals and slopes along them, (m,) and (m, k)."""

    power: np.ndarray
    residual: np.ndarray
    slope: np.ndarray

    @classmethod
    def of(cls, r: np.ndarray, basis: np.ndarray, root: np.ndarray) -> "_Part":
        w, v = np.linalg.eigh(root.T @ root)
        kept = w > 1e-12 * w.max(initial=0.0)
        u = root @ (v[:, kept] / np.sqrt(w[kept]))
        return cls(w[kept], u.T @ r, u.T @ basis)

    def at(self, ratio: Float[np.ndarray, " g"]) -> tuple[np.ndarray, ...]:
        """ln det of I + ratio K, and what K takes from rᵀr, from Qᵀr and from QᵀQ, (g, …) each."""
        more = ratio[:, None] * self.power
        taken = more / (1.0 + more)
        gram = np.einsum("gm,mi,mj->gij", taken, self.slope, self.slope, optimize=True)
        return np.log1p(more).sum(axis=1), taken @ self.residual**2, (taken * self.residual) @ self.slope, gram


def _likelihood(
    parts: Sequence[_Part], ratios: Sequence[np.ndarray], r: np.ndarray, basis: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """ℓ and η² at every combination of the parts' ratios τ²/η², (g, …) both."""
    grid, lead = [part.at(ratio) for part, ratio in zip(parts, ratios, strict=True)], range(len(parts))

    def total(which: int) -> np.ndarray:
        each = [np.expand_dims(found[which], tuple(j for j in lead if j != b)) for b, found in enumerate(grid)]
        return sum(each[1:], start=each[0])

    rest, k = len(r) - basis.shape[1], basis.shape[1]
    gram, slope = np.eye(k) - total(3), basis.T @ r - total(2)
    square = r @ r - total(1) - np.sum(slope * np.linalg.solve(gram, slope[..., None])[..., 0], axis=-1)
    white = np.maximum(square, 1e-300) / rest
    return -0.5 * (rest * np.log(white) + total(0) + np.linalg.slogdet(gram)[1]), white
