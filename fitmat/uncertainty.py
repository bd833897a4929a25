"""How sure the data are: draws from the posterior, by Laplace's approximation or by emcee, and whether to trust them.

Priors are flat within the bounds: in the logarithm for parameters whose scale is log (alpha, exponent, eta, kappa,
f0), linearly for kd, ks and the discrepancy s ≥ 0; a shared scale g has ln g ~ N(0, calibration²). This is the only
room that imports emcee.
"""

import dataclasses
import importlib
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat import fitting
from fitmat.apparent import Apparent, apparent
from fitmat.brdf import AbstractBRDF
from fitmat.errors import FitmatError
from fitmat.information import inverse_information
from fitmat.likelihood import Data, log_density, mapped, noise_scale
from fitmat.measurement import Measurements
from fitmat.outcome import Fit
from fitmat.params import space, vector, with_vector
from fitmat.posterior import ENOUGH_ESS, ENOUGH_TAU, Diagnostics, Posterior, split_rhat

CHUNK = 50
"""Steps between looks at the autocorrelation time."""

SHORTEST = 250
"""Steps that every chain has, however short its autocorrelation time."""

HEAVY_TAIL = 6.0
"""Degrees of freedom of the t distribution that proposes draws of its own around the Laplace approximation."""

LAPLACE_DRAWS = 2000

Progress = Callable[[int, int], None]
"""Called with steps done and steps expected."""


def laplace(fit: Fit, *, seed: int) -> Posterior:
    """Draws from the Gaussian with the fit's covariance in natural coordinates, folded into the bounds.

    Args:
        fit: A fit with a finite optimum.
        seed: Seed of the draws.

    Returns:
        A `Posterior`; a fit that is not finite gives a single, unusable draw.
    """
    if not fit.finite:
        return Posterior(fit, "laplace", fit.values[None], np.array([fit.discrepancy]))
    values, discrepancy = _physical(fit, _laplace_draws(fit, LAPLACE_DRAWS, np.random.default_rng(seed)))
    return Posterior(fit, "laplace", values, discrepancy)


def laplace_each(measurements: Measurements, jobs: Mapping[str, Mapping[str, Any]], *, seed: int) -> list[Posterior]:
    """`fit` and `laplace` of several models, side by side in threads: most of a first fit is compilation.

    Args:
        measurements: From `fitmat.read`.
        jobs: Model name → keyword arguments of `fit`.
        seed: Of the draws.

    Raises:
        FitmatError: as `fit`, for the first model that cannot be fitted.
    """

    def one(name: str) -> Posterior:
        return laplace(fitting.fit(measurements, name, **jobs[name]), seed=seed)

    with ThreadPoolExecutor() as pool:
        pending = [pool.submit(one, name) for name in jobs]
        importlib.import_module("emcee")  # slow to load, and this thread has nothing else to do
        return [job.result() for job in pending]


def sample(
    fit: Fit,
    *,
    seed: int,
    walkers: int | None = None,
    max_steps: int = 8_000,
    progress: Progress | None = None,
) -> Posterior:
    """Sample the posterior with emcee until the autocorrelation time says enough.

    The ensemble starts from Laplace draws. A step proposes for every walker either an independent draw from a t
    distribution around the Laplace approximation (60 %), or a differential-evolution (30 %) or snooker (10 %) move,
    which need no such approximation; all walkers are evaluated in one compiled call. It stops at 50 autocorrelation
    times and 400 effective draws per parameter after a burn-in of 5 autocorrelation times, or at the cap.

    Args:
        fit: A fit with a finite optimum.
        seed: Seed of the whole run; the same seed gives the same chain.
        walkers: Size of the ensemble; default the larger of 32 and 4 per dimension.
        max_steps: Cap on steps per walker.
        progress: Called now and then with steps done and steps expected.

    Returns:
        A `Posterior`. An interrupt (Ctrl-C) ends the run and keeps what was done.

    Raises:
        FitmatError: the fit is not finite.
    """
    import emcee

    if not fit.finite:
        raise FitmatError(f"{fit.name}: the fit ended {fit.result}, there is nothing to sample; check the data.")
    rng = np.random.default_rng(seed)
    dimensions = len(fit.free) + 1
    walkers = walkers or default_walkers(fit)
    independent = emcee.moves.MHMove(_independent_proposal(fit))
    moves = [(independent, 0.6), (emcee.moves.DEMove(), 0.3), (emcee.moves.DESnookerMove(), 0.1)]
    density = log_posterior(fit, walkers)
    sampler: Any = emcee.EnsembleSampler(walkers, dimensions, density, moves=moves, vectorize=True)
    sampler.log_prob_fn = density  # emcee's wrapper prints a traceback to stdout on Ctrl-C
    random_state = np.random.RandomState(rng.integers(2**32)).get_state()
    state = emcee.State(_laplace_draws(fit, walkers, rng), random_state=random_state)
    goal, interrupted = SHORTEST, False
    try:
        while (done := sampler.iteration) < min(goal, max_steps):
            state = sampler.run_mcmc(state, min(CHUNK, max_steps - done), skip_initial_state_check=True)
            if sampler.iteration >= SHORTEST:
                goal = max(goal, _steps_needed(sampler, walkers))
            if progress is not None:
                progress(sampler.iteration, min(max(goal, sampler.iteration), max_steps))
    except KeyboardInterrupt:
        interrupted = True
    if sampler.iteration < 4:
        return dataclasses.replace(laplace(fit, seed=seed), interrupted=True)
    return _posterior(fit, sampler, seed, interrupted)


def _steps_needed(sampler: Any, walkers: int) -> int:
    tau = sampler.get_autocorr_time(tol=0)
    worst = float(np.nanmax(tau)) if np.isfinite(tau).any() else float(sampler.iteration)
    return int(np.ceil(worst * (5 + max(ENOUGH_TAU, ENOUGH_ESS / walkers)))) + 1


def _posterior(fit: Fit, sampler: Any, seed: int, interrupted: bool) -> Posterior:
    steps = sampler.iteration
    tau = sampler.get_autocorr_time(tol=0)
    finite = np.nanmax(tau) if np.isfinite(tau).any() else 0.0
    burn_in = int(min(np.ceil(5 * finite), steps // 2))
    chain = sampler.get_chain(discard=burn_in)
    kept, walkers, dimensions = chain.shape
    values, discrepancy = _physical(fit, chain.reshape(-1, dimensions))
    physical = np.concatenate([values[:, fit.free], discrepancy[:, None]], axis=1)
    found = Diagnostics(
        tau=tau,
        ess=kept * walkers / tau,
        rhat=split_rhat(chain),
        acceptance=float(np.mean(sampler.acceptance_fraction)),
        steps=steps,
        burn_in=burn_in,
        walkers=walkers,
        seed=seed,
    )
    return Posterior(fit, "emcee", values, discrepancy, physical.reshape(chain.shape), found, interrupted)


def default_walkers(fit: Fit) -> int:
    """The larger of 32 and four per sampled dimension."""
    return max(32, 4 * (len(fit.free) + 1))


def log_posterior(fit: Fit, batch: int = 1) -> Callable[[np.ndarray], np.ndarray]:
    """The log posterior density over (w, free + 1) sampled coordinates as one compiled call; −inf outside.

    Args:
        fit: What is sampled.
        batch: Smaller w are filled up to this many, so that one program serves whole and half ensembles.
    """
    free = tuple(int(k) for k in fit.free)
    arrays, static = eqx.partition((fit.model, fit.data), eqx.is_array)

    where = apparent(fit)

    def call(coordinates: np.ndarray) -> np.ndarray:
        filled = np.pad(coordinates, ((0, max(0, batch - len(coordinates))), (0, 0)), mode="edge")
        return np.asarray(_log_posterior(arrays, static, free, where, jnp.asarray(filled)))[: len(coordinates)]

    return call


@eqx.filter_jit
def _log_posterior(arrays: Any, static: Any, free: tuple[int, ...], where: Apparent, coordinates: Array) -> Array:
    template, data = eqx.combine(arrays, static)
    return mapped(lambda x: _log_density(template, data, free, where, x), coordinates)


def _log_density(template: AbstractBRDF, data: Data, free: tuple[int, ...], where: Apparent, x: Array) -> Array:
    whole, places = space(template), np.array(free, int)
    natural = where.natural(x)
    t, s = natural[:-1], natural[-1]
    inside = jnp.all((t >= whole.natural_lower[places]) & (t <= whole.natural_upper[places])) & (s >= 0.0)
    full = whole.natural(vector(template)).at[places].set(jnp.where(inside, t, whole.natural_lower[places]))
    value = log_density(with_vector(template, whole.physical(full)), data, jnp.abs(s))
    return jnp.where(inside & jnp.isfinite(value), value, -jnp.inf)


def _laplace_gaussian(fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of the sampled coordinates: the free natural ones, `apparent` weights, and s."""
    whole, free = space(fit.model), fit.free
    span = (whole.natural_upper - whole.natural_lower)[free]
    centre = np.append(whole.natural_array(fit.values)[free], fit.discrepancy)
    covariance = np.zeros((len(centre),) * 2)
    # The flat prior counts with the variance of its range: a direction that no datum determines is no wider than it.
    information = fit.information[np.ix_(free, free)] + np.diag(12.0 / span**2)
    covariance[:-1, :-1] = inverse_information(information, span)
    covariance[-1, -1] = _discrepancy_sd(fit) ** 2
    return apparent(fit).gaussian(centre, covariance)


def _laplace_draws(fit: Fit, count: int, rng: np.random.Generator) -> Float[np.ndarray, "count d"]:
    """Gaussian draws of the sampled coordinates, folded at the bounds of the parameters."""
    whole, free, where = space(fit.model), fit.free, apparent(fit)
    low, high = whole.natural_lower[free], whole.natural_upper[free]
    draws = where.natural_array(rng.multivariate_normal(*_laplace_gaussian(fit), size=count, method="eigh"))
    turn = (draws[:, :-1] - low) % (2 * (high - low))
    folded = low + np.where(turn > high - low, 2 * (high - low) - turn, turn)
    return where.sampled(np.column_stack([folded, np.abs(draws[:, -1])]))


def _independent_proposal(fit: Fit) -> Callable[[np.ndarray, Any], tuple[np.ndarray, np.ndarray]]:
    """Draws from a multivariate t around the Laplace approximation, s folded at 0, with their log density ratio."""
    centre, covariance = _laplace_gaussian(fit)
    factor = np.linalg.cholesky(covariance + 1e-12 * np.diag(np.diagonal(covariance)))
    whitening = np.linalg.inv(factor)
    flip = np.append(np.ones(len(centre) - 1), -1.0)

    def one_side(x: np.ndarray) -> np.ndarray:
        distance = np.sum(((x - centre) @ whitening.T) ** 2, axis=1)
        return -0.5 * (HEAVY_TAIL + len(centre)) * np.log1p(distance / HEAVY_TAIL)

    def log_density(x: np.ndarray) -> np.ndarray:
        return np.logaddexp(one_side(x), one_side(x * flip))

    def propose(coordinates: np.ndarray, random: Any) -> tuple[np.ndarray, np.ndarray]:
        stretch = np.sqrt(HEAVY_TAIL / random.chisquare(HEAVY_TAIL, size=len(coordinates)))
        drawn = centre + stretch[:, None] * (random.standard_normal(coordinates.shape) @ factor.T)
        drawn[:, -1] = np.abs(drawn[:, -1])
        return drawn, log_density(coordinates) - log_density(drawn)

    return propose


def _discrepancy_sd(fit: Fit) -> float:
    """Half of how far s must move from its best value for the log-likelihood to fall by 2.

    That is σ of a Gaussian, and also the mean of the exponential that s follows where its best value is 0.
    """
    if fit.discrepancy_sd is not None:
        return fit.discrepancy_sd
    unit = max(float(noise_scale(fit.data)), 1e-12)
    moves = np.sort(np.concatenate([unit * 2.0 ** np.arange(-12, 12), fit.discrepancy * 2.0 ** np.arange(-6, 2)]))
    moves = moves[moves > 0]
    natural = space(fit.model).natural_array(fit.values)[fit.free]
    along = apparent(fit).sampled(np.vstack([np.append(natural, fit.discrepancy + move) for move in (0.0, *moves)]))
    density = log_posterior(fit, default_walkers(fit))(along)
    drop = density[0] - density[1:]
    crossing = np.flatnonzero(drop > 2.0)
    if len(crossing) == 0:
        return float(moves[-1])
    first = crossing[0]
    return float(moves[first] / np.sqrt(2.0 * drop[first]))


def _physical(fit: Fit, coordinates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sampled coordinates (m, free + 1) to full physical vectors (m, p) and discrepancies (m,)."""
    whole, natural = space(fit.model), apparent(fit).natural_array(coordinates)
    full = np.tile(fit.values, (len(natural), 1))
    log = whole.log[fit.free]
    full[:, fit.free] = np.where(log, np.exp(np.where(log, natural[:, :-1], 0.0)), natural[:, :-1])
    return full, natural[:, -1]
