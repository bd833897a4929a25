"""Samples: the rows of a table as arrays, one row for each geometry, and what of them is masked.

It drops no row: what cannot be used stays, marked and counted.
"""

import dataclasses

import numpy as np
import polars as pl
from jaxtyping import Bool, Float

from fitmat.formats.angles import ROUNDING

HORIZON = np.pi / 2 - ROUNDING


@dataclasses.dataclass(frozen=True, eq=False)
class Samples:
    """n rows of c channels as the file has them, NaN where it has nothing.

    Attributes:
        angles: theta_i, phi_i, theta_o, phi_o in radians, (n, 4).
        value: The measured quantity in its own unit, (n, c).
        sigma: Its standard deviation, (n, c); None where unknown.
        flagged: Where the file itself calls the value invalid, (n, c).
        absent: Where the file has no row for a channel, (n, c).
        channels: c names.
    """

    angles: Float[np.ndarray, "n 4"]
    value: Float[np.ndarray, "n c"]
    sigma: Float[np.ndarray, "n c"] | None
    flagged: Bool[np.ndarray, "n c"]
    absent: Bool[np.ndarray, "n c"]
    channels: tuple[str, ...]


def pivot(samples: Samples, labels: np.ndarray) -> Samples:
    """Samples of one channel a row, each row labelled, as one row for each geometry and repeat.

    Args:
        samples: n rows of one channel.
        labels: Channel of each row, (n,): text, in order of appearance, or wavelengths, in increasing order.

    Returns:
        Samples whose rows keep the order in which their geometry first appears.
    """
    names, first, column = np.unique(labels, return_index=True, return_inverse=True)
    order = np.arange(len(names)) if labels.dtype.kind == "f" else np.argsort(first)
    column = np.argsort(order)[column]
    geometry = ["theta_i", "phi_i", "theta_o", "phi_o"]
    keys = pl.DataFrame(samples.angles, schema=geometry).with_columns(label=pl.Series(column))
    keys = keys.with_columns(repeat=pl.int_range(pl.len()).over(*geometry, "label")).with_row_index("row")
    leader = keys.select(pl.col("row").first().over(*geometry, "repeat"))["row"].to_numpy()
    rows, row = np.unique(leader, return_inverse=True)

    def spread(flat: np.ndarray, blank: float | bool) -> np.ndarray:
        wide = np.full((len(rows), len(names)), blank)
        wide[row, column] = flat[:, 0]
        return wide

    return Samples(
        angles=samples.angles[rows],
        value=spread(samples.value, np.nan),
        sigma=None if samples.sigma is None else spread(samples.sigma, np.nan),
        flagged=spread(samples.flagged, False),
        absent=spread(samples.absent, True),
        channels=tuple(f"{name:.10g}" if labels.dtype.kind == "f" else str(name) for name in names[order]),
    )


def mask(samples: Samples) -> tuple[Bool[np.ndarray, "n c"], dict[str, int]]:
    """What can be used, and how many rows are masked for each reason; a value counts for its first one."""
    theta_i, _, theta_o, _ = samples.angles.T
    value, sigma = samples.value, samples.sigma
    reasons = {
        "no row for a channel of this geometry": samples.absent,
        "flagged invalid": samples.flagged,
        "angle missing or infinite": np.isnan(theta_i)[:, None],
        "at or below the horizon": ((theta_i >= HORIZON) | (theta_o >= HORIZON))[:, None],
        "value missing or NaN": np.isnan(value),
        "value infinite": np.isinf(value),
    }
    if sigma is not None:
        reasons["sigma missing, infinite or not positive"] = ~(np.isfinite(sigma) & (sigma > 0))
    negative = value[value < 0]
    if len(negative) > 1 and (negative == negative[0]).all():
        reasons[f"sentinel {negative[0]:g}"] = value == negative[0]
    valid = np.ones(value.shape, bool)
    masked = {}
    for reason, bad in reasons.items():
        masked[reason] = int((valid & bad).any(axis=1).sum())
        valid &= ~bad
    return valid, {reason: count for reason, count in masked.items() if count}
