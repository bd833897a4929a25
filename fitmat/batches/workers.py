"""Workers: processes that study one file each, and what happens when one of them dies.

They are spawned, never forked: JAX has threads. Files whose worker dies are tried again, each alone.
"""

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

import jax

from fitmat.batches import rows, runs
from fitmat.batches.jobs import Job, digest
from fitmat.errors import FitmatError, OutputError, ReadError
from fitmat.measurements.reader import read
from fitmat.measurements.samples import Measurements
from fitmat.studies.study import study

DIED = "its process died, also when it was tried alone: it was killed, or there was not enough memory."

TRIES = 3
"""How often a file is tried alone after its worker died, which may have been for another's sake."""

ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NPROC", "POLARS_MAX_THREADS"), "1")
"""Environment of a worker, of BLAS, XLA and polars: there are as many workers as cores."""

Rows = list[dict[str, Any]]
Work = Callable[[Job, str], Rows]


def studied(job: Job, content: str) -> Rows:
    """The rows of one file, with the seconds that it took; a file that cannot be used is a row that says why.

    What is read of a file that changes meanwhile says nothing of it: its row is one that is not kept.

    Args:
        job: The file and what is told of it.
        content: Digest of what is to be read.
    """
    begin = time.perf_counter()
    found = _rows(job, content)
    taken = round(time.perf_counter() - begin, 3)
    return [{**row, "seconds": taken} for row in found]


def _rows(job: Job, content: str) -> Rows:
    try:
        found = study(_read(job, content), **{"short": job.runs is None, **job.studying})
        told = rows.rows(found)
        return told if job.runs is None else runs.write(job, job.key(content), found, told)
    except OutputError as error:
        return [{"outcome": rows.FAILED, "message": str(error)}]
    except _ChangedError:
        words = f"{job.path} changed while it waited. Give the same command again."
        return [{"outcome": rows.FAILED, "message": words}]
    except FitmatError as error:
        return rows.refused(error)
    except Exception as error:  # one file is not worth the others
        return rows.failed(error)


class _ChangedError(Exception):
    """A file is not what it was, or not there."""


def _read(job: Job, content: str) -> Measurements:
    try:
        return read(job.path, **job.reading)
    finally:
        try:
            same = digest(job.path) == content
        except ReadError:
            same = False
        if not same:
            raise _ChangedError


def each(jobs: Mapping[str, tuple[Job, str]], count: int, work: Work = studied) -> Iterator[tuple[str, Rows]]:
    """Key and rows of every job, as they are done.

    Args:
        jobs: Key → job and the digest of its file.
        count: How many processes.
        work: What each does.
    """
    left = dict(jobs)
    with _one_thread():
        while left:
            suspects: Sequence[str] = ()
            try:
                for key, found in _side_by_side(left, count, work):
                    del left[key]
                    yield key, found
            except _DiedError as died:
                suspects = died.keys
            for key in suspects:
                yield key, _alone(left.pop(key), work)


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    """`ONE_THREAD` for the workers to inherit, but for what the user's environment says already; then as it was."""
    added = {name: value for name, value in ONE_THREAD.items() if name not in os.environ}
    os.environ.update(added)
    try:
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)


class _DiedError(Exception):
    """A worker died while it had one of these."""

    def __init__(self, keys: Sequence[str]) -> None:
        super().__init__()
        self.keys = keys


def _side_by_side(jobs: Mapping[str, tuple[Job, str]], count: int, work: Work) -> Iterator[tuple[str, Rows]]:
    """As `each`, with no more jobs given out than there are workers, so that few are suspect when one dies."""
    waiting = iter(list(jobs.items()))
    given: dict[Future[Rows], str] = {}
    pool = _pool(min(count, len(jobs)))
    try:
        while True:
            while len(given) < count and (following := next(waiting, None)) is not None:
                key, told = following
                given[pool.submit(work, *told)] = key
            if not given:
                return
            for done in wait(given, return_when=FIRST_COMPLETED).done:
                found = done.result()
                yield given.pop(done), found
    except BrokenProcessPool:
        raise _DiedError(list(given.values())) from None
    finally:
        _end(pool)


def _alone(told: tuple[Job, str], work: Work) -> Rows:
    for _ in range(TRIES):
        pool = _pool(1)
        try:
            return pool.submit(work, *told).result()
        except BrokenProcessPool:
            continue
        finally:
            _end(pool)
    return [{"outcome": rows.FAILED, "message": f"{told[0].path}: {DIED}"}]


def _pool(count: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), _begin)


def _begin() -> None:
    """Ctrl-C is the parent's to answer, and a worker ends when its parent does, however that is."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    jax.config.update("jax_enable_x64", True)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _end(pool: ProcessPoolExecutor) -> None:
    """Without waiting for what is under way: nobody will ask for it."""
    processes = list((pool._processes or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.terminate()
