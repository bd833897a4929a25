"""Calibration of the inference by simulation: are 95 % intervals right 95 times in 100?

Talts, Betancourt, Simpson, Vehtari & Gelman, "Validating Bayesian Inference Algorithms with Simulation-Based
Calibration", arXiv:1804.06788 (2018): where truths are drawn from the prior and data from the likelihood, the rank of
the truth among posterior draws is uniform, whatever the data. It judges the program, not a model: whether real
materials obey the model is another question.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from jaxtyping import ArrayLike, Bool, Float, Int

from fitmat import arguments
from fitmat._types import Progress
from fitmat.errors import FitmatError
from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.fitting import fit
from fitmat.fitting.likelihood import log_pointwise
from fitmat.fitting.priors import DISCREPANCY, draw, prepare_prior
from fitmat.fitting.result import Fit
from fitmat.judgement.multiplicity import adjusted_for_many
from fitmat.judgement.prediction import predictions, replicated
from fitmat.judgement.uniformity import p_values
from fitmat.measurements.instrument import IDEAL
from fitmat.measurements.samples import Measurements
from fitmat.models.base import AbstractBRDF, evaluate
from fitmat.models.parameters import entries, vector, with_vector
from fitmat.models.registry import model
from fitmat.models.values import values
from fitmat.text import brief
from fitmat.uncertainty.chains import sample
from fitmat.uncertainty.laplace import laplace
from fitmat.uncertainty.posterior import Posterior

RANKED_DRAWS = 99
"""L, draws among which the truth is ranked: far fewer than a posterior's effective ones, so hardly dependent."""

LEVELS = (0.5, 0.68, 0.95)
"""Credible intervals whose coverage is counted."""

FAMILY = 0.05
"""Probability that a right program fails in any of the quantities of one calibration (Holm 1979)."""

LOG_LIKELIHOOD = "log-likelihood"
"""A quantity beside the parameters; it notices what ranks of single parameters cannot (Modrák et al. 2023)."""

Priors = Mapping[str, tuple[ArrayLike, ArrayLike]]


@dataclasses.dataclass(frozen=True, eq=False)
class Calibration:
    """Where the truths of n simulations lay in their posteriors.

    Attributes:
        model: The model's name.
        method: "laplace" or "emcee".
        quantities: Names of the free parameters, `DISCREPANCY` and `LOG_LIKELIHOOD`, (q,).
        ranks: How many of `RANKED_DRAWS` posterior draws lie below the truth, (n, q).
        covered: Whether the central interval of each of `LEVELS` holds the truth, (n, levels, q − 1); a log-likelihood
            has none.
        trusted: Whether the posterior itself says that its draws follow the density, (n,). It says so from the data
            alone, so that the ranks of those are uniform, too; only they are judged.
    """

    model: str
    method: str
    quantities: tuple[str, ...]
    ranks: Int[np.ndarray, "n q"]
    covered: Bool[np.ndarray, "n levels q-1"]
    trusted: Bool[np.ndarray, " n"]

    __repr__ = brief

    def coverage(self) -> Float[np.ndarray, "levels q-1"]:
        """Fraction of trusted posteriors whose interval holds the truth."""
        return self.covered[self.trusted].mean(axis=0)

    def p_values(self) -> Float[np.ndarray, " q"]:
        """Of the uniformity of the ranks of each quantity (`uniformity.p_values`)."""
        return p_values(self.ranks[self.trusted], RANKED_DRAWS)

    def faults(self, family: float = FAMILY) -> tuple[str, ...]:
        """Quantities whose ranks are not uniform, a right program having any with probability `family` at most."""
        p = self.p_values()
        return tuple(self.quantities[k] for k in np.argsort(p) if adjusted_for_many(p)[k] <= family)

    @property
    def words(self) -> str:
        """What came out, in sentences."""
        count, smallest = int(self.trusted.sum()), float(self.p_values().min())
        if faults := self.faults():
            told = f"NOT calibrated: the posterior is wrong in {', '.join(faults)}"
        else:
            told = "the intervals are as sure as they say, as far as so many simulations can tell"
        share = ", ".join(
            f"{100 * part:.0f} % in {100 * low:.1f} – {100 * high:.1f} %"
            for part, low, high in zip(LEVELS, self.coverage().min(axis=1), self.coverage().max(axis=1), strict=True)
        )
        return (
            f"{self.model}, {self.method}: {told}. Intervals of {share} of {count} simulations held the truth; "
            f"smallest p of {len(self.quantities)} tests of uniformity {smallest:.2g}, family-wise level {FAMILY:g}; "
            f"{len(self.trusted) - count} posteriors that do not trust themselves left out."
        )


def coverage_limits(count: int, hits: int) -> tuple[float, float]:
    """95 % limits of the coverage of which `hits` of `count` were found (Clopper & Pearson 1934)."""
    from scipy.stats import binomtest

    found = binomtest(hits, count).proportion_ci(0.95, method="exact")
    return float(found.low), float(found.high)


def calibrate(
    name: str,
    geometry: Measurements,
    noise: tuple[float, float],
    priors: Priors,
    *,
    simulations: int,
    seed: int,
    method: Literal["laplace", "emcee"] = "laplace",
    told: float = 1.0,
    progress: Progress | None = None,
) -> Calibration:
    """Simulate truths and data, fit them, and rank the truths among posterior draws.

    Args:
        name: Model name.
        geometry: Where to measure; its values do not count.
        noise: Fraction of the value that the prior's centre has, and floor in sr⁻¹. σ is the same for all truths: if
            it followed each, it would tell of the truth what no likelihood uses.
        priors: As for `fit`; of the discrepancy as well.
        simulations: n.
        seed: Of everything.
        method: How posteriors are drawn: `laplace`, corrected, or `sample`.
        told: Multiple of the true σ that the fit is told; anything but 1 is a planted fault.
        progress: Called with simulations done and n.

    Returns:
        A `Calibration`.

    Raises:
        FitmatError: the discrepancy has no prior, or a fit is not finite.
    """
    arguments.kind("geometry", geometry, Measurements)
    arguments.kind("priors", priors, Mapping)
    arguments.named(priors=priors)
    arguments.whole("simulations", simulations, 1)
    arguments.whole("seed", seed)
    arguments.choice("method", method, ("laplace", "emcee"))
    arguments.function("progress", progress)
    _refuse_noise(noise, told)
    rng = np.random.default_rng(seed)
    flat = model(name, channels=len(geometry.channels))
    prior, template = prepare_prior(flat, IDEAL, priors), _centre(flat, priors)
    sigma = np.hypot(noise[1], noise[0] * evaluate(template, geometry.wi, geometry.wo))
    truths, s = draw(template, prior, coordinates(template).index, simulations, rng)
    kappa, normal = geometry.wi[:, 2:3], rng.normal(size=(simulations, *sigma.shape))
    exact = values(template, truths, geometry.wi, geometry.wo) * kappa
    measured = replicated(exact, sigma * kappa, s[:, None, None], normal) / kappa
    plan = dataclasses.replace(
        geometry, sigma=told * sigma, valid=np.ones(sigma.shape, bool), source=f"simulated {name}", instrument=IDEAL
    )
    found = []
    for k in range(simulations):
        fitted = fit(dataclasses.replace(plan, value=measured[k]), name, priors=priors)
        if not fitted.finite:
            raise FitmatError(f"simulation {k} of {name}: the fit ended {fitted.result}.")
        number = int(rng.integers(2**31))
        posterior = sample(fitted, seed=number) if method == "emcee" else laplace(fitted, seed=number)
        found.append(_placed(posterior, truths[k], s[k]))
        if progress is not None:
            progress(f"calibrating {name}", k + 1, simulations)
    ranks, covered, trusted = (np.stack(part) for part in zip(*found, strict=True))
    return Calibration(name, method, _quantities(template), ranks, covered, trusted)


def _refuse_noise(noise: object, told: object) -> None:
    if arguments.numbers("noise", noise, 0.0).shape != (2,):
        arguments.refuse("noise", noise, "two numbers: a fraction, and a floor in sr⁻¹")
    arguments.numbers("told", told, 0.0, single=True)


def join(parts: Sequence[Calibration]) -> Calibration:
    """Calibrations of one model and method as one: ranks are uniform whatever the geometry and the noise."""
    ranks, covered, trusted = (
        np.concatenate([getattr(part, field) for part in parts]) for field in ("ranks", "covered", "trusted")
    )
    return dataclasses.replace(parts[0], ranks=ranks, covered=covered, trusted=trusted)


def _centre(template: AbstractBRDF, priors: Priors) -> AbstractBRDF:
    """The model at the centre of the priors."""
    values = np.array(vector(template))
    for entry in entries(template):
        if entry.name in priors:
            values[entry.place] = priors[entry.name][0]
    return with_vector(template, values)


def _quantities(template: AbstractBRDF) -> tuple[str, ...]:
    names = [e.name if e.size == 1 else f"{e.name} {k + 1}" for e in entries(template) for k in range(e.size)]
    return (*names, DISCREPANCY, LOG_LIKELIHOOD)


def _placed(posterior: Posterior, truth: np.ndarray, s: float) -> tuple[np.ndarray, np.ndarray, np.bool_]:
    """Ranks (q,), coverage (levels, q − 1) and trust of one posterior."""
    every = np.column_stack([posterior.values, posterior.discrepancy])
    few, true = np.column_stack(posterior.thinned(RANKED_DRAWS)), np.append(truth, s)
    likelihood = _log_likelihoods(posterior.fit, np.vstack([true, few]))
    below = np.append((few < true).sum(axis=0), (likelihood[1:] < likelihood[0]).sum())
    ends = [np.quantile(every, [(1 - level) / 2, (1 + level) / 2], axis=0) for level in LEVELS]
    return below, np.stack([(low <= true) & (true <= high) for low, high in ends]), np.bool_(posterior.exact)


def _log_likelihoods(fit: Fit, points: np.ndarray) -> Float[np.ndarray, " m"]:
    data, found = fit.data, np.empty(len(points))
    for part, x, noise, spread in predictions(fit, points[:, :-1], points[:, -1]):
        found[part] = (data.weight * log_pointwise(x, noise, data, spread)).sum(axis=(1, 2))
    return found
