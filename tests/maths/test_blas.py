"""The threads of BLAS: one within, as many as before afterwards, whatever happens in between."""

import pytest

from fitmat.maths import blas
from fitmat.maths.blas import one_thread


def test_threads_are_given_back() -> None:
    """Also where blocks of several threads overlap, and where one ends with an error."""
    found = blas.threads()
    if found is None:
        pytest.skip("NumPy has another library than OpenBLAS here; install NumPy from PyPI")
    get, put = found
    users = get()
    put(2)
    try:
        first, second = one_thread(), one_thread()
        first.__enter__()
        assert get() == 1
        second.__enter__()
        first.__exit__(None, None, None)
        assert get() == 1
        second.__exit__(None, None, None)
        assert get() == 2
        with pytest.raises(ZeroDivisionError):
            one_thread()(lambda: 1 // 0)()
        assert get() == 2
    finally:
        put(users)
