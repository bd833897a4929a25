"""The headline of a match: plain sentences first, numbers in them, the thresholds that chose the words beside them.

It measures nothing and decides nothing that a named threshold does not.
"""

import bisect
import math

from fitmat.match.ablation import TERMS, Ablation
from fitmat.match.discernibility import SEPARATED, Telling
from fitmat.match.distances import WITHIN
from fitmat.match.regions import GRAZING_DEG
from fitmat.uncertainty.estimate import Estimate

CLOSE, SIMILAR = 0.1, 0.3
"""Distances up to which the verdict says "hardly differ" and "differ moderately"."""

STRONG_EVIDENCE = 10.0
"""ΔBIC from which the data clearly prefer one model (Kass & Raftery 1995: "very strong")."""

MENTIONED = 0.05
"""A loss or gain beyond `regions.GRAZING_DEG` is mentioned from this fraction on, where its interval excludes 0."""

Names = tuple[str, str]
"""Of the empirical and the microfacet lobe."""


def distance_sentence(names: Names, measured: Estimate, whole: Estimate, beyond: float) -> str:
    """How far apart the two are where they were measured, and over the hemisphere.

    Args:
        names: Of the two.
        measured: Relative distance at the incidences measured.
        whole: The same over the hemisphere.
        beyond: Fraction of the whole that lies at incidences beyond those measured.
    """
    over = f"Over the whole hemisphere it is {_percent(whole)}"
    rests = f", of which {100 * beyond:.0f} % rests on incidences beyond those measured" if beyond >= MENTIONED else ""
    apart = _percent(measured, "apart at the incidences measured")
    return f"{' and '.join(names)} {_differ(measured)}: {apart}. {over}{rests}."


def _differ(distance: Estimate) -> str:
    """What the interval, or without one the value, is called; from one word to another where it holds several."""
    ends = distance.ci95 if distance.has_interval else (distance.value, distance.value)
    low, high = (bisect.bisect_right((CLOSE, SIMILAR), end) for end in ends)
    words = ("hardly differ", "differ moderately", "differ strongly")
    return words[low] if low == high else f"{words[low]} or {words[high]}, which the data leave open"


def _percent(distance: Estimate, apart: str = "") -> str:
    low, high = (100 * x for x in distance.ci95)
    words = f"{100 * distance.value:.0f} %{f' {apart}' if apart else ''}"
    return f"{words} (95 % interval {low:.0f}–{high:.0f} %)" if distance.has_interval else words


def telling_sentence(names: Names, telling: Telling) -> str | None:
    """Up to which incidence the instrument cannot tell the two apart, and what would; None where noise is unknown."""
    if not telling.known:
        return None
    alike, hidden, last = telling.alike_up_to_deg, telling.hidden_up_to_deg, float(telling.theta_i_deg[-1])
    if telling.every.value < SEPARATED:
        times = telling.repeats_needed.value
        return f"These measurements cannot tell them apart; that would take {_times(times)} as many readings."
    if alike == last:
        return "Only all incidences together tell them apart, no single one does."
    if alike is not None:
        return f"Up to {alike:.0f}° incidence this instrument cannot tell {names[0]} from {names[1]}, beyond it can."
    if hidden == last:
        return "Everywhere their difference is within the noise of a single reading, but all readings tell them apart."
    if hidden is not None:
        return (
            f"Up to {hidden:.0f}° incidence their difference is within the noise of a single reading, beyond it shows."
        )
    return "This instrument tells them apart at every incidence measured."


def grazing_sentence(names: Names, excess: Estimate, ablation: Ablation | None) -> str | None:
    """How much light from grazing incidence is missing or too much, and why; None where it is little or not certain."""
    if not grazing_matters(excess):
        return None
    low, high = sorted(abs(100 * x) for x in excess.ci95)
    side = "less" if excess.value < 0 else "more"
    causes = ablation.causes(ablation.grazing) if ablation is not None else ()
    why = f": it has {' and '.join(TERMS[cause] for cause in causes)}" if causes else ""
    return (
        f"Beyond {GRAZING_DEG:.0f}° {names[0]} reflects {abs(100 * excess.value):.0f} % {side} than {names[1]}"
        + (f" ({low:.0f}–{high:.0f} %)" if excess.has_interval else "")
        + f"{why}."
    )


def grazing_matters(excess: Estimate) -> bool:
    """Whether so much light from grazing incidence is missing or too much that it is said."""
    return abs(excess.value) >= MENTIONED and excess.ci95[0] * excess.ci95[1] > 0


def gap_sentence(names: Names, gap: Estimate, sign: int, theta_i_deg: float, measured_deg: tuple[float, float]) -> str:
    """The largest difference of the albedos, where it is, and whether that is an extrapolation."""
    side = "less" if sign < 0 else "more"
    near = math.degrees(WITHIN)
    within = measured_deg[0] - near <= theta_i_deg <= measured_deg[1] + near
    where = f"At {theta_i_deg:.0f}° incidence{'' if within else ', which is extrapolated,'}"
    return f"{where} {names[0]} reflects {100 * gap.value:.1f} % of the light {side} than {names[1]}" + (
        f" ({100 * gap.ci95[0]:.1f}–{100 * gap.ci95[1]:.1f} %)." if gap.has_interval else "."
    )


def evidence_sentence(names: Names, delta_bic: float) -> str:
    """Which of the two the data prefer; nothing where the loss is an objective, which weighs no models."""
    if math.isnan(delta_bic):
        return ""
    if abs(delta_bic) < STRONG_EVIDENCE:
        return f"The data do not decide between them (ΔBIC {delta_bic:.0f})."
    return f"The data clearly prefer {names[1] if delta_bic > 0 else names[0]} (ΔBIC {abs(delta_bic):.0f})."


def _times(factor: float) -> str:
    return f"{factor:.2g} times" if factor < 1000 else "over a thousand times"
