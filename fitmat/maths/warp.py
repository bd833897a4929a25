"""The warp of bilinear densities on the unit square: uniform positions ↔ positions distributed like a table.

It knows no directions and no materials.

Source: the `Marginal2D` (continuous) of Mitsuba 3, `mitsuba/core/distr_2d.h`, of which J. Dupuy & W. Jakob, ACM TOG
37(6), 2018, is the application.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from fitmat.text import brief

EDGE = 2.0**-24
"""Positions are sampled this far inside the unit square, as the published code does: an inverse is unique there."""


class Blend(NamedTuple):
    """Which slices of a table count, and how much: n queries, k slices each."""

    slices: Int[np.ndarray, "n k"]
    weights: Float[np.ndarray, "n k"]

    @classmethod
    def only(cls, chosen: Int[np.ndarray, " n"]) -> "Blend":
        """One slice for each query."""
        return cls(chosen[:, None], np.ones((len(chosen), 1)))

    @classmethod
    def between(cls, nodes: Float[np.ndarray, " s"], at: Float[np.ndarray, " n"]) -> "Blend":
        """The two nodes next to each number, weighted linearly; the outermost one beyond the ends."""
        if len(nodes) == 1:
            return cls.only(np.zeros(len(at), int))
        lower = np.clip(np.searchsorted(nodes, at) - 1, 0, len(nodes) - 2)
        t = np.clip((at - nodes[lower]) / (nodes[lower + 1] - nodes[lower]), 0.0, 1.0)
        return cls(np.stack([lower, lower + 1], axis=1), np.stack([1.0 - t, t], axis=1))

    def times(self, other: "Blend", size: int) -> "Blend":
        """Slices numbered self × size + other, weighted by both."""
        slices = self.slices[:, :, None] * size + other.slices[:, None, :]
        weights = self.weights[:, :, None] * other.weights[:, None, :]
        shape = len(slices), slices.shape[1] * slices.shape[2]
        return Blend(slices.reshape(shape), weights.reshape(shape))

    def take(self, table: np.ndarray, *index: np.ndarray) -> np.ndarray:
        """Σ_k w_k table[slice_k, index]; (n,), or (n, c) where the table has channels behind the index."""
        parts = (
            (weight if table.ndim == 1 + len(index) else weight[:, None]) * table[(chosen, *index)]
            for chosen, weight in zip(self.slices.T, self.weights.T, strict=True)
        )
        return sum(parts, np.zeros(()))


class Cell(NamedTuple):
    """Bilinear patches of a grid and positions in them."""

    x: Int[np.ndarray, " n"]
    y: Int[np.ndarray, " n"]
    fx: Float[np.ndarray, " n"]
    fy: Float[np.ndarray, " n"]

    @classmethod
    def at(cls, u: Float[np.ndarray, "n 2"], width: int, height: int) -> "Cell":
        """Where positions of the unit square are on a grid whose outer nodes lie on its edges."""
        scaled = np.clip(u, 0.0, 1.0) * (width - 1, height - 1)
        whole = np.minimum(scaled.astype(int), (width - 2, height - 2))
        return cls(*whole.T, *(scaled - whole).T)

    def lerp_y(self, blend: Blend, table: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The table between the rows of the cell, at a column."""
        return lerp(blend.take(table, self.y, x), blend.take(table, self.y + 1, x), self.fy)

    def bilinear(self, blend: Blend, table: np.ndarray) -> np.ndarray:
        """The bilinear interpolant of the table."""
        return lerp(self.lerp_y(blend, table, self.x), self.lerp_y(blend, table, self.x + 1), self.fx)


def lerp(a: np.ndarray, b: np.ndarray, t: np.ndarray) -> np.ndarray:
    """(1 − t) a + t b, for (n,) or (n, c)."""
    t = t if a.ndim == 1 else t[:, None]
    return (1.0 - t) * a + t * b


@dataclasses.dataclass(frozen=True, eq=False)
class Warp:
    """The marginal-conditional warp of one density or, interpolated between slices, of many.

    A row is chosen by the density integrated along x, then the position in the row.

    Attributes:
        density: Slices normalised to 1, (s, h, w); 0 where a slice has no density at all.
        conditional: Its integral along x up to each node, (s, h, w).
        marginal: The integral of that along y, (s, h).
    """

    density: Float[np.ndarray, "s h w"]
    conditional: Float[np.ndarray, "s h w"]
    marginal: Float[np.ndarray, "s h"]

    __repr__ = brief

    @classmethod
    def of(cls, density: Float[np.ndarray, "s h w"]) -> "Warp":
        """From densities ≥ 0 of any scale."""
        density = density.astype(float)
        height, width = density.shape[1:]
        conditional, marginal = np.zeros(density.shape), np.zeros(density.shape[:2])
        np.cumsum((density[..., 1:] + density[..., :-1]) / (2 * (width - 1)), axis=-1, out=conditional[..., 1:])
        rows = conditional[..., -1]
        np.cumsum((rows[:, 1:] + rows[:, :-1]) / (2 * (height - 1)), axis=-1, out=marginal[:, 1:])
        total = marginal[:, -1]
        scale = np.where(total > 0, 1.0 / np.where(total > 0, total, 1.0), 0.0)
        for table in (density, conditional, marginal):
            table *= scale.reshape(-1, *[1] * (table.ndim - 1))
        return cls(density, conditional, marginal)

    @property
    def empty(self) -> Bool[np.ndarray, " s"]:
        """Slices without any density."""
        return self.marginal[:, -1] == 0

    def invert(self, u: Float[np.ndarray, "n 2"], blend: Blend) -> Float[np.ndarray, "n 2"]:
        """Distributed positions (x, y) to uniform ones; x = 0 in a row without density."""
        height, width = self.density.shape[1:]
        cell = Cell.at(u, width, height)
        left, right = (cell.lerp_y(blend, self.density, cell.x + side) for side in (0, 1))
        last = np.full_like(cell.x, width - 1)
        lower, upper = (blend.take(self.conditional, cell.y + side, last) for side in (0, 1))
        x = cell.lerp_y(blend, self.conditional, cell.x) + _segment(cell.fx, left, right) / (width - 1)
        y = blend.take(self.marginal, cell.y) + _segment(cell.fy, lower, upper) / (height - 1)
        row = lerp(lower, upper, cell.fy)
        return np.stack([np.where(row > 0, x / np.where(row > 0, row, 1.0), 0.0), y], axis=1)

    def sample(self, s: Float[np.ndarray, "n 2"], blend: Blend) -> Float[np.ndarray, "n 2"]:
        """Uniform positions (x, y) to distributed ones: the inverse of `invert`; 0 where there is no density."""
        height, width = self.density.shape[1:]
        x, y = np.clip(s, EDGE, 1.0 - EDGE).T
        row = _first(lambda index: blend.take(self.marginal, index + 1) >= y, len(y), height - 2)
        last = np.full_like(row, width - 1)
        lower, upper = (blend.take(self.conditional, row + side, last) for side in (0, 1))
        fy = _solve((y - blend.take(self.marginal, row)) * (height - 1), lower, upper)
        cell = Cell(row, row, fy, fy)
        x = x * lerp(lower, upper, fy)
        column = _first(lambda index: cell.lerp_y(blend, self.conditional, index + 1) >= x, len(x), width - 2)
        left, right = (cell.lerp_y(blend, self.density, column + side) for side in (0, 1))
        fx = _solve((x - cell.lerp_y(blend, self.conditional, column)) * (width - 1), left, right)
        return np.stack([(column + fx) / (width - 1), (row + fy) / (height - 1)], axis=1)


def _first(reached: Callable[[np.ndarray], np.ndarray], number: int, largest: int) -> Int[np.ndarray, " n"]:
    """The first index up to the largest at which a monotonic condition holds, for each query, by bisection."""
    low, high = np.zeros(number, int), np.full(number, largest)
    for _ in range(largest.bit_length()):
        middle = (low + high) // 2
        found = reached(middle)
        low, high = np.where(found, low, np.minimum(middle + 1, high)), np.where(found, middle, high)
    return low


def _segment(t: np.ndarray, v0: np.ndarray, v1: np.ndarray) -> np.ndarray:
    """∫₀ᵗ of what runs linearly from v0 to v1."""
    return t * lerp(v0, v1, t / 2)


def _solve(area: np.ndarray, v0: np.ndarray, v1: np.ndarray) -> np.ndarray:
    """The t in [0, 1] at which `_segment` is the area, in the form that loses no digits where v0 ≈ v1."""
    divisor = v0 + np.sqrt(np.maximum(v0**2 + 2 * area * (v1 - v0), 0.0))
    return np.clip(2 * area / np.where(divisor > 0, divisor, 1.0), 0.0, 1.0)
