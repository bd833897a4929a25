"""Laplace's approximation: the Gaussian around the best fit, corrected by the density itself, and draws from it.

It walks nowhere; `chains` does. A correction that cannot be relied on is not made, and the verdict says so.
"""

import dataclasses
import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any

import numpy as np
from jaxtyping import Float

from fitmat import arguments
from fitmat._types import Progress
from fitmat.fitting import fitting
from fitmat.fitting.coordinates import Coordinates
from fitmat.fitting.information import inverse_information, unknown_spread
from fitmat.fitting.result import Fit
from fitmat.maths.blas import one_thread
from fitmat.measurements.noise import measured_noise
from fitmat.measurements.samples import Measurements
from fitmat.text import brief
from fitmat.uncertainty.density import log_posterior, physical
from fitmat.uncertainty.diagnostics import GOOD_PARETO
from fitmat.uncertainty.pareto import smoothed
from fitmat.uncertainty.posterior import Posterior
from fitmat.uncertainty.scaled_weights import sampled, scaled_gaussian

NAMED = 4
"""More models than these are counted where progress is told."""

LAPLACE_DRAWS = 2000

PROPOSALS = (2000, 4000)
"""Draws that are weighted for a correction: the second number where the first gives fewer than `ENOUGH`."""

ENOUGH = 1000
"""Effective draws that are as good as more: means are within 0.03 sd."""

FEWEST = 200
"""Effective draws (1/Σw², Kong 1992) below which a correction is not made, whatever its k̂."""

MOST_CORRECTED = 50_000
"""Values above which the Gaussian is left as it is: so much data make the posterior Gaussian."""

HEAVY_TAIL = 6.0
"""Degrees of freedom of the t distribution that proposes draws of its own around the Laplace approximation."""


@one_thread()
def laplace(fit: Fit, *, seed: int, corrected: bool = True) -> Posterior:
    """Draws around the best fit without walking there.

    Corrected: draws from a t distribution around Laplace's Gaussian, within the bounds, are weighted with the
    posterior density over their own, the weights smoothed by a Pareto tail (PSIS: Vehtari, Simpson, Gelman, Yao &
    Gabry, JMLR 25(72), 2024), and resampled in proportion. The shape k̂ of that tail says whether it worked; where it
    did not, and uncorrected, they are draws from the Gaussian with the fit's covariance in natural coordinates, folded
    into the bounds.

    Args:
        fit: A fit with a finite optimum.
        seed: Seed of the draws.
        corrected: Whether to correct; above `MOST_CORRECTED` values it is never done.

    Returns:
        A `Posterior`; a fit that is not finite, or under an objective, gives a single draw and no intervals.
    """
    arguments.kind("fit", fit, Fit)
    arguments.whole("seed", seed)
    arguments.flags(corrected=corrected)
    if not (fit.finite and fit.loss.posterior):
        return Posterior(fit, "laplace", fit.values[None], np.array([fit.discrepancy]))
    rng, k, drawn = np.random.default_rng(seed), None, None
    if corrected and fit.n_values <= MOST_CORRECTED:
        drawn, k = _reweighted(fit, rng)
    if drawn is None:
        drawn = draws(fit, LAPLACE_DRAWS, np.random.default_rng(seed))
    values, discrepancy = physical(fit, drawn)
    return Posterior(fit, "laplace", values, discrepancy, pareto_k=k)


def laplace_each(
    measurements: Measurements,
    jobs: Mapping[str, Mapping[str, Any]],
    *,
    seed: int,
    corrected: bool = True,
    progress: Progress | None = None,
) -> list[Posterior]:
    """`fit` and `laplace` of several models, side by side in threads: most of a first fit is compilation.

    Args:
        measurements: From `fitmat.read`.
        jobs: Model name → keyword arguments of `fit`.
        seed: Of the draws.
        corrected: As in `laplace`; of no use where the fits are sampled afterwards.
        progress: Called with what is done next.

    Raises:
        FitmatError: as `fit`, for a model that cannot be fitted.
    """
    many = len(jobs) > NAMED
    words = f"fitting {f'{len(jobs)} models' if many else ', '.join(jobs)}"
    say, total = progress or (lambda *_: None), len(jobs) if many else 0
    say(words, 0, total)
    noise = measured_noise(measurements)

    def one(name: str) -> Posterior:
        return laplace(fitting.fitted(measurements, noise, name, **jobs[name]), seed=seed, corrected=corrected)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        pending = {pool.submit(one, name): name for name in reversed(list(jobs))}  # what takes longest stands last
        for done, job in enumerate(as_completed(pending), 1):
            if job.exception() is not None:
                pool.shutdown(cancel_futures=True)
                break
            say(f"{words}, {pending[job]} is done" if many else words, min(done, total), total)
        # In the order of submission: of several that cannot be fitted the same one is named, whichever ended first.
        found = {name: job.result() for job, name in pending.items() if not job.cancelled()}
        return [found[name] for name in jobs]


def gaussian(fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of the sampled coordinates: the natural ones, weights scaled, and s."""
    moved, free = sampled(fit), fit.free
    span, centre = moved.span, np.append(moved.natural(fit.values), fit.discrepancy)
    covariance = np.zeros((len(centre),) * 2)
    # The flat prior counts with the variance of its range: a direction that no datum determines is no wider than it.
    information = fit.information[np.ix_(free, free)] + np.diag(12.0 / moved.extent**2)
    few = unknown_spread(fit.noise.known, fit.n_values, len(free))
    covariance[:-1, :-1] = few * inverse_information(information, span)
    covariance[-1, -1] = _discrepancy_sd(fit) ** 2
    return scaled_gaussian(moved, centre, covariance)


def draws(fit: Fit, count: int, rng: np.random.Generator) -> Float[np.ndarray, "count d"]:
    """Gaussian draws of the sampled coordinates, folded at the bounds of the parameters."""
    moved = sampled(fit)
    natural = moved.unscaled(rng.multivariate_normal(*gaussian(fit), size=count, method="eigh"))
    return moved.scaled(np.column_stack([moved.folded(natural[:, :-1]), np.abs(natural[:, -1])]))


@dataclasses.dataclass(frozen=True, eq=False)
class HeavyTailed:
    """The multivariate t of `HEAVY_TAIL` degrees of freedom around Laplace's Gaussian, s folded at 0.

    Attributes:
        centre: Of the sampled coordinates, (d,).
        factor: Cholesky factor of the Gaussian's covariance, (d, d).
        whitening: Its inverse.
        moved: The coordinates without s, with their bounds.
    """

    centre: np.ndarray
    factor: np.ndarray
    whitening: np.ndarray
    moved: Coordinates

    __repr__ = brief

    def drawn(self, count: int, random: np.random.Generator | np.random.RandomState) -> Float[np.ndarray, "count d"]:
        """Draws of the sampled coordinates; the bounds of the parameters do not hold them."""
        return self._placed(*self._random(count, random))

    def _random(self, count: int, random: np.random.Generator | np.random.RandomState) -> tuple[np.ndarray, np.ndarray]:
        return random.chisquare(HEAVY_TAIL, size=count), random.standard_normal((count, len(self.centre)))

    def _placed(self, square: Float[np.ndarray, " m"], normal: Float[np.ndarray, "m d"]) -> Float[np.ndarray, "m d"]:
        x = self.centre + np.sqrt(HEAVY_TAIL / square)[:, None] * (normal @ self.factor.T)
        x[:, -1] = np.abs(x[:, -1])
        return x

    def drawn_inside(self, count: int, rng: np.random.Generator) -> Float[np.ndarray, "k d"]:
        """The first `count` draws within the bounds; fewer where hardly any are. Their density is `log_density` too.

        Leaving out what is outside changes the density by one factor for all, which no weight notices.
        """
        random = self._random(16 * count, rng)
        found = np.zeros((0, len(self.centre)))
        for begin in range(0, 16 * count, 2 * count):  # all are drawn, however few are asked for, so that none changes
            if len(found) >= count:
                break
            x = self._placed(*(part[begin : begin + 2 * count] for part in random))
            natural = self.moved.unscaled(x)[:, :-1]
            inside = ((natural >= self.moved.low) & (natural <= self.moved.high)).all(axis=1)
            found = np.concatenate([found, x[inside]])
        return found[:count]

    def log_density(self, x: Float[np.ndarray, "m d"]) -> Float[np.ndarray, " m"]:
        """The log density at s ≥ 0, up to a constant: both sides of the fold."""
        mirrored = x * np.append(np.ones(len(self.centre) - 1), -1.0)
        return np.logaddexp(self._one_side(x), self._one_side(mirrored))

    def _one_side(self, x: np.ndarray) -> np.ndarray:
        distance = np.sum(((x - self.centre) @ self.whitening.T) ** 2, axis=1)
        return -0.5 * (HEAVY_TAIL + len(self.centre)) * np.log1p(distance / HEAVY_TAIL)


def heavy_tailed(fit: Fit) -> HeavyTailed:
    """The t distribution around a fit that is finite."""
    centre, covariance = gaussian(fit)
    factor = np.linalg.cholesky(covariance + 1e-12 * np.diag(np.diagonal(covariance)))
    return HeavyTailed(centre, factor, np.linalg.inv(factor), sampled(fit))


def independent_proposal(fit: Fit) -> Callable[[np.ndarray, Any], tuple[np.ndarray, np.ndarray]]:
    """Draws of `heavy_tailed` as emcee's Metropolis–Hastings move wants them, with their log density ratio."""
    around = heavy_tailed(fit)

    def propose(coordinates: np.ndarray, random: Any) -> tuple[np.ndarray, np.ndarray]:
        x = around.drawn(len(coordinates), random)
        return x, around.log_density(coordinates) - around.log_density(x)

    return propose


def _reweighted(fit: Fit, rng: np.random.Generator) -> tuple[np.ndarray | None, float]:
    """Resampled draws of the sampled coordinates (None where the weights are no good), and k̂ of the weights."""
    around, density = heavy_tailed(fit), log_posterior(fit)
    found, weight, k, effective = np.zeros((0, fit.coordinates.count + 2)), np.zeros(0), np.inf, 0.0
    for count in np.diff(PROPOSALS, prepend=0).tolist():
        proposed = around.drawn_inside(count, rng)
        logs = density(proposed) - around.log_density(proposed) if len(proposed) else np.zeros(0)
        found = np.concatenate([found, np.column_stack([proposed, logs])[np.isfinite(logs)]])
        if len(found) < FEWEST:
            continue
        weight, shape = smoothed(found[:, -1])
        k, effective = float(shape), 1.0 / np.sum(weight**2)
        if k <= GOOD_PARETO and effective >= ENOUGH:
            break
    if not (k <= GOOD_PARETO and effective >= FEWEST):
        return None, max(k, float(np.nextafter(GOOD_PARETO, 1.0)))
    # Systematic resampling: one random offset, so that a draw of weight w is taken w·m times, up or down to an integer.
    places = np.searchsorted(np.cumsum(weight), (np.arange(LAPLACE_DRAWS) + rng.uniform()) / LAPLACE_DRAWS)
    return rng.permutation(found[np.minimum(places, len(weight) - 1), :-1]), k


def _discrepancy_sd(fit: Fit) -> float:
    """Half of how far s must move from its best value for the log-likelihood to fall by 2.

    That is σ of a Gaussian, and also the mean of the exponential that s follows where its best value is 0.
    """
    if fit.discrepancy_sd is not None:
        return fit.discrepancy_sd
    unit = max(float(fit.data.typical), 1e-12)
    moves = np.sort(np.concatenate([unit * 2.0 ** np.arange(-12, 12), fit.discrepancy * 2.0 ** np.arange(-6, 2)]))
    moves = moves[moves > 0]
    moved = sampled(fit)
    natural = moved.natural(fit.values)
    along = moved.scaled(np.vstack([np.append(natural, fit.discrepancy + move) for move in (0.0, *moves)]))
    density = log_posterior(fit)(along)
    drop = density[0] - density[1:]
    crossing = np.flatnonzero(drop > 2.0)
    if len(crossing) == 0:
        return float(moves[-1])
    first = crossing[0]
    return float(moves[first] / np.sqrt(2.0 * drop[first]))
