"""A study at a terminal: fit, sample, compare and examine, with progress on stderr; Ctrl-C ends it between two steps.

Nothing is computed here, and no result is shown.
"""

import contextlib
import dataclasses
import shutil
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskID, TextColumn, TimeElapsedColumn

from fitmat.errors import ModelError
from fitmat.fitting.losses import DEFAULT
from fitmat.fitting.priors import DISCREPANCY
from fitmat.fitting.result import Fit
from fitmat.fitting.streamed import fit_chunks
from fitmat.judgement.choice import every_model
from fitmat.match.match import Comparison, compare, is_empirical, is_microfacet
from fitmat.measurements.large import chunks
from fitmat.measurements.large.stream import Rows, held
from fitmat.measurements.reader import read
from fitmat.measurements.samples import Measurements
from fitmat.models.parameters import entries
from fitmat.models.registry import LOBES, lobe_names, model, normalised
from fitmat.studies.study import Study, concluded
from fitmat.uncertainty import second_sampler
from fitmat.uncertainty.chains import resumable_steps, sample
from fitmat.uncertainty.laplace import laplace, laplace_each
from fitmat.uncertainty.posterior import Posterior

MOST_AT_ONCE = 100_000
"""Rows above which a fit passes over the data block by block."""

MOST_SAMPLED = 50_000
"""Values above which nothing is sampled: a step takes seconds, and Laplace's approximation is as good."""


EVERY = "all"
"""Asks for every model that makes sense for the measurements."""

MOST_LISTED = 4
"""More models than this are counted on the screen, not listed."""


def model_names(text: str, measurements: Measurements | None = None) -> list[str]:
    """A comma-separated list of model names, checked, without repeats; "all" for what can be told by measurements."""
    if text.strip() == EVERY:
        return list(every_model(measurements))
    names = [normalised(part) for part in text.split(",") if part.strip()]
    if not names:
        raise ModelError("no model given; try --models lambert+blinn-phong,lambert+ggx.")
    return list(dict.fromkeys(names))


def source(file: Path, reading: Mapping[str, Any]) -> Measurements | Rows:
    """The measurements of a file: in memory where they are few, else to be passed over, with a progress bar on stderr.

    Raises:
        ReadError: as `fitmat.read`.
    """
    if chunks.is_large(file):
        with _bar() as bar:
            return chunks.scan(file, **reading, progress=_passes(bar, f"reading {file.name}"))
    measurements = read(file, **reading)
    return held(measurements) if measurements.n_samples > MOST_AT_ONCE else measurements


@dataclasses.dataclass(frozen=True)
class Plan:
    """How measurements are studied.

    Attributes:
        known: Model name → parameters that are known of it beforehand (`known.prepared`).
        fixed: Parameters to hold in every model that has them; at least one must.
        priors: What is known beforehand, in every model that has the parameter; at least one must.
        loss: What the fits minimise, by name.
        masking: Of the microfacet lobes; None for the models' own.
        sampling: Whether to sample; else, and for more than `MOST_SAMPLED` values, Laplace's approximation.
        seed: Of the sampling.
        second_opinion: Whether to sample a second time with another method.
        resume: Folder in which the sampling is kept while it lasts; None to keep nothing.
    """

    known: Mapping[str, Mapping[str, np.ndarray]]
    fixed: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)
    priors: Mapping[str, tuple[float, float]] = dataclasses.field(default_factory=dict)
    loss: str = DEFAULT.name
    masking: str | None = None
    sampling: bool = True
    seed: int = 0
    second_opinion: bool = False
    resume: Path | None = None


def study(measurements: Measurements | Rows, plan: Plan) -> Study:
    """Fit, sample, compare and examine, with a progress bar on stderr.

    Args:
        measurements: What to fit; `Rows` are passed over, and models fitted one after the other.
        plan: How.

    An interrupt during sampling keeps what was done and leaves the remaining models to Laplace's approximation.
    """
    if plan.second_opinion:
        second_sampler.require()
    jobs = {name: _options(name, plan) for name in plan.known}
    with _bar() as bar:
        first = _fitted(measurements, jobs, bar, plan)
        walking = plan.sampling and first[0].fit.loss.posterior and first[0].fit.n_values <= MOST_SAMPLED
        with ThreadPoolExecutor(1) as pool:
            # The match of the approximations: the answer without sampling, and compiled for the one with it.
            early = pool.submit(_match, first)
            posteriors = _sampled(first, bar, plan) if walking else first
            last = bar.add_task("comparing", total=None)
            match = early.result() if posteriors == first else _match(posteriors)
        return concluded(
            posteriors,
            match,
            seed=plan.seed,
            second_opinion=plan.second_opinion,
            progress=lambda words: bar.update(last, description=words),
        )


def fitted(measurements: Measurements, plan: Plan) -> list[Posterior]:
    """Fit the models of a plan, with corrected draws around each fit, and a progress bar on stderr."""
    jobs = {name: _options(name, plan) for name in plan.known}
    with _bar() as bar:
        return _fitted(measurements, jobs, bar, dataclasses.replace(plan, sampling=False))


def _fitted(
    measurements: Measurements | Rows, jobs: Mapping[str, Mapping[str, Any]], bar: Progress, plan: Plan
) -> list[Posterior]:
    """Every model fitted, with Laplace's approximation."""
    if isinstance(measurements, Measurements):
        listed = ", ".join(jobs) if len(jobs) <= MOST_LISTED else f"{len(jobs)} models"
        fitting = bar.add_task(f"fitting {listed}", total=None)
        first = laplace_each(measurements, jobs, seed=plan.seed, corrected=not plan.sampling)
        bar.update(fitting, total=1, completed=1)
        return first
    if plan.loss != DEFAULT.name:
        raise ModelError(f"--loss {plan.loss}: more than {MOST_AT_ONCE:,} rows are fitted under the default loss only.")
    every = {name: {k: v for k, v in job.items() if k != "loss"} for name, job in jobs.items()}
    return [
        laplace(fit_chunks(measurements, name, **job, progress=_passes(bar, f"fitting {name}")), seed=plan.seed)
        for name, job in every.items()
    ]


def _bar() -> Progress:
    """A progress bar on stderr, where that is a terminal."""
    screen = Console(stderr=True)
    parts = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    return Progress(*parts, console=screen, transient=True, disable=not screen.is_terminal)


def _passes(bar: Progress, what: str) -> Callable[[str, int, int], None]:
    """A bar that follows passes over a large file."""
    task = bar.add_task(what, total=None)
    return lambda step, done, total: bar.update(
        task, description=f"{what}: {step}", completed=done, total=total or None
    )


def _sampled(first: Sequence[Posterior], bar: Progress, plan: Plan) -> list[Posterior]:
    """Sample one fit after the other; after an interrupt, and for fits that are not finite, Laplace's draws stay."""
    posteriors: list[Posterior] = []
    for approximate in first:
        if not approximate.fit.finite or any(posterior.interrupted for posterior in posteriors):
            posteriors.append(approximate)
            continue
        kept = _kept(approximate.fit, bar, plan)
        task = bar.add_task(f"sampling {approximate.fit.name}", total=None)
        with _interrupt_later() as asked:

            def progress(done: int, total: int, task: TaskID = task, asked: list[int] = asked) -> None:
                bar.update(task, completed=done, total=total)
                if asked:
                    raise KeyboardInterrupt

            posteriors.append(sample(approximate.fit, seed=plan.seed, progress=progress, checkpoint=kept))
    return posteriors


def _kept(fit: Fit, bar: Progress, plan: Plan) -> Path | None:
    """The folder of one model's checkpoints; those of another run make way, and what goes on is said."""
    if plan.resume is None:
        return None
    folder = plan.resume / fit.name
    if folder.exists():
        steps = resumable_steps(fit, seed=plan.seed, checkpoint=folder)
        if steps:
            bar.console.print(f"Resuming {fit.name} at step {steps:,}.", highlight=False)
        else:
            shutil.rmtree(folder)
    return folder


@contextlib.contextmanager
def _interrupt_later() -> Iterator[list[int]]:
    """Ctrl-C is noted in the list, so that sampling can stop between two steps; a second one is as before."""
    asked: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        asked.append(number)
        signal.signal(signal.SIGINT, before)

    before = signal.signal(signal.SIGINT, note)
    try:
        yield asked
    finally:
        signal.signal(signal.SIGINT, before)


def _options(name: str, plan: Plan) -> dict[str, Any]:
    """What is known of this model, and what of --fix, --prior and --masking concerns it; refuses what concerns none."""
    names, having = list(plan.known), {n: {e.name for e in entries(model(n))} | _BESIDE for n in plan.known}
    for flag, given in (("--fix", plan.fixed), ("--prior", plan.priors)):
        for key in given:
            if not any(key in has for has in having.values()):
                every = ", ".join(sorted(set().union(*having.values()) - _BESIDE))
                raise ModelError(f"{flag} {key}: no model of {', '.join(names)} has it; they have {every}.")
    chosen: dict[str, Any] = {
        "fixed": {**plan.known[name], **{k: v for k, v in plan.fixed.items() if k in having[name] - _BESIDE}},
        "priors": {k: v for k, v in plan.priors.items() if k in having[name]},
        "loss": plan.loss,
    }
    choosing = [n for n in names if any(LOBES[part].has_masking for part in lobe_names(n))]
    if plan.masking is not None and name in choosing:
        chosen["masking"] = plan.masking
    elif plan.masking is not None and not choosing:
        raise ModelError(f"--masking {plan.masking}: none of {', '.join(names)} has a masking to choose.")
    return chosen


_BESIDE = {DISCREPANCY}
# What has a prior beside the parameters of a model.


def _match(posteriors: Sequence[Posterior]) -> Comparison | None:
    """The match of the first empirical and the first microfacet model, if there are both and both are finite."""
    empirical = next((p for p in posteriors if is_empirical(p.fit.name)), None)
    microfacet = next((p for p in posteriors if is_microfacet(p.fit.name) and not is_empirical(p.fit.name)), None)
    if empirical is None or microfacet is None or not (empirical.fit.finite and microfacet.fit.finite):
        return None
    found = compare(empirical, microfacet)
    return found if np.isfinite(found.hemisphere_distance.value) else None
