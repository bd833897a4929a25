"""Priors: what is believed of a model's parameters before the data, as given, as the likelihood needs it, and as draws.

It sees no data. Without a word of the user a parameter is as likely anywhere within its bounds: in the logarithm where
its scale is log (alpha, exponent, eta, kappa, f0), else linearly; the discrepancy s ≥ 0 likewise. A stated prior is
a Gaussian in the same coordinate, cut off at the bounds: a log-normal of that median and that relative sd where the
scale is log. What an instrument does not know of itself has the sd that it states: ln g ~ N(0, calibration²) of the
shared scale, ln w of the half-angles, δ_i and δ_o of the angles' offsets.
"""

from collections.abc import Container, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import ArrayLike, Float

from fitmat import arguments
from fitmat.errors import ModelError
from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.likelihood import Prior
from fitmat.fitting.losses import Loss
from fitmat.measurements.instrument import Instrument
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import Entry, entries, refuse_repeated, vector
from fitmat.text import with_error

DISCREPANCY = "discrepancy"
"""Name under which s has a prior: centre 0, and the sd of a Gaussian of which s is the size (half-normal)."""


def prepare_prior(
    model: AbstractBRDF, instrument: Instrument, given: Mapping[str, tuple[ArrayLike, ArrayLike]]
) -> Prior | None:
    """Stated priors, and the instrument's, in natural coordinates; None where everything is flat.

    Args:
        model: Gives the parameters.
        instrument: Gives the priors of what it does not know of itself.
        given: Parameter name → centre and sd in physical units, each one number or one per channel.

    Raises:
        ModelError: a name is not a parameter's, a centre lies outside its bounds, an sd is not positive.
    """
    every, places = coordinates(model), {e.name: e for e in entries(model)}
    mean, precision = np.zeros(len(vector(model))), np.zeros(len(vector(model)))
    discrepancy = 0.0
    for name, (field, sd) in told_of(instrument).items():
        if name in given:
            got = f"prior of {name} beside the instrument's {field} = {getattr(instrument, field):g}"
            raise ModelError(f"{got}, expected one of the two. Leave one out.")
        precision[places[name].place] = 1.0 / sd
    for name, pair in given.items():
        centre, sd = _pair(name, pair)
        if name == DISCREPANCY:
            _refuse_centre(centre)
            discrepancy = 1.0 / _positive(name, sd).item()
            continue
        if name not in places:
            raise ModelError(f"prior of {name!r}: {model.name} has {', '.join(places)}; also {DISCREPANCY}.")
        entry = places[name]
        middle, spread = _inside(entry, centre), _positive(name, sd)
        log = every.ratio[entry.place]
        mean[entry.place] = np.where(log, np.log(np.where(log, middle, 1.0)), middle)
        precision[entry.place] = np.where(log, middle, 1.0) / spread
    if not precision.any() and not discrepancy:
        return None
    return Prior(mean, precision, np.asarray(discrepancy))


def told_of(instrument: Instrument) -> dict[str, tuple[str, float]]:
    """Parameter of `models.around.instrument.Seen` → which field tells of it, and its sd in natural coordinates."""
    degrees = float(np.rad2deg(instrument.angle_error))
    known = {
        "scale": ("calibration", instrument.calibration),
        "aperture": ("aperture_error", instrument.aperture_error),
        "theta_i_offset": ("angle_error", degrees),
        "theta_o_offset": ("angle_error", degrees),
    }
    return {name: told for name, told in known.items() if told[1]}


def refuse_idle(given: Container[str], fixed: Iterable[str], loss: Loss) -> None:
    """Stop where a prior could change nothing.

    Args:
        given: Names of what has a prior.
        fixed: Names of the parameters that are held.
        loss: What is minimised.

    Raises:
        ModelError: a parameter is held, or the loss has no discrepancy.
    """
    for name in fixed:
        if name in given:
            expected = "expected one of the two: of what is fixed nothing is left to learn"
            raise ModelError(
                f"{name} is fixed and has a prior (--fix or --ior, and --prior), {expected}. Leave one out."
            )
    if DISCREPANCY in given and not loss.infers_discrepancy:
        expected = "expected none: it takes the model for exact"
        raise ModelError(
            f"prior of {DISCREPANCY} (--prior) under the loss {loss.name} (--loss), {expected}. Leave one out."
        )


def _pair(name: str, given: Any) -> tuple[np.ndarray, np.ndarray]:
    if not isinstance(given, Sequence | np.ndarray) or isinstance(given, str) or len(given) != 2:
        arguments.refuse(f"prior of {name}", given, "a centre and a standard deviation, as (1.5, 0.05)")
    centre, sd = (arguments.numbers(f"prior of {name}", part) for part in given)
    return centre, sd


def _refuse_centre(centre: ArrayLike) -> None:
    if np.any(np.asarray(centre, float) != 0):
        expected = "expected 0, from which its sd is counted, for example discrepancy=0,0.01"
        raise ModelError(f"prior of {DISCREPANCY}: centre {centre}, {expected}.")


def _inside(entry: Entry, centre: ArrayLike) -> np.ndarray:
    middle = np.atleast_1d(np.asarray(centre, float))
    if middle.size not in (1, entry.size):
        raise ModelError(f"prior of {entry.name}: {middle.size} centres, expected 1 or {entry.size}.")
    lower, upper = entry.param.lower, entry.param.upper
    if not ((middle >= lower) & (middle <= upper)).all():
        raise ModelError(f"prior of {entry.name}: centre {middle}, expected a value from {lower:g} to {upper:g}.")
    return middle


def _positive(name: str, sd: ArrayLike) -> np.ndarray:
    spread = np.atleast_1d(np.asarray(sd, float))
    if not (np.isfinite(spread) & (spread > 0)).all():
        raise ModelError(f"prior of {name}: standard deviation {spread}, expected a positive number.")
    return spread


def assignments(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    """`NAME=CENTRE,SD` texts as the argument `priors` of `fit`.

    Raises:
        ModelError: a text is not of that form, or a name is given twice.
    """
    found: dict[str, tuple[float, float]] = {}
    for text in texts:
        name, _, values = text.partition("=")
        refuse_repeated(name.strip(), found, "--prior")
        try:
            centre, sd = (float(v) for v in values.split(","))
        except ValueError as error:
            raise ModelError(f"--prior {text!r}: expected NAME=CENTRE,SD, for example eta=1.5,0.05.") from error
        found[name.strip()] = (centre, sd)
    return found


def natural_sd(model: AbstractBRDF, prior: Prior | None) -> Float[np.ndarray, " p"]:
    """Prior standard deviation of every natural coordinate; that of a flat prior is its range / √12."""
    flat = coordinates(model).extent / np.sqrt(12.0)
    if prior is None:
        return flat
    precision = np.asarray(prior.precision)
    return np.where(precision > 0, np.minimum(1.0 / np.where(precision > 0, precision, 1.0), flat), flat)


def draw(
    model: AbstractBRDF, prior: Prior | None, free: np.ndarray, count: int, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "count p"], Float[np.ndarray, " count"]]:
    """Parameter vectors (physical) and discrepancies from the prior; parameters that are not free as in the model.

    Raises:
        ModelError: s has a flat prior, from which nothing can be drawn.
    """
    from scipy.stats import truncnorm

    if prior is None or not float(prior.discrepancy) > 0:
        raise ModelError(f"cannot draw from a flat prior of {DISCREPANCY}: state one, for example (0, 0.01).")
    every = coordinates(model)
    low, high = every.low, every.high
    precision = np.asarray(prior.precision)
    sd = np.where(precision > 0, 1.0 / np.where(precision > 0, precision, 1.0), 1.0)
    a, b = (low - np.asarray(prior.mean)) / sd, (high - np.asarray(prior.mean)) / sd
    u = rng.random((count, len(low)))
    gaussian = np.asarray(prior.mean) + sd * truncnorm.ppf(u, a, b)
    natural = np.where(precision > 0, gaussian, low + u * (high - low))
    values = np.tile(np.asarray(vector(model)), (count, 1))
    values[:, free] = every.physical(natural)[:, free]
    return values, np.abs(rng.standard_normal(count)) / float(prior.discrepancy)


def words(model: AbstractBRDF, prior: Prior | None) -> dict[str, tuple[str, ...]]:
    """The prior of every parameter as text, one for each channel: "1.50 ± 0.05", or "0.0001 – 1, any magnitude"."""
    found = {}
    for entry in entries(model):
        texts = []
        for k in range(entry.place.start, entry.place.stop):
            stated = prior is not None and float(prior.precision[k]) > 0
            texts.append(_stated(prior, entry.param.scale == "log", k) if stated else _flat(entry))
        found[entry.name] = tuple(texts)
    return found


def _flat(entry: Entry) -> str:
    p = entry.param
    return f"{p.lower:g} – {p.upper:g}{', in the logarithm' if p.scale == 'log' else ''}"


def _stated(prior: Any, log: bool, k: int) -> str:
    mean, sd = float(prior.mean[k]), 1.0 / float(prior.precision[k])
    return with_error(np.exp(mean), np.exp(mean) * sd) if log else with_error(mean, sd)
