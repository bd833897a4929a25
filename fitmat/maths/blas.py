"""BLAS: one thread for NumPy's linear algebra where matrices are too small to be worth more.

OpenBLAS wakes its threads for a product of 64 rows and columns already, and they spin for tens of milliseconds after
each. Nothing is computed here; where NumPy has another library, nothing changes.
"""

import contextlib
import ctypes
import functools
import threading
from collections.abc import Callable, Iterator
from typing import Any

from numpy.linalg import _umath_linalg

NAMES = tuple(f"{maker}openblas_{{}}_num_threads{end}" for maker in ("scipy_", "") for end in ("64_", ""))
"""Of the functions that get and set the number of threads, in the builds of OpenBLAS that NumPy comes with."""

_LOCK = threading.Lock()
_INSIDE: list[int] = []
# For each block that runs, the number of threads when it began: the first is the user's.


@functools.cache
def threads() -> tuple[Callable[[], int], Callable[[int], Any]] | None:
    """What says and what sets the number of threads; None where NumPy has not OpenBLAS."""
    with contextlib.suppress(OSError):
        library = ctypes.CDLL(_umath_linalg.__file__)
        for name in NAMES:
            get, put = (getattr(library, name.format(verb), None) for verb in ("get", "set"))
            if get is not None and put is not None:
                return get, put
    return None


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """One thread within the block, in all threads of the process; afterwards as many as before. Also a decorator."""
    found = threads()
    if found is None:
        yield
        return
    get, put = found
    with _LOCK:
        _INSIDE.append(get())
        put(1)
    try:
        yield
    finally:
        with _LOCK:
            before = _INSIDE.pop()
            if not _INSIDE:
                put(before)
