"""Sampling: the posteriors of a study sampled one after the other, each kept while it lasts, so that it can go on.

How one is sampled and what a checkpoint holds, `uncertainty` knows.
"""

import contextlib
from collections.abc import Sequence
from pathlib import Path

from fitmat._types import SAMPLING, Progress
from fitmat.uncertainty import checkpoint
from fitmat.uncertainty.chains import resumable_steps, sample
from fitmat.uncertainty.posterior import Posterior


def sample_each(first: Sequence[Posterior], *, seed: int, resume: Path | None, progress: Progress) -> list[Posterior]:
    """Sample one fit after the other; after an interrupt, and for fits that are not finite, Laplace's draws stay.

    Args:
        first: Laplace's approximations of the fits' posteriors.
        seed: Of everything that is drawn.
        resume: Folder in which the sampling is kept while it lasts, and from which it goes on; None to keep nothing.
        progress: Called with what is done next.
    """
    posteriors: list[Posterior] = []
    for approximate in first:
        fit = approximate.fit
        if not fit.finite or any(posterior.interrupted for posterior in posteriors):
            posteriors.append(approximate)
            continue
        kept = None if resume is None else resume / fit.name
        steps = 0 if kept is None else _resumable(approximate, seed, kept)
        progress(f"{SAMPLING} {fit.name}{f', resumed at step {steps:,}' if steps else ''}", steps, 0)
        posteriors.append(sample(fit, seed=seed, progress=progress, checkpoint=kept))
    return posteriors


def _resumable(approximate: Posterior, seed: int, kept: Path) -> int:
    """The step from which a run goes on; checkpoints of another run make way."""
    if not kept.exists():
        return 0
    steps = resumable_steps(approximate.fit, seed=seed, checkpoint=kept)
    if not steps:
        checkpoint.discard(kept)
    return steps


def forget(resume: Path) -> None:
    """Remove what `sample_each` kept to go on from, which has served; what it did not write stays."""
    with contextlib.suppress(OSError):
        for kept in resume.iterdir():
            checkpoint.discard(kept)
        resume.rmdir()
