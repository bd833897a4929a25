"""Rows: a study as flat rows, one for each model, with everything that a table of many files is asked for.

Computes nothing: a quantity's columns are NAME, NAME_sd, NAME_low, NAME_high, with the channel where it has its own.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from fitmat.errors import FitmatError
from fitmat.match.match import Match
from fitmat.studies.findings import Findings
from fitmat.studies.study import Study
from fitmat.text import plain
from fitmat.uncertainty.estimate import Estimate

REFUSED, FAILED = "refused", "failed"
"""Outcomes of a file that could not be read or fitted, and of one that fitmat stumbled over; `message` says why."""


def rows(study: Study) -> list[dict[str, Any]]:
    """One row for each model of a study, JSON types only."""
    best = None if study.choice is None else study.choice.candidates[0].name
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
    return [
        plain(shared | {"model": found.name, "best": best is None or found.name == best} | _one(found) | match)
        for found in study.findings
    ]


def refused(error: FitmatError) -> list[dict[str, Any]]:
    """The row of a file that cannot be read or fitted."""
    return [{"outcome": REFUSED, "message": str(error)}]


def failed(error: BaseException) -> list[dict[str, Any]]:
    """The row of a file that fitmat stumbled over."""
    words = str(error).partition("\n")[0]
    return [{"outcome": FAILED, "message": f"{type(error).__name__}: {words}. Please report it, with the file."}]


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
        for k in range(len(q.value)):
            name = f"{q.name} {fit.measurements.channels[k]}" if q.per_channel and len(q.value) > 1 else q.name
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
