"""The likelihood: measurement noise and model discrepancy in one variance-stabilising transform.

Compared are x = f κ with κ = cosθ_i. The spread of a measurement about the model is taken as a + d(x): a = κσ is the
measurement noise, d(x) = 3 s |x|^(2/3) is the model's discrepancy, a constant spread s of ∛x. With

    z(x) = ∫₀ˣ dt/(a + 3 s |t|^(2/3)) = (x/a) · 3(q − atan q)/q³,   q² = 3 s |x|^(2/3)/a,

z(y κ) is N(z(f κ), 1). Where s → 0 this is the Gaussian likelihood of the raw values, unbiased and as sharp as σ
allows; where s dominates it is the perceptual cube-root fit. The density in y carries z′ at the *data*, so a model
gains nothing by inflating itself.

This room knows no solver, no sampler and no particular model.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from fitmat._types import Directions, Samples, Scalar
from fitmat.brdf import AbstractBRDF, evaluate_pairs, padded_length
from fitmat.measurement import Measurements
from fitmat.noise import Noise
from fitmat.params import space, vector


def _near_shape() -> np.ndarray:
    """Coefficients, highest first, of 3(q − atan q)/q³ as a polynomial in 2q² − 1 for 0 ≤ q² ≤ 1, exact to 1e-15.

    Interpolated at Chebyshev nodes; the values come from the formula, and from its power series where that cancels.
    """

    def exact(t: np.ndarray) -> np.ndarray:
        q = np.sqrt(np.maximum(t, 0.02))
        series = np.polynomial.polynomial.polyval(t, [(-1.0) ** k * 3.0 / (2 * k + 3) for k in range(12)])
        return np.where(t < 0.02, series, 3.0 * (q - np.arctan(q)) / q**3)

    fitted = np.polynomial.Chebyshev.interpolate(exact, 20, domain=[0.0, 1.0])
    return np.polynomial.chebyshev.cheb2poly(fitted.coef)[::-1]


_NEAR = _near_shape()


class Prior(eqx.Module):
    """What is known of the parameters beside the bounds: Gaussians in their natural coordinates.

    Attributes:
        mean: Of each coordinate, (p,).
        precision: 1/sd of each coordinate, (p,); 0 where the prior is flat.
    """

    mean: Float[Array, " p"]
    precision: Float[Array, " p"]


class Data(eqx.Module):
    """Samples as the likelihood sees them; masked values and filling rows have weight 0.

    Attributes:
        wi: Directions to the light, (n, 3).
        wo: Directions to the sensor, (n, 3).
        x: Measured f cosθ_i, (n, c).
        noise: σ cosθ_i, (n, c), positive.
        kappa: cosθ_i, (n, 1).
        weight: 1 where valid, 0 where masked, (n, c).
        prior: Of the model's parameters; None where it is flat.
    """

    wi: Directions
    wo: Directions
    x: Samples
    noise: Samples
    kappa: Float[Array, "n 1"]
    weight: Samples
    prior: Prior | None = None

    def every(self, stride: int) -> "Data":
        """Each stride-th row, under the same prior."""
        arrays = (self.wi, self.wo, self.x, self.noise, self.kappa, self.weight)
        wi, wo, x, noise, kappa, weight = (part[::stride] for part in arrays)
        return Data(wi, wo, x, noise, kappa, weight, self.prior)


def prepare(m: Measurements, noise: Noise, prior: Prior | None = None) -> Data:
    """Measurements and their noise, ready for the likelihood.

    Rows with nothing valid are left out; rows of weight 0 fill up to `padded_length`, so that files of similar size
    share compiled programs.
    """
    keep = np.flatnonzero(m.valid.any(axis=1))
    m, sigma = m.rows(keep), noise.sigma[keep]
    kappa = m.wi[:, 2:3]
    parts = (m.wi, m.wo, m.value * kappa, sigma * kappa, kappa, m.valid.astype(float))
    extra = padded_length(len(kappa)) - len(kappa)
    padded = (jnp.asarray(_padded(part, extra, fill)) for part, fill in zip(parts, _FILL, strict=True))
    wi, wo, x, deviation, kappa, weight = padded
    return Data(wi, wo, x, deviation, kappa, weight, prior)


_FILL = ((0.0, 0.0, 1.0), (0.0, 0.0, 1.0), 0.0, 1.0, 1.0, 0.0)
# One row of Data that weighs nothing: both directions the normal, x = 0, noise = 1, κ = 1, weight 0.


def _padded(part: np.ndarray, extra: int, fill: float | tuple[float, ...]) -> np.ndarray:
    return np.concatenate([part, np.broadcast_to(np.asarray(fill), (extra, part.shape[1]))])


@jax.custom_jvp
def _shape(q2: Array) -> Array:
    """3(q − atan q)/q³ as a function of q²; for q > 1 by atan q = π/2 − atan(1/q), with the same polynomial."""
    near = q2 <= 1.0
    v2 = 1.0 / jnp.where(near, 1.0, q2)
    v = jnp.sqrt(v2)
    polynomial = jnp.polyval(jnp.asarray(_NEAR), 2.0 * jnp.where(near, q2, v2) - 1.0)
    far = 3.0 * v**3 * (1.0 / v - jnp.pi / 2.0 + v * (1.0 - v2 * polynomial / 3.0))
    return jnp.where(near, polynomial, far)


@_shape.defjvp
def _shape_jvp(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    """g′(w) = 3(1/(1 + w) − g)/(2w), which follows from z′(x) = 1/(a + d); by its power series where that cancels."""
    (w,), (w_dot,) = primals, tangents
    g = _shape(w)
    small = w < 1e-3
    series = -3.0 / 5.0 + w * (6.0 / 7.0 - w * (1.0 - w * 12.0 / 11.0))
    safe = jnp.where(small, 1.0, w)
    return g, jnp.where(small, series, 1.5 / safe * (1.0 / (1.0 + safe) - g)) * w_dot


def _two_thirds(x: Array) -> Array:
    """|x|^(2/3), by exp and log: several times faster than a cube root; 0 at 0."""
    return jnp.exp(jnp.log(jnp.maximum(x * x, 1e-300)) / 3.0)


def spread(x: Array, noise: Array, s: Array) -> Array:
    """a + 3 s |x|^(2/3): the standard deviation of a measurement of x."""
    return noise + 3.0 * s * _two_thirds(x)


@jax.custom_jvp
def stabilised(x: Array, noise: Array, s: Array) -> Array:
    """z(x), the module's transform; its derivative in x is 1/(a + 3 s |x|^(2/3)), finite everywhere."""
    return x / noise * _shape(3.0 * s * _two_thirds(x) / noise)


def _stabilised_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Any]:
    x, noise, s = primals
    x_dot, _, s_dot = tangents
    value, change = stabilised(x, noise, s), jnp.zeros(())
    if not isinstance(x_dot, SymbolicZero):
        change = x_dot / spread(x, noise, s)
    if not isinstance(s_dot, SymbolicZero):
        fixed = _two_thirds(x)
        change += jax.jvp(lambda t: x / noise * _shape(3.0 * t * fixed / noise), (s,), (s_dot,))[1]
    return value, jnp.broadcast_to(change, value.shape)


stabilised.defjvp(_stabilised_jvp, symbolic_zeros=True)


def from_stabilised(z: Array, noise: Array, s: Array) -> Array:
    """x with z(x) = z, by bisection in ∛|x|; for predictive bands.

    Since a + 3 s u² is at least its larger part and at most twice that, ∛|x| lies between the larger of ∛(a|z|) and
    s|z|, and ∛(2a|z|) + 2s|z|.
    """
    size = jnp.abs(z)

    def halve(_: int, bracket: tuple[Array, Array]) -> tuple[Array, Array]:
        low, high = bracket
        middle = 0.5 * (low + high)
        below = stabilised(middle**3, noise, s) < size
        return jnp.where(below, middle, low), jnp.where(below, high, middle)

    begin = jnp.maximum(jnp.cbrt(noise * size), s * size), jnp.cbrt(2.0 * noise * size) + 2.0 * s * size
    low, high = jax.lax.fori_loop(0, HALVINGS, halve, begin)
    return jnp.sign(z) * (0.5 * (low + high)) ** 3


HALVINGS = 50
"""Bisections of a bracket whose ends are within a factor of 3.3 of each other: ∛x to 15 digits."""


def residuals(model: AbstractBRDF, data: Data, s: Scalar) -> Samples:
    """z(y κ) − z(f κ), (n, c), unit variance under the model; 0 where masked."""
    return residuals_from(stabilised(data.x, data.noise, s), model, data, s)


def residuals_from(measured: Samples, model: AbstractBRDF, data: Data, s: Scalar) -> Samples:
    """`residuals` with z(y κ) given, for loops in which s stays."""
    predicted = evaluate_pairs(model, data.wi, data.wo) * data.kappa
    return data.weight * (measured - stabilised(predicted, data.noise, s))


def prior_residuals(model: AbstractBRDF, data: Data) -> Float[Array, " p"]:
    """How many prior standard deviations each parameter is from its prior mean; (0,) where the prior is flat."""
    if data.prior is None:
        return jnp.zeros(0)
    return data.prior.precision * (space(model).natural(vector(model)) - data.prior.mean)


def every_residual(model: AbstractBRDF, data: Data, s: Scalar, measured: Samples | None = None) -> Float[Array, " r"]:
    """`residuals` and `prior_residuals` as one vector, what least squares minimises.

    Args:
        model: Where to evaluate.
        data: The samples.
        s: Discrepancy.
        measured: z(y κ), for loops in which s stays.
    """
    measured = stabilised(data.x, data.noise, s) if measured is None else measured
    samples = residuals_from(measured, model, data, s).ravel()
    return samples if data.prior is None else jnp.concatenate([samples, prior_residuals(model, data)])


def log_density(model: AbstractBRDF, data: Data, s: Scalar) -> Scalar:
    """`log_likelihood` and the log prior density, up to the prior's constant."""
    apart = prior_residuals(model, data)
    return log_likelihood(model, data, s) - 0.5 * jnp.vdot(apart, apart)


def log_likelihood(model: AbstractBRDF, data: Data, s: Scalar) -> Scalar:
    """Log density of the measured values (in sr⁻¹), noise and discrepancy included."""
    r = residuals(model, data, s)
    logs = jnp.log(spread(data.x, data.noise, s)) - jnp.log(data.kappa) + 0.5 * np.log(2.0 * np.pi)
    # Dot products, not sums: XLA fuses a sum with what it adds up into a scalar loop, five times slower on a CPU.
    return -0.5 * jnp.vdot(r, r) - jnp.vdot(data.weight, logs)


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
        return jnp.vdot(data.weight, 0.5 * r**2 + jnp.log(spread(data.x, data.noise, s)))

    slope = jax.grad(cost)
    floor = jnp.log(NEGLIGIBLE * noise_scale(data))

    def step(_: int, t: Scalar) -> Scalar:
        g, curvature = jax.jvp(slope, (t,), (jnp.ones_like(t),))
        newton = -g / jnp.maximum(jnp.abs(curvature), 1e-3)
        return jnp.clip(t + jnp.clip(newton, -2.0, 2.0), floor, floor + 40.0)

    t = jax.lax.fori_loop(0, 12, step, jnp.maximum(jnp.log(start), floor + 1.0))
    return jnp.where(t > floor + 1e-6, jnp.exp(t), 0.0)


def mapped(function: Callable[[Array], Any], items: Array) -> Any:
    """`function` of every item: one after the other on a CPU, all at once on an accelerator.

    On a few cores the loop compiles in half the time and runs twice as fast, because each pass stays in the cache.
    """
    return jax.lax.map(function, items) if jax.default_backend() == "cpu" else jax.vmap(function)(items)


NEGLIGIBLE = 1e-3
"""A discrepancy below this fraction of the noise is reported as none."""


@jax.jit
def noise_scale(data: Data) -> Scalar:
    """The s whose discrepancy equals the noise for the typical sample, in sr^(−1/3)."""
    ratio = data.noise / (3.0 * jnp.cbrt(jnp.abs(data.x) + data.noise) ** 2)
    return jnp.nanmedian(jnp.where(data.weight > 0, ratio, jnp.nan))


@jax.jit
def first_discrepancy(data: Data) -> Scalar:
    """A first s before anything is fitted: a tenth of the typical ∛x."""
    return 0.1 * jnp.nanmedian(jnp.where(data.weight > 0, jnp.cbrt(jnp.abs(data.x)), jnp.nan))
