"""A cluster: the files of a batch as tasks of a Dask scheduler that somebody else runs.

A task is named by its job's key, so that it may be done anywhere and again: a worker that dies loses nothing.
"""

import dataclasses
import os
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from typing import Any

import jax

from fitmat.batches import rows
from fitmat.batches.jobs import Job, digest
from fitmat.batches.workers import DIED, ONE_THREAD, Rows, Work, studied
from fitmat.errors import FitmatError, ReadError
from fitmat.extras import needed
from fitmat.maths.blas import one_thread

HERE = version("fitmat")
"""The version of fitmat that every worker must have."""

WAIT = 5.0
"""Seconds after which a scheduler that does not answer is given up."""


class UnfitError(Exception):
    """A worker may not do a task."""


def each(jobs: Mapping[str, tuple[Job, str]], address: str, work: Work = studied) -> Iterator[tuple[str, Rows]]:
    """Key and rows of every job, as they are done; see `workers.each`.

    Args:
        jobs: Key → job and the digest of its file.
        address: Of the scheduler, such as "tcp://10.0.0.1:8786".
        work: What each does.

    Raises:
        FitmatError: Dask is missing, the scheduler does not answer or goes away, or a worker cannot do this work.
    """
    distributed = needed("distributed", "a batch on a cluster")
    client = _client(distributed, address)
    with client:
        _refuse_unfit(client)
        keys = {}
        for key, (job, content) in jobs.items():
            runs = None if job.runs is None else job.runs.absolute()
            absolute = dataclasses.replace(job, path=job.path.absolute(), runs=runs)
            keys[client.submit(there, HERE, work, absolute, content, key=f"fitmat-{key}")] = key
        for done in distributed.as_completed(list(keys), loop=client.loop):
            if done.status not in ("finished", "error"):
                raise FitmatError(
                    f"the scheduler at {address} went away; what was done is kept: give the same command."
                )
            key = keys.pop(done)
            yield key, done.result() if done.status == "finished" else _lost(client, jobs[key][0], done.exception())


def there(expected: str, work: Work, job: Job, content: str) -> Rows:
    """On a worker: the rows of one file, computed by one thread.

    Args:
        expected: The version of fitmat that asks.
        work: What is to be done.
        job: The file, by its absolute path, and what is told of it.
        content: Digest of what is to be read.

    Raises:
        UnfitError: fitmat is of another version here, or the worker does several tasks at once.
    """
    worker = needed("distributed", "a batch on a cluster").get_worker()
    if version("fitmat") != expected or worker.state.nthreads != 1:
        raise UnfitError
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
    jax.config.update("jax_enable_x64", True)
    try:
        digest(job.path)
    except ReadError as error:
        words = f"{str(error).removesuffix('.')} on worker {worker.address}, expected there what is here"
        return [{"outcome": rows.FAILED, "message": f"{words}: use a folder that all machines share."}]
    with one_thread():
        return work(job, content)


def _client(distributed: Any, address: str) -> Any:
    try:
        return distributed.Client(address, timeout=WAIT, set_as_default=False)
    except (OSError, ValueError) as error:
        why = str(error).partition("\n")[0].removesuffix(".") or type(error).__name__
        raise FitmatError(
            f"no scheduler answers at {address} ({why}), expected the address that `dask scheduler` says, "
            "such as tcp://10.0.0.1:8786."
        ) from error


def _refuse_unfit(client: Any) -> None:
    """Stop where a worker has not this fitmat, or does several tasks at once.

    Raises:
        FitmatError: it names the first of them.
    """
    for worker, found in client.run(version, "fitmat", on_error="return").items():
        if found != HERE:
            got = f"fitmat {found}" if isinstance(found, str) else "no fitmat"
            raise FitmatError(f"worker {worker} has {got}, expected fitmat {HERE} as here: install it there.")
    for worker, count in client.nthreads().items():
        if count != 1:
            raise FitmatError(f"worker {worker} has {count} threads, expected 1: start it with --nthreads 1.")


def _lost(client: Any, job: Job, error: BaseException) -> Rows:
    """The row of a file whose task ended with an error.

    Raises:
        FitmatError: it was the worker's fault.
    """
    _refuse_unfit(client)
    if isinstance(error, needed("distributed", "a batch on a cluster").KilledWorker):
        return [{"outcome": rows.FAILED, "message": f"{job.path}: {DIED}"}]
    return rows.failed(error)
