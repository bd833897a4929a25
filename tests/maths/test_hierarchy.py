"""Hierarchies: the posterior of a population is that of the book, of a sampler of its own, and holds the truth."""

import numpy as np
import pytest
from selection import always

from fitmat.maths import hierarchy
from fitmat.maths.hierarchy import population

# D. B. Rubin, "Estimation in parallel randomized experiments", J. Educ. Stat. 6 (1981), as rounded in the book.
EFFECTS, ERRORS = [28, 8, -3, 7, -1, 1, 18, 12], [15, 10, 16, 11, 9, 11, 10, 18]

PUBLISHED = {
    0.025: (-2, -5, -11, -7, -9, -7, -1, -6),
    0.25: (7, 3, 2, 4, 1, 2, 7, 3),
    0.5: (10, 8, 7, 8, 5, 6, 10, 8),
    0.75: (16, 12, 11, 11, 10, 10, 15, 13),
    0.975: (31, 23, 19, 21, 18, 28, 26, 33),
}
"""Bayesian Data Analysis, 3rd ed., table 5.3: quantiles of 200 simulations of each school's effect, rounded."""

DRAWN = 200


@pytest.mark.parametrize("level", PUBLISHED)
def test_eight_schools_are_those_of_the_book(level: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Within four standard errors of the place of a quantile among 200 draws, and the rounding."""
    error = 4.0 * np.sqrt(level * (1.0 - level) / DRAWN)
    ends = max(level - error, 1e-4), level, min(level + error, 1.0 - 1e-4)
    monkeypatch.setattr(hierarchy, "LEVELS", ends)
    found, told = population(EFFECTS, ERRORS).members, np.array(PUBLISHED[level])
    assert (found[:, 0] - 0.5 <= told).all()
    assert (told <= found[:, 2] + 0.5).all()


def test_the_common_mean_of_the_schools_is_the_published_one() -> None:
    """Sec. 5.5 from Rubin's unrounded numbers: all schools alike give 7.9 with a variance of 17.4."""
    effects = [28.39, 7.94, -2.75, 6.82, -0.64, 0.63, 18.01, 12.16]
    errors = np.array([14.9, 10.2, 16.3, 11.0, 9.4, 11.4, 10.4, 17.6])
    mean, variance, _ = hierarchy._centre(np.array(effects), errors**2, np.zeros(1))
    assert (round(float(mean[0]), 1), round(float(variance[0]), 1)) == (7.9, 17.4)


def gibbs(y: np.ndarray, sd: np.ndarray, chains: int, steps: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Draws of θ and of (μ, τ) by the conditionals of the book's section 11.6; the first fifth is left out."""
    rng, j = np.random.default_rng(seed), len(y)
    theta = y + sd * rng.normal(size=(chains, j))
    mu, tau = theta.mean(axis=1), theta.std(axis=1)
    kept: list[tuple[np.ndarray, np.ndarray]] = []
    for step in range(steps):
        precision = 1.0 / sd**2 + 1.0 / tau[:, None] ** 2
        mean = (y / sd**2 + mu[:, None] / tau[:, None] ** 2) / precision
        theta = mean + rng.normal(size=theta.shape) / np.sqrt(precision)
        mu = theta.mean(axis=1) + tau / np.sqrt(j) * rng.normal(size=chains)
        tau = np.sqrt(np.sum((theta - mu[:, None]) ** 2, axis=1) / rng.chisquare(j - 1, size=chains))
        if step >= steps // 5:
            kept.append((theta, np.stack([mu, tau], axis=1)))
    return np.concatenate([one for one, _ in kept]), np.concatenate([two for _, two in kept])


def test_a_sampler_finds_the_same() -> None:
    """Gibbs' sampler shares no step with the quadrature; a quantile of its draws moves by some hundredths of an sd."""
    y, sd = np.array(EFFECTS, float), np.array(ERRORS, float)
    found = population(y, sd)
    theta, both = gibbs(y, sd, 500, 1500, 1)
    sides = np.quantile(theta, hierarchy.LEVELS, axis=0).T
    assert np.abs(sides - found.members).max() < 0.05 * found.sd.max()
    assert theta.std(axis=0) == pytest.approx(found.sd, rel=0.02)
    assert np.quantile(both[:, 0], hierarchy.LEVELS) == pytest.approx(found.centre, abs=0.3)
    assert np.quantile(both[:, 1], hierarchy.LEVELS)[1:] == pytest.approx(found.spread[1:], rel=0.03)
    further = both[:, 0] + both[:, 1] * np.random.default_rng(2).normal(size=len(both))
    assert np.quantile(further, hierarchy.LEVELS) == pytest.approx(found.following, abs=0.5)


BATCHES, MEMBERS = 250, 8


def coverage(spreads: np.ndarray) -> tuple[np.ndarray, float]:
    """How often intervals of members, of the centre and of a further member hold the truth; and sd over one's own."""
    rng = np.random.default_rng(MEMBERS)
    held, narrower = [], []
    for tau in spreads:
        truth, sd = rng.normal(1.5, tau, MEMBERS + 1), rng.uniform(0.02, 0.4, MEMBERS)
        found = population(truth[:-1] + sd * rng.normal(size=MEMBERS), sd)
        inside = np.mean((found.members[:, 0] < truth[:-1]) & (truth[:-1] < found.members[:, 2]))
        others = [low < true < high for (low, _, high), true in ((found.centre, 1.5), (found.following, truth[-1]))]
        held.append([inside, *others])
        narrower.append(np.mean(found.sd / sd))
    return np.mean(held, axis=0), float(np.mean(narrower))


CHANCE = 4.0 * np.sqrt(0.95 * 0.05 / BATCHES)
"""Four binomial errors."""


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    """Over batches whose spreads are as the prior has them, flat; its end, where there is none, moves little."""
    held, _ = coverage(np.random.default_rng(5).uniform(0.0, 1.0, BATCHES))
    assert held == pytest.approx(np.full(3, 0.95), abs=CHANCE)


@pytest.mark.parametrize("tau", always([0.0], [0.0, 0.02, 0.1, 0.5]))
def test_intervals_are_never_too_narrow(tau: float) -> None:
    """Of one spread, be it less than any member is known to; there they hold more, as a flat prior allows for some."""
    held, found = coverage(np.full(BATCHES, tau))
    assert (held > 0.95 - CHANCE).all()
    assert found < (0.75 if tau <= 0.1 else 0.95)


def test_extremes_keep_their_sense() -> None:
    """Members known exactly stay; members that differ not at all become one."""
    rng = np.random.default_rng(0)
    y = rng.normal(size=30)
    apart = population(y, np.full(30, 1e-6))
    assert apart.members[:, 1] == pytest.approx(y, abs=1e-5)
    assert apart.spread[0] < np.std(y, ddof=1) < apart.spread[2]
    alike = population(1.0 + 1e-9 * y, np.full(30, 0.1))
    assert alike.members[:, 1] == pytest.approx(np.ones(30), abs=1e-6)
    assert alike.sd.max() < 0.03
    wide = population([1.0, 1.1, 0.9], [0.1, 0.1, 1e6])
    assert np.isfinite(wide.members).all()
