"""Distances between two models by every metric of the literature, over the hemisphere, by incidence and by region.

It judges no distance and reads no measurements.
"""

import dataclasses
from collections.abc import Callable
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat._types import Scalar
from fitmat.match.regions import GRAZING_DEG, NGAN_DEG, REGIONS, incidence_panels, memberships
from fitmat.maths.quadrature import Rule, lobe_rule
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import with_vector
from fitmat.uncertainty.estimate import Estimate, band, estimate

AZIMUTHS = 4
"""Azimuths of incidence over half a turn, where a model is anisotropic."""

ANGLES = np.deg2rad(np.arange(0.0, 86.0, 5.0))
"""Incidence angles of all curves against incidence, radians."""

EPSILON = 1e-3
"""What the log ratio adds to both values, and the floor of its cosines (sr⁻¹; 1)."""

_ROOT_FLOOR = 1e-12
# ∛x has no slope at 0; a smaller f cosθ_i counts as this.


@dataclasses.dataclass(frozen=True)
class Metric:
    """How the values of two BRDFs are compared: T = ∫∫ |t(f₁) − t(f₂)|ᵖ w over V = ∫∫ w, the same pairs of directions.

    Attributes:
        transform: t(f, c_i, c_o) of values (m, c) and cosines () and (m, 1).
        weight: w: "solid" dω_i dω_o, "within" the same up to `NGAN_DEG`, "projected" c_i c_o dω_i dω_o.
        kind: "relative" √(T/∫∫ f₂² w), "rms" √(T/V), "mean square" T/V, all with p = 2; "light" T/π with p = 1.
        words: What it measures, and its unit.
    """

    transform: Callable[[Array, Scalar, Array], Array]
    weight: Literal["solid", "within", "projected"]
    kind: Literal["relative", "rms", "mean square", "light"]
    words: str


METRICS = {
    "relative": Metric(
        lambda f, ci, co: f, "projected", "relative",
        "√(∫∫ (f₁ − f₂)² c_i c_o / ∫∫ f₂² c_i c_o): a fraction of the second model, weighted as light is",
    ),
    "ngan": Metric(
        lambda f, ci, co: f * ci, "within", "rms",
        f"rms of (f₁ − f₂) cosθ_i up to {NGAN_DEG:g}°, sr⁻¹ (Ngan et al. 2005): what the peak of the highlight says",
    ),
    "low-e1": Metric(
        lambda f, ci, co: f * ci, "solid", "mean square",
        "mean of ((f₁ − f₂) cosθ_i)² sinθ_i, sr⁻² (Löw et al. 2012, E1)",
    ),
    "low-e2": Metric(
        lambda f, ci, co: jnp.log1p(f * ci), "solid", "mean square",
        "mean of (ln(1 + f₁ cosθ_i) − ln(1 + f₂ cosθ_i))² sinθ_i (Löw et al. 2012, E2): bright parts count less",
    ),
    "cube-root": Metric(
        lambda f, ci, co: jnp.cbrt(jnp.maximum(f * ci, _ROOT_FLOOR)), "solid", "rms",
        "rms of ∛(f₁ cosθ_i) − ∛(f₂ cosθ_i), sr^(−1/3): closest to what eyes judge",
    ),
    "log-ratio": Metric(
        lambda f, ci, co: jnp.log(f * jnp.maximum(ci * co, EPSILON) + EPSILON), "solid", "rms",
        f"rms of ln((f₁κ + ε)/(f₂κ + ε)), κ = max(cosθ_i cosθ_o, {EPSILON:g}), ε = {EPSILON:g} sr⁻¹: faint parts count",
    ),
    "albedo": Metric(
        lambda f, ci, co: f, "projected", "light",
        "∫∫ |f₁ − f₂| c_i c_o/π: light that leaves in another direction, or not at all, as a fraction of what arrives",
    ),
}  # fmt: skip
"""Metric → definition. Averages are over solid angle of ω_o and ω_i, Löw's over θ_i evenly in angle; f is averaged over
the channels after |·|ᵖ. What is known of eyes: Fores et al. 2012; Lavoué et al. 2021 (README of the design)."""


@dataclasses.dataclass(frozen=True, eq=False)
class Distances:
    """How far the first model is from the second, in every metric; values at the best fits with 95 % intervals.

    Attributes:
        theta_i: Incidence of the curves, radians, (k,).
        whole: Metric → distance over all pairs of directions.
        measured: The relative distance over the incidence angles of the measurements.
        by_region: Metric → region → distance over the region's pairs; for "albedo" the region's part of the whole.
        share: Metric → region → fraction of the whole difference T that lies there.
        by_incidence: Metric → distance at each incidence, rows low, best, high, (3, k); NaN where it has no pairs.
        by_incidence_and_region: Metric → the same for each region, (3, k, 4), in the order of `regions.REGIONS`.
        grazing_excess: Light from beyond `GRAZING_DEG` that the first reflects, over what the second does, minus 1.
        albedos: Channel-mean directional albedo of both at each draw and incidence, best first, (2, 1 + draws, k).
    """

    theta_i: Float[np.ndarray, " k"]
    whole: dict[str, Estimate]
    measured: Estimate
    by_region: dict[str, dict[str, Estimate]]
    share: dict[str, dict[str, Estimate]]
    by_incidence: dict[str, Float[np.ndarray, "3 k"]]
    by_incidence_and_region: dict[str, Float[np.ndarray, "3 k 4"]]
    grazing_excess: Estimate
    albedos: Float[np.ndarray, "2 d k"]


Values = tuple[Float[np.ndarray, "d p"], Float[np.ndarray, "d q"]]
"""Parameter vectors of both models, the best fits first, then posterior draws."""


def measure_distances(
    first: AbstractBRDF, second: AbstractBRDF, values: Values, measured: Float[np.ndarray, " a"]
) -> Distances:
    """Every distance of two models, with intervals over draws of their parameters.

    Args:
        first: Its shapes and static choices; mounts and instruments are taken away.
        second: The same; its lobe, as wide as in the first row of `values`, says where the regions are.
        values: Parameters of both.
        measured: Incidence angles for `Distances.measured`, radians.
    """
    theta, solid = incidence_panels()
    nodes = np.concatenate([theta, measured, ANGLES])
    over, at, curves = np.split(np.arange(len(nodes)), [len(theta), len(theta) + len(measured)])
    width = surface(with_vector(second, jnp.asarray(values[1][0]))).width()
    vectors = jnp.asarray(values[0]), jnp.asarray(values[1])
    top, bottom, albedos = (np.asarray(x) for x in _integrals(first, second, vectors, jnp.asarray(nodes), width))
    result: dict[str, dict] = {key: {} for key in ("whole", "by_region", "share", "by_incidence", "both")}
    for k, (name, metric) in enumerate(METRICS.items()):
        t, b = (part[:, over, k] * incidence_weight(metric, theta, solid)[:, None] for part in (top, bottom))
        t, b = t.sum(axis=1), b.sum(axis=1)
        spread, shares = _over_nodes(metric, t, b), t / np.maximum(t.sum(axis=1, keepdims=True), 1e-300)
        result["whole"][name] = estimate(_over_nodes(metric, t.sum(axis=1), b.sum(axis=1)))
        result["by_region"][name] = {region: estimate(spread[:, r]) for r, region in enumerate(REGIONS)}
        result["share"][name] = {region: estimate(shares[:, r]) for r, region in enumerate(REGIONS)}
        t, b = top[:, curves, k], bottom[:, curves, k]
        result["by_incidence"][name] = band(_at_node(metric, t.sum(axis=2), b.sum(axis=2), ANGLES))
        result["both"][name] = band(_at_node(metric, t, b, ANGLES[:, None]))
    place = list(METRICS).index("relative")
    t, b = (part[:, at, place].sum(axis=2) @ np.cos(measured) for part in (top, bottom))
    light = albedos[:, over].transpose(2, 0, 1) @ np.where(theta > np.deg2rad(GRAZING_DEG), solid * np.cos(theta), 0.0)
    return Distances(
        theta_i=ANGLES,
        whole=result["whole"],
        measured=estimate(_over_nodes(METRICS["relative"], t, b)),
        by_region=result["by_region"],
        share=result["share"],
        by_incidence=result["by_incidence"],
        by_incidence_and_region=result["both"],
        grazing_excess=estimate(light[0] / np.maximum(light[1], 1e-300) - 1.0),
        albedos=albedos[:, curves].transpose(2, 0, 1),
    )


def incidence_weight(metric: Metric, theta: np.ndarray, solid: np.ndarray) -> np.ndarray:
    """What of w belongs to ω_i: dω_i, with c_i or the limit of 80° where the metric has it."""
    kept = {"solid": 1.0, "projected": np.cos(theta), "within": theta <= np.deg2rad(NGAN_DEG)}
    return solid * kept[metric.weight]


def _over_nodes(metric: Metric, top: np.ndarray, bottom: np.ndarray) -> np.ndarray:
    """The distance from T and V, or ∫∫ f₂² w; Löw's dθ_i sinθ_i over π/2 is 2/π of the mean over solid angle."""
    if metric.kind == "light":
        return top / np.pi
    mean = top / np.where(bottom > 0, bottom, np.nan)
    return 2.0 / np.pi * mean if metric.kind == "mean square" else np.sqrt(mean)


def _at_node(metric: Metric, top: np.ndarray, bottom: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """The same of a single incidence: light as a fraction of what arrives from there, Löw's with sinθ_i."""
    kept = np.where(theta <= np.deg2rad(NGAN_DEG), 1.0, np.nan) if metric.weight == "within" else 1.0
    factor = {"light": np.pi, "mean square": np.pi / 2.0 * np.sin(theta)}.get(metric.kind, 1.0)
    return kept * factor * _over_nodes(metric, top, bottom)


@eqx.filter_jit
def _integrals(
    first: AbstractBRDF, second: AbstractBRDF, values: tuple[Array, Array], theta_i: Array, width: Array
) -> tuple[Float[Array, "d k m r"], Float[Array, "d k m r"], Float[Array, "d k 2"]]:
    """∫ |t(f₁) − t(f₂)|ᵖ w and ∫ w (or ∫ f₂² w) over ω_o: draw, incidence, metric, region; and both albedos."""
    isotropic = surface(first).isotropic and surface(second).isotropic
    turns = jnp.zeros(1) if isotropic else (jnp.arange(AZIMUTHS) + 0.5) * jnp.pi / AZIMUTHS

    def at(theta: Array, phi: Array, one: AbstractBRDF, two: AbstractBRDF) -> tuple[Array, Array, Array]:
        rule = lobe_rule(theta, jnp.minimum(one.width(), two.width()), phi_i=None if isotropic else phi)
        f = tuple(jax.vmap(lambda wo, g=g: jnp.atleast_1d(g(rule.wi, wo)))(rule.wo) for g in (one, two))
        inside = memberships(rule.wi, rule.wo, width)
        tops, bottoms = zip(*(_terms(metric, rule, *f) for metric in METRICS.values()), strict=True)
        albedo = jnp.stack([(rule.weight @ g).mean() for g in f])
        return jnp.stack(tops) @ inside, jnp.stack(bottoms) @ inside, albedo

    def pair(both: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        one, two = (surface(with_vector(f, v)) for f, v in zip((first, second), both, strict=True))
        every = jax.vmap(lambda phi: jax.vmap(lambda theta: at(theta, phi, one, two))(theta_i))(turns)
        return jax.tree.map(lambda part: part.mean(axis=0), every)

    return jax.lax.map(pair, values)


def _terms(metric: Metric, rule: Rule, one: Array, two: Array) -> tuple[Float[Array, " m"], Float[Array, " m"]]:
    """Integrand and normaliser at the nodes of a rule, channel means, with the weight of ω_o."""
    ci, co, w = rule.wi[2], rule.wo[:, 2:], direction_weight(metric, rule)
    apart = jnp.abs(metric.transform(one, ci, co) - metric.transform(two, ci, co))
    apart = apart if metric.kind == "light" else apart**2
    return w * apart.mean(axis=1), w * (two**2).mean(axis=1) if metric.kind == "relative" else w


def direction_weight(metric: Metric, rule: Rule) -> Float[Array, " m"]:
    """What of w belongs to ω_o, at the nodes of a rule."""
    if metric.weight == "projected":
        return rule.weight
    solid = jnp.where(rule.weight > 0, rule.weight / jnp.maximum(rule.wo[:, 2], 1e-12), 0.0)
    low = rule.wo[:, 2] < np.cos(np.deg2rad(NGAN_DEG))
    return jnp.where(low, 0.0, solid) if metric.weight == "within" else solid
