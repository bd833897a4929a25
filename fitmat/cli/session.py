"""A session at a terminal: progress on stderr, and Ctrl-C, which ends sampling between two steps.

Nothing is computed here, and no result is shown.
"""

import contextlib
import signal
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import FrameType
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskID, TextColumn, TimeElapsedColumn

from fitmat.measurements.large import chunks
from fitmat.measurements.large.stream import Stream
from fitmat.measurements.reader import read
from fitmat.measurements.samples import Measurements
from fitmat.studies.study import SAMPLING


class Watch:
    """What a run tells of its progress, as a bar on stderr; while it samples, Ctrl-C asks it to stop.

    The first Ctrl-C during sampling is raised as KeyboardInterrupt at the next step, so that
    what was done is kept; a second one, and any other, is as before.
    """

    def __init__(self, bar: Progress) -> None:
        self._bar, self._task, self._stage = bar, TaskID(0), ""
        self._before: Any = None
        self._asked = False

    def __call__(self, what: str, done: int, total: int) -> None:
        """Show the stage; stop where that was asked for."""
        sampling = what.startswith(SAMPLING)
        if what != self._stage:
            self._begin(what, sampling)
        self._bar.update(self._task, completed=done, total=total or None)
        if sampling and self._asked:
            raise KeyboardInterrupt

    def _begin(self, what: str, sampling: bool) -> None:
        self._stage, self._task = what, self._bar.add_task(what, total=None)
        if "resumed" in what:
            self._bar.console.print(f"{what[0].upper()}{what[1:]}.", highlight=False)
        if sampling and self._before is None:
            self._before = signal.signal(signal.SIGINT, self._note)
        elif not sampling:
            self.close()

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._asked = True
        self.close()

    def close(self) -> None:
        """Give Ctrl-C back to whom it belonged."""
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
            self._before = None


@contextlib.contextmanager
def watch() -> Iterator[Watch]:
    """A progress bar on stderr, where that is a terminal, for as long as the block runs."""
    screen = Console(stderr=True)
    parts = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*parts, console=screen, transient=True, disable=not screen.is_terminal) as bar:
        told = Watch(bar)
        try:
            yield told
        finally:
            told.close()


def source(file: Path, reading: Mapping[str, Any], told: Watch) -> Measurements | Stream:
    """The measurements of a file: in memory, or to be passed over where it is large.

    Raises:
        ReadError: as `fitmat.read`.
    """
    if not chunks.is_large(file):
        return read(file, **reading)

    def passing(step: str, done: int, total: int) -> None:
        told(f"reading {file.name}: {step}", done, total)

    return chunks.scan(file, **reading, progress=passing)
