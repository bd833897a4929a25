"""Runs: of each file of a batch, where that was asked for, the folder that `fitmat fit` would write.

A run's name ends in the key of its file's rows, so that no two files have one folder.
"""

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

from fitmat import files
from fitmat.batches.jobs import Job
from fitmat.errors import OutputError
from fitmat.studies.result import RECORD
from fitmat.studies.study import Study

RUNS = "runs"
"""Folder in a batch's folder."""

RUN = "run"
"""Column of the names of runs, which are folders in `RUNS`."""

_STEM, _KEY = 48, 8


def write(job: Job, key: str, study: Study, rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Write the run of a file, in place of an earlier one, and its rows with its name.

    Args:
        job: The file, whose `runs` says where.
        key: Of its rows.
        study: What was found.
        rows: The same as rows; what could not be drawn is said as their message.

    Raises:
        OutputError: it cannot be written.
    """
    from fitmat.reports import page  # most batches write none

    assert job.runs is not None
    folder = job.runs / f"{job.path.stem[:_STEM]}-{key[:_KEY]}"
    with files.new(folder, own=page.own, force=True) as draft:
        missing = page.write(draft, study)
    return [{**row, RUN: folder.name, "message": missing} for row in rows]


def is_there(job: Job, rows: Sequence[Mapping[str, Any]]) -> bool:
    """Whether the run of kept rows, if one is asked for, is still on disk."""
    return job.runs is None or RUN not in rows[0] or (job.runs / str(rows[0][RUN]) / RECORD).exists()


def link(row: Mapping[str, Any]) -> str:
    """Address of a run's page relative to the batch's, "" where there is none."""
    if not row.get(RUN) or row["message"]:
        return ""
    from fitmat.reports.page import PAGE

    return f"{RUNS}/{quote(os.fsencode(row[RUN]))}/{PAGE}"


def remove(folder: Path) -> None:
    """Take a run away; what else somebody put into its folder stays.

    Raises:
        OSError: it cannot be removed.
    """
    from fitmat.reports import page

    with suppress(OutputError):  # it is none any more
        for name in page.own(folder):
            (folder / name).unlink(missing_ok=True)
    with suppress(OSError):
        folder.rmdir()
