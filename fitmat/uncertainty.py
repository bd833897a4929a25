"""How sure the data are: draws from the posterior, by Laplace's approximation or by emcee, and whether to trust them.

Priors are flat within the bounds: in the logarithm for parameters whose scale is log (alpha, exponent, eta, kappa,
f0), linearly for kd, ks and the discrepancy s ≥ 0. This is the only room that imports emcee.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat.brdf import AbstractBRDF
from fitmat.errors import FitmatError
from fitmat.likelihood import Data, log_likelihood, noise_scale
from fitmat.outcome import Fit, inverse_information
from fitmat.params import space, vector, with_vector
from fitmat.posterior import ENOUGH_ESS, ENOUGH_TAU, Diagnostics, Posterior, split_rhat

CHUNK = 250
"""Steps between looks at the autocorrelation time."""

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
    natural = _laplace_draws(fit, LAPLACE_DRAWS, np.random.default_rng(seed))
    values, discrepancy = _physical(fit, natural)
    return Posterior(fit, "laplace", values, discrepancy)


def sample(
    fit: Fit,
    *,
    seed: int,
    walkers: int | None = None,
    max_steps: int = 20_000,
    progress: Progress | None = None,
) -> Posterior:
    """Sample the posterior with emcee until the autocorrelation time says enough.

    The ensemble starts from the Laplace draws and moves by differential evolution (80 %) and snooker (20 %) moves;
    all walkers are evaluated in one compiled call. It stops at 50 autocorrelation times and 400 effective draws per
    parameter after a burn-in of 5 autocorrelation times, or at the cap.

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
    walkers = walkers or max(32, 4 * dimensions)
    moves = [(emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)]
    sampler = emcee.EnsembleSampler(walkers, dimensions, log_posterior(fit), moves=moves, vectorize=True)
    random_state = np.random.RandomState(rng.integers(2**32)).get_state()
    state = emcee.State(_laplace_draws(fit, walkers, rng), random_state=random_state)
    goal, interrupted = 2 * CHUNK, False
    try:
        while (done := sampler.iteration) < min(goal, max_steps):
            state = sampler.run_mcmc(state, min(CHUNK, max_steps - done), skip_initial_state_check=True)
            goal = _steps_needed(sampler, walkers)
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


def log_posterior(fit: Fit) -> Callable[[np.ndarray], np.ndarray]:
    """The log posterior density over (w, free + 1) natural coordinates as one compiled call; −inf outside."""
    free = tuple(int(k) for k in fit.free)
    arrays, static = eqx.partition((fit.model, fit.data), eqx.is_array)

    def call(coordinates: np.ndarray) -> np.ndarray:
        return np.asarray(_log_posterior(arrays, static, free, coordinates))

    return call


@eqx.filter_jit
def _log_posterior(arrays: Any, static: Any, free: tuple[int, ...], coordinates: Array) -> Array:
    template, data = eqx.combine(arrays, static)
    return jax.vmap(lambda x: _log_density(template, data, free, x))(coordinates)


def _log_density(template: AbstractBRDF, data: Data, free: tuple[int, ...], x: Array) -> Array:
    whole, places = space(template), np.array(free, int)
    t, s = x[:-1], x[-1]
    inside = jnp.all((t >= whole.natural_lower[places]) & (t <= whole.natural_upper[places])) & (s >= 0.0)
    full = whole.natural(vector(template)).at[places].set(jnp.where(inside, t, whole.natural_lower[places]))
    value = log_likelihood(with_vector(template, whole.physical(full)), data, jnp.abs(s))
    return jnp.where(inside & jnp.isfinite(value), value, -jnp.inf)


def _laplace_draws(fit: Fit, count: int, rng: np.random.Generator) -> Float[np.ndarray, "count d"]:
    """Gaussian draws of the free natural coordinates and s, folded at the bounds."""
    whole, free = space(fit.model), fit.free
    low, high = whole.natural_lower[free], whole.natural_upper[free]
    centre = np.asarray(whole.natural(vector(fit.model)))[free]
    covariance = inverse_information(fit.information[np.ix_(free, free)], high - low)
    draws = rng.multivariate_normal(centre, covariance, size=count, method="eigh")
    turn = (draws - low) % (2 * (high - low))
    folded = low + np.where(turn > high - low, 2 * (high - low) - turn, turn)
    s = np.abs(fit.discrepancy + _discrepancy_sd(fit) * rng.standard_normal(count))
    return np.column_stack([folded, s])


def _discrepancy_sd(fit: Fit) -> float:
    """How far s must move from its best value for the log-likelihood to fall by ½."""
    unit = max(float(noise_scale(fit.data)), 1e-12)
    moves = unit * 2.0 ** np.arange(-12, 12)
    if fit.discrepancy > 0:
        moves = np.concatenate([moves, fit.discrepancy * 2.0 ** np.arange(-8, 3)])
    moves.sort()
    drop = fit.log_likelihood - np.asarray(_over_discrepancy(fit.model, fit.data, fit.discrepancy + moves))
    crossing = np.flatnonzero(drop > 0.5)
    if len(crossing) == 0:
        return float(moves[-1])
    first = crossing[0]
    return float(moves[first] / np.sqrt(max(drop[first] / 0.5, 1.0)))


@eqx.filter_jit
def _over_discrepancy(model: AbstractBRDF, data: Data, s: Array) -> Array:
    return jax.lax.map(lambda value: log_likelihood(model, data, value), s)


def _physical(fit: Fit, natural: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sampled coordinates (m, free + 1) to full physical vectors (m, p) and discrepancies (m,)."""
    whole = space(fit.model)
    full = np.tile(fit.values, (len(natural), 1))
    log = whole.log[fit.free]
    full[:, fit.free] = np.where(log, np.exp(np.where(log, natural[:, :-1], 0.0)), natural[:, :-1])
    return full, natural[:, -1]
