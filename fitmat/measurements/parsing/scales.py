"""Scales: how values are written, plainly, in percent or as logarithms, and back to plain numbers.

It converts what the user says; what only a column's name says is asked about.
"""

import re

import numpy as np
from jaxtyping import Float

from fitmat.measurements.parsing import units

Numbers = Float[np.ndarray, "n c"]

_LOGARITHMS: dict[str, tuple[str, float]] = {
    "db": ("decibels, 10 log₁₀ of the quantity", np.log(10.0) / 10.0),
    "log10": ("log₁₀ of the quantity", np.log(10.0)),
    "ln": ("the natural logarithm of the quantity", 1.0),
}
# Scale → in words, and b of quantity = exp(b · number).

_BEFORE = re.compile(r"(10)?[ *]*(log_?10|lg|log|ln)[ _]*(\(.+\)|[a-z].*)", re.IGNORECASE)
_BEHIND = re.compile(r"(.+?)[ _]*(?:[ _](db|log10|log|ln)|[\[(](db|log10|log|ln)[\])])", re.IGNORECASE)
_NAMED = {"db": "db", "ln": "ln", "lg": "log10", "log10": "log10", "log": "log10"}


def stated(name: str) -> tuple[str, str]:
    """The name of a quantity without the scale it names, and that scale; "" where it names none.

    Example:
        >>> stated("10*log10(BRDF)"), stated("brdf [dB]"), stated("brdf")
        (('BRDF', 'db'), ('brdf', 'db'), ('brdf', ''))
    """
    name = " ".join(name.split())
    if len(name) > units.LONGEST:
        return name, ""
    if before := _BEFORE.fullmatch(name):
        scale = _NAMED[before[2].lower().replace("_", "")]
        return before[3].strip("()"), "db" if before[1] else scale
    if behind := _BEHIND.fullmatch(name):
        return behind[1], _NAMED[(behind[2] or behind[3]).lower()]
    return name, ""


def plain(value: Numbers, sigma: Numbers | None, scale: str | None) -> tuple[Numbers, Numbers | None]:
    """Plain numbers and their σ, to first order (JCGM 100:2008, eq. 10), from numbers in a scale."""
    if scale == "percent":
        return value / 100.0, None if sigma is None else sigma / 100.0
    if scale not in _LOGARITHMS:
        return value, sigma
    base = _LOGARITHMS[scale][1]
    with np.errstate(over="ignore"):  # what is not finite is masked
        found = np.exp(base * value)
        return found, None if sigma is None else base * sigma * found


def note(scale: str | None) -> tuple[str, ...]:
    """What was done to the numbers, in a sentence."""
    if scale == "percent":
        return ("Values read as percent: divided by 100.",)
    return (f"Values read as {_LOGARITHMS[scale][0]}.",) if scale in _LOGARITHMS else ()
