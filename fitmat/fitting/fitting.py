"""Fit a model to measurements: many starts, Levenberg–Marquardt, the discrepancy inferred, the outcome named.

Gives the best parameters, how sure the data are of them locally (covariance), and what to think of the result.
"""

import os
from collections.abc import Mapping

import jax
import numpy as np
from jaxtyping import ArrayLike

from fitmat import arguments
from fitmat.errors import FitmatError, ModelError
from fitmat.fitting.concluding import conclude
from fitmat.fitting.coordinates import Coordinates, coordinates
from fitmat.fitting.discrepancy import first_discrepancy
from fitmat.fitting.dispersed import dispersed, located
from fitmat.fitting.ends import Ends, behind
from fitmat.fitting.jitter import AGAIN, jittered
from fitmat.fitting.likelihood import Data, prepare
from fitmat.fitting.losses import DEFAULT
from fitmat.fitting.losses import loss as find_loss
from fitmat.fitting.priors import prepare_prior, refuse_idle
from fitmat.fitting.proportional import proportional
from fitmat.fitting.refining import MAX_STEPS, ROUNDS, STARTS, confirmed, optima
from fitmat.fitting.result import Fit
from fitmat.fitting.seeing import seen
from fitmat.fitting.starts import starting_points
from fitmat.maths.blas import one_thread
from fitmat.measurements.noise import Noise, measured_noise
from fitmat.measurements.reader import measurements_of
from fitmat.measurements.samples import Measurements
from fitmat.models import names
from fitmat.models.around.noise import LEAST_ABSOLUTE, Noisy
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import check_range, entries, vector, with_vector
from fitmat.models.registry import model


@one_thread()
def fit(
    measurements: Measurements | str | os.PathLike[str],
    to: str | AbstractBRDF,
    *,
    fixed: Mapping[str, ArrayLike] | None = None,
    priors: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    loss: str = DEFAULT.name,
    masking: str | None = None,
    dispersion: str | None = None,
    max_steps: int = MAX_STEPS,
) -> Fit:
    """Fit a model to measurements.

    Args:
        measurements: From `fitmat.read`, or a file that needs no options.
        to: A model name ("lambert+ggx"), or a model whose shapes and static choices are used.
        fixed: Parameters to hold, by name, also as others call them: `{"ks": 1.0}`, `{"roughness": 0.4}`.
        priors: What is known beforehand, by name: centre and standard deviation, `{"eta": (1.5, 0.05)}`; see
            `fitmat.fitting.priors`.
        loss: What is minimised, by name (`fitmat.fitting.losses`); only a likelihood supports a posterior.
        masking: Static masking choice for the microfacet lobes of a named model.
        dispersion: Law that the refractive index follows over the channels' wavelengths, "cauchy", "sellmeier",
            "drude", "drude-lorentz", "smooth" or "smooth-metal" (`fitmat.models.terms.dispersive`): its few parameters
            are fitted instead.
        max_steps: Levenberg–Marquardt iterations per start.

    Returns:
        A `Fit`; a numerical failure is its `result`, not an exception.

    Raises:
        FitmatError: float64 is off, the model is unknown, a prior is not of this model or could change nothing, or
            there are too few valid samples.

    Example:
        >>> fit(read("measurements.csv"), "lambert+ggx", fixed={"ks": 1.0})  # doctest: +SKIP
    """
    arguments.kind("to", to, str, AbstractBRDF)
    arguments.named(fixed=fixed, priors=priors)
    arguments.whole("max_steps", max_steps, 1)
    given = measurements_of(measurements)
    asked = {"fixed": fixed, "priors": priors, "loss": loss, "masking": masking, "dispersion": dispersion}
    return fitted(given, measured_noise(given), to, **asked, max_steps=max_steps)


@one_thread()
def fitted(
    measurements: Measurements,
    noise: Noise,
    to: str | AbstractBRDF,
    *,
    fixed: Mapping[str, ArrayLike] | None = None,
    priors: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    loss: str = DEFAULT.name,
    masking: str | None = None,
    dispersion: str | None = None,
    max_steps: int = MAX_STEPS,
) -> Fit:
    """`fit` where the noise, which is the same for every model, was looked for before."""
    refuse_single_precision()
    template = located(asked_model(to, len(measurements.channels), masking), measurements.channels)
    arguments.kind("dispersion", dispersion, str, optional=True)
    if dispersion is not None:
        template = dispersed(template, dispersion, measurements.channels)
    chosen = find_loss(loss)
    shown = seen(template, measurements)
    known = dict(priors or {})
    fixed = names.own(template.name, {e.name for e in entries(template)}, fixed or {})
    refuse_idle(known, fixed, chosen)
    if chosen.infers_noise:
        shown, known = Noisy(shown), _noise_priors(measurements) | known
    held = held_values(shown, fixed)
    moved = coordinates(shown, held)
    needed = moved.count + 2
    if chosen.needs_noise and not noise.known:
        raise FitmatError(
            f"{measurements.source}: the loss {chosen.name} needs the noise, and it is not known; give a column sigma, "
            f"or choose another loss (default infers what is needed)."
        )
    data = prepare(measurements, noise, prepare_prior(shown, measurements.instrument, known), chosen)
    usable = int(np.count_nonzero(data.weight))
    if usable < needed:
        raise FitmatError(
            f"{measurements.source}: {usable} valid samples, but {template.name} has {moved.count} free "
            f"parameters and needs at least {needed}; measure more angles or fix parameters (--fix ks=1)."
        )
    first = first_discrepancy(data)
    starts = starting_points(template, data, first, held, ROUNDS * STARTS)
    added = np.asarray(vector(shown))[len(vector(template)) :]
    starts = np.column_stack([starts, np.tile(added, (len(starts), 1))])
    ends = confirmed(shown, data, starts, moved, max_steps)
    if measurements.sigma is not None and not chosen.infers_noise:  # noise that readings show has jitter in it
        data, ends = _with_jitter(measurements, shown, data, ends, moved, max_steps)
    if not noise.known and chosen.infers_discrepancy:
        noise, data, ends = proportional(measurements, shown, (noise, data), ends, moved, max_steps)
    return conclude(measurements, shown, held, (noise, data), ends)


def refuse_single_precision() -> None:
    """Raise `FitmatError` where JAX computes in 32 bits."""
    if not jax.config.read("jax_enable_x64"):
        raise FitmatError(
            'fitmat needs 64-bit floats: run jax.config.update("jax_enable_x64", True) before building arrays.'
        )


def asked_model(to: str | AbstractBRDF, channels: int, masking: str | None) -> AbstractBRDF:
    """The model that a name means, or the model itself.

    Raises:
        ModelError: the name is unknown, or a masking is given beside a model.
    """
    if isinstance(to, str):
        return model(to, channels=channels, masking=masking)
    if masking is not None:
        raise ModelError(
            f"masking = {masking!r} beside a model, expected it with a name: a model has its own. Leave it out."
        )
    return to


def _with_jitter(
    m: Measurements, shown: AbstractBRDF, data: Data, ends: Ends, moved: Coordinates, max_steps: int
) -> tuple[Data, Ends]:
    """The samples with the noise that chance errors of their angles add, and where the ends go with it."""
    told, found = m.instrument.angle_error, data
    for _ in range(AGAIN if told else 0):
        apart = behind(ends, found)
        order = np.argsort(apart, kind="stable")[:STARTS]
        if not np.isfinite(apart[order[0]]):
            break
        found = jittered(data, with_vector(shown, ends.values[order[0]]), told, signed=bool(m.in_plane.all()))
        ends = optima(shown, found, ends.values[order], moved, max_steps)
    return found, ends


def _noise_priors(m: Measurements) -> dict[str, tuple[ArrayLike, ArrayLike]]:
    """Of an inferred noise: either part is known to an order of magnitude, about 3 % and a hundredth of the median."""
    middle = float(np.median(np.abs(m.value[m.valid]))) or 1.0
    centres = {"absolute": np.clip(0.01 * middle, 2.0 * LEAST_ABSOLUTE, 1.0), "relative": 0.03}
    return {name: (centre, np.log(10.0) * centre) for name, centre in centres.items()}


def held_values(template: AbstractBRDF, fixed: Mapping[str, ArrayLike]) -> dict[str, np.ndarray]:
    """Fixed values as arrays of each parameter's size, checked against its bounds."""
    sizes = {e.name: e for e in entries(template)}
    held, values = {}, np.array(vector(template))
    for name, value in fixed.items():
        if name not in sizes:
            raise ModelError(f"cannot fix {name!r}: {template.name} has {', '.join(sizes)}.")
        given = np.atleast_1d(arguments.numbers(f"fixed {name}", value))
        if given.shape not in ((1,), (sizes[name].size,)):
            raise ModelError(f"fixed {name} has {given.size} values: expected 1 or {sizes[name].size}.")
        values[sizes[name].place] = given
        held[name] = values[sizes[name].place].copy()
    check_range(with_vector(template, values))
    return held
