"""Drawn: what is drawn of a study, or of a run on disk, and the numbers of each picture as a table.

It draws nothing.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import polars as pl

from fitmat import arguments
from fitmat.errors import FitmatError
from fitmat.studies import figures
from fitmat.studies.result import Result, drawn
from fitmat.studies.study import Study

KINDS = ("curves", "residuals", "albedo", "match", "corner")
"""Pictures of a run, by name."""

Drawn = Mapping[str, Any]
"""As `studies.figures` has it."""


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


def table(found: Drawn, kind: str, *, channel: str | int = 0, model: str | None = None) -> pl.DataFrame:
    """The numbers of a picture; angles in degrees, BRDFs in sr⁻¹.

    Args:
        found: What is drawn.
        kind: One of `KINDS`.
        channel: Of the curves and the residuals, by name or from 0.
        model: Of the corner; None for the last.

    Raises:
        FitmatError: there is nothing of the kind.
    """
    if kind == "corner":
        _, draws = draws_of(found, model)
        return pl.DataFrame(dict(zip(draws["names"], values_of(draws).T, strict=True)))
    if kind in ("curves", "residuals"):
        k = channel_of(found, channel)
        rows = [row for one in sections(found) for row in (_curve if kind == "curves" else _residual)(one, k)]
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
