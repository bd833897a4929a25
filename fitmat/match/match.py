"""The match: how closely an empirical model reproduces a microfacet model fitted to the same measurements.

Judges two fits; draws nothing and prints nothing.
"""

import dataclasses
import functools
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from jaxtyping import Float

from fitmat import arguments
from fitmat.errors import FitmatError
from fitmat.fitting.result import Fit
from fitmat.match import sentences
from fitmat.match.ablation import GRAZING, Ablation, ablate
from fitmat.match.appearance.spheres import Perceived, perceived
from fitmat.match.discernibility import Telling, tell_apart
from fitmat.match.distances import ANGLES, Distances, PairedDraws, measure_distances
from fitmat.match.imitation import Imitation, imitate
from fitmat.match.kinds import is_empirical, refuse_unlike
from fitmat.match.pairing import paired_draws
from fitmat.match.sentences import CLOSE as CLOSE
from fitmat.match.sentences import SIMILAR as SIMILAR
from fitmat.match.sentences import STRONG_EVIDENCE as STRONG_EVIDENCE
from fitmat.maths.blas import one_thread
from fitmat.measurements.incidences import incidence_range, incidences
from fitmat.models.conversion import alpha_from_exponent, exponent_from_alpha
from fitmat.models.metrics import METRICS
from fitmat.text import brief
from fitmat.uncertainty.estimate import Estimate, band, estimate
from fitmat.uncertainty.laplace import laplace
from fitmat.uncertainty.posterior import Posterior

FEW_DRAWS = 50
"""Draws behind the intervals of what is costlier: ablation and the predictive difference."""

ALBEDO_ANGLES = ANGLES
"""Incidence angles of the albedo curves, radians."""

ALBEDO_ERROR = 2e-3
"""Albedos above 1 by more than the quadrature's error are called impossible."""

MOST_INCIDENCES = 16
"""More measured incidence angles than this are taken together, neighbours first."""

IMITATED = ("relative", "ngan", "cube-root", "log-ratio")
"""Metrics in which each fitted model is imitated by the other."""


@dataclasses.dataclass(frozen=True, eq=False)
class Match:
    """The match of two fits.

    Attributes:
        empirical: Posterior of the empirical model.
        microfacet: Posterior of the microfacet model.
        hemisphere_distance: √(∫∫(f_P − f_M)² c_i c_o / ∫∫ f_M² c_i c_o), over all pairs of directions.
        measured_distance: The same over the incidence angles of the file.
        cube_root_distance: √(mean (∛(f_P c_i) − ∛(f_M c_i))²) over solid angle, in sr^(−1/3); None of a short match.
        albedo_gap_max: Largest |ρ_P − ρ_M| over incidence (channel mean), 0 to 85°.
        albedo_gap_sign: −1 where the empirical model reflects less there, else +1.
        albedo_gap_theta_i_deg: Where it occurs.
        implied_exponent: 2/α² − 2 of the microfacet lobe; None for lobes without alpha.
        fitted_exponent: Of the empirical lobe; None for lobes without exponent.
        implied_alpha: √(2/(n+2)) of the empirical lobe; None for lobes without exponent.
        fitted_alpha: Of the microfacet lobe; None for lobes without alpha.
        width_ratio: Implied over fitted alpha: how much wider the empirical lobe is; None where one of them is.
        delta_aicc: AICc of the empirical minus that of the microfacet fit; positive favours microfacet.
        delta_bic: The same for BIC.
        albedo_theta_i: Angles of the albedo curves, radians, (k,).
        albedo_empirical: Channel-mean directional albedo, rows low, best, high (95 %), (3, k).
        albedo_microfacet: The same.
        distances: Every metric, over the hemisphere, by incidence and by region.
        ablation: Which terms of the microfacet lobe make the difference; None for lobes that have not these terms.
        telling: The difference against the noise of the instrument.
        perceived: What an eye sees of the difference on a sphere; None where it was not asked for.
        imitations: The empirical model closest to the fitted microfacet model and the other way round, in each of
            `IMITATED`; empty where it was not asked for.
    """

    empirical: Posterior
    microfacet: Posterior
    hemisphere_distance: Estimate
    measured_distance: Estimate
    cube_root_distance: Estimate | None
    albedo_gap_max: Estimate
    albedo_gap_sign: int
    albedo_gap_theta_i_deg: float
    implied_exponent: Estimate | None
    fitted_exponent: Estimate | None
    implied_alpha: Estimate | None
    fitted_alpha: Estimate | None
    width_ratio: Estimate | None
    delta_aicc: float
    delta_bic: float
    albedo_theta_i: np.ndarray
    albedo_empirical: Float[np.ndarray, "3 k"]
    albedo_microfacet: Float[np.ndarray, "3 k"]
    distances: Distances
    ablation: Ablation | None
    telling: Telling
    perceived: Perceived | None
    imitations: tuple[Imitation, ...]

    __repr__ = brief

    def __str__(self) -> str:
        """The verdict."""
        return self.verdict

    @functools.cached_property
    def verdict(self) -> str:
        """The match in plain sentences; thresholds: `sentences`, `discernibility`, `ablation`, `spheres`."""
        names = _lobe_title(self.empirical.fit.name), _lobe_title(self.microfacet.fit.name)
        found = [
            sentences.distance_sentence(names, self.measured_distance, self.hemisphere_distance, self.distances.beyond),
            sentences.telling_sentence(names, self.telling),
            sentences.grazing_sentence(names, self.distances.grazing_excess, self.ablation),
            sentences.gap_sentence(
                names, self.albedo_gap_max, self.albedo_gap_sign, self.albedo_gap_theta_i_deg, self.incidence_range_deg
            ),
            None if self.perceived is None else self.perceived.words,
            sentences.evidence_sentence(names, self.delta_bic),
            f"{names[0]} {self.empirical.fit.adequacy}; {names[1]} {self.microfacet.fit.adequacy}.",
        ]
        return " ".join([sentence for sentence in found if sentence] + self._cautions(names))

    @property
    def incidence_range_deg(self) -> tuple[float, float]:
        """Between which incidences was measured; beyond, everything is extrapolated."""
        m = self.empirical.fit.measurements
        low, high = np.rad2deg(incidence_range(m.wi, np.any(m.valid, axis=1)))
        return float(low), float(high)

    @property
    def serves_up_to_deg(self) -> float | None:
        """The incidence up to which, from 0° on, the best fits differ moderately at most; None where they never do."""
        alike = self.distances.by_incidence["relative"][1] < SIMILAR
        count = len(alike) if alike.all() else int(np.argmin(alike))
        return float(np.rad2deg(self.distances.theta_i[count - 1])) if count else None

    def _cautions(self, names: tuple[str, str]) -> list[str]:
        """What is impossible, undetermined or unfinished."""
        sentences = []
        for name, albedo in zip(names, (self.albedo_empirical[1], self.albedo_microfacet[1]), strict=True):
            if albedo.max() > 1.0 + ALBEDO_ERROR:
                at = np.rad2deg(self.albedo_theta_i[np.argmax(albedo)])
                sentences.append(
                    f"{name} reflects more light than it receives (albedo {albedo.max():.2f} at {at:.0f}°)."
                )
        fits = self.empirical.fit, self.microfacet.fit
        for fit in fits:
            if fit.undetermined:
                loose = " and ".join(fit.undetermined)
                sentences.append(f"{fit.name} leaves {loose} undetermined: trust the intervals, not the values.")
        unsure = [fit for fit in fits if fit.result in ("max_steps", "nonfinite")]
        return sentences + [f"Do not rely on this match: the fit of {f.name} ended {f.result}." for f in unsure]

    def _repr_html_(self) -> str:
        return f"<p>{self.verdict}</p>"


def _lobe_title(name: str) -> str:
    return name.removeprefix("lambert+")


@one_thread()
def compare(
    one: Posterior | Fit,
    other: Posterior | Fit,
    *,
    spheres: bool = True,
    imitations: bool = False,
    pictures: bool = False,
    short: bool = False,
) -> Match:
    """The match between an empirical and a microfacet model, in either order.

    Args:
        one: Posterior (`laplace` or `sample`) of a fit; a Fit stands for its Laplace approximation with seed 0.
        other: That of the other fit to the same measurements.
        spheres: Whether to ask what an eye would see of the difference.
        imitations: Whether to ask for the parameters with which each of the two best imitates the other.
        pictures: Whether to make pictures of the spheres.
        short: Whether to leave out every metric but "relative", and terms of which the verdict says nothing.

    Returns:
        A `Match`; intervals come from independent draws of both posteriors.

    Raises:
        FitmatError: the two are not one empirical and one microfacet model, fitted to the same data, and finite.
    """
    arguments.kind("one", one, Posterior, Fit)
    arguments.kind("other", other, Posterior, Fit)
    arguments.flags(spheres=spheres, imitations=imitations, pictures=pictures, short=short)
    if pictures and not spheres:
        raise FitmatError("pictures without spheres, expected spheres = True: they are what is drawn. Leave one out.")
    both = [given if isinstance(given, Fit) else given.fit for given in (one, other)]
    refuse_unlike(*both)
    first, second = (laplace(given, seed=0) if isinstance(given, Fit) else given for given in (one, other))
    empirical, microfacet = (first, second) if is_empirical(both[0].name) else (second, first)
    fits, models = (empirical.fit, microfacet.fit), (empirical.fit.model, microfacet.fit.model)
    draws, m = paired_draws(empirical, microfacet), fits[0].measurements
    every = incidences(m.wi, np.any(m.valid, axis=1), MOST_INCIDENCES)
    measured = np.deg2rad([group.theta_i_deg for group in every])
    few = draws[0][: FEW_DRAWS + 1], draws[1][: FEW_DRAWS + 1]
    with ThreadPoolExecutor() as pool:
        metrics = {"relative": METRICS["relative"]} if short else METRICS
        measuring = pool.submit(measure_distances, *models, draws=draws, measured=measured, metrics=metrics)
        ablating = None if short else pool.submit(ablate, *models, draws=few)
        telling = pool.submit(tell_apart, *fits, draws=few)
        seeing = pool.submit(_perceived, *fits, draws, pictures) if spheres else None
        imitating = pool.map(lambda pair: _imitated(*pair), (fits[::-1], fits)) if imitations else ()
        found = measuring.result()
        parts: dict[str, Any] = {"telling": telling.result(), "perceived": seeing and seeing.result()}
        parts["imitations"] = tuple(one for each in imitating for one in each)
        if ablating is None and sentences.grazing_matters(found.grazing_excess):
            ablating = pool.submit(ablate, *models, draws=few, theta_i=GRAZING)
        parts["ablation"] = ablating and ablating.result()
    return _concluded((empirical, microfacet), found, **parts)


def _imitated(what: Fit, by: Fit) -> list[Imitation]:
    """The model of one fit closest to that of another, in each of `IMITATED`."""
    return [imitate(what, by.model, metric) for metric in IMITATED]


def _concluded(pair: tuple[Posterior, Posterior], found: Distances, **parts: Any) -> Match:
    """The match from what was measured."""
    empirical, microfacet = pair
    gaps = found.albedos[0] - found.albedos[1]
    worst = int(np.argmax(np.abs(gaps[0])))
    n, alpha = _draws_of(empirical, "exponent"), _draws_of(microfacet, "alpha")
    width = None if n is None else alpha_from_exponent(n)
    return Match(
        empirical=empirical,
        microfacet=microfacet,
        hemisphere_distance=found.whole["relative"],
        measured_distance=found.measured,
        cube_root_distance=found.whole.get("cube-root"),
        albedo_gap_max=estimate(np.abs(gaps).max(axis=1)),
        albedo_gap_sign=int(np.sign(gaps[0, worst])) or 1,
        albedo_gap_theta_i_deg=float(np.rad2deg(ALBEDO_ANGLES[worst])),
        implied_exponent=None if alpha is None else estimate(exponent_from_alpha(alpha)),
        fitted_exponent=None if n is None else estimate(n),
        implied_alpha=None if width is None else estimate(width),
        fitted_alpha=None if alpha is None else estimate(alpha),
        width_ratio=None if width is None or alpha is None else estimate(_ratio(width, alpha)),
        delta_aicc=empirical.fit.aicc - microfacet.fit.aicc,
        delta_bic=empirical.fit.bic - microfacet.fit.bic,
        albedo_theta_i=ALBEDO_ANGLES,
        albedo_empirical=band(found.albedos[0]),
        albedo_microfacet=band(found.albedos[1]),
        distances=found,
        **parts,
    )


def _perceived(empirical: Fit, microfacet: Fit, draws: PairedDraws, pictures: bool) -> Perceived:
    return perceived(empirical.model, microfacet.model, draws, empirical.measurements.channels, pictures=pictures)


def _draws_of(posterior: Posterior, name: str) -> np.ndarray | None:
    """The best value and every draw of a parameter; None where the model has it not."""
    place = next((e.place for e in posterior.fit.entries if e.name == name), None)
    return None if place is None else np.r_[posterior.fit.values[place], posterior.values[:, place].ravel()]


def _ratio(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    count = min(len(one), len(other))
    return one[:count] / other[:count]
