"""The posterior density over the coordinates that are sampled, and the way back to physical parameters.

Sampled are the natural coordinates that were fitted (see `scaled_weights`) and, last, the discrepancy s, which is inert
under a loss that infers none. The priors are those of `priors`. Nothing is drawn here.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from fitmat.fitting.coordinates import Coordinates
from fitmat.fitting.likelihood import Data, log_density, mapped, noise_scale
from fitmat.fitting.result import Fit
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import vector
from fitmat.uncertainty.scaled_weights import sampled


def default_walkers(fit: Fit) -> int:
    """The larger of 32 and four per sampled dimension."""
    return max(32, 4 * (len(fit.free) + 1))


def log_posterior(fit: Fit, batch: int = 1) -> Callable[[np.ndarray], np.ndarray]:
    """The log posterior density over (w, free + 1) sampled coordinates as one compiled call; −inf outside.

    Args:
        fit: What is sampled.
        batch: Smaller w are filled up to this many, so that one program serves whole and half ensembles.
    """
    arrays, static = eqx.partition((fit.model, fit.data), eqx.is_array)
    moved = sampled(fit)

    def call(coordinates: np.ndarray) -> np.ndarray:
        filled = np.pad(coordinates, ((0, max(0, batch - len(coordinates))), (0, 0)), mode="edge")
        return np.asarray(_log_posterior(arrays, static, moved, jnp.asarray(filled)))[: len(coordinates)]

    return call


@eqx.filter_jit
def _log_posterior(arrays: Any, static: Any, moved: Coordinates, coordinates: Array) -> Array:
    template, data = eqx.combine(arrays, static)
    return mapped(lambda x: log_density_at(template, data, moved, x), coordinates)


def log_density_at(template: AbstractBRDF, data: Data, moved: Coordinates, x: Array) -> Array:
    """The log posterior density at one point of the sampled coordinates, traceable by JAX; −inf outside.

    Args:
        template: The fit's model, which holds what is fixed.
        data: The samples.
        moved: What is sampled, from `scaled_weights.sampled`.
        x: The point, (free + 1,), s last.
    """
    natural = moved.unscaled(x)
    t, s = natural[:-1], natural[-1]
    inside = jnp.all((t >= moved.low) & (t <= moved.high)) & (s >= 0.0)
    here = moved.model(template, vector(template), jnp.where(inside, t, moved.low))
    inert = jnp.zeros(()) if data.loss.infers_discrepancy else 0.5 * (s / noise_scale(data)) ** 2
    value = log_density(here, data, _inferred(data, jnp.abs(s))) - inert
    return jnp.where(inside & jnp.isfinite(value), value, -jnp.inf)


def physical(fit: Fit, coordinates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sampled coordinates (m, free + 1) to full physical vectors (m, p) and discrepancies (m,)."""
    moved = sampled(fit)
    natural = moved.unscaled(coordinates)
    return moved.filled(fit.values, natural[:, :-1]), _inferred(fit.data, natural[:, -1])


def _inferred(data: Data, s: Any) -> Any:
    """s where the loss infers it, else 0: its coordinate is then inert, so that every sampler sees the same shape."""
    return s if data.loss.infers_discrepancy else 0.0 * s
