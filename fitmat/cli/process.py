"""The process behind a command: its streams, and how Ctrl-C ends it.

It knows no command.
"""

import contextlib
import io
import logging
import os
import signal
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

from fitmat import files

WRONG_INPUT, INTERRUPTED = 1, 130
"""Exit codes after wrong input, and after Ctrl-C."""


def prepare_streams() -> None:
    """Keep stderr for what the user must act on, and never fail on a character that the terminal lacks."""
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    logging.disable(logging.WARNING)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def leave_on_interrupt(draft: Path | None = None) -> None:
    """Let Ctrl-C end the program at once, and its draft with it.

    No exception: raised inside compiled code or while a module loads, it gets lost, turns into another, or crashes.
    """

    def leave(number: int, frame: FrameType | None) -> None:
        if draft is not None:
            files.abandon(draft)
        sys.stderr.write("fitmat: interrupted before the end; no report was written.\n")
        sys.stderr.flush()
        os._exit(INTERRUPTED)

    signal.signal(signal.SIGINT, leave)


@contextlib.contextmanager
def taken_away(new: contextlib.AbstractContextManager[Path]) -> Iterator[Path]:
    """A draft that Ctrl-C takes away, also where it comes while the draft is made."""
    asked: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: asked.append(number))
    try:
        with new as draft:
            leave_on_interrupt(draft)
            if asked:
                signal.raise_signal(signal.SIGINT)
            yield draft
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # what is complete is moved into its place
    finally:
        leave_on_interrupt()


def set_up() -> None:
    """Turn on 64-bit floats."""
    import jax

    jax.config.update("jax_enable_x64", True)


def end(message: str) -> None:
    """Say in one line what is wrong, and leave."""
    sys.stderr.write(f"fitmat: {message}\n")
    sys.exit(WRONG_INPUT)
