"""A study: everything that is said of some models of the same measurements, in one noun.

It fits and samples nothing: it gathers what other rooms say of posteriors.
"""

import dataclasses
from collections.abc import Callable, Sequence

from fitmat.judgement.choice import Choice, choose
from fitmat.judgement.doubts import Doubts, doubted
from fitmat.judgement.identifiability.verdicts import Identifiability, identify
from fitmat.judgement.predictive_check import PredictiveCheck, check_predictions
from fitmat.match.match import Comparison
from fitmat.uncertainty.posterior import Posterior
from fitmat.uncertainty.second_sampler import SecondOpinion, check_posterior

DETAILED = 4
"""Of more models than this, only so many are examined one by one: those of the match, then the best."""

Progress = Callable[[str], None]
"""Called with what is done next."""


@dataclasses.dataclass(frozen=True, eq=False)
class Study:
    """What is known of some models of the same measurements.

    Attributes:
        posteriors: In the order of the fits.
        match: Of an empirical and a microfacet model among them; None where there is no such pair.
        choice: Which model the data prefer; None under a loss that weighs no models, and of a single model.
        identified: What the angles determine, of `detailed` models.
        checks: Whether the models can make such data, of the same; none under a robust loss, which expects bad values.
        opinions: Of a second sampler, where it was asked for.
    """

    posteriors: tuple[Posterior, ...]
    match: Comparison | None = None
    choice: Choice | None = None
    identified: tuple[Identifiability, ...] = ()
    checks: tuple[PredictiveCheck, ...] = ()
    opinions: tuple[SecondOpinion, ...] = ()

    def doubts(self, posterior: Posterior) -> Doubts:
        """What speaks against the intervals of one of the posteriors."""
        return doubted(posterior.fit)


def concluded(
    posteriors: Sequence[Posterior],
    match: Comparison | None = None,
    *,
    seed: int = 0,
    second_opinion: bool = False,
    progress: Progress | None = None,
) -> Study:
    """Examine posteriors of fits to the same measurements.

    Args:
        posteriors: By `sample` or `laplace`.
        match: Of two of them.
        seed: Of the replicated data and of the second sampler.
        second_opinion: Whether to sample chains a second time with another method.
        progress: Called before each part with what it does.
    """
    say = progress or (lambda _: None)
    usable = [p for p in posteriors if p.fit.finite and p.fit.loss.posterior]
    choice = None
    if len(usable) > 1:
        say("weighing the models")
        choice = choose(usable, predicting=usable[0].fit.n_values == usable[0].fit.measurements.n_valid)
    looked_at = detailed(usable, match, choice)
    say("asking what the angles determine")
    identified = tuple(identify(p) for p in looked_at)
    say("replicating the data")
    checks = tuple(check_predictions(p, seed=seed) for p in looked_at if not p.fit.loss.robust)
    opinions = []
    for posterior in looked_at if second_opinion else []:
        say(f"sampling {posterior.fit.name} a second time")
        opinions.append(check_posterior(posterior, seed=seed))
    return Study(tuple(posteriors), match, choice, identified, checks, tuple(opinions))


def detailed(usable: Sequence[Posterior], match: Comparison | None, choice: Choice | None) -> list[Posterior]:
    """The posteriors that are examined one by one, in the order given."""
    first = [] if match is None else [match.empirical, match.microfacet]
    ranked = [] if choice is None else [c.posterior for c in choice.candidates]
    chosen = list(dict.fromkeys(id(p) for p in (*first, *ranked, *usable)))[:DETAILED]
    return [p for p in usable if id(p) in chosen]
