"""Rows: a study as flat rows, one for each model, with everything that a table of many files is asked for.

Computes nothing: a quantity's columns are NAME, NAME_sd, NAME_low, NAME_high, with the channel where it has its own.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from fitmat.errors import FitmatError, exhausted
from fitmat.match.match import Match
from fitmat.studies import record
from fitmat.studies.cards import best, cards
from fitmat.studies.findings import Findings
from fitmat.studies.study import Study
from fitmat.studies.swatches import swatch
from fitmat.text import plain
from fitmat.uncertainty.estimate import Estimate

CARDS, SWATCH = ("material", "phong", "trust"), "swatch"
"""Columns of the sentences, and what the table leaves to the page."""

REFUSED, FAILED = "refused", "failed"
"""Outcomes of a file that could not be read or fitted, and of one that fitmat stumbled over; `message` says why."""


def rows(study: Study) -> list[dict[str, Any]]:
    """One row for each model of a study, JSON types only."""
    named = None if study.choice is None else study.choice.candidates[0].name
    shared = {
        "outcome": "",
        "message": "",
        "n_samples": study.n_samples,
        "n_masked": study.n_masked,
        "channels": ", ".join(study.measurements.channels),
        "noise": study.findings[0].fit.noise.words,
        "warnings": " ".join(study.warnings),
    }
    match = {} if study.match is None else dict(_match(study.match))
    said = _cards(study)
    return [
        plain(shared | {"model": found.name, "best": named is None or found.name == named} | said | _one(found) | match)
        for found in study.findings
    ]


def _cards(study: Study) -> dict[str, Any]:
    """The three sentences that a page begins with, their levels, and the sphere beside them."""
    told = record.to_dict(study, short=True)
    found = {}
    for name, card in zip(CARDS, cards(told), strict=True):
        found |= {name: card.sentence, f"{name}_level": card.level}
    first = best(told)
    of = next((f for f in study.findings if first is not None and f.name == first["model"]), None)
    shown = None if of is None else swatch(of.fit.model, study.measurements.channels)
    return found | {SWATCH: shown}


def refused(error: FitmatError) -> list[dict[str, Any]]:
    """The row of a file that cannot be read or fitted."""
    return [{"outcome": REFUSED, "message": str(error)}]


def failed(error: BaseException) -> list[dict[str, Any]]:
    """The row of a file that fitmat stumbled over, or for which the machine had too little."""
    words = str(error).partition("\n")[0]
    ours = f"{type(error).__name__}: {words}. Please report it, with the file."
    return [{"outcome": FAILED, "message": exhausted(error) or ours}]


def _one(found: Findings) -> dict[str, Any]:
    fit = found.posterior.fit
    told = {
        "outcome": fit.result,
        "posterior": found.posterior.verdict,
        "adequacy": fit.adequacy,
        "misfit_over_noise": fit.misfit_ratio if fit.finite else None,
        "doubts": " ".join(found.doubts.words),
        "intervals_hold": found.doubts.intervals_hold,
        "aicc": fit.aicc,
        "bic": fit.bic,
    }
    for q in (*found.parameters, *found.derived):
        for k, name in enumerate(q.labels(fit.measurements.channels)):
            low, high = q.ci95[k]
            told |= {name: q.value[k], f"{name}_sd": q.sd[k], f"{name}_low": low, f"{name}_high": high}
            told |= {f"{name}_remark": q.remarks[k]}
    return told


def _match(match: Match) -> Iterator[tuple[str, Any]]:
    yield "match_verdict", match.verdict
    seen = match.perceived
    for name, found in (
        ("match_distance", match.hemisphere_distance),
        ("match_measured_distance", match.measured_distance),
        ("match_albedo_gap", match.albedo_gap_max),
        ("match_delta_e_2000", None if seen is None else seen.delta_e_2000.mean),
    ):
        yield from _estimate(name, found)
    yield "match_delta_bic", match.delta_bic


def _estimate(name: str, found: Estimate | None) -> Iterator[tuple[str, Any]]:
    if found is not None:
        yield name, float(found.value)
        yield f"{name}_low", float(found.ci95[0]) if found.has_interval else np.nan
        yield f"{name}_high", float(found.ci95[1]) if found.has_interval else np.nan
