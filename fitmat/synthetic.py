"""Synthetic measurements: a model of known parameters seen by an instrument of known noise.

It fits nothing and reads no file; what it writes, `fitmat.formats.read` reads.
"""

import dataclasses
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from fitmat.brdf import AbstractBRDF, Seen, evaluate
from fitmat.errors import FitmatError, ModelError
from fitmat.folder import write_text
from fitmat.geometry import from_angles
from fitmat.instrument import IDEAL, Instrument
from fitmat.measurement import Measurements, from_arrays
from fitmat.params import vector

FLAT = 1e-6
"""Radians; an azimuth this close to 0 or π is written as the sign of theta_o."""


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
        instrument: What shows the surface. Its calibration error is drawn once, from
            ln g ~ N(0, calibration²); a dark signal that is to be fitted must be given a value.

    Returns:
        n = d·a·c·b samples, theta_o running fastest; a sample of σ = 0 among others is masked.

    Raises:
        FitmatError: the model holds 32-bit floats.
        ModelError: an angle or a noise is out of range, or the names are not as many as the model's channels.

    Example:
        >>> import jax
        >>> jax.config.update("jax_enable_x64", True)
        >>> from fitmat.brdf import model
        >>> gloss = model("lambert+ggx", kd=0.3, alpha=0.1, eta=1.5)
        >>> simulate(gloss, [0.5, 1.0], [-0.5, 0.5, 1.0], relative_noise=0.02, absolute_noise=1e-3, seed=1).n_samples
        6
    """
    grid = np.meshgrid(phi_i, theta_i, phi, theta_o, indexing="ij")
    turn, light, relative, sensor = (np.ravel(angle) for angle in grid)
    _refuse_single_precision(truth)
    for name, angle in {"theta_i": light, "|theta_o|": np.abs(sensor)}.items():
        _refuse_outside(name, angle, np.pi / 2, "0 to π/2 radians. Are the angles in degrees?")
    for name, noise in {"relative_noise": relative_noise, "absolute_noise": absolute_noise}.items():
        _refuse_outside(name, noise, np.inf, "a finite number of at least 0")
    wi, wo = from_angles(light, turn), from_angles(np.abs(sensor), turn + relative + np.where(sensor < 0, np.pi, 0.0))
    rng = np.random.default_rng(seed)
    scale = np.exp(instrument.calibration * rng.normal()) if instrument.calibration else 1.0
    shown = truth if instrument.ideal else Seen(truth, instrument, scale=scale, dark=instrument.dark)
    exact = evaluate(shown, wi, wo)
    if channels is not None and len(channels) != exact.shape[1]:
        raise ModelError(f"{len(channels)} channel names, expected {exact.shape[1]}, one for each of the model's.")
    sigma = np.hypot(absolute_noise, relative_noise * exact)
    value = exact + sigma * rng.normal(size=exact.shape)
    given = sigma if give_sigma and relative_noise + absolute_noise > 0 else None
    source = f"simulated {truth.name}"
    azimuths = {"phi": relative, "phi_i": turn}
    measured = from_arrays(light, sensor, value, **azimuths, sigma=given, channels=channels, source=source)
    return dataclasses.replace(measured, instrument=instrument)


def _refuse_single_precision(truth: AbstractBRDF) -> None:
    if vector(truth).dtype != np.float64:
        raise FitmatError(
            'fitmat needs 64-bit floats: run jax.config.update("jax_enable_x64", True) before building the model.'
        )


def _refuse_outside(name: str, values: ArrayLike, upper: float, expected: str) -> None:
    values = np.ravel(np.asarray(values, float))
    for value in values[~(np.isfinite(values) & (values >= 0) & (values <= upper))][:1]:
        raise ModelError(f"{name} = {value:g}: expected {expected}.")


def write_csv(measurements: Measurements, path: str | Path, comments: Iterable[str] = ()) -> Path:
    """Write measurements as a table that `fitmat.formats.read` reads: angles in degrees, BRDF and σ in sr⁻¹.

    Columns theta_i, theta_o, brdf (brdf_r, … for several channels) and, where known, sigma; in the plane of incidence
    theta_o is signed, positive on the mirror side, else a column phi follows it, or phi_i and phi_o where the light
    does not always come from azimuth 0. Masked values are written as nan.
    Values have 7 digits, angles 10⁻⁶ degrees, so that the same measurements give the same bytes.

    Args:
        measurements: What to write.
        path: The file, replaced where it exists.
        comments: Lines to go before the header, each behind a #.

    Returns:
        The path.

    Raises:
        OutputError: the file cannot be written.
    """
    m = measurements
    aside = np.minimum(m.phi, np.pi - m.phi)
    flat = bool(np.all((aside < FLAT) | (m.theta_i < FLAT) | (m.theta_o < FLAT)))
    turned = bool(np.any(np.abs((m.phi_i + np.pi) % (2 * np.pi) - np.pi) > FLAT))
    angles = {"theta_i": m.theta_i, "theta_o": m.signed_theta_o if flat and not turned else m.theta_o}
    if turned:
        angles |= {"phi_i": m.phi_i, "phi_o": np.arctan2(m.wo[:, 1], m.wo[:, 0]) % (2 * np.pi)}
    elif not flat:
        angles |= {"phi": m.phi}
    tails = [f"_{name}" for name in m.channels] if len(m.channels) > 1 else [""]
    numbers = [np.where(m.valid, part, np.nan) for part in (m.value, m.sigma) if part is not None]
    kinds = ("brdf", "sigma")[: len(numbers)]
    header = [*angles, *(kind + tail for kind in kinds for tail in tails)]
    degrees = np.round(np.rad2deg(np.stack(list(angles.values()), axis=1)), 6) + 0.0
    rows = [
        ",".join([*(f"{angle:.9g}" for angle in left), *(f"{number:.6e}" for number in right)])
        for left, right in zip(degrees, np.concatenate(numbers, axis=1), strict=True)
    ]
    return write_text(Path(path), "\n".join([*(f"# {line}" for line in comments), ",".join(header), *rows, ""]))
