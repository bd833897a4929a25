"""Kriging: values between known ones, by a Gaussian process whose sizes are learnt from these, with its error.

Noise + a part that each place has for itself + Matérn's process of smoothness 3/2 over scaled places; every place is
predicted from its nearest (M. L. Stein, Interpolation of Spatial Data, Springer 1999; a local neighbourhood as in
A. V. Vecchia, J. R. Stat. Soc. B 50 (1988), 297). How far the stated errors hold is found by leaving out each of some
known places with all others within some distance (buffered cross-validation: K. Le Rest et al., Global Ecol. Biogeogr.
23 (2014), 811), and they are stretched accordingly. It knows no direction and no BRDF.
"""

import dataclasses
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize
from scipy.spatial import KDTree

from fitmat.maths.matern import matern
from fitmat.maths.normal import Z95
from fitmat.maths.parts import slices
from fitmat.text import brief

NEIGHBOURS = 24
"""Known places that tell of another."""

BLOCKS, FAR = 10, 120
"""Neighbourhoods, and places of a sample from everywhere, in which sizes are learnt."""

SHORTEST, LONGEST = 0.02, 20.0
"""Of a length, in the scale in which places are given."""

FLAT, UNSEEN = 0.02, 0.15
"""Along an axis on which all places are within the first, nothing can be learnt: the length is taken as the second."""

TESTED, BUFFERS = 150, (0.0, 0.1, 0.3, 1.0, 3.0)
"""Known places that are left out, and within how many lengths the others are left out with them."""

SHARES = (0.1, 0.3, 0.6, 0.9)
"""Where a stretch is known, as shares of the variance that neighbours leave open."""

FEWEST = 30
"""Comparisons that tell of a stretch."""

AT_ONCE = 12288
"""Places that are predicted at a time."""


@dataclasses.dataclass(frozen=True, eq=False)
class Kriging:
    """Known values of c kinds at n places, and how they vary.

    Attributes:
        places: Divided by the lengths, (n, d).
        rest: Values, mean 0, (n, c).
        noise: Variance of each, (n,).
        lengths: Over which values are alike, in the scale of the places, (d,).
        process: τ², variance of the process.
        own: η², of what each place has for itself.
        stretch: Factors of the error at `SHARES`, of each sort of place, (s, 4).
    """

    places: Float[np.ndarray, "n d"]
    rest: Float[np.ndarray, "n c"]
    noise: Float[np.ndarray, " n"]
    lengths: Float[np.ndarray, " d"]
    process: float
    own: float
    stretch: Float[np.ndarray, "s 4"]

    __repr__ = brief

    def predicted(self, places: Float[np.ndarray, "m d"], sorts: Int[np.ndarray, " m"]) -> Iterator["Part"]:
        """Some places at a time; what is expected of a place is its weights times the values of its neighbours."""
        tree, scaled = KDTree(self.places), places / self.lengths
        for some in slices(len(places), AT_ONCE):
            _, near = tree.query(scaled[some], k=min(NEIGHBOURS, len(self.places)))
            near = near.reshape(some.stop - some.start, -1)
            weights, variance = self.told(scaled[some], near)
            yield Part(some, near, weights, np.sqrt(variance) * self.stretched(variance, sorts[some]))

    def told(
        self, at: Float[np.ndarray, "m d"], near: Int[np.ndarray, "m k"]
    ) -> tuple[Float[np.ndarray, "m k"], Float[np.ndarray, " m"]]:
        """Weights of the neighbours, and the variance that they leave."""
        found = self.places[near]
        matrix = self.process * matern(_apart(found, found))
        diagonal = np.arange(near.shape[1])
        matrix[:, diagonal, diagonal] += self.noise[near] + self.own + 1e-9 * self.process
        alike = self.process * matern(_apart(at[:, None], found)[:, 0])
        weights = np.linalg.solve(matrix, alike[..., None])[..., 0]
        left = self.process + self.own - np.sum(weights * alike, axis=1)
        return weights, np.maximum(left, 1e-6 * (self.process + self.own))

    def stretched(self, variance: Float[np.ndarray, " m"], sorts: Int[np.ndarray, " m"]) -> Float[np.ndarray, " m"]:
        """The factor of the errors that leave such variances; of a sort that is not known, of the one before."""
        each = np.stack([np.interp(variance / (self.process + self.own), SHARES, one) for one in self.stretch])
        return each[np.minimum(sorts, len(each) - 1), np.arange(len(sorts))]


class Part(NamedTuple):
    """Predictions of some places: which, their neighbours, (m, k), the weights, (m, k), and the errors, (m,)."""

    some: slice
    near: np.ndarray
    weights: np.ndarray
    sd: np.ndarray


def _apart(a: Float[np.ndarray, "m i d"], b: Float[np.ndarray, "m j d"]) -> Float[np.ndarray, "m i j"]:
    """Distances; by one axis after the other, which holds less."""
    square = np.zeros((a.shape[0], a.shape[1], b.shape[1]))
    for k in range(a.shape[2]):
        square += (a[:, :, None, k] - b[:, None, :, k]) ** 2
    return np.sqrt(square)


def kriging(
    places: Float[np.ndarray, "n d"],
    rest: Float[np.ndarray, "n c"],
    noise: Float[np.ndarray, " n"],
    sorts: Int[np.ndarray, " n"],
    seed: int = 0,
) -> Kriging:
    """Learn how values vary, and how far the errors of predictions hold.

    Args:
        places: Where values are known, in scales of about 1; repeats are allowed.
        rest: The values, around 0.
        noise: Variance of the noise of each, positive.
        sorts: Of each place, from 0: errors may be stretched by other factors in each.
        seed: Of the places that are looked at.
    """
    rng = np.random.default_rng(seed)
    blocks = _blocks(places, rng)
    total = float(np.mean(rest**2))
    flat = np.ptp(places, axis=0) < FLAT
    begin = np.log([*np.where(flat, UNSEEN, 0.5), max(total, 1e-12), max(0.05 * total, 1e-12)])
    low = np.log([*np.where(flat, UNSEEN, SHORTEST), 1e-8 * (total + 1e-12), 1e-8 * (total + 1e-12)])
    high = np.log([*np.where(flat, UNSEEN, LONGEST), 100.0 * total + 1e-9, 10.0 * total + 1e-9])

    def cost(logs: np.ndarray) -> float:
        size = np.exp(np.clip(logs, low, high))
        away = float(np.sum((logs - np.clip(logs, low, high)) ** 2) + 0.5 * np.sum((logs[:-2] - begin[:-2]) ** 2))
        return away + sum(_surprise(places[b] / size[:-2], rest[b], noise[b], size[-2], size[-1]) for b in blocks)

    found = minimize(cost, begin, method="Nelder-Mead", options={"maxiter": 300, "xatol": 0.02, "fatol": 0.05})
    size = np.exp(np.clip(found.x, low, high))
    lengths, plain = size[:-2], np.ones((int(sorts.max()) + 1, len(SHARES)))
    learnt = Kriging(places / lengths, rest, noise, lengths, float(size[-2]), float(size[-1]), plain)
    each = [_stretch(learnt, rng.permutation(np.flatnonzero(sorts == one))[:TESTED]) for one in range(len(plain))]
    return dataclasses.replace(learnt, stretch=np.stack(each))


def _blocks(places: np.ndarray, rng: np.random.Generator) -> list[np.ndarray]:
    """Neighbourhoods of some places, and a sample of all."""
    n = len(places)
    everywhere = rng.permutation(n)[:FAR]
    if n <= FAR:
        return [everywhere]
    _, near = KDTree(places).query(places[rng.permutation(n)[:BLOCKS]], k=NEIGHBOURS)
    return [everywhere, *np.atleast_2d(near)]


def _surprise(at: np.ndarray, rest: np.ndarray, noise: np.ndarray, process: float, own: float) -> float:
    """−ln of the density of values, each kind by itself."""
    matrix = process * matern(_apart(at[None], at[None])[0])
    matrix[np.diag_indices(len(at))] += noise + own + 1e-9 * process
    factor = cho_factor(matrix, lower=True, check_finite=False)
    half = float(np.sum(np.log(np.diagonal(factor[0]))))
    return half * rest.shape[1] + 0.5 * float(np.sum(rest * cho_solve(factor, rest, check_finite=False)))


def _stretch(k: Kriging, tests: Int[np.ndarray, " t"]) -> Float[np.ndarray, " 4"]:
    """Of errors at `SHARES`: 95 % of what is left out lies within 1.96 of them."""
    shares, misses = [], []
    for place in tests:
        away = np.linalg.norm(k.places - k.places[place], axis=1)
        away[place] = -1.0
        for buffer in BUFFERS:
            outside = np.flatnonzero(away > buffer)
            if len(outside) <= NEIGHBOURS:
                continue
            near = outside[np.argpartition(away[outside], NEIGHBOURS)[:NEIGHBOURS]][None]
            weights, variance = k.told(k.places[place][None], near)
            error = np.abs(k.rest[place] - weights[0] @ k.rest[near[0]]) / np.sqrt(variance[0] + k.noise[place])
            shares += [variance[0] / (k.process + k.own)] * len(error)
            misses += error.tolist()
    share, miss = np.array(shares), np.array(misses)
    edges = [0.0, *(0.5 * (a + b) for a, b in pairwise(SHARES)), np.inf]
    known = [
        np.quantile(miss[(share >= a) & (share < b)], 0.95) / Z95
        if np.count_nonzero((share >= a) & (share < b)) >= FEWEST
        else np.nan
        for a, b in pairwise(edges)
    ]
    told = np.isfinite(known)
    if not told.any():
        return np.ones(len(SHARES))
    return np.maximum(np.interp(SHARES, np.array(SHARES)[told], np.array(known)[told]), 1.0)
