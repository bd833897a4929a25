"""Drawn: what is drawn of a study, or of a run on disk, and the numbers of each picture as a table.

It draws nothing.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from fitmat import arguments
from fitmat.errors import FitmatError
from fitmat.maths.directions import from_angles
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF
from fitmat.models.values import at
from fitmat.studies import figures
from fitmat.studies.result import Result, drawn
from fitmat.studies.study import Study

KINDS = ("curves", "residuals", "lobes", "slice", "albedo", "corner", "match", "coverage")
"""Pictures of a run, by name."""

CELL_DEG = 1.0
"""Of a slice, along each side."""

Drawn = Mapping[str, Any]
"""As `studies.figures` has it."""


class Slice(NamedTuple):
    """A model over the angles of half vector and difference, in the plane of incidence.

    Attributes:
        name: The model's.
        value: BRDF in sr⁻¹ at the middle of each cell, rows θ_d, columns θ_h, both from 0° to 90°; NaN below the
            horizon, (d, h).
        theta_h: Of the measured points, degrees, (k,).
        theta_d: The same.
        ratio: Measured over fitted there, (k,).
    """

    name: str
    value: np.ndarray
    theta_h: np.ndarray
    theta_d: np.ndarray
    ratio: np.ndarray


def drawn_of(what: Study | Result) -> Drawn:
    """What is drawn of a study, or of the result of one from `fitmat.load`.

    Raises:
        FitmatError: it is neither, or the run's figures cannot be read.
    """
    arguments.kind("what", what, Study, Result)
    return figures.to_dict(what) if isinstance(what, Study) else drawn(what)


def channel_of(found: Drawn, channel: str | int) -> int:
    """The place of a channel among those that are drawn, by its name or from 0.

    Raises:
        FitmatError: there is none, with all that there are.
    """
    names = found["channels"]
    if isinstance(channel, str) and channel in names:
        return names.index(channel)
    if isinstance(channel, bool) or channel not in range(len(names)):
        arguments.refuse("channel", channel, f"one of {', '.join(names)}, or its place from 0")
    return int(channel)


def sections(found: Drawn) -> list[Mapping[str, Any]]:
    """The curves in planes of incidence.

    Raises:
        FitmatError: there are none.
    """
    if not found["curves"]:
        raise FitmatError(f"{found['file']}: no in-plane curve of at least three samples; the page has maps.")
    return list(found["curves"])


def match_of(found: Drawn) -> Mapping[str, Any]:
    """What is drawn of the match.

    Raises:
        FitmatError: there is none.
    """
    if found["match"] is None:
        raise FitmatError(f"{found['file']}: no match to draw, expected an empirical and a microfacet model. Fit both.")
    return found["match"]


def draws_of(found: Drawn, model: str | None) -> tuple[str, Mapping[str, Any]]:
    """A model with draws, by its name or the last, and these.

    Raises:
        FitmatError: there is none.
    """
    every = found["draws"]
    name = model if model is not None else next(reversed(every), "")
    if name not in every:
        known = ", ".join(every) or "no model"
        raise FitmatError(f"{found['file']}: no draws of {name or 'any model'}; {known} has some.")
    return name, every[name]


def values_of(draws: Mapping[str, Any]) -> np.ndarray:
    """Draws in physical units, (m, k)."""
    return np.array(draws["low"]) + np.array(draws["step"]) * np.array(draws["values"], float).T


def slices_of(what: Study | Result, channel: str | int = 0) -> list[Slice]:
    """The slice of every model with values that is drawn.

    Raises:
        FitmatError: there is no such channel, or no model has values.
    """
    found = drawn_of(what)
    k, every = channel_of(found, channel), _models(what)
    models = {name: every[name] for name in found["models"] if name in every}
    if not models:
        raise FitmatError(
            f"{found['file']}: no model has values to draw. Check the columns of the file, and fit again."
        )
    place = _channels(what).index(found["channels"][k])
    edge = np.arange(CELL_DEG / 2, 90.0, CELL_DEG)
    half, apart = np.meshgrid(np.deg2rad(edge), np.deg2rad(edge))
    light, sensor = half - apart, half + apart
    lit = np.abs(sensor) < np.pi / 2
    points = _points(found, k)
    return [_slice(name, model, place, (light, sensor, lit), points) for name, model in models.items()]


def _slice(name: str, model: AbstractBRDF, place: int, grid: tuple[np.ndarray, ...], points: np.ndarray) -> Slice:
    light, sensor, lit = grid
    value = np.full(light.shape, np.nan)
    value[lit] = _in_plane(model, light[lit], sensor[lit], np.zeros(lit.sum()), place)
    theta_i, phi_i, theta_o, measured = points.T
    theta_i, theta_o = np.deg2rad(theta_i), np.deg2rad(theta_o)
    fitted = _in_plane(model, -theta_i, theta_o, np.deg2rad(phi_i), place)
    half, apart = np.rad2deg(np.abs(theta_o - theta_i)) / 2, np.rad2deg(np.abs(theta_o + theta_i)) / 2
    return Slice(name, value, half, apart, measured / np.maximum(fitted, 1e-12))


def _in_plane(model: AbstractBRDF, light: np.ndarray, sensor: np.ndarray, phi_i: np.ndarray, place: int) -> np.ndarray:
    """Values at signed angles on one axis, positive on the side away from the light's azimuth, radians."""
    wi, wo = (from_angles(np.abs(a), phi_i + np.where(a > 0, np.pi, 0.0)) for a in (light, sensor))
    value = at(model, wi, wo)
    return value[:, min(place, value.shape[1] - 1)]


def _points(found: Drawn, k: int) -> np.ndarray:
    """Positive measured values of the curves: theta_i, phi_i, theta_o in degrees, value, (n, 4)."""
    rows = [
        (one["theta_i"], one["phi_i"], angle, value)
        for one in found["curves"]
        for angle, value in zip(one["theta_o"], one["measured"][k], strict=True)
        if value is not None and value > 0
    ]
    return np.array(rows).reshape(-1, 4)


def _models(what: Study | Result) -> dict[str, AbstractBRDF]:
    """Each model with values, without what the instrument does."""
    if isinstance(what, Study):
        return {one.name: surface(one.fit.model) for one in what.findings if one.fit.finite}
    return {one.name: surface(one.model) for one in what.fits}


def _channels(what: Study | Result) -> list[str]:
    return list(what.measurements.channels if isinstance(what, Study) else what.record["channels"])


def coverage_of(what: Study | Result) -> pl.DataFrame:
    """Every geometry that is drawn: theta_i, phi_i, theta_o, phi, and θ_h, θ_d, in degrees.

    Raises:
        FitmatError: nothing is drawn.
    """
    found = drawn_of(what)
    rows = [
        (one["theta_i"], one["phi_i"], abs(angle), 180.0 if angle >= 0 else 0.0)
        for one in found["curves"]
        for angle in one["theta_o"]
    ]
    rows += [
        (one["theta_i"], 0.0, angle, (180.0 + phi) % 360.0)
        for one in found["maps"]
        for angle, phi in zip(one["theta_o"], one["phi"], strict=True)
    ]
    if not rows:
        raise FitmatError(f"{found['file']}: nothing is drawn, no curve or map of at least three samples.")
    theta_i, phi_i, theta_o, phi = np.array(rows).T
    wi = from_angles(np.deg2rad(theta_i), np.deg2rad(phi_i))
    wo = from_angles(np.deg2rad(theta_o), np.deg2rad(phi_i + phi))
    h = wi + wo
    h /= np.maximum(np.linalg.norm(h, axis=1, keepdims=True), 1e-12)
    half, apart = (np.rad2deg(np.arccos(np.clip(c, -1.0, 1.0))) for c in (h[:, 2], (h * wi).sum(axis=1)))
    columns = {"theta_i": theta_i, "phi_i": phi_i, "theta_o": theta_o, "phi": phi, "theta_h": half, "theta_d": apart}
    return pl.DataFrame({name: np.round(column, 4) for name, column in columns.items()}).unique(maintain_order=True)


def table(what: Study | Result, kind: str, *, channel: str | int = 0, model: str | None = None) -> pl.DataFrame:
    """The numbers of a picture; angles in degrees, BRDFs in sr⁻¹.

    Args:
        what: A study, or the result of one from `fitmat.load`.
        kind: One of `KINDS`.
        channel: Of curves, residuals, lobes and slices, by name or from 0.
        model: Of the corner; None for the last.

    Raises:
        FitmatError: there is nothing of the kind.
    """
    if kind == "coverage":
        return coverage_of(what)
    if kind == "slice":
        return pl.concat([_cells(one) for one in slices_of(what, channel)])
    found = drawn_of(what)
    if kind == "corner":
        _, draws = draws_of(found, model)
        return pl.DataFrame(dict(zip(draws["names"], values_of(draws).T, strict=True)))
    if kind in ("curves", "residuals", "lobes"):
        k = channel_of(found, channel)
        rows = [row for one in sections(found) for row in (_residual if kind == "residuals" else _curve)(one, k)]
    else:
        rows = list(_albedos(match_of(found)) if kind == "albedo" else _distances(match_of(found)))
    return pl.DataFrame(rows, infer_schema_length=None)


def _curve(section: Mapping[str, Any], k: int) -> Iterator[dict[str, Any]]:
    place = {"theta_i": section["theta_i"], "phi_i": section["phi_i"]}
    none = {"value": None, "low": None, "high": None}
    for angle, value in zip(section["theta_o"], section["measured"][k], strict=True):
        yield place | {"series": "measured", "theta_o": angle} | none | {"value": value}
    for name, one in section["models"].items():
        for angle, value in zip(one["theta_o"], one["value"][k], strict=True):
            yield place | {"series": name, "theta_o": angle} | none | {"value": value}
        for angle, low, high in zip(section["theta_o"], one["low"][k], one["high"][k], strict=True):
            yield place | {"series": f"{name}, band", "theta_o": angle} | none | {"low": low, "high": high}


def _cells(one: Slice) -> pl.DataFrame:
    """A model's cells, then its points."""
    edge = np.arange(CELL_DEG / 2, 90.0, CELL_DEG)
    half, apart = (part.ravel() for part in np.meshgrid(edge, edge))
    lit = np.isfinite(one.value.ravel())
    cells = {"theta_h": half[lit], "theta_d": apart[lit], "value": one.value.ravel()[lit]}
    points = {"theta_h": one.theta_h, "theta_d": one.theta_d, "measured_over_fitted": one.ratio}
    both = pl.concat([pl.DataFrame(cells), pl.DataFrame(points)], how="diagonal")
    return both.select(pl.lit(one.name).alias("model"), pl.all())


def _residual(section: Mapping[str, Any], k: int) -> Iterator[dict[str, Any]]:
    for name, one in section["models"].items():
        for angle, z in zip(section["theta_o"], one["residual"][k], strict=True):
            yield {"model": name, "theta_i": section["theta_i"], "theta_o": angle, "residual": z}


def _albedos(match: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for role, band in match["albedo"].items():
        for angle, low, best, high in zip(match["theta_i"], *band, strict=True):
            yield {"model": match[role], "theta_i": angle, "low": low, "albedo": best, "high": high}


def _distances(match: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for region, band in {"all directions": match["distance"], **match["by_region"]}.items():
        for angle, low, best, high in zip(match["theta_i"], *band, strict=True):
            yield {"region": region, "theta_i": angle, "low": low, "distance": best, "high": high}
