"""Sharing: what many fits tell of one another, as surfaces of one kind, or as neighbours in rows and columns.

Each fit's value and deviation stand for its likelihood; nothing is fitted, and what was found stays.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from fitmat._types import Progress
from fitmat.fitting import asking
from fitmat.fitting.coordinates import channel_names
from fitmat.fitting.many.fits import Fits
from fitmat.fitting.many.lanes import Shared
from fitmat.fitting.pooling import Pooled, pooled
from fitmat.fitting.smoothing import Smoothed, smoothed
from fitmat.maths.normal import Z95
from fitmat.models.parameters import Entry, entries


class Sharing(NamedTuple):
    """Names of the parameters that are asked for; none is empty."""

    pool: tuple[str, ...]
    smooth: tuple[str, ...]


def sharing(pool: object, smooth: object) -> Sharing:
    """What the arguments of these names ask for.

    Raises:
        FitmatError: they hold no names.
    """
    return Sharing(asking.asked("pool", pool), asking.asked("smooth", smooth))


def refuse_idle(names: Sharing, shared: Shared, held: Mapping[str, np.ndarray], axes: Sequence[int]) -> None:
    """Stop where nothing could be shared.

    Args:
        names: What is asked for.
        shared: The model and the loss.
        held: Fixed parameters by name.
        axes: Numbers of surfaces along each axis.

    Raises:
        ModelError: a parameter is held or none of the model's, the loss gives no intervals, or the surfaces are too few
            or, where neighbours are asked, in no rows and columns.
    """
    known = {shared.template.name: [entry.name for entry in entries(shared.template)]}
    for option, those in names._asdict().items():
        asking.refuse_idle(option, those, int(np.prod(axes)), "surface", held)
        asking.refuse_foreign(option, those, known)
        if those and not shared.loss.posterior:
            got = f"the loss {shared.loss.name} is no likelihood"
            asking.refuse_other(option, those[0], got, "one that gives intervals")
    if names.smooth and len(axes) != 2:
        got = f"the values of {int(np.prod(axes))} surfaces have no rows and columns"
        asking.refuse_other("smooth", names.smooth[0], got, "the shape (rows, columns, n, c)")


def told_together(names: Sharing, fits: Fits, progress: Progress | None = None) -> Fits:
    """The fits with what they tell of one another.

    Args:
        names: What is asked for.
        fits: What was found.
        progress: Called with what is done, how many surfaces are fitted, and how many there are: all.
    """
    if not any(names):
        return fits
    return dataclasses.replace(
        fits, pooled=dict(_pooled(names.pool, fits)), smoothed=dict(_smoothed(names.smooth, fits, progress))
    )


def _pooled(names: Sequence[str], fits: Fits) -> Iterator[tuple[str, Pooled]]:
    """Each parameter, and each channel of it, from values ± 1.96 sd of its natural coordinate."""
    for entry in fits.entries:
        if entry.name in names:
            value, sd = _ended(entry, fits)
            for k, label in enumerate(channel_names(entry, fits.channels)):
                middle, reach = value[..., k], Z95 * sd[..., k]
                if entry.param.scale == "log":
                    ends = middle * np.exp(-reach / middle), middle * np.exp(reach / middle)
                else:
                    ends = middle - reach, middle + reach
                yield label, pooled(label, entry.param, *ends)


def _smoothed(names: Sequence[str], fits: Fits, progress: Progress | None) -> Iterator[tuple[str, Smoothed]]:
    """Each parameter, of all its channels."""
    for entry in fits.entries:
        if entry.name in names:
            if progress is not None:
                progress(f"smoothing {entry.name}", fits.outcome.size, fits.outcome.size)
            yield entry.name, smoothed(channel_names(entry, fits.channels), entry, *_ended(entry, fits))


def _ended(entry: Entry, fits: Fits) -> tuple[Float[np.ndarray, "... k"], Float[np.ndarray, "... k"]]:
    """Values of a parameter and their deviations, NaN of a fit that found no optimum."""
    ended = np.isin(fits.result, ("converged", "at_bound", "unidentifiable"))
    return fits.values[..., entry.place], np.where(ended[..., None], fits.sd[..., entry.place], np.nan)
