"""Checking: an examination as the command line shows it, with its picture.

It finds nothing itself.
"""

import json
from pathlib import Path

from fitmat.judgement.examination.examining import Examination, examine
from fitmat.measurements.samples import Measurements
from fitmat.reports.pictures import refuse_picture, write_picture


def check(measurements: Measurements, picture: Path | None, *, force: bool) -> Examination:
    """Examine measurements and draw them.

    Args:
        measurements: What to examine.
        picture: The picture to write, or None.
        force: Replace it where it exists.

    Raises:
        OutputError: as `refuse_picture` and `write_picture`.
    """
    refuse_picture(picture, force=force)
    found = examine(measurements)
    if picture is not None:
        from fitmat.reports.examination_plots import examination

        write_picture(examination(found), picture)
    return found


def as_json(found: Examination) -> str:
    """Everything that was found, as one JSON object."""
    return json.dumps(found.as_dict(), indent=2, ensure_ascii=False, allow_nan=False)
