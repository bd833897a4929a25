"""Distances between two models by every metric of the literature, over the hemisphere, by incidence and by region.

It judges no distance and reads no measurements.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from fitmat.match.regions import GRAZING_DEG, REGIONS, incidence_panels, memberships
from fitmat.maths.arrays import library
from fitmat.maths.quadrature import AZIMUTH_NODES, ZENITH_NODES, Rule, lobe_rules
from fitmat.models.base import AbstractBRDF
from fitmat.models.metrics import METRICS, NGAN_DEG, Metric
from fitmat.models.values import Draws, blocks, channel_mean, surfaces, widths
from fitmat.text import brief
from fitmat.uncertainty.estimate import Estimate, band, estimate, estimates

COARSE = (24, 12)
"""Nodes behind the spread of the draws; the best fits are integrated with all nodes."""

WITHIN = np.deg2rad(2.5)
"""An incidence so near to one that was measured is not beyond it."""

EXTRAPOLATED = 0.5
"""Relative standard deviation of a difference at incidences smaller or larger than all that were measured.

Two models that follow the same readings differ beyond them by how each goes on, and one of the two at least goes wrong
there, of which no draw of its parameters knows. Whoever measures there fits both anew, and finds of the difference
anything from nothing to twice as much: the least that holds what a laboratory finds of another's range of incidences.
"""

ANGLES = np.deg2rad(np.arange(0.0, 86.0, 5.0))
"""Incidence angles of all curves against incidence, radians."""


@dataclasses.dataclass(frozen=True, eq=False)
class Distances:
    """How far the first model is from the second, in every metric; values at the best fits with 95 % intervals.

    Attributes:
        theta_i: Incidence of the curves, radians, (k,).
        whole: Metric → distance over all pairs of directions.
        relative: The relative distance over all pairs at each draw, best first, (1 + draws,).
        measured: The relative distance over the incidence angles of the measurements.
        beyond: Fraction of the whole relative difference T that lies at incidences smaller or larger than all of these.
        by_region: Metric → region → distance over the region's pairs; for "albedo" the region's part of the whole.
        share: Metric → region → fraction of the whole difference T that lies there.
        by_incidence: Metric → distance at each incidence, rows low, best, high, (3, k); NaN where it has no pairs.
        by_incidence_and_region: Metric → the same for each region, (3, k, 4), in the order of `regions.REGIONS`.
        grazing_excess: Light from beyond `GRAZING_DEG` that the first reflects, over what the second does, minus 1.
        albedos: Channel-mean directional albedo of both at each draw and incidence, best first, (2, 1 + draws, k).
    """

    theta_i: Float[np.ndarray, " k"]
    whole: dict[str, Estimate]
    relative: Float[np.ndarray, " d"]
    measured: Estimate
    beyond: float
    by_region: dict[str, dict[str, Estimate]]
    share: dict[str, dict[str, Estimate]]
    by_incidence: dict[str, Float[np.ndarray, "3 k"]]
    by_incidence_and_region: dict[str, Float[np.ndarray, "3 k 4"]]
    grazing_excess: Estimate
    albedos: Float[np.ndarray, "2 d k"]

    __repr__ = brief


PairedDraws = tuple[Float[np.ndarray, "d p"], Float[np.ndarray, "d q"]]
"""Parameter vectors of both models, the best fits first, then posterior draws."""


def measure_distances(
    first: AbstractBRDF,
    second: AbstractBRDF,
    draws: PairedDraws,
    measured: Float[np.ndarray, " a"],
    metrics: Mapping[str, Metric] = METRICS,
) -> Distances:
    """Every distance of two models, with intervals over draws of their parameters.

    Args:
        first: Its shapes and static choices; mounts and instruments are taken away.
        second: The same; its lobe, as wide as in the first row of `draws`, says where the regions are.
        draws: Parameters of both.
        measured: Incidence angles for `Distances.measured`, radians; beyond them a difference is known to a factor.
        metrics: Those that are asked for, "relative" among them.
    """
    theta, solid = incidence_panels()
    nodes = np.concatenate([theta, measured, ANGLES])
    over, at, curves = np.split(np.arange(len(nodes)), [len(theta), len(theta) + len(measured)])
    pair = surfaces(first, draws[0]), surfaces(second, draws[1])
    every = [widths(*part) for part in pair]
    of_lobe = min(w.min() for w in every), every[1][0]
    asked = tuple(metrics.values())
    best = _integrals(_first(pair), nodes, of_lobe, (ZENITH_NODES, AZIMUTH_NODES), asked)
    top, bottom, albedos = _spread_about(best, _integrals(pair, nodes, of_lobe, COARSE, asked))
    if not all(np.allclose(part, part[0], rtol=1e-9, atol=0.0) for part in draws):  # an objective has no intervals
        powers = np.array([1.0 if metric.kind == "light" else 2.0 for metric in asked])
        top *= extrapolation(nodes, measured, len(top))[:, :, None, None] ** powers[:, None]
    result: dict[str, dict] = {key: {} for key in ("draws", "whole", "by_region", "share", "by_incidence", "both")}
    for k, (name, metric) in enumerate(metrics.items()):
        t, b = (part[:, over, k] * incidence_weight(metric, theta, solid)[:, None] for part in (top, bottom))
        t, b = t.sum(axis=1), b.sum(axis=1)
        spread, shares = _over_nodes(metric, t, b), t / np.maximum(t.sum(axis=1, keepdims=True), 1e-300)
        result["draws"][name] = _over_nodes(metric, t.sum(axis=1), b.sum(axis=1))
        result["whole"][name] = estimate(result["draws"][name])
        result["by_region"][name] = dict(zip(REGIONS, estimates(spread), strict=True))
        result["share"][name] = dict(zip(REGIONS, estimates(shares), strict=True))
        t, b = top[:, curves, k], bottom[:, curves, k]
        result["by_incidence"][name] = band(_at_node(metric, t.sum(axis=2), b.sum(axis=2), ANGLES))
        result["both"][name] = band(_at_node(metric, t, b, ANGLES[:, None]))
    place = list(metrics).index("relative")
    t, b = (part[:, at, place].sum(axis=2) @ np.cos(measured) for part in (top, bottom))
    light = albedos[:, over].transpose(2, 0, 1) @ np.where(theta > np.deg2rad(GRAZING_DEG), solid * np.cos(theta), 0.0)
    return Distances(
        theta_i=ANGLES,
        whole=result["whole"],
        relative=result["draws"]["relative"],
        measured=estimate(_over_nodes(METRICS["relative"], t, b)),
        beyond=_beyond(top[0, over, place].sum(axis=1) * solid * np.cos(theta), theta, measured),
        by_region=result["by_region"],
        share=result["share"],
        by_incidence=result["by_incidence"],
        by_incidence_and_region=result["both"],
        grazing_excess=estimate(light[0] / np.maximum(light[1], 1e-300) - 1.0),
        albedos=albedos[:, curves].transpose(2, 0, 1),
    )


def extrapolation(
    theta: Float[np.ndarray, " k"], measured: Float[np.ndarray, " a"], count: int
) -> Float[np.ndarray, "count k"]:
    """How many times as large a difference may be as two models have it: 1 in the first row and where was measured.

    Args:
        theta: Incidences, radians.
        measured: Those that were measured.
        count: Rows, the best fits and draws.
    """
    z = np.random.default_rng(0).standard_normal((count, 2))
    below, above = np.abs(1.0 + EXTRAPOLATED * np.where(np.arange(count)[:, None] > 0, z, 0.0)).T[:, :, None]
    least, most = _range(measured)
    return np.where(theta < least, below, np.where(theta > most, above, 1.0))


def _range(measured: np.ndarray) -> tuple[float, float]:
    """Between which incidences nothing is extrapolated."""
    return float(measured.min() - WITHIN), float(measured.max() + WITHIN)


def _beyond(parts: np.ndarray, theta: np.ndarray, measured: np.ndarray) -> float:
    """Fraction of parts at incidences `theta` that lie outside the range of those measured."""
    least, most = _range(measured)
    return float(parts[(theta < least) | (theta > most)].sum() / max(parts.sum(), 1e-300))


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


Integrals = tuple[Float[np.ndarray, "d k m r"], Float[np.ndarray, "d k m r"], Float[np.ndarray, "d k 2"]]


def _first(pair: tuple[Draws, Draws]) -> tuple[Draws, Draws]:
    """The best fits alone."""
    (one, first), (other, second) = pair
    return (one, first[:1]), (other, second[:1])


def _spread_about(best: Integrals, draws: Integrals) -> Integrals:
    """Integrals of draws by a coarse rule, each by as much too large or small as that of the best fit was.

    Where the coarse rule has no node in a region, the draws change there as they do over all regions together.
    """

    def corrected(exact: np.ndarray, coarse: np.ndarray) -> np.ndarray:
        whole = coarse.sum(axis=-1, keepdims=True)
        seen, any_seen = coarse[:1] > 0, whole[:1] > 0
        change = np.where(seen, coarse / np.where(seen, coarse[:1], 1.0), whole / np.where(any_seen, whole[:1], 1.0))
        return exact * change

    top, bottom, albedos = (corrected(*parts) for parts in zip(best, draws, strict=True))
    return top, bottom, albedos


def _integrals(
    pair: tuple[Draws, Draws],
    theta_i: Float[np.ndarray, " k"],
    of_lobe: tuple[float, float],
    nodes: tuple[int, int],
    metrics: Sequence[Metric],
) -> Integrals:
    """∫ |t(f₁) − t(f₂)|ᵖ w and ∫ w (or ∫ f₂² w) over ω_o: draw, incidence, metric, region; and both albedos.

    Args:
        pair: Both models with their draws.
        theta_i: Incidences in radians.
        of_lobe: Width of the narrowest lobe of all draws, which the rule resolves, and that which makes the regions.
        nodes: Of the rule over ω_o.
        metrics: What is integrated.
    """
    isotropic = all(model.isotropic for model, _ in pair)
    rules = lobe_rules(theta_i, of_lobe[0], isotropic=isotropic, nodes=nodes)
    turns = len(rules) // len(theta_i)
    weights = [_weights(rule, memberships(rule.wi, rule.wo, of_lobe[1]), metrics) for rule in rules]
    shape = len(pair[0][1]), len(theta_i), len(metrics), len(REGIONS)
    top, bottom, albedos = np.zeros(shape), np.zeros(shape), np.zeros((*shape[:2], 2))
    for rows, k, found in blocks(pair, [(rule.wi, rule.wo) for rule in rules]):
        place = k // turns
        t, b = _terms(rules[k], weights[k], found, metrics)
        top[rows, place] += t.transpose(1, 0, 2) / turns
        bottom[rows, place] += b.transpose(1, 0, 2) / turns
        albedos[rows, place] += np.stack([channel_mean(f) @ rules[k].weight for f in found], axis=1) / turns
    return top, bottom, albedos


def _weights(rule: Rule, inside: Float[np.ndarray, "m r"], metrics: Sequence[Metric]) -> Float[np.ndarray, "m w r"]:
    """Each of the weights of ω_o that metrics have at the nodes of a rule, by region."""
    every = {metric.weight: metric for metric in metrics}
    return np.stack([direction_weight(metric, rule)[:, None] * inside for metric in every.values()], axis=1)


def _terms(
    rule: Rule,
    weights: Float[np.ndarray, "m w r"],
    pair: Sequence[Float[np.ndarray, "d m c"]],
    metrics: Sequence[Metric],
) -> tuple[Float[np.ndarray, "k d r"], Float[np.ndarray, "k d r"]]:
    """T and V, or ∫ f₂² w, of every metric by region, channel means."""
    (one, two), ci, co, flat = pair, rule.wi[2], rule.wo[:, 2:], weights.reshape(len(weights), -1)

    def summed(term: np.ndarray) -> np.ndarray:
        found = sum(term[:, :, channel] @ flat for channel in range(term.shape[2])) / term.shape[2]
        return np.asarray(found).reshape(len(term), *weights.shape[1:]).transpose(1, 0, 2)

    apart = {t: t(one, ci, co) - t(two, ci, co) for t in {metric.transform for metric in metrics}}
    squares = {t: summed(difference**2) for t, difference in apart.items()}
    lights = {m.transform: summed(np.abs(apart[m.transform])) for m in metrics if m.kind == "light"}
    square = summed(two**2)
    solid = np.broadcast_to(weights.sum(axis=0)[:, None], square.shape)
    top, bottom, places = [], [], list(dict.fromkeys(metric.weight for metric in metrics))
    for metric in metrics:
        place = places.index(metric.weight)
        top.append((lights if metric.kind == "light" else squares)[metric.transform][place])
        bottom.append((square if metric.kind == "relative" else solid)[place])
    return np.stack(top), np.stack(bottom)


def direction_weight(metric: Metric, rule: Rule) -> Float[Any, " m"]:
    """What of w belongs to ω_o, at the nodes of a rule."""
    if metric.weight == "projected":
        return rule.weight
    xp = library(rule.weight)
    solid = xp.where(rule.weight > 0, rule.weight / xp.maximum(rule.wo[:, 2], 1e-12), 0.0)
    low = rule.wo[:, 2] < np.cos(np.deg2rad(NGAN_DEG))
    return xp.where(low, 0.0, solid) if metric.weight == "within" else solid
