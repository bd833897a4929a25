"""A bank of Kalman filters, one for each Gaussian of a ridge: what candidates for a measurement would leave unknown.

It chooses no candidate. The bank is the Gaussian sum of Alspach & Sorenson (IEEE Trans. Automatic Control 17, 1972).
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat.fitting.coordinates import Coordinates
from fitmat.fitting.losses import Loss
from fitmat.fitting.result import Fit
from fitmat.judgement.identifiability.profiles import profiles
from fitmat.judgement.identifiability.ridge import Ridge, ridge
from fitmat.maths.mapping import mapped
from fitmat.maths.programs import program
from fitmat.models.base import AbstractBRDF

TRUTHS = 16
"""Points of the ridge that are taken for the truth, equally likely."""


class Bank(eqx.Module):
    """A ridge for compiled programs: its Gaussians, the model they belong to, and which centres serve as truths."""

    template: AbstractBRDF
    base: Any
    moved: Coordinates = eqx.field(static=True)
    loss: Loss = eqx.field(static=True)
    s: Any
    logs: Any
    centre: Any
    covariance: Any
    truths: Any

    def predicted(self, t: Array, wi: Array, wo: Array) -> Array:
        """f κ at the natural coordinates t, (c,)."""
        return jnp.atleast_1d(self.moved.model(self.template, self.base, t)(wi, wo)) * wi[2]


class Task(eqx.Module):
    """What candidates are judged by: the law of the noise, repeats, the places asked for, and (truth, rival)."""

    law: Any
    repeats: Any
    wanted: tuple[int, ...] = eqx.field(static=True)
    match: tuple[int, int] | None = eqx.field(static=True)


def bank(fit: Fit) -> Bank:
    """The filters of a fit, and truths of equal probability along its ridge."""
    found: Ridge = ridge(fit, profiles(fit, widened=False), widened=False)
    middles = (np.arange(TRUTHS) + 0.5) / TRUTHS
    truths = np.minimum(np.searchsorted(np.cumsum(found.weight), middles), len(found.weight) - 1)
    arrays = (np.asarray(fit.discrepancy), np.log(found.weight + 1e-300), found.centre, found.covariance, truths)
    return Bank(fit.model, fit.values, fit.coordinates, fit.data.loss, *arrays)


def unmeasured(filters: Bank, task: Task) -> tuple[float, Float[np.ndarray, " f"]]:
    """The score of measuring nothing, and the sd that is left then, natural."""
    weight = np.exp(filters.logs)
    apart = filters.centre - weight @ filters.centre
    spread = np.einsum("e,eij->ij", weight, filters.covariance) + np.einsum("e,ei,ej->ij", weight, apart, apart)
    variance = np.diagonal(spread)
    if task.match is not None:
        return 0.0, np.sqrt(variance)
    if task.wanted:
        return -0.5 * float(np.mean(np.log(variance[list(task.wanted)]))), np.sqrt(variance)
    return -0.5 * float(np.linalg.slogdet(spread)[1]) / len(variance), np.sqrt(variance)


@program
def scores(banks: tuple[Bank, ...], task: Task, candidates: Any, count: Any, history: Any) -> tuple[Array, Array]:
    """Score of every candidate (k,), larger is better, and the sd it leaves for each truth, natural, (k, t, f).

    Args:
        banks: Of one model, or of two for the match.
        task: What is asked.
        candidates: Directions to the light and the sensor (k, m, 3), and beside how many readings whose misfit is alike
            each sample is taken (k, m), −1 where there is none.
        count: How many of them there are; what stands behind is of no meaning.
        history: The same of what is measured before, (h, m, 3) and (h, m).
    """
    # For "match" the model that needs less discrepancy is the truth, and the other is asked how far off it is.
    pairs = [(0, 0)] if task.match is None else [(0, 0), task.match]
    begin = [_ready(banks[k], len(banks[0].truths)) for _, k in pairs]
    flat = tuple(part.reshape(-1, *part.shape[2:]) for part in history)
    known = [_taken(banks[t], banks[k], task, state, flat) for (t, k), state in zip(pairs, begin, strict=True)]

    def one(candidate: Any) -> tuple[Array, Array]:
        ends = [_taken(banks[t], banks[k], task, state, candidate) for (t, k), state in zip(pairs, known, strict=True)]
        spread = _left(banks[0], ends[0])
        sd = jnp.sqrt(jnp.diagonal(spread, axis1=1, axis2=2))
        if task.match is not None:
            apart = ends[1][3] - known[1][3]
            return jnp.mean(apart @ jnp.exp(banks[task.match[1]].logs)), sd
        if task.wanted:
            return -0.5 * jnp.mean(jnp.log(jnp.mean(sd**2, axis=0)[np.array(task.wanted)])), sd
        return -0.5 * jnp.mean(jnp.linalg.slogdet(spread)[1]) / sd.shape[1], sd

    return mapped(one, candidates, count)


def _ready(filters: Bank, truths: int) -> tuple:
    """What filters carry: ln of their weights (t, e), shifts (t, e, f), covariances (e, f, f), Σ innovation² (t, e)."""
    logs = jnp.tile(filters.logs, (truths, 1))
    return logs, jnp.zeros((truths, *filters.centre.shape)), filters.covariance, jnp.zeros_like(logs)


def _taken(truth: Bank, model: Bank, task: Task, state: tuple, rows: tuple) -> tuple:
    """The filters of a model after rows of noise-free measurements of each truth, a rank-1 update for each channel."""

    def row(state: tuple, given: tuple[Array, Array, Array]) -> tuple[tuple, None]:
        wi, wo, alike = given

        def point(t: Array) -> tuple[Array, Array]:
            x = model.predicted(t, wi, wo)
            return x, x

        slope, expected = jax.vmap(jax.jacfwd(point, has_aux=True))(model.centre)
        if truth is model:
            seen = expected[truth.truths]
        else:
            seen = jax.vmap(lambda t: truth.predicted(t, wi, wo))(truth.centre[truth.truths])
        noise = jnp.hypot(task.law[0] * wi[2], task.law[1] * expected)
        weight = jnp.sqrt(jnp.where(alike < 0.0, 0.0, news(expected, noise, model.s, alike, task.repeats)))

        def z(x: Array) -> Array:
            return weight * model.loss.transform(x, noise, wi[2], model.s)

        here, steep = jax.jvp(z, (expected,), (jnp.ones_like(expected),))
        slope, apart = slope * steep[..., None], z(seen[:, None]) - here
        for channel in range(apart.shape[-1]):
            state = _assimilated(state, slope[:, channel], apart[..., channel])
        return state, None

    return jax.lax.scan(row, state, rows)[0]


def news(x: Array, noise: Array, s: Array, alike: Array, repeats: Array) -> Array:
    """What readings tell beside others of the same misfit, in readings that are alone.

    n readings at one place, each with its own noise and all with one misfit, know the place to σ²/n + s². Beside m of
    them r more are worth I(m + r) − I(m) of one that is alone, I(n) = n/(1 − ρ + ρn), ρ = s²/(σ² + s²).

    Args:
        x: f κ.
        noise: σ κ.
        s: Discrepancy.
        alike: m.
        repeats: r.
    """
    share = s**2 / (s**2 + (noise / (3.0 * jnp.cbrt(jnp.abs(x) + noise) ** 2)) ** 2)

    def told(n: Array) -> Array:
        return n / (1.0 - share + share * n)

    return told(jnp.maximum(alike, 0.0) + repeats) - told(jnp.maximum(alike, 0.0))


def _assimilated(state: tuple, j: Float[Array, "e f"], apart: Float[Array, "t e"]) -> tuple:
    """Kalman's update (Sherman & Morrison) of every filter by one datum of unit variance."""
    logs, shift, covariance, apart_by = state
    cj = jnp.einsum("eij,ej->ei", covariance, j)
    variance = 1.0 + jnp.einsum("ei,ei->e", j, cj)
    innovation = apart - jnp.einsum("tei,ei->te", shift, j)
    logs = logs - 0.5 * innovation**2 / variance - 0.5 * jnp.log(variance)
    shift = shift + (innovation / variance)[..., None] * cj
    covariance = covariance - cj[:, :, None] * cj[:, None, :] / variance[:, None, None]
    return logs, shift, covariance, apart_by + innovation**2 / variance


def _left(filters: Bank, state: tuple) -> Float[Array, "t f f"]:
    """Covariance of the mixture under each truth."""
    logs, shift, covariance, _ = state
    weight = jax.nn.softmax(logs, axis=1)
    at = filters.centre + shift
    apart = at - jnp.einsum("te,tef->tf", weight, at)[:, None]
    within = jnp.einsum("te,eij->tij", weight, covariance)
    return within + jnp.einsum("te,tei,tej->tij", weight, apart, apart)
