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
from fitmat.measurements import writing
from fitmat.measurements.reader import read
from fitmat.measurements.samples import Measurements
from fitmat.text import visible

FITTED = 20_000
"""Rows to which the model is fitted, at most; what it misses is carried over from all."""


def written(
    sources: Sequence[Path],
    reading: Mapping[str, Any],
    out: Path,
    say: Progress,
    *,
    force: bool,
    model: str | None = None,
) -> list[str]:
    """Write the measurements of files to another; what they are, and what that cannot hold, as lines.

    Args:
        sources: Files to read, as one measurement.
        reading: Arguments of `fitmat.read`.
        out: To write; its ending names the format.
        say: Called with what is done next.
        force: Whether to replace it.
        model: What fills the gaps; None for leaving them.

    Raises:
        FitmatError: as `fitmat.read` and `fitmat.write`, or nothing can be completed.
    """
    measurements = read(sources, **reading)
    told = [str(measurements)]
    if model is not None:
        measurements = completed(measurements, out, model, say, force=force)
        told += [completion(measurements)]
        if (beside := writing.marks(out)) is not None:
            told += [f"Which of them were inferred, and how well each is known: {visible(str(beside))}"]
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
    inferred = np.zeros(m.n_samples, bool) if m.inferred is None else m.inferred
    sd = np.zeros((1, 1)) if m.sigma is None else m.sigma[inferred]
    relative = 100.0 * np.quantile(sd / np.maximum(m.value[inferred], 1e-300), [0.5, 0.9])
    rows = f"{np.count_nonzero(~inferred)} rows as measured, {np.count_nonzero(inferred)} inferred"
    return f"{rows}, half of them to within {relative[0]:.2g} % (sd), nine of ten to within {relative[1]:.2g} %."
