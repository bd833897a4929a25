"""The process behind a command: its streams, and the words with which it ends.

It knows no command.
"""

import io
import logging
import os
import sys
import warnings
from typing import IO, Any, NoReturn

import typer

from fitmat.errors import Doubt, FitmatError, ReadAs
from fitmat.text import for_shell, visible

WRONG_INPUT, NOT_CONVERGED, NOBODY_READS = 1, 3, 141
"""Exit codes: after wrong input, after a fit that did not converge, and where nobody reads the output to its end, 128 +
SIGPIPE as shells count."""


ADDRESSES = 2_000_000_000
"""Bytes of address space that polars, XLA and their threads take for a small file; with less they hang or abort."""


def prepare_streams() -> None:
    """Keep stderr for what the user must act on, and never fail on a character that the terminal lacks."""
    _open_what_is_closed()
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
        for told in (ReadAs, Doubt):
            warnings.simplefilter("once", told)
        warnings.showwarning = _told
    logging.disable(logging.WARNING)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def _told(message: Warning | str, *where: object) -> None:
    """A warning as a sentence, without the place in the program."""
    del where
    print(visible(str(message)), file=sys.stderr)


def _open_what_is_closed() -> None:
    """Take the places of streams that are closed, before a file of the user's does: what is printed would go there."""
    for place in range(3):
        try:
            os.fstat(place)
        except OSError:  # the lowest free place is this one; stdout refuses what is written
            os.open(os.devnull, os.O_WRONLY if place == 2 else os.O_RDONLY)
    if sys.stdout is None:
        sys.stdout = os.fdopen(1, "w", encoding="utf-8")
    if sys.stderr is None:
        sys.stderr = os.fdopen(2, "w", encoding="utf-8")


def silence(place: int) -> None:
    """Let what is still to be written to a stream, 1 or 2, go nowhere: it must not be tried again."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, place)
    os.close(nowhere)


def command() -> str:
    """What was typed, quoted as a shell takes it."""
    return " ".join(["fitmat", *map(for_shell, sys.argv[1:])])


def refuse_little_memory() -> None:
    """Stop where compiled libraries would be refused memory, which ends the process or hangs it without a word.

    Raises:
        FitmatError: the process may use less address space than they take.
    """
    try:
        import resource  # not on every system
    except ImportError:
        return
    granted = resource.getrlimit(resource.RLIMIT_AS)[0]
    if granted != resource.RLIM_INFINITY and granted < ADDRESSES:
        got = f"this process may use {granted / 1e9:.2g} GB of address space"
        raise FitmatError(f"{got}, expected at least {ADDRESSES / 1e9:g} GB. Raise the limit with ulimit -v unlimited.")


def say(words: str, *, err: bool = False) -> None:
    """Print words, of which none can make the terminal do anything but begin a new line.

    Args:
        words: What is said.
        err: Whether on stderr, where a reader that has gone stops nothing.
    """
    if err:
        tell(words, sys.stderr)
    else:
        typer.echo(visible(words, keep="\n"))


def tell(words: str, stderr: IO[str]) -> None:
    """Say something on stderr, if anybody reads it; else go on."""
    try:
        stderr.write(visible(words, keep="\n") + "\n")
        stderr.flush()
    except OSError:
        silence(2)


def set_up() -> None:
    """Turn on 64-bit floats, where there is memory for it."""
    refuse_little_memory()
    import jax

    jax.config.update("jax_enable_x64", True)


def use_gpu() -> None:
    """Let JAX take a GPU for what follows, where nothing was computed yet.

    Raises:
        FitmatError: it finds none.
    """
    import jax

    jax.config.update("jax_platforms", "")
    if jax.default_backend() == "cpu":
        raise FitmatError(
            "--device gpu: JAX finds no GPU here, expected one. Install JAX for it (pip install 'jax[cuda13]' for "
            "NVIDIA's), or leave out --device."
        )


def misused(error: Any) -> NoReturn:
    """Say what is wrong with the arguments, as typer does, and leave."""
    from typer import rich_utils

    words = visible(error.format_message(), keep="\n")
    error.format_message = lambda: words
    rich_utils.rich_format_error(error)
    sys.exit(error.exit_code)


def end(message: str) -> NoReturn:
    """Say in one line what is wrong, and leave."""
    say(f"fitmat: {visible(message)}", err=True)
    sys.exit(WRONG_INPUT)
