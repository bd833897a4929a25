"""Chains: draws from the posterior by emcee, until the autocorrelation time says that they are enough.

This is the only room that imports emcee.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from fitmat.approximation import draws, gaussian, laplace
from fitmat.density import default_walkers, log_posterior, physical
from fitmat.errors import FitmatError
from fitmat.outcome import Fit
from fitmat.posterior import ENOUGH_ESS, ENOUGH_TAU, Diagnostics, Posterior, split_rhat

CHUNK = 50
"""Steps between looks at the autocorrelation time."""

SHORTEST = 250
"""Steps that every chain has, however short its autocorrelation time."""

HEAVY_TAIL = 6.0
"""Degrees of freedom of the t distribution that proposes draws of its own around the Laplace approximation."""

Progress = Callable[[int, int], None]
"""Called with steps done and steps expected."""


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
    state = emcee.State(draws(fit, walkers, rng), random_state=random_state)
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
    values, discrepancy = physical(fit, chain.reshape(-1, dimensions))
    sampled = np.concatenate([values[:, fit.free], discrepancy[:, None]], axis=1)
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
    return Posterior(fit, "emcee", values, discrepancy, sampled.reshape(chain.shape), found, interrupted)


def _independent_proposal(fit: Fit) -> Callable[[np.ndarray, Any], tuple[np.ndarray, np.ndarray]]:
    """Draws from a multivariate t around the Laplace approximation, s folded at 0, with their log density ratio."""
    centre, covariance = gaussian(fit)
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
