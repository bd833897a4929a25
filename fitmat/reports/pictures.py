"""Pictures as files: PNG, SVG or PDF, whole or not at all, and never over something unasked.

It draws nothing.
"""

import io
import os
from pathlib import Path
from typing import TYPE_CHECKING

from fitmat.errors import OutputError
from fitmat.files import write_bytes

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


def write_picture(figure: "Figure", path: Path) -> None:
    """Write a figure in the format that the suffix names.

    Raises:
        OutputError: it cannot be written.
    """
    buffer = io.BytesIO()
    figure.savefig(buffer, format=_kind(path), dpi=DPI, bbox_inches="tight")
    write_bytes(path, buffer.getvalue())


def _kind(path: Path) -> str:
    return path.suffix.lower().removeprefix(".")
