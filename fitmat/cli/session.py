"""A session at a terminal: progress on stderr, and Ctrl-C, which ends sampling between two steps.

Nothing is computed here, and no result is shown.
"""

import contextlib
import signal
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from fitmat._types import SAMPLING
from fitmat.cli import process
from fitmat.errors import ReadError
from fitmat.text import visible

if TYPE_CHECKING:
    from fitmat.measurements.large.stream import Stream
    from fitmat.measurements.samples import Measurements


LOADING = "loading"
"""What is done before the first stage."""

EVERY = 30.0
"""Seconds after which a stage that goes on says how far it is where there is no terminal, as in the log of a queue."""


class Watch:
    """What a run tells of its progress on stderr; while it samples, Ctrl-C asks it to stop.

    At a terminal it is one line with a bar, elsewhere a line for each stage, and now and then how far a long one is.
    Words behind a comma are news of the same stage. The first Ctrl-C during sampling is raised as KeyboardInterrupt at
    the next step, so that what was done is kept; a second one, and any other, is as before.

    Attributes:
        most: How far any stage was.
    """

    def __init__(self, screen: Console) -> None:
        self._screen, self._stage, self._told = screen, "", set()
        self._since, self._said = (0.0, 0), 0.0
        self._bar: Progress | None = None
        self._task = TaskID(0)
        self._before: Any = None
        self._asked, self.most = False, 0

    def open(self, what: str) -> None:
        """Show that something is going on, at a terminal only, before there is a stage."""
        if self._screen.is_terminal and not self._screen.is_dumb_terminal:
            parts = (
                SpinnerColumn(),
                TextColumn("{task.description}", markup=False),
                BarColumn(20),
                TimeElapsedColumn(),
            )
            self._bar = Progress(*parts, TimeRemainingColumn(), console=self._screen, transient=True)
            self._bar.start()
            self._task = self._bar.add_task(what, total=None)

    def __call__(self, what: str, done: int, total: int) -> None:
        """Show the stage; stop where that was asked for."""
        self.most = max(self.most, done)
        what = visible(what)
        sampling = what.startswith(SAMPLING)
        if what != self._stage:
            self._begin(what, done, sampling)
        if self._bar is not None:
            self._bar.update(self._task, completed=done, total=total or None)
        elif total and time.monotonic() - self._said > EVERY:
            self._tell_how_far(done, total)
        if sampling and self._asked:
            raise KeyboardInterrupt

    def preparing(self, doing: str, what: str) -> None:
        """Say that a program is compiled, which happens once, or at a terminal that it is loaded.

        Args:
            doing: "compiling", "loading", or "" when it is done.
            what: The model, or "".
        """
        of = what or "what models share"
        words = f"compiling {of}, once for this machine" if doing == "compiling" else f"loading {of}" if doing else ""
        if self._bar is not None:
            stage = ": ".join(filter(None, (self._stage, words))) or LOADING
            self._bar.update(self._task, description=stage, refresh=True)
        elif doing == "compiling" and words not in self._told:
            self._told.add(words)
            self._say(words)

    def _begin(self, what: str, done: int, sampling: bool) -> None:
        goes_on = what.partition(",")[0] == self._stage.partition(",")[0]
        self._stage = what
        if not goes_on:
            self._since = time.monotonic(), done
        if self._bar is not None and goes_on:
            self._bar.update(self._task, description=what, refresh=True)
        elif self._bar is not None:
            self._bar.remove_task(self._task)
            self._task = self._bar.add_task(what, total=None)
            self._bar.refresh()
        if self._bar is None or "resumed" in what:
            self._say(f"{what[0].upper()}{what[1:]}.")
        if sampling and self._before is None:
            self._before = signal.signal(signal.SIGINT, self._note)
        elif not sampling:
            self._give_back()

    def _tell_how_far(self, done: int, total: int) -> None:
        """Say it with the time that is left, if what was done since the stage began tells of it."""
        now, (begin, before) = time.monotonic(), self._since
        left = (now - begin) / (done - before) * (total - done) if done > before else None
        self._say(f"{done:,} of {total:,}{'' if left is None else f', about {_spoken(left)} left'}.")

    def _say(self, words: str) -> None:
        self._said = time.monotonic()
        if self._bar is not None:
            self._screen.print(visible(words), highlight=False, markup=False, soft_wrap=True)
        else:
            process.tell(words, self._screen.file)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._asked = True
        self._give_back()

    def _give_back(self) -> None:
        """Give Ctrl-C back to whom it belonged."""
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
            self._before = None

    def close(self) -> None:
        """Take the line away, and give Ctrl-C back."""
        self._give_back()
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


def _spoken(seconds: float) -> str:
    return (
        f"{seconds:.0f} s"
        if seconds < 100
        else f"{seconds / 60:.0f} min"
        if seconds < 6000
        else f"{seconds / 3600:.0f} h"
    )


@contextlib.contextmanager
def watch() -> Iterator[Watch]:
    """A `Watch` for as long as the block runs."""
    told = Watch(Console(stderr=True))
    told.open(LOADING)
    try:
        yield told
    finally:
        told.close()
        sys.stderr.flush()


@contextlib.contextmanager
def computing() -> Iterator[Watch]:
    """A `Watch` that also says when programs are loaded and compiled; from JAX, which is loaded where it is not."""
    with watch() as told:
        process.set_up()
        from fitmat.maths import programs

        with programs.announced(told.preparing):
            yield told


def source(files: Sequence[Path], reading: Mapping[str, Any], told: Watch) -> "Measurements | Stream":
    """The measurements of one file, in memory, or to be passed over where it is large; or of several, in memory.

    Raises:
        ReadError: as `fitmat.read`, or one of several is large.
    """
    from fitmat.measurements.large import chunks
    from fitmat.measurements.parsing.contents import is_stream
    from fitmat.measurements.reader import read

    large = [path for path in files if not is_stream(path) and chunks.is_large(path)]
    if not large:
        return read(files, **reading)
    (file, *others) = files
    if others:
        got = f"{large[0].name}: more than {chunks.LARGE >> 20} MB, expected less in files that are joined"
        raise ReadError(f"{got}. Write all rows into one table, which is read block by block.")

    def passing(step: str, done: int, total: int) -> None:
        told(f"reading {file.name}: {step}", done, total)

    return chunks.scan(file, **reading, progress=passing)
