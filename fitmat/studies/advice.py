"""Advice: the one next angle worth measuring, where something of the material is not known and an angle would tell.

It finds none itself, `judgement.design` does, and it is silent where the model misses the data: a design trusts it.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from fitmat.judgement.choice.choice import Choice
from fitmat.judgement.design.candidates import Limits
from fitmat.judgement.design.design import MATCH, next_angles
from fitmat.judgement.identifiability.verdicts import STATES
from fitmat.match.match import Match
from fitmat.studies.findings import Findings

WORTH = 1.1
"""An angle is named from this factor on by which the standard deviation of a parameter shrinks."""

WORTH_APART = 2.0
"""The same of two models: standard deviations between them."""

MOST_CHANNELS = 4
"""Above, looking for it takes longer than it tells at first sight: `fitmat design` does it."""


@dataclasses.dataclass(frozen=True)
class Advice:
    """One curve to measure next: an incidence, and a scan of the sensor as the file has it.

    Attributes:
        target: What it tells: a parameter of `model`, or `MATCH`.
        model: The model that it is planned with.
        against: The other model, where the target is the match; else None.
        theta_i_deg: Incidence.
        phi_i_deg: Its azimuth.
        theta_o_deg: First and last angle of the sensor, signed, positive on the mirror side of the azimuth `phi_deg`.
        phi_deg: Relative azimuth of positive theta_o; 180 is the plane of incidence.
        gain: By which factor the standard deviation is expected to shrink; of the match, how many standard deviations
            the models are apart there.
    """

    target: str
    model: str
    against: str | None
    theta_i_deg: float
    phi_i_deg: float
    theta_o_deg: tuple[float, float]
    phi_deg: float
    gain: float


def advise(findings: Sequence[Findings], match: Match | None, choice: Choice | None) -> Advice | None:
    """The curve that would tell most of what is known worst of the material, or which of two models is right.

    Args:
        findings: Of every model.
        match: Of two of them, if there is one.
        choice: Which the data prefer, if that was asked.

    Returns:
        None where everything is determined and decided, where no single curve would tell enough (`WORTH`,
        `WORTH_APART`), where the model misses the data, or of more than `MOST_CHANNELS` channels.
    """
    found = _standing(findings, match, choice)
    if found is None or found.doubts.inadequate or len(found.fit.measurements.channels) > MOST_CHANNELS:
        return None
    if (target := _known_worst(found)) is not None:
        return _planned(found, target, None, WORTH)
    rival = _undecided(findings, found, match, choice)
    return None if rival is None else _planned(found, MATCH, rival, WORTH_APART)


def _standing(findings: Sequence[Findings], match: Match | None, choice: Choice | None) -> Findings | None:
    """The model that stands for the material, as `cards.best` has it."""
    finite = {found.name: found for found in findings if found.fit.finite and found.fit.loss.posterior}
    ranked = [] if choice is None else [candidate.name for candidate in choice.candidates]
    ranked += [] if match is None else [match.microfacet.fit.name]
    return next((finite[name] for name in (*ranked, *finite) if name in finite), None)


def _known_worst(found: Findings) -> str | None:
    """The parameter, of all its channels, that these angles determine least; None where they determine all."""
    asked = found.identifiability
    open_ = [] if asked is None else [v for v in asked.verdicts if v.state != STATES[0] and not v.misfit]
    if not open_:
        return None
    worst = max(open_, key=lambda v: (STATES.index(v.state), -v.contraction))
    names = (e.name for e in found.fit.entries)
    return next(name for name in names if worst.name == name or worst.name.startswith(f"{name} "))


def _undecided(
    findings: Sequence[Findings], found: Findings, match: Match | None, choice: Choice | None
) -> Findings | None:
    """The other model of the match, where the data leave open which is right and none misses them."""
    if match is None or choice is None:
        return None
    pair, equals = (match.microfacet, match.empirical), [c.posterior for c in choice.equals]
    if found.posterior not in pair or not all(posterior in equals for posterior in pair):
        return None
    other = next(f for f in findings if f.posterior in pair and f is not found)
    return None if other.doubts.inadequate or not len(other.fit.free) else other


def _planned(found: Findings, target: str, rival: Findings | None, worth: float) -> Advice | None:
    limits = Limits(in_plane=bool(found.fit.measurements.in_plane.all()))
    asked: dict[str, Any] = {"target": target, "against": None if rival is None else rival.posterior}
    first = next_angles(found.posterior, kind="curve", count=1, limits=limits, **asked).proposals[0]
    if not first.gain >= worth:
        return None
    theta_i, phi_i, low, high, phi = (
        round(float(np.rad2deg(angle)), 1)
        for angle in (first.theta_i, first.phi_i, first.theta_o.min(), first.theta_o.max(), first.phi)
    )
    against = None if rival is None else rival.name
    return Advice(target, found.name, against, theta_i, phi_i, (low, high), phi, first.gain)
