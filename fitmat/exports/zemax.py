"""Zemax (OpticStudio): the material as tabulated BSDF files, one for each channel, by the writer of `measurements`.

Angles count from the mirror direction, and more densely near it; nothing is fitted, and OpticStudio is not run.
"""

import dataclasses
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from fitmat.exports.material import Chosen
from fitmat.exports.table import READER, grid
from fitmat.exports.verification import Difference, compared, exact
from fitmat.maths.directions import from_angles
from fitmat.measurements.formats import zemax
from fitmat.measurements.parsing import blocks
from fitmat.measurements.reader import read
from fitmat.measurements.samples import Measurements, default_channels
from fitmat.models.base import evaluate
from fitmat.models.values import at

FINER = (1 / 64, 1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2)
"""Steps from the mirror direction before the first whole one."""


def translated(chosen: Chosen, theta_i: ArrayLike | None = None, step: float | None = None) -> list[Measurements]:
    """The material around the mirror direction of every incidence, channel by channel.

    Args:
        chosen: What is exported.
        theta_i: Zenith angles of incidence in radians, (k,); None for 0 to below π/2 by the step.
        step: Between radial angles, between azimuths around the mirror direction and between rotations of an
            anisotropic sample, radians; None for 5°, or 15° of an anisotropic material.

    Raises:
        FitmatError: an angle or the step is out of range.
    """
    step, _, light, azimuth, turns = grid(chosen, theta_i, step)
    radial = np.concatenate([[0.0], step * np.array(FINER), np.arange(step, np.pi - 1e-9, step)])
    turn, incidence, around, away = np.meshgrid(turns, light, azimuth, radial, indexing="ij")
    wo = blocks.around(incidence, turn, away, around).reshape(-1, 3)
    wi = from_angles(incidence.ravel(), turn.ravel())
    once = (wo[:, 2] > 1e-6) & ((away.ravel() > 0.0) | (around.ravel() == 0.0))
    wi, wo = wi[once], wo[once]
    value, source = at(chosen.model, wi, wo), chosen.source or chosen.model.name
    kept = (value > 0.0).all(axis=1)
    wi, wo, value = wi[kept], wo[kept], value[kept]
    valid, names = np.ones((len(wi), 1), bool), default_channels(1)
    return [
        Measurements(wi=wi, wo=wo, value=one[:, None], sigma=None, valid=valid, channels=names, source=source)
        for one in value.T
    ]


def texts(name: str, header: Sequence[str], parts: Sequence[Measurements]) -> dict[str, str]:
    """File names → texts: one file, or one for each channel; what there is to say in comment lines."""
    said = "".join(f"# {line}\n" for line in header)
    if len(parts) == 1:
        return {f"{name}.bsdf": said + zemax.dump(parts[0])}
    labels = default_channels(len(parts))
    return {f"{name}-{label}.bsdf": said + zemax.dump(part) for label, part in zip(labels, parts, strict=True)}


def difference(chosen: Chosen, parts: Sequence[Measurements]) -> Difference:
    """How far what is read back from the file of the first channel is from the model's values there."""
    with tempfile.TemporaryDirectory(prefix="fitmat-zemax-") as folder:
        file = Path(folder) / "table.bsdf"
        file.write_text(zemax.dump(parts[0]), encoding="utf-8")
        back = read(file)
    kept = back.valid.all(axis=1)
    wi, wo = back.wi[kept], back.wo[kept]
    own = evaluate(chosen.model, *exact(wi, wo))[:, :1]
    over = "those of the file; between them whoever reads it interpolates"
    return dataclasses.replace(compared(back.value[kept], own, wi, wo, READER), over=over, how="Read back by")
