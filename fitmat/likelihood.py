"""The likelihood: measurement noise and model discrepancy in one variance-stabilising transform.

Compared are x = f κ with κ = cosθ_i. The spread of a measurement about the model is taken as a + d(x): a = κσ is the
measurement noise, d(x) = 3 s |x|^(2/3) is the model's discrepancy, a constant spread s of ∛x. With

    z(x) = ∫₀ˣ dt/(a + 3 s |t|^(2/3)) = (x/a) · 3(q − atan q)/q³,   q² = 3 s |x|^(2/3)/a,

z(y κ) is N(z(f κ), 1). Where s → 0 this is the Gaussian likelihood of the raw values, unbiased and as sharp as σ
allows; where s dominates it is the perceptual cube-root fit. The density in y carries z′ at the *data*, so a model
gains nothing by inflating itself.

This room knows no solver, no sampler and no particular model.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat._types import Directions, Samples, Scalar
from fitmat.brdf import AbstractBRDF, evaluate_pairs, padded_length
from fitmat.instrument import Noise
from fitmat.measurement import Measurements

_SERIES = 0.05
# Below this q² the closed form loses digits to cancellation; the series is exact to 1e-15 there.
_COEFFICIENTS = tuple((-1.0) ** k * 3.0 / (2 * k + 3) for k in range(12))


class Data(eqx.Module):
    """Samples as the likelihood sees them; masked values and filling rows have weight 0.

    Attributes:
        wi: Directions to the light, (n, 3).
        wo: Directions to the sensor, (n, 3).
        x: Measured f cosθ_i, (n, c).
        noise: σ cosθ_i, (n, c), positive.
        kappa: cosθ_i, (n, 1).
        weight: 1 where valid, 0 where masked, (n, c).
    """

    wi: Directions
    wo: Directions
    x: Samples
    noise: Samples
    kappa: Float[Array, "n 1"]
    weight: Samples


def prepare(m: Measurements, noise: Noise) -> Data:
    """Measurements and their noise, ready for the likelihood.

    Rows with nothing valid are left out; rows of weight 0 fill up to `padded_length`, so that files of similar size
    share compiled programs.
    """
    keep = np.flatnonzero(m.valid.any(axis=1))
    m, sigma = m.rows(keep), noise.sigma[keep]
    kappa = m.wi[:, 2:3]
    parts = (m.wi, m.wo, m.value * kappa, sigma * kappa, kappa, m.valid.astype(float))
    extra = padded_length(len(kappa)) - len(kappa)
    return Data(*(jnp.asarray(_padded(part, extra, fill)) for part, fill in zip(parts, _FILL, strict=True)))


_FILL = ((0.0, 0.0, 1.0), (0.0, 0.0, 1.0), 0.0, 1.0, 1.0, 0.0)
# One row of Data that weighs nothing: both directions the normal, x = 0, noise = 1, κ = 1, weight 0.


def _padded(part: np.ndarray, extra: int, fill: float | tuple[float, ...]) -> np.ndarray:
    return np.concatenate([part, np.broadcast_to(np.asarray(fill), (extra, part.shape[1]))])


def _shape(q2: Array) -> Array:
    """3(q − atan q)/q³ as a function of q²."""
    small = q2 < _SERIES
    series = jnp.polyval(jnp.array(_COEFFICIENTS[::-1]), jnp.where(small, q2, 0.0))
    q = jnp.sqrt(jnp.where(small, 1.0, q2))
    return jnp.where(small, series, 3.0 * (q - jnp.arctan(q)) / q**3)


def spread(x: Array, noise: Array, s: Array) -> Array:
    """a + 3 s |x|^(2/3): the standard deviation of a measurement of x."""
    return noise + 3.0 * s * jnp.cbrt(x) ** 2


@jax.custom_jvp
def stabilised(x: Array, noise: Array, s: Array) -> Array:
    """z(x), the module's transform; its derivative in x is 1/(a + 3 s |x|^(2/3)), finite everywhere."""
    return x / noise * _shape(3.0 * s * jnp.cbrt(x) ** 2 / noise)


@stabilised.defjvp
def _stabilised_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    x, noise, s = primals
    x_dot, _, s_dot = tangents
    fixed = jnp.cbrt(x) ** 2
    value, from_s = jax.jvp(lambda t: x / noise * _shape(3.0 * t * fixed / noise), (s,), (s_dot,))
    return value, x_dot / spread(x, noise, s) + from_s


def from_stabilised(z: Array, noise: Array, s: Array, guess: Array) -> Array:
    """x with z(x) = z, by Newton's method in ∛x from `guess`; for predictive bands."""

    def step(_: int, u: Array) -> Array:
        slope = 3.0 * u**2 / spread(u**3, noise, s)
        move = (z - stabilised(u**3, noise, s)) / jnp.maximum(slope, 1e-3 / jnp.cbrt(noise))
        return u + jnp.clip(move, -limit, limit)

    limit = jnp.cbrt(jnp.abs(guess) + noise)
    return jax.lax.fori_loop(0, 40, step, jnp.cbrt(guess)) ** 3


def residuals(model: AbstractBRDF, data: Data, s: Scalar) -> Samples:
    """z(y κ) − z(f κ), (n, c), unit variance under the model; 0 where masked."""
    predicted = evaluate_pairs(model, data.wi, data.wo) * data.kappa
    difference = stabilised(data.x, data.noise, s) - stabilised(predicted, data.noise, s)
    return data.weight * difference


def log_likelihood(model: AbstractBRDF, data: Data, s: Scalar) -> Scalar:
    """Log density of the measured values (in sr⁻¹), noise and discrepancy included."""
    r = residuals(model, data, s)
    logs = jnp.log(spread(data.x, data.noise, s)) - jnp.log(data.kappa) + 0.5 * np.log(2.0 * np.pi)
    return -jnp.sum(0.5 * r**2 + data.weight * logs)


def best_discrepancy(predicted: Samples, data: Data, start: Scalar) -> Scalar:
    """The s ≥ 0 that maximises the likelihood for given model values.

    Args:
        predicted: Model f κ, (n, c).
        data: The samples.
        start: A positive first guess.

    Newton's method in log s with steps of at most 2; what falls below `NEGLIGIBLE` of the noise is 0.
    """

    def cost(t: Scalar) -> Scalar:
        s = jnp.exp(t)
        r = stabilised(data.x, data.noise, s) - stabilised(predicted, data.noise, s)
        return jnp.sum(data.weight * (0.5 * r**2 + jnp.log(spread(data.x, data.noise, s))))

    slope = jax.grad(cost)
    floor = jnp.log(NEGLIGIBLE * noise_scale(data))

    def step(_: int, t: Scalar) -> Scalar:
        g, curvature = jax.jvp(slope, (t,), (jnp.ones_like(t),))
        newton = -g / jnp.maximum(jnp.abs(curvature), 1e-3)
        return jnp.clip(t + jnp.clip(newton, -2.0, 2.0), floor, floor + 40.0)

    t = jax.lax.fori_loop(0, 12, step, jnp.maximum(jnp.log(start), floor + 1.0))
    return jnp.where(t > floor + 1e-6, jnp.exp(t), 0.0)


NEGLIGIBLE = 1e-3
"""A discrepancy below this fraction of the noise is reported as none."""


def noise_scale(data: Data) -> Scalar:
    """The s whose discrepancy equals the noise for the typical sample, in sr^(−1/3)."""
    ratio = data.noise / (3.0 * jnp.cbrt(jnp.abs(data.x) + data.noise) ** 2)
    return jnp.nanmedian(jnp.where(data.weight > 0, ratio, jnp.nan))


def first_discrepancy(data: Data) -> Scalar:
    """A first s before anything is fitted: a tenth of the typical ∛x."""
    return 0.1 * jnp.nanmedian(jnp.where(data.weight > 0, jnp.cbrt(jnp.abs(data.x)), jnp.nan))
