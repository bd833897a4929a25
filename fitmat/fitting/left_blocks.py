"""Left blocks: how far a fit moves when a range of geometries is left out, and the covariance that follows.

It solves to first order, and knows no model: who calls fits again where such a step leaves the bounds.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from fitmat.maths.normal import Z95

BLOCKS = 4
"""Of how many ranges one is left out, at most.

Of two to six, four are those whose intervals hold best what the other half of a range of incidences gives, over seven
families of wrong surfaces; the more there are, the more of a misfit stays where a fit has absorbed it.
"""

LEAST = 1e-6
"""Of a parameter's own information that is always left, so that one that a single range determines moves finitely."""


class Again(NamedTuple):
    """How far steps may go, and what holds beyond.

    Attributes:
        low: How far the lower bounds are, (i,).
        high: How far the upper bounds are.
        moves: Block and its step → how far a fit moves without it, (i,).
    """

    low: Float[np.ndarray, " i"]
    high: Float[np.ndarray, " i"]
    moves: Callable[[int, Float[np.ndarray, " i"]], Float[np.ndarray, " i"]]


def ranges(places: Float[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
    """Which of `BLOCKS` ranges of as many readings each a reading lies in, from 0; equal places lie in the same."""
    ends = np.quantile(places, np.linspace(0.0, 1.0, BLOCKS + 1)[1:-1])
    return np.unique(np.searchsorted(ends, places, side="right"), return_inverse=True)[1]


def left_out(
    r: Float[np.ndarray, "n c"],
    slopes: Float[np.ndarray, "n c i"],
    known: Float[np.ndarray, "i i"],
    blocks: Int[np.ndarray, " n"],
    more: float,
    again: Again,
) -> Float[np.ndarray, "i i"]:
    """(g − 1)/g Σ (δ_k − δ̄)(δ_k − δ̄)ᵀ over g blocks, δ_k = −(H − H_k)⁻¹ s_k: the jackknife that leaves out a block.

    Tukey, Ann. Math. Stat. 29 (1958), 614; of blocks, Künsch, Ann. Stat. 17 (1989), 1217. Residuals as the likelihood
    counts them are of one size, so that s_k = Σ J r; what a fit has absorbed of a misfit is seen in how it moves
    without a block. What the rest hardly tells apart moves along a valley, which is straight for a short way only: a
    step that leaves the bounds is none, and the move is that of a fit without the block.

    Args:
        r: Residuals.
        slopes: J = −∂r/∂t, 0 where a residual does not count.
        known: H, the information of all values and of the bounds.
        blocks: Which block each row belongs to.
        more: How many values were fitted for each of these.
        again: For steps that are too long.
    """
    least, moves = LEAST * np.diag(np.diagonal(known)), []
    for block in np.unique(blocks):
        j, one = slopes[blocks == block], r[blocks == block]
        rest = known - more * np.einsum("nci,ncj->ij", j, j, optimize=True)
        step = np.linalg.solve(_positive(rest, known) + least, -more * np.einsum("nci,nc->i", j, one))
        moves.append(step if ((again.low <= step) & (step <= again.high)).all() else again.moves(int(block), step))
    apart = np.array(moves) - np.mean(moves, axis=0)
    return (len(moves) - 1) / len(moves) * apart.T @ apart


def of_few(freedom: int) -> float:
    """Factor of a variance known with so many degrees of freedom: intervals are Student's instead of the normal's.

    As of a mean of g numbers, g − 1 (Ibragimov & Müller, J. Bus. Econ. Stat. 28 (2010), 453).
    """
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.975) / Z95) ** 2


def _positive(rest: Float[np.ndarray, "i i"], known: Float[np.ndarray, "i i"]) -> Float[np.ndarray, "i i"]:
    """Without the negative directions that rounding leaves where a block has all of the information."""
    unit = np.sqrt(np.diagonal(known))
    w, v = np.linalg.eigh(rest / np.outer(unit, unit))
    return (v * np.maximum(w, 0.0)) @ v.T * np.outer(unit, unit)
