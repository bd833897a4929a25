"""Tables: a material at a goniometer's angles as CSV, Parquet and JSON, and at the cells of a MERL file.

The files are those of `measurements`; nothing is fitted, and no value is moved.
"""

import dataclasses
import json
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from fitmat import arguments
from fitmat.errors import ModelError
from fitmat.exports.material import Chosen
from fitmat.exports.verification import Difference, compared, directions, exact
from fitmat.maths.directions import from_angles, rotated
from fitmat.measurements.formats import csv, merl, parquet
from fitmat.measurements.reader import read
from fitmat.measurements.samples import Measurements, default_channels, from_arrays
from fitmat.models.base import AbstractBRDF, Sum, evaluate
from fitmat.models.values import at

STEP_DEG, WIDE_STEP_DEG = 5.0, 15.0
"""Degrees between angles where nothing is said; the wide one of anisotropic materials, which have an angle more."""

FINEST, COARSEST = np.deg2rad(0.1), np.deg2rad(45.0)
"""Steps that a table may have, radians."""

MOST_ROWS = 5_000_000
"""More rows than this are a slip of the keyboard."""

AZIMUTHS = 12
"""Azimuths of incidence over half a turn, of which a MERL file holds the mean."""

READER, LOOKUP = "fitmat's own reader", "the nearest cell, as BRDFRead.cpp does,"


class Grid(NamedTuple):
    """Angles of a goniometer, radians.

    Attributes:
        step: Between two of them.
        zenith: From 0 to below π/2, (n,).
        light: Zenith angles of incidence, (k,).
        azimuth: From 0 to π, of an anisotropic material all the way round, (m,).
        turns: Azimuths of incidence: 0, of an anisotropic material through half a turn, (r,).
    """

    step: float
    zenith: Float[np.ndarray, " n"]
    light: Float[np.ndarray, "..."]
    azimuth: Float[np.ndarray, " m"]
    turns: Float[np.ndarray, " r"]


def grid(chosen: Chosen, theta_i: ArrayLike | None, step: float | None) -> Grid:
    """The angles at which a material is written down.

    Args:
        chosen: What is exported.
        theta_i: Zenith angles of incidence in radians; None for every zenith angle.
        step: In radians; None for 5°, or 15° of an anisotropic material.

    Raises:
        FitmatError: an angle or the step is out of range.
    """
    isotropic = chosen.model.isotropic
    if step is None:
        step = float(np.deg2rad(STEP_DEG if isotropic else WIDE_STEP_DEG))
    arguments.numbers("step", step, FINEST, COARSEST, of=" radians; 0.1 to 45 degrees", single=True)
    zenith = np.arange(0.0, np.pi / 2 - 1e-9, step)
    light = zenith if theta_i is None else np.atleast_1d(arguments.angles("theta_i", theta_i, arguments.ZENITH))
    across = np.linspace(0.0, np.pi, max(round(np.pi / step), 1) + 1)
    azimuth = across if isotropic else np.concatenate([across, np.pi + across[1:-1]])
    return Grid(step, zenith, light, azimuth, across[:1] if isotropic else across[:-1])


def measured(chosen: Chosen, theta_i: ArrayLike | None = None, step: float | None = None) -> Measurements:
    """The material at every combination of angles.

    theta_o goes from 0 to below π/2 and the azimuth between the two from 0 to π, the mirror side, by the step; of an
    anisotropic material the azimuth goes all the way round, and that of incidence through half a turn.

    Args:
        chosen: What is exported.
        theta_i: Zenith angles of incidence in radians, 0 to below π/2, (k,); None for those of theta_o.
        step: In radians; None for 5°, or 15° of an anisotropic material.

    Raises:
        FitmatError: an angle or the step is out of range, or there would be more than `MOST_ROWS` rows.
    """
    step, seen, light, phi, turns = grid(chosen, theta_i, step)
    rows = len(light) * len(seen) * len(phi) * len(turns)
    if light.ndim != 1 or not 0 < rows <= MOST_ROWS:
        raise ModelError(
            f"a table of {rows} rows (step {np.rad2deg(step):g} degrees), expected 1 to {MOST_ROWS}. "
            "Take a larger step, or other incidences."
        )
    turn, incidence, azimuth, sensor = (a.ravel() for a in np.meshgrid(turns, light, phi, seen, indexing="ij"))
    wi, wo = from_angles(incidence, turn), from_angles(sensor, turn + azimuth)
    value = at(chosen.model, wi, wo)
    names = chosen.channels if len(chosen.channels) == value.shape[1] else default_channels(value.shape[1])
    source = chosen.source or chosen.model.name
    return from_arrays(incidence, sensor, value, phi=azimuth, phi_i=turn, channels=names, source=source)


def texts(name: str, header: Sequence[str], table: Measurements) -> dict[str, str | bytes]:
    """File names → contents: the same table three times; angles in degrees, BRDF in sr⁻¹."""
    columns = {key: column.tolist() for key, column in csv.columns(table).items()}
    told = {"about": list(header), "columns": columns}
    return {
        f"{name}.csv": csv.dump(table, header),
        f"{name}.parquet": parquet.dump(table),
        f"{name}.json": json.dumps(told, ensure_ascii=False, allow_nan=False) + "\n",
    }


def difference(chosen: Chosen, table: Measurements) -> Difference:
    """How far the values that are read back from the CSV file, at its own angles, are from the model's."""
    with tempfile.TemporaryDirectory(prefix="fitmat-table-") as folder:
        file = Path(folder) / "table.csv"
        file.write_text(csv.dump(table), encoding="utf-8")
        back = read(file)
    own = evaluate(chosen.model, *exact(back.wi, back.wo))
    found = compared(back.value, own, back.wi, back.wo, READER)
    over = "those of the table; between them whoever reads it interpolates"
    return dataclasses.replace(found, over=over, how="Read back by")


def in_cells(chosen: Chosen) -> Measurements:
    """The material at the centres of MERL's cells, light at azimuth 0; anisotropic ones in the mean over azimuths.

    Raises:
        OutputError: neither 1 nor 3 channels.
    """
    wi, wo = merl.centres()
    up = (wi[:, 2] > 0.0) & (wo[:, 2] > 0.0)
    wi, wo = wi[up], wo[up]
    count = 1 if chosen.model.isotropic else AZIMUTHS
    value = np.mean([_turned(chosen.model, wi, wo, k * np.pi / count) for k in range(count)], axis=0)
    names = chosen.channels if len(chosen.channels) == value.shape[1] else default_channels(value.shape[1])
    source = chosen.source or chosen.model.name
    valid = np.ones(value.shape, bool)
    return Measurements(wi=wi, wo=wo, value=value, sigma=None, valid=valid, channels=names, source=source)


def _turned(
    model: AbstractBRDF, wi: Float[np.ndarray, "n 3"], wo: Float[np.ndarray, "n 3"], angle: float
) -> Float[np.ndarray, "n c"]:
    """Values with both directions turned about the normal."""
    return at(model, *(np.asarray(rotated(w.T, np.asarray(angle))).T for w in (wi, wo)))


def file(name: str, header: Sequence[str], cells: Measurements) -> dict[str, str | bytes]:
    """The MERL file, which holds no words: what there is to say stands in the record."""
    del header
    return {f"{name}.binary": merl.dump(cells)}


def notes(chosen: Chosen, cells: Measurements) -> list[str]:
    """What a MERL file cannot hold of the material, as sentences."""
    lobes = chosen.model.lobes if isinstance(chosen.model, Sum) else (chosen.model,)
    found = []
    if not chosen.model.isotropic:
        found.append(f"MERL holds isotropic materials: the values are means over {AZIMUTHS} azimuths of incidence.")
    if one_way := [lobe.name for lobe in lobes if "reciprocal" in lobe.breaks]:
        found.append(f"MERL holds light and eye exchanged in one cell, and {one_way[0]} is not reciprocal.")
    return found + [line for line in merl.losses(cells) if not line.startswith("One channel")]


def looked_up(chosen: Chosen, cells: Measurements) -> Difference:
    """How far the cell is, in which BRDFRead.cpp looks a pair of directions up, from the model's value there."""
    wi, wo = (w.astype(float) for w in directions())
    filled = np.zeros((int(np.prod(merl.SHAPE)), cells.value.shape[1]))
    filled[merl.cells(cells.wi, cells.wo)[0]] = cells.value
    below = (wi[:, 2] <= 0.0) | (wo[:, 2] <= 0.0)
    found = np.where(below[:, None], 0.0, filled[merl.cells(wi, wo)[0]])
    apart = compared(found, evaluate(chosen.model, *exact(wi, wo)), wi, wo, LOOKUP)
    return dataclasses.replace(apart, how="Looked up in")
