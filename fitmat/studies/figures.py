"""Figures: everything of a study that is drawn, as JSON types: points, curves, bands, residuals, draws, priors.

It draws nothing and finds nothing: each number comes from the study, in `DIGITS` significant digits, and what is left
out is said.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from fitmat.fitting.result import Fit
from fitmat.match.match import Match
from fitmat.match.regions import REGIONS
from fitmat.measurements.incidences import incidences
from fitmat.measurements.samples import Measurements
from fitmat.studies.curves import Curve
from fitmat.studies.findings import Findings
from fitmat.studies.numbers import needed, quantised, short
from fitmat.studies.result import DRAWN
from fitmat.studies.study import Study
from fitmat.studies.swatches import spheres, swatch

CHANNELS, CHANNELS_FULL = 3, 12
"""At most so many channels are drawn, evenly spread; the second where everything was asked."""

MOST_POINTS = 300
"""Measured points of a curve; of more, so many are drawn, evenly spread."""

MAPS, MAP_POINTS = 8, 700
"""At most so many incidences have a map of the hemisphere, and so many points each."""

DRAWS = 2000
"""Posterior draws of a model, evenly spread over the run."""

CORNER = 8
"""At most so many parameters are set against each other."""


def to_dict(study: Study) -> dict[str, Any]:
    """What is drawn of a study, as JSON types; angles in degrees, BRDFs in sr⁻¹, null for what there is not."""
    m, shown = study.measurements, study.detailed
    channels = _channels(len(m.channels), CHANNELS_FULL if study.full else CHANNELS)
    curves = [_section(m, [(f, f.curves[k]) for f in shown], channels) for k in range(len(shown[0].curves))]
    maps = _maps(m, shown, channels)
    return {
        "format": DRAWN,
        "file": m.source,
        "models": [found.name for found in shown],
        "inadequate": [found.name for found in shown if found.doubts.inadequate],
        "channels": [m.channels[k] for k in channels],
        "left_out": _left_out(study, channels, maps),
        "curves": curves,
        "maps": maps,
        "parameters": {found.name: _priors(found.fit) for found in shown if found.fit.finite},
        "draws": {found.name: _draws(found, channels) for found in shown if _has_draws(found.fit)},
        "match": None if study.match is None else _match(study.match),
        "swatches": {found.name: swatch(found.fit.model, m.channels) for found in shown if found.fit.finite},
    }


def _channels(count: int, most: int) -> list[int]:
    if count <= most:
        return list(range(count))
    return [int(k) for k in np.unique(np.linspace(0, count - 1, most).round().astype(int))]


def _left_out(study: Study, channels: list[int], maps: list[dict[str, Any]]) -> list[str]:
    """What is not drawn, as sentences."""
    m, first = study.measurements, study.detailed[0]
    words = []
    if len(channels) < len(m.channels):
        more = "" if study.full else f"; fitmat fit --full draws up to {CHANNELS_FULL}"
        words.append(f"{len(channels)} of {len(m.channels)} channels are drawn, evenly spread{more}.")
    if len(study.detailed) < len(study.findings):
        words.append(
            f"{len(study.detailed)} of {len(study.findings)} models are drawn: those of the match, then the best."
        )
    lit = len(np.unique(np.round(np.rad2deg(m.theta_i[m.valid.any(axis=1)]), 1)))
    if max(len(first.curves), len(maps)) < lit:
        drawn = f"{len(first.curves)} as curves" if first.curves else f"{len(maps)} as maps"
        words.append(f"Of {lit} angles of incidence {drawn} are drawn, evenly spread.")
    if any(len(curve.section.rows) > MOST_POINTS for curve in first.curves):
        words.append(f"Of each curve {MOST_POINTS} measured points are drawn, evenly spread; all were fitted.")
    if any(drawn["points"] > len(drawn["theta_o"]) for drawn in maps):
        words.append(f"Of each map {MAP_POINTS} measured points are drawn, chosen by chance; all were fitted.")
    return words


def _section(m: Measurements, models: Sequence[tuple[Findings, Curve]], channels: list[int]) -> dict[str, Any]:
    """One incidence in its plane: the points, and of each model its curve, its band and what it leaves over."""
    section = models[0][1].section
    chosen = _evenly(len(section.rows), MOST_POINTS)
    rows, theta_o = section.rows[chosen], section.theta_o[chosen]
    valid = m.valid[rows][:, channels]
    used = np.where(valid, m.value[rows][:, channels], np.nan)
    drawn = {}
    for found, curve in models:
        kept = needed(np.rad2deg(curve.theta_o), curve.value[:, channels])
        band = np.where(valid, curve.band[:, chosen][:, :, channels], np.nan)
        drawn[found.name] = {
            "theta_o": short(np.rad2deg(curve.theta_o[kept])),
            "value": short(curve.value[kept][:, channels].T),
            "low": short(band[0].T),
            "high": short(band[1].T),
            "residual": short(_residuals(found, rows)[:, channels].T, 3),
        }
    return {
        "theta_i": short(np.rad2deg(section.theta_i)),
        "phi_i": short(np.rad2deg(section.phi_i)),
        "theta_o": short(np.rad2deg(theta_o)),
        "measured": short(used.T),
        "models": drawn,
    }


def _residuals(found: Findings, rows: np.ndarray) -> Float[np.ndarray, "k c"]:
    """In standard deviations of noise and misfit, at rows of the measurements; NaN where nothing was fitted."""
    m = found.fit.measurements
    kept = np.flatnonzero(m.valid.any(axis=1))
    weight = np.asarray(found.fit.data.weight)
    every = np.full(m.value.shape, np.nan)
    if len(weight) >= len(kept):
        every[kept] = np.where(weight > 0, found.residuals, np.nan)[: len(kept)]
    return every[rows]


def _evenly(count: int, most: int) -> np.ndarray:
    return np.arange(count) if count <= most else np.unique(np.linspace(0, count - 1, most).round().astype(int))


def _maps(m: Measurements, shown: Sequence[Findings], channels: list[int]) -> list[dict[str, Any]]:
    """Of each incidence that was seen out of its plane: the points from above, the mirror side at azimuth 0."""
    used = np.asarray(m.valid.any(axis=1))
    outside = used & ~m.in_plane
    if not outside.any():
        return []
    groups = [i for i in incidences(m.wi, used, None) if np.count_nonzero(outside[i.rows]) >= 3]
    if not groups:
        groups = [i for i in incidences(m.wi, used, MAPS) if outside[i.rows].any()]
    return [_map(m, shown, channels, groups[k].name, groups[k].rows) for k in _evenly(len(groups), MAPS)]


def _map(
    m: Measurements, shown: Sequence[Findings], channels: list[int], name: str, every: np.ndarray
) -> dict[str, Any]:
    rows = every
    if len(rows) > MAP_POINTS:
        rows = np.sort(np.random.default_rng(0).permutation(every)[:MAP_POINTS])
    wi, wo = m.wi[rows], m.wo[rows]
    turn = np.arctan2(wo[:, 1], wo[:, 0]) - np.arctan2(wi[:, 1], wi[:, 0]) - np.pi
    return {
        "name": name,
        "theta_i": short(np.rad2deg(m.theta_i[rows].mean())),
        "points": len(every),
        "theta_o": short(np.rad2deg(np.arccos(np.clip(wo[:, 2], -1.0, 1.0))), 4),
        "phi": short(np.rad2deg(np.angle(np.exp(1j * turn))), 4),
        "measured": short(np.where(m.valid[rows], m.value[rows], np.nan)[:, channels].T, 4),
        "residual": {found.name: short(_residuals(found, rows)[:, channels].T, 3) for found in shown},
    }


def _priors(fit: Fit) -> dict[str, Any]:
    """Of each parameter its range, whether equal ratios matter in it, and the 95 % of a prior that was stated."""
    found, prior = {}, fit.data.prior
    for entry in fit.entries:
        stated = []
        for k in range(entry.place.start, entry.place.stop):
            if prior is None or not float(prior.precision[k]) > 0:
                stated.append(None)
                continue
            ends = float(prior.mean[k]) + np.array([-1.96, 1.96]) / float(prior.precision[k])
            ends = np.exp(ends) if entry.param.scale == "log" else ends
            stated.append(short(np.clip(ends, entry.param.lower, entry.param.upper)))
        p = entry.param
        found[entry.name] = {"range": [p.lower, p.upper], "log": p.scale == "log", "stated": stated}
    return found


def _has_draws(fit: Fit) -> bool:
    return fit.finite and fit.loss.posterior and len(fit.free) > 0


def _draws(found: Findings, channels: list[int]) -> dict[str, Any]:
    """Draws of the parameters that all channels share, and of one channel, as whole steps of their range."""
    fit = found.fit
    named = list(zip(fit.coordinates.names, fit.coordinates.places, strict=True))
    own = channels[len(channels) // 2]
    several = {
        k for e in fit.entries if e.size > 1 for k in range(e.place.start, e.place.stop) if k - e.place.start != own
    }
    chosen = [(name, k) for name, k in named if k not in several][:CORNER]
    places = [k for _, k in chosen]
    symbols = {k: e.param.symbol for e in fit.entries for k in range(e.place.start, e.place.stop)}
    logs = {k: e.param.scale == "log" for e in fit.entries for k in range(e.place.start, e.place.stop)}
    draws = found.posterior.thinned(DRAWS)[0][:, places]
    return {
        "names": [name for name, _ in chosen],
        "symbols": [symbols[k] for k in places],
        "log": [logs[k] for k in places],
        "best": short(fit.values[places]),
        "left_out": len(named) - len(chosen),
        **quantised(draws),
    }


def _match(match: Match) -> dict[str, Any]:
    """Albedos and distances against incidence, rows low, best, high; what each term of the lobe explains; spheres."""
    found, causes, seen = match.distances, match.ablation, match.perceived
    return {
        "empirical": match.empirical.fit.name,
        "microfacet": match.microfacet.fit.name,
        "measured_deg": short(list(match.incidence_range_deg)),
        "theta_i": short(np.rad2deg(match.albedo_theta_i)),
        "albedo": {"empirical": short(match.albedo_empirical), "microfacet": short(match.albedo_microfacet)},
        "distance": short(found.by_incidence["relative"]),
        "by_region": {
            region: short(found.by_incidence_and_region["relative"][:, :, k]) for k, region in enumerate(REGIONS)
        },
        "causes": None
        if causes is None
        else {"theta_i": short(np.rad2deg(causes.theta_i)), "fall": {k: short(v) for k, v in causes.fall.items()}},
        "spheres": [] if seen is None else spheres(seen),
    }
