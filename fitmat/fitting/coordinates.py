"""Coordinates of a model's parameters: their names and bounds, and the ways between what is reported and what is moved.

Physical are the values as reported; natural their logarithms where equal ratios matter, else the values themselves;
unbounded what a solver moves; scaled what a sampler moves where a shared scale is fitted. All functions take one point
or many draws, (..., k), in NumPy or in JAX. Nothing is fitted here.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, TypeVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat.errors import ModelError
from fitmat.maths.arrays import library
from fitmat.maths.normal import Z95
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF, AbstractEstimated
from fitmat.models.estimated import unfitted
from fitmat.models.parameters import Entry, entries, with_vector
from fitmat.text import channel_labels

M = TypeVar("M", bound=eqx.Module)
Numbers = TypeVar("Numbers", np.ndarray, Array)
"""JAX or NumPy arrays; what goes in comes out."""

EDGE = 1e-3
"""Starts are kept this fraction of the range (in the sine) away from a bound."""

AT_BOUND = 1e-6
"""A coordinate closer to its bound than this fraction of its range counts as on the bound."""


@dataclasses.dataclass(frozen=True)
class Coordinates:
    """k parameters of a model, in the order of its vector; equal where a compiled program may be shared.

    Attributes:
        places: In the model's parameter vector of p.
        lower: Bounds, physical.
        upper: Bounds, physical.
        log: Where the natural coordinate is the logarithm.
        weights: Which of the k, by position, the scale multiplies; empty where no scale is fitted.
        scale: Position of ln g among the k; 0 where there is none.
        names: Of the parameters, with their channel where there are several.
        periods: After which a parameter is the same again; 0 where there is no such.
    """

    places: tuple[int, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    log: tuple[bool, ...]
    weights: tuple[int, ...] = ()
    scale: int = 0
    names: tuple[str, ...] = dataclasses.field(default=(), compare=False)
    periods: tuple[float, ...] = dataclasses.field(default=(), compare=False)

    @property
    def count(self) -> int:
        """k."""
        return len(self.places)

    @property
    def index(self) -> np.ndarray:
        """`places` as an index of arrays."""
        return np.array(self.places, int)

    @property
    def ratio(self) -> np.ndarray:
        """`log` as a mask, (k,)."""
        return np.array(self.log, bool)

    @property
    def low(self) -> Float[np.ndarray, " k"]:
        """Lower bounds, natural."""
        return self._to_natural(np.array(self.lower, float))

    @property
    def high(self) -> Float[np.ndarray, " k"]:
        """Upper bounds, natural."""
        return self._to_natural(np.array(self.upper, float))

    @property
    def span(self) -> Float[np.ndarray, " k"]:
        """Widths of the bounds, natural."""
        return self.high - self.low

    @property
    def extent(self) -> Float[np.ndarray, " k"]:
        """How far apart, natural, two values can be that are not the same: the width of the bounds, or a period."""
        return np.where(self._turn > 0, self._turn, self.span)

    @property
    def _turn(self) -> Float[np.ndarray, " k"]:
        return np.array(self.periods or (0.0,) * self.count, float)

    def around(self, centre: Float[np.ndarray, " k"]) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
        """Bounds, natural, as seen from a point: half a period on either side of what is periodic."""
        turn = self._turn
        return np.where(turn > 0, centre - turn / 2, self.low), np.where(turn > 0, centre + turn / 2, self.high)

    def near(self, values: Float[np.ndarray, "... p"], centre: Float[np.ndarray, " p"]) -> Float[np.ndarray, "... p"]:
        """Parameter vectors with what is periodic moved by whole periods, to within half of one of a vector's."""
        turn, found = self._turn, np.array(values)
        apart = np.asarray(values)[..., self.index] - np.asarray(centre)[self.index]
        found[..., self.index] -= turn * np.round(apart / np.where(turn > 0, turn, 1.0))
        return found

    def _to_natural(self, chosen: Numbers) -> Numbers:
        xp = library(chosen)
        return xp.where(self.ratio, xp.log(xp.where(self.ratio, chosen, 1.0)), chosen)

    def natural(self, values: Numbers) -> Numbers:
        """Parameter vectors (..., p) to natural coordinates (..., k)."""
        return self._to_natural(values[..., self.index])

    def physical(self, natural: Numbers) -> Numbers:
        """Natural coordinates to physical values of the same parameters, (..., k) both."""
        xp = library(natural)
        return xp.where(self.ratio, xp.exp(xp.where(self.ratio, natural, 0.0)), natural)

    def filled(self, base: Numbers, natural: Numbers) -> Numbers:
        """Parameter vectors (..., p) with these natural coordinates and everything else as in `base`, (p,)."""
        return self._placed(base, self.physical(natural))

    def _placed(self, base: Any, chosen: Any) -> Any:
        if library(base, chosen) is jnp:
            full = jnp.broadcast_to(base, (*chosen.shape[:-1], base.shape[-1]))
            return full.at[..., self.index].set(chosen)
        full = np.tile(base, (*chosen.shape[:-1], 1))
        full[..., self.index] = chosen
        return full

    def model(self, template: M, base: Array, natural: Array) -> M:
        """The model at natural coordinates (k,), everything else as in `base`."""
        return with_vector(template, self.filled(base, natural))

    def unbounded(self, values: Numbers) -> Numbers:
        """Parameter vectors (..., p) to unbounded coordinates (..., k); values on or outside a bound are nudged inside.

        MINUIT's sine, x = low + (high − low)(1 + sin u)/2 of the natural coordinate (James & Roos 1975): unlike a
        sigmoid it reaches a bound at finite u, so that a solver can stop there.
        """
        xp, t = library(values), 2.0 * (self.natural(values) - self.low) / self.span - 1.0
        return xp.arcsin(xp.clip(t, -np.cos(EDGE), np.cos(EDGE)))

    def from_unbounded(self, base: Array, u: Array) -> Array:
        """Unbounded coordinates (k,) to a parameter vector (p,), always within the bounds."""
        return self.filled(base, self.natural_of(u))

    def natural_of(self, u: Numbers) -> Numbers:
        """Unbounded to natural coordinates, (..., k) both."""
        low, span = (part.astype(u.dtype) for part in (self.low, self.span))
        return low + span * (1.0 + library(u).sin(u)) / 2.0

    def bend(self, u: Array, slope: Float[Array, " k"]) -> Float[Array, " k"]:
        """What the sine adds to the second derivative of a cost of which ∂/∂u is given, where that is more than 0.

        x″ ∂cost/∂x = −tan u ∂cost/∂u. Where the cost falls towards a bound it is all the curvature there is: the slope
        of the residuals vanishes there, and steps by JᵀJ alone would be as long as they are senseless.
        """
        return jnp.maximum(-jnp.tan(u) * slope, 0.0)

    def folded(self, natural: Float[np.ndarray, "... k"]) -> Float[np.ndarray, "... k"]:
        """Natural coordinates mirrored at the bounds until they lie between them."""
        turn = (natural - self.low) % (2.0 * self.span)
        return self.low + np.where(turn > self.span, 2.0 * self.span - turn, turn)

    def side(self, values: Float[np.ndarray, "... p"]) -> np.ndarray:
        """Which of the k parameters sit on a bound: −1 lower, +1 upper, 0 inside."""
        t = (self.natural(values) - self.low) / self.span
        return np.where(t < AT_BOUND, -1, np.where(t > 1.0 - AT_BOUND, 1, 0))

    def slope(self, values: Float[np.ndarray, "... p"]) -> Float[np.ndarray, "... k"]:
        """∂physical/∂natural: the value where the scale is log, else 1."""
        return np.where(self.ratio, values[..., self.index], 1.0)

    def interval(self, values: Float[np.ndarray, " p"], sd: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k 2"]:
        """95 % intervals, physical, of a normal in each natural coordinate; they end at the bounds.

        Args:
            values: The middle of all, physical.
            sd: Standard deviations of the k parameters, physical.
        """
        middle = values[self.index]
        with np.errstate(over="ignore"):
            ratio = np.exp(Z95 * sd / self.slope(values))
            low = np.where(self.ratio, middle / ratio, middle - Z95 * sd)
            high = np.where(self.ratio, middle * ratio, middle + Z95 * sd)
        ends = zip(self.around(self.natural(values)), (self.lower, self.upper), strict=True)
        least, most = (np.where(self.ratio, bound, seen) for seen, bound in ends)
        return np.stack([np.maximum(low, least), np.minimum(high, most)], axis=1)

    def scaled(self, natural: Numbers) -> Numbers:
        """Natural to scaled coordinates: weights times the scale g; what stands behind the k is kept."""
        return self._times(natural, 1.0)

    def unscaled(self, x: Numbers) -> Numbers:
        """Scaled to natural coordinates, the inverse."""
        return self._times(x, -1.0)

    def _times(self, x: Any, sign: float) -> Any:
        if not self.weights:
            return x
        which, xp = np.array(self.weights, int), library(x)
        factor = xp.exp(sign * x[..., self.scale, None])
        if xp is jnp:
            return x.at[..., which].multiply(factor)
        changed = np.array(x)
        changed[..., which] *= factor
        return changed


def coordinates(
    model: eqx.Module, held: Mapping[str, object] | None = None, channels: tuple[str, ...] = ()
) -> Coordinates:
    """The coordinates of a model's parameters, without those that are held.

    Args:
        model: Gives shapes and bounds.
        held: Names of parameters to leave out.
        channels: For the names.

    Raises:
        ModelError: the model has no formula.
    """
    bare = surface(model) if isinstance(model, AbstractBRDF) else model
    if isinstance(bare, AbstractEstimated):
        raise ModelError(unfitted(bare.name))
    kept = [e for e in entries(model) if not held or e.name not in held]
    each = [(e.param, place) for e in kept for place in range(e.place.start, e.place.stop)]
    return Coordinates(
        places=tuple(place for _, place in each),
        lower=tuple(p.lower for p, _ in each),
        upper=tuple(p.upper for p, _ in each),
        log=tuple(p.scale == "log" for p, _ in each),
        names=tuple(name for e in kept for name in channel_names(e, channels)),
        periods=tuple(p.period for p, _ in each),
    )


def channel_names(entry: Entry, channels: tuple[str, ...]) -> list[str]:
    """The name of each value of a parameter, on one line: "kd r", "kd g", or "alpha" where all channels share it."""
    return channel_labels(entry.name, entry.size, channels, own=bool(entry.shape))
