"""Exporting: the material of a run, written for a renderer beside it.

It translates nothing itself.
"""

from pathlib import Path

from fitmat import files
from fitmat.exports.export import Export, export
from fitmat.studies.result import RECORD, load


def written(
    run: Path, target: str, folder: Path | None, model: str | None, name: str | None, **options: bool
) -> Export:
    """Load a run and export one of its models.

    Args:
        run: A run's folder, or its record.
        target: As `fitmat.export`.
        folder: Where to; None for one beside the run, with its name and the target's.
        model: Which model; None for the one that the data prefer.
        name: Of the material.
        **options: strict, verify and force, as `fitmat.export`.

    Raises:
        FitmatError: as `fitmat.load` and `fitmat.export`.
    """
    result = load(run)
    place = run.parent if run.name == RECORD else run
    target_folder = folder or files.default(place.resolve(), target)
    return export(result, target, target_folder, model=model, name=name, **options)
