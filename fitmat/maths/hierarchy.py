"""Hierarchy: numbers of one population, each known with an error of its own, and what they tell of one another.

y_j ~ N(θ_j, σ_j²) and θ_j ~ N(μ, τ²) with flat priors of μ and τ (A. Gelman et al., Bayesian Data Analysis, 3rd ed.,
CRC 2013, sec. 5.4). Given τ everything is normal, (5.17) and (5.20); the posterior of τ, (5.21), is summed on a grid.
It knows no parameter and no bound.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from fitmat.maths import normal
from fitmat.maths.parts import slices

FEWEST = 3
"""Members from which on the posterior exists: with two, any spread between them is as likely as the next."""

LEVELS = (0.025, 0.5, 0.975)
"""What is told of each number: the limits of 95 %, and its median between them."""

CELLS = 100
"""Of the grid over τ."""

FAR = 25.0
"""Nats below the greatest density at which the grid ends."""

ZOOMS = 8
"""Times that the grid is drawn closer around the posterior, at most."""

AT_ONCE = 2_000_000
"""Members × cells that are held at a time."""

STEPS = 60
"""Most steps towards a quantile: each halves the bracket, or is Newton's."""

STILL = 1e-10
"""Of the standard deviation: the step that ends the search."""


class Population(NamedTuple):
    """What is known of a population and its members; quantiles are those of `LEVELS`.

    Attributes:
        members: Of each θ_j, (j, 3).
        sd: Posterior standard deviation of each θ_j, (j,).
        centre: Of μ, (3,).
        spread: Of τ, (3,).
        following: Of a further member of which nothing is known, (3,).
    """

    members: Float[np.ndarray, "j 3"]
    sd: Float[np.ndarray, " j"]
    centre: Float[np.ndarray, " 3"]
    spread: Float[np.ndarray, " 3"]
    following: Float[np.ndarray, " 3"]


def population(found: ArrayLike, sd: ArrayLike) -> Population:
    """The posterior of a population.

    Args:
        found: y_j, finite, at least `FEWEST`.
        sd: σ_j, all positive.

    Example:
        >>> schools = population([28, 8, -3, 7, -1, 1, 18, 12], [15, 10, 16, 11, 9, 11, 10, 18])
        >>> print(np.round(schools.members[0]))
        [-2. 10. 32.]
    """
    y, variance = np.asarray(found, float), np.asarray(sd, float) ** 2
    tau, weight, edges = _spreads(y, variance)
    mean, of_mean, _ = _centre(y, variance, tau)
    members, deviation = np.empty((len(y), len(LEVELS))), np.empty(len(y))
    for some in slices(len(y), max(1, AT_ONCE // len(tau))):
        share = tau**2 / (variance[some, None] + tau**2)
        means = share * y[some, None] + (1.0 - share) * mean
        spread = np.sqrt(share * variance[some, None] + (1.0 - share) ** 2 * of_mean)
        members[some], deviation[some] = _quantiles(means, spread, weight)
    return Population(
        members,
        deviation,
        _quantiles(mean[None], np.sqrt(of_mean)[None], weight)[0][0],
        np.interp(LEVELS, np.append(0.0, np.cumsum(weight)), edges),
        _quantiles(mean[None], np.sqrt(of_mean + tau**2)[None], weight)[0][0],
    )


def _centre(
    y: np.ndarray, variance: np.ndarray, tau: Float[np.ndarray, " k"]
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Mean and variance of μ given τ, (5.20), and the log density of τ, (5.21), up to a constant."""
    found = np.empty((3, len(tau)))
    for some in slices(len(tau), max(1, AT_ONCE // len(y))):
        precision = 1.0 / (variance + tau[some, None] ** 2)
        of_mean = 1.0 / precision.sum(axis=1)
        mean = of_mean * (precision @ y)
        log = np.log(of_mean) + np.sum(np.log(precision) - precision * (y - mean[:, None]) ** 2, axis=1)
        found[:, some] = mean, of_mean, 0.5 * log
    return found[0], found[1], found[2]


def _spreads(y: np.ndarray, variance: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Middles of cells of τ, (k,), what the posterior has in each, (k,), and their edges, (k + 1,).

    Cells are even in u = τ/(τ + a), which holds every τ, and are drawn closer until the posterior fills them.
    """
    typical = np.sqrt(np.median(variance)) + float(np.std(y))

    def cells(low: float, high: float) -> tuple[np.ndarray, ...]:
        edge = np.linspace(low, high, CELLS + 1)
        u = 0.5 * (edge[:-1] + edge[1:])
        tau = typical * u / (1.0 - u)
        return tau, _centre(y, variance, tau)[2] - 2.0 * np.log1p(-u), edge

    tau, log, edge = cells(0.0, 1.0)
    for _ in range(ZOOMS):
        near = np.flatnonzero(log > log.max() - FAR)
        if len(near) > CELLS // 2:
            break
        tau, log, edge = cells(float(edge[max(near[0] - 1, 0)]), float(edge[min(near[-1] + 2, CELLS)]))
    weight = np.exp(log - log.max())
    with np.errstate(divide="ignore"):
        edges = np.minimum(typical * edge / (1.0 - edge), np.finfo(float).max)
    return tau, weight / weight.sum(), edges


def _quantiles(
    means: Float[np.ndarray, "j k"], spread: Float[np.ndarray, "j k"], weight: Float[np.ndarray, " k"]
) -> tuple[Float[np.ndarray, "j 3"], Float[np.ndarray, " j"]]:
    """Quantiles and standard deviations of mixtures of normals, by Newton's steps inside a bracket."""
    centre = means @ weight
    sd = np.sqrt(((means - centre[:, None]) ** 2 + spread**2) @ weight)
    found = np.empty((len(means), len(LEVELS)))
    for k, level in enumerate(LEVELS):
        each = means + spread * normal.quantile(np.array(level))
        low, high = each.min(axis=1), each.max(axis=1)
        x = np.clip(centre + sd * normal.quantile(np.array(level)), low, high)
        for _ in range(STEPS):
            z = (x[:, None] - means) / spread
            over = normal.cdf(z) @ weight - level
            low, high = np.where(over < 0, x, low), np.where(over < 0, high, x)
            density = (np.exp(-0.5 * z**2) / spread) @ weight / np.sqrt(2 * np.pi)
            tried = x - over / np.maximum(density, 1e-300)
            moved = np.where((tried >= low) & (tried <= high), tried, 0.5 * (low + high))
            done = np.abs(moved - x) <= STILL * sd
            x = moved
            if done.all():
                break
        found[:, k] = x
    return found, sd
