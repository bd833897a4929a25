"""The posterior density over the coordinates that are sampled, and the way back to physical parameters.

Sampled are the natural coordinates that were fitted (see `scaled_weights`) and, last, the discrepancy s, which is inert
under a loss that infers none. The priors are those of `priors`. Nothing is drawn here.
"""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike

from fitmat.fitting.coordinates import Coordinates
from fitmat.fitting.likelihood import Data, log_density
from fitmat.fitting.result import Fit
from fitmat.maths.mapping import mapped
from fitmat.maths.parts import slices
from fitmat.maths.programs import program
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import vector
from fitmat.uncertainty.scaled_weights import sampled

AT_ONCE = 128
"""Points for which the density's program is compiled; fewer cost no more than they are."""


def log_posterior(fit: Fit) -> Callable[[np.ndarray], np.ndarray]:
    """The log posterior density over (w, free + 1) sampled coordinates as one compiled call; −inf outside.

    Args:
        fit: What is sampled.
    """
    moved = sampled(fit)
    example = np.zeros((AT_ONCE, moved.count + 1))
    run = _log_posterior.bound((fit.model, fit.data, moved), example, np.array(1))

    def block(points: np.ndarray) -> np.ndarray:
        filled = example.copy()
        filled[: len(points)] = points
        return np.asarray(run(filled, np.array(len(points))))[: len(points)]

    def call(points: np.ndarray) -> np.ndarray:
        if len(points) <= AT_ONCE:
            return block(points)
        return np.concatenate([block(points[part]) for part in slices(len(points), AT_ONCE)])

    return call


@program
def _log_posterior(
    template: AbstractBRDF, data: Data, moved: Coordinates, points: ArrayLike, count: ArrayLike
) -> Array:
    return mapped(lambda x: log_density_at(template, data, moved, x), jnp.asarray(points), count)


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
    inert = jnp.zeros(()) if data.loss.infers_discrepancy else 0.5 * (s / data.typical) ** 2
    value = log_density(here, data, _inferred(data, jnp.abs(s))) - inert
    return jnp.where(inside & jnp.isfinite(value), value, -jnp.inf)


def physical(fit: Fit, coordinates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sampled coordinates (m, free + 1) to full physical vectors (m, p) and discrepancies (m,).

    What is periodic lies within half a period of the best fit.
    """
    moved = sampled(fit)
    natural = moved.unscaled(coordinates)
    return moved.near(moved.filled(fit.values, natural[:, :-1]), fit.values), _inferred(fit.data, natural[:, -1])


def _inferred(data: Data, s: Any) -> Any:
    """s where the loss infers it, else 0: its coordinate is then inert, so that every sampler sees the same shape."""
    return s if data.loss.infers_discrepancy else 0.0 * s
