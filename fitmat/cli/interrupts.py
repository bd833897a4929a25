"""Interrupts: how Ctrl-C ends a command, from its first moment on, and takes away what is half done.

It loads next to nothing: until it is called, Ctrl-C is a traceback. Sampling is stopped by `session`.
"""

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import NoReturn

INTERRUPTED = 130
"""Exit code after Ctrl-C."""


def leave_on_interrupt(discard: Callable[[], None] = lambda: None) -> None:
    """Let Ctrl-C end the program at once, after `discard`.

    No exception: raised inside compiled code or while a module loads, it gets lost, turns into another, or crashes.
    """

    def leave(number: int, frame: FrameType | None) -> None:
        discard()
        with suppress(OSError, RuntimeError):  # nobody reads it, or it is being written to at this moment
            sys.stderr.write("fitmat: interrupted before the end; no report was written.\n")
            sys.stderr.flush()
        os._exit(INTERRUPTED)

    signal.signal(signal.SIGINT, leave)


@contextmanager
def raised() -> Iterator[None]:
    """Ctrl-C as a KeyboardInterrupt while the block runs, so that what was done is kept; a second one ends at once."""

    def stop(number: int, frame: FrameType | None) -> None:
        leave_on_interrupt()
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def leave_threads() -> NoReturn:
    """End the program after Ctrl-C without waiting for its threads: what is compiled cannot be stopped."""
    with suppress(OSError):
        sys.stdout.flush()
    os._exit(INTERRUPTED)


@contextmanager
def taken_away(new: AbstractContextManager[Path], discard: Callable[[Path], None]) -> Iterator[Path]:
    """A draft that Ctrl-C takes away by `discard`, also where it comes while the draft is made."""
    asked: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: asked.append(number))
    try:
        with new as draft:
            leave_on_interrupt(lambda: discard(draft))
            if asked:
                signal.raise_signal(signal.SIGINT)
            yield draft
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # what is complete is moved into its place
    finally:
        leave_on_interrupt()
