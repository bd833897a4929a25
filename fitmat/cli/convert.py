"""Converting: a file written in another format, completed where that is asked, and what there is to say of it.

The formats are those of `measurements`, and what fills gaps is a posterior's.
"""

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fitmat._types import Progress
from fitmat.errors import ModelError
from fitmat.measurements import inferred, writing
from fitmat.measurements.reader import read
from fitmat.measurements.samples import Measurements
from fitmat.text import visible

FILLING = "lambert+ggx"
"""What fills gaps, where the user names no model."""

UNKNOWN = 0.5
"""Share of a value from which on its sd leaves it unknown."""

FITTED = 20_000
"""Rows to which the model is fitted, at most; what it misses is carried over from all."""


def written(
    sources: Sequence[Path],
    reading: Mapping[str, Any],
    out: Path,
    say: Progress,
    *,
    force: bool,
    complete: bool = False,
    model: str | None = None,
) -> list[str]:
    """Write the measurements of files to another; what they are, and what that cannot hold, as lines.

    Args:
        sources: Files to read, as one measurement.
        reading: Arguments of `fitmat.read`.
        out: To write; its ending names the format.
        say: Called with what is done next.
        force: Whether to replace it.
        complete: Whether to fill what was not measured.
        model: What fills it; None for `FILLING`.

    Raises:
        FitmatError: as `fitmat.read` and `fitmat.write`, nothing can be completed, or a model has nothing to fill.
    """
    if model is not None and not complete:
        raise ModelError(f"--model {model} without --complete, for which it would fill gaps. Leave it out, or add it.")
    measurements = read(sources, **reading)
    told = [str(measurements)]
    if complete:
        measurements = completed(measurements, out, model or FILLING, say, force=force)
        told += [completion(measurements)]
        if (beside := writing.marks(out)) is not None:
            told += [f"Which of them were inferred, and how well each is known: {visible(str(beside))}"]
    elif lost := inferred.rows(measurements):
        told += [
            f"{lost} rows hold values that were inferred, not measured, which are not written: only what was measured "
            f"is converted. They are still in {measurements.source}; --complete infers them anew."
        ]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the losses are among the lines
        writing.write(measurements, out, force=force)
    return [*told, *writing.losses(measurements, out)]


def completed(measurements: Measurements, out: Path, model: str, say: Progress, *, force: bool) -> Measurements:
    """The measurements with what a complete file of that format holds besides.

    Raises:
        FitmatError: as `writing.gaps`, or the model does not fit.
    """
    from fitmat.fitting.fitting import fit
    from fitmat.studies.plan import named
    from fitmat.uncertainty.laplace import laplace

    names = named(model)
    if len(names) > 1:
        raise ModelError(f"--model {model}: {len(names)} models, expected the one that fills the gaps.")
    directions = writing.gaps(measurements, out, force=force)
    part = measurements
    if measurements.n_samples > FITTED:
        part = measurements.rows(np.random.default_rng(0).permutation(measurements.n_samples)[:FITTED])
    say(f"fitting {names[0]}", 0, 0)
    posterior = laplace(fit(part, names[0]), seed=0)
    return posterior.complete(*directions, measurements, say)


def completion(m: Measurements) -> str:
    """How much was inferred, and how well it is known, as a sentence."""
    filled = np.zeros(m.value.shape, bool) if m.inferred is None else m.inferred
    sd = np.zeros((1, 1)) if m.sigma is None else m.sigma[filled]
    value = m.value[filled]
    relative = np.where(sd < value, sd / np.where(value > 0.0, value, 1.0), 1.0)
    some, every = filled.any(axis=1), filled.all(axis=1)
    rows = f"{np.count_nonzero(~some)} rows as measured, {np.count_nonzero(some)} inferred"
    if partly := np.count_nonzero(some & ~every):
        rows += f" ({partly} of them in some channels only)"
    half, most = (f"{100.0 * share:.2g} %" for share in np.quantile(relative, [0.5, 0.9]))
    if (lost := np.mean(relative > UNKNOWN)) > 0.1:
        got = f"WARNING: {100.0 * lost:.0f} % of them are known to no better than half of their value"
        return f"{rows}. {got}: the readings do not say what --model should be there. Try another, or measure more."
    return f"{rows}, half of them to within {half} (sd), nine of ten to within {most}."
