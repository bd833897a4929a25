"""Findings: everything that is said of one model of a study, in one noun.

Each part is computed once, here or by whom it is named after; the record, the page and the terminal only read it.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from fitmat.fitting import priors
from fitmat.fitting.quantities import Quantity
from fitmat.fitting.result import Fit
from fitmat.judgement.budget import Budget, draw_up
from fitmat.judgement.doubts import Doubts, find_doubts
from fitmat.judgement.fit_metrics import fit_metrics
from fitmat.judgement.identifiability.verdicts import Identifiability
from fitmat.judgement.prediction import Section, standardised_residuals
from fitmat.judgement.predictive.check import PredictiveCheck
from fitmat.judgement.scope import describe_scope
from fitmat.judgement.several_facets import left_out
from fitmat.judgement.yardstick import Yardstick, explained
from fitmat.studies.curves import Curve, predict_curves
from fitmat.text import brief
from fitmat.uncertainty.derived import derived
from fitmat.uncertainty.posterior import Posterior
from fitmat.uncertainty.second_sampler import SecondOpinion


@dataclasses.dataclass(frozen=True)
class Learnt:
    """What the data added to one parameter.

    Attributes:
        name: Of the parameter, with its channel where there are several.
        symbol: The letter of the literature.
        prior: What was believed before, as text.
        narrower: Prior over posterior standard deviation, in the natural coordinate.
    """

    name: str
    symbol: str
    prior: str
    narrower: float


@dataclasses.dataclass(frozen=True, eq=False)
class Findings:
    """What a study found of one model.

    Attributes:
        posterior: Draws of its parameters, around its fit.
        parameters: As people read them.
        derived: What follows from them.
        doubts: What speaks against the intervals.
        scope: What the intervals are about, as sentences.
        several_facets: How much light single scattering leaves out, in a sentence.
        metrics: Name → distance from the measurements; "explained", the share of what can be.
        priors: Parameter → what was believed of it before, as text, one for each channel.
        learnt: What the data added, for each fitted parameter.
        curves: Along each section of the study.
        residuals: Of each value, in standard deviations of noise and misfit, rows as in `fit.data`, (n, c).
        budget: Where its uncertainty comes from; None where there is nothing to propagate, as under an objective.
        identifiability: What the angles determine; None where the model was not examined one by one.
        check: Whether the model can make such data; None where that was not asked.
        second_opinion: Of another sampler; None where that was not asked.
    """

    posterior: Posterior
    parameters: tuple[Quantity, ...]
    derived: tuple[Quantity, ...]
    doubts: Doubts
    scope: str
    several_facets: str
    metrics: Mapping[str, float | None]
    priors: Mapping[str, tuple[str, ...]]
    learnt: tuple[Learnt, ...]
    curves: tuple[Curve, ...]
    residuals: Float[np.ndarray, "n c"]
    budget: Budget | None = None
    identifiability: Identifiability | None = None
    check: PredictiveCheck | None = None
    second_opinion: SecondOpinion | None = None

    __repr__ = brief

    @property
    def fit(self) -> Fit:
        """The fit behind the posterior."""
        return self.posterior.fit

    @property
    def name(self) -> str:
        """The model's."""
        return self.posterior.fit.name


def find(
    posterior: Posterior,
    along: Sequence[Section],
    identifiability: Identifiability | None = None,
    check: PredictiveCheck | None = None,
    possible: Yardstick | None = None,
    *,
    short: bool = False,
) -> Findings:
    """What a posterior says of its model.

    Args:
        posterior: By `sample` or `laplace`.
        along: Sections of the measurements, along which the model is drawn.
        identifiability: What the angles determine, where that was asked; what they leave open is called so everywhere.
        check: Whether the model can make such data, where that was asked.
        possible: What the readings themselves say, of which a model explains a share.
        short: Whether to leave out the budget, and what only a page says: scope, light left out, and metrics.
    """
    fit = posterior.fit
    fitted = posterior.quantities(() if identifiability is None else identifiability.undetermined)
    follows = derived(posterior, fitted)
    return Findings(
        posterior=posterior,
        parameters=tuple(fitted),
        derived=tuple(follows),
        doubts=find_doubts(fit),
        scope="" if short else describe_scope(fit),
        several_facets="" if short else left_out(fit),
        metrics={} if short else _metrics(fit, possible),
        priors=priors.words(fit.model, fit.data.prior),
        learnt=_learnt(posterior),
        curves=predict_curves(posterior, along),
        residuals=standardised_residuals(fit),
        budget=None if short else draw_up(posterior, fitted, follows),
        identifiability=identifiability,
        check=check,
    )


def _metrics(fit: Fit, possible: Yardstick | None) -> dict[str, float | None]:
    return {**fit_metrics(fit), "explained": None if possible is None else explained(possible, fit)}


def _learnt(posterior: Posterior) -> tuple[Learnt, ...]:
    fit = posterior.fit
    told = [text for texts in priors.words(fit.model, fit.data.prior).values() for text in texts]
    symbols = [e.param.symbol for e in fit.entries for _ in range(e.size)]
    before = priors.natural_sd(fit.model, fit.data.prior)
    after = fit.coordinates.natural(posterior.values).std(axis=0)
    rows = zip(fit.coordinates.names, fit.coordinates.places, after, strict=True)
    return tuple(Learnt(name, symbols[k], told[k], float(before[k] / max(sd, 1e-300))) for name, k, sd in rows)
