"""Exporting: the material of a run, written for a renderer beside it.

It translates nothing itself.
"""

from pathlib import Path
from typing import Any

import numpy as np

from fitmat import files
from fitmat._types import Progress
from fitmat.cli.angles import angles
from fitmat.exports.export import Export, export
from fitmat.studies.result import RECORD, load


def written(run: Path, target: str, folder: Path | None, say: Progress, **options: Any) -> Export:
    """Load a run and export one of its models.

    Args:
        run: A run's folder, or its record.
        target: As `fitmat.export`.
        folder: Where to; None for one beside the run, with its name and the target's.
        say: Is told what is done.
        **options: As `fitmat.export`.

    Raises:
        FitmatError: as `fitmat.load` and `fitmat.export`.
    """
    result = load(run)
    say(f"exporting to {target}", 0, 0)
    place = run.parent if run.name == RECORD else run
    return export(result, target, folder or files.default(place.resolve(), target), **options)


def grid(theta_i: str | None, step: float | None) -> dict[str, Any]:
    """The angles of a table in radians; errors as `angles`."""
    light = None if theta_i is None else np.deg2rad(angles(theta_i, "--theta-i", lowest=0.0))
    return {"theta_i": light, "step": None if step is None else float(np.deg2rad(step))}
