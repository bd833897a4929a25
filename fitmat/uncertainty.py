"""How sure the data are: draws from the posterior, by Laplace's approximation or by emcee, and whether to trust them.

Priors are flat within the bounds: in the logarithm for parameters whose scale is log (alpha, exponent, eta, kappa,
f0), linearly for kd, ks and the discrepancy s ≥ 0. This is the only room that imports emcee.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat.brdf import AbstractBRDF
from fitmat.errors import FitmatError
from fitmat.fitting import Fit, inverse_information
from fitmat.likelihood import Data, log_likelihood, noise_scale
from fitmat.params import space, vector, with_vector

ENOUGH_TAU = 50
"""A chain of this many autocorrelation times is long enough (emcee's documentation)."""

ENOUGH_ESS = 400
"""Independent draws per parameter that are enough for a 95 % interval (Vehtari et al. 2021)."""

GOOD_RHAT = 1.05
"""Split-R̂ over walkers up to which the posterior counts as converged."""

CHUNK = 250
"""Steps between looks at the autocorrelation time."""

LAPLACE_DRAWS = 2000

Progress = Callable[[int, int], None]
"""Called with steps done and steps expected."""


@dataclasses.dataclass(frozen=True)
class Diagnostics:
    """How a chain went; arrays follow the sampled coordinates (free parameters, then s).

    Attributes:
        tau: Integrated autocorrelation time in steps.
        ess: Effective number of independent draws.
        rhat: Split-R̂ over walkers.
        acceptance: Accepted fraction of proposals.
        steps: Steps per walker, burn-in included.
        burn_in: Steps left out.
        walkers: Number of walkers.
        seed: What the run was started with.
        interrupted: True if stopped by the user.
    """

    tau: np.ndarray
    ess: np.ndarray
    rhat: np.ndarray
    acceptance: float
    steps: int
    burn_in: int
    walkers: int
    seed: int
    interrupted: bool


@dataclasses.dataclass(frozen=True, eq=False)
class Posterior:
    """Draws of a fit's parameters.

    Attributes:
        fit: What was sampled.
        method: "laplace" or "emcee".
        values: Physical parameter vectors, (m, p), fixed parameters included.
        discrepancy: s of each draw, (m,).
        chain: For emcee, the same before flattening, (steps, walkers, free + 1), physical; else None.
        diagnostics: For emcee; else None.
    """

    fit: Fit
    method: str
    values: Float[np.ndarray, "m p"]
    discrepancy: Float[np.ndarray, " m"]
    chain: np.ndarray | None = None
    diagnostics: Diagnostics | None = None

    @property
    def verdict(self) -> str:
        """"reliable", "tentative" or "unusable"; "not sampled" for Laplace."""
        if self.diagnostics is None:
            return "not sampled"
        d = self.diagnostics
        kept = d.steps - d.burn_in
        if not np.isfinite(d.tau).all() or kept < 10 * d.tau.max() or d.rhat.max() > 1.2:
            return "unusable"
        enough = kept >= ENOUGH_TAU * d.tau.max() and d.ess.min() >= ENOUGH_ESS and d.rhat.max() <= GOOD_RHAT
        return "reliable" if enough else "tentative"

    @property
    def usable(self) -> bool:
        """Whether intervals may be taken from these draws."""
        return self.verdict != "unusable"

    def sd(self) -> Float[np.ndarray, " p"]:
        """Standard deviation of each parameter."""
        return self.values.std(axis=0)

    def interval(self, level: float = 0.95) -> Float[np.ndarray, "p 2"]:
        """Central credible interval of each parameter."""
        return np.quantile(self.values, [(1 - level) / 2, (1 + level) / 2], axis=0).T

    def thinned(self, count: int) -> tuple[Float[np.ndarray, "k p"], Float[np.ndarray, " k"]]:
        """At most `count` draws spread evenly over the run: parameter vectors and discrepancies."""
        chosen = np.linspace(0, len(self.values) - 1, min(count, len(self.values))).astype(int)
        return self.values[chosen], self.discrepancy[chosen]

    def save(self, path: str | Path) -> None:
        """Write the draws as ArviZ netCDF (group `posterior`, dimensions chain = walker, draw = step)."""
        from arviz_base import from_dict

        chain = self.values[None] if self.chain is None else np.swapaxes(self.chain, 0, 1)
        variables: dict[str, np.ndarray] = {}
        free = [e for e in self.fit.entries if e.name not in self.fit.held]
        start = 0
        for entry in free:
            part = chain[..., start : start + entry.size] if self.chain is not None else chain[..., entry.place]
            variables[entry.name] = part if entry.shape else part[..., 0]
            start += entry.size
        variables["discrepancy"] = self.discrepancy[None] if self.chain is None else chain[..., -1]
        attributes: dict[str, Any] = {"model": self.fit.name, "method": self.method, "verdict": self.verdict}
        if self.diagnostics is not None:
            attributes |= {"seed": self.diagnostics.seed, "burn_in": self.diagnostics.burn_in}
        tree = from_dict({"posterior": variables}, attrs={"posterior": attributes})
        tree.to_netcdf(str(path), engine="h5netcdf")


def laplace(fit: Fit, *, seed: int) -> Posterior:
    """Draws from the Gaussian with the fit's covariance in natural coordinates, folded into the bounds.

    Args:
        fit: A fit with a finite optimum.
        seed: Seed of the draws.

    Raises:
        FitmatError: the fit is not finite.
    """
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

    rng = np.random.default_rng(seed)
    dimensions = len(fit.free) + 1
    walkers = walkers or max(32, 4 * dimensions)
    moves = [(emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)]
    sampler = emcee.EnsembleSampler(walkers, dimensions, log_posterior(fit), moves=moves, vectorize=True)
    random_state = np.random.RandomState(rng.integers(2**32)).get_state()  # noqa: NPY002 - emcee's own interface
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
    if sampler.iteration < 2:
        raise KeyboardInterrupt
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
        interrupted=interrupted,
    )
    return Posterior(fit, "emcee", values, discrepancy, physical.reshape(chain.shape), found)


def split_rhat(chain: Float[np.ndarray, "steps walkers d"]) -> Float[np.ndarray, " d"]:
    """Split-R̂ with every half of every walker as a chain (Gelman et al., Bayesian Data Analysis, sec. 11.4)."""
    half = len(chain) // 2
    parts = np.concatenate([chain[:half], chain[half : 2 * half]], axis=1)
    within = parts.var(axis=0, ddof=1).mean(axis=0)
    between = parts.mean(axis=0).var(axis=0, ddof=1)
    return np.sqrt((half - 1) / half + between / np.where(within > 0, within, np.nan))


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
    if not np.isfinite(fit.log_likelihood):
        raise FitmatError(f"{fit.name}: the fit ended {fit.result}, there is nothing to sample; check the data.")
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
