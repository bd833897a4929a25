"""Steps: how far Newton's method moves the free parameters and the discrepancy, and where these may go.

It passes over no file: the sums of all rows are given.
"""

import numpy as np
from jaxtyping import Float

from fitmat.fitting.discrepancy import NEGLIGIBLE
from fitmat.fitting.information import FOLLOWS, expected_information, observed_information
from fitmat.fitting.result import Fit
from fitmat.fitting.streamed.sums import Sums
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import with_vector

NO_CURVATURE = 1e-11
"""Eigenvalue of the scaled curvature below which a direction is left where it is: rounding, not data, moves it."""


class Range:
    """Where the free natural coordinates and, behind them, s may go; x is such a vector, (free + 1,).

    Attributes:
        lower: Lower bounds; 0 for s.
        upper: Upper bounds; infinite for s.
        longest: How far one step may go.
        negligible: The s below which there is none.
    """

    def __init__(self, start: Fit) -> None:
        self._start, self._moved, self._free = start, start.coordinates, start.free
        lower, upper = self._moved.low, self._moved.high
        typical = float(start.data.typical)
        self.lower, self.upper = np.append(lower, 0.0), np.append(upper, np.inf)
        self.longest = np.append((upper - lower) / 4.0, max(typical, start.discrepancy))
        self.negligible = NEGLIGIBLE * typical

    @property
    def begin(self) -> np.ndarray:
        """The optimum of the part; what is almost on a bound, on it."""
        side, natural = self._moved.side(self._start.values), self._moved.natural(self._start.values)
        natural = np.where(side < 0, self.lower[:-1], np.where(side > 0, self.upper[:-1], natural))
        return np.append(natural, self._start.discrepancy)

    def model(self, x: np.ndarray) -> AbstractBRDF:
        """The model at x."""
        values = self._moved.filled(self._start.values, x[:-1])
        values[self._free] = np.clip(values[self._free], self._moved.lower, self._moved.upper)
        return with_vector(self._start.model, values)

    def second_order(self, best: AbstractBRDF, s: float) -> Float[np.ndarray, "p p"]:
        """What residuals × their curvature add to JᵀJ for each value, estimated from the part; 0 if negligible."""
        start = self._start
        if s < FOLLOWS * float(start.data.typical):
            return np.zeros_like(start.information)
        first = expected_information(best, start.data, s)
        both = observed_information(best, start.data, s, first)
        return (both - first) / start.measurements.n_valid

    def step(self, x: np.ndarray, sums: Sums, more: np.ndarray, damping: float) -> tuple[np.ndarray, float]:
        """The projected Newton step from x, and its length in standard errors."""
        free, size = self._free, len(self._free)
        slope, curvature = np.append(sums.gradient[free], sums.slope), np.zeros((size + 1, size + 1))
        curvature[:size, :size] = (sums.gram + more)[np.ix_(free, free)]
        curvature[size, :size] = curvature[:size, size] = sums.mixed[free]
        curvature[size, size] = sums.curvature
        held = ((x <= self.lower) & (slope > 0)) | ((x >= self.upper) & (slope < 0))
        while True:
            moving, step = np.flatnonzero(~held), np.zeros(size + 1)
            step[moving], length = _newton(slope[moving], curvature[np.ix_(moving, moving)], damping)
            leaving = ~held & (((x <= self.lower) & (step < 0)) | ((x >= self.upper) & (step > 0)))
            if not leaving.any():
                break
            held |= leaving
        step *= min(1.0, float(np.min(self.longest / np.maximum(np.abs(step), 1e-300))))
        return np.clip(x + step, self.lower, self.upper) - x, length


def _newton(slope: np.ndarray, curvature: np.ndarray, damping: float) -> tuple[np.ndarray, float]:
    """−H⁻¹g, downhill also where H is not positive definite, and the length of that step without damping.

    Along directions of no curvature it is 0.
    """
    diagonal = np.abs(np.diagonal(curvature))
    unit = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    eigenvalues, vectors = np.linalg.eigh(curvature / np.outer(unit, unit))
    sharp = np.abs(eigenvalues) > NO_CURVATURE
    along = np.where(sharp, vectors.T @ (slope / unit), 0.0)
    size = np.where(sharp, np.abs(eigenvalues), 1.0)
    return -vectors @ (along / (size + damping)) / unit, float(np.sqrt(np.sum(along**2 / size)))
