"""Fit one model to many surfaces that were seen from the same directions, by one compiled program.

Likelihood, bounds, convergence and outcomes are those of `fitmat.fit`. It reads no file.
"""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import ArrayLike, Float

from fitmat import arguments
from fitmat._types import Progress
from fitmat.errors import FitmatError, ModelError, ReadError
from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.fitting import asked_model, held_values, refuse_single_precision
from fitmat.fitting.losses import DEFAULT, Loss
from fitmat.fitting.losses import loss as find_loss
from fitmat.fitting.many.fits import Fits
from fitmat.fitting.many.gathering import padded
from fitmat.fitting.many.lanes import Shared
from fitmat.fitting.many.searching import PRECISIONS, Search
from fitmat.fitting.many.sharing import refuse_idle, sharing, told_together
from fitmat.fitting.many.table import table
from fitmat.fitting.many.tiles import Work, each
from fitmat.fitting.refining import MAX_STEPS
from fitmat.measurements.samples import default_channels
from fitmat.models import names
from fitmat.models.base import AbstractBRDF, direction_pairs
from fitmat.models.parameters import entries, holding, with_vector
from fitmat.models.terms.film import has_film
from fitmat.models.values import at

STARTS = 3
"""Valleys of the grid from which a fit begins, at most: most surfaces have one."""


def fit_many(
    wi: ArrayLike,
    wo: ArrayLike,
    value: ArrayLike,
    to: str | AbstractBRDF = "lambert+ggx",
    *,
    sigma: ArrayLike | None = None,
    fixed: Mapping[str, ArrayLike] | None = None,
    loss: str = DEFAULT.name,
    masking: str | None = None,
    starts: int = STARTS,
    max_steps: int = MAX_STEPS,
    threads: int | None = None,
    pool: str | Sequence[str] | None = None,
    smooth: str | Sequence[str] | None = None,
    precision: str = "double",
    progress: Progress | None = None,
) -> Fits:
    """Fit a model to many surfaces, or to each point of one, that were seen from the same directions.

    Args:
        wi: Unit vectors to the light, (n, 3) or (1, 3), local frame with the normal +z; `fitmat.directions` makes
            them from angles.
        wo: Unit vectors to the sensor, likewise.
        value: BRDF values in sr⁻¹, (…, n, c) for c channels, or (m, n) for m surfaces of one channel; NaN is masked.
        to: A model name ("lambert+ggx"), or a model whose shapes and static choices are used.
        sigma: Standard deviation of the noise: a number, or what has the shape of `value`. Where it is None no noise is
            looked for, and all scatter counts as the model's misfit.
        fixed: Parameters to hold, by name, the same for all: `{"ks": 1.0}`.
        loss: As in `fitmat.fit`, but for those that infer the noise.
        masking: Static masking choice for the microfacet lobes of a named model.
        starts: From how many valleys of the start grid a fit begins, at most; one that goes to a bound or does not
            settle begins again at the grid's six best nodes.
        max_steps: Levenberg–Marquardt iterations per start.
        threads: How many work side by side; None for one for each core.
        pool: Parameters in which the surfaces are taken to be of one kind: each is drawn to the others as far as its
            own data leave it open, `Fits.pooled`; values and deviations stay.
        smooth: Parameters of points in rows and columns that are taken to differ little from those of their neighbours,
            but where two materials meet: `Fits.smoothed`; values and deviations stay.
        precision: "single" looks for every optimum in float32, and only goes on from there in float64, in which noise,
            deviations and outcomes are always judged.
        progress: Called with what is done, how many surfaces are done, and how many there are.

    Returns:
        `Fits`; a surface that cannot be fitted is an outcome, not an exception.

    Raises:
        FitmatError: float64 is off, shapes do not fit, the model is unknown, nothing is left to fit, or what is to be
            pooled or smoothed is held, unknown, or of fewer than three surfaces.

    Example:
        >>> wi, wo = directions(30, degrees=True), directions([0, 15, 30, 45], 180, degrees=True)  # doctest: +SKIP
        >>> fit_many(wi, wo, texture, "lambert+ggx", fixed={"ks": 1.0})["alpha"]  # doctest: +SKIP
    """
    refuse_single_precision()
    arguments.kind("to", to, str, AbstractBRDF)
    arguments.named(fixed=fixed)
    for name, given in (("starts", starts), ("max_steps", max_steps)):
        arguments.whole(name, given, 1)
    arguments.whole("threads", threads, 1, optional=True)
    arguments.choice("precision", precision, PRECISIONS)
    arguments.function("progress", progress)
    asked, pair = sharing(pool, smooth), direction_pairs(wi, wo)
    numbers = _values(value, len(pair[0]))
    noise = None if sigma is None else _noise(sigma, numbers, np.shape(value))
    shared, held = shared_by_all(pair, numbers.shape[-1], to, fixed or {}, find_loss(loss), masking)
    if noise is None and shared.loss.needs_noise:
        raise FitmatError(
            f"sigma is None, expected the noise: the loss {shared.loss.name} (--loss) needs it. Give it, or another."
        )
    refuse_idle(asked, shared, held, numbers.shape[:-2])
    axes, flat = numbers.shape[:-2], numbers.reshape(-1, *numbers.shape[-2:])
    noise = None if noise is None else noise.reshape(flat.shape)
    known, count = table(shared, held), threads or os.cpu_count() or 1
    search = Search(shared, known, starts, max_steps)
    work = Work(search.rough() if precision == "single" else search)
    size = work.size(len(flat), count)
    found = each(
        lambda part: work.fitted(flat[part], None if noise is None else noise[part], size),
        len(flat),
        size,
        count,
        progress,
    )
    shaped: dict[str, Any] = {name: part.reshape(*axes, *part.shape[1:]) for name, part in found.items()}
    fits = Fits(shared.template, default_channels(numbers.shape[-1]), held, **shaped)
    return told_together(asked, fits, progress)


def _values(given: ArrayLike, rows: int) -> Float[np.ndarray, "... n c"]:
    """The values with an axis for the channels."""
    found = arguments.numbers("value", given)
    shaped = found[..., None] if found.ndim == 2 else found
    if shaped.ndim < 3 or shaped.shape[-2] != rows or not shaped.size:
        raise ReadError(
            f"value has shape {found.shape}, expected (…, {rows}, c) for {rows} pairs of directions, or (m, {rows})."
        )
    return shaped


def _noise(given: ArrayLike, value: np.ndarray, shape: tuple[int, ...]) -> Float[np.ndarray, "... n c"]:
    found = arguments.numbers("sigma", given)
    if found.shape not in ((), shape):
        raise ReadError(f"sigma has shape {found.shape}, expected one number, or {shape} as value.")
    return np.broadcast_to(found, shape).reshape(value.shape)


def shared_by_all(
    pair: list[np.ndarray],
    channels: int,
    to: str | AbstractBRDF,
    fixed: Mapping[str, ArrayLike],
    loss: Loss,
    masking: str | None,
) -> tuple[Shared, dict[str, np.ndarray]]:
    """What all fits share, and what is fixed.

    Args:
        pair: Unit vectors to the light and to the sensor.
        channels: c.
        to: A model, or its name.
        fixed: Parameters to hold, by name.
        loss: What is minimised.
        masking: Of a named model.

    Raises:
        FitmatError: the model is unknown or has other channels, or nothing is left to fit.
    """
    if loss.infers_noise:
        raise ModelError(
            f"loss is {loss.name!r} (--loss), expected one that infers no noise: many fits look at no neighbours."
        )
    template = asked_model(to, channels, masking)
    if isinstance(to, str) and has_film(template):
        raise ModelError(
            f"to = {to!r} (--models), expected a model: a film has wavelengths. Give model({to!r}, wavelengths=[…])."
        )
    held = held_values(template, names.own(template.name, {e.name for e in entries(template)}, fixed))
    moved = coordinates(template, held)
    if not moved.count:
        raise ModelError(
            f"every parameter of {template.name} is fixed (--fix), expected one that is not: nothing is fitted."
        )
    template = with_vector(template, holding(template, held))
    shown = at(template, *(w[:1] for w in pair)).shape[1]
    if shown not in (1, channels):
        raise ModelError(f"the model has {shown} channels and the values {channels}: expected as many.")
    return Shared(template, padded(pair[0]), padded(pair[1]), moved, loss, channels), held
