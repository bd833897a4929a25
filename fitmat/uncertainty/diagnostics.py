"""Diagnostics: how a sampler went, and whether its draws may be trusted.

It draws nothing, and knows no parameter.
"""

import dataclasses

import numpy as np

from fitmat.text import brief

VERDICTS = {
    "reliable": "The walks are long enough and agree with each other.",
    "tentative": "The walks are short: the intervals may still move. Let them run longer.",
    "unusable": "There is nothing to take intervals from: the walks do not agree, or nothing finite was found.",
    "corrected": "Not sampled: draws around the best fit, weighted until they follow the posterior itself.",
    "approximate": "Not sampled: a Gaussian around the best fit, which the posterior does not follow well. "
    "Sample it before relying on the intervals.",
    "not sampled": "Not sampled: a Gaussian around the best fit.",
    "no posterior": "The loss is an objective, not a likelihood: there is a best fit and nothing around it.",
}
"""How far draws can be trusted, and what that means."""

ENOUGH_TAU = 50
"""A chain of this many autocorrelation times is long enough (emcee's documentation)."""

ENOUGH_ESS = 400
"""Independent draws per parameter that are enough for its mean (Vehtari et al. 2021)."""

ENOUGH_TAIL_ESS = 714
"""Independent draws behind each 95 % limit whose own standard error is then 0.1 sd, √(0.025 · 0.975/ESS)/φ(1.96)."""

GOOD_RHAT = 1.05
"""Split-R̂ over walkers up to which the posterior counts as converged."""

GOOD_PARETO = 0.7
"""Pareto k̂ of importance weights up to which their averages can be relied on (Vehtari et al. 2024, sec. 3)."""


@dataclasses.dataclass(frozen=True)
class Diagnostics:
    """How a chain went; arrays follow the sampled coordinates (free parameters, then s).

    Attributes:
        tau: Integrated autocorrelation time in steps.
        ess: Effective number of independent draws.
        tail_ess: The same behind the 95 % limits (`mixing.tail_ess`).
        rhat: Split-R̂ over walkers.
        acceptance: Accepted fraction of proposals.
        steps: Steps per walker, burn-in included.
        burn_in: Steps left out.
        walkers: Number of walkers.
        seed: What the run was started with.
    """

    tau: np.ndarray
    ess: np.ndarray
    tail_ess: np.ndarray
    rhat: np.ndarray
    acceptance: float
    steps: int
    burn_in: int
    walkers: int
    seed: int

    __repr__ = brief

    @property
    def verdict(self) -> str:
        """One of the first three keys of `VERDICTS`."""
        kept = self.steps - self.burn_in
        if not np.isfinite(self.tau).all() or kept < 10 * self.tau.max() or self.rhat.max() > 1.2:
            return "unusable"
        independent = self.ess.min() >= ENOUGH_ESS and self.tail_ess.min() >= ENOUGH_TAIL_ESS
        enough = independent and self.rhat.max() <= GOOD_RHAT and kept >= ENOUGH_TAU * self.tau.max()
        return "reliable" if enough else "tentative"
