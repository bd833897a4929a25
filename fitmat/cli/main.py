"""The command line from its first line to its exit code.

It knows no command: errors of all of them end here.
"""

import atexit
import gc
import os
import sys

# Matrices are small: the threads of BLAS cost more, from the import of NumPy on, than they save.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from fitmat.cli import process
from fitmat.cli.commands import app
from fitmat.errors import FitmatError


def main() -> None:
    """Run the command line; wrong input, a full disk and Ctrl-C become one line on stderr and an exit code."""
    process.prepare_streams()
    process.leave_on_interrupt()
    # A run is short and makes few reference cycles; looking for them, at the end above all, takes a fifth of its time.
    gc.disable()
    atexit.register(gc.freeze)
    try:
        try:
            app()
        finally:
            gc.enable()
            sys.stdout.flush()
    except FitmatError as error:
        process.end(str(error))
    except OSError as error:
        # What could not be written must not be tried again when Python closes stdout.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        process.end(f"cannot write the output: {error.strerror or error}.")
