"""The choice of a model: what the data say of each of several, what it predicts, and whether it can be true.

It fits no parameter and draws nothing: everything rests on posteriors. It chooses among what it is given, and that the
best of them is good enough is for `predictive_check` to say.
"""

import dataclasses
import functools
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from fitmat import arguments
from fitmat.errors import FitmatError
from fitmat.fitting.result import Fit
from fitmat.judgement.choice.evidence import Evidence, weigh
from fitmat.judgement.choice.left_out import LeftOut, leave_incidences_out
from fitmat.judgement.plausibility import broken_laws, doubts
from fitmat.measurements.samples import Measurements
from fitmat.models.registry import LOBES
from fitmat.text import brief, html_table, text_table
from fitmat.uncertainty.posterior import Posterior

SMALL, SURE = 4.0, 2.0
"""A difference of elpd is clear from 4 on and beyond 2 standard errors (Sivula, Magnusson, Matamoros & Vehtari 2020:
below 4 it is small, and its standard error too short)."""

FEW_BAD = 0.01
"""Share of values with a k̂ above `GOOD_PARETO` from which the elpd is said to be unreliable."""

WHOLE = ("plastic", "disney-2012", "disney-2015")
"""Lobes that hold a diffuse part of their own."""

OTHER_FRESNELS = ("lambert+ggx-schlick", "lambert+ggx-conductor")
"""The Fresnel terms that `every_model` tries beside the dielectric one: the common shortcut, and metals."""


@dataclasses.dataclass(frozen=True, eq=False)
class Candidate:
    """One model of a choice.

    Attributes:
        posterior: Of its fit.
        evidence: By leaving out single values; None where there are too many.
        behind: By how much its elpd is below the highest; NaN where it has none.
        behind_se: Standard error of that difference.
        left_out: Errors of whole incidences that were left out; None where there is only one.
        doubts: What else speaks against its parameters, in words.
    """

    posterior: Posterior
    evidence: Evidence | None
    behind: float
    behind_se: float
    left_out: LeftOut | None
    doubts: tuple[str, ...]

    __repr__ = brief

    @functools.cached_property
    def broken(self) -> tuple[str, ...]:
        """Laws that it breaks, in words."""
        return broken_laws(self.fit)

    @property
    def name(self) -> str:
        """The model's."""
        return self.posterior.fit.name

    @property
    def fit(self) -> Fit:
        """Its fit."""
        return self.posterior.fit

    @property
    def weighed(self) -> bool:
        """Whether there is a number by which it stands among the others."""
        return bool(np.isfinite(self.behind))

    @property
    def clearly_behind(self) -> bool:
        """Whether the data prefer the best by more than chance."""
        return self.behind > max(SMALL, SURE * self.behind_se)

    @property
    def reliable(self) -> bool:
        """Whether its elpd can be relied on."""
        return self.weighed and self.evidence is not None and self.evidence.bad <= FEW_BAD and self.posterior.exact


@dataclasses.dataclass(frozen=True, eq=False)
class Choice:
    """Several models of the same measurements, the best first.

    Attributes:
        candidates: First those that are not clearly behind, the fewest parameters first: the data do not ask for more
            (the rule of one standard error: Breiman, Friedman, Olshen & Stone 1984, sec. 3.4.3). Then the others by
            elpd, where any has one, else by AICc; those without such a number are not weighed and come last.
    """

    candidates: tuple[Candidate, ...]

    __repr__ = brief

    @property
    def best(self) -> Candidate:
        """The model that the data prefer, be it by little."""
        return self.candidates[0]

    @property
    def equals(self) -> tuple[Candidate, ...]:
        """The best and whatever is not clearly behind it."""
        return tuple(c for c in self.candidates if c is self.best or (c.weighed and not c.clearly_behind))

    @property
    def verdict(self) -> str:
        """Which model the data prefer, whether by enough, and what to know before taking it."""
        sentences = [self._preferred()]
        predicting = [c for c in self.candidates if c.left_out is not None]
        if len(predicting) > 1:
            sure = min(predicting, key=lambda c: c.left_out.error if c.left_out else np.inf)
            assert sure.left_out is not None
            promised = sure.left_out.surprise
            sentences.append(
                f"An angle of incidence that was left out is predicted best by {sure.name} (cube-root error "
                f"{sure.left_out.error:.2g}"
                + (f", {promised:.2g} × what noise and misfit promise)." if np.isfinite(promised) else ").")
            )
        if self.best.broken:
            sentences.append(f"But {self.best.name} {' and '.join(self.best.broken)}.")
            lawful = next((c for c in self.candidates if not c.broken), None)
            if lawful is not None:
                sentences.append(f"The best of those that break no law is {lawful.name}.")
        if self.best.doubts:
            sentences.append(f"Of {self.best.name}: {'; '.join(self.best.doubts)}.")
        shaky = [c.name for c in self.equals if c.evidence is not None and not c.reliable]
        if lost := [c.name for c in self.candidates if not c.weighed]:
            sentences.append(f"Not weighed: {', '.join(lost)}, of which what it predicts is not a number.")
        if shaky:
            sentences.append(
                f"The comparison is rough for {', '.join(shaky)}: {'its' if len(shaky) == 1 else 'their'} draws do not "
                "carry over to data with a value less."
            )
        return " ".join(sentences)

    def _preferred(self) -> str:
        equals, rest = self.equals, [c for c in self.candidates if c.clearly_behind]
        if len(self.candidates) == 1:
            return f"{self.best.name} is the only model that was tried."
        if len(equals) == 1 and not rest:
            return "No model could be weighed." if not self.best.weighed else f"Only {self.best.name} could be weighed."
        by = "elpd" if self.best.evidence is not None else "half of AICc"
        if len(equals) > 1:
            names = [c.name for c in equals]
            shown = ", ".join(names[:-1]) + f" and {names[-1]}"
            tail = f"; {rest[0].name} follows clearly behind ({rest[0].behind:.0f})" if rest else ""
            return f"The data do not decide between {shown} ({by} within {max(c.behind for c in equals):.1f}){tail}."
        follows = rest[0]
        error = f" ± {follows.behind_se:.0f}" if follows.behind_se > 0 else ""
        return (
            f"The data prefer {self.best.name}, and clearly: {follows.name}, the next, is behind by "
            f"{follows.behind:.0f}{error} ({by})."
        )

    def _whole(self, candidate: Candidate) -> str:
        """By how much its elpd of incidences left out differs from the first one's, with the error over incidences."""
        one, first = candidate.left_out, self.best.left_out
        if one is None or first is None or not np.isfinite(one.elpd - first.elpd).all():
            return ""
        apart = one.elpd - first.elpd
        error = float(np.sqrt(len(apart)) * apart.std(ddof=1))
        return "0" if candidate is self.best else f"{apart.sum():.1f} ± {error:.1f}"

    def _rows(self) -> list[tuple[str, ...]]:
        return [
            (
                c.name,
                f"{c.fit.aicc:.1f}",
                f"{c.fit.bic:.1f}",
                "" if c.evidence is None or not c.weighed else f"{c.evidence.elpd:.1f} ± {c.evidence.se:.1f}",
                "not weighed" if not c.weighed else "0" if c.behind == 0 else f"{-c.behind:.1f} ± {c.behind_se:.1f}",
                "" if c.evidence is None or not c.weighed else f"{c.evidence.p_loo:.1f}",
                "" if c.left_out is None else f"{c.left_out.error:.3g}",
                "" if c.left_out is None else f"{c.left_out.surprise:.2g}",
                self._whole(c),
                "; ".join((*c.broken, *c.doubts)),
            )
            for c in self.candidates
        ]

    def __str__(self) -> str:
        """The verdict, then a line for each model."""
        return text_table(self.verdict, self._rows())

    def _repr_html_(self) -> str:
        headings = ("model", "AICc", "BIC", "elpd", "to the highest", "p_loo", "incidence left out", "as z",
            "its elpd to the first", "remarks")  # fmt: skip
        return html_table(self.verdict, headings, self._rows())


def every_model(measurements: Measurements | None = None) -> tuple[str, ...]:
    """What to try where nothing is known of a material: every lobe that stands for a surface of its own.

    Diffuse lobes and those with a diffuse part of their own stand alone, the others on a Lambert base; the Fresnel
    term is each lobe's default, beside `OTHER_FRESNELS`. Anisotropic lobes are tried only where the sample was turned
    or seen out of the plane: else their second width is not determined. Of the two forms of compensation `-kc` is
    tried: `-turquin` stands for the same surface.

    Args:
        measurements: What will be fitted; None for all.
    """
    m = measurements
    arguments.kind("measurements", m, Measurements, optional=True)
    turned = m is None or not bool(m.in_plane.all()) or bool(np.ptp(m.phi_i) > 0)
    names = []
    for name, lobe in LOBES.items():
        parts = name.split("-")
        again = "turquin" in parts or ("aniso" in parts and not turned)
        if lobe.kind == "cover" or lobe.fresnel_suffix(name) or again:
            continue
        names.append(name if lobe.kind == "diffuse" or name in WHOLE else f"lambert+{name}")
    return (*names, *OTHER_FRESNELS, "rough-varnish-over-lambert")


def choose(posteriors: Sequence[Posterior], *, predicting: bool = True, singly: bool = True) -> Choice:
    """Weigh several models of the same measurements.

    AICc and BIC charge for each parameter at the optimum. The elpd (Vehtari, Gelman & Gabry 2017) is what the
    posterior predicts of values that it has not seen, one at a time; its differences have pointwise standard errors.
    Beside it stand the errors of whole incidences that were left out, the laws of reflection that a model breaks, and
    parameters on a bound or not determined.

    Args:
        posteriors: By `chains.sample`, or `laplace.laplace`; models whose fit is not finite are left out.
        predicting: Whether to refit without each incidence.
        singly: Whether to ask for the elpd; else AICc decides.

    Raises:
        FitmatError: nothing is finite, or fits differ in measurements or loss.
    """
    arguments.kind("posteriors", posteriors, Sequence)
    arguments.flags(predicting=predicting, singly=singly)
    for posterior in posteriors:
        arguments.kind("one of posteriors", posterior, Posterior)
    usable = [p for p in posteriors if p.fit.finite]
    if not usable:
        raise FitmatError("no fit is finite, there is nothing to choose from; check the data.")
    first = usable[0].fit
    for fit in (p.fit for p in usable):
        if fit.measurements is not first.measurements or fit.loss is not first.loss:
            raise FitmatError(
                f"{fit.name} and {first.name}: a choice needs fits to the same Measurements object under the same loss."
            )
    if not first.loss.posterior:
        raise FitmatError(
            f"the loss {first.loss.name} is no likelihood, so that it weighs no models; try --loss default."
        )
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        weighed = pool.map(lambda p: weigh(p) if singly else None, usable)
        left = pool.map(lambda p: leave_incidences_out(p.fit, densities=singly) if predicting else None, usable)
        found, unseen = list(weighed), list(left)
    scores = [np.nan if e is None else e.elpd for e in found]
    if not np.isfinite(scores).any():
        scores = [-0.5 * p.fit.aicc for p in usable]
    scores = np.where(np.isfinite(scores), scores, np.nan)
    best = int(np.argmax(np.nan_to_num(scores, nan=-np.inf)))
    candidates = []
    for posterior, proof, out, score in zip(usable, found, unseen, scores, strict=True):
        fit, top = posterior.fit, found[best]
        apart = np.zeros(1)
        if proof is not None and top is not None and np.isfinite(score):
            apart = top.pointwise - proof.pointwise
        error = float(np.sqrt(len(apart)) * apart.std())
        candidates.append(Candidate(posterior, proof, float(scores[best] - score), error, out, doubts(fit)))
    return Choice(tuple(sorted(candidates, key=_rank)))


def _rank(candidate: Candidate) -> tuple[bool, bool, int, float]:
    """Smaller is better."""
    parameters = 0 if candidate.clearly_behind else candidate.fit.n_inferred
    return not candidate.weighed, candidate.clearly_behind, parameters, candidate.behind
