"""The discrepancy s of a model from its samples: the best one for given values, a first guess, and what is negligible.

It sees samples as `likelihood` holds them, and no model.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from fitmat._types import Samples, Scalar
from fitmat.fitting.losses import Loss
from fitmat.fitting.stabilising import along_discrepancy, two_thirds

Total = Callable[[Array, Array], Array]
"""Weights and what they weigh → the sum of the products."""

NEGLIGIBLE = 1e-3
"""A discrepancy below this fraction of the noise is reported as none."""

STILL = 1e-10
"""Relative step at which Newton's method for the discrepancy ends."""


def best_discrepancy(x: Any, data: Any, start: Any, total: Total = jnp.vdot, most: int = 12) -> Any:
    """The s ≥ 0 that maximises the likelihood for given model values.

    Args:
        x: `predicted`, (n, c).
        data: The samples.
        start: A positive first guess.
        total: Σ weight · part; where it leaves an axis, that is of as many problems, and so are `start` and the result.
        most: Steps.

    Under losses that infer none it is 0. Newton's method in log s with steps of at most 2; what falls below
    `NEGLIGIBLE` of the noise is 0.
    """
    if not data.loss.infers_discrepancy:
        return jnp.zeros(())

    powers, floor = (two_thirds(data.x), two_thirds(x)), jnp.log(NEGLIGIBLE * data.typical)

    def slopes(t: Scalar) -> tuple[Scalar, Scalar]:
        """Of ½ Σ residual² + Σ ln(a + d), first and second."""
        s = jnp.exp(t)
        z, change, bend, share = along_discrepancy(data.x, data.noise, s, powers[0])
        other, other_change, other_bend, _ = along_discrepancy(x, data.noise, s, powers[1])
        change, bend = change - other_change, bend - other_bend
        pull, pull_change = _pull(z - other, data.loss)
        known = 0.0 if data.prior is None else (data.prior.discrepancy * s) ** 2
        first = total(data.weight, pull * change + share) + known
        second = pull_change * change**2 + pull * bend + share * (1.0 - share)
        return first, total(data.weight, second) + 2.0 * known

    def step(state: tuple[Scalar, Scalar, Array]) -> tuple[Scalar, Scalar, Array]:
        t, _, count = state
        g, curvature = slopes(t)
        newton = jnp.clip(-g / jnp.maximum(jnp.abs(curvature), 1e-3), -2.0, 2.0)
        moved = jnp.clip(t + newton, floor, floor + 40.0)
        return moved, jnp.abs(moved - t), count + 1

    begin = jnp.maximum(jnp.log(start), floor + 1.0)

    def moves(state: tuple[Scalar, Scalar, Array]) -> Array:
        return jnp.any(state[1] > STILL) & (state[2] < most)

    t, _, _ = jax.lax.while_loop(moves, step, (begin, jnp.ones(jnp.shape(start), begin.dtype), jnp.array(0)))
    return jnp.where(t > floor + 1e-6, jnp.exp(t), 0.0)


def _pull(r: Samples, loss: Loss) -> tuple[Samples, Samples]:
    """The first two derivatives of ½ shrink(r)²."""
    one = jnp.ones_like(r)

    def half(r: Samples) -> Samples:
        return 0.5 * loss.shrink(r) ** 2

    return jax.jvp(lambda r: jax.jvp(half, (r,), (one,))[1], (r,), (one,))


def noise_scales(x: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """The s whose discrepancy equals the noise of each sample, in sr^(−1/3)."""
    return noise / (3.0 * np.cbrt(np.abs(x) + noise) ** 2)


def first_scales(x: np.ndarray) -> np.ndarray:
    """Of each sample a first s before anything is fitted: a tenth of ∛x."""
    return 0.1 * np.cbrt(np.abs(x))


def noise_scale(x: np.ndarray, noise: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """The median of `noise_scales`; NaN where there is no sample."""
    used = weight > 0
    if not used.any():
        return np.array(np.nan)
    return np.asarray(np.median(noise_scales(x[used], noise[used])))


def first_discrepancy(data: Any) -> np.ndarray:
    """The median of `first_scales`."""
    return np.asarray(np.median(first_scales(data.x[data.weight > 0])))
