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
from fitmat.measurements.samples import Measurements

FORMATS = {".csv": "csv", ".parquet": "parquet", ".binary": "merl", ".bsdf": "zemax", ".alta": "alta"}
"""Suffix → room of `formats/` with `dump(measurements)`, its content as text or bytes, and, where that cannot hold all,
`losses(measurements)`, what it leaves out in sentences."""


def write(measurements: Measurements, path: str | os.PathLike[str], force: bool = False) -> Path:
    """Write measurements in the format that the suffix names; what the format cannot hold is warned of.

    Args:
        measurements: What to write.
        path: The file: .csv, .parquet, .binary (MERL), .bsdf (Zemax) or .alta.
        force: Replace the file where it exists; until the new one is complete, the old one stays.

    Returns:
        The path.

    Raises:
        OutputError: the suffix is unknown, the format cannot hold the measurements, the file exists and `force` is off,
            or the disk refuses.
    """
    arguments.kind("measurements", measurements, Measurements)
    arguments.kind("path", path, str, os.PathLike)
    arguments.flags(force=force)
    target = Path(path)
    room = _room(target)
    if os.path.lexists(target) and not force:
        raise OutputError(f"{target}: already exists; choose another name, or --force (force=True) to replace it.")
    content = room.dump(measurements)
    if lost := losses(measurements, target):
        warnings.warn(f"{target.name}: {' '.join(lost)}", stacklevel=2)
    return write_bytes(target, content.encode() if isinstance(content, str) else content)


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
