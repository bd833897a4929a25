"""Quantities: numbers of a fit as people read them: value, standard deviation, interval, unit, or why there is none.

They are told here; fits and posteriors find them.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
import polars as pl

from fitmat.errors import ModelError
from fitmat.text import brief, channel_labels, with_error

UNDETERMINED = "not determined"
"""Remark on what has an interval but no value to rely on."""

BOUND = " bound"
"""How the remark ends on what sits on one: "at its lower bound"."""

SEVERAL = "another optimum fits as well"
"""Remark on what has several values, which its interval holds, and none to rely on."""


@dataclasses.dataclass(frozen=True, eq=False)
class Quantity:
    """One reported quantity; arrays hold one entry per channel, or a single one for shared quantities.

    Attributes:
        name: Parameter name.
        symbol: The letter of the literature.
        unit: "1" for none.
        doc: What it means.
        value: Best fit, (k,).
        sd: Standard deviation, (k,); NaN where `remarks` says why there is none.
        ci95: 95 % interval, (k, 2).
        per_channel: Whether the k entries are channels.
        remarks: (k,); "" or a reason: "fixed", "at its lower bound", "not determined".
    """

    name: str
    symbol: str
    unit: str
    doc: str
    value: np.ndarray
    sd: np.ndarray
    ci95: np.ndarray
    per_channel: bool
    remarks: tuple[str, ...]

    __repr__ = brief

    def __str__(self) -> str:
        """The name, each value with its standard deviation and 95 % interval, or why there is none."""
        told = (self._entry(k) for k in range(len(self.value)))
        return f"{self.name} ({self.symbol}) = {'; '.join(told)}{'' if self.unit == '1' else ' ' + self.unit}"

    def labels(self, channels: Sequence[str]) -> list[str]:
        """The name of each value, on one line: "kd r", "kd g", or "alpha" where all channels share it."""
        return channel_labels(self.name, len(self.value), channels, own=self.per_channel)

    def _entry(self, k: int) -> str:
        found, (low, high), remark = with_error(float(self.value[k]), float(self.sd[k])), self.ci95[k], self.remarks[k]
        limits = f"95 % {low:.4g} – {high:.4g}" if np.isfinite(self.ci95[k]).all() and low < high else ""
        words = ", ".join(part for part in (limits, remark) if part)
        return f"{found} ({words})" if words else found


def named(known: Sequence[Quantity], name: str, owner: str) -> Quantity:
    """The quantity of a name.

    Raises:
        ModelError: there is none, with all names.
    """
    found = next((q for q in known if q.name == name), None)
    if found is None:
        raise ModelError(f"{owner} has no parameter {name!r}, expected one of {', '.join(q.name for q in known)}.")
    return found


def dataframe(known: Sequence[Quantity], owner: str, channels: Sequence[str]) -> pl.DataFrame:
    """One row for each quantity and channel: model, parameter, channel, symbol, value, sd, low, high, unit, remark.

    Args:
        known: The quantities.
        owner: Name of the model.
        channels: Names of its channels; null where all share a quantity.
    """
    rows = [
        {
            "model": owner,
            "parameter": q.name,
            "channel": channels[k] if q.per_channel else None,
            "symbol": q.symbol,
            "value": float(q.value[k]),
            "sd": float(q.sd[k]),
            "low": float(q.ci95[k, 0]),
            "high": float(q.ci95[k, 1]),
            "unit": q.unit,
            "remark": q.remarks[k],
        }
        for q in known
        for k in range(len(q.value))
    ]
    return pl.DataFrame(rows, schema_overrides={"channel": pl.String})
