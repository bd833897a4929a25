"""Unused: what columns that play no part may have meant; said where their names, or the rows, tell of more.

It reads no value by them: what is right stays right when its owner leaves them.
"""

import re
from collections.abc import Iterator, Sequence

import numpy as np
import polars as pl
from jaxtyping import Float

from fitmat.measurements.parsing.contents import listed, shown
from fitmat.measurements.parsing.table import Table

SETTINGS = 50
"""A column of more distinct cells counts rows, and names no setting."""

RESOLVED = 0.9
"""Share of the repeated rows that a column tells apart, if it names what was changed between them."""

APART = 0.25
"""Relative difference of their values, in the middle one of the geometries, from which they are no repeats of one."""

_NOISE = r"std|stdev|sd|err|error|unc|uncert|uncertainty|var|variance|sigma|noise|u|snr"
_FLAG = r"mask|masked|quality|qc|qa|saturated|saturation|bad|outlier|outliers|status|overload|overrange"
_READING = r"dark|background|bg|gain|exposure|integration|shutter|attenuation|attenuator|filter|nd|od"
_DIGITS = 7


def doubts(
    table: Table,
    unused: Sequence[int],
    directions: Float[np.ndarray, "n d"],
    value: Float[np.ndarray, "n c"],
    *,
    noisy: bool,
    readings: bool,
) -> Iterator[str]:
    """What may have been meant, in sentences with what to do.

    Args:
        table: What was read.
        unused: Its columns that play no part.
        directions: What tells one geometry from another: vectors to light and sensor, and the channel of a row.
        value: Of the rows.
        noisy: Whether a σ was read.
        readings: Whether the values are readings of an instrument, not yet of the sample.
    """
    for column in [
        k for k in unused if not noisy and _is_named(table.names[k], _NOISE) and table.is_numeric(table.names[k])
    ]:
        name = shown(table.names[column])
        yield (
            f"The column {name} is not used, and the noise is estimated. If it is the standard deviation of the "
            f"values, in their unit, pass --columns sigma={name}; turn an expanded uncertainty, a variance or a "
            "percentage into one first."
        )
    for column in [k for k in unused if _is_named(table.names[k], _FLAG) and _cells(table, k).n_unique() > 1]:
        name = shown(table.names[column])
        yield (
            f"The column {name} is not used. If it marks rows that are no measurements, pass --columns invalid={name} "
            f"(true leaves a row out), --columns valid={name}, or --where {name}=…."
        )
    for column in [k for k in unused if readings and _is_named(table.names[k], _READING)]:
        name = shown(table.names[column])
        yield (
            f"The column {name} is not used: readings are taken as they stand. If they are not corrected for it, "
            "subtract it or divide by it first."
        )
    yield from _settings(table, unused, directions, value)


def _is_named(name: str, words: str) -> bool:
    return bool(re.search(rf"(?i)(^|[^a-z])({words})([^a-z]|$)", name))


def _cells(table: Table, column: int) -> pl.Series:
    return table.cells.to_series(column).cast(pl.String).fill_null("")


def _settings(
    table: Table, unused: Sequence[int], directions: Float[np.ndarray, "n d"], value: Float[np.ndarray, "n c"]
) -> Iterator[str]:
    """Columns that tell apart rows of one geometry whose values differ: samples, polarisations, temperatures."""
    rows = len(value)
    told = {k: cells for k in unused if 1 < (cells := _cells(table, k)).n_unique() <= min(SETTINGS, rows / 2)}
    if not told:
        return
    keys = pl.DataFrame(np.round(directions, _DIGITS) + 0.0).with_columns(value=pl.Series(value[:, 0]))
    geometry = [name for name in keys.columns if name != "value"]
    repeats = rows - keys.select(pl.struct(geometry).n_unique()).item()
    if repeats < rows * (1 - RESOLVED):
        return
    spread = _spread(keys, geometry)
    for column, cells in told.items():
        left = rows - keys.with_columns(told=cells).select(pl.struct([*geometry, "told"]).n_unique()).item()
        if left > (1 - RESOLVED) * repeats or spread < APART:
            continue
        name = shown(table.names[column]) or f"column {column + 1}"
        found = listed(cells.unique().sort().to_list(), 5)
        yield (
            f"Rows of one geometry differ in the column {name} ({found}) and, by more than a quarter of the value, in "
            "what was measured; they are taken as repeats of one. If they are of different things, choose with "
            f"--where {name}=…."
        )


def _spread(keys: pl.DataFrame, geometry: list[str]) -> float:
    """Range over mean of the values of a geometry, the middle one of those that are there more than once."""
    finite = keys.filter(pl.col("value").is_finite())
    each = finite.group_by(geometry).agg(
        spread=(pl.col("value").max() - pl.col("value").min()) / pl.col("value").abs().mean(), count=pl.len()
    )
    middle = each.filter((pl.col("count") > 1) & pl.col("spread").is_finite())["spread"].median()
    return float(middle) if isinstance(middle, float) else 0.0
