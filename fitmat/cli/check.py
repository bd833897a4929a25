"""Checking: an examination as the command line shows it, with its picture.

It finds nothing itself.
"""

import io
import json
import os
from pathlib import Path

from fitmat.errors import OutputError
from fitmat.files import write_bytes
from fitmat.judgement.examination.examining import Examination, examine
from fitmat.measurements.samples import Measurements
from fitmat.reports.examination_plots import plot_examination

PICTURES = ("png", "svg", "pdf")
DPI = 150


def checked(measurements: Measurements, plot: Path | None, *, force: bool) -> Examination:
    """Examine measurements and draw them.

    Args:
        measurements: What to examine.
        plot: The picture to write, or None.
        force: Replace it where it exists.

    Raises:
        OutputError: the picture exists and `force` is off, has no suffix of a picture, or cannot be written.
    """
    if plot is not None and os.path.lexists(plot) and not force:
        raise OutputError(f"{plot}: already exists; choose another name, or --force to replace it.")
    kind = None if plot is None else plot.suffix.lower().removeprefix(".")
    if kind is not None and kind not in PICTURES:
        raise OutputError(f"{plot}: no picture, expected a name that ends in {', '.join(PICTURES)}. Rename it.")
    found = examine(measurements)
    if plot is not None:
        buffer = io.BytesIO()
        plot_examination(found).savefig(buffer, format=kind, dpi=DPI, bbox_inches="tight")
        write_bytes(plot, buffer.getvalue())
    return found


def as_json(found: Examination) -> str:
    """Everything that was found, as one JSON object."""
    return json.dumps(found.as_dict(), indent=2, ensure_ascii=False, allow_nan=False)
