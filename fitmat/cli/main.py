"""The command line from its first line to its exit code.

It knows no command: errors of all of them end here.
"""

import atexit
import gc
import os
import sys

# Matrices are small: the threads of BLAS cost more, from the import of NumPy on, than they save.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# One fit is too small for a GPU, and several processes would fight for its memory.
os.environ.setdefault("JAX_PLATFORMS", "cpu")

from fitmat.cli import interrupts
from fitmat.errors import FitmatError, exhausted


def main() -> None:
    """Run the command line; wrong input, a full disk and Ctrl-C become one line on stderr and an exit code."""
    interrupts.leave_on_interrupt()
    import typer

    from fitmat.cli import process

    process.prepare_streams()
    from fitmat.cli.application import app

    # A run is short and makes few reference cycles; looking for them, at the end above all, takes a fifth of its time.
    gc.disable()
    atexit.register(gc.freeze)
    misuse: type[BaseException] = typer.BadParameter.__bases__[0]  # which typer does not name
    stdout, place = sys.stdout, os.fstat(1)
    try:
        try:
            ended = app(standalone_mode=False)
        finally:
            gc.enable()
            sys.stdout.flush()
            # Where its reader has gone, Typer and Rich put something else in the place of stdout.
            if sys.stdout is not stdout or not os.path.samestat(os.fstat(1), place):
                raise BrokenPipeError
    except misuse as error:
        process.misused(error)
    except FitmatError as error:
        process.end(str(error))
    except (MemoryError, RuntimeError) as error:
        words = exhausted(error)
        if not words:
            raise
        process.end(words)
    except BrokenPipeError:
        process.silence(1)
        sys.exit(process.NOBODY_READS)
    except OSError as error:
        process.silence(1)
        process.end(f"cannot write the output: {error.strerror or error}.")
    sys.exit(ended)
