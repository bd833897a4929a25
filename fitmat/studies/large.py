"""Large: a study of more rows than are taken at once, which passes over them block by block.

It judges nothing.
"""

import os
from concurrent.futures import ThreadPoolExecutor

from fitmat._types import Progress
from fitmat.errors import ModelError
from fitmat.fitting.losses import DEFAULT
from fitmat.fitting.streamed.passes import fit_from, fit_part, rows
from fitmat.measurements.large.stream import Stream, hold
from fitmat.measurements.samples import Measurements
from fitmat.studies.plan import Jobs
from fitmat.uncertainty.laplace import laplace
from fitmat.uncertainty.posterior import Posterior

MOST_AT_ONCE = 100_000
"""Rows above which a fit passes over the data block by block."""


def counted(given: Measurements | Stream) -> tuple[int, int]:
    """Rows, and those in which something is masked; of a file read in parts, as often as a reason was found."""
    if isinstance(given, Measurements):
        return given.n_samples, given.n_masked
    return given.n_samples, min(sum(given.part.masked.values()), given.n_samples)


def as_stream(measurements: Measurements | Stream) -> Measurements | Stream:
    """Measurements as they are, or, of more than `MOST_AT_ONCE` rows, as what is passed over block by block."""
    if isinstance(measurements, Measurements) and measurements.n_samples > MOST_AT_ONCE:
        return hold(measurements)
    return measurements


def pass_over(stream: Stream, jobs: Jobs, seed: int, say: Progress) -> list[Posterior]:
    """Every model fitted to more rows than are taken at once."""
    loss = next(iter(jobs.values()))["loss"]
    if loss != DEFAULT.name:
        raise ModelError(f"--loss {loss}: more than {MOST_AT_ONCE:,} rows are fitted under the default loss only.")
    found = []
    every = rows(stream, lambda step, done, total: say(f"reading: {step}", done, total))
    say(f"fitting {', '.join(jobs)}: a part of the rows", 0, 0)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        told = [{key: value for key, value in job.items() if key != "loss"} for job in jobs.values()]
        starts = list(pool.map(lambda name, job: fit_part(every, name, **job), jobs, told))
    for name, start in zip(jobs, starts, strict=True):

        def passing(step: str, done: int, total: int, name: str = name) -> None:
            say(f"fitting {name}: {step}", done, total)

        found.append(laplace(fit_from(every, start, passing), seed=seed))
    return found
