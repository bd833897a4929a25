"""Fitting: the study of a file, written to a folder of its own, as the command line makes and shows it.

It computes nothing itself.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from fitmat import files
from fitmat.cli import interrupts, process, session
from fitmat.fitting import priors
from fitmat.maths import program_files
from fitmat.models.parameters import assignments
from fitmat.reports import page, terminal
from fitmat.studies.result import RECORD
from fitmat.studies.sampling import forget
from fitmat.studies.study import Study, study


class Report(NamedTuple):
    """What a run leaves.

    Attributes:
        folder: Of the files written.
        study: What they tell.
        missing: What could not be written, as a sentence; empty where nothing is missing.
    """

    folder: Path
    study: Study
    missing: str

    @property
    def converged(self) -> bool:
        """Whether every fit did, and none was interrupted."""
        return all(p.fit.result == "converged" and not p.interrupted for p in self.study.posteriors)

    def tell(self, *, as_json: bool) -> None:
        """Print the study, and on stderr what is missing, and why compiled programs are not kept if they are not.

        Args:
            as_json: Whether as the record that was written; else as a person reads it.
        """
        record, shown = self.folder / RECORD, self.folder / page.PAGE
        text = record.read_text(encoding="utf-8")
        if as_json:
            process.say(text.rstrip("\n"))
        else:
            terminal.show(json.loads(text), shown if shown.exists() else record)
        if self.missing:
            process.say(f"{self.folder}: {self.missing}", err=True)
        if (kept := program_files.kept()).why:
            process.say(kept.words, err=True)

    def open(self) -> None:
        """Open the page in a browser; say so where there is none."""
        import webbrowser

        shown = (self.folder / page.PAGE).resolve()
        if shown.exists() and not webbrowser.open(shown.as_uri()):
            process.say(f"no browser was found to open {shown} with.", err=True)


def known(fixed: Sequence[str], believed: Sequence[str]) -> dict[str, Any]:
    """What `--fix` and `--prior` say, as `study` takes it.

    Raises:
        ModelError: as `parameters.assignments` and `priors.assignments`.
    """
    return {"fixed": assignments(fixed, "--fix"), "priors": priors.assignments(believed)}


def write_report(
    sources: Sequence[Path],
    folder: Path | None,
    reading: Mapping[str, Any],
    told: Mapping[str, Any],
    watch: session.Watch,
    *,
    force: bool,
) -> Report:
    """Study files as one measurement and write the report; Ctrl-C before its end takes away what is half done.

    Args:
        sources: The files of the measurements.
        folder: For the report; None for one beside the first file, with its name.
        reading: Arguments of `fitmat.read`.
        told: Arguments of `study`.
        watch: Is told what is done.
        force: Whether to replace an earlier run's files.

    Raises:
        FitmatError: as `fitmat.read`, `study` and `files.new`.
    """
    target = folder or files.default(sources[0])
    draft = interrupts.taken_away(files.new(target, own=page.own, force=force), files.abandon)
    with draft as written:
        measurements = session.source(sources, reading, watch)
        page.load_ahead()
        found = study(measurements, resume=files.resumed(target), progress=watch, **told)
        watch("writing the report", 0, 0)
        missing = page.write(written, found, process.command())
    if told["sampling"]:
        forget(files.resumed(target))
    return Report(target, found, missing)
