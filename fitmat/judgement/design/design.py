"""Designs: which next measurement would tell most about a parameter, about all, or about which of two models is right.

It measures nothing and refits nothing: what it expects holds where the model does, with s as the fit found it. Where
the misfits of neighbours are alike, standard deviations are wider by the same factor before and after. A reading beside
others shares their misfit and tells the less (`filters.news`): were it told anew each time, a D-optimal choice under a
wrong model would repeat as many directions as there are parameters, and the fit would follow the surface nowhere else.
For "match" the misfit is what is asked for, and each reading tells of its own.

Each candidate is put to a bank of Kalman filters, one for each Gaussian of the `ridge` (the Gaussian sum of Alspach &
Sorenson, IEEE Trans. Automatic Control 17, 1972), with several points of the ridge taken for the truth in turn. What
is expected is averaged over these truths (Chaloner & Verdinelli, Statistical Science 10, 1995): one point would be
blind where a parameter is not determined, and random draws would miss what a narrow ridge becomes.
"""

import dataclasses
from typing import Literal

import numpy as np
from jaxtyping import Float

from fitmat import arguments
from fitmat.errors import FitmatError
from fitmat.fitting.result import Fit
from fitmat.judgement.design.candidates import Candidates, Limits, Measured, proposed
from fitmat.judgement.design.filters import Bank, Task, bank, scores, unmeasured
from fitmat.judgement.design.likeness import Likeness
from fitmat.measurements.noise import channel_laws
from fitmat.text import brief
from fitmat.uncertainty.posterior import Posterior

APART = 4.9
"""Proposals differ by more than this, in degrees; to take one again there are repeats."""

MATCH = "match"
"""The target that asks which of two models is right."""


MOST_STEPS = 8
"""So many measurements are planned at most: all steps share one program."""

ROOM = {"sample": 4096, "curve": 64}
"""Candidates that a program has room for, or twice as many and so on: instruments and lobes share it."""


@dataclasses.dataclass(frozen=True, eq=False)
class Proposal:
    """One next measurement.

    Attributes:
        theta_i: Incidence, radians.
        phi_i: Its azimuth, radians.
        theta_o: Signed, positive on the mirror side of the azimuth `phi`, radians, (m,).
        phi: Relative azimuth of positive theta_o, radians; π is the plane of incidence.
        repeats: How often each sample is taken.
        gain: By which factor the standard deviation shrinks in this step (the geometric mean over all combinations of
            parameters, or over the channels of one); for "match" how far the models are apart there, in standard
            deviations of what the worse of them predicts.
        sd: Of each free parameter after this step and those before it, natural, (f,).
        sd_if: The same for each truth, (t, f).
    """

    theta_i: float
    phi_i: float
    theta_o: Float[np.ndarray, " m"]
    phi: float
    repeats: int
    gain: float
    sd: Float[np.ndarray, " f"]
    sd_if: Float[np.ndarray, "t f"]

    __repr__ = brief


@dataclasses.dataclass(frozen=True, eq=False)
class Design:
    """The next measurements of a fitted material, the best first, each given those before it.

    Attributes:
        fit: What is known so far.
        rival: The other model, where the target is "match"; else None.
        target: Name of a parameter, "match", or None for all parameters.
        kind: "sample" or "curve".
        names: Of the free parameters, (f,).
        sd: Of each before any new measurement, natural (of ln p where the scale is log), (f,).
        truths: Free parameters, natural, that were taken for the truth in turn, (t, f).
        proposals: At least one.
        candidates: What was looked at.
        gains: Of each candidate as the first measurement, as `Proposal.gain`, (k,).
    """

    fit: Fit
    rival: Fit | None
    target: str | None
    kind: Measured
    names: tuple[str, ...]
    sd: Float[np.ndarray, " f"]
    truths: Float[np.ndarray, "t f"]
    proposals: tuple[Proposal, ...]
    candidates: Candidates
    gains: Float[np.ndarray, " k"]

    __repr__ = brief


def next_angles(
    posterior: Posterior,
    *,
    target: str | None = None,
    against: Posterior | None = None,
    kind: Literal["sample", "curve"] = "sample",
    count: int = 5,
    repeats: int = 1,
    limits: Limits | None = None,
) -> Design:
    """The next measurements that would shrink a parameter's standard deviation most, chosen one after the other.

    The noise of a candidate follows the law σ² = a² + (b f)² of the file, and the fit's discrepancy adds to it as it
    does in the fit. For one parameter the expected variance is minimised, for all of them the expected ln of the
    determinant of their covariance (Bayesian D-optimality). For "match" the expected squared difference of the two
    models is maximised, over the variance of what the one with more discrepancy predicts (noise, discrepancy and
    parameters together), as Box & Hill (Technometrics 9, 1967) weigh it, while the other counts as the truth. Repeats
    share one misfit, where the model has any.

    Args:
        posterior: Of a fit with at least one free parameter; only its fit is used.
        target: A parameter's name, "match", or None for all parameters.
        against: The posterior of the other model, for "match".
        kind: Whether to propose single samples or whole curves: one incidence with the theta_o of the file.
        count: How many measurements.
        repeats: How often each is taken.
        limits: What the instrument cannot do.

    Returns:
        A `Design`.

    Raises:
        FitmatError: the fit is not finite or has nothing free, the target is no free parameter, "match" lacks a second
            model, a number is below 1, or the limits leave nothing.

    Example:
        >>> next_angles(laplace(fit, seed=0), target="eta", count=2)  # doctest: +SKIP
    """
    arguments.kind("posterior", posterior, Posterior)
    arguments.kind("target", target, str, optional=True)
    arguments.kind("against", against, Posterior, optional=True)
    arguments.choice("kind", kind, ("sample", "curve"))
    arguments.whole("count", count, 1)
    arguments.whole("repeats", repeats, 1)
    arguments.kind("limits", limits, Limits, optional=True)
    fit, rival = posterior.fit, None if against is None else against.fit
    _refuse(fit, rival, target, (count, repeats))
    fits = (fit,) if rival is None or target != MATCH else (fit, rival)
    looked = proposed(fit, kind, limits or Limits())
    banks = tuple(bank(f) for f in fits)
    better = int(np.argmin([f.discrepancy for f in fits]))
    match = (better, 1 - better) if target == MATCH else None
    task = Task(_law(fit), np.asarray(float(repeats)), _wanted(fit, target), match)
    history: list[int] = []
    lone, likeness = np.where(looked.used, 0.0, -1.0), None if match else Likeness(fit, looked, repeats)
    past = np.full((MOST_STEPS, looked.used.shape[1]), -1.0)
    proposals: list[Proposal] = []
    gains = np.zeros(0)
    wider = np.sqrt(fit.correlation.inflation)
    before, start = unmeasured(banks[0], task)
    for _ in range(count):
        beside = lone if likeness is None else likeness.beside
        score, sd = _expected(banks, task, looked, (history, past, beside), ROOM[kind])
        score = np.where(looked.near(history, APART), -np.inf, score)
        gain = np.sqrt(np.maximum(score, 0.0)) if match else np.exp(score - before)
        best = int(np.argmax(score))
        proposals.append(_proposal(looked, best, repeats, float(gain[best]), wider * sd[best]))
        gains = gains if history else gain
        before = score[best]
        past[len(history)] = beside[best]
        if likeness is not None:
            likeness.take(best)
        history.append(best)
    truths = np.asarray(banks[0].centre)[np.asarray(banks[0].truths)]
    known = (fit, fits[-1] if match else None, target, kind, fit.coordinates.names, wider * start, truths)
    return Design(*known, tuple(proposals), looked, gains)


def _refuse(fit: Fit, rival: Fit | None, target: str | None, numbers: tuple[int, int]) -> None:
    for one in (fit, *([rival] if rival else [])):
        if not one.finite:
            raise FitmatError(f"{one.name}: the fit ended {one.result}, there is nothing to plan from; check the data.")
        if not len(one.free):
            raise FitmatError(f"{one.name}: every parameter is fixed, there is nothing to determine; free one.")
    if target != MATCH and rival is not None:
        raise FitmatError(f'against is given and target is {target!r}, expected "match" beside it. Leave it out.')
    if target == MATCH and rival is None:
        raise FitmatError("which model is right can be asked of two only: give a second model.")
    known = [*(e.name for e in fit.entries if e.name not in fit.held), *fit.coordinates.names]
    if target not in (None, MATCH, *known):
        raise FitmatError(f"{target!r} is no free parameter of {fit.name}: expected {', '.join(dict.fromkeys(known))}.")
    if min(numbers) < 1 or numbers[0] > MOST_STEPS:
        raise FitmatError(f"count {numbers[0]}, repeats {numbers[1]}: expected 1 to {MOST_STEPS}, and at least 1.")


def _wanted(fit: Fit, target: str | None) -> tuple[int, ...]:
    """Places of the target among the free parameters, every channel of it; () for all together."""
    owner = [e.name for e in fit.entries if e.name not in fit.held for _ in range(e.size)]
    return tuple(k for k, names in enumerate(zip(owner, fit.coordinates.names, strict=True)) if target in names)


def _law(fit: Fit) -> Float[np.ndarray, "2 c"]:
    """a and b of every channel."""
    return np.array([law or (1.0, 0.0) for law in channel_laws(fit.measurements, fit.noise)]).T


def _proposal(looked: Candidates, best: int, repeats: int, gain: float, sd_if: np.ndarray) -> Proposal:
    used = looked.used[best]
    place = (looked.theta_i[best], looked.phi_i[best], looked.theta_o[best][used], looked.phi[best])
    return Proposal(*place, repeats, gain, np.sqrt(np.mean(sd_if**2, axis=0)), sd_if)


def _expected(
    banks: tuple[Bank, ...],
    task: Task,
    looked: Candidates,
    taken: tuple[list[int], Float[np.ndarray, "h m"], Float[np.ndarray, "k m"]],
    room: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Score of every candidate after those of the history, (k,), and the sd it leaves for each truth, (k, t, f)."""
    wi, wo = looked.directions()
    history, past, beside = taken
    count = len(wi)
    while room < count:
        room *= 2
    rows = np.zeros(MOST_STEPS, int)
    rows[: len(history)] = history
    every = tuple(
        np.concatenate([part, np.tile(part[:1], (room - count, *[1] * (part.ndim - 1)))]) for part in (wi, wo, beside)
    )
    score, sd = scores(banks, task, every, np.asarray(count), (wi[rows], wo[rows], past))
    return np.asarray(score)[:count], np.asarray(sd)[:count]
