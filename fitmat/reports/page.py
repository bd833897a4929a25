"""The report: one JSON object, the draws, what is drawn of them, and one HTML page made from these files alone.

It computes nothing. All numbers are on disk before the page is made, so that it can be made again.
"""

import contextlib
import json
import os
import threading
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jinja2 import UndefinedError

from fitmat import arguments, files
from fitmat.errors import OutputError, ReadError
from fitmat.measurements.parsing.contents import shown
from fitmat.reports import ball, rendering
from fitmat.studies import figures, record
from fitmat.studies.result import FIGURES, POSTERIOR, RECORD, Result, drawn
from fitmat.studies.study import Study

PAGE, BUDGET = "report.html", "budget.txt"


def write(folder: Path, study: Study, command: str | None = None) -> str:
    """Write `fit.json`, `budget.txt`, `figures.json` and one `posterior-MODEL.parquet` per model, then `report.html`.

    Args:
        folder: Where to.
        study: What was found.
        command: By which it was asked for; None where it was not by one.

    Returns:
        What is missing because it could not be drawn or written, in one sentence; "" where nothing is.
    """
    found = record.to_dict(study, command)
    (folder / RECORD).write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    budgets = [str(found.budget) for found in study.findings if found.budget is not None]
    (folder / BUDGET).write_text("\n\n\n".join(budgets) + "\n", encoding="utf-8")
    for posterior in study.posteriors:
        posterior.save(folder / POSTERIOR.format(posterior.fit.name))
    try:
        points = figured(study)
        text = json.dumps(points, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
        (folder / FIGURES).write_text(text + "\n", encoding="utf-8")
        files.write_text(folder / PAGE, rendering.to_html(found, points))
    except Exception as error:  # the numbers stand, whatever a page comes upon
        why = f"{type(error).__name__}: {shown(str(error), 120)}"
        return f"{PAGE} could not be made ({why}); the numbers are saved in {RECORD}."
    return ""


def figured(study: Study) -> dict[str, Any]:
    """What a page draws of a study, as JSON types: its figures, and what lights its ball."""
    return figures.to_dict(study) | {"ball": ball.data(study)}


def own(folder: Path) -> list[str]:
    """Names of the files that a run wrote into a folder, last the record, which names the models of the others.

    Raises:
        OutputError: the folder has a file of such a name, and no record that says it is a run's.
    """
    beside = (PAGE, FIGURES, BUDGET, RECORD)
    try:
        found = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        models = [str(fit["model"]) for fit in found["fits"] if found["fitmat"]]
    except (OSError, ValueError, LookupError, TypeError):
        for name in (PAGE, RECORD, FIGURES, BUDGET):
            if os.path.lexists(folder / name):
                why = f"{folder / name} is not known to be of an earlier run, and is not replaced"
                raise OutputError(f"{why}; move it, or give another --out DIR.") from None
        return []
    names = [*(POSTERIOR.format(model) for model in models), *beside]
    return [name for name in names if Path(name).name == name and os.path.lexists(folder / name)]


def report(study: Study | Result, folder: str | Path | None = None, *, force: bool = False) -> Path:
    """Write the report of a study, or make the page of a run that is on disk again.

    Args:
        study: From `fitmat.study`: written are one HTML page, what it shows as JSON, and the draws of every posterior.
            Or from `fitmat.load`: only the page is written, beside what was loaded.
        folder: Where to; it appears complete or not at all. None for a run from disk, whose folder it is.
        force: Replace the report of an earlier run, or the page that is there.

    Returns:
        The page.

    Raises:
        OutputError: the folder holds something and `force` is off, or it cannot be written.
        ReadError: what is on disk is older than this version, or damaged.
    """
    arguments.kind("study", study, Study, Result)
    arguments.kind("folder", folder, str, os.PathLike, optional=isinstance(study, Result))
    arguments.flags(force=force)
    if isinstance(study, Result):
        if folder is not None:
            arguments.refuse("folder", folder, "none: the page of a run stands beside its record")
        return _again(study, force=force)
    target = Path(folder or "")
    with files.new(target, own=own, force=force) as draft:
        missing = write(draft, study)
    if missing:
        warnings.warn(f"{target}: {missing}", stacklevel=2)
    return target / PAGE


def _again(result: Result, *, force: bool) -> Path:
    """The page of a run, from its record and its figures."""
    target = result.file.parent / PAGE
    if os.path.lexists(target) and not force:
        raise OutputError(f"{target}: already exists; --force makes it again.")
    return files.write_text(target, _rendered(result.file, result.record, drawn(result)))


def _rendered(file: Path, told: Mapping[str, Any], points: Mapping[str, Any]) -> str:
    """The page; a record that lacks what a page needs is refused."""
    try:
        return rendering.to_html(told, points)
    except (LookupError, TypeError, ValueError, AttributeError, UndefinedError) as error:
        why = f"no {error}" if isinstance(error, KeyError) else shown(str(error), 120)
        raise ReadError(f"{file} lacks what a page shows ({why}): it is older, or damaged. Fit again.") from error


def load_ahead() -> None:
    """Load, in a thread, what pages are made with, while there are other things to do."""
    threading.Thread(target=_load, daemon=True).start()


def _load() -> None:
    with contextlib.suppress(Exception):  # what cannot be loaded is said where it is used
        rendering.load()
