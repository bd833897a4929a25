"""A second opinion on a posterior: the same density sampled by another method, Hamiltonian Monte Carlo without U-turns.

It replaces no chain and decides nothing: it says whether two samplers that share no move agree. The only room that
imports blackjax.
"""

import dataclasses
from types import ModuleType
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat import arguments
from fitmat.errors import FitmatError
from fitmat.extras import needed
from fitmat.fitting.coordinates import Coordinates
from fitmat.fitting.likelihood import Data
from fitmat.fitting.result import Fit
from fitmat.maths.mapping import mapped
from fitmat.models.base import AbstractBRDF
from fitmat.text import brief, html_table, text_table
from fitmat.uncertainty.density import log_density_at, physical
from fitmat.uncertainty.diagnostics import ENOUGH_ESS, GOOD_RHAT
from fitmat.uncertainty.laplace import draws
from fitmat.uncertainty.mixing import split_rhat
from fitmat.uncertainty.posterior import Posterior
from fitmat.uncertainty.scaled_weights import sampled

AGREEING = 4.0
"""Monte Carlo standard errors by which two numbers may differ by chance: 1 in 16,000 for a Gaussian."""

TAILS = (0.025, 0.975)
"""Probabilities of the two limits that are compared."""

INSIDE = 1e-3
"""Chains start at least this fraction of a parameter's range away from its bounds."""

DIVERGING = 0.01
"""Share of divergent steps (Betancourt 2017, sec. 6.2) from which the second sampler is not relied on."""


@dataclasses.dataclass(frozen=True, eq=False)
class Agreement:
    """One number that was sampled twice; arrays hold its mean and its lower and upper 95 % limit.

    Attributes:
        name: Of the parameter, with its channel.
        first: By the posterior's own chain, physical units, (3,).
        second: By NUTS, (3,).
        error: Monte Carlo standard errors of their differences, (3,).
        sd: Standard deviation of the parameter.
    """

    name: str
    first: Float[np.ndarray, "3"]
    second: Float[np.ndarray, "3"]
    error: Float[np.ndarray, "3"]
    sd: float

    __repr__ = brief

    @property
    def distance(self) -> Float[np.ndarray, "3"]:
        """The differences in Monte Carlo standard errors, (3,)."""
        return np.abs(self.first - self.second) / np.maximum(self.error, 1e-300)

    @property
    def agrees(self) -> bool:
        """Whether chance explains all three differences."""
        return bool((self.distance <= AGREEING).all())

    @property
    def words(self) -> str:
        """What differs most and by how much, or "agree"."""
        if self.agrees:
            return "agree"
        worst = int(np.argmax(self.distance))
        what = ("mean", "lower limit", "upper limit")[worst]
        apart = abs(self.first[worst] - self.second[worst]) / self.sd
        return f"disagree: the {what} differs by {apart:.2g} standard deviations"


@dataclasses.dataclass(frozen=True, eq=False)
class SecondOpinion:
    """What NUTS says of a posterior.

    Attributes:
        posterior: Which was checked.
        agreements: One for each free parameter and channel, s last.
        rhat: Largest rank-normalised split-R̂ of NUTS (Vehtari et al. 2021).
        ess: Smallest effective number of its draws, in the bulk or the tails.
        diverging: Share of its steps that diverged.
    """

    posterior: Posterior
    agreements: tuple[Agreement, ...]
    rhat: float
    ess: float
    diverging: float

    __repr__ = brief

    @property
    def verdict(self) -> str:
        """One of "agree", "disagree", and "unsure" where the second sampler did not converge."""
        if not (self.rhat <= GOOD_RHAT and self.ess >= ENOUGH_ESS and self.diverging <= DIVERGING):
            return "unsure"
        return "agree" if all(a.agrees for a in self.agreements) else "disagree"

    @property
    def words(self) -> str:
        """The verdict in a sentence or two."""
        name = self.posterior.fit.name
        if self.verdict == "unsure":
            return (
                f"{name}: no second opinion, the second sampler did not converge (R̂ {self.rhat:.2f}, "
                f"{self.ess:.0f} effective draws, {100 * self.diverging:.1f} % divergent)."
            )
        if self.verdict == "agree":
            return f"{name}: two samplers that share no move agree on all means and 95 % limits."
        apart = "; ".join(f"{a.name}: {a.words}" for a in self.agreements if not a.agrees)
        return f"{name}: two samplers do not agree ({apart}). Run the chains longer before relying on the intervals."

    def _rows(self) -> list[tuple[str, ...]]:
        return [
            (a.name, *(f"{x:.4g} / {y:.4g}" for x, y in zip(a.first, a.second, strict=True)), a.words)
            for a in self.agreements
        ]

    def __str__(self) -> str:
        """The verdict, then each mean and limit by both samplers."""
        return text_table(self.words, self._rows())

    def _repr_html_(self) -> str:
        return html_table(self.words, ("parameter", "mean", "2.5 %", "97.5 %", "verdict"), self._rows())


def require() -> ModuleType:
    """The package blackjax; asked for before anything is fitted that it shall check.

    Raises:
        FitmatError: it is missing, or what tells how far its chains can be trusted; names the command that installs it.
    """
    needed("arviz_stats", "checking a posterior with NUTS")
    return needed("blackjax", "checking a posterior with NUTS")


def check_posterior(
    posterior: Posterior, *, seed: int, chains: int = 4, warmup: int = 500, count: int = 1000
) -> SecondOpinion:
    """Sample a posterior again by NUTS (Hoffman & Gelman, JMLR 15, 2014) and compare.

    The density is the one that was sampled, in unbounded coordinates: u = logit of where a natural coordinate lies
    between its bounds, and ln s, with the logarithm of the Jacobian. Step size and a dense mass matrix are adapted in
    windows as in Stan. Errors are Monte Carlo standard errors of means and quantiles (Vehtari, Gelman, Simpson,
    Carpenter & Bürkner 2021, Bayesian Analysis 16), walkers counting as chains.

    Args:
        posterior: From `chains.sample`.
        seed: Of starts and moves.
        chains: Chains of NUTS, each from a draw of Laplace's approximation.
        warmup: Steps of each that adapt and are left out.
        count: Draws of each that are kept.

    Raises:
        FitmatError: the posterior holds no chain, or blackjax is missing.
    """
    arguments.kind("posterior", posterior, Posterior)
    for name, number, least in (("seed", seed, 0), ("chains", chains, 2), ("warmup", warmup, 1), ("count", count, 4)):
        arguments.whole(name, number, least)
    require()
    if posterior.chain is None:
        raise FitmatError(
            f"{posterior.fit.name}: was not sampled, so that there is no chain to check; sample it first."
        )
    found, diverged = _sampled(posterior.fit, seed, chains, warmup, count)
    return compare_chains(posterior, found, diverging=float(np.mean(diverged)))


def compare_chains(
    posterior: Posterior, other: Float[np.ndarray, "chains draws d"], *, diverging: float = 0.0
) -> SecondOpinion:
    """Means and limits of a sampled posterior beside those of other chains of free parameters and s, physical.

    Raises:
        FitmatError: the posterior holds no chain.
    """
    if posterior.chain is None:
        raise FitmatError(f"{posterior.fit.name}: was not sampled, so that there is no chain to compare.")
    own = np.swapaxes(posterior.chain, 0, 1)
    agreements = []
    for k, name in enumerate(_names(posterior.fit)):
        (first, one), (second, two) = (_summary(part[..., k]) for part in (own, other))
        agreements.append(Agreement(name, first, second, np.hypot(one, two), float(own[..., k].std())))
    parts = [other[..., k] for k in range(len(agreements))]
    return SecondOpinion(
        posterior,
        tuple(agreements),
        rhat=float(split_rhat(np.swapaxes(other, 0, 1)[..., : len(agreements)]).max()),
        ess=min(float(np.min(_effective(part))) for part in parts),
        diverging=diverging,
    )


def _effective(chains: Float[np.ndarray, "chains draws"]) -> np.ndarray:
    """Effective draws in the bulk, and for the limits."""
    from arviz_stats.base.array import array_stats

    return np.array([array_stats.ess(chains), array_stats.ess(chains, method="tail", prob=TAILS)], float)


def _summary(chains: Float[np.ndarray, "chains draws"]) -> tuple[np.ndarray, np.ndarray]:
    """Mean and both limits, (3,), and their Monte Carlo standard errors, (3,)."""
    from arviz_stats.base.array import array_stats

    errors = [array_stats.mcse(chains, method="mean")]
    errors += [array_stats.mcse(chains, method="quantile", prob=tail) for tail in TAILS]
    return np.append(chains.mean(), np.quantile(chains, TAILS)), np.array(errors, float)


def _names(fit: Fit) -> list[str]:
    """Of the free parameters, with their channels, then of s where it is inferred."""
    return [*fit.coordinates.names, *(["discrepancy"] if fit.loss.infers_discrepancy else [])]


def _sampled(fit: Fit, seed: int, chains: int, warmup: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Chains of free parameters and s, physical, (chains, count, free + 1), and which steps diverged."""
    rng = np.random.default_rng(seed)
    moved = sampled(fit)
    low, high = moved.low, moved.high
    start = moved.unscaled(draws(fit, chains, rng))
    inside = np.clip((start[:, :-1] - low) / (high - low), INSIDE, 1.0 - INSIDE)
    least = 1e-3 * max(float(np.median(start[:, -1])), 1e-12)
    begin = np.column_stack([np.log(inside / (1.0 - inside)), np.log(np.maximum(start[:, -1], least))])
    keys = jax.random.split(jax.random.key(int(rng.integers(2**31))), chains)
    x, diverged = _chains(fit.model, fit.data, moved, (keys, jnp.asarray(begin)), (warmup, count))
    x = np.asarray(x)
    values, s = physical(fit, x.reshape(-1, x.shape[-1]))
    return np.column_stack([values[:, fit.free], s]).reshape(x.shape), np.asarray(diverged)


@eqx.filter_jit
def _chains(
    template: AbstractBRDF,
    data: Data,
    moved: Coordinates,
    begin: tuple[Array, Array],
    steps: tuple[int, int],
) -> tuple[Array, Array]:
    """NUTS from several starts: sampled coordinates, (chains, draws, d), and whether each step diverged."""
    blackjax = require()
    low, high = jnp.asarray(moved.low), jnp.asarray(moved.high)

    def placed(u: Array) -> tuple[Array, Array]:
        """The sampled coordinates of u, and ln |∂x/∂u|."""
        t = low + (high - low) * jax.nn.sigmoid(u[:-1])
        jacobian = jnp.sum(jnp.log(high - low) + jax.nn.log_sigmoid(u[:-1]) + jax.nn.log_sigmoid(-u[:-1])) + u[-1]
        x = jnp.append(t, jnp.exp(u[-1]))
        return moved.scaled(x), jacobian + len(moved.weights) * x[moved.scale]

    def target(u: Array) -> Array:
        x, jacobian = placed(u)
        return log_density_at(template, data, moved, x) + jacobian

    def one(chain: tuple[Array, Array]) -> tuple[Array, Array]:
        first, second = jax.random.split(chain[0])
        adaptation = blackjax.window_adaptation(blackjax.nuts, target, is_mass_matrix_diagonal=False)
        (state, parameters), _ = adaptation.run(first, chain[1], num_steps=steps[0])
        kernel = blackjax.nuts(target, **parameters)

        def step(state: Any, key: Array) -> tuple[Any, tuple[Array, Array]]:
            info: Any
            state, info = kernel.step(key, state)
            return state, (placed(state.position)[0], info.is_divergent)

        return jax.lax.scan(step, state, jax.random.split(second, steps[1]))[1]

    return mapped(one, begin)  # pyright: ignore[reportArgumentType]
