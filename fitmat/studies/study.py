"""A study: the whole story of one file. Fit, sample, match, judge: everything is computed here, once.

What people see of it, `reports` makes; nothing is written or printed here.
"""

import dataclasses
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from jaxtyping import ArrayLike

from fitmat import arguments
from fitmat._types import Progress
from fitmat.fitting.losses import DEFAULT
from fitmat.judgement.budget import Line, of_draws
from fitmat.judgement.choice.choice import Choice, choose
from fitmat.judgement.examination.examining import warnings
from fitmat.judgement.identifiability.verdicts import identify
from fitmat.judgement.prediction import sections
from fitmat.judgement.predictive.check import check_predictions
from fitmat.judgement.yardstick import yardstick
from fitmat.match.kinds import is_empirical, is_microfacet
from fitmat.match.match import Match, compare
from fitmat.match.pairing import paired_draws
from fitmat.maths.blas import one_thread
from fitmat.measurements.large.stream import Stream
from fitmat.measurements.reader import measurements_of
from fitmat.measurements.samples import Measurements
from fitmat.models.around.tilt import Tilted
from fitmat.studies import DEFAULT_MODELS
from fitmat.studies.advice import Advice, advise
from fitmat.studies.findings import Findings, find
from fitmat.studies.large import as_stream, counted, pass_over
from fitmat.studies.plan import plan, refuse_unsampled
from fitmat.studies.sampling import sample_each
from fitmat.text import brief
from fitmat.uncertainty import second_sampler
from fitmat.uncertainty.laplace import laplace_each
from fitmat.uncertainty.posterior import Posterior

MOST_SAMPLED = 50_000
"""Values above which nothing is sampled: a step takes seconds, and Laplace's approximation is as good."""

DETAILED = 4
"""Of more models than this, only so many are examined one by one: those of the match, then the best."""


@dataclasses.dataclass(frozen=True, eq=False)
class Study:
    """What is known of some models of the same measurements.

    Attributes:
        findings: One for each model, in the order of the fits.
        match: Of an empirical and a microfacet model among them; None where there is no such pair.
        choice: Which model the data prefer; None under a loss that weighs no models, and of a single model.
        distance: Where the uncertainty of the match's distance comes from; None where there is no match or no budget.
        advice: The one next angle worth measuring; None where none is.
        full: Whether everything was asked; see `study`.
        warnings: What is odd about the measurements themselves, as sentences.
        rows: How many rows were given, and in how many of them something is masked, where `measurements` holds only
            some of them; else None.
    """

    findings: tuple[Findings, ...]
    match: Match | None = None
    choice: Choice | None = None
    distance: Line | None = None
    advice: Advice | None = None
    full: bool = False
    warnings: tuple[str, ...] = ()
    rows: tuple[int, int] | None = None

    __repr__ = brief

    @property
    def measurements(self) -> Measurements:
        """What was fitted; of very many rows, those that are shown."""
        return self.findings[0].fit.measurements

    @property
    def n_samples(self) -> int:
        """Rows that were given, masked ones included."""
        return self.measurements.n_samples if self.rows is None else self.rows[0]

    @property
    def n_masked(self) -> int:
        """Rows of these in which something is masked."""
        return self.measurements.n_masked if self.rows is None else self.rows[1]

    @property
    def posteriors(self) -> tuple[Posterior, ...]:
        """One for each model."""
        return tuple(found.posterior for found in self.findings)

    def __str__(self) -> str:
        """What was fitted, how each fit ended, and the verdict of the match."""
        m, ends = self.measurements, [str(found.fit).partition("\n")[0] for found in self.findings]
        return "\n".join(
            [f"{m.source}: {self.n_samples} samples", *ends, *([self.match.verdict] if self.match else [])]
        )

    @property
    def detailed(self) -> tuple[Findings, ...]:
        """At most `DETAILED` models: those of the match, then the best; in the order of the fits."""
        chosen = _detailed(self.posteriors, self.match, self.choice)
        return tuple(found for found in self.findings if found.posterior in chosen)


@one_thread()
def study(
    measurements: Measurements | Stream | str | os.PathLike[str],
    models: str | Sequence[str] = DEFAULT_MODELS,
    *,
    fixed: Mapping[str, ArrayLike] | None = None,
    priors: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    loss: str = DEFAULT.name,
    masking: str | None = None,
    ior: str | None = None,
    tilt: bool = False,
    dispersion: str | None = None,
    film: str | None = None,
    sampling: bool = True,
    seed: int = 0,
    second_opinion: bool = False,
    full: bool = False,
    short: bool = False,
    resume: Path | None = None,
    progress: Progress | None = None,
) -> Study:
    """Fit models, sample their posteriors, match them and judge them: what `fitmat fit` does with a file.

    Args:
        measurements: From `fitmat.read`, or a file that needs no options; of more than `large.MOST_AT_ONCE` rows it is
            passed over block by block.
        models: Names, or a text with commas between them; "all" for every model that makes sense.
        fixed: Parameters to hold, by name, in every model that has them: `{"ks": 1.0}`.
        priors: What is known beforehand, by name: centre and standard deviation, `{"eta": (1.5, 0.05)}`.
        loss: What the fits minimise, by name (`fitting.losses`).
        masking: Of the microfacet lobes; None for each lobe's own.
        ior: Material whose refractive index is taken from the literature: "Au".
        tilt: Whether to fit how far the sample's normal leans.
        dispersion: Law that the refractive index follows over the channels' wavelengths, as in `fit`.
        film: Material whose refractive index the film of `ggx-film` and others has: "TiO2".
        sampling: Whether to sample; else, and for more than `MOST_SAMPLED` values, Laplace's approximation.
        seed: Of everything that is drawn.
        second_opinion: Whether to sample every posterior a second time with another method.
        full: Whether to ask what takes longer than it tells at first sight as well: the parameters with which each
            model of the match best imitates the other, pictures of the spheres, and of two models what each predicts
            of single values left out.
        short: Whether to leave out what a table of many files does not show: curves, budgets, predictive checks, what
            can be explained, what predicts an incidence left out best, and of the match every metric but the relative
            one; nothing else changes.
        resume: Folder in which the sampling is kept while it lasts; None to keep nothing.
        progress: Called with what is done next.

    Returns:
        A `Study`. An interrupt during sampling keeps what was done and leaves the rest to Laplace's approximation.

    Raises:
        FitmatError: as `fit`; a model or an option that concerns none is refused before anything is fitted.

    Example:
        >>> study(read("measurements.csv"), "lambert+phong,lambert+ggx").match.verdict  # doctest: +SKIP
    """
    given = measurements if isinstance(measurements, Stream) else measurements_of(measurements)
    arguments.kind("models", models, str, Sequence)
    arguments.named(fixed=fixed, priors=priors)
    named = {"loss": loss, "masking": masking, "ior": ior, "dispersion": dispersion, "film": film}
    for name, text in named.items():
        arguments.kind(name, text, str, optional=name != "loss")
    arguments.whole("seed", seed)
    arguments.flags(tilt=tilt, sampling=sampling, second_opinion=second_opinion, full=full, short=short)
    arguments.kind("resume", resume, Path, optional=True)
    arguments.function("progress", progress)
    say = progress or (lambda *_: None)
    if second_opinion:
        refuse_unsampled(given.n_valid, MOST_SAMPLED, loss, sampling=sampling)
        second_sampler.require()
    stream = as_stream(given)
    shown = stream if isinstance(stream, Measurements) else stream.part
    known = {"fixed": fixed, "priors": priors, "loss": loss, "masking": masking, "ior": ior, "tilt": tilt}
    jobs = plan(models, shown, **known, dispersion=dispersion, film=film)
    if isinstance(stream, Measurements):
        first = laplace_each(stream, jobs, seed=seed, corrected=not sampling, progress=say)
    else:
        first = pass_over(stream, jobs, seed, say)
    walking = sampling and first[0].fit.loss.posterior and first[0].fit.n_values <= MOST_SAMPLED
    posteriors = sample_each(first, seed=seed, resume=resume, progress=say) if walking else first
    asked = {"second_opinion": second_opinion, "full": full, "short": short}
    found = judge(posteriors, seed=seed, **asked, progress=say)
    return found if stream is shown else dataclasses.replace(found, rows=counted(given))


def judge(
    posteriors: Sequence[Posterior],
    *,
    seed: int,
    second_opinion: bool = False,
    full: bool = False,
    short: bool = False,
    progress: Progress | None = None,
) -> Study:
    """Match, weigh and examine posteriors of fits to the same measurements.

    Args:
        posteriors: By `sample` or `laplace`.
        seed: Of the replicated data and of the second sampler.
        second_opinion: Whether to sample chains a second time with another method; what has none goes without.
        full: As in `study`.
        short: As in `study`.
        progress: Called with what is done next.
    """
    say = progress or (lambda *_: None)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        odd = pool.submit(_odd, posteriors)
        possible = None if short else pool.submit(yardstick, posteriors[0].fit.measurements)
        say("comparing", 0, 0)
        match = _match(posteriors, full, short)
        usable = [p for p in posteriors if p.fit.finite and p.fit.loss.posterior]
        choice = None
        if len(usable) > 1:
            say("weighing the models", 0, 0)
            whole = usable[0].fit.n_values == usable[0].fit.measurements.n_valid
            choice = choose(usable, predicting=whole and not short, singly=full or len(usable) > 2)
        along = () if short else sections(posteriors[0].fit.measurements)
        looked_at = [p for p in _detailed(usable, match, choice) if p in usable]
        findings, count = [], len(posteriors)
        words = f"examining {', '.join(p.fit.name for p in posteriors) if count <= DETAILED else f'{count} models'}"
        say(words, 0, count)

        def looked(posterior: Posterior) -> Findings:
            looking = posterior in looked_at
            asked = identify(posterior) if looking else None
            if possible is None:
                return find(posterior, (), asked, short=True)
            checked = looking and not posterior.fit.loss.robust
            check = check_predictions(posterior, seed=seed) if checked else None
            return find(posterior, along, asked, check, possible.result())

        for found in pool.map(looked, posteriors):
            findings.append(found)
            say(words, len(findings), count)
    if second_opinion:
        asked = [found.posterior in looked_at and found.posterior.chain is not None for found in findings]
        findings = [_asked_again(f, seed, say) if again else f for f, again in zip(findings, asked, strict=True)]
    advice = advise(findings, match, choice)
    line = None if short else _distance(match)
    return Study(tuple(findings), match, choice, line, advice, full, odd.result())


def _distance(match: Match | None) -> Line | None:
    """The budget of the distance over all pairs of directions."""
    if match is None:
        return None
    pairs = zip(
        (match.empirical.fit, match.microfacet.fit), paired_draws(match.empirical, match.microfacet), strict=True
    )
    return of_draws("hemisphere distance", "d", match.distances.relative, list(pairs))


def _odd(posteriors: Sequence[Posterior]) -> tuple[str, ...]:
    """What is odd about the measurements; of a file of which only a part is at hand, what reading it said."""
    fit = posteriors[0].fit
    if fit.n_values > fit.measurements.n_valid:
        return fit.measurements.warnings
    tilted = any(Tilted.prefix in posterior.fit.name for posterior in posteriors)
    return warnings(fit.measurements, fit.noise, tilted=tilted)


def _asked_again(found: Findings, seed: int, say: Progress) -> Findings:
    """With what another sampler says."""
    say(f"sampling {found.name} a second time", 0, 0)
    return dataclasses.replace(found, second_opinion=second_sampler.check_posterior(found.posterior, seed=seed))


def _match(posteriors: Sequence[Posterior], full: bool, short: bool) -> Match | None:
    """The match of the first empirical and the first microfacet model, if there are both and both are finite."""
    empirical = next((p for p in posteriors if is_empirical(p.fit.name)), None)
    microfacet = next((p for p in posteriors if is_microfacet(p.fit.name) and not is_empirical(p.fit.name)), None)
    if empirical is None or microfacet is None or not (empirical.fit.finite and microfacet.fit.finite):
        return None
    found = compare(empirical, microfacet, imitations=full, pictures=full, short=short)
    return found if np.isfinite(found.hemisphere_distance.value) else None


def _detailed(posteriors: Sequence[Posterior], match: Match | None, choice: Choice | None) -> tuple[Posterior, ...]:
    """The posteriors that are examined one by one."""
    first = [] if match is None else [match.empirical, match.microfacet]
    ranked = [] if choice is None else [candidate.posterior for candidate in choice.candidates]
    return tuple(dict.fromkeys((*first, *ranked, *posteriors)))[:DETAILED]
