"""Options of `fitmat simulate` as text, and the files it writes; nothing is replaced unless asked.

The physics and the noise are those of `models.simulation`.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fitmat import arguments
from fitmat.cli.angles import angles
from fitmat.cli.angles import wavelengths as spectrum
from fitmat.errors import ModelError, OutputError
from fitmat.files import write_text
from fitmat.fitting.dispersed import dispersed, located
from fitmat.fitting.known import of_film, of_material, refuse_no_film
from fitmat.measurements.formats import csv
from fitmat.measurements.instrument import Instrument
from fitmat.measurements.samples import default_channels
from fitmat.models import catalogue, simulation
from fitmat.models.base import AbstractBRDF, AbstractEstimated
from fitmat.models.parameters import assignments, check_range, entries, of_size, vector, with_vector
from fitmat.models.registry import model
from fitmat.models.terms.dispersive import LAWS

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


def truth(
    name: str | None,
    settings: Sequence[str],
    masking: str | None,
    wavelengths: str | None = None,
    *,
    ior: str | None = None,
    film: str | None = None,
    dispersion: str | None = None,
) -> tuple[AbstractBRDF, tuple[str, ...]]:
    """The model to simulate, and the names of its channels; lists of values make it a model of several.

    Args:
        name: Of the model.
        settings: `NAME=VALUE` texts.
        masking: Of microfacet lobes.
        wavelengths: Of the channels, as `angles.wavelengths`.
        ior: Material of the surface, or of what lies under its film.
        film: Material of the film.
        dispersion: Law of the index over the wavelengths.

    Raises:
        ModelError: no name, two things that say the same, or what `models.registry.model`, `fitting.known` and
            `fitting.dispersed` refuse.
    """
    if name is None:
        raise ModelError("name a model to simulate, for example lambert+ggx, or give --catalogue FOLDER.")
    values = assignments(settings, "--set")
    nm = None if wavelengths is None else spectrum(wavelengths, "--wavelengths")
    count = max((v.size for v in values.values()), default=1) if nm is None else len(nm)
    channels = default_channels(count) if nm is None else tuple(f"{x:.10g}" for x in nm)
    if dispersion is not None:
        if nm is None:
            raise ModelError(
                f"--dispersion {dispersion} without --wavelengths, expected where the channels are. Add it."
            )
        if ior is not None or film is not None:
            got = f"--dispersion {dispersion} beside {'--film' if ior is None else '--ior'}"
            raise ModelError(f"{got}, which says an index already: expected one of them. Leave one out.")
        return _lawful(name, values, masking, channels, dispersion), channels
    if film is not None and nm is None and "-film" in name:
        raise ModelError(f"--film {film} without --wavelengths, expected where the channels are. Add it.")
    held: dict[str, np.ndarray] = {}
    if ior is not None:
        ((name, held),) = of_material(name, ior, channels).items()
    if film is not None:
        made = of_film(name, film, channels)
        refuse_no_film(film, {name: made})
        held = held | made
    if twice := sorted(held.keys() & values.keys()):
        raise ModelError(f"--set {twice[0]} beside --ior or --film, which say it already. Leave one out.")
    given = {k: v[0] if v.size == 1 else v for k, v in (values | held).items()}
    built = model(name, masking=masking, channels=count, **given)
    return (built if nm is None else located(built, channels)), channels


def _lawful(
    name: str,
    values: dict[str, np.ndarray],
    masking: str | None,
    channels: tuple[str, ...],
    law: str,
) -> AbstractBRDF:
    """The model whose index follows a law, with the law's parameters as given."""
    arguments.choice("dispersion", law, LAWS)
    own = {field.name for field in dataclasses.fields(LAWS[law]) if "param" in field.metadata}
    given = {k: v[0] if v.size == 1 else v for k, v in values.items() if k not in own}
    try:
        plain = model(name, masking=masking, channels=len(channels), **given)
    except ModelError as error:
        raise ModelError(f"{error} The law {law} has {', '.join(sorted(own))}.") from error
    built = dispersed(plain, law, channels)
    left = {entry.name for entry in entries(built)}
    if lost := sorted(given.keys() & ({entry.name for entry in entries(plain)} - left)):
        got = f"--set {lost[0]} beside --dispersion {law}, whose law says it"
        raise ModelError(f"{got}: expected any of {', '.join(e.name for e in entries(built))}. Set those.")
    told = np.array(vector(built), float)
    for entry in entries(built):
        if entry.name in own & values.keys():
            told[entry.place] = of_size(entry.name, values[entry.name], len(channels), False)
    built = with_vector(built, told)
    check_range(built)
    return built


def write_simulation(
    path: Path,
    material: AbstractBRDF,
    geometry: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    channels: tuple[str, ...] | None = None,
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
        channels: Their names; None for the usual ones.
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
        channels=channels,
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
