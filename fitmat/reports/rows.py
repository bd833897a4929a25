"""Rows: the numbers of one model as text, for the page and the terminal alike.

It computes nothing: every number comes from the record.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fitmat.fitting.quantities import UNDETERMINED
from fitmat.studies.result import FIXED
from fitmat.text import interval, visible, with_error

Record = Mapping[str, Any]
"""A part of the record of a study, as JSON types."""

BADGES = {
    "determined": ("determined", "good", "These angles determine it to better than a tenth."),
    "weakly determined": (
        "weakly",
        "caution",
        "These angles determine it to a tenth at best, or another value fits too.",
    ),
    "not determined": ("not determined", "bad", "These angles do not determine it: quote its interval, not its value."),
}
"""State of a parameter → what its badge says, how it looks, and what it means."""


LEVELS = ("good", "unknown", "caution", "bad")
"""How a badge looks, from what is known to what is not."""


def parameter_rows(fit: Record, channels: Sequence[str]) -> list[dict[str, Any]]:
    """One line per reported number, as text: name, symbol, value, interval, remark, what it means.

    What the data do not determine has its interval, but no standard deviation: the draws fill the range allowed.

    Args:
        fit: One of the record's `fits`.
        channels: Names of all channels.
    """
    result = []
    for kind, told in (("fitted", fit["parameters"]), ("follows", fit["derived"])):
        for name, q in told.items():
            for k, (value, sd, (low, high), remark) in enumerate(_each(q)):
                several = isinstance(q["value"], list)
                free = remark != FIXED and math.isfinite(low) and math.isfinite(high)
                sd = math.nan if remark == UNDETERMINED else sd
                full = name + (f" {visible(channels[k])}" if several and len(channels) > 1 else "")
                result.append(
                    {
                        "kind": kind,
                        "name": full,
                        "key": name,
                        "place": k,
                        "symbol": q["symbol"],
                        "value": with_error(value, sd),
                        "interval": interval(low, high, sd) if free else "",
                        "ends": (low, high) if free else None,
                        "best": value,
                        "sd": sd,
                        "unit": "" if q["unit"] == "1" else q["unit"],
                        "remark": remark,
                        "doc": q["doc"],
                        "badge": _badge(fit, kind, full, remark),
                    }
                )
    return result


def brief_rows(fit: Record, channels: Sequence[str], most: int = 6) -> list[dict[str, Any]]:
    """Of each fitted parameter the line of the channel that is known worst; at most so many."""
    found: dict[str, dict[str, Any]] = {}
    for row in parameter_rows(fit, channels):
        known = found.get(row["key"])
        if row["kind"] == "fitted" and row["badge"] and (known is None or _doubt(row) > _doubt(known)):
            found[row["key"]] = row
    return list(found.values())[:most]


def _doubt(row: Record) -> int:
    return LEVELS.index(row["badge"][1])


def _each(q: Record) -> Iterator[tuple[float, float, tuple[float, float], str]]:
    """Value, standard deviation, limits and remark of each channel, NaN for what is null."""
    several = isinstance(q["value"], list)
    columns = [q[key] if several else [q[key]] for key in ("value", "sd", "ci95", "remark")]
    for value, sd, ends, remark in zip(*columns, strict=True):
        yield _number(value), _number(sd), (_number(ends[0]), _number(ends[1])), remark


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _badge(fit: Record, kind: str, name: str, remark: str) -> tuple[str, str, str] | None:
    """What a badge says, how it looks, and what that means; None where nothing is known."""
    if remark == FIXED:
        return "held", "unknown", "It was given, not fitted."
    states = (fit["identifiability"] or {"parameters": {}})["parameters"]
    if remark == UNDETERMINED:
        return BADGES[UNDETERMINED]
    if kind == "fitted" and name in states:
        return BADGES[states[name]["state"]]
    return ("in doubt", "caution", f"{remark[0].upper()}{remark[1:]}.") if remark else None


def prior_rows(fit: Record, channels: Sequence[str]) -> list[dict[str, str]]:
    """One line per fitted parameter: its prior, what the data made of it, and how much narrower that is."""
    after = {row["name"]: row for row in parameter_rows(fit, channels) if row["kind"] == "fitted"}
    return [
        {
            "name": learnt["name"],
            "symbol": after[visible(learnt["name"])]["symbol"],
            "prior": learnt["prior"],
            "posterior": after[visible(learnt["name"])]["interval"],
            "narrower": "–" if learnt["narrower"] is None else f"{learnt['narrower']:.3g}",
        }
        for learnt in fit["learnt"]
    ]
