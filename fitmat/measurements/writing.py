"""Writing: measurements → a file of the format that its suffix names, whole or not at all.

It knows no layout: each format writes its own.
"""

import importlib
import os
import warnings
from pathlib import Path
from typing import Any

from fitmat import arguments
from fitmat.errors import OutputError
from fitmat.files import write_bytes
from fitmat.measurements.gaps import Directions
from fitmat.measurements.gaps import gaps as own_gaps
from fitmat.measurements.samples import Measurements

FORMATS = {".csv": "csv", ".parquet": "parquet", ".binary": "merl", ".bsdf": "zemax", ".alta": "alta"}
"""Suffix → room of `formats/` with `dump(measurements)`, its content as text or bytes, and, where that cannot hold all,
`losses(measurements)`, what it leaves out in sentences."""


TABLES = (".csv", ".parquet")
"""Suffixes of what has a column for everything."""


def write(measurements: Measurements, path: str | os.PathLike[str], force: bool = False) -> Path:
    """Write measurements in the format that the suffix names; what the format cannot hold is warned of.

    Of completed ones the table says what was inferred; beside another format stands NAME.cells.parquet, which does.

    Args:
        measurements: What to write.
        path: The file: .csv, .parquet, .binary (MERL), .bsdf (Zemax) or .alta.
        force: Replace the file where it exists; until the new one is complete, the old one stays.

    Returns:
        The path.

    Raises:
        OutputError: the suffix is unknown, the format cannot hold the measurements, the file exists and `force` is off,
            beside it stands what was inferred in another, or the disk refuses.
    """
    arguments.kind("measurements", measurements, Measurements)
    arguments.kind("path", path, str, os.PathLike)
    arguments.flags(force=force)
    target = Path(path)
    beside = None if measurements.inferred is None else marks(target)
    _refuse_existing(target, beside, force=force)
    if beside is None and (stale := marks(target)) is not None and os.path.lexists(stale):
        got = f"{stale} says that values of {target.name} were inferred, which those to write are not"
        raise OutputError(f"{got}; choose another name, or move it away.")
    content = _room(target).dump(measurements)
    if lost := losses(measurements, target):
        warnings.warn(f"{target.name}: {' '.join(lost)}", stacklevel=2)
    if beside is not None:
        write_bytes(beside, _room(beside).dump(measurements))
    return write_bytes(target, content.encode() if isinstance(content, str) else content)


def marks(target: Path) -> Path | None:
    """Where it stands what was inferred, and how well it is known; None where the file itself has room for it."""
    return None if target.suffix.lower() in TABLES else target.with_name(f"{target.stem}.cells.parquet")


def gaps(measurements: Measurements, path: str | os.PathLike[str], force: bool = False) -> Directions:
    """Directions that a complete file would hold, and that were not measured, before any work is done for them.

    Args:
        measurements: What was measured.
        path: The file, whose suffix names the format: MERL has a grid of its own, else it is that of the table.
        force: As in `write`.

    Returns:
        Unit vectors to the light and to the sensor, (m, 3) each.

    Raises:
        OutputError: as `write`, or nothing is missing, or the angles form no grid.
    """
    target = Path(path)
    room = _room(target)
    _refuse_existing(target, marks(target), force=force)
    return getattr(room, "gaps", own_gaps)(measurements)


def _refuse_existing(*paths: Path | None, force: bool) -> None:
    for path in paths:
        if path is not None and _room(path) and os.path.lexists(path) and not force:
            raise OutputError(f"{path}: already exists; choose another name, or --force (force=True) to replace it.")


def losses(measurements: Measurements, path: str | os.PathLike[str]) -> tuple[str, ...]:
    """What the format of that suffix cannot hold of the measurements, in sentences."""
    told, said = getattr(_room(Path(path)), "losses", None), str(measurements.instrument)
    beside = (f"No file says this of its values, say it again when it is read: {said}",) if said else ()
    return (*(told(measurements) if told else ()), *beside)


def _room(target: Path) -> Any:
    """The module that writes the format; imported here, so that none costs start-up time."""
    suffix = target.suffix.lower()
    if suffix not in FORMATS:
        known = ", ".join(FORMATS)
        got = f"no format has the suffix {suffix}" if suffix else "the name has no suffix, which says the format"
        raise OutputError(f"{target}: {got}, expected {known}. Rename it.")
    return importlib.import_module(f"fitmat.measurements.formats.{FORMATS[suffix]}")
