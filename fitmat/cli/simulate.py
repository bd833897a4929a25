"""Options of `fitmat simulate` as text, and the files it writes; nothing is replaced unless asked.

The physics and the noise are those of `models.simulation`.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fitmat.cli.angles import angles
from fitmat.errors import ModelError, OutputError
from fitmat.files import write_text
from fitmat.measurements.formats import csv
from fitmat.measurements.instrument import Instrument
from fitmat.models import catalogue, simulation
from fitmat.models.base import AbstractBRDF, AbstractEstimated
from fitmat.models.parameters import assignments
from fitmat.models.registry import model

SAMPLES = 4096
"""Paths for each geometry of a model that is estimated, where the user gives no number."""


def grid(theta_i: str, theta_o: str, phi: str, phi_i: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The angles of the four options of that name, in degrees; errors as `angles`."""
    return (
        angles(theta_i, "--theta-i", lowest=0.0),
        angles(theta_o, "--theta-o"),
        angles(phi, "--phi", lowest=0.0, highest=360.0),
        angles(phi_i, "--phi-i", lowest=0.0, highest=360.0),
    )


def truth(name: str | None, settings: Sequence[str], masking: str | None) -> AbstractBRDF:
    """The model to simulate; lists of values make it a model of several channels.

    Raises:
        ModelError: no name, or what `models.registry.model` refuses.
    """
    if name is None:
        raise ModelError("name a model to simulate, for example lambert+ggx, or give --catalogue FOLDER.")
    values = assignments(settings, "--set")
    channels = max((v.size for v in values.values()), default=1)
    return model(name, masking=masking, channels=channels, **{k: v[0] if v.size == 1 else v for k, v in values.items()})


def write_simulation(
    path: Path,
    material: AbstractBRDF,
    geometry: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    *,
    noise: tuple[float, float, int],
    samples: int | None,
    instrument: Instrument,
    force: bool,
) -> tuple[Path, ...]:
    """Simulate and write one CSV file.

    Args:
        path: The file.
        material: The true model.
        geometry: theta_i, signed theta_o, phi and phi_i in degrees; every combination is measured.
        noise: Relative noise, absolute noise in sr⁻¹, seed.
        samples: Paths for each geometry where the model is estimated; None for `SAMPLES`.
        instrument: What measures it.
        force: Replace an existing file.

    Raises:
        OutputError: the file exists and `force` is off, or it cannot be written.
    """
    _refuse_existing([path], force)
    theta_i, theta_o, phi, phi_i = (np.deg2rad(part) for part in geometry)
    relative, absolute, seed = noise
    if samples is None and isinstance(material, AbstractEstimated):
        samples = SAMPLES
    measured = simulation.simulate(
        material,
        theta_i,
        theta_o,
        phi=phi,
        phi_i=phi_i,
        relative_noise=relative,
        absolute_noise=absolute,
        seed=seed,
        instrument=instrument,
        samples=samples,
    )
    described = f"simulated {material.name}; noise {relative:g} relative + {absolute:g} sr^-1, seed {seed}"
    paths = f"an estimate of {samples} paths a geometry, whose standard error is part of sigma" if samples else ""
    comments = [described, *filter(None, [paths, str(instrument)])]
    return (write_text(path, csv.dump(measured, comments)),)


def write_catalogue(folder: Path, *, force: bool) -> tuple[Path, ...]:
    """Write the catalogue of synthetic materials.

    Raises:
        OutputError: one of its files exists and `force` is off, or it cannot be written.
    """
    _refuse_existing([folder / f"{material.name}.csv" for material in catalogue.MATERIALS], force)
    return catalogue.write_catalogue(folder)


def _refuse_existing(paths: Sequence[Path], force: bool) -> None:
    existing = [path for path in paths if path.exists()]
    if existing and not force:
        raise OutputError(f"{existing[0]} already exists; give another name, or --force to replace it.")
