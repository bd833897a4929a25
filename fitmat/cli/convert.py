"""Converting: a file written in another format, and what there is to say of it.

The formats are those of `measurements`.
"""

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fitmat.measurements import writing
from fitmat.measurements.reader import read


def written(sources: Sequence[Path], reading: Mapping[str, Any], out: Path, *, force: bool) -> list[str]:
    """Write the measurements of files to another; what they are, and what that cannot hold, as lines.

    Args:
        sources: Files to read, as one measurement.
        reading: Arguments of `fitmat.read`.
        out: To write; its ending names the format.
        force: Whether to replace it.

    Raises:
        FitmatError: as `fitmat.read` and `fitmat.write`.
    """
    measurements = read(sources, **reading)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the losses are among the lines
        writing.write(measurements, out, force=force)
    return [str(measurements), *writing.losses(measurements, out)]
