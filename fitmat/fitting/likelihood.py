"""The likelihood: the samples as a loss sees them, residuals, and log densities.

The default joins measurement noise and model discrepancy in one variance-stabilising transform (`stabilising`):
z(y κ) is N(z(f κ), 1). Where s → 0 this is the Gaussian likelihood of the raw values, unbiased and as sharp as σ
allows; where s dominates it is the perceptual cube-root fit. The density in y carries z′ at the *data*, so a model
gains nothing by inflating itself. Other losses come from `losses`.

This room knows no solver, no sampler and no particular model.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat._types import Samples, Scalar
from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.discrepancy import noise_scale
from fitmat.fitting.losses import DEFAULT, Loss
from fitmat.maths.arrays import library
from fitmat.maths.least_squares import Residuals
from fitmat.measurements.horizon import with_horizon
from fitmat.measurements.noise import Noise, levels
from fitmat.measurements.samples import Measurements
from fitmat.models.around.noise import Noisy
from fitmat.models.base import AbstractBRDF, evaluate_pairs, padded_length
from fitmat.models.parameters import vector


class Prior(eqx.Module):
    """What is known of the parameters beside the bounds: Gaussians in their natural coordinates.

    Attributes:
        mean: Of each coordinate, (p,).
        precision: 1/sd of each coordinate, (p,); 0 where the prior is flat.
        discrepancy: 1/sd of the half-normal of s; 0 where its prior is flat.
    """

    mean: Any
    precision: Any
    discrepancy: Any

    def of(self, places: np.ndarray) -> "Prior":
        """That of some of the parameters."""
        return Prior(self.mean[places], self.precision[places], self.discrepancy)


class Data(eqx.Module):
    """Samples as the likelihood sees them, in NumPy's arrays outside of programs; masked and filling rows weigh 0.

    Attributes:
        wi: Directions to the light, (n, 3).
        wo: Directions to the sensor, (n, 3).
        x: Measured f cosθ_i, (n, c).
        noise: σ cosθ_i, (n, c), positive.
        kappa: cosθ_i, (n, 1).
        weight: 1 where valid, 0 where masked, (n, c).
        prior: Of the model's parameters; None where it is flat.
        loss: What a fit minimises.
        level: |f| as the neighbouring angles show it, in sr⁻¹, (n, c), where the noise is inferred; else None.
        typical: The s whose discrepancy equals the noise for the typical sample, in sr^(−1/3).
        jitter: The part of the noise that chance errors of the angles make, as `noise`; None where nothing is said of
            them.
    """

    wi: Any
    wo: Any
    x: Any
    noise: Any
    kappa: Any
    weight: Any
    prior: Prior | None = None
    loss: Loss = eqx.field(static=True, default=DEFAULT)
    level: Any = None
    typical: Any = 0.0
    jitter: Any = None

    def told(self, free: np.ndarray) -> np.ndarray:
        """Which of the free parameters have a prior that is not flat, as `free`."""
        return np.zeros(len(free), bool) if self.prior is None else np.asarray(self.prior.precision)[free] > 0

    def every(self, stride: int) -> "Data":
        """Each stride-th row, under the same prior and loss."""
        arrays = (self.wi, self.wo, self.x, self.noise, self.kappa, self.weight)
        wi, wo, x, noise, kappa, weight = (part[::stride] for part in arrays)
        level, jitter = (None if part is None else part[::stride] for part in (self.level, self.jitter))
        return Data(wi, wo, x, noise, kappa, weight, self.prior, self.loss, level, self.typical, jitter)

    def of_channels(self, which: np.ndarray, places: np.ndarray) -> "Data":
        """Some of the channels; `places` are those of their parameters in the vector of all."""
        x, noise, weight, level, jitter = (
            None if part is None else part[:, which]
            for part in (self.x, self.noise, self.weight, self.level, self.jitter)
        )
        known = None if self.prior is None else self.prior.of(places)
        return dataclasses.replace(self, x=x, noise=noise, weight=weight, level=level, jitter=jitter, prior=known)

    def under(self, loss: Loss) -> "Data":
        """The same samples under another loss and a flat prior."""
        return dataclasses.replace(self, prior=None, loss=loss, level=None)


def prepare(
    m: Measurements, noise: Noise, prior: Prior | None = None, loss: Loss = DEFAULT, *, scaled: bool = True
) -> Data:
    """Measurements and their noise, ready for the likelihood; `typical` is NaN where it is not asked for (`scaled`).

    Rows with nothing valid are left out, and values at θ_o = 90° under all but an objective; what the loss cannot be
    applied to has weight 0; rows of weight 0 fill up to `padded_length`, so that files of similar size share programs.
    """
    m, sigma = (m, noise.sigma) if loss.posterior else with_horizon(m, noise.sigma)
    keep = np.flatnonzero(m.valid.any(axis=1))
    m, sigma = m.rows(keep), sigma[keep]
    kappa = m.wi[:, 2:3]
    weight = m.valid if loss.usable is None else m.valid & loss.usable(m)
    parts = (m.wi, m.wo, m.value * kappa, sigma * kappa, kappa, weight.astype(float))
    extra = padded_length(len(kappa)) - len(kappa)
    padded = (_padded(part, extra, fill) for part, fill in zip(parts, _FILL, strict=True))
    level = _padded(levels(m), extra, 1.0) if loss.infers_noise else None
    wi, wo, x, deviation, kappa, weight = padded
    typical = noise_scale(x, deviation, weight) if scaled else np.array(np.nan)
    return Data(wi, wo, x, deviation, kappa, weight, prior, loss, level, typical)


_FILL = ((0.0, 0.0, 1.0), (0.0, 0.0, 1.0), 0.0, 1.0, 1.0, 0.0)
# One row of Data that weighs nothing: both directions the normal, x = 0, noise = 1, κ = 1, weight 0.


def _padded(part: np.ndarray, extra: int, fill: float | tuple[float, ...]) -> np.ndarray:
    return np.concatenate([part, np.broadcast_to(np.asarray(fill), (extra, part.shape[1]))])


def predicted(model: AbstractBRDF, data: Data) -> Samples:
    """f κ at the samples, (n, c)."""
    return evaluate_pairs(model, data.wi, data.wo) * data.kappa


def residuals(model: AbstractBRDF, data: Data, s: Scalar, x: Samples | None = None) -> Samples:
    """T(y κ) − T(f κ), shrunk as the loss has it, (n, c), unit variance under a likelihood; 0 where masked.

    Args:
        model: Where to evaluate.
        data: The samples.
        s: Discrepancy.
        x: `predicted`, where it is at hand.
    """
    return residuals_from(transformed(data, s), model, data, s, x)


def transformed(data: Data, s: Scalar) -> Samples:
    """T(y κ) with the noise that the data state, (n, c)."""
    return data.loss.transform(data.x, data.noise, data.kappa, s)


def residuals_from(measured: Samples, model: AbstractBRDF, data: Data, s: Scalar, x: Samples | None = None) -> Samples:
    """`residuals` with T(y κ) given, for loops in which s stays; where the noise is inferred it is not used."""
    x, noise = predicted(model, data) if x is None else x, data.noise
    if data.loss.infers_noise:
        noise = inferred_noise(model, data)
        measured = data.loss.transform(data.x, noise, data.kappa, s)
    return _apart(measured, x, noise, data, s)


def _apart(measured: Any, x: Any, noise: Any, data: Data, s: Any) -> Any:
    return data.weight * data.loss.shrink(measured - data.loss.transform(x, noise, data.kappa, s))


def misfits(x: Any, noise: Any, data: Data, s: Any) -> Any:
    """`residuals` of given model values f κ and noise σ κ, (…, n, c); of NumPy arrays where `data` holds such."""
    return _apart(data.loss.transform(data.x, noise, data.kappa, s), x, noise, data, s)


def inferred_noise(model: AbstractBRDF, data: Data) -> Samples:
    """σ κ as a `Noisy` model has it, (n, c)."""
    assert isinstance(model, Noisy)
    return data.kappa * model.sigma(_level(data))


def _level(data: Data) -> Samples:
    assert data.level is not None
    return data.level


def _spread_residuals(model: AbstractBRDF, data: Data) -> Samples:
    """√(2 ln(σ/σ_least)), (n, c), whose half squares sum to the ln σ of the density."""
    assert isinstance(model, Noisy)
    level = _level(data)
    return data.weight * jnp.sqrt(2.0 * jnp.log(model.sigma(level) / model.least_sigma(level)))


def prior_residuals(model: AbstractBRDF, data: Data) -> Float[Array, " p"]:
    """How many prior standard deviations each parameter is from its prior mean; (0,) where the prior is flat."""
    if data.prior is None:
        return jnp.zeros(0)
    return data.prior.precision * (coordinates(model).natural(vector(model)) - data.prior.mean)


def every_residual(
    model: AbstractBRDF,
    data: Data,
    s: Scalar,
    measured: Samples | None = None,
    x: Samples | None = None,
    free: np.ndarray | None = None,
) -> Residuals:
    """`residuals`, below them what an inferred noise adds, and `prior_residuals`: what least squares minimises.

    Args:
        model: Where to evaluate.
        data: The samples.
        s: Discrepancy.
        measured: T(y κ), for loops in which s stays.
        x: `predicted`, where it is at hand.
        free: Places of the parameters that are moved, of which alone there is a prior; None for all.
    """
    measured = transformed(data, s) if measured is None else measured
    samples, known = residuals_from(measured, model, data, s, x), prior_residuals(model, data)
    if data.loss.infers_noise:
        samples = jnp.concatenate([samples, _spread_residuals(model, data)])
    return Residuals(samples, known if data.prior is None or free is None else known[free])


def log_density(model: AbstractBRDF, data: Data, s: Scalar, x: Samples | None = None) -> Scalar:
    """`log_likelihood` and the log prior density, up to the prior's constant."""
    apart = prior_residuals(model, data)
    return log_likelihood(model, data, s, x) - 0.5 * jnp.vdot(apart, apart) - discrepancy_cost(data, s)


def discrepancy_cost(data: Data, s: Scalar) -> Scalar:
    """−ln of the prior density of s, up to its constant."""
    return jnp.zeros(()) if data.prior is None else 0.5 * (data.prior.discrepancy * s) ** 2


def log_likelihood(model: AbstractBRDF, data: Data, s: Scalar, x: Samples | None = None) -> Scalar:
    """Log density of the measured values (in sr⁻¹), noise and discrepancy included; of an objective −½ Σ residual²."""
    r = residuals(model, data, s, x)
    # Dot products, not sums: XLA fuses a sum with what it adds up into a scalar loop, five times slower on a CPU.
    return -0.5 * jnp.vdot(r, r) - jnp.vdot(data.weight, _log_spread(model, data, s))


def log_pointwise(x: Any, noise: Any, data: Data, s: Any) -> Any:
    """The terms of `log_likelihood`, one for each value, of what `misfits` takes; of no meaning where one is masked."""
    return -0.5 * misfits(x, noise, data, s) ** 2 - _log_width(noise, data, s)


def _log_spread(model: AbstractBRDF, data: Data, s: Scalar) -> Samples:
    """−ln of the density of a residual of 0, in sr, (n, c); 0 of an objective."""
    return _log_width(inferred_noise(model, data) if data.loss.infers_noise else data.noise, data, s)


def _log_width(noise: Any, data: Data, s: Any) -> Any:
    xp = library(noise, data.x, s)
    if data.loss.spread is None:
        return xp.zeros_like(data.x)
    return xp.log(data.loss.spread(data.x, noise, data.kappa, s)) - xp.log(data.kappa) - data.loss.log_peak
