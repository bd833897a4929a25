"""The record of a study: everything the report holds, as JSON types.

It computes nothing; numbers that are not finite become null.
"""

from importlib.metadata import version
from typing import Any

from fitmat.fitting.concluding import RESULTS
from fitmat.fitting.quantities import UNDETERMINED, Quantity
from fitmat.judgement.budget import ALBEDO_DEG, COVERAGE, SOURCES, Budget, Line
from fitmat.judgement.choice import Choice
from fitmat.judgement.identifiability.verdicts import Identifiability
from fitmat.match.appearance.spheres import Perceived, Spread
from fitmat.match.match import Match
from fitmat.studies.findings import Findings
from fitmat.studies.result import FORMAT, masking
from fitmat.studies.study import Study
from fitmat.text import plain
from fitmat.uncertainty.estimate import Estimate


def to_dict(study: Study) -> dict[str, Any]:
    """What the report holds, as JSON types; numbers that are not finite become null."""
    m, first = study.measurements, study.findings[0].fit
    return plain(
        {
            "format": FORMAT,
            "fitmat": version("fitmat"),
            "file": m.source,
            "n_samples": study.n_samples,
            "n_masked": study.n_masked,
            "masked": m.masked,
            "notes": [*m.notes, *filter(None, [str(m.instrument)])],
            "noise": first.noise.words,
            "warnings": list(study.warnings),
            "loss": {"name": first.loss.name, "formula": first.loss.formula, "posterior": first.loss.posterior},
            "channels": list(m.channels),
            "fits": [_fit_dict(found) for found in study.findings],
            "choice": None if study.choice is None else _choice_dict(study.choice),
            "match": None if study.match is None else _match_dict(study.match, study.distance),
        }
    )


def _fit_dict(found: Findings) -> dict[str, Any]:
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
        "result": fit.result,
        "result_means": RESULTS[fit.result],
        "adequacy": fit.adequacy,
        "doubts": list(found.doubts.words),
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
        "posterior": {
            "verdict": posterior.verdict,
            "interrupted": posterior.interrupted,
            "pareto_k": posterior.pareto_k,
            **diagnosed,
            "second_sampler": None if opinion is None else {"verdict": opinion.verdict, "words": opinion.words},
        },
        "predictive_check": None if check is None else {"failed": bool(check.failed), "words": check.words},
        "metrics": dict(found.metrics),
        "log_likelihood": fit.log_likelihood,
        "aicc": fit.aicc,
        "bic": fit.bic,
    }


def _identified_dict(found: Identifiability) -> dict[str, Any]:
    states = {v.name: {"state": v.state, "ci95": list(v.ci95), "contraction": v.contraction} for v in found.verdicts}
    return {"words": found.words, "parameters": states}


def _choice_dict(choice: Choice) -> dict[str, Any]:
    candidates = [
        {
            "model": c.name,
            "aicc": c.fit.aicc,
            "bic": c.fit.bic,
            "elpd": None if c.evidence is None else c.evidence.elpd,
            "behind": c.behind,
            "behind_se": c.behind_se,
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
    return {"value": value, "sd": sd, "ci95": ci95, "unit": q.unit, "symbol": q.symbol, "remark": remark}


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
        "parts": line.parts,
        "u": line.combined,
        "U": line.expanded,
    }


def _match_dict(match: Match, distance: Line | None) -> dict[str, Any]:
    def estimate(e: Estimate | None) -> dict[str, Any] | None:
        return None if e is None else {"value": e.value, "ci95": list(e.ci95) if e.has_interval else None}

    return {
        "empirical": match.empirical.fit.name,
        "microfacet": match.microfacet.fit.name,
        "hemisphere_distance": estimate(match.hemisphere_distance),
        "measured_distance": estimate(match.measured_distance),
        "cube_root_distance": estimate(match.cube_root_distance),
        "albedo_gap_max": {
            **(estimate(match.albedo_gap_max) or {}),
            "theta_i_deg": match.albedo_gap_theta_i_deg,
            "sign": match.albedo_gap_sign,
        },
        "implied_exponent": estimate(match.implied_exponent),
        "fitted_exponent": estimate(match.fitted_exponent),
        "fitted_alpha": estimate(match.fitted_alpha),
        "implied_alpha": estimate(match.implied_alpha),
        "width_ratio": estimate(match.width_ratio),
        "delta_aicc": match.delta_aicc,
        "delta_bic": match.delta_bic,
        "distances": {
            name: {
                "all": estimate(whole),
                "regions": {r: estimate(e) for r, e in match.distances.by_region[name].items()},
                "share": {r: estimate(e) for r, e in match.distances.share[name].items()},
            }
            for name, whole in match.distances.whole.items()
        },
        "budget": None if distance is None else _line_dict(distance),
        "cannot_be_told_apart_up_to_deg": match.telling.alike_up_to_deg,
        "imitations": [
            {"of": i.of, "by": i.model.name, "metric": i.metric, "parameters": i.parameters, "distance": i.distance}
            for i in match.imitations
        ],
        "perceived": None if match.perceived is None else _perceived_dict(match.perceived),
        "verdict": match.verdict,
    }


def _perceived_dict(seen: Perceived) -> dict[str, Any]:
    def difference(found: Spread) -> dict[str, Any]:
        parts = {"mean": found.mean, "worst_twentieth": found.worst_twentieth, "largest": found.largest}
        return {name: {"value": e.value, "ci95": list(e.ci95)} for name, e in parts.items()}

    return {
        "words": seen.words,
        "delta_e_2000": difference(seen.delta_e_2000),
        "delta_e_itp": difference(seen.delta_e_itp),
        "lightings": {x.name: {"delta_e_2000": difference(x.delta_e_2000)} for x in seen.lightings},
    }
