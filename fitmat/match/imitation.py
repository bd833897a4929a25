"""Imitation: the parameters with which one model comes closest to another over the whole hemisphere.

No measurement takes part: the rows are directions of a quadrature and the values those of the model that is imitated.
"""

import dataclasses
import itertools
from collections.abc import Mapping
from typing import Any, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from fitmat import arguments
from fitmat.errors import FitmatError
from fitmat.fitting.coordinates import Coordinates, coordinates
from fitmat.fitting.refining import STEADY
from fitmat.fitting.result import Fit
from fitmat.fitting.starts import nonnegative
from fitmat.match.distances import direction_weight, incidence_weight
from fitmat.match.regions import incidence_panels
from fitmat.maths.least_squares import least_squares
from fitmat.maths.mapping import mapped
from fitmat.maths.programs import program
from fitmat.maths.quadrature import lobe_rules
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF, evaluate_pairs
from fitmat.models.conversion import exponent_from_alpha
from fitmat.models.metrics import METRICS, Weight
from fitmat.models.parameters import check_range, entries, vector, with_vector
from fitmat.models.registry import model
from fitmat.models.values import at, values, widths
from fitmat.text import brief

LEAST_SQUARES = tuple(name for name, metric in METRICS.items() if metric.kind != "light")
"""Metrics that are sums of squares, and can be minimised as such."""

WEIGHTS: tuple[str, ...] = get_args(Weight)

NODES = (24, 12)
"""Of the quadrature over ω_o, in zenith and azimuth, at each of the incidences of `regions.incidence_panels`."""

WIDER = (0.6, 1.0, 1.7)
"""Starts have the closed-form width, and so many times it."""

REFINED = 3
"""Best starts that are refined."""

MOST_NODES = 64
"""Of the start grid; models with many shapes try the first ones."""


@dataclasses.dataclass(frozen=True, eq=False)
class Imitation:
    """The closest that one model comes to another.

    Attributes:
        model: The imitating model with its best parameters.
        of: Name of the model imitated.
        metric: Key of `LEAST_SQUARES`: what was minimised.
        distance: What remains in that metric, in its unit; of the imitating from the imitated model.
        converged: Whether the solver ended at a minimum.
        weight: Of pairs of directions, where it was not the metric's own.
    """

    model: AbstractBRDF
    of: str
    metric: str
    distance: float
    converged: bool
    weight: Weight | None = None

    __repr__ = brief

    @property
    def parameters(self) -> dict[str, np.ndarray]:
        """Name → values, one per channel where the parameter has them."""
        values = np.asarray(vector(self.model))
        return {e.name: values[e.place] for e in entries(self.model)}

    def __str__(self) -> str:
        """One line."""
        found = ", ".join(f"{k} = {' '.join(f'{x:.4g}' for x in v)}" for k, v in self.parameters.items())
        return f"{self.model.name} closest to {self.of} by {self.metric}: {found}; {self.distance:.3g} apart."


def imitate(
    what: AbstractBRDF | Fit,
    into: str | AbstractBRDF,
    metric: str = "cube-root",
    *,
    fixed: Mapping[str, ArrayLike] | None = None,
    weight: Weight | None = None,
) -> Imitation:
    """The parameters with which a model best imitates another, over all pairs of directions and without noise.

    The least squares of a metric of `distances.METRICS` over a product quadrature, from starts with the closed-form
    width (`conversion`).

    Args:
        what: A model, or a fit, whose surface is imitated.
        into: The imitating model: a name, or a model whose shapes and static choices are used.
        metric: One of `LEAST_SQUARES`.
        fixed: Parameters of the imitating model to hold, by name.
        weight: Of pairs of directions, as in `metrics.Metric`, where it is not the metric's own.

    Raises:
        FitmatError: the metric is no sum of squares, or a model, a parameter or a value is not known.

    Example:
        >>> import fitmat as fm
        >>> imitate(fm.model("lambert+ggx", alpha=0.1), "lambert+blinn-phong").parameters["exponent"]  # doctest: +SKIP
        array([138.2])
    """
    arguments.kind("what", what, AbstractBRDF, Fit)
    arguments.kind("into", into, str, AbstractBRDF)
    arguments.named(fixed=fixed)
    arguments.choice("metric", metric, LEAST_SQUARES)
    arguments.choice("weight", weight, (None, *WEIGHTS))
    source = surface(what.model if isinstance(what, Fit) else what)
    template, moved = _template(source, into, dict(fixed or {}))
    rows = quadrature(source, metric, weight)
    nodes = _nodes(template, moved.index, float(widths(source, vector(source)[None])[0]))
    found = _solve(template, rows, _started(template, nodes, moved, rows, metric), moved)
    ends, square, converged = (np.asarray(part) for part in found)
    best = int(np.argmin(np.nan_to_num(square, nan=np.inf)))
    mean_square = METRICS[metric].kind == "mean square"
    distance = 2.0 / np.pi * square[best] if mean_square else np.sqrt(square[best])
    chosen = with_vector(template, ends[best])
    return Imitation(chosen, source.name, metric, float(distance), bool(converged[best]), weight)


def _template(
    source: AbstractBRDF, into: str | AbstractBRDF, held: dict[str, ArrayLike]
) -> tuple[AbstractBRDF, Coordinates]:
    """The imitating model with what is held at its value, and the coordinates of the rest."""
    up = np.array([[0.0, 0.0, 1.0]])
    channels = at(source, up, up).shape[1]
    template = surface(model(into, channels=channels) if isinstance(into, str) else into)
    numbers, places = np.array(vector(template)), {e.name: e.place for e in entries(template)}
    for name, value in held.items():
        if name not in places:
            raise FitmatError(f"cannot fix {name!r}: {template.name} has {', '.join(places)}.")
        given = arguments.numbers(f"fixed {name}", value)
        if given.shape not in ((), (1,), numbers[places[name]].shape):
            raise FitmatError(f"fixed {name} has {given.size} values: expected 1 or {numbers[places[name]].size}.")
        numbers[places[name]] = given
    template = with_vector(template, numbers)
    check_range(template)
    return template, coordinates(template, held)


def _nodes(template: AbstractBRDF, free: np.ndarray, width: float) -> Float[np.ndarray, "k p"]:
    """The start grid: slopes and exponents near the closed form of a width, other shapes at their own starts."""
    base = np.array(vector(template))
    shapes = [e for e in entries(template) if not e.param.weight and e.place.start in free]
    grid = []
    for entry in shapes:
        slope, power = entry.name.endswith(("alpha", "alpha_x", "alpha_y")), entry.name.startswith("exponent")
        own = entry.param.starts or (base[entry.place.start],)
        near = [width * w if slope else exponent_from_alpha(min(width * w, 0.99)) for w in WIDER]
        grid.append([np.clip(x, entry.param.lower, entry.param.upper) for x in (near if slope or power else own)])
    nodes = []
    for chosen in itertools.islice(itertools.product(*grid), MOST_NODES):
        node = base.copy()
        for entry, value in zip(shapes, chosen, strict=True):
            node[entry.place] = value
        nodes.append(node)
    return np.array(nodes)


class Target(eqx.Module):
    """Pairs of directions with what is imitated there, in NumPy's arrays outside of programs.

    Attributes:
        wi: Directions to the light, (n, 3).
        wo: Directions to the sensor, (n, 3).
        root: √(w/V), (n, 1): the sum of squares of the residuals is T/V.
        value: f of the imitated model, (n, c).
        metric: Place in `LEAST_SQUARES`, traced.
    """

    wi: Any
    wo: Any
    root: Any
    value: Any
    metric: Any


def _started(
    template: AbstractBRDF, nodes: Float[np.ndarray, "k p"], moved: Coordinates, rows: Target, metric: str
) -> Float[np.ndarray, "e p"]:
    """The `REFINED` best nodes with their weights solved, the transform taken as straight about the imitated values."""
    free = set(moved.places)
    places = np.array(
        [k for e in entries(template) if e.param.weight for k in range(e.place.start, e.place.stop) if k in free], int
    )
    cosines, transform = (rows.wi[:, 2:], rows.wo[:, 2:]), METRICS[metric].transform
    target, step = transform(rows.value, *cosines), 1e-6 * np.abs(rows.value) + 1e-12
    slope = (transform(rows.value + step, *cosines) - transform(rows.value - step, *cosines)) / (2.0 * step)
    upper, solved, cost = np.array(coordinates(template).upper)[places], [], []
    for node in nodes:
        lit = np.tile(node, (1 + len(places), 1))
        lit[:, places] = 0.0
        lit[np.arange(1, len(lit)), places] = 1.0
        f = values(template, lit, rows.wi, rows.wo)
        offset, scale = f[0], rows.root * slope
        columns = ((f[1:] - offset) * scale).reshape(len(places), offset.size)
        start = lit[0]
        if len(places):
            weights = nonnegative(columns @ columns.T, columns @ ((rows.value - offset) * scale).ravel())
            start[places] = np.minimum(weights, upper)
        found = offset + np.tensordot(start[places], f[1:] - offset, 1)
        solved.append(start if len(places) else node)
        cost.append(np.sum((rows.root * (transform(found, *cosines) - target)) ** 2))
    return np.array(solved)[np.argsort(np.nan_to_num(cost, nan=np.inf), kind="stable")[:REFINED]]


@program
def _solve(
    template: AbstractBRDF, rows: Target, starts: ArrayLike, moved: Coordinates
) -> tuple[Float[Array, "e p"], Float[Array, " e"], Array]:
    """The ends of the starts: parameters, T/V, and whether the solver was content."""

    def transformed(f: Array) -> Array:
        cosines = rows.wi[:, 2:], rows.wo[:, 2:]
        branches = [lambda f, k=name: METRICS[k].transform(f, *cosines) for name in LEAST_SQUARES]
        return jax.lax.switch(rows.metric, branches, f)

    target = transformed(rows.value)

    def residual(u: Array, base: Array) -> tuple[Array, None]:
        f = evaluate_pairs(with_vector(template, moved.from_unbounded(base, u)), rows.wi, rows.wo)
        return rows.root * (transformed(f) - target), None

    def refined(base: Array) -> tuple[Array, Array, Array]:
        end = least_squares(residual, moved.unbounded(base), base)
        return moved.from_unbounded(base, end.x), end.square, end.solved | (end.offset < STEADY)

    return mapped(refined, jnp.asarray(starts))


def quadrature(source: AbstractBRDF, metric: str, weight: Weight | None = None) -> Target:
    """The pairs of directions and what is imitated there, dense where the imitated lobe is; see `imitate`."""
    measure = METRICS[metric] if weight is None else dataclasses.replace(METRICS[metric], weight=weight)
    theta, solid = incidence_panels()
    width = float(widths(source, vector(source)[None])[0])
    rules = lobe_rules(theta, width, isotropic=source.isotropic, nodes=NODES)
    wi = np.concatenate([np.broadcast_to(rule.wi, rule.wo.shape) for rule in rules])
    wo = np.concatenate([rule.wo for rule in rules])
    f = at(source, wi, wo)
    of_light = np.repeat(incidence_weight(measure, theta, solid), len(rules) // len(theta))
    of_sensor = [direction_weight(measure, rule) for rule in rules]
    every = np.concatenate([light * part for light, part in zip(of_light, of_sensor, strict=True)])
    norm = every @ ((f**2).mean(axis=1) if METRICS[metric].kind == "relative" else np.ones(len(f)))
    root = np.sqrt(every / norm / f.shape[1])[:, None]
    return Target(wi, wo, root, f, np.array(LEAST_SQUARES.index(metric)))
