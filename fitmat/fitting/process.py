"""Process: residuals as noise plus a smooth process over the geometry, Σ = η² I + τ² K, without a matrix of all pairs.

It knows no model and no fit.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from fitmat.maths.normal import Z95

RANK = 160
"""Most columns of the pivoted Cholesky factor that stands for K."""

LEFT_OVER = 1e-3
"""Mean of the diagonal of K that the factor may leave over."""

FEWEST = 20
"""Values beyond the parameters from which on a process can be told from chance: of twelve readings never was."""

RATIOS = np.concatenate([[0.0], np.logspace(-4.0, 6.0, 121)])
"""τ²/η² that are tried."""

ASKED = 3.0
"""Nats by which the process must raise the restricted likelihood; below, it is left out and no interval changes.

Chance alone does that in one right model of 140 (½χ₀² + ½χ₁²: Self & Liang 1987).
"""


class Found(NamedTuple):
    """Of each channel: η², τ, τ² with what is not known of it, and nats, all (c,)."""

    white: np.ndarray
    size: np.ndarray
    allowance: np.ndarray
    gain: np.ndarray


def find(
    r: Float[np.ndarray, "n c"],
    slopes: Float[np.ndarray, "n c i"],
    used: Bool[np.ndarray, "n c"],
    root: Float[np.ndarray, "n m"],
) -> Found:
    """The sizes of each channel; one whose residuals ask for no process counts as its likelihood has it."""
    channels = r.shape[1]
    found = Found(np.ones(channels), np.zeros(channels), np.zeros(channels), np.full(channels, np.nan))
    for k in range(channels):
        these = used[:, k]
        basis = _basis(slopes[these, k])
        if np.count_nonzero(these) < basis.shape[1] + FEWEST:
            continue
        one = sizes(r[these, k], basis, root[these])
        found.gain[k] = one.gain
        if one.gain >= ASKED:
            found.white[k], found.size[k], found.allowance[k] = one.white, np.sqrt(one.process), one.allowance
    return found


def meat(
    found: Found, slopes: Float[np.ndarray, "n c i"], kernel: tuple[np.ndarray, np.ndarray], more: float
) -> Float[np.ndarray, "i i"]:
    """Jᵀ Σ J of `more` times as many values, K as from `factor`; the channels' misfits count as one."""
    root, left = kernel
    single = found.white + left[:, None] * found.allowance
    shared = more * np.einsum("nm,nci,c->mi", root, slopes, np.sqrt(found.allowance), optimize=True)
    return more * np.einsum("nci,nc,ncj->ij", slopes, single, slopes, optimize=True) + shared.T @ shared


def independent(found: Found, used: Bool[np.ndarray, "n c"], root: Float[np.ndarray, "n m"], more: float) -> float:
    """(tr Σ)²/tr Σ² of `more` times as many values."""
    count, process = used.sum(axis=0), found.size**2
    grams = np.einsum("nm,nc,nk->mk", root, used * process, root, optimize=True)
    trace = more * count @ (found.white + process)
    square = more * count @ (found.white**2 + 2.0 * found.white * process) + more**2 * np.sum(grams**2)
    return float(trace**2 / square)


def _basis(slopes: Float[np.ndarray, "n i"]) -> Float[np.ndarray, "n k"]:
    """Orthonormal columns that span the slopes."""
    length = np.linalg.norm(slopes, axis=0)
    if not length.any():
        return np.zeros((len(slopes), 0))
    u, w, _ = np.linalg.svd(slopes[:, length > 0] / length[length > 0], full_matrices=False)
    return u[:, w > 1e-8 * w[0]]


def factor(
    places: Float[np.ndarray, "n d"], rows: Bool[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, "n m"], Float[np.ndarray, " n"]]:
    """L with K ≈ L Lᵀ by Cholesky's method with pivots, and what it leaves of the diagonal.

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
    root, over = np.zeros((len(places), count)), np.zeros(len(places))
    root[where], over[where] = columns[:count].T, left
    return root, over


def matern(distance: np.ndarray) -> np.ndarray:
    """(1 + √3 d) exp(−√3 d)."""
    q = np.sqrt(3.0) * distance
    return (1.0 + q) * np.exp(-q)


class Sizes(NamedTuple):
    """Of noise and process.

    Attributes:
        white: η².
        process: τ².
        gain: Nats over τ = 0.
        freedom: Degrees of freedom with which τ² is known, as of the mean of so many squares: −2 d²ℓ/d(ln τ²)².
    """

    white: float
    process: float
    gain: float
    freedom: float

    @property
    def allowance(self) -> float:
        """τ² with what is not known of it: intervals of Student's t, not of the normal distribution."""
        from scipy.special import stdtrit

        return self.process * float(stdtrit(max(self.freedom, 1.5), 0.975) / Z95) ** 2


def sizes(r: Float[np.ndarray, " n"], basis: Float[np.ndarray, "n k"], root: Float[np.ndarray, "n m"]) -> Sizes:
    """Noise and process of residuals, by restricted maximum likelihood.

    Args:
        r: Residuals.
        basis: Orthonormal columns that span the slopes of the fitted parameters.
        root: L of K ≈ L Lᵀ.
    """
    w, v = np.linalg.eigh(root.T @ root)
    kept = w > 1e-12 * w[-1]
    w, u = w[kept], root @ (v[:, kept] / np.sqrt(w[kept]))
    rest, k = len(r) - basis.shape[1], basis.shape[1]
    ur, uq = u.T @ r, u.T @ basis
    taken = RATIOS[:, None] * w / (1.0 + RATIOS[:, None] * w)
    gram = np.eye(k) - np.einsum("lm,mi,mj->lij", taken, uq, uq, optimize=True)
    slope = basis.T @ r - (taken * ur) @ uq
    square = r @ r - taken @ ur**2 - np.einsum("li,li->l", slope, np.linalg.solve(gram, slope[..., None])[..., 0])
    white = np.maximum(square, 1e-300) / rest
    logs = -0.5 * (rest * np.log(white) + np.log1p(RATIOS[:, None] * w).sum(axis=1) + np.linalg.slogdet(gram)[1])
    j = int(np.argmax(logs))
    bent = logs[j - 1] - 2.0 * logs[j] + logs[j + 1] if 1 < j < len(RATIOS) - 1 else 0.0
    freedom = -2.0 * bent / np.log(RATIOS[2] / RATIOS[1]) ** 2
    return Sizes(float(white[j]), float(RATIOS[j] * white[j]), float(logs[j] - logs[0]), float(freedom))
