"""The record of a match: what the report holds of it, as plain types and arrays.

It computes nothing.
"""

from typing import Any

from fitmat.match.ablation import TERMS, Ablation
from fitmat.match.appearance.spheres import Perceived
from fitmat.match.appearance.spread import Spread
from fitmat.match.discernibility import Telling
from fitmat.match.match import Match
from fitmat.match.regions import GRAZING_DEG
from fitmat.uncertainty.estimate import Estimate


def estimate(e: Estimate | None) -> dict[str, Any] | None:
    """Value and interval; no interval where no draws spread about the value."""
    return None if e is None else {"value": e.value, "ci95": list(e.ci95) if e.has_interval else None}


def to_dict(match: Match, budget: dict[str, Any] | None, *, short: bool = False) -> dict[str, Any]:
    """What the report holds of a match.

    Args:
        match: What was found.
        budget: Of its distance, where there is one.
        short: As `record.to_dict` has it.
    """
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
        "budget": budget,
        "beyond": match.distances.beyond,
        "serves_up_to_deg": match.serves_up_to_deg,
        "measured_deg": list(match.incidence_range_deg),
        "grazing_excess": estimate(match.distances.grazing_excess),
        "causes": None if match.ablation is None else _causes_dict(match.ablation),
        "cannot_be_told_apart_up_to_deg": match.telling.alike_up_to_deg,
        "hidden_up_to_deg": match.telling.hidden_up_to_deg,
        "telling": _telling_dict(match.telling) if match.telling.known else None,
        "imitations": [
            {
                "of": i.of,
                "by": i.model.name,
                "metric": i.metric,
                "parameters": i.parameters,
                "distance": i.distance,
                "converged": i.converged,
            }
            for i in match.imitations
        ],
        "perceived": None if match.perceived is None else _perceived_dict(match.perceived, short),
        "verdict": match.verdict,
    }


def _causes_dict(found: Ablation) -> dict[str, Any]:
    """Term → by how much the distance falls without it, near the normal and at grazing incidence."""
    parts = {"near": found.near, "grazing": found.grazing}
    return {
        "grazing_deg": GRAZING_DEG,
        "means": TERMS,
        **{name: {term: estimate(e) for term, e in part.items()} for name, part in parts.items()},
        **{f"{name}_named": list(found.causes(part)) for name, part in parts.items()},
    }


def _telling_dict(found: Telling) -> list[dict[str, Any]]:
    """What the instrument sees of the difference, a line for each incidence."""
    return [
        {
            "theta_i_deg": angle,
            "readings": found.readings[k],
            "rms": found.rms[:, k],
            "beyond": found.beyond[1, k],
            "separation": found.separation[:, k],
            "repeats": found.repeats[1, k],
        }
        for k, angle in enumerate(found.theta_i_deg)
    ]


def _perceived_dict(seen: Perceived, short: bool) -> dict[str, Any]:
    def difference(found: Spread) -> dict[str, Any]:
        parts = {"mean": found.mean, "worst_twentieth": found.worst_twentieth, "largest": found.largest}
        return {name: {"value": e.value, "ci95": list(e.ci95)} for name, e in parts.items()} | {"rule": found.rule}

    if short:
        return {"delta_e_2000": difference(seen.delta_e_2000)}
    return {
        "words": seen.words,
        "colours": seen.colours,
        "delta_e_2000": difference(seen.delta_e_2000),
        "delta_e_itp": difference(seen.delta_e_itp),
        "lightings": {
            x.name: {"delta_e_2000": difference(x.delta_e_2000), "delta_e_itp": difference(x.delta_e_itp)}
            for x in seen.lightings
        },
    }
