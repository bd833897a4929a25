"""Evidence: what a posterior predicts of each value from all the others, without fitting again.

It compares no models; `choice` does.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.fitting.likelihood import log_pointwise
from fitmat.judgement.prediction import predictions
from fitmat.text import brief
from fitmat.uncertainty.diagnostics import GOOD_PARETO
from fitmat.uncertainty.pareto import leave_one_out
from fitmat.uncertainty.posterior import Posterior

LEFT_OUT_DRAWS = 1000
"""Posterior draws behind the predictive densities."""

MOST_LEFT_OUT = 20_000
"""Values above which none is left out one by one: that needs draws × values numbers."""


@dataclasses.dataclass(frozen=True, eq=False)
class Evidence:
    """The predictive density of each value by the fit to all others, by importance sampling (PSIS-LOO).

    Attributes:
        elpd: Expected log predictive density of new values like these, nats.
        se: Its standard error.
        p_loo: Effective number of parameters.
        bad: Share of values with a Pareto k̂ above `GOOD_PARETO`, whose density is not reliable.
        pointwise: Of each value, (n,).
    """

    elpd: float
    se: float
    p_loo: float
    bad: float
    pointwise: Float[np.ndarray, " n"]

    __repr__ = brief


def weigh(posterior: Posterior) -> Evidence | None:
    """PSIS-LOO of a posterior (Vehtari, Gelman & Gabry 2017, eq. 10); None above `MOST_LEFT_OUT` values."""
    fit = posterior.fit
    used = np.asarray(fit.data.weight) > 0
    if int(used.sum()) > MOST_LEFT_OUT or fit.n_values > MOST_LEFT_OUT:
        return None
    draws, s = posterior.thinned(LEFT_OUT_DRAWS, widened=False)
    data, logs = fit.data, np.empty((len(s), int(used.sum())))
    for part, x, noise, spread in predictions(fit, draws, s):
        logs[part] = log_pointwise(x, noise, data, spread)[:, used]
    d = posterior.diagnostics
    independent = 1.0 if d is None else float(np.clip(np.nanmin(d.ess) / len(s), 0.01, 1.0))
    elpd, k, p_loo = leave_one_out(logs, independent)
    spread = float(np.sqrt(elpd.size) * elpd.std())
    return Evidence(float(elpd.sum()), spread, p_loo, float(np.mean(k > GOOD_PARETO)), elpd)
