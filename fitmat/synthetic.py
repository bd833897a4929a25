"""Synthetic measurements: a model of known parameters seen by an instrument of known noise, and a catalogue of them.

It fits nothing and reads no file; what it writes, `fitmat.formats.read` reads.
"""

import dataclasses
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fitmat.brdf import AbstractBRDF, evaluate, model
from fitmat.errors import FitmatError, ModelError, OutputError
from fitmat.geometry import from_angles
from fitmat.measurement import Measurements, from_arrays
from fitmat.params import vector

COMMAND = "fitmat simulate --catalogue data/synthetic"
"""What makes the files of the catalogue."""

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
    phi: float = np.pi,
    channels: tuple[str, ...] | None = None,
    give_sigma: bool = True,
) -> Measurements:
    """Measure a model at every pair of a theta_i and a theta_o, angles in radians, BRDF in sr⁻¹ without cosine.

    y = f + σ ε, ε ~ N(0, 1), σ² = absolute² + (relative f)², where f is the true value, not y. Values that the noise
    makes negative are kept.

    Args:
        truth: From `fitmat.model`.
        theta_i: Zenith angles of incidence, (a,), 0 to π/2.
        theta_o: Zenith angles of reflection, (b,), −π/2 to π/2; with the default phi, positive = mirror side.
        relative_noise: Fraction of the true value, ≥ 0.
        absolute_noise: In sr⁻¹, ≥ 0.
        seed: Of numpy's default generator; the same seed gives the same noise.
        phi: Relative azimuth φ_o − φ_i of positive theta_o.
        channels: Names of the c channels.
        give_sigma: Whether the measurements know their σ; never where there is no noise.

    Returns:
        n = a·b samples, theta_o running fastest; a sample of σ = 0 among others is masked.

    Raises:
        FitmatError: the model holds 32-bit floats.
        ModelError: an angle or a noise is out of range, or the names are not as many as the model's channels.

    Example:
        >>> import jax
        >>> jax.config.update("jax_enable_x64", True)
        >>> gloss = model("lambert+ggx", kd=0.3, alpha=0.1, eta=1.5)
        >>> simulate(gloss, [0.5, 1.0], [-0.5, 0.5, 1.0], relative_noise=0.02, absolute_noise=1e-3, seed=1).n_samples
        6
    """
    light, sensor = (np.ravel(angle) for angle in np.meshgrid(theta_i, theta_o, indexing="ij"))
    _refuse_single_precision(truth)
    for name, angle in {"theta_i": light, "|theta_o|": np.abs(sensor)}.items():
        _refuse_outside(name, angle, np.pi / 2, "0 to π/2 radians. Are the angles in degrees?")
    for name, noise in {"relative_noise": relative_noise, "absolute_noise": absolute_noise}.items():
        _refuse_outside(name, noise, np.inf, "a finite number of at least 0")
    azimuth = np.where(sensor < 0, phi + np.pi, phi)
    wi, wo = from_angles(light, np.zeros_like(light)), from_angles(np.abs(sensor), azimuth)
    exact = evaluate(truth, wi, wo)
    if channels is not None and len(channels) != exact.shape[1]:
        raise ModelError(f"{len(channels)} channel names, expected {exact.shape[1]}, one for each of the model's.")
    sigma = np.hypot(absolute_noise, relative_noise * exact)
    value = exact + sigma * np.random.default_rng(seed).normal(size=exact.shape)
    given = sigma if give_sigma and relative_noise + absolute_noise > 0 else None
    source = f"simulated {truth.name}"
    return from_arrays(light, sensor, value, phi=phi, sigma=given, channels=channels, source=source)


def _refuse_single_precision(truth: AbstractBRDF) -> None:
    if vector(truth).dtype != np.float64:
        raise FitmatError(
            'fitmat needs 64-bit floats: run jax.config.update("jax_enable_x64", True) before building the model.'
        )


def _refuse_outside(name: str, values: ArrayLike, upper: float, expected: str) -> None:
    values = np.ravel(np.asarray(values, float))
    for value in values[~(np.isfinite(values) & (values >= 0) & (values <= upper))][:1]:
        raise ModelError(f"{name} = {value:g}: expected {expected}.")


@dataclasses.dataclass(frozen=True)
class Setup:
    """How the instrument looked; angles in **degrees**, noise as in `simulate`.

    Attributes:
        incidences: theta_i, (a,).
        theta_o: Signed theta_o, positive = mirror side, (b,), the same for each incidence.
        relative_noise: Fraction of the true value.
        absolute_noise: In sr⁻¹.
        sigma: Whether the file has a column of σ.
        channels: Names of the channels, None for one channel.
    """

    incidences: tuple[float, ...]
    theta_o: tuple[float, ...]
    relative_noise: float = 0.02
    absolute_noise: float = 1e-3
    sigma: bool = True
    channels: tuple[str, ...] | None = None


@dataclasses.dataclass(frozen=True)
class Material:
    """One file of the catalogue: a true material and how it was measured.

    Attributes:
        name: Stem of its files.
        model: Name of the true model.
        parameters: Its parameters by name, one number or one for each channel.
        setup: Angles and noise.
        seed: Of the noise.
        words: What the material is and what its file is good for.
        not_determined: Parameters that these angles cannot determine.
    """

    name: str
    model: str
    parameters: Mapping[str, float | tuple[float, ...]]
    setup: Setup
    seed: int
    words: str
    not_determined: tuple[str, ...] = ()

    def truth(self) -> AbstractBRDF:
        """The model with its true parameters."""
        values: dict[str, Any] = dict(self.parameters)
        return model(self.model, channels=len(self.setup.channels or ("value",)), **values)

    def measured(self) -> Measurements:
        """What the instrument saw, before rounding to the digits of a file."""
        return simulate(
            self.truth(),
            np.deg2rad(self.setup.incidences),
            np.deg2rad(self.setup.theta_o),
            relative_noise=self.setup.relative_noise,
            absolute_noise=self.setup.absolute_noise,
            seed=self.seed,
            channels=self.setup.channels,
            give_sigma=self.setup.sigma,
        )

    def record(self) -> dict[str, object]:
        """The truth as it is written beside the measurements, ready for JSON."""
        noise = {"relative": self.setup.relative_noise, "absolute": self.setup.absolute_noise}
        return {
            "name": self.name,
            "words": self.words,
            "model": self.model,
            "parameters": dict(self.parameters),
            "not_determined": list(self.not_determined),
            "noise": {**noise, "sigma_in_file": self.setup.sigma},
            "seed": self.seed,
            "command": COMMAND,
        }


def write_csv(measurements: Measurements, path: str | Path, comments: Iterable[str] = ()) -> Path:
    """Write measurements as a table that `fitmat.formats.read` reads: angles in degrees, BRDF and σ in sr⁻¹.

    Columns theta_i, theta_o, brdf (brdf_r, … for several channels) and, where known, sigma; in the plane of incidence
    theta_o is signed, positive on the mirror side, else a column phi follows it. Masked values are written as nan.
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
    angles = {"theta_i": m.theta_i, "theta_o": m.signed_theta_o if flat else m.theta_o}
    angles |= {} if flat else {"phi": m.phi}
    tails = [f"_{name}" for name in m.channels] if len(m.channels) > 1 else [""]
    numbers = [np.where(m.valid, part, np.nan) for part in (m.value, m.sigma) if part is not None]
    kinds = ("brdf", "sigma")[: len(numbers)]
    header = [*angles, *(kind + tail for kind in kinds for tail in tails)]
    degrees = np.round(np.rad2deg(np.stack(list(angles.values()), axis=1)), 6) + 0.0
    rows = [
        ",".join([*(f"{angle:.9g}" for angle in left), *(f"{number:.6e}" for number in right)])
        for left, right in zip(degrees, np.concatenate(numbers, axis=1), strict=True)
    ]
    return _write(Path(path), "\n".join([*(f"# {line}" for line in comments), ",".join(header), *rows, ""]))


def write_catalogue(folder: str | Path) -> tuple[Path, ...]:
    """Write NAME.csv and NAME.truth.json for each of `MATERIALS`, replacing files of those names.

    Args:
        folder: Where to; made where it does not exist.

    Returns:
        The paths written.

    Raises:
        OutputError: the folder or a file cannot be written.
    """
    folder, paths = Path(folder), []
    for material in MATERIALS:
        made = (f"{material.name}: {material.words}", f"Made by {COMMAND}; the truth is in {material.name}.truth.json")
        paths.append(write_csv(material.measured(), folder / f"{material.name}.csv", made))
        record = json.dumps(material.record(), indent=2, ensure_ascii=False) + "\n"
        paths.append(_write(folder / f"{material.name}.truth.json", record))
    return tuple(paths)


def _write(path: Path, text: str) -> Path:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_name(f"{path.name}.part")
        draft.write_text(text, encoding="utf-8", newline="\n")
        draft.replace(path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror}); choose another place.") from error
    return path


def _grid(step: float, fine: float | None = None) -> tuple[float, ...]:
    """Degrees from −80 to 80 by `step`, with 8 more by `fine` on either side of each angle of `FOUR`."""
    every = [np.arange(-80.0, 80.0 + step / 2, step)]
    every += [] if fine is None else [angle + fine * np.arange(-8, 9) for angle in FOUR]
    return tuple(np.unique(np.concatenate(every)).tolist())


GGX, BLINN = "lambert+ggx", "lambert+blinn-phong"
FOUR = (10.0, 30.0, 50.0, 70.0)

# Most setups have 4 × 81 = 6 × 54 = 324 rows, because a fit is compiled anew for each number of rows.
BROAD, SHARP, MIRROR = Setup(FOUR, _grid(2)), Setup(FOUR, _grid(10, fine=1)), Setup(FOUR, _grid(10, fine=0.25))
COARSE, SPARSE = Setup(FOUR, _grid(5)), Setup((20.0, 45.0, 70.0), _grid(10))
CURVE, NORMAL = Setup((45.0,), _grid(1)), Setup((0.0,), tuple(np.arange(0.0, 80.1, 0.5).tolist()))
SIX = Setup((10.0, 30.0, 45.0, 60.0, 70.0, 80.0), tuple(np.arange(-79.5, 80.0, 3.0).tolist()), relative_noise=0.01)
COLOUR = Setup(FOUR, _grid(4), channels=("r", "g", "b"))
POOR = Setup(FOUR, _grid(2), relative_noise=0.15, absolute_noise=0.02)
PRECISE, ROUGH = (dataclasses.replace(SHARP, relative_noise=noise) for noise in (0.01, 0.03))
UNKNOWN = dataclasses.replace(BROAD, sigma=False)

MATERIALS = (
    Material("dull-plastic", GGX, {"kd": 0.3, "ks": 1.0, "alpha": 0.4, "eta": 1.5}, BROAD, 1,
        words="dull grey plastic: a broad lobe on a diffuse floor"),
    Material("satin-plastic", GGX, {"kd": 0.2, "ks": 1.0, "alpha": 0.15, "eta": 1.5}, SHARP, 2,
        words="satin plastic, every 1° around the mirror directions"),
    Material("glossy-plastic", GGX, {"kd": 0.1, "ks": 1.0, "alpha": 0.05, "eta": 1.49}, SHARP, 3,
        words="glossy plastic, every 1° around the mirror directions"),
    Material("mirror-plastic", GGX, {"kd": 0.03, "ks": 1.0, "alpha": 0.01, "eta": 1.52}, MIRROR, 4,
        words="black plastic, nearly a mirror, every 0.25° around the mirror directions"),
    Material("rough-metal", GGX, {"kd": 0.02, "ks": 1.0, "alpha": 0.35, "eta": 6.0}, SIX, 5,
        words="rough metal as a dielectric of high index, up to 80° of incidence"),
    Material("polished-metal", GGX, {"kd": 0.01, "ks": 1.0, "alpha": 0.04, "eta": 6.0}, PRECISE, 6,
        words="polished metal as a dielectric of high index"),
    Material("coated-wood", GGX, {"kd": 0.25, "ks": 1.0, "alpha": 0.12, "eta": 1.5}, ROUGH, 7,
        words="varnished wood, a little uneven: more noise"),
    Material("red-paint", GGX, {"kd": (0.45, 0.12, 0.05), "ks": (1.0, 1.0, 1.0), "alpha": 0.2, "eta": 1.5}, COLOUR, 8,
        words="red paint in three channels: a diffuse colour under an uncoloured gloss"),
    Material("wax", BLINN, {"kd": 0.5, "ks": 0.06, "exponent": 40.0}, COARSE, 9,
        words="wax, with the broad lobe of Blinn–Phong"),
    Material("lacquer", BLINN, {"kd": 0.2, "ks": 0.04, "exponent": 800.0}, SHARP, 17,
        words="lacquer, with the narrow lobe of Blinn–Phong, every 1° around the mirror directions"),
    Material("sparse", GGX, {"kd": 0.3, "ks": 1.0, "alpha": 0.3, "eta": 1.5}, SPARSE, 11,
        words="dull plastic measured in a hurry: 3 incidences, 17 angles each"),
    Material("noisy", GGX, {"kd": 0.1, "ks": 1.0, "alpha": 0.25, "eta": 1.5}, POOR, 12,
        words="dull plastic under a poor instrument; negative values are noise"),
    Material("one-curve", GGX, {"kd": 0.3, "ks": 1.0, "alpha": 0.2, "eta": 1.5}, CURVE, 13,
        words="one curve at 45°: enough for the index, which the far side of the lobe shows"),
    Material("normal-incidence", GGX, {"kd": 0.3, "ks": 1.0, "alpha": 0.05, "eta": 1.5}, NORMAL, 14,
        words="one curve at normal incidence: weight and index act alike, so that neither is determined",
        not_determined=("ks", "eta")),
    Material("no-sigma-paint", GGX, {"kd": 0.4, "ks": 1.0, "alpha": 0.3, "eta": 1.5}, UNKNOWN, 15,
        words="silk paint without a column of σ: neighbouring angles show the noise"),
    Material("no-sigma-rubber", BLINN, {"kd": 0.06, "ks": 0.05, "exponent": 60.0}, UNKNOWN, 16,
        words="rubber, with the lobe of Blinn–Phong, without a column of σ"),
)  # fmt: skip
"""The catalogue, one file each; the default fits recover every parameter but those `not_determined`."""
