"""Likeness: what a fitted surface is like, in a few words and numbers: "satin plastic", "diffuse 20 %", "α 0.150".

It quotes only what the data determine, and judges nothing.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fitmat.fitting.quantities import BOUND, UNDETERMINED
from fitmat.text import with_error

GLOSS = ((0.03, "mirror-smooth"), (0.12, "glossy"), (0.25, "satin"), (0.45, "dull"), (np.inf, "matte"))
"""Width α of the lobe below which a surface is called so."""

METAL = 0.3
"""F0 from which a surface that is less diffuse than that is called a metal: dielectrics stay below 0.2 (η < 2.6)."""

DIFFUSE = 0.02
"""Albedo of a diffuse part up to which there is hardly one."""

Record = Mapping[str, Any]
"""JSON types: quantities of one fit by their names."""


def likeness(fit: Mapping[str, Any]) -> tuple[str, list[str]]:
    """What a fit of the record is like: "satin plastic" or "", and the numbers that say so."""
    told = {**fit["derived"], **fit["parameters"]}
    return _kind(told), [*_diffuse(told), *_mirror(told), *_width(told)] or _others(fit["parameters"])


def listed(value: Any) -> list[Any]:
    """A value of each channel, or the one of all."""
    return list(value) if isinstance(value, Sequence) and not isinstance(value, str) else [value]


def _sure(told: Record, name: str) -> Record | None:
    """A quantity, where there is one whose value can be relied on."""
    found = told.get(name)
    if found is None or any(remark == UNDETERMINED or BOUND in remark for remark in listed(found["remark"])):
        return None
    return found


def _percent(values: list[float]) -> str:
    """In percent: one number, a few with slashes, or from the least to the largest."""
    texts = list(dict.fromkeys(f"{100 * v:.2g}" if 0.0005 <= v < 0.995 else f"{100 * v:.3g}" for v in values))
    if len(texts) == 1:
        return f"{texts[0]} %"
    if len(values) <= 3:
        return "/".join(f"{100 * v:.2g}" for v in values) + " %"
    return f"{100 * min(values):.2g}–{100 * max(values):.2g} %"


def _diffuse(told: Record) -> list[str]:
    kd = _sure(told, "kd")
    return [] if kd is None else [f"diffuse {_percent(listed(kd['value']))}"]


def _mirror(told: Record) -> list[str]:
    """What is reflected like by a mirror: F0, or what of it is determined, or the weight of an empirical lobe."""
    for name, called in (("f0", "F0"), ("ks·F0", "ks·F0")):
        if (found := _sure(told, name)) is not None:
            return [f"{called} {_two_digits(listed(found['value']))}"]
    if (ks := _sure(told, "ks")) is not None and "eta" not in told:
        return [f"specular weight {listed(ks['value'])[0]:.2g}"]
    return []


def _two_digits(values: list[float]) -> str:
    if len(values) == 1:
        return f"{100 * values[0]:#.2g}".rstrip(".") + " %"
    return _percent(values)


def _width(told: Record) -> list[str]:
    for name, letter in (("alpha", "α"), ("alpha_x", "αx"), ("exponent", "exponent")):
        found = _sure(told, name)
        if found is not None and not isinstance(found["value"], list):
            sd = found["sd"] if found["sd"] is not None else np.nan
            across = _sure(told, "alpha_y") if name == "alpha_x" else None
            beside = [] if across is None else [f"αy {across['value']:.3g}"]
            return [f"{letter} {_shortly(found['value'], sd)}", *beside]
    return []


def _others(told: Record) -> list[str]:
    """Three at most of the parameters of a model that has none of the usual ones."""
    usual = {"kd", "ks", "alpha", "alpha_x", "exponent", "eta"} & told.keys()
    sure = {} if usual else {name: q for name in told if name != "discrepancy" and (q := _sure(told, name))}
    return [f"{name} {_shortly(q['value'], q['sd'])}" for name, q in sure.items() if isinstance(q["sd"], float)][:3]


def _shortly(value: float, sd: float) -> str:
    """As `with_error`, the error to one digit."""
    text = with_error(value, sd)
    digits = text.partition(" ± ")[2]
    if not digits or "e" in text or "." not in digits:
        return text
    places = max(len(digits.partition(".")[2]) - 1, 1)
    return f"{value:.{places}f} ± {sd:.{places}f}"


def _kind(told: Record) -> str:
    """What such a surface is like, in two words; "" where gloss or reflectance is not known."""
    alpha, f0, kd = _sure(told, "alpha"), _sure(told, "f0") or _sure(told, "ks·F0"), _sure(told, "kd")
    if alpha is None or isinstance(alpha["value"], list) or (f0 is None and kd is None):
        return ""
    gloss = next(word for limit, word in GLOSS if alpha["value"] < limit)
    diffuse = float(np.mean(listed(kd["value"]))) if kd is not None else 0.0
    mirror = float(np.mean(listed(f0["value"]))) if f0 is not None else 0.0
    if mirror >= METAL and diffuse < mirror:
        return f"{gloss} metal"
    if diffuse > DIFFUSE:
        return f"{gloss} paint" if gloss in ("dull", "matte") else f"{gloss} plastic"
    return f"a {gloss} dielectric"
