"""Smoothness: numbers on a grid, each known with an error of its own, and what neighbours tell of one another.

y_i ~ N(x_i, σ_i²), and the differences d of neighbours have the density of Student's t with ν degrees of freedom and
scale τ, up to one factor of all: τ^(k−n) for n points in k pieces, as only differences count. Each edge has a weight
w ~ Γ(ν/2, ν/2) given which d ~ N(0, τ²/w) (K. Lange, R. Little and J. Taylor, J. Am. Stat. Assoc. 84 (1989) 881); and
a share π of the edges is cut: there two materials meet, and |d| may be anything up to the range of the data and 2 σ.
The posterior is taken as a product of a normal density of x and one of each edge (variational Bayes: C. Bishop, Pattern
Recognition and Machine Learning, Springer 2006, sec. 10.1), so that an edge's weight is (ν + 1)/(ν + ⟨d²⟩/τ²), times
the probability that it is not cut, which both densities of d give where d² is ⟨d²⟩. π is the mean of that of all, and τ
where the bound on the evidence, times τ, is greatest: the factor keeps it from 0 (Y. Chung et al., Psychometrika 78
(2013) 685). It knows no parameter.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from fitmat.maths.lattice import Lattice, Moments, eliminated, sampled

FREEDOM = 2.0
"""ν: with fewer, less of a step between two materials is blurred; with more, normal fields are inferred better."""

STUDENT = math.gamma(0.5 * (FREEDOM + 1.0)) / math.gamma(0.5 * FREEDOM) / math.sqrt(FREEDOM * math.pi)
"""Density of Student's t at 0, of scale 1."""

CUT = 1e-2, 1e-12, 0.5
"""π to begin with, the least, and the most."""

LEAST = 1e-6
"""Probability that an edge is not cut, at least, so that all points hang together."""

EXACT = 64, 1024
"""Points of the shorter and of the longer side up to which variances are exact; of larger grids they are from draws."""

DRAWS = 4, 64
"""While the scale is learnt, and at the end, each the least; a standard deviation of k is off by 1/√(2k), or less."""

MOST_DRAWS = 128
"""On small grids."""

DRAWN = 1 << 26
"""Points × draws at the end, where that is more than the least."""

ROUNDS = 50
"""Most looks at the field."""

STILL = 2e-3
"""Change of ln τ², and of the logarithms of the weights, root mean square, that ends them."""

FARTHEST, LONGEST = 2.5, 8.0
"""Change of ln τ² in a round, at most, and how often the simple step of it is taken at once."""

NO_LESS = 1e-2
"""Parameters that count as found where none are, so that data without any difference have a scale."""

APART = 20.0
"""⟨d²⟩ over its median from which on neighbours are of two materials: three deviations, where the field is normal."""

Look = Callable[[Lattice], Moments]


class Smoothness(NamedTuple):
    """What is known of the numbers.

    Attributes:
        mean: (rows, columns).
        sd: (rows, columns).
        step: Root mean square of the differences of neighbours, without those of `APART`.
        scale: τ.
        cut: π.
        lattice: Precisions, and weights over τ², given which the moments are.
    """

    mean: Float[np.ndarray, "rows columns"]
    sd: Float[np.ndarray, "rows columns"]
    step: float
    scale: float
    cut: float
    lattice: Lattice


def smoothness(found: Float[np.ndarray, "rows columns"], sd: Float[np.ndarray, "rows columns"]) -> Smoothness:
    """The posterior of numbers on a grid.

    Args:
        found: y, of at least three points.
        sd: σ; NaN where there is no y, and the neighbours alone tell.
    """
    used = np.isfinite(found) & (sd > 0)
    precision = np.where(used, 1.0 / np.where(used, sd, 1.0) ** 2, 0.0)
    centre = float(np.median(found[used]))
    y = np.where(used, found - centre, 0.0)
    short, long = sorted(y.shape)
    exact = short <= EXACT[0] and long <= EXACT[1]
    draws = None if exact else _Draws(y)
    look: Look = draws or (lambda lattice: eliminated(lattice, y))
    edges = [np.zeros(y.shape), np.zeros(y.shape)]
    edges[0][:, :-1], edges[1][:-1] = 1.0, 1.0
    width = 2.0 * float(np.ptp(found[used]) + 2.0 * np.median(sd[used]))
    first = _first(y, used, precision)
    lattice, moments, square, cut = _learnt(look, precision, edges, first, width)
    if draws is not None:
        moments = draws.closer(lattice)
    inside = [edge > 0 for edge in edges]
    apart = np.concatenate([part[e] for part, e in zip(_mean_squares(moments), inside, strict=True)])
    typical = float(np.sqrt(np.mean(apart[apart < APART * np.median(apart)])))
    return Smoothness(moments.mean + centre, np.sqrt(moments.variance), typical, float(np.sqrt(square)), cut, lattice)


class _Draws:
    """Looks at a large field, each from where the last one ended."""

    def __init__(self, y: np.ndarray) -> None:
        self._y, (few, many) = y, DRAWS
        self._count = int(np.clip(few * DRAWN / many / y.size, few, MOST_DRAWS // many * few))
        self._rounds = many // few
        self._found = np.zeros((1 + self._count, *y.shape))

    def __call__(self, lattice: Lattice) -> Moments:
        self._found, *spread = sampled(lattice, self._y, self._found, np.arange(1 + self._count))
        return Moments(*map(np.array, (self._found[0], *spread)))

    def closer(self, lattice: Lattice) -> Moments:
        """The same from more draws."""
        parts = [self(lattice)]
        start = np.zeros((1 + self._count, *self._y.shape))
        start[0] = parts[0].mean
        for k in range(1, self._rounds):
            seeds = np.arange(1 + self._count) + k * self._count
            _, *spread = sampled(lattice, self._y, start, seeds)
            parts.append(Moments(parts[0].mean, *map(np.array, spread)))
        return Moments(parts[0].mean, *(np.mean([part[k] for part in parts], axis=0) for k in (1, 2, 3)))


def _squares(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """d² to the next column and to the next row, 0 where there is none."""
    across, along = np.zeros(x.shape), np.zeros(x.shape)
    across[:, :-1], along[:-1] = np.diff(x, axis=1) ** 2, np.diff(x, axis=0) ** 2
    return across, along


def _mean_squares(moments: Moments) -> tuple[np.ndarray, np.ndarray]:
    """⟨d²⟩ of the same."""
    across, along = _squares(moments.mean)
    return across + moments.right, along + moments.down


def _first(y: np.ndarray, used: np.ndarray, precision: np.ndarray) -> float:
    """τ² to begin with: as large as errors, or as differences where these are larger."""
    both = [used[:, 1:] & used[:, :-1], used[1:] & used[:-1]]
    apart = np.concatenate([np.diff(y, axis=1)[both[0]], np.diff(y, axis=0)[both[1]]])
    error = 1.0 / float(np.median(precision[used]))
    return max(error, float(np.median(apart**2)) if len(apart) else 0.0)


def _learnt(
    look: Look, precision: np.ndarray, edges: list[np.ndarray], square: float, width: float
) -> tuple[Lattice, Moments, float, float]:
    """The lattice, the moments, τ² and π at which weights stay.

    At the greatest bound Σ c d̄² + k + 1 is the number of parameters that the data determine, tr(Q⁻¹ P); the simple step
    towards it is D. MacKay's, Neural Comput. 4 (1992) 415, made longer by what the last one did.
    """
    weights, before, cut, pieces = edges, None, CUT[0], 1
    lattice = Lattice(precision, *(w / square for w in weights))
    moments = look(lattice)
    for _ in range(ROUNDS):
        across, along = _squares(moments.mean)
        rough = float(np.sum(lattice.right * across) + np.sum(lattice.down * along))
        determined = float(np.sum(moments.variance * precision))
        change = float(np.log((rough + NO_LESS) / (max(determined - pieces - 1.0, 0.0) + NO_LESS)))
        here, longer = np.log(square), 1.0
        if before is not None and here != before[0]:
            slope = (change - before[1]) / (here - before[0])
            longer = LONGEST if slope >= 0 else float(np.clip(-1.0 / slope, 1.0, LONGEST))
        before = here, change
        moved = float(np.exp(np.clip(longer * change, -FARTHEST, FARTHEST)))
        new, cuts = _weights(_mean_squares(moments), edges, square * moved, cut, width)
        whole = np.concatenate([part[e > 0] for part, e in zip(cuts, edges, strict=True)])
        cut, pieces = float(np.clip(np.mean(whole), *CUT[1:])), _pieces(cuts, precision > 0)
        shift = [np.log(a[e > 0] / b[e > 0]) for a, b, e in zip(new, weights, edges, strict=True)]
        if max(abs(change), float(np.sqrt(np.mean(np.concatenate(shift) ** 2)))) < STILL:
            break
        weights, square = new, square * moved
        lattice = Lattice(precision, *(w / square for w in weights))
        moments = look(lattice)
    return lattice, moments, square, cut


def _weights(
    mean_squares: Sequence[np.ndarray], edges: Sequence[np.ndarray], square: float, cut: float, width: float
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """The weights of edges, 0 of what is none, and the probabilities that they are cut."""
    weights, cuts = [], []
    for part, edge in zip(mean_squares, edges, strict=True):
        spread = 1.0 + part / (FREEDOM * square)
        density = STUDENT / np.sqrt(square) * spread ** (-0.5 * (FREEDOM + 1.0))
        probability = cut / (cut + (1.0 - cut) * width * density)
        weights.append(edge * np.maximum(1.0 - probability, LEAST) * (FREEDOM + 1.0) / (FREEDOM * spread))
        cuts.append(probability)
    return weights, cuts


def _pieces(cuts: Sequence[np.ndarray], used: np.ndarray) -> int:
    """How many pieces with data the edges leave that are rather not cut."""
    right, down = (part < 0.5 for part in cuts)
    if right[:, :-1].all() and down[:-1].all():
        return 1
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    number = np.arange(used.size).reshape(used.shape)
    ends = (
        (number[:, :-1][right[:, :-1]], number[:, 1:][right[:, :-1]]),
        (number[:-1][down[:-1]], number[1:][down[:-1]]),
    )
    place = tuple(np.concatenate(part) for part in zip(*ends, strict=True))
    graph = coo_array((np.ones(len(place[0]), bool), place), shape=(used.size, used.size))
    return len(np.unique(connected_components(graph, directed=False)[1][used.ravel()]))
