"""Cross-validation: how well a fit to all other incidences predicts the one that was left out.

It says nothing of which model is better; `choice` does. A large file is not refitted.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.fitting.likelihood import misfits
from fitmat.fitting.refining import optima
from fitmat.fitting.result import Fit
from fitmat.judgement.prediction import predictions
from fitmat.measurements.incidences import incidences
from fitmat.models.metrics import cube_root
from fitmat.text import brief

MOST_REFITTED = 50_000
"""Values above which nothing is refitted."""


@dataclasses.dataclass(frozen=True, eq=False)
class LeftOut:
    """Prediction errors of incidences that the fit had not seen; arrays hold one entry for each, (k,).

    Attributes:
        names: The incidences, "60°".
        theta_i_deg: Their angles in degrees.
        cube_root: Rms of ∛(y cosθ_i) − ∛(f cosθ_i) in sr^(−1/3).
        z: Rms residual in the standard deviations that the others' noise and misfit promise: 1 where the prediction
            is as good as promised; NaN where the loss promises nothing.
        values: How many values were predicted.
        settled: Whether the refit converged.
    """

    names: tuple[str, ...]
    theta_i_deg: np.ndarray
    cube_root: np.ndarray
    z: np.ndarray
    values: np.ndarray
    settled: np.ndarray

    __repr__ = brief

    @property
    def error(self) -> float:
        """Rms of `cube_root` over all values, sr^(−1/3)."""
        return float(np.sqrt(np.sum(self.values * self.cube_root**2) / self.values.sum()))

    @property
    def surprise(self) -> float:
        """Rms of `z` over all values."""
        return float(np.sqrt(np.sum(self.values * self.z**2) / self.values.sum()))

    @property
    def worst(self) -> str:
        """The incidence that is predicted worst, in its own standard deviations."""
        return self.names[int(np.argmax(np.nan_to_num(self.z)))]


def leave_incidences_out(fit: Fit) -> LeftOut | None:
    """Refit without each incidence in turn, from the optimum of all, and predict it.

    Left-out values have weight 0, so that the program that fitted all serves for each. Where there are many angles,
    neighbouring ones are left out together.

    Args:
        fit: A fit that is finite.

    Returns:
        The errors; None for a single incidence, where nothing would be left, for what is not finite, and above
        `MOST_REFITTED` values.
    """
    data = fit.data
    used = np.asarray(data.weight)
    groups = incidences(np.asarray(data.wi), np.asarray((used > 0).any(axis=1)))
    if len(groups) < 2 or not fit.finite or fit.n_values > MOST_REFITTED:
        return None
    left = np.zeros((len(groups), *used.shape))
    for k, group in enumerate(groups):
        left[k, group.rows] = used[group.rows]
    values, s, settled = _refitted(fit, used - left)
    cube, z = _errors(fit, values, s, left)
    promised = fit.loss.posterior
    angles = np.array([g.theta_i_deg for g in groups])
    count = left.sum(axis=(1, 2))
    return LeftOut(tuple(g.name for g in groups), angles, cube, z if promised else z * np.nan, count, settled)


def _refitted(fit: Fit, weights: Float[np.ndarray, "k n c"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Parameters (k, p), s and convergence of the fits under other weights."""
    ends = [
        optima(fit.model, dataclasses.replace(fit.data, weight=weight), fit.values[None], fit.coordinates)
        for weight in weights
    ]
    values, s, _, settled, _ = (np.concatenate(column) for column in zip(*ends, strict=True))
    return values, s, settled


def _errors(fit: Fit, draws: np.ndarray, s: np.ndarray, left: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Root mean squares, over what each was not fitted to, of the cube-root error and of the residual, (k,) each."""
    data, found = fit.data, np.empty((2, len(draws)))
    for part, x, noise, spread in predictions(fit, draws, s):
        squares = (cube_root(data.x) - cube_root(x)) ** 2, misfits(x, noise, data, spread) ** 2
        found[:, part] = [(left[part] * square).sum(axis=(1, 2)) for square in squares]
    cube, z = np.sqrt(found / left.sum(axis=(1, 2)))
    return cube, z
