"""Cross-validation: how well a fit to all other incidences predicts the one that was left out.

It says nothing of which model is better; `choice` does. A large file is not refitted.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.fitting.information import information
from fitmat.fitting.likelihood import log_pointwise, misfits
from fitmat.fitting.refining import optima
from fitmat.fitting.result import Fit
from fitmat.judgement.choice.evidence import MOST_LEFT_OUT
from fitmat.judgement.prediction import predictions
from fitmat.measurements.incidences import incidences
from fitmat.models.metrics import cube_root
from fitmat.models.parameters import with_vector
from fitmat.text import brief
from fitmat.uncertainty.density import physical
from fitmat.uncertainty.laplace import draws

DRAWS = 100
"""Of each refit, behind its predictive density."""

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
        elpd: Log predictive density of the incidence's values by the fits to all others, nats; NaN where that was not
            asked.
    """

    names: tuple[str, ...]
    theta_i_deg: np.ndarray
    cube_root: np.ndarray
    z: np.ndarray
    values: np.ndarray
    settled: np.ndarray
    elpd: np.ndarray

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


def leave_incidences_out(fit: Fit, *, densities: bool = False) -> LeftOut | None:
    """Refit without each incidence in turn, from the optimum of all, and predict it.

    Left-out values have weight 0, so that the program that fitted all serves for each. Where there are many angles,
    neighbouring ones are left out together.

    Args:
        fit: A fit that is finite.
        densities: Whether to ask for predictive densities as well, up to `MOST_LEFT_OUT` values.

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
    elpd = np.full(len(groups), np.nan)
    if densities and promised and fit.n_values <= MOST_LEFT_OUT:
        elpd = np.array([_density(fit, values[k], float(s[k]), left[k]) for k in range(len(groups))])
    return LeftOut(tuple(g.name for g in groups), angles, cube, z if promised else z * np.nan, count, settled, elpd)


def _density(fit: Fit, values: Float[np.ndarray, " p"], s: float, left: Float[np.ndarray, "n c"]) -> float:
    """Σ ln p(y | all other incidences) over the values that were left out, by Laplace's draws around the refit."""
    data = dataclasses.replace(fit.data, weight=np.asarray(fit.data.weight) - left)
    best = with_vector(fit.model, values)
    known = information(best, data, s, fit.free)
    refit = dataclasses.replace(fit, model=best, data=data, discrepancy=s, information=known)
    drawn, spreads = physical(refit, draws(refit, DRAWS, np.random.default_rng(0)))
    used, logs = left > 0, np.empty((DRAWS, int(np.count_nonzero(left))))
    for part, x, noise, spread in predictions(fit, drawn, spreads):
        logs[part] = log_pointwise(x, noise, fit.data, spread)[:, used]
    return float(np.sum(np.logaddexp.reduce(logs, axis=0) - np.log(DRAWS)))


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
