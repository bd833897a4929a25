"""Chains: draws from the posterior by emcee, until the autocorrelation time says that they are enough.

This is the only room that imports emcee.
"""

import dataclasses
import importlib
import importlib.metadata
import sys
import types
from pathlib import Path
from typing import Any

import jax
import numpy as np

from fitmat import arguments
from fitmat._types import SAMPLING, Progress
from fitmat.errors import FitmatError, OutputError
from fitmat.fitting.result import Fit
from fitmat.uncertainty.checkpoint import Checkpoint, Saved, digest
from fitmat.uncertainty.density import log_posterior, physical
from fitmat.uncertainty.diagnostics import ENOUGH_ESS, ENOUGH_TAIL_ESS, ENOUGH_TAU, Diagnostics
from fitmat.uncertainty.laplace import draws, independent_proposal, laplace
from fitmat.uncertainty.mixing import split_rhat, tail_ess
from fitmat.uncertainty.posterior import Posterior

WALKERS = 40
"""Of the ensemble; four for each dimension where there are more than ten."""

CHUNK = 50
"""Most steps between looks at the autocorrelation time."""

SHORTEST = 150
"""Steps that every chain has, however short its autocorrelation time."""

MAX_STEPS = 8_000
"""Cap on the steps of every walker."""

SAMPLED_BY = ("fitmat", "emcee", "numpy", "jax", "jaxlib")
"""Whose versions decide the last digit of a chain."""


def sample(
    fit: Fit,
    *,
    seed: int,
    walkers: int | None = None,
    max_steps: int = MAX_STEPS,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
) -> Posterior:
    """Sample the posterior with emcee until the autocorrelation time says enough.

    The ensemble starts from Laplace draws. A step proposes for every walker either an independent draw from a t
    distribution around the Laplace approximation (60 %), or a differential-evolution (30 %) or snooker (10 %) move,
    which need no such approximation; all walkers are evaluated in one compiled call. It stops at 50 autocorrelation
    times, 400 effective draws per parameter and 714 behind its limits after a burn-in of 5 autocorrelation times, or
    at the cap.

    Args:
        fit: A fit with a finite optimum.
        seed: Seed of the whole run; the same seed gives the same chain.
        walkers: Size of the ensemble; default the larger of `WALKERS` and 4 per dimension.
        max_steps: Cap on steps per walker.
        progress: Called now and then with steps done and expected.
        checkpoint: Folder in which the run is kept while it lasts, and from which the same run goes on after it was
            killed, to the same chain; damaged parts of it are left out with a warning. Remove it when it has served.

    Returns:
        A `Posterior`. An interrupt (Ctrl-C) ends the run and keeps what was done.

    Raises:
        FitmatError: the fit is not finite, or the folder holds checkpoints of another run.
        OutputError: the folder cannot be made.
    """
    arguments.kind("fit", fit, Fit)
    arguments.whole("seed", seed)
    arguments.whole("walkers", walkers, 1, optional=True)
    arguments.whole("max_steps", max_steps, 1)
    arguments.function("progress", progress)
    arguments.kind("checkpoint", checkpoint, Path, optional=True)
    sampler, state = _ensemble(fit, seed, walkers)
    kept, goal = None, SHORTEST
    if checkpoint is not None:
        kept = Checkpoint(checkpoint, _run(fit, state, seed, max_steps))
        state, goal = (state, goal) if kept.saved is None else (_resumed(sampler, kept.saved), kept.saved.goal)
    interrupted = False
    try:
        while (done := sampler.iteration) < min(goal, max_steps):
            state = sampler.run_mcmc(state, min(CHUNK, min(goal, max_steps) - done), skip_initial_state_check=True)
            if sampler.iteration >= SHORTEST:
                goal = max(goal, _steps_needed(sampler))
            if kept is not None:
                kept.write(sampler.backend, goal, finished=sampler.iteration >= min(goal, max_steps))
            if progress is not None:
                progress(f"{SAMPLING} {fit.name}", sampler.iteration, min(max(goal, sampler.iteration), max_steps))
    except KeyboardInterrupt:
        interrupted = True
    if sampler.iteration < 4:
        return dataclasses.replace(laplace(fit, seed=seed), interrupted=True)
    return _posterior(fit, sampler, seed, interrupted)


def resumable_steps(
    fit: Fit, *, seed: int, checkpoint: Path, walkers: int | None = None, max_steps: int = MAX_STEPS
) -> int:
    """The step from which `sample` with the same arguments would go on; 0 where nothing of this run is kept.

    Raises:
        FitmatError: the fit is not finite.
        OutputError: the folder cannot be made or read.
    """
    _, state = _ensemble(fit, seed, walkers)
    run = _run(fit, state, seed, max_steps)
    try:
        saved = Checkpoint(checkpoint, run).saved
    except OutputError:
        raise
    except FitmatError:
        return 0
    return 0 if saved is None else len(saved.chain)


def _emcee() -> Any:
    """emcee, without `scipy.stats`, which takes it a second to load for a move that is not used here.

    The move stays usable: what it needs of scipy is loaded when it is called.
    """
    if "emcee" not in sys.modules and "scipy.stats" not in sys.modules:
        later = types.ModuleType("scipy.stats")
        later.__dict__["gaussian_kde"] = lambda *args: importlib.import_module("scipy.stats").gaussian_kde(*args)
        sys.modules["scipy.stats"] = later
        try:
            return importlib.import_module("emcee")
        finally:
            del sys.modules["scipy.stats"]
    return importlib.import_module("emcee")


def _ensemble(fit: Fit, seed: int, walkers: int | None) -> tuple[Any, Any]:
    """The sampler, and the state in which a run begins."""
    emcee = _emcee()
    if not fit.finite:
        raise FitmatError(f"{fit.name}: the fit ended {fit.result}, there is nothing to sample; check the data.")
    if not fit.loss.posterior:
        raise FitmatError(
            f"{fit.name}: the loss {fit.loss.name} is an objective, not a likelihood, and has no posterior to sample; "
            "fit under --loss default."
        )
    rng = np.random.default_rng(seed)
    walkers = walkers or max(WALKERS, 4 * (len(fit.free) + 1))
    independent = emcee.moves.MHMove(independent_proposal(fit))
    moves = [(independent, 0.6), (emcee.moves.DEMove(), 0.3), (emcee.moves.DESnookerMove(), 0.1)]
    density = log_posterior(fit)
    sampler: Any = emcee.EnsembleSampler(walkers, len(fit.free) + 1, density, moves=moves, vectorize=True)
    sampler.log_prob_fn = density  # emcee's wrapper prints a traceback to stdout on Ctrl-C
    random_state = np.random.RandomState(rng.integers(2**32)).get_state()
    return sampler, emcee.State(draws(fit, walkers, rng), random_state=random_state)


def _run(fit: Fit, state: Any, seed: int, max_steps: int) -> bytes:
    """Digest of all that decides a chain: its beginning, the density there, model, data, loss, seed and versions."""
    versions = [f"{name} {importlib.metadata.version(name)}" for name in SAMPLED_BY]
    density = log_posterior(fit)(state.coords)
    words = ", ".join(
        [fit.name, fit.loss.name, f"seed {seed}", f"at most {max_steps} steps", *sorted(fit.held), *versions]
    )
    leaves = [np.asarray(leaf) for leaf in jax.tree.leaves((fit.model, fit.data))]
    return digest(words, [state.coords, density, state.random_state[1], *leaves])


def _resumed(sampler: Any, saved: Saved) -> Any:
    """The state in which a run goes on, its past given back to the sampler."""
    emcee = _emcee()
    past = sampler.backend
    past.chain, past.log_prob, past.accepted = saved.chain, saved.log_prob, saved.accepted
    past.iteration, past.random_state = len(saved.chain), saved.random_state
    return emcee.State(saved.chain[-1], log_prob=saved.log_prob[-1], random_state=saved.random_state)


def _steps_needed(sampler: Any) -> int:
    tau = sampler.get_autocorr_time(tol=0)
    worst = float(np.nanmax(tau)) if np.isfinite(tau).any() else float(sampler.iteration)
    burn_in = 5.0 * worst
    kept = sampler.get_chain(discard=int(min(np.ceil(burn_in), sampler.iteration // 2)))
    behind = float(np.nan_to_num(tail_ess(kept), nan=np.inf).min())  # NaN where nothing moved, which R̂ says
    needed = max(ENOUGH_TAU * worst, ENOUGH_ESS / sampler.nwalkers * worst, ENOUGH_TAIL_ESS / behind * len(kept))
    return int(np.ceil(burn_in + needed)) + 1


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
        tail_ess=tail_ess(chain),
        rhat=split_rhat(chain),
        acceptance=float(np.mean(sampler.acceptance_fraction)),
        steps=steps,
        burn_in=burn_in,
        walkers=walkers,
        seed=seed,
    )
    return Posterior(fit, "emcee", values, discrepancy, sampled.reshape(chain.shape), found, interrupted)
