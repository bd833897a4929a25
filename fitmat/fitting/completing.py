"""Completing: what a fit and its residuals say of directions where nothing was measured, with a standard deviation.

The model, and what it misses: residuals in the stabilised coordinate of the likelihood, in which they are about even,
are carried over by kriging in the coordinates in which `correlation` finds them alike. The parameters' part of the
error is that of the draws after the same carrying over: near a measurement they agree with it (universal kriging).
It writes no file.
"""

import dataclasses

import numpy as np
from jaxtyping import Float, Int

from fitmat._types import Progress
from fitmat.errors import ModelError
from fitmat.fitting.correlation import places
from fitmat.fitting.result import Fit
from fitmat.fitting.stabilising import from_stabilised, spread, stabilised
from fitmat.maths.blas import one_thread
from fitmat.maths.directions import zenith
from fitmat.maths.kriging import kriging
from fitmat.measurements.inferred import measured_only
from fitmat.measurements.noise import at_level, channel_laws
from fitmat.measurements.samples import Measurements
from fitmat.models.values import at, values, widths
from fitmat.text import brief

DRAWS, FEWEST_DRAWS, WORK = 64, 12, 20_000_000
"""Draws of a posterior that are carried over: the most, the fewest, and places × draws in between."""

FEWEST = 30
"""Rows from which on residuals are carried over."""

FLAT = 0.5, 0.2
"""Cosines of the flatter direction from which on errors are judged by themselves."""

QUIET = 0.05
"""The share of readings that are less noisy than the scale at which the stabilised coordinate turns linear."""


@dataclasses.dataclass(frozen=True, eq=False)
class _Scale:
    """The stabilised coordinate of all: its noise and its spread, the same everywhere."""

    noise: float
    s: float

    __repr__ = brief

    def of(self, x: np.ndarray) -> np.ndarray:
        return stabilised(x, self.noise, self.s)

    def back(self, z: np.ndarray) -> np.ndarray:
        return from_stabilised(z, self.noise, self.s)


@one_thread()
def completed(
    fit: Fit,
    draws: Float[np.ndarray, "d p"],
    wi: Float[np.ndarray, "m 3"],
    wo: Float[np.ndarray, "m 3"],
    measured: Measurements | None = None,
    progress: Progress | None = None,
) -> Measurements:
    """The measurements with more rows: of `wi` and `wo`, inferred.

    Args:
        fit: Under the default loss.
        draws: Of the posterior of its parameters.
        wi: Directions to the light, of what is to be inferred.
        wo: Directions to the sensor.
        measured: All that was measured, where the fit saw a part of it.
        progress: Called now and then with rows done and expected.

    Returns:
        Rows in which every channel is valid as they were; then rows in which some channel was masked, now filled; then
        those of `wi` and `wo`. `inferred` marks the values that were not there; their σ is the standard deviation of
        the surface's own value, that of the others as it was, NaN where it was unknown.

    Raises:
        ModelError: the fit is not finite, its loss is an objective, or there is nothing to infer.
    """
    m = fit.measurements if measured is None else measured_only(measured)
    if not (fit.finite and fit.loss.posterior):
        got = f"the loss {fit.loss.name} gives no interval" if fit.finite else f"{fit.name} found no finite fit"
        raise ModelError(f"{m.source}: nothing can be inferred, for {got}; expected one that does. Take another.")
    whole, some = np.all(m.valid, axis=1), np.any(m.valid, axis=1)
    partly = some & ~whole
    wi, wo = (np.concatenate([w[partly], asked]) for w, asked in ((m.wi, wi), (m.wo, wo)))
    if not len(wi):
        raise ModelError(f"{m.source}: no value is masked, and wi has no row, expected one to infer. Name directions.")
    sigma = _noise(fit, m)
    known = m.rows(np.flatnonzero(whole))
    value, sd = _inferred(fit, draws, known, sigma[whole], wi, wo, progress or (lambda *_: None))
    kept = m.valid[partly]
    given = np.full(m.value.shape, np.nan) if m.sigma is None else m.sigma
    value[: len(kept)] = np.where(kept, m.value[partly], value[: len(kept)])
    sd[: len(kept)] = np.where(kept, given[partly], sd[: len(kept)])
    return dataclasses.replace(
        known,
        wi=np.concatenate([known.wi, wi]),
        wo=np.concatenate([known.wo, wo]),
        value=np.concatenate([known.value, value]),
        sigma=np.concatenate([given[whole], sd]),
        valid=np.ones((known.n_samples + len(wi), len(m.channels)), bool),
        inferred=np.concatenate([~known.valid, ~kept, np.ones((len(wi) - len(kept), len(m.channels)), bool)]),
        masked={},
        horizontal=None,
        stated=(),
    )


def _noise(fit: Fit, m: Measurements) -> Float[np.ndarray, "n c"]:
    """Of every reading; where the fit saw a part, by the law that it found."""
    if m is fit.measurements:
        return fit.noise.sigma
    if m.sigma is not None:
        return m.sigma
    laws = np.array([law or (np.nan, np.nan) for law in channel_laws(fit.measurements, fit.noise)])
    return at_level(laws, np.abs(m.value), np.max(np.abs(m.value), axis=0))


def _inferred(
    fit: Fit, draws: np.ndarray, known: Measurements, sigma: np.ndarray, wi: np.ndarray, wo: np.ndarray, say: Progress
) -> tuple[Float[np.ndarray, "m c"], Float[np.ndarray, "m c"]]:
    """Values and standard deviations, sr⁻¹."""
    kappa, there_kappa = (np.sqrt(light[:, 2:3] * sensor[:, 2:3]) for light, sensor in ((known.wi, known.wo), (wi, wo)))
    noise = sigma * kappa
    scale = _Scale(float(np.quantile(noise, QUIET)), max(fit.misfit, float(fit.data.typical)))
    x = known.value * kappa
    rest = scale.of(x) - scale.of(at(fit.model, known.wi, known.wo) * kappa)
    before = scale.of(at(fit.model, wi, wo) * there_kappa)
    few = int(np.clip(WORK / (len(known.wi) + len(wi) + 1), FEWEST_DRAWS, DRAWS))
    draws = draws[np.linspace(0, len(draws) - 1, min(few, len(draws))).astype(int)]
    z, sd = np.array(before), np.empty_like(before)
    if len(known.wi) < FEWEST:
        moved = scale.of(values(fit.model, draws, wi, wo) * there_kappa)
        sd[:] = np.sqrt(np.mean((moved - before) ** 2, axis=0) + np.mean(rest**2, axis=0))
        return _physical(scale, z, sd, there_kappa)
    variance = np.mean((noise / spread(np.abs(x), scale.noise, scale.s)) ** 2, axis=1)
    learnt = kriging(_places(fit, known.wi, known.wo), rest, np.maximum(variance, 1e-8), _sorts(known.wi, known.wo))
    at_known = scale.of(values(fit.model, draws, known.wi, known.wo) * kappa) - (scale.of(x) - rest)
    at_known = np.moveaxis(at_known, 0, 1).reshape(len(x), -1)
    for part in learnt.predicted(_places(fit, wi, wo), _sorts(wi, wo)):
        say("inferring", part.some.start, len(wi))
        z[part.some] += _carried(learnt.rest, part.near, part.weights)
        there = values(fit.model, draws, wi[part.some], wo[part.some]) * there_kappa[part.some]
        moved = np.moveaxis(scale.of(there) - before[part.some], 0, 1)
        moved -= _carried(at_known, part.near, part.weights).reshape(moved.shape)
        sd[part.some] = np.sqrt(np.mean(moved**2, axis=1) + part.sd[:, None] ** 2)
    return _physical(scale, z, sd, there_kappa)


def _sorts(wi: np.ndarray, wo: np.ndarray) -> Int[np.ndarray, " n"]:
    """0 of directions far above the horizon, and more towards it, where models miss most."""
    return np.searchsorted(-np.array(FLAT), -np.minimum(wi[:, 2], wo[:, 2]))


def _carried(rest: np.ndarray, near: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """What neighbours have, (n, q), by their weights, (m, q)."""
    return (weights[:, None] @ rest[near])[:, 0]


def _physical(scale: _Scale, z: np.ndarray, sd: np.ndarray, kappa: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """f and its standard deviation, a quarter of the interval of ± 2; none is below 0."""
    width = 0.25 * (scale.back(z + 2.0 * sd) - scale.back(z - 2.0 * sd))
    return np.maximum(scale.back(z), 0.0) / kappa, width / kappa


def _places(fit: Fit, wi: np.ndarray, wo: np.ndarray) -> Float[np.ndarray, "n 3"]:
    """asinh(θ_h/w), θ_d, and |n·(h × ω_i)|, which is 0 in the plane of incidence.

    Reciprocal and mirrored pairs of an isotropic surface are one place. Of a model with axes: those of the correlation.
    """
    if not fit.model.isotropic:
        return places(fit.model, wi, wo)[0]
    width = float(widths(fit.model, fit.values[None])[0])
    h = wi + wo
    h = h / np.linalg.norm(h, axis=1, keepdims=True)
    theta_d = np.arccos(np.clip(np.sum(wi * h, axis=1), -1.0, 1.0))
    aside = np.abs(h[:, 0] * wi[:, 1] - h[:, 1] * wi[:, 0])
    return np.stack([np.arcsinh(np.asarray(zenith(h)) / width), theta_d, aside], axis=1)
