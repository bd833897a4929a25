"""What a study says agrees with itself: points lie in their intervals, and no two sentences contradict."""

import dataclasses
import json
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.colour.differences import seen
from fitmat.fitting.quantities import UNDETERMINED
from fitmat.reports.rows import parameter_rows
from fitmat.studies import record
from fitmat.studies.cards import BAD, GOOD, MOST_WORDS, Card, best, cards
from fitmat.studies.study import Study, study
from fitmat.uncertainty.estimate import Estimate

ROUNDING = 1e-9
"""Of quantiles."""

PAIR = "lambert+blinn-phong,lambert+ggx"


def estimates(thing: Any, place: str = "") -> Iterator[tuple[str, Estimate]]:
    """Every `Estimate` inside a dataclass, a dict or a tuple, but for posteriors."""
    if isinstance(thing, Estimate):
        yield place, thing
    elif isinstance(thing, dict):
        for key, part in thing.items():
            yield from estimates(part, f"{place}.{key}")
    elif isinstance(thing, tuple):
        for k, part in enumerate(thing):
            yield from estimates(part, f"{place}[{k}]")
    elif dataclasses.is_dataclass(thing) and not isinstance(thing, fm.Posterior | type):
        for field in dataclasses.fields(thing):
            yield from estimates(getattr(thing, field.name), f"{place}.{field.name}")


def contradictions(found: Study) -> list[str]:
    """Every point outside its interval and every pair of statements that do not go together."""
    return [*_points(found), *_states(found), *_sentences(found), *_cards(found)]


def _points(found: Study) -> Iterator[str]:
    for one in found.findings:
        for q in (*one.parameters, *one.derived):
            for value, (low, high), remark in zip(q.value, q.ci95, q.remarks, strict=True):
                slack, none = ROUNDING * max(abs(value), 1.0), np.isnan(low) and np.isnan(high) and remark != ""
                if remark != "fixed" and not none and not low - slack <= value <= high + slack:
                    yield f"{one.name} {q.name}: {value} outside {low} – {high}"
    for place, e in estimates(found.match):
        if e.has_interval and not e.ci95[0] - ROUNDING <= e.value <= e.ci95[1] + ROUNDING:
            yield f"match{place}: {e.value} outside {e.ci95}"


def _states(found: Study) -> Iterator[str]:
    written = {one["model"]: one for one in record.to_dict(found)["fits"]}
    for one in found.findings:
        lost = {q.name for q in one.parameters if UNDETERMINED in q.remarks}
        rows = {
            row["name"]
            for row in parameter_rows(written[one.name], found.measurements.channels)
            if (row["kind"], row["remark"]) == ("fitted", UNDETERMINED)
        }
        if set(written[one.name]["not_determined"]) != lost:
            yield f"{one.name}: the record calls other parameters not determined than the table"
        if not set(one.fit.undetermined) <= lost:
            yield f"{one.name}: {one.fit.undetermined} not determined by the fit, {lost} in the table"
        if one.identifiability is not None and set(one.identifiability.undetermined) != rows:
            yield f"{one.name}: identifiability {one.identifiability.undetermined}, table {rows}"
        for row in parameter_rows(written[one.name], found.measurements.channels):
            if row["remark"] == UNDETERMINED and "±" in row["value"]:
                yield f"{one.name} {row['name']}: a standard deviation of what is not determined"
        missed = one.fit.adequacy.startswith("inadequate")
        if missed and not one.doubts.inadequate:
            yield f"{one.name}: inadequate without a doubt"
        if one.doubts.intervals_hold == any("intervals hold only if" in words for words in one.doubts.words):
            yield f"{one.name}: in doubt, but not said"


def _sentences(found: Study) -> Iterator[str]:
    words = " ".join(
        [*found.warnings, found.match.verdict if found.match else "", found.choice.verdict if found.choice else ""]
    )
    for value, low, high in re.findall(r"(\d+) %(?: apart[a-z ]*)? \(95 % interval (\d+)–(\d+) %\)", words):
        if not int(low) <= int(value) <= int(high):
            yield f"{value} % outside {low}–{high} %"
    if found.match is None:
        return
    names = [one.fit.name.removeprefix("lambert+") for one in (found.match.empirical, found.match.microfacet)]
    for name, other in (names, names[::-1]):
        if f"clearly prefer {name}" in words and f"clearly prefer {other}" in words:
            yield "the data prefer both"
    apart = found.match.measured_distance
    if "hardly differ:" in words and apart.value > 0.1 + ROUNDING:
        yield f"hardly differ, {apart.value} apart"
    if "cannot tell them apart" in words and "tells them apart at every" in words:
        yield "told apart and not"


def _cards(found: Study) -> Iterator[str]:
    """The three answers against what they are about."""
    told = json.loads(json.dumps(record.to_dict(found)))
    material, phong, trust = cards(told)
    for card in (material, phong, trust):
        if len(card.sentence.split()) > MOST_WORDS:
            yield f"{card.sentence}: more than {MOST_WORDS} words"
    stands = best(told)
    if stands is None:
        return
    one = next(f for f in found.findings if f.name == stands["model"])
    lost = {q.name for q in one.parameters if UNDETERMINED in q.remarks}
    if trust.level == GOOD and (one.doubts.words or lost or not one.doubts.intervals_hold or found.warnings):
        yield f"{trust.sentence} though {one.doubts.words}, {lost} and {found.warnings}"
    if (material.level == GOOD) == one.doubts.inadequate:
        yield f"{material.word} of a model whose doubts are {one.doubts.words}"
    if trust.word == "in part" and not any(name in trust.sentence for name in lost):
        yield f"{trust.sentence} but {lost} are not determined"
    if not one.doubts.intervals_hold and trust.level != BAD:
        yield f"{trust.sentence} though the intervals do not hold"
    if "kd" in lost and "diffuse" in material.sentence:
        yield f"{material.sentence} with kd not determined"
    if found.match is not None:
        yield from _served(found, phong)


def _served(found: Study, phong: Card) -> Iterator[str]:
    match = found.match
    assert match is not None
    preferred = match.delta_bic <= -10 or match.perceived is None
    apart = match.distances.by_incidence["relative"][1]
    if phong.level == GOOD and not preferred and match.measured_distance.value > 0.3 + ROUNDING:
        yield f"{phong.sentence} though they differ strongly"
    if phong.word == "does not serve" and apart[:5].max() < 0.3:
        yield f"{phong.sentence} though within {apart[:5]} up to 20°"
    if "ΔE2000" in phong.sentence and match.perceived is not None:
        delta = match.perceived.delta_e_2000
        mean, worst = delta.mean.value, delta.worst_twentieth.value
        said = f"mean ΔE2000 {mean:.1f}, {seen(mean)}", f"ΔE2000 {worst:.1f} where worst, {seen(worst)}"
        if said["worst" in phong.sentence] not in phong.sentence:
            yield f"{phong.sentence} with ΔE2000 {mean}, {worst}"


TRUTHS = [
    ("lambert", {}),
    ("lambert+ggx", {"alpha": (0.01, 0.7), "eta": (1.2, 2.5)}),
    ("lambert+blinn-phong", {"exponent": (2.0, 2000.0), "ks": (0.02, 0.5)}),
    ("ggx", {"alpha": (0.05, 0.6), "eta": (1.3, 10.0)}),
    ("oren-nayar", {}),
]


def made(seed: int) -> fm.Measurements:
    """Readings of a random material at random angles, with a random noise that is given or not."""
    rng = np.random.default_rng(seed)
    name, ranges = TRUTHS[seed % len(TRUTHS)]
    drawn: dict[str, Any] = {key: float(np.exp(rng.uniform(*np.log(limits)))) for key, limits in ranges.items()}
    theta_i = np.sort(rng.uniform(0, np.deg2rad(75), rng.integers(1, 5)))
    theta_o = np.linspace(-1.3, rng.uniform(0.3, 1.4), rng.integers(7, 60))
    noise = float(np.exp(rng.uniform(np.log(1e-3), np.log(0.2))))
    m = fm.simulate(
        fm.model(name, **drawn), theta_i, theta_o, relative_noise=noise, absolute_noise=noise * 0.05, seed=seed
    )
    return m if seed % 3 else dataclasses.replace(m, sigma=None)


def test_a_study_agrees_with_itself() -> None:
    assert contradictions(study(made(1), PAIR, sampling=False)) == []


@pytest.mark.study
@pytest.mark.parametrize("seed", range(2, 14))
def test_random_studies_agree_with_themselves(seed: int) -> None:
    assert contradictions(study(made(seed), PAIR, sampling=False)) == []


def test_identical_values_are_followed_by_nothing() -> None:
    theta_o = np.linspace(-1.2, 1.2, 30)
    m = fm.from_arrays(np.full(30, 0.5), theta_o, np.full(30, 0.2), sigma=np.full(30, 0.01))
    found = study(m, "lambert", sampling=False)
    assert found.findings[0].fit.adequacy == "adequacy unknown: all values are identical"
    assert contradictions(found) == []
