"""The ball: what a page needs to light a study's materials in the browser: their shaders, ranges, draws and colours.

It draws nothing and fits nothing; `static/` holds what draws.
"""

from collections.abc import Iterable, Sequence
from importlib.resources import files
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from fitmat.colour.channels import colouring
from fitmat.colour.spaces import FROM_SRGB
from fitmat.errors import ModelError
from fitmat.exports.glsl.translation import COLOURS, Parametrised, parametrised
from fitmat.match.appearance import scene
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import Entry, Param, entries, vector, with_vector
from fitmat.models.values import surfaces
from fitmat.studies.study import Study
from fitmat.text import visible
from fitmat.uncertainty.posterior import Posterior

WIDER = 10.0
"""By which factor the slider of a parameter goes beyond its interval, where equal ratios matter."""

DRAWS = 60
"""Posterior draws that a page holds, of each model."""

SCRIPTS = (
    ("fitmat.exports.glsl", "shader.js"),
    *(
        ("fitmat.reports", f"static/{name}")
        for name in ("scene.js", "controls.js", "ball.js", "solids.js", "lobes.js", "mounting.js")
    ),
)
"""What draws the ball, in the order in which it is read."""

SURROUNDINGS = "an overcast sky over ground of albedo 0.2, and two soft windows"


def script() -> str:
    """The scripts that draw what `data` holds."""
    return "\n".join(files(room).joinpath(name).read_text(encoding="utf-8") for room, name in SCRIPTS)


def data(study: Study) -> dict[str, Any]:
    """What `mountBall` takes, as JSON types; `why` holds the reasons for a model that cannot be drawn."""
    channels = study.measurements.channels
    channel = None if len(channels) in COLOURS else len(channels) // 2
    named = channels if channel is None else channels[channel : channel + 1]
    materials, why = [], []
    for role, posterior in _pair(study):
        try:
            materials.append(_model(role, posterior, channel, named))
        except ModelError as error:
            why.append(str(error))
    return page_data(materials, named, len(channels)) | {"why": why}


def page_data(materials: Sequence[dict[str, Any]], channels: tuple[str, ...], of: int) -> dict[str, Any]:
    """The same of one or two materials in these channels, of so many that there are."""
    return {
        "models": list(materials),
        "channels": [visible(name) for name in channels],
        "light": list(scene.LIGHTS["side light"]),
        "sky": _sky(),
        "surroundings": SURROUNDINGS,
        **_colours(channels, of),
    }


def _colours(channels: tuple[str, ...], of: int) -> dict[str, Any]:
    """Linear sRGB of the shader's three values, by columns, and in words what was taken for what."""
    colours = colouring(channels)
    each = colours.weights @ np.linalg.inv(FROM_SRGB).T * len(channels) / len(FROM_SRGB)
    words = colours.words if len(channels) == of else f"{visible(channels[0])} of {of} channels, drawn grey"
    return {"colours": _rounded(np.broadcast_to(each, FROM_SRGB.shape).ravel()), "words": f"Colours: {words}."}


def _pair(study: Study) -> list[tuple[str, Posterior]]:
    """What is drawn beside each other: the two of the match, else the first two models."""
    if study.match is not None:
        empirical, microfacet = study.match.empirical, study.match.microfacet
        return [("Phong" if "phong" in empirical.fit.name else "Empirical", empirical), ("Microfacet", microfacet)]
    return [(posterior.fit.name, posterior) for posterior in study.posteriors[:2]]


def _model(role: str, posterior: Posterior, channel: int | None, channels: Sequence[str]) -> dict[str, Any]:
    """A material of the ball.

    Raises:
        ModelError: it has no values, or no form in GLSL.
    """
    fit = posterior.fit
    if not fit.finite:
        raise ModelError(f"{fit.name} ended without values.")
    sampled = fit.loss.posterior and len(fit.free) > 0
    ends = posterior.interval().T if sampled else np.stack([fit.values, fit.values])
    draws = posterior.thinned(DRAWS)[0] if sampled else ends[:0]
    model, rows = surfaces(fit.model, np.concatenate([fit.values[None], ends, draws]))
    if channel is not None:
        model, rows = _of_channel(model, rows, channel)
    return material(role, model, rows, channels)


def material(role: str, model: AbstractBRDF, rows: Float[np.ndarray, "k p"], channels: Sequence[str]) -> dict[str, Any]:
    """A material of the ball, from parameter vectors: its fit, both ends of the 95 % intervals, then draws.

    Raises:
        ModelError: it has no form in GLSL.
    """
    free = parametrised(model)
    held = [e.name for e in entries(model) if e.name not in free.uniforms]
    return {
        "role": role,
        "name": model.name,
        "source": free.text,
        "fit": _rounded(rows[0]),
        "parameters": [_parameter(e, free, rows[:3], channels) for e in entries(model)],
        "draws": [] if held else [_rounded(row) for row in rows[3:]],
        "held": f"The shader holds numbers made from {', '.join(held)}: fixed at the fit, and no draws."
        if held
        else "",
    }


def _of_channel(
    model: AbstractBRDF, rows: Float[np.ndarray, "k p"], channel: int
) -> tuple[AbstractBRDF, Float[np.ndarray, "k q"]]:
    """The same in one of its channels."""

    def part(several: AbstractBRDF) -> AbstractBRDF:
        return jax.tree.map(lambda leaf: leaf[channel : channel + 1] if np.ndim(leaf) else leaf, several)

    return part(model), rows[:, vector(part(with_vector(model, np.arange(rows.shape[1])))).astype(int)]


def _parameter(
    entry: Entry, free: Parametrised, rows: Float[np.ndarray, "3 p"], channels: Sequence[str]
) -> dict[str, Any]:
    """A slider for each of its values; rows hold the fit and the ends of the 95 % intervals."""
    fit, low, high = rows[:, entry.place]
    uniform, (least, most) = free.uniforms.get(entry.name), _range(entry.param, fit, low, high)
    return {
        "symbol": entry.param.symbol,
        "unit": entry.param.unit,
        "doc": entry.param.doc,
        "uniform": uniform,
        "spectrum": f"uniform vec3 {uniform};" in free.text,
        "start": entry.place.start,
        "shared": entry.size == 1,
        "channels": [visible(name) for name in channels] if entry.size > 1 else [""],
        "low": least,
        "high": most,
        "log": entry.param.scale == "log",
        "intervals": [_rounded(ends) for ends in zip(low, high, strict=True)],
    }


def _range(p: Param, *known: Float[np.ndarray, " c"]) -> tuple[float, float]:
    """Of a slider: what is known and as much again on either side, within the bounds."""
    least, most = min(map(np.min, known)), max(map(np.max, known))
    if p.scale == "log":
        return float(max(p.lower, least / WIDER)), float(min(p.upper, most * WIDER))
    if p.weight:
        return float(p.lower), float(min(p.upper, max(2.0 * most, 0.01 * p.upper)))
    return float(p.lower), float(p.upper)


def _sky() -> dict[str, Any]:
    """The environment of `scene`, by the names of the shader's uniforms."""
    angles, azimuths, sharpness, brightness = np.array(scene.WINDOWS).T.tolist()
    centres = [scene.frame(*np.deg2rad(place))[2] for place in zip(angles, azimuths, strict=True)]
    windows = np.concatenate(centres).tolist()
    return {"ground": scene.GROUND, "windows": windows, "sharpness": sharpness, "brightness": brightness}


def _rounded(values: Iterable[float]) -> list[float]:
    return [float(f"{value:.7g}") for value in values]
