"""Likeness: beside how many readings of the same misfit a sample is taken, Σ K² with K of the fit's `correlation`.

K² is the share of the misfit of one place that another tells. It chooses no candidate.
"""

import numpy as np
from jaxtyping import Bool, Float

from fitmat.fitting.correlation import places
from fitmat.fitting.result import Fit
from fitmat.judgement.design.candidates import Candidates
from fitmat.maths.matern import matern

MOST = 1024
"""Of more readings of a file an evenly spread part stands for all."""


class Likeness:
    """The places of candidates, and what is measured there.

    Attributes:
        beside: Σ K² over what is measured, and over the samples of a curve before each, (k, m); −1 where there is none.
    """

    def __init__(self, fit: Fit, looked: Candidates, repeats: int) -> None:
        wi, wo = (w.reshape(-1, 3) for w in looked.directions())
        at, near = places(fit.model, wi, wo)
        self._at, self._near = at.reshape(*looked.used.shape, 3), near.reshape(looked.used.shape)
        self._weight = np.where(looked.used, float(repeats), 0.0)
        measured = np.flatnonzero(fit.measurements.valid.any(axis=1))
        part = measured[:: -(-len(measured) // MOST)]
        known = places(fit.model, fit.measurements.wi[part], fit.measurements.wo[part])
        self.beside = self._like(*known, np.full(len(part), len(measured) / len(part)))
        for k in range(1, looked.used.shape[1]):
            like = _squared((self._at[:, k, None], self._near[:, k, None]), (self._at[:, :k], self._near[:, :k]))
            self.beside[:, k] += np.sum(like * self._weight[:, :k], axis=1)
        self.beside[~looked.used] = -1.0

    def take(self, chosen: int) -> None:
        """Count a candidate as measured."""
        more = self._like(self._at[chosen], self._near[chosen], self._weight[chosen])
        self.beside = np.where(self.beside < 0.0, -1.0, self.beside + more)

    def _like(
        self, at: Float[np.ndarray, "n 3"], near: Bool[np.ndarray, " n"], weight: Float[np.ndarray, " n"]
    ) -> Float[np.ndarray, "k m"]:
        rows = zip(self._at[:, :, None], self._near[:, :, None], strict=True)
        return np.stack([_squared(row, (at, near)) @ weight for row in rows])


def _squared(one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """K² of places, given as where they lie and whether near the highlight; 0 between the two parts."""
    return matern(np.linalg.norm(one[0] - other[0], axis=-1)) ** 2 * (one[1] == other[1])
