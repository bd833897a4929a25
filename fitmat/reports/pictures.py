"""Pictures as files: PNG, SVG or PDF, whole or not at all, and never over something unasked.

It draws nothing.
"""

import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from fitmat.errors import OutputError
from fitmat.files import write_bytes
from fitmat.measurements.parsing.contents import shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = ("png", "svg", "pdf")
"""Suffixes of pictures."""

DPI = 150


def refuse_picture(path: Path | None, *, force: bool) -> None:
    """Refuse, before any work, a picture that could not be written.

    Args:
        path: Where it is to be written; None where none was asked for.
        force: Replace it where it exists.

    Raises:
        OutputError: it exists and `force` is off, or has no suffix of a picture.
    """
    if path is None:
        return
    if os.path.lexists(path) and not force:
        raise OutputError(f"{path}: already exists; choose another name, or --force to replace it.")
    if _kind(path) not in KINDS:
        raise OutputError(f"{path}: no picture, expected a name that ends in {', '.join(KINDS)}. Rename it.")


def write_picture(draw: Callable[[], "Figure"], path: Path, *, exact: bool = False) -> None:
    """Write what `draw` draws in the format that the suffix names; as large as it is if `exact`, else without margins.

    Raises:
        OutputError: it cannot be drawn or written.
    """
    buffer = io.BytesIO()
    try:
        draw().savefig(buffer, format=_kind(path), dpi=DPI, bbox_inches=None if exact else "tight")
    except Exception as error:  # whatever a library of pictures comes upon
        raise OutputError(f"{path}: could not be drawn ({reason(error)}); what was found is complete.") from error
    write_bytes(path, buffer.getvalue())


def reason(error: Exception) -> str:
    """Why something could not be drawn."""
    return f"{type(error).__name__}: {shown(str(error), 120)}"


def _kind(path: Path) -> str:
    return path.suffix.lower().removeprefix(".")
