"""Recording: what a file or an object holds, as it holds it; the one noun between the formats and the reader.

It drops no row and converts no quantity: what a file marks as no datum stays, with its reason.
"""

import dataclasses

import numpy as np
import polars as pl
from jaxtyping import Bool, Float

from fitmat.measurements.parsing.angles import ROUNDING
from fitmat.measurements.samples import StatedAlbedo
from fitmat.text import brief

HORIZON = np.sin(ROUNDING)
"""Cosine of a zenith angle at or below which a direction counts as horizontal."""


_FILLS = (1e20, 1e30, 1e34, 1e36, 1e38, 9.96921e36, 9.969209968386869e36, 3.4028235e38, 3.4028234663852886e38)
# Of NetCDF and other programs; the longer of two are the shorter in single precision.

SENTINELS = (-99.0, -999.0, -9999.0, -99999.0, -999999.0, -32768.0, *_FILLS, *(-fill for fill in _FILLS))
"""Numbers that programs write for "no datum"; no surface and no detector has them."""

LARGEST = (999.0, 9999.0, 99999.0, 999999.0, 32767.0, 65535.0)
"""Numbers that stand for nothing where they are repeated and every other is `ALONE` times smaller."""

ALONE = 10.0

_LEAST_FILL, _LEAST_NEGATIVE = min(_FILLS), max(number for number in SENTINELS if number < 0)


@dataclasses.dataclass(frozen=True, eq=False)
class Recording:
    """n rows of c channels in the file's own quantity, NaN where it has nothing.

    Attributes:
        source: Name of the file or object, for messages and titles.
        wi: Unit vectors to the light, (n, 3), local frame (n = +z); NaN where an angle is missing.
        wo: Unit vectors to the sensor, (n, 3).
        value: The measured quantity in its own unit, (n, c).
        quantity: What that is, one of `fitmat.measurements.quantity.QUANTITIES`.
        channels: c names.
        sigma: Standard deviation in the unit of `value`, (n, c); None where unknown.
        doubts: Reason → which values the file itself marks as no datum, (n, c).
        notes: Plain sentences: conventions of the format, what was assumed.
        distinct: Whether no geometry can occur twice, because the format is a grid.
        unsaid_side: The flag that exchanges the mirror side and the light's, and the one that confirms them; empty
            where format or user has settled which is which.
        stated: What the file says that its values add up to.
        warnings: Plain sentences: what may have been meant otherwise than it is read.
    """

    source: str
    wi: Float[np.ndarray, "n 3"]
    wo: Float[np.ndarray, "n 3"]
    value: Float[np.ndarray, "n c"]
    quantity: str
    channels: tuple[str, ...]
    sigma: Float[np.ndarray, "n c"] | None = None
    doubts: dict[str, Bool[np.ndarray, "n c"]] = dataclasses.field(default_factory=dict)
    notes: tuple[str, ...] = ()
    distinct: bool = False
    unsaid_side: tuple[str, ...] = ()
    stated: tuple[StatedAlbedo, ...] = ()
    warnings: tuple[str, ...] = ()

    __repr__ = brief


def pivot(long: Recording, labels: np.ndarray) -> Recording:
    """Rows of one channel each, labelled, as one row for each geometry and repeat.

    Args:
        long: n rows of one channel.
        labels: Channel of each row, (n,): text, in order of appearance, or wavelengths, in increasing order.

    Returns:
        Rows in the order in which their geometry first appears.
    """
    names, first, column = np.unique(labels, return_index=True, return_inverse=True)
    order = np.arange(len(names)) if labels.dtype.kind == "f" else np.argsort(first)
    column = np.argsort(order)[column]
    geometry = [f"{vector}_{axis}" for vector in ("wi", "wo") for axis in "xyz"]
    keys = pl.DataFrame(np.concatenate([long.wi, long.wo], axis=1), schema=geometry)
    keys = keys.with_columns(label=pl.Series(column))
    keys = keys.with_columns(repeat=pl.int_range(pl.len()).over(*geometry, "label")).with_row_index("row")
    leader = keys.select(pl.col("row").first().over(*geometry, "repeat"))["row"].to_numpy()
    rows, row = np.unique(leader, return_inverse=True)

    def spread(flat: np.ndarray, blank: float | bool) -> np.ndarray:
        wide = np.full((len(rows), len(names)), blank)
        wide[row, column] = flat[:, 0]
        return wide

    absent = {"no row for a channel of this geometry": spread(np.zeros(long.value.shape, bool), True)}
    return dataclasses.replace(
        long,
        wi=long.wi[rows],
        wo=long.wo[rows],
        value=spread(long.value, np.nan),
        sigma=None if long.sigma is None else spread(long.sigma, np.nan),
        doubts=absent | {reason: spread(doubt, False) for reason, doubt in long.doubts.items()},
        channels=channel_names(names[order]),
    )


def channel_names(labels: np.ndarray) -> tuple[str, ...]:
    """Wavelengths, or texts, as names of channels."""
    return tuple(f"{label:.10g}" if labels.dtype.kind == "f" else str(label) for label in labels)


def sentinels(value: Float[np.ndarray, "n c"]) -> dict[str, Bool[np.ndarray, "n c"]]:
    """Reason → where the values are one of `SENTINELS`."""
    return {named(number): value == number for number in np.unique(value[is_sentinel(value)]).tolist()}


def is_sentinel(value: Float[np.ndarray, "n c"]) -> Bool[np.ndarray, "n c"]:
    """Where the values are one of `SENTINELS`; they are looked up only where they lie beyond the least of these."""
    found = (value <= _LEAST_NEGATIVE) | (value >= _LEAST_FILL)
    found[found] = np.isin(value[found], SENTINELS)
    return found


def named(sentinel: float) -> str:
    """The reason for which rows with a number that stands for nothing are masked."""
    return f"sentinel {sentinel:g}"


def _repeated(value: Float[np.ndarray, "n c"]) -> float | None:
    """The largest value, where it is one of `LARGEST`, repeated, and no other comes near it."""
    known = value[np.isfinite(value) & ~is_sentinel(value)]
    largest = known.max(initial=0.0)
    others = known[known < largest]
    if largest not in LARGEST or len(known) - len(others) < 2 or ALONE * others.max(initial=0.0) > largest:
        return None
    return float(largest)


def mask(recording: Recording) -> tuple[Bool[np.ndarray, "n c"], dict[str, int]]:
    """What can be used, and how many rows are masked for each reason; a value counts for its first one."""
    value, sigma = recording.value, recording.sigma
    lowest = np.minimum(recording.wi[:, 2], recording.wo[:, 2])
    reasons = recording.doubts | sentinels(value)
    reasons |= {
        "angle missing or infinite": np.any(np.isnan(recording.wi + recording.wo), axis=1, keepdims=True),
        "at or below the horizon": (lowest <= HORIZON)[:, None],
        "value missing or NaN": np.isnan(value),
        "value infinite": np.isinf(value),
    }
    if sigma is not None:
        reasons["sigma missing, infinite or not positive"] = ~(np.isfinite(sigma) & (sigma > 0))
    negative = value[(value < 0) & ~is_sentinel(value)]
    if len(negative) > 1 and (negative == negative[0]).all():
        reasons[named(negative[0])] = value == negative[0]
    if (found := _repeated(value)) is not None:
        reasons[named(found)] = value == found
    valid = np.ones(value.shape, bool)
    masked = {}
    for reason, bad in reasons.items():
        if bad.any():
            masked[reason] = int((valid & bad).any(axis=1).sum())
            valid &= ~bad
    return valid, {reason: count for reason, count in masked.items() if count}
