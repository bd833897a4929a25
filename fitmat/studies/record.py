"""The record of a study: everything the report holds, as JSON types.

It computes nothing; numbers that are not finite become null.
"""

import dataclasses
import functools
import platform
from importlib.metadata import version as installed
from typing import Any

import numpy as np

from fitmat.fitting.concluding import RESULTS
from fitmat.fitting.dispersed import law_of
from fitmat.fitting.quantities import UNDETERMINED, Quantity
from fitmat.fitting.result import Fit
from fitmat.judgement.budget import ALBEDO_DEG, COVERAGE, SOURCES, Budget, Line
from fitmat.judgement.choice.choice import Choice
from fitmat.judgement.identifiability.verdicts import Identifiability
from fitmat.judgement.predictive.check import PredictiveCheck
from fitmat.studies import match_record
from fitmat.studies.findings import Findings
from fitmat.studies.result import FORMAT, masking
from fitmat.studies.study import Study
from fitmat.text import plain

version = functools.cache(installed)
# Files of a batch ask for the same few.


def to_dict(study: Study, command: str | None = None, *, short: bool = False) -> dict[str, Any]:
    """What the report holds, as JSON types; numbers that are not finite become null.

    Args:
        study: What was found.
        command: By which it was asked for; None where it was not by one.
        short: Leave out what takes time and no card reads: of the choice all but the order, with the laws that models
            break; of what an eye sees all but ΔE2000 in all lights.
    """
    m, first = study.measurements, study.findings[0].fit
    return plain(
        {
            "format": FORMAT,
            "fitmat": version("fitmat"),
            "versions": {name: version(name) for name in ("jax", "numpy")} | {"Python": platform.python_version()},
            "file": m.source,
            "n_samples": study.n_samples,
            "n_masked": study.n_masked,
            "masked": m.masked,
            "notes": [*m.notes, *filter(None, [str(m.instrument)])],
            "noise": first.noise.words,
            "warnings": list(study.warnings),
            "loss": _loss_dict(first),
            "channels": list(m.channels),
            "full": study.full,
            "command": command,
            "fits": [fit_dict(found) for found in study.findings],
            "choice": None if study.choice is None else _choice_dict(study.choice, short),
            "match": None if study.match is None else match_record.to_dict(study.match, _line(study), short=short),
            "next": None if study.advice is None else dataclasses.asdict(study.advice),
        }
    )


def _loss_dict(fit: Fit) -> dict[str, Any]:
    loss, flat = fit.loss, fit.measurements.horizontal
    more = 0 if loss.posterior or flat is None else int(np.isfinite(flat).sum())
    left = fit.measurements.n_valid + more - fit.n_values
    words = f"{left} values left out: {loss.unusable}." if loss.usable is not None and left > 0 else ""
    counted = f"{more} values at θ_o = 90° count: {loss.name} takes no cosθ_o." if more > left else ""
    return {
        "name": loss.name,
        "formula": loss.formula,
        "source": loss.source,
        "posterior": loss.posterior,
        "left_out": " ".join(filter(None, (words, counted))),
    }


def _line(study: Study) -> dict[str, Any] | None:
    return None if study.distance is None else _line_dict(study.distance)


def fit_dict(found: Findings) -> dict[str, Any]:
    """What the record holds of one model."""
    posterior, fit, d = found.posterior, found.fit, found.posterior.diagnostics
    channels, check, opinion = len(fit.measurements.channels), found.check, found.second_opinion
    diagnosed = {"ess_min": None, "tail_ess_min": None, "rhat_max": None, "tau_max": None}
    if d is not None:
        diagnosed = {"ess_min": d.ess.min(), "tail_ess_min": d.tail_ess.min()}
        diagnosed |= {"rhat_max": d.rhat.max(), "tau_max": d.tau.max()}
        diagnosed |= {"acceptance": d.acceptance, "steps": d.steps, "burn_in": d.burn_in, "walkers": d.walkers}
        diagnosed |= {"seed": d.seed}
    return {
        "model": fit.name,
        "masking": masking(fit.model),
        "dispersion": law_of(fit.model),
        "result": fit.result,
        "result_means": RESULTS[fit.result],
        "adequacy": fit.adequacy,
        "misfit_ratio": fit.misfit_ratio if fit.noise.known and fit.finite else None,
        "doubts": list(found.doubts.words),
        "inadequate": found.doubts.inadequate,
        "intervals_hold": found.doubts.intervals_hold,
        "scope": found.scope,
        "several_facets": found.several_facets,
        "readings": {"fitted": fit.n_values, "independent": fit.correlation.independent},
        "not_determined": [q.name for q in found.parameters if UNDETERMINED in q.remarks],
        "n_starts": fit.n_starts,
        "n_starts_agreeing": fit.n_starts_agreeing,
        "steps": fit.steps,
        "parameters": {q.name: _quantity_dict(q, channels) for q in found.parameters},
        "derived": {q.name: _quantity_dict(q, channels) for q in found.derived},
        "budget": None if found.budget is None else _budget_dict(found.budget),
        "identifiability": None if found.identifiability is None else _identified_dict(found.identifiability),
        "priors": dict(found.priors),
        "learnt": [{"name": x.name, "prior": x.prior, "narrower": x.narrower} for x in found.learnt],
        "posterior": {
            "verdict": posterior.verdict,
            "interrupted": posterior.interrupted,
            "pareto_k": posterior.pareto_k,
            **diagnosed,
            "second_sampler": None if opinion is None else {"verdict": opinion.verdict, "words": opinion.words},
        },
        "predictive_check": None if check is None else _check_dict(check),
        "metrics": dict(found.metrics),
        "log_likelihood": fit.log_likelihood,
        "aicc": fit.aicc,
        "bic": fit.bic,
    }


def _identified_dict(found: Identifiability) -> dict[str, Any]:
    states = {
        v.name: {
            "state": v.state,
            "misfit": v.misfit,
            "value": v.value,
            "ci95": list(v.ci95),
            "open": list(v.open),
            "contraction": v.contraction,
            "narrower": v.narrower,
        }
        for v in found.verdicts
    }
    return {"words": found.words, "parameters": states}


def _check_dict(found: PredictiveCheck) -> dict[str, Any]:
    every = [
        {
            "name": s.name,
            "place": s.place,
            "observed": s.observed,
            "expected": list(s.expected),
            "p": s.p,
            "surprising": s.surprising,
        }
        for s in found.statistics
    ]
    return {"failed": bool(found.failed), "words": found.words, "statistics": every}


def _choice_dict(choice: Choice, short: bool) -> dict[str, Any]:
    if short:
        return {"candidates": [{"model": c.name} for c in choice.candidates]}
    candidates = [
        {
            "model": c.name,
            "aicc": c.fit.aicc,
            "bic": c.fit.bic,
            "elpd": None if c.evidence is None else c.evidence.elpd,
            "elpd_se": None if c.evidence is None else c.evidence.se,
            "p_loo": None if c.evidence is None else c.evidence.p_loo,
            "behind": c.behind,
            "behind_se": c.behind_se,
            "clearly_behind": c.clearly_behind,
            "left_out_error": None if c.left_out is None else c.left_out.error,
            "left_out_surprise": None if c.left_out is None else c.left_out.surprise,
            "broken_laws": list(c.broken),
            "doubts": list(c.doubts),
            "reliable": c.reliable,
        }
        for c in choice.candidates
    ]
    return {"verdict": choice.verdict, "candidates": candidates}


def _quantity_dict(q: Quantity, channels: int) -> dict[str, Any]:
    """Scalars for shared quantities and single-channel files, else lists in channel order."""
    scalar = not q.per_channel or channels == 1
    value, sd, ci95, remark = ((a[0] if scalar else a) for a in (q.value, q.sd, q.ci95, q.remarks))
    told = {"value": value, "sd": sd, "ci95": ci95, "unit": q.unit, "symbol": q.symbol, "remark": remark, "doc": q.doc}
    return told


def _budget_dict(found: Budget) -> dict[str, Any]:
    return {
        "words": found.words,
        "coverage_factor": COVERAGE,
        "sources": SOURCES,
        "albedo_theta_i_deg": ALBEDO_DEG,
        "unstated": found.unstated,
        "quantities": {line.name: _line_dict(line) for line in found.lines},
        "correlation": found.correlation,
    }


def _line_dict(line: Line) -> dict[str, Any]:
    return {
        "value": line.value,
        "unit": line.unit,
        "remark": line.remark,
        "words": line.words,
        "parts": line.parts,
        "u": line.combined,
        "U": line.expanded,
    }
