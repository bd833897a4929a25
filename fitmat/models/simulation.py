"""Synthetic measurements: a model of known parameters seen by an instrument of known noise.

It fits nothing, reads no file and writes none.
"""

import dataclasses

import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from fitmat import arguments
from fitmat.errors import FitmatError, ModelError
from fitmat.maths.directions import from_angles
from fitmat.measurements.instrument import IDEAL, Instrument
from fitmat.measurements.samples import Measurements, from_arrays, in_plane
from fitmat.models.around.instrument import Seen, displaced
from fitmat.models.base import AbstractBRDF, AbstractEstimated, evaluate, refuse_sampling
from fitmat.models.parameters import vector


def simulate(
    truth: AbstractBRDF,
    theta_i: ArrayLike,
    theta_o: ArrayLike,
    *,
    relative_noise: float,
    absolute_noise: float,
    seed: int,
    phi: ArrayLike = np.pi,
    phi_i: ArrayLike = 0.0,
    channels: tuple[str, ...] | None = None,
    give_sigma: bool = True,
    instrument: Instrument = IDEAL,
    samples: int | None = None,
) -> Measurements:
    """Measure a model at every combination of angles, in radians; BRDF in sr⁻¹ without cosine.

    y = f + σ ε, ε ~ N(0, 1), σ² = absolute² + (relative f)², where f is the true value, not y. Values that the noise
    makes negative are kept.

    Args:
        truth: From `fitmat.model`.
        theta_i: Zenith angles of incidence, (a,), 0 to π/2.
        theta_o: Zenith angles of reflection, (b,), −π/2 to π/2; with the default phi, positive = mirror side.
        relative_noise: Fraction of the true value, ≥ 0.
        absolute_noise: In sr⁻¹, ≥ 0.
        seed: Of numpy's default generator; the same seed gives the same noise.
        phi: Relative azimuths φ_o − φ_i of positive theta_o, (c,) or one.
        phi_i: Azimuths of incidence, (d,) or one; of consequence for anisotropic and tilted samples only.
        channels: Names of the c channels.
        give_sigma: Whether the measurements know their σ; never where there is no noise.
        instrument: What shows the surface. Its calibration error is drawn once, from ln g ~ N(0, calibration²), that of
            its half-angles likewise; of each angle an offset once, and jitter for every reading, both from
            N(0, angle_error²). Its dark signal must have a value.
        samples: Paths for each geometry of a model that is estimated, such as `ggx-walk`; for no other. Its standard
            error is part of σ.

    Returns:
        n = d·a·c·b samples, theta_o running fastest; a sample of σ = 0 among others is masked.

    Raises:
        FitmatError: the model holds 32-bit floats, or an angle, as in degrees, a noise or the seed is out of range.
        ModelError: the names are not as many as the model's channels.

    Example:
        >>> import jax
        >>> jax.config.update("jax_enable_x64", True)
        >>> from fitmat.models.registry import model
        >>> gloss = model("lambert+ggx", kd=0.3, alpha=0.1, eta=1.5)
        >>> simulate(gloss, [0.5, 1.0], [-0.5, 0.5, 1.0], relative_noise=0.02, absolute_noise=1e-3, seed=1).n_samples
        6
    """
    arguments.kind("truth", truth, AbstractBRDF)
    arguments.kind("instrument", instrument, Instrument)
    arguments.whole("seed", seed)
    arguments.flags(give_sigma=give_sigma)
    for name, noise in {"relative_noise": relative_noise, "absolute_noise": absolute_noise}.items():
        arguments.numbers(name, noise, 0.0, single=True)
    if instrument.dark is None:
        raise ModelError("dark = None of the instrument (--dark fit), expected a number: there is nothing to fit yet.")
    if isinstance(truth, AbstractEstimated) and not instrument.ideal:
        raise ModelError(f"instrument of {truth.name}: expected an ideal one for values that are estimated.")
    turn, light, relative, sensor = _grid(theta_i, theta_o, phi, phi_i)
    _refuse_single_precision(truth)
    wi, wo = from_angles(light, turn), from_angles(np.abs(sensor), turn + relative + np.where(sensor < 0, np.pi, 0.0))
    rng = np.random.default_rng(seed)
    shown = truth if instrument.ideal else _shown(truth, instrument, rng)
    pair, ratio = _read_amiss(wi, wo, instrument, rng) if instrument.angle_error else ((wi, wo), 1.0)
    exact, error = _values(shown, pair, samples, seed)
    exact = exact * ratio
    if channels is not None and len(channels) != exact.shape[1]:
        raise ModelError(f"{len(channels)} channel names, expected {exact.shape[1]}, one for each of the model's.")
    sigma = np.hypot(absolute_noise, relative_noise * exact)
    value = exact + sigma * rng.normal(size=exact.shape)
    sigma = np.hypot(sigma, error)
    given = sigma if give_sigma and relative_noise + absolute_noise > 0 else None
    source = f"simulated {truth.name}"
    measured = from_arrays(
        light, sensor, value, phi=relative, phi_i=turn, sigma=given, channels=channels, source=source
    )
    return dataclasses.replace(measured, instrument=instrument)


def _shown(truth: AbstractBRDF, instrument: Instrument, rng: np.random.Generator) -> Seen:
    """The surface as an instrument shows it whose factors are drawn."""
    scale, aperture = (
        jnp.exp(sd * rng.normal()) if sd else None for sd in (instrument.calibration, instrument.aperture_error)
    )
    return Seen(truth, instrument, scale=scale, aperture=aperture)


def _read_amiss(
    wi: np.ndarray, wo: np.ndarray, instrument: Instrument, rng: np.random.Generator
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Where the light and the sensor are in truth, and the light's cosine there over that where it was read."""
    sd, count = instrument.angle_error, len(wi)
    light, sensor = (sd * (rng.normal() + rng.normal(size=(count, 1))) for _ in range(2))
    true = displaced(wi, wo, light, sensor, signed=bool(in_plane(wi, wo).all()))
    return true, np.maximum(true[0][:, 2:], 0.0) / wi[:, 2:]


def _values(
    truth: AbstractBRDF, pair: tuple[np.ndarray, np.ndarray], samples: int | None, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Values and their standard errors, 0 where there is a formula."""
    if isinstance(truth, AbstractEstimated):
        arguments.whole("samples", samples, 2)
        assert samples is not None
        found = evaluate(truth, *pair, samples=samples, seed=seed)
        return found.value, found.standard_error
    refuse_sampling(truth, samples=samples)
    exact = evaluate(truth, *pair)
    return exact, np.zeros_like(exact)


def _grid(theta_i: ArrayLike, theta_o: ArrayLike, phi: ArrayLike, phi_i: ArrayLike) -> list[np.ndarray]:
    """phi_i, theta_i, phi and theta_o at every combination, theta_o fastest."""
    axes = (
        arguments.angles("phi_i", phi_i, arguments.AZIMUTH, signed=True),
        arguments.angles("theta_i", theta_i, arguments.ZENITH),
        arguments.angles("phi", phi, arguments.AZIMUTH, signed=True),
        arguments.angles("theta_o", theta_o, arguments.ZENITH, signed=True),
    )
    return [np.ravel(angle) for angle in np.meshgrid(*axes, indexing="ij")]


def _refuse_single_precision(truth: AbstractBRDF) -> None:
    if vector(truth).dtype != np.float64:
        raise FitmatError(
            'fitmat needs 64-bit floats: run jax.config.update("jax_enable_x64", True) before building the model.'
        )
