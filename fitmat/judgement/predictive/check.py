"""Posterior-predictive checks: whether the fitted model can make data like the measured ones, and where it cannot.

It fits nothing and compares no models: a model may be the best of all and still fail.
"""

import dataclasses

import numpy as np

from fitmat import arguments
from fitmat.errors import FitmatError
from fitmat.fitting.losses import DEFAULT
from fitmat.fitting.result import Fit
from fitmat.judgement.multiplicity import adjusted_for_many
from fitmat.judgement.prediction import predictions
from fitmat.judgement.predictive.statistics import Replicates, Statistic
from fitmat.maths import normal
from fitmat.measurements.incidences import incidences
from fitmat.text import brief, html_table, text_table
from fitmat.uncertainty.posterior import Posterior

REPLICATED_DRAWS = 200
"""Posterior draws behind every p-value, where the file is not large."""

MOST_NUMBERS = 2_000_000
"""Draws × values; files of more than 10,000 values get fewer draws, but at least `FEWEST_DRAWS`.

What is averaged over d draws has an error of at most 0.3/√d: 0.02 of 200 draws, 0.07 of the fewest."""

FEWEST_DRAWS = 20

CANNOT = {
    ("largest", 1): "cannot make its largest residual",
    ("largest", -1): "leaves no residual as large as chance would",
    ("outliers", 1): "leaves more residuals beyond 2 sd than chance does",
    ("outliers", -1): "leaves fewer residuals beyond 2 sd than chance does: the noise is stated too large",
    ("peak", 1): "has too low a peak at {}",
    ("peak", -1): "has too high a peak at {}",
    ("pattern", 1): "cannot make the pattern seen at {}",
    ("pattern", -1): "cannot make the alternation of neighbours seen at {}",
    ("side", 1): "reflects too little at {}",
    ("side", -1): "reflects too much at {}",
}
"""What a failed check says of the model; {} are the places. 1: more was measured than the model makes."""


@dataclasses.dataclass(frozen=True, eq=False)
class PredictiveCheck:
    """All checks of one posterior.

    Attributes:
        posterior: Of the model that was checked.
        statistics: What was looked at, in the order of `NAMES`.
    """

    posterior: Posterior
    statistics: tuple[Statistic, ...]

    __repr__ = brief

    @property
    def failed(self) -> tuple[Statistic, ...]:
        """What the model cannot make."""
        return tuple(s for s in self.statistics if s.surprising)

    @property
    def words(self) -> str:
        """What the model cannot make, in a sentence."""
        name = self.posterior.fit.name
        if not self.failed:
            return f"{name} can make data like these: none of {len(self.statistics)} checks is surprising."
        said = []
        for (kind, sign), text in CANNOT.items():
            places = [s.place for s in self.failed if (s.kind, s.sign) == (kind, sign)]
            if places:
                said.append(text.format(_listed(places)))
        return f"{name} {'; it '.join(said)}."

    def _rows(self) -> list[tuple[str, ...]]:
        return [
            (s.name, s.place, f"{s.observed:.3g}", f"{s.expected[0]:.3g} – {s.expected[1]:.3g}", f"{s.p:.2g}",
             "cannot" if s.surprising else "")
            for s in self.statistics
        ]  # fmt: skip

    def __str__(self) -> str:
        """The sentence, then every check."""
        return text_table(self.words, self._rows())

    def _repr_html_(self) -> str:
        return html_table(self.words, ("check", "where", "measured", "model, 95 %", "p", ""), self._rows())


def _listed(places: list[str]) -> str:
    return places[0] if len(places) == 1 else f"{', '.join(places[:-1])} and {places[-1]}"


def check_predictions(posterior: Posterior, *, seed: int) -> PredictiveCheck:
    """Compare statistics of the data with those of data replicated from the posterior (Rubin 1984; Gelman et al. 1996).

    A statistic T may depend on the parameters. For each draw θ the probability that replicated data have a larger
    T(y_rep, θ) than T(y, θ) is averaged over the draws. Residuals of replicated data are N(0, 1) by construction of
    the likelihood, so that this probability is known in closed form: of the largest |z|, of the binomial number beyond
    2 sd, of a mean, and of the highest value of an incidence, P(max ≤ m) = Π_i Φ(T(m κ_i) − T(f κ_i)). That of
    neighbours comes from drawn residuals. Such p-values are a little conservative: parameters that were fitted explain
    part of what is looked at (Robins, van der Vaart & Ventura 2000).

    Args:
        posterior: Of a fit by a likelihood with Gaussian residuals.
        seed: Of the replicated data.

    Raises:
        FitmatError: the fit is not finite, or its loss is no such likelihood.
    """
    arguments.kind("posterior", posterior, Posterior)
    arguments.whole("seed", seed)
    fit = posterior.fit
    if not fit.finite:
        raise FitmatError(f"{fit.name}: the fit ended {fit.result}, there is nothing to check; check the data.")
    if not fit.loss.posterior or fit.loss.shrink is not DEFAULT.shrink:
        raise FitmatError(
            f"{fit.name}: the loss {fit.loss.name} makes no Gaussian residuals to check; fit with the default loss."
        )
    rng, data = np.random.default_rng(seed), fit.data
    used = np.greater(data.weight, 0.0)
    groups = incidences(np.asarray(data.wi), np.asarray(used.any(axis=1)))
    y = np.where(used, np.asarray(data.x / data.kappa), -np.inf)
    highest, top = np.array([y[g.rows].max() for g in groups]), np.zeros(len(y))
    for group, value in zip(groups, highest, strict=True):
        top[group.rows] = value
    count = int(np.clip(MOST_NUMBERS / used.size, FEWEST_DRAWS, REPLICATED_DRAWS))
    draws, s = posterior.thinned(count, widened=False)
    look = Replicates(fit, used, groups, rng, *_seen(fit, draws, s, top))
    found = [*look.whole(), *look.peaks(highest, s), *look.patterns(), *look.sides()]
    adjusted = adjusted_for_many(np.array([f.p for f in found]))
    judged = (dataclasses.replace(f, adjusted=float(a)) for f, a in zip(found, adjusted, strict=True))
    return PredictiveCheck(posterior, tuple(judged))


def _seen(
    fit: Fit, draws: np.ndarray, s: np.ndarray, top: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Residuals, ln P(y_rep ≤ top), model f κ and noise of every draw, (d, n, c) each."""
    data, found = fit.data, np.empty((4, len(draws), *fit.data.x.shape))
    for part, x, noise, spread in predictions(fit, draws, s):
        levels = (x, data.x, top[:, None] * data.kappa)
        at, measured, above = (data.loss.transform(f, noise, data.kappa, spread) for f in levels)
        found[0, part] = data.weight * (measured - at)
        found[1, part] = np.where(data.weight > 0, normal.log_cdf(above - at), 0.0)
        found[2, part], found[3, part] = x, noise
    return found[0], found[1], found[2], found[3]
