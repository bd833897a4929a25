"""Joining: several measurements of one sample, as one.

It averages nothing, brings no scale into line, and drops no row: geometries in two files are kept as repeats.
"""

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fitmat import arguments
from fitmat.errors import ReadError
from fitmat.measurements.instrument import UNKNOWN_SCALE
from fitmat.measurements.parsing import contents
from fitmat.measurements.parsing.contents import listed
from fitmat.measurements.samples import Measurements
from fitmat.text import visible

NAMED = 3
"""Files up to which the title names each."""


def join(parts: Sequence[Measurements]) -> Measurements:
    """Several measurements of one sample, in one instrument's scale, as one; rows in the order of the parts.

    Args:
        parts: From `fitmat.read`, or `fitmat.from_arrays`. Files that are read alike need no join:
            `fitmat.read(["a.csv", "b.csv"])` gives it.

    Returns:
        All rows. What was masked, assumed or warned of says of which file, unless it holds of all.

    Raises:
        ReadError: other channels, σ in some only, other instruments, or a scale of its own in each.

    Example:
        >>> from fitmat.measurements.samples import from_arrays
        >>> one, other = (from_arrays([0.5], [angle], [0.1], source=f"{angle}.csv") for angle in (0.1, 0.2))
        >>> both = join([one, other])
        >>> both.source, both.n_samples
        ('0.1.csv + 0.2.csv', 2)
    """
    arguments.kind("parts", parts, list, tuple)
    for part in parts:
        arguments.kind("a part", part, Measurements)
    if not parts:
        raise ReadError("parts of no measurements, expected at least one. Pass fitmat.read of each file.")
    if len(parts) == 1:
        return parts[0]
    names = _names([part.source for part in parts])
    for conflict in _conflicts(parts, names):
        raise ReadError(conflict)
    order = [[part.channels.index(name) for name in parts[0].channels] for part in parts]
    horizontal, sigma, inferred = (
        _stacked([getattr(part, name) for part in parts], parts, order, blank)
        for name, blank in (("horizontal", np.nan), ("sigma", np.nan), ("inferred", False))
    )
    return Measurements(
        wi=np.concatenate([part.wi for part in parts]),
        wo=np.concatenate([part.wo for part in parts]),
        value=np.concatenate([part.value[:, places] for part, places in zip(parts, order, strict=True)]),
        sigma=sigma,
        valid=np.concatenate([part.valid[:, places] for part, places in zip(parts, order, strict=True)]),
        channels=parts[0].channels,
        source=" + ".join(names) if len(names) <= NAMED else f"{names[0]} + {len(names) - 1} others",
        masked={
            f"{name}: {reason}": count
            for part, name in zip(parts, names, strict=True)
            for reason, count in part.masked.items()
        },
        notes=(_counts(parts, names), *_told([part.notes for part in parts], names)),
        instrument=parts[0].instrument,
        warnings=_told([part.warnings for part in parts], names),
        stated=tuple(stated for part in parts for stated in part.stated),
        horizontal=horizontal,
        inferred=inferred,
    )


def _stacked(
    given: Sequence[np.ndarray | None], parts: Sequence[Measurements], order: list[list[int]], blank: float | bool
) -> np.ndarray | None:
    """What some parts have, with blanks for the others; None where none has it."""
    if all(one is None for one in given):
        return None
    each = [np.full(part.value.shape, blank) if one is None else one for one, part in zip(given, parts, strict=True)]
    return np.concatenate([one[:, places] for one, places in zip(each, order, strict=True)])


def refuse_twice(sources: Sequence[Any]) -> None:
    """Stop at a file that is there twice: its readings would count as two.

    Raises:
        ReadError: which.
    """
    seen: dict[tuple[int, int], Any] = {}
    for source in sources:
        if isinstance(source, str | os.PathLike) and os.path.exists(source):
            status = os.stat(source)
            if (place := (status.st_dev, status.st_ino)) in seen:
                got = f"the same file as {seen[place]}" if str(seen[place]) != str(source) else "there twice"
                raise ReadError(f"{source}: {got}, expected each file once. Leave one out.")
            seen[place] = source


def tails(sources: Sequence[Any]) -> list[str | None]:
    """As much of the end of each path as tells it from the others; None where the file's name does, or for no path."""
    paths = [Path(source) if isinstance(source, str | os.PathLike) else None for source in sources]
    alike = Counter(contents.name(path) for path in paths if path is not None)
    shown: list[str | None] = []
    for path in paths:
        if path is None or alike[contents.name(path)] == 1:
            shown.append(None)
            continue
        others = [other.absolute().parts for other in paths if other is not None and other is not path]
        own = path.absolute().parts
        known = (k for k in range(1, len(own)) if all(other[-k:] != own[-k:] for other in others))
        length = next(known, len(own))
        shown.append(visible(os.path.join(*own[-length:])))
    return shown


def _names(sources: Sequence[str]) -> list[str]:
    """One name for each, numbered where two are the same."""
    count, seen = Counter(sources), Counter[str]()
    names = []
    for source in sources:
        seen[source] += 1
        names.append(source if count[source] == 1 else f"{source} ({seen[source]})")
    return names


def _conflicts(parts: Sequence[Measurements], names: Sequence[str]) -> Iterator[str]:
    """What speaks against one measurement of one sample, in sentences."""
    first, name = parts[0], names[0]
    for other, its in zip(parts[1:], names[1:], strict=True):
        pair = f"{name} and {its}"
        if {*other.channels} != {*first.channels}:
            got = f"channels {listed(first.channels)} beside {listed(other.channels)}"
            remedy = "Fit them one by one, or choose the columns that they share (--columns)"
            yield f"{pair}: {got}, expected the same in every file that is joined. {remedy}."
        if other.sigma_given != first.sigma_given:
            lacking, having = (name, its) if other.sigma_given else (its, name)
            remedy = f"Add it to {lacking}, or rename it in {having} to leave it out"
            yield f"{pair}: sigma in {having} only, expected it in every file that is joined, or in none. {remedy}."
        if other.instrument != first.instrument:
            got = " beside ".join(str(part.instrument) or "an ideal instrument" for part in (first, other))
            yield f"{pair}: {got}, expected one instrument for all that is joined. Fit them one by one."
    if first.instrument.calibration == UNKNOWN_SCALE:
        got = "a scale that is not known, for each a factor of its own"
        remedy = "Read them at once, fitmat.read([…], unknown_scale=True), which keeps them in proportion"
        yield f"{listed(names)}: {got}, expected one scale for all. {remedy}."


def _counts(parts: Sequence[Measurements], names: Sequence[str]) -> str:
    each = listed([f"{name} ({part.n_samples} rows)" for part, name in zip(parts, names, strict=True)])
    return f"Joined, as one measurement of one sample: {each}."


def _told(sentences: Sequence[Sequence[str]], names: Sequence[str]) -> tuple[str, ...]:
    """What is said of all as it stands, and of some behind their names."""
    shared = {said for said in sentences[0] if all(said in other for other in sentences)}
    common = [said for said in sentences[0] if said in shared]
    own = [
        f"{name}: {said}" for each, name in zip(sentences, names, strict=True) for said in each if said not in shared
    ]
    return (*common, *own)
