"""Cards: a run in three sentences of at most `MOST_WORDS` words: the material, whether Phong serves, how sure it is.

They read the record and decide nothing that a named threshold does not; page and terminal show the same.
"""

import dataclasses
import shlex
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from fitmat.colour.differences import CLEARLY_VISIBLE, JUST_NOTICEABLE, seen
from fitmat.fitting.quantities import UNDETERMINED
from fitmat.match.distances import WITHIN
from fitmat.match.regions import GRAZING_DEG
from fitmat.match.sentences import CLOSE, SIMILAR, STRONG_EVIDENCE
from fitmat.studies.likeness import likeness, listed

MOST_WORDS = 25
"""Of a sentence."""

FEW = 2
"""Of so many models or fewer, more can be tried."""

ACROSS_DEG = 135.0
"""Relative azimuth below which a curve is said to lie across the plane of incidence, not in it."""

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

    @property
    def after_word(self) -> str:
        """The sentence where the word stands above it, without the same word: "Yes: it follows …" is "It follows …"."""
        first, colon, rest = self.sentence.partition(": ")
        said = colon and first.lower() == self.word.lower()
        return rest[:1].upper() + rest[1:] if said else self.sentence


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
        and all(value is not None for one in every for value in listed(one))
    )


def _material(record: Record) -> Card:
    fit = best(record)
    if fit is None:
        return Card("The material", BAD, "no values", "No model was fitted: nothing finite was found in these data.")
    name, (kind, parts) = title(fit["model"]), likeness(fit)
    numbers = ", ".join(parts) or "its parameters are not determined"
    words = f"Like {kind}: {numbers} ({name})." if kind else f"{name}: {numbers}."
    if fit["inadequate"]:
        return Card("The material", CAUTION, f"nearest model: {name}", words)
    return Card("The material", GOOD, f"best model: {name}", words)


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
    eye, worst, perceived, apart = "", "", match["perceived"], match["measured_distance"]
    limit = (apart["ci95"] or [apart["value"]] * 2)[1]
    hardly = limit < CLOSE
    if perceived is not None:
        delta = perceived["delta_e_2000"]
        eye = _seen("mean ΔE2000 {:.1f}", delta["mean"]["value"])
        if delta["mean"]["value"] < JUST_NOTICEABLE <= delta["worst_twentieth"]["value"]:
            worst = _seen("ΔE2000 {:.1f} where worst", delta["worst_twentieth"]["value"])
        hardly = delta["worst_twentieth"]["ci95"][1] < CLEARLY_VISIBLE
        hardly &= delta["mean"]["value"] < JUST_NOTICEABLE or apart["value"] < SIMILAR
    if hardly:
        words = (
            f"{one} serves: an eye would hardly tell it from {other}" if eye else f"{one} hardly differs from {other}"
        )
        return Card(question, GOOD, "serves", f"{words}{f' ({eye})' if eye else ''}.")
    eye = worst or eye
    upto = match["serves_up_to_deg"]
    if upto is not None and upto >= SERVES_FROM_DEG:
        beyond = "" if upto <= match["measured_deg"][1] + np.rad2deg(WITHIN) else ", extrapolated"
        words = f"{one} serves up to {upto:.0f}° of incidence{beyond}, within {100 * SIMILAR:.0f} % of {other}"
        return Card(question, CAUTION, f"up to {upto:.0f}° of incidence", f"{words}; {eye or 'beyond, it breaks'}.")
    shares = {region: e["value"] for region, e in match["distances"]["relative"]["share"].items()}
    place = max(shares, key=lambda region: shares[region] or 0.0)
    share = f"{100 * (shares[place] or 0.0):.0f} %"
    where = f"over the hemisphere, {share} of the difference to {other} lies {PLACES[place]}"
    return Card(question, BAD, "does not serve", f"{one} does not serve: {f'{eye}; ' if eye else ''}{where}.")


def _seen(words: str, delta: float) -> str:
    return f"{words.format(delta)}, {seen(delta)}"


PLACES = {
    "core": "in the highlight's core",
    "tail": "in the highlight's tail",
    "grazing": f"beyond {GRAZING_DEG:.0f}°",
    "diffuse": "far from the highlight",
}
"""Region of `match.regions` → where that is."""


def next_angle(record: Record) -> str:
    """What to measure next: "incidence 80°"; "" where no angle is worth it."""
    place = record.get("next")
    if place is None:
        return ""
    turned = f" turned {place['phi_i_deg']:.3g}°" if place["phi_i_deg"] else ""
    across = " across the plane" if place["phi_deg"] < ACROSS_DEG else ""
    return f"incidence {place['theta_i_deg']:.3g}°{turned}{across}"


def wider(record: Record) -> str:
    """The command that tries every model, where the best of a few misses the data; "" where none is known."""
    fit, command = best(record), record.get("command")
    if command is None or fit is None or not fit["inadequate"] or len(record["fits"]) > FEW:
        return ""
    words = shlex.split(command)
    names = [k for k, word in enumerate(words) if word == "--models"]
    kept = [word for k, word in enumerate(words) if k not in names and k - 1 not in names]
    return shlex.join([*(word for word in kept if not word.startswith("--models=")), "--models", "all"])


def _trust(record: Record) -> Card:
    fit, question = best(record), "Can I trust it?"
    if fit is None:
        return Card(
            question, BAD, "no", "No: no fit ended with finite values; check the columns and units of the file."
        )
    name = title(fit["model"])
    ratio = fit["misfit_ratio"]
    misses = f"{name} misses the data by {ratio:.2g} × the noise" if ratio is not None and fit["inadequate"] else ""
    if not fit["intervals_hold"]:
        why = misses or (f"what speaks against {name} is said below" if fit["doubts"] else f"{name} is in doubt")
        return Card(question, BAD, "no", f"No: {why}; do not take the intervals at their word.")
    if not record["loss"]["posterior"]:
        words = f"In part: {name} is a single best fit under the loss {record['loss']['name']}, without intervals."
        return Card(question, CAUTION, "no intervals", words)
    if misses:
        others = "; try more models" if len(record["fits"]) <= FEW else ""
        words = f"With care: {misses}; the intervals allow for that{others}."
        if lost := fit["not_determined"]:
            words = _within(lost, lambda few, verb: f"With care: {misses}, and {few} {verb} not determined{others}.")
        return Card(question, CAUTION, "with care", words)
    if fit["not_determined"]:
        return Card(question, CAUTION, "in part", _lost(record, fit))
    if fit["adequacy"].startswith("adequacy unknown"):
        words = "Not known: nobody stated the noise, so whether the model is adequate cannot be judged"
        where = next_angle(record)
        return Card(question, UNKNOWN, "not known", f"{words}{f'; measure next: {where}' if where else ''}.")
    return _trusted(record, fit, name, question)


def _lost(record: Record, fit: Record) -> str:
    """What these angles leave open, and where to look."""
    where, states = next_angle(record), (fit["identifiability"] or {"parameters": {}})["parameters"]
    why = " by these angles; " + (f"measure next: {where}" if where else "`fitmat design` says what to measure next")
    open_ = [state for state in states.values() if state["state"] == UNDETERMINED]
    if open_ and all(state.get("misfit") for state in open_):
        why = ", because the model misses the data; another model may say more"
    return _within(fit["not_determined"], lambda few, verb: f"In part: {few} {verb} not determined{why}.")


def _within(names: Sequence[str], words: Callable[[str, str], str]) -> str:
    """A sentence about parameters that names as many of them as `MOST_WORDS` allow, at most three."""
    verb, many = "is" if len(names) == 1 else "are", len(names)
    named = [", ".join(names[:most]) + (f" and {many - most} more" if many > most else "") for most in (3, 2, 1)]
    sentences = [words(few, verb) for few in (*named, f"{many} parameters")]
    return next((one for one in sentences if len(one.split()) <= MOST_WORDS), sentences[-1])


def _trusted(record: Record, fit: Record, name: str, question: str) -> Card:
    """Where nothing speaks against the model."""
    asked, where = fit["identifiability"] is not None, next_angle(record)
    sure = "every parameter is determined" if asked else "nothing speaks against it"
    follows = f"{name} follows the data within the noise"
    if fit["posterior"]["verdict"] in ("unusable", "approximate"):
        words = f"With care: {follows}, but the posterior is {fit['posterior']['verdict']}: the intervals may be wrong."
        return Card(question, CAUTION, "with care", words)
    states = (fit["identifiability"] or {"parameters": {}})["parameters"].items()
    weak = list(dict.fromkeys(k.partition(" ")[0] for k, v in states if v["state"] != "determined"))
    if weak:
        then = f"; measure next: {where}" if where else ""
        words = _within(weak, lambda few, verb: f"Mostly: {follows}, but {few} {verb} only weakly determined{then}.")
        return Card(question, CAUTION, "mostly", words)
    if doubts := len(fit["doubts"]) + len(record["warnings"]):
        said = "a remark on the data is" if doubts == 1 else f"{doubts} remarks on the data are"
        return Card(question, CAUTION, "mostly", f"Mostly: {follows} and {sure}, but {said} below.")
    if where:
        rival = title(record["next"]["against"] or "")
        return Card(question, GOOD, "yes", f"Yes: {follows} and {sure}; {where} would tell it from {rival}.")
    return Card(question, GOOD, "yes", f"Yes: {follows} and {sure}{'; no further angle is needed' if asked else ''}.")
