"""Evidence: what a posterior predicts of each value from all the others, without fitting again.

It compares no models; `choice` does.
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat.fitting.likelihood import Data, log_pointwise, mapped
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import with_vector
from fitmat.uncertainty.posterior import GOOD_PARETO, Posterior

DRAWS = 1000
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


def weigh(posterior: Posterior) -> Evidence | None:
    """PSIS-LOO of a posterior (Vehtari, Gelman & Gabry 2017, eq. 10); None above `MOST_LEFT_OUT` values."""
    from arviz_stats.base.array import array_stats

    fit = posterior.fit
    used = np.asarray(fit.data.weight) > 0
    if int(used.sum()) > MOST_LEFT_OUT or fit.n_values > MOST_LEFT_OUT:
        return None
    values, s = posterior.thinned(DRAWS)
    logs = np.asarray(_pointwise(fit.model, fit.data, jnp.asarray(values), jnp.asarray(s)))[:, used]
    d = posterior.diagnostics
    independent = 1.0 if d is None else float(np.clip(np.nanmin(d.ess) / len(s), 0.01, 1.0))
    elpd, k, p_loo = array_stats.loo(logs.T[:, None, :], r_eff=independent)
    elpd, k = np.asarray(elpd), np.asarray(k)
    spread = float(np.sqrt(elpd.size) * elpd.std())
    return Evidence(float(elpd.sum()), spread, float(np.sum(p_loo)), float(np.mean(k > GOOD_PARETO)), elpd)


@eqx.filter_jit
def _pointwise(template: AbstractBRDF, data: Data, values: Array, s: Array) -> Array:
    """Log density of every value in sr⁻¹ under every draw, (d, n, c)."""

    def one(draw: tuple[Array, Array]) -> Array:
        return log_pointwise(with_vector(template, draw[0]), data, draw[1])

    return mapped(one, (values, s))  # pyright: ignore[reportArgumentType]
