"""Imitation: the parameters with which one model comes closest to another over the whole hemisphere.

No measurement takes part: the rows are directions of a quadrature and the values those of the model that is imitated.
"""

import dataclasses
import itertools
from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, ArrayLike, Float

from fitmat.errors import FitmatError
from fitmat.fitting.coordinates import Coordinates, coordinates
from fitmat.fitting.fitting import STEADY
from fitmat.fitting.likelihood import mapped
from fitmat.fitting.result import Fit
from fitmat.fitting.starts import nonnegative
from fitmat.match.distances import AZIMUTHS, direction_weight, incidence_weight
from fitmat.match.regions import incidence_panels
from fitmat.maths.least_squares import least_squares
from fitmat.maths.quadrature import Rule, lobe_rule
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF, evaluate_pairs
from fitmat.models.conversion import exponent_from_alpha
from fitmat.models.metrics import METRICS
from fitmat.models.parameters import check_range, entries, vector, with_vector
from fitmat.models.registry import model

LEAST_SQUARES = tuple(name for name, metric in METRICS.items() if metric.kind != "light")
"""Metrics that are sums of squares, and can be minimised as such."""

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
    """

    model: AbstractBRDF
    of: str
    metric: str
    distance: float
    converged: bool

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
) -> Imitation:
    """The parameters with which a model best imitates another, over all pairs of directions and without noise.

    The least squares of a metric of `distances.METRICS` over a product quadrature, from starts with the closed-form
    width (`conversion`).

    Args:
        what: A model, or a fit, whose surface is imitated.
        into: The imitating model: a name, or a model whose shapes and static choices are used.
        metric: One of `LEAST_SQUARES`.
        fixed: Parameters of the imitating model to hold, by name.

    Raises:
        FitmatError: the metric is no sum of squares, or a model, a parameter or a value is not known.

    Example:
        >>> import fitmat as fm
        >>> imitate(fm.model("lambert+ggx", alpha=0.1), "lambert+blinn-phong").parameters["exponent"]  # doctest: +SKIP
        array([138.2])
    """
    if metric not in LEAST_SQUARES:
        raise FitmatError(f"metric {metric!r}: expected one of {', '.join(LEAST_SQUARES)}.")
    source = surface(what.model if isinstance(what, Fit) else what)
    template, moved = _template(source, into, dict(fixed or {}))
    nodes = _nodes(template, moved.index, float(source.width()))
    index = jnp.asarray(LEAST_SQUARES.index(metric))
    found = _solve(source, template, jnp.asarray(nodes), index, moved)
    values, square, converged = (np.asarray(part) for part in found)
    best = int(np.argmin(np.nan_to_num(square, nan=np.inf)))
    mean_square = METRICS[metric].kind == "mean square"
    distance = 2.0 / np.pi * square[best] if mean_square else np.sqrt(square[best])
    chosen = with_vector(template, jnp.asarray(values[best]))
    return Imitation(chosen, source.name, metric, float(distance), bool(converged[best]))


def _template(
    source: AbstractBRDF, into: str | AbstractBRDF, held: dict[str, ArrayLike]
) -> tuple[AbstractBRDF, Coordinates]:
    """The imitating model with what is held at its value, and the coordinates of the rest."""
    up = jnp.array([0.0, 0.0, 1.0])
    channels = jax.eval_shape(lambda: jnp.atleast_1d(source(up, up))).size
    template = surface(model(into, channels=channels) if isinstance(into, str) else into)
    values, places = np.array(vector(template)), {e.name: e.place for e in entries(template)}
    for name, value in held.items():
        if name not in places:
            raise FitmatError(f"cannot fix {name!r}: {template.name} has {', '.join(places)}.")
        values[places[name]] = value
    template = with_vector(template, jnp.asarray(values))
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
    for values in itertools.islice(itertools.product(*grid), MOST_NODES):
        node = base.copy()
        for entry, value in zip(shapes, values, strict=True):
            node[entry.place] = value
        nodes.append(node)
    return np.array(nodes)


@eqx.filter_jit
def _solve(
    source: AbstractBRDF, template: AbstractBRDF, nodes: Float[Array, "k p"], metric: Array, moved: Coordinates
) -> tuple[Float[Array, "e p"], Float[Array, " e"], Array]:
    """The ends of the best starts: parameters, T/V, and whether the solver was content; `metric` is traced."""
    rows = _rows(source, metric)
    weights = [
        k for e in entries(template) if e.param.weight for k in range(e.place.start, e.place.stop) if k in moved.places
    ]

    def residual(u: Array, base: Array) -> Array:
        return rows.residual(with_vector(template, moved.from_unbounded(base, u)))

    def started(node: Array) -> tuple[Array, Array]:
        start = _weighted(template, node, jnp.array(weights, int), rows) if weights else node
        return start, jnp.sum(rows.residual(with_vector(template, start)) ** 2)

    starts, cost = jax.lax.map(started, nodes)
    first = starts[jnp.argsort(cost)[:REFINED]]

    def refined(base: Array) -> tuple[Array, Array, Array]:
        end = least_squares(residual, moved.unbounded(base), base)
        best = with_vector(template, moved.from_unbounded(base, end.x))
        solved = (end.result == optx.RESULTS.successful) | (end.offset < STEADY)
        return vector(best), jnp.sum(rows.residual(best) ** 2), solved

    return mapped(refined, first)


class Target(eqx.Module):
    """Pairs of directions with what is imitated there.

    Attributes:
        wi: Directions to the light, (n, 3).
        wo: Directions to the sensor, (n, 3).
        root: √(w/V), (n, 1): the sum of squares of the residuals is T/V.
        target: t of the imitated model, (n, c).
        slope: dt/df there, (n, c).
        value: f of the imitated model, (n, c).
        metric: Place in `LEAST_SQUARES`, traced.
    """

    wi: Float[Array, "n 3"]
    wo: Float[Array, "n 3"]
    root: Float[Array, "n 1"]
    target: Float[Array, "n c"]
    slope: Float[Array, "n c"]
    value: Float[Array, "n c"]
    metric: Array

    def residual(self, imitating: AbstractBRDF) -> Float[Array, "n c"]:
        """√(w/V) (t(f) − t(f_2))."""
        f = evaluate_pairs(imitating, self.wi, self.wo)
        return self.root * (_transformed(self.metric, f, self.wi, self.wo) - self.target)


def _transformed(metric: Array, f: Array, wi: Array, wo: Array) -> Array:
    branches = [lambda f, k=name: METRICS[k].transform(f, wi[:, 2:], wo[:, 2:]) for name in LEAST_SQUARES]
    return jax.lax.switch(metric, branches, f)


def _rows(source: AbstractBRDF, metric: Array) -> Target:
    """The quadrature, dense where the imitated lobe is."""
    theta, solid = incidence_panels()
    turns = jnp.zeros(1) if source.isotropic else (jnp.arange(AZIMUTHS) + 0.5) * jnp.pi / AZIMUTHS
    place = jnp.stack([jnp.repeat(turns, len(theta)), jnp.tile(jnp.asarray(theta), len(turns))], axis=1)

    def at(turn: Array, angle: Array) -> Rule:
        return lobe_rule(angle, source.width(), phi_i=None if source.isotropic else turn, nodes=NODES)

    rules = jax.vmap(at)(*place.T)
    wi = jnp.broadcast_to(rules.wi[:, None], rules.wo.shape).reshape(-1, 3)
    wo = rules.wo.reshape(-1, 3)
    f = evaluate_pairs(source, wi, wo)
    of_light = jnp.asarray([incidence_weight(METRICS[name], theta, solid) for name in LEAST_SQUARES])
    of_sensor = jnp.stack([jax.vmap(lambda r, k=k: direction_weight(METRICS[k], r))(rules) for k in LEAST_SQUARES])
    weight = (jnp.tile(of_light, len(turns))[..., None] * of_sensor).reshape(len(LEAST_SQUARES), -1)[metric]
    relative = jnp.asarray([METRICS[name].kind == "relative" for name in LEAST_SQUARES])[metric]
    norm = weight @ jnp.where(relative, (f**2).mean(axis=1), 1.0)
    target, slope = jax.jvp(lambda f: _transformed(metric, f, wi, wo), (f,), (jnp.ones_like(f),))
    return Target(wi, wo, jnp.sqrt(weight / norm / f.shape[1])[:, None], target, slope, f, metric)


def _weighted(template: AbstractBRDF, node: Array, places: Array, rows: Target) -> Array:
    """The node with its weights solved, the transform taken as straight about the imitated values."""

    def value(p: Array) -> Array:
        return evaluate_pairs(with_vector(template, p), rows.wi, rows.wo)

    dark = node.at[places].set(0.0)
    offset, scale = value(dark), rows.root * rows.slope
    columns = jax.lax.map(lambda k: ((value(dark.at[k].set(1.0)) - offset) * scale).ravel(), places)
    target = ((rows.value - offset) * scale).ravel()
    limit = jnp.asarray(coordinates(template).upper)[places]
    return dark.at[places].set(jnp.minimum(nonnegative(columns @ columns.T, columns @ target), limit))
