"""Cards: a run in three sentences of at most `MOST_WORDS` words: the material, whether Phong serves, how sure it is.

They read the record and decide nothing that a named threshold does not; page and terminal show the same.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fitmat.colour.differences import CLEARLY_VISIBLE, JUST_NOTICEABLE
from fitmat.fitting.quantities import BOUND, UNDETERMINED
from fitmat.match.distances import WITHIN
from fitmat.match.regions import GRAZING_DEG
from fitmat.match.sentences import CLOSE, SIMILAR, STRONG_EVIDENCE
from fitmat.text import with_error

MOST_WORDS = 25
"""Of a sentence."""

GLOSS = ((0.03, "mirror-smooth"), (0.12, "glossy"), (0.25, "satin"), (0.45, "dull"), (np.inf, "matte"))
"""Width α of the lobe below which a surface is called so."""

METAL = 0.3
"""F0 from which a surface that is less diffuse than that is called a metal: dielectrics stay below 0.2 (η < 2.6)."""

DIFFUSE = 0.02
"""Albedo of a diffuse part up to which there is hardly one."""

SERVES_FROM_DEG = 20.0
"""An empirical model that holds up to smaller incidences only is said not to serve."""

TITLES = {
    "phong": "Phong",
    "blinn-phong": "Blinn–Phong",
    "blinn-phong-exact": "Blinn–Phong",
    "ggx": "GGX",
    "beckmann": "Beckmann",
    "ward": "Ward",
    "cook-torrance": "Cook–Torrance",
}
"""Lobe → as people write it; the others keep their names."""

GOOD, CAUTION, BAD, UNKNOWN = "good", "caution", "bad", "unknown"

Record = Mapping[str, Any]
"""JSON types of `record.to_dict`, or a part of it."""


@dataclasses.dataclass(frozen=True)
class Card:
    """One answer.

    Attributes:
        title: The question, in a few words.
        level: `GOOD`, `CAUTION`, `BAD`, or `UNKNOWN` where the data leave it open.
        word: The level in a word.
        sentence: The answer.
    """

    title: str
    level: str
    word: str
    sentence: str


def cards(record: Record) -> tuple[Card, Card, Card]:
    """The three cards of a run, in the order in which they are read."""
    return _material(record), _phong(record), _trust(record)


def title(name: str) -> str:
    """A model's name as people write it, without its Lambert base."""
    lobe = name.removeprefix("lambert+")
    return TITLES.get(lobe, lobe)


def best(record: Record) -> Record | None:
    """The model that stands for the material: which the data prefer, else that of the match, else the first."""
    fits = {fit["model"]: fit for fit in record["fits"] if _has_values(fit)}
    ranked = [c["model"] for c in (record["choice"] or {"candidates": []})["candidates"]]
    ranked += [record["match"]["microfacet"]] if record["match"] else []
    return next((fits[name] for name in (*ranked, *fits) if name in fits), None)


def ordered(record: Record) -> list[Record]:
    """The record's fits, that of the material first."""
    first = best(record)
    return sorted(record["fits"], key=lambda fit: fit is not first)


def _has_values(fit: Record) -> bool:
    every = [q["value"] for q in fit["parameters"].values()]
    return (
        fit["result"] != "nonfinite"
        and bool(every)
        and all(value is not None for one in every for value in _listed(one))
    )


def _listed(value: Any) -> list[Any]:
    return list(value) if isinstance(value, Sequence) and not isinstance(value, str) else [value]


def _material(record: Record) -> Card:
    fit = best(record)
    if fit is None:
        return Card("The material", BAD, "no values", "No model was fitted: nothing finite was found in these data.")
    told = {**fit["derived"], **fit["parameters"]}
    parts = [*_diffuse(told), *_mirror(told), *_width(told)]
    name, kind = title(fit["model"]), _kind(told)
    listed = ", ".join(parts) or "its parameters are not determined"
    words = f"Like {kind}: {listed} ({name})." if kind else f"{name}: {listed}."
    if fit["inadequate"]:
        return Card("The material", CAUTION, "nearest model", words)
    return Card("The material", GOOD, "best model", words)


def _sure(told: Record, name: str) -> Record | None:
    """A quantity, where there is one whose value can be relied on."""
    found = told.get(name)
    if found is None or any(remark == UNDETERMINED or BOUND in remark for remark in _listed(found["remark"])):
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
    return [] if kd is None else [f"diffuse {_percent(_listed(kd['value']))}"]


def _mirror(told: Record) -> list[str]:
    """What is reflected like by a mirror: F0, or what of it is determined, or the weight of an empirical lobe."""
    for name, called in (("f0", "F0"), ("ks·F0", "ks·F0")):
        if (found := _sure(told, name)) is not None:
            return [f"{called} {_two_digits(_listed(found['value']))}"]
    if (ks := _sure(told, "ks")) is not None and "eta" not in told:
        return [f"specular weight {_listed(ks['value'])[0]:.2g}"]
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
    diffuse = float(np.mean(_listed(kd["value"]))) if kd is not None else 0.0
    mirror = float(np.mean(_listed(f0["value"]))) if f0 is not None else 0.0
    if mirror >= METAL and diffuse < mirror:
        return f"{gloss} metal"
    if diffuse > DIFFUSE:
        return f"{gloss} paint" if gloss in ("dull", "matte") else f"{gloss} plastic"
    return f"a {gloss} dielectric"


def _phong(record: Record) -> Card:
    """Whether the empirical model can stand for the microfacet one, and where it breaks."""
    match, question = record["match"], "Phong or not"
    if match is None:
        words = "Not asked: no pair of an empirical and a microfacet model has values; name both with --models."
        return Card(question, UNKNOWN, "not asked", words)
    one, other = title(match["empirical"]), title(match["microfacet"])
    fits = {fit["model"]: fit for fit in record["fits"]}
    adequate = not fits[match["empirical"]]["inadequate"]
    preferred = match["delta_bic"] is not None and match["delta_bic"] <= -STRONG_EVIDENCE
    if preferred and adequate:
        return Card(question, GOOD, "serves", f"{one} serves: it follows the data, which clearly prefer it to {other}.")
    if preferred:
        words = f"{one} serves better than {other}, but neither follows the data within their noise."
        return Card(question, CAUTION, "better, not good", words)
    return _standing_in(match, one, other, question)


def _standing_in(match: Record, one: str, other: str, question: str) -> Card:
    eye, seen, apart = "", match["perceived"], match["measured_distance"]
    limit = (apart["ci95"] or [apart["value"]] * 2)[1]
    hardly = limit < CLOSE
    if seen is not None:
        delta = seen["delta_e_2000"]
        eye = f"ΔE2000 {delta['mean']['value']:.1f} on average"
        hardly = delta["worst_twentieth"]["ci95"][1] < CLEARLY_VISIBLE
        hardly &= delta["mean"]["value"] < JUST_NOTICEABLE or apart["value"] < SIMILAR
    if hardly:
        words = (
            f"{one} serves: an eye would hardly tell it from {other}" if eye else f"{one} hardly differs from {other}"
        )
        return Card(question, GOOD, "serves", f"{words}{f' ({eye})' if eye else ''}.")
    upto = match["serves_up_to_deg"]
    if upto is not None and upto >= SERVES_FROM_DEG:
        beyond = "" if upto <= match["measured_deg"][1] + np.rad2deg(WITHIN) else ", extrapolated"
        words = f"{one} serves up to {upto:.0f}°{beyond}, within {100 * SIMILAR:.0f} % of {other}"
        return Card(question, CAUTION, f"up to {upto:.0f}°", f"{words}; {eye or 'beyond, it breaks'}.")
    shares = {region: e["value"] for region, e in match["distances"]["relative"]["share"].items()}
    worst = max(shares, key=lambda region: shares[region] or 0.0)
    where = f"{100 * (shares[worst] or 0.0):.0f} % of the difference to {other} lies {PLACES[worst]}"
    return Card(question, BAD, "does not serve", f"{one} does not serve: {f'{eye}; ' if eye else ''}{where}.")


PLACES = {
    "core": "in the core of the highlight",
    "tail": "in the tail of the highlight",
    "grazing": f"beyond {GRAZING_DEG:.0f}°",
    "diffuse": "far from the highlight",
}
"""Region of `match.regions` → where that is."""


def _trust(record: Record) -> Card:
    fit, question = best(record), "Can I trust it?"
    if fit is None:
        return Card(
            question, BAD, "no", "No: no fit ended with finite values; check the columns and units of the file."
        )
    name, lost = title(fit["model"]), fit["not_determined"]
    ratio = fit["misfit_ratio"]
    misses = f"{name} misses the data by {ratio:.2g} × the noise" if ratio is not None and fit["inadequate"] else ""
    if not fit["intervals_hold"]:
        why = misses or (f"what speaks against {name} is said below" if fit["doubts"] else f"{name} is in doubt")
        return Card(question, BAD, "no", f"No: {why}; do not take the intervals at their word.")
    if not record["loss"]["posterior"]:
        words = f"In part: {name} is a single best fit under the loss {record['loss']['name']}, without intervals."
        return Card(question, CAUTION, "no intervals", words)
    if misses:
        return Card(question, CAUTION, "with care", f"With care: {misses}; the intervals allow for that.")
    if lost:
        few = ", ".join(lost[:3]) + (f" and {len(lost) - 3} more" if len(lost) > 3 else "")
        verb, states = "is" if len(lost) == 1 else "are", (fit["identifiability"] or {"parameters": {}})["parameters"]
        why = " by these angles; `fitmat design` says what to measure next"
        open_ = [state for state in states.values() if state["state"] == UNDETERMINED]
        if open_ and all(state.get("misfit") for state in open_):
            why = ", because the model misses the data; another model may say more"
        return Card(question, CAUTION, "in part", f"In part: {few} {verb} not determined{why}.")
    if fit["adequacy"].startswith("adequacy unknown"):
        words = "Not known: nobody stated the noise, so whether the model is adequate cannot be judged."
        return Card(question, UNKNOWN, "not known", words)
    return _trusted(record, fit, name, question)


def _trusted(record: Record, fit: Record, name: str, question: str) -> Card:
    """Where nothing speaks against the model."""
    sure = "every parameter is determined" if fit["identifiability"] is not None else "nothing speaks against it"
    follows = f"{name} follows the data within the noise"
    if fit["posterior"]["verdict"] in ("unusable", "approximate"):
        words = f"With care: {follows}, but the posterior is {fit['posterior']['verdict']}: the intervals may be wrong."
        return Card(question, CAUTION, "with care", words)
    states = (fit["identifiability"] or {"parameters": {}})["parameters"].items()
    weak = list(dict.fromkeys(k.partition(" ")[0] for k, v in states if v["state"] != "determined"))
    if weak:
        few = ", ".join(weak[:3]) + (f" and {len(weak) - 3} more" if len(weak) > 3 else "")
        words = f"Mostly: {follows}, but {few} {'is' if len(weak) == 1 else 'are'} only weakly determined."
        return Card(question, CAUTION, "mostly", words)
    if doubts := len(fit["doubts"]) + len(record["warnings"]):
        said = "a remark on the data is" if doubts == 1 else f"{doubts} remarks on the data are"
        return Card(question, CAUTION, "mostly", f"Mostly: {follows} and {sure}, but {said} below.")
    return Card(question, GOOD, "yes", f"Yes: {follows} and {sure}.")
