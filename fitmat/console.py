"""What a person at a terminal sees while a study runs and when it is done.

Progress goes to stderr, results to stdout; nothing is computed here.
"""

import contextlib
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskID, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from fitmat.approximation import laplace, laplace_each
from fitmat.brdf import LOBES, lobe_names, model, normalised
from fitmat.bulk import fit_chunks
from fitmat.comparison import Comparison, compare, is_empirical, is_microfacet
from fitmat.errors import ModelError
from fitmat.formats import chunks, read
from fitmat.measurement import Measurements
from fitmat.outcome import RESULTS
from fitmat.params import entries
from fitmat.posterior import Posterior
from fitmat.report import rows
from fitmat.rows import Rows, held
from fitmat.uncertainty import sample

MOST_AT_ONCE = 100_000
"""Rows above which a fit passes over the data block by block."""

MOST_SAMPLED = 50_000
"""Values above which nothing is sampled: a step takes seconds, and Laplace's approximation is as good."""


def model_names(text: str) -> list[str]:
    """A comma-separated list of model names, checked, without repeats."""
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


def study(
    measurements: Measurements | Rows,
    known: Mapping[str, Mapping[str, np.ndarray]],
    *,
    fixed: Mapping[str, np.ndarray],
    masking: str | None,
    sampling: bool,
    seed: int,
) -> tuple[list[Posterior], Comparison | None]:
    """Fit, sample and compare, with a progress bar on stderr.

    Args:
        measurements: What to fit; `Rows` are passed over, and models fitted one after the other.
        known: Model name → parameters that are known of it beforehand (`conditions.prepared`).
        fixed: Parameters to hold in every model that has them; at least one must.
        masking: The same for the masking.
        sampling: Whether to sample; else, and for more than `MOST_SAMPLED` values, Laplace's approximation.
        seed: Of the sampling.

    An interrupt during sampling keeps what was done and leaves the remaining models to Laplace's approximation.
    """
    jobs = {name: _options(name, known, fixed, masking) for name in known}
    with _bar() as bar:
        if isinstance(measurements, Measurements):
            fitting = bar.add_task(f"fitting {', '.join(jobs)}", total=None)
            first = laplace_each(measurements, jobs, seed=seed)
            bar.update(fitting, total=1, completed=1)
        else:
            first = [
                laplace(fit_chunks(measurements, name, **job, progress=_passes(bar, f"fitting {name}")), seed=seed)
                for name, job in jobs.items()
            ]
        with ThreadPoolExecutor(1) as pool:
            # The match of the approximations: the answer without sampling, and compiled for the one with it.
            match = pool.submit(_match, first)
            few = first[0].fit.n_values <= MOST_SAMPLED
            posteriors = _sampled(first, bar, seed) if sampling and few else first
            bar.add_task("comparing", total=None)
            return posteriors, match.result() if posteriors == first else _match(posteriors)


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


def _sampled(first: Sequence[Posterior], bar: Progress, seed: int) -> list[Posterior]:
    """Sample one fit after the other; after an interrupt, and for fits that are not finite, Laplace's draws stay."""
    posteriors: list[Posterior] = []
    for approximate in first:
        if not approximate.fit.finite or any(posterior.interrupted for posterior in posteriors):
            posteriors.append(approximate)
            continue
        task = bar.add_task(f"sampling {approximate.fit.name}", total=None)
        with _interrupt_later() as asked:

            def progress(done: int, total: int, task: TaskID = task, asked: list[int] = asked) -> None:
                bar.update(task, completed=done, total=total)
                if asked:
                    raise KeyboardInterrupt

            posteriors.append(sample(approximate.fit, seed=seed, progress=progress))
    return posteriors


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


def _options(
    name: str,
    known: Mapping[str, Mapping[str, np.ndarray]],
    fixed: Mapping[str, np.ndarray],
    masking: str | None,
) -> dict[str, Any]:
    """What is known of this model, and what of --fix and --masking concerns it; refuses what concerns none."""
    names, having = list(known), {n: {e.name for e in entries(model(n))} for n in known}
    for key in fixed:
        if not any(key in has for has in having.values()):
            every = ", ".join(sorted(set().union(*having.values())))
            raise ModelError(f"--fix {key}: no model of {', '.join(names)} has it; they have {every}.")
    chosen: dict[str, Any] = {"fixed": {**known[name], **{k: v for k, v in fixed.items() if k in having[name]}}}
    choosing = [n for n in names if any(LOBES[part].has_masking for part in lobe_names(n))]
    if masking is not None and name in choosing:
        chosen["masking"] = masking
    elif masking is not None and not choosing:
        raise ModelError(f"--masking {masking}: none of {', '.join(names)} has a masking to choose.")
    return chosen


def _match(posteriors: Sequence[Posterior]) -> Comparison | None:
    """The match of the first empirical and the first microfacet model, if there are both and both are finite."""
    empirical = next((p for p in posteriors if is_empirical(p.fit.name)), None)
    microfacet = next((p for p in posteriors if is_microfacet(p.fit.name) and not is_empirical(p.fit.name)), None)
    if empirical is None or microfacet is None or not (empirical.fit.finite and microfacet.fit.finite):
        return None
    found = compare(empirical, microfacet)
    return found if np.isfinite(found.hemisphere_distance.value) else None


def show(posteriors: Sequence[Posterior], match: Comparison | None, folder: Path) -> None:
    """Print the parameters of every model, the verdict and where the report is."""
    out = Console()
    m = posteriors[0].fit.measurements
    out.print(str(m), markup=False, highlight=False)
    out.print(posteriors[0].fit.noise.words, markup=False, highlight=False)
    if posteriors[0].fit.n_values > MOST_SAMPLED:
        words = f"More than {MOST_SAMPLED:,} values: intervals from Laplace's approximation, nothing is sampled."
        out.print(words, highlight=False)
    for posterior in posteriors:
        out.print(f"\n[bold]{_title(posterior)}[/bold]", highlight=False)
        out.print(_table(posterior))
        if posterior.fit.result != "converged":
            out.print(f"[yellow]{posterior.fit.result}[/yellow]: {RESULTS[posterior.fit.result]}", highlight=False)
        if posterior.interrupted:
            out.print("[yellow]interrupted[/yellow]: sampling was stopped; what was done is kept.", highlight=False)
    out.print("\n→ follows from the parameters above it", highlight=False, style="dim")
    words = match.verdict if match else " ".join(f"{p.fit.name} {p.fit.adequacy}." for p in posteriors)
    out.print(f"\n[bold]{words}[/bold]\n", highlight=False)
    out.print(f"Report: {folder / 'report.html'}", markup=False, highlight=False, soft_wrap=True)


def _title(posterior: Posterior) -> str:
    fit = posterior.fit
    agreeing = f"{fit.n_starts_agreeing} of {fit.n_starts} starts agree"
    return f"{fit.name}: {fit.result}, {agreeing}, posterior {posterior.verdict}"


def _table(posterior: Posterior) -> Table:
    table = Table(box=None, pad_edge=False)
    for heading in ("parameter", "", "value ± sd", "95 % interval", ""):
        table.add_column(heading, no_wrap=True)
    for row in rows(posterior):
        name = f"→ {row['name']}" if row["kind"] == "follows" else row["name"]
        remark = " ".join(part for part in (row["unit"], row["remark"].removesuffix(" by these angles")) if part)
        table.add_row(*(Text(cell) for cell in (name, row["symbol"], row["value"], row["interval"], remark)))
    return table
