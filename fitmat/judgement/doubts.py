"""Adequacy: what speaks against taking a fit's intervals at their word, as plain sentences with what to do.

Intervals hold if the model is right, the noise is what it is said to be, and no value is bad. This room looks for
signs of the contrary in the data and in what the fit leaves over; it changes no number.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat.fitting.information import MISSES
from fitmat.fitting.losses import bad_probability
from fitmat.fitting.result import Fit
from fitmat.judgement import assumed_noise
from fitmat.judgement.prediction import standardised_residuals
from fitmat.maths import normal
from fitmat.maths.directions import signed_zenith
from fitmat.measurements.neighbours import leave_one_out, spacing
from fitmat.models.values import widths

CHANCE = 1e-3
"""Probability, over all values of a file together, from which on a deviation is not put down to chance."""

FAR_OFF = 3.0
"""A given σ is find_doubts where it is wrong by more than this factor."""

QUARTILE = 0.3186
"""Lower quartile of |N(0, 1)|: hardly any interpolation error where a curve bends reaches into it."""

FEWEST = 20
"""Comparisons with neighbours needed to doubt a given σ."""

SPARSE = 0.45
"""Widths of the lobe from which neighbours are too far apart to tell its flanks from noise.

Simulated at alpha 0.02 to 0.5, 0.2 and 2 %, steps of 1 to 15°: denser, σ is right within 30 % on the lobe as well.
"""

TOWARDS_LIGHT = np.deg2rad(10.0)
"""Angle from the direction of the light within which light comes back to it."""

CORE = np.deg2rad(15.0)
"""Angle of the half vector from the normal within which a specular lobe lies."""

GRAZING = np.deg2rad(70.0)
"""Zenith angle of light or sensor beyond which a geometry is grazing."""


CONTRADICTED = "The intervals hold only if the model and the noise are right, which these data contradict."

ALLOWED = "The intervals allow for that: other angles of the same range would give parameters within them."


@dataclasses.dataclass(frozen=True)
class Doubts:
    """What speaks against a fit's intervals.

    Attributes:
        words: One sentence each; empty where nothing does.
        inadequate: Whether the intervals must not be quoted as if the model were true.
        intervals_hold: Whether nothing speaks against the intervals; a model that misses the data does not where the
            correlation of its misfit was found, for they allow for that.
    """

    words: tuple[str, ...]
    inadequate: bool
    intervals_hold: bool

    def __str__(self) -> str:
        """All sentences."""
        return " ".join(self.words)


def find_doubts(fit: Fit) -> Doubts:
    """What speaks against the intervals of a fit.

    Args:
        fit: Under any loss.

    Returns:
        `Doubts`; what a user should know first comes first.
    """
    if not fit.finite:
        return Doubts((f"{fit.name} {fit.adequacy}.",), True, False)
    clashes, identical = _contradictions(fit), _identical(fit)
    noise = [] if identical else _doubtful_noise(fit)
    missed = fit.noise.known and fit.misfit_ratio >= MISSES
    words = [*identical, *clashes, *noise, *_sparse_neighbours(fit), *_bad_values(fit, clashes)]
    if missed:
        ratio = f"{fit.misfit_ratio:.2g} × the measurement noise"
        words.insert(0, f"{fit.name} is inadequate: it misses the data by {ratio}; {_pattern(fit)}.")
    elif not fit.noise.known:
        unknown = f"Whether {fit.name} is adequate cannot be judged: the noise is not known."
        words.append(" ".join(filter(None, (unknown, assumed_noise.words(fit)))))
    contradicted = bool(noise or identical or (clashes and not fit.loss.robust))
    allowed = fit.loss.posterior and not contradicted and fit.correlation.found
    if (missed or contradicted) and fit.loss.posterior:
        words.append(ALLOWED if allowed else CONTRADICTED)
    return Doubts(tuple(words), missed or contradicted, not contradicted and (allowed or not missed))


def _identical(fit: Fit) -> list[str]:
    m = fit.measurements
    used = m.value[m.valid]
    if used.size and np.ptp(used) == 0:
        return [
            f"All values of {m.source} are identical ({used[0]:g} sr⁻¹): no instrument measures that, and nothing but "
            "a diffuse floor can be learnt from it. Check the column."
        ]
    return []


def _contradictions(fit: Fit) -> list[str]:
    """Repeats of one geometry that differ by more than their noise."""
    m, sigma = fit.measurements, fit.noise.sigma
    if not fit.noise.known:
        return []
    place = np.round(np.concatenate([m.wi, m.wo], axis=1), 6)
    group = np.unique(place, axis=0, return_inverse=True)[1].reshape(-1)
    worst, where, pairs = 0.0, (0, 0), 0
    for k in range(len(m.channels)):
        rows = np.flatnonzero(m.valid[:, k])
        order = rows[np.lexsort((m.value[rows, k], group[rows]))]
        low, high = _extremes(group[order])
        a, b = order[low], order[high]
        apart = np.abs(m.value[b, k] - m.value[a, k]) / np.hypot(sigma[a, k], sigma[b, k])
        pairs += int(np.count_nonzero(a != b))
        if apart.size and apart.max() > worst:
            worst, at = float(apart.max()), int(apart.argmax())
            where = int(a[at]), int(b[at])
    if pairs == 0 or worst <= -normal.quantile(CHANCE / (2 * pairs)):
        return []
    give = "the wrong one little weight."
    advice = f"The loss {fit.loss.name} gives {give}" if fit.loss.robust else f"--loss student-t gives {give}"
    theta_i, theta_o = (np.rad2deg(part[where[0]]) for part in (m.theta_i, m.signed_theta_o))
    return [
        f"Two measurements of one geometry (θᵢ {theta_i:.4g}°, θₒ {theta_o:.4g}°) differ by {worst:.3g} times their "
        f"noise: no model can follow both. {advice}"
    ]


def _extremes(group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last place of every run of equal numbers."""
    if len(group) == 0:
        return np.zeros(0, int), np.zeros(0, int)
    change = np.flatnonzero(np.diff(group)) + 1
    return np.r_[0, change], np.r_[change - 1, len(group) - 1]


def _doubtful_noise(fit: Fit) -> list[str]:
    """A given σ that neither the neighbouring angles nor the fit confirm."""
    m = fit.measurements
    if m.sigma is None:
        return []
    _, error, factor = leave_one_out(m)
    used = np.isfinite(error)
    ratio = np.abs(error[used]) / (np.sqrt(factor[used]) * m.sigma[used])
    if ratio.size < FEWEST:
        return []
    scatter = float(np.quantile(ratio, 0.25)) / QUARTILE
    z = _noise_residuals(fit)
    left = float(np.sqrt(np.mean(z**2))) if z.size else 1.0
    if scatter > FAR_OFF and fit.misfit_ratio >= MISSES:
        return [
            f"The σ of the file is about {scatter:.2g} times smaller than the scatter of neighbouring angles: "
            "correct its unit, or leave the column out and the noise is estimated."
        ]
    if scatter < 1.0 / FAR_OFF and left < 1.0 / FAR_OFF:
        return [
            f"The σ of the file is about {1.0 / max(scatter, 1e-12):.2g} times larger than the scatter of neighbouring "
            "angles: correct its unit, or leave the column out and the noise is estimated."
        ]
    return []


def _sparse_neighbours(fit: Fit) -> list[str]:
    """A σ estimated from neighbours that are further apart than the lobe's flanks allow."""
    if fit.noise.laws is None:
        return []
    step, width = spacing(fit.measurements), float(widths(fit.model, fit.values[None])[0])
    if not step > SPARSE * width:
        return []
    apart, wide = np.rad2deg(step), np.rad2deg(np.arctan(width))
    return [
        f"The noise was estimated from neighbours {apart:.2g}° apart beside a lobe {wide:.2g}° wide: on the highlight "
        "it is not known, elsewhere it is an upper bound only. Measure more densely, repeat readings, or give sigma."
    ]


def _noise_residuals(fit: Fit) -> Float[np.ndarray, " n"]:
    """What the fit leaves over in units of the measurement noise alone, valid values only."""
    z = standardised_residuals(fit, misfit=False)
    return z[np.asarray(fit.data.weight) > 0]


def _bad_values(fit: Fit, clashes: list[str]) -> list[str]:
    """Single values far from a model that otherwise follows the data."""
    weight = np.asarray(fit.data.weight) > 0
    z = np.where(weight, standardised_residuals(fit), 0.0)
    if fit.loss.name == "mixture":
        bad = weight & (bad_probability(z) > 0.5)
        limit = "probably bad"
    else:
        bad = np.abs(z) > -normal.quantile(CHANCE / (2 * max(fit.n_values, 1)))
        limit = "further from it than noise and misfit explain"
    count = int(np.count_nonzero(bad))
    if count == 0 or clashes or (fit.misfit_ratio >= MISSES and not fit.loss.robust):
        return []
    row = int(np.abs(z).max(axis=1).argmax())
    wi, wo = np.asarray(fit.data.wi)[row], np.asarray(fit.data.wo)[row]
    theta_i = np.rad2deg(np.arccos(np.clip(wi[2], -1.0, 1.0)))
    theta_o = np.rad2deg(signed_zenith(wi[None], wo[None])[0])
    values = "value is" if count == 1 else "values are"
    return [
        f"{count} of {fit.n_values} {values} {limit}, the worst at θᵢ {theta_i:.4g}°, θₒ {theta_o:.4g}° "
        f"({np.abs(z).max():.2g} standard deviations)."
    ]


def _pattern(fit: Fit) -> str:
    """Where the residuals are largest, and of which sign, in words."""
    weight = np.asarray(fit.data.weight) > 0
    z = np.where(weight, standardised_residuals(fit, misfit=False), 0.0)
    wi, wo = np.asarray(fit.data.wi), np.asarray(fit.data.wo)
    middle = wi + wo
    half = np.arccos(np.clip(middle[:, 2] / np.linalg.norm(middle, axis=1), -1.0, 1.0))
    back = np.arccos(np.clip(np.sum(wi * wo, axis=1), -1.0, 1.0)) < TOWARDS_LIGHT
    tilted = np.arccos(np.clip(wi[:, 2], -1.0, 1.0)) > 1.5 * TOWARDS_LIGHT
    grazing = np.minimum(wi[:, 2], wo[:, 2]) < np.cos(GRAZING)
    regions = {
        "back towards the light (retro-reflection)": back & tilted,
        "around the mirror direction": (half < CORE) & ~(back & tilted),
        "at grazing angles": grazing & (half >= CORE) & ~back,
    }
    regions["away from the mirror direction"] = ~np.logical_or.reduce(list(regions.values()))
    sizes = {name: _mean_square(z[inside], weight[inside]) for name, inside in regions.items()}
    name = max(sizes, key=lambda key: sizes[key])
    signed = z[regions[name]][weight[regions[name]]]
    side = np.sum(signed) / max(np.sum(np.abs(signed)), 1e-300)
    word = "too dark" if side > 0.5 else "too bright" if side < -0.5 else "partly too bright and partly too dark"
    return f"of the angles measured, the residuals are largest {name}, where it is {word}"


def _mean_square(z: np.ndarray, weight: np.ndarray) -> float:
    count = np.count_nonzero(weight)
    return float(np.sum(z[weight] ** 2) / count) if count >= 3 else 0.0
