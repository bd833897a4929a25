"""Lanes: the residuals of many small fits side by side, and their normal equations; the fits are the last axis.

A sample's directions are the same in all lanes, so that its cosines are computed once for them all. It steps nowhere.
"""

from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from fitmat.fitting.coordinates import Coordinates
from fitmat.fitting.likelihood import Data
from fitmat.fitting.losses import Loss
from fitmat.maths.grams import Normal, Whole
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import vector


class Shared(eqx.Module):
    """What all fits share.

    Attributes:
        template: Gives shapes, static choices and the values of what is held.
        wi: Directions to the light, (n, 3).
        wo: Directions to the sensor, (n, 3).
        moved: The k parameters that are fitted.
        loss: What is minimised.
        channels: c.
    """

    template: AbstractBRDF
    wi: Any
    wo: Any
    moved: Coordinates = eqx.field(static=True)
    loss: Loss = eqx.field(static=True)
    channels: int = eqx.field(static=True)

    def data(self, samples: "Samples") -> Data:
        """Samples, the fits last, as `likelihood` takes them."""
        x, noise, weight = samples.x, samples.noise, samples.weight
        return Data(None, None, x, noise, self.kappa, weight, None, self.loss, None, samples.typical)

    @property
    def kappa(self) -> Float[Array, "n 1 1"]:
        """cosθ_i."""
        return jnp.asarray(self.wi)[:, 2, None, None]


class Samples(eqx.Module):
    """Samples as the likelihood sees them, as `likelihood.Data` has them: of many fits.

    Attributes:
        x: Measured f cosθ_i.
        noise: σ cosθ_i, positive.
        weight: 1 where valid, 0 where masked.
        typical: The s whose discrepancy equals the noise for the typical sample.
    """

    x: Any
    noise: Any
    weight: Any
    typical: Any


Charted = tuple[list[Array], list[Array]]
"""The k fitted parameters of every lane, and their slopes along other coordinates, (B,) each."""


def from_natural(moved: Coordinates, natural: Float[Array, "k B"]) -> Charted:
    """Of natural coordinates."""
    found = [jnp.exp(t) if ratio else t for t, ratio in zip(natural, moved.log, strict=True)]
    return found, [p if ratio else jnp.ones_like(p) for p, ratio in zip(found, moved.log, strict=True)]


def from_unbounded(moved: Coordinates, u: Float[Array, "k B"]) -> Charted:
    """Of unbounded coordinates."""
    found, slopes = from_natural(moved, moved.natural_of(u.T).T)
    along = moved.span.astype(u.dtype)[:, None] * jnp.cos(u) / 2.0
    return found, [slope * turn for slope, turn in zip(slopes, along, strict=True)]


def predicted(shared: Shared, chosen: list[Array]) -> tuple[Float[Array, "n c B"], list[Array]]:
    """f cosθ_i at the samples, of the fitted parameters of every lane, and its slopes along them."""

    def one(wi: Array, wo: Array, *moved: Array) -> list[Array]:
        def value(*numbers: Array) -> Array:
            value = jnp.asarray(_model(shared, numbers)(wi, wo), wi.dtype)  # tables of some models are of 64 bits
            return jnp.broadcast_to(value, (shared.channels,)) * wi[2]

        return [value(*moved), *(_slope(value, moved, k) for k in range(len(moved)))]

    lanes = jax.vmap(one, in_axes=(None, None, *(0 for _ in chosen)), out_axes=-1)
    samples = jax.vmap(lanes, in_axes=(0, 0, *(None for _ in chosen)))
    x, *columns = samples(jnp.asarray(shared.wi), jnp.asarray(shared.wo), *chosen)
    return x, columns


def _model(shared: Shared, moved: Sequence[Array]) -> AbstractBRDF:
    """The model with its fitted parameters."""
    leaves, structure = jax.tree.flatten(shared.template)
    every = jnp.asarray(vector(shared.template))
    numbers = [every[place] for place in range(len(every))]
    for place, value in zip(shared.moved.places, moved, strict=True):
        numbers[place] = value
    ends = np.cumsum([0, *(np.size(leaf) for leaf in leaves)])
    made = [
        numbers[start] if np.ndim(leaf) == 0 else jnp.stack(numbers[start : start + np.size(leaf)])
        for leaf, start in zip(leaves, ends, strict=False)
    ]
    return jax.tree.unflatten(structure, made)


def _slope(of: Callable[..., Array], at: Sequence[Array], k: int) -> Array:
    """Of a function along its k-th argument; what does not depend on it costs nothing."""
    return jax.jvp(lambda value: of(*at[:k], value, *at[k + 1 :]), (at[k],), (jnp.ones_like(at[k]),))[1]


def looked(
    shared: Shared, data: Samples, s: Float[Array, " B"], measured: Array, at: Callable[[], Charted], some: Any
) -> tuple[Normal, Float[Array, "n c B"]]:
    """The normal equations of every lane, and f cosθ_i there.

    Args:
        shared: The model and the directions.
        data: The samples.
        s: Discrepancy.
        measured: T(y κ).
        at: Gives the parameters.
        some: Whether any lane is of interest; else the results are of no meaning.
    """
    chosen, slopes = alone(some, at)

    def columns() -> list[Array]:
        x, along = predicted(shared, chosen)

        def residual(x: Array) -> Array:
            return data.weight * shared.loss.shrink(measured - shared.loss.transform(x, data.noise, shared.kappa, s))

        r, change = jax.jvp(residual, (x,), (jnp.ones_like(x),))
        return [x, r, *(change * part for part in along)]

    x, r, *found = alone(some, columns)
    return _normal(r, found, slopes), x


def alone(some: Bool[Array, ""], function: Callable[[], Any]) -> Any:
    """A function's results as arrays: XLA would merge it with what follows, and compute its parts again and again."""
    nothing = jax.tree.map(lambda part: jnp.zeros(part.shape, part.dtype), jax.eval_shape(function))
    return jax.lax.cond(some, function, lambda: nothing)


def _normal(r: Array, columns: list[Array], slopes: list[Array]) -> Normal:
    """Of residuals and their columns along other coordinates than those that are moved."""
    k = len(columns)
    products = [[summed(a * b) for b in columns[: i + 1]] for i, a in enumerate(columns)]
    rows = [jnp.stack([products[max(i, j)][min(i, j)] * slopes[i] * slopes[j] for j in range(k)]) for i in range(k)]
    slope = jnp.stack([summed(r * column) * along for column, along in zip(columns, slopes, strict=True)])
    return Normal(summed(r * r), slope, Whole(jnp.stack(rows)))


def summed(part: Float[Array, "n c B"]) -> Float[Array, " B"]:
    """Over all samples, by halves: XLA sums along the first axis four times slower."""
    rows = part.reshape(-1, part.shape[-1])
    while len(rows) > 1:
        half = len(rows) // 2
        added = rows[:half] + rows[half : 2 * half]
        rows = added if len(rows) % 2 == 0 else added.at[0].add(rows[-1])
    return rows[0]
