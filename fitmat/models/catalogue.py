"""The catalogue: synthetic materials with what they are good for, written as files.

Each file's truth lies beside it; nothing is fitted.
"""

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fitmat.files import write_text
from fitmat.measurements.formats import csv
from fitmat.measurements.samples import Measurements
from fitmat.models.base import AbstractBRDF
from fitmat.models.registry import model
from fitmat.models.simulation import simulate

COMMAND = "fitmat simulate --catalogue data/synthetic"
"""What makes the files of the catalogue."""


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
        paths.append(write_text(folder / f"{material.name}.csv", csv.dump(material.measured(), made)))
        record = json.dumps(material.record(), indent=2, ensure_ascii=False) + "\n"
        paths.append(write_text(folder / f"{material.name}.truth.json", record))
    return tuple(paths)


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
