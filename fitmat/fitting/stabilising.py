"""The variance-stabilising transform that joins measurement noise and model discrepancy, and its inverse.

The spread of a measurement about x = f κ is taken as a + d(x): a = κσ is the measurement noise, d(x) = 3 s |x|^(2/3) a
constant spread s of ∛x. With

    z(x) = ∫₀ˣ dt/(a + 3 s |t|^(2/3)) = (x/a) · 3(q − atan q)/q³,   q² = 3 s |x|^(2/3)/a,

z(y κ) is N(z(f κ), 1). Mathematics only: this room knows neither data nor model.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array

from fitmat.maths.arrays import library


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


def _near(t: Any) -> Any:
    """The polynomial; of NumPy's arrays in place, which takes a third of the time."""
    if library(t) is not np:
        return jnp.polyval(jnp.asarray(_NEAR, t.dtype), t)
    found = np.full_like(t, _NEAR[0])
    for coefficient in _NEAR[1:]:
        found *= t
        found += coefficient
    return found


def _shape(q2: Any) -> Any:
    """3(q − atan q)/q³ as a function of q²; for q > 1 by atan q = π/2 − atan(1/q), with the same polynomial."""
    xp = library(q2)
    near = q2 <= 1.0
    v2 = 1.0 / xp.where(near, 1.0, q2)
    v = xp.sqrt(v2)
    polynomial = _near(2.0 * xp.where(near, q2, v2) - 1.0)
    far = 3.0 * v**3 * (1.0 / v - np.pi / 2.0 + v * (1.0 - v2 * polynomial / 3.0))
    return xp.where(near, polynomial, far)


_traced_shape = jax.custom_jvp(_shape)


@_traced_shape.defjvp
def _shape_jvp(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    """g′(w) = 3(1/(1 + w) − g)/(2w), which follows from z′(x) = 1/(a + d); by its power series where that cancels."""
    (w,), (w_dot,) = primals, tangents
    g = _traced_shape(w)
    small = w < 1e-3
    series = -3.0 / 5.0 + w * (6.0 / 7.0 - w * (1.0 - w * 12.0 / 11.0))
    safe = jnp.where(small, 1.0, w)
    return g, jnp.where(small, series, 1.5 / safe * (1.0 / (1.0 + safe) - g)) * w_dot


def two_thirds(x: Any) -> Any:
    """|x|^(2/3), by exp and log: several times faster than a cube root; 0 at 0."""
    xp = library(x)
    return xp.exp(xp.log(xp.maximum(x * x, 1e-300)) / 3.0)


def spread(x: Any, noise: Any, s: Any) -> Any:
    """a + 3 s |x|^(2/3): the standard deviation of a measurement of x."""
    return noise + 3.0 * s * two_thirds(x)


def stabilised(x: Any, noise: Any, s: Any) -> Any:
    """z(x), the module's transform; its derivative in x is 1/(a + 3 s |x|^(2/3)), finite everywhere.

    JAX and NumPy arrays alike, as the others here.
    """
    if library(x, noise, s) is np:
        return x / noise * _shape(3.0 * s * two_thirds(x) / noise)
    return _traced(x, noise, s)


@jax.custom_jvp
def _traced(x: Array, noise: Array, s: Array) -> Array:
    return x / noise * _traced_shape(3.0 * s * two_thirds(x) / noise)


def _stabilised_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Any]:
    x, noise, s = primals
    x_dot, _, s_dot = tangents
    value = _traced(x, noise, s)
    change = jnp.zeros((), value.dtype)
    if not isinstance(x_dot, SymbolicZero):
        change = x_dot / spread(x, noise, s)
    if not isinstance(s_dot, SymbolicZero):
        fixed = two_thirds(x)
        change += jax.jvp(lambda t: x / noise * _traced_shape(3.0 * t * fixed / noise), (s,), (s_dot,))[1]
    return value, jnp.broadcast_to(change, value.shape)


_traced.defjvp(_stabilised_jvp, symbolic_zeros=True)


def along_discrepancy(x: Any, noise: Any, s: Any, power: Any) -> tuple[Any, Any, Any, Any]:
    """z(x) and its first two derivatives along ln s, and the share of the discrepancy in the spread, d/(a + d) = p.

    With w = q² and f = 1/(1 + w): ∂g/∂ln s = 3(f − g)/2, hence z″; ln(a + d) has the derivatives p and p(1 − p).

    Args:
        x: Where.
        noise: a.
        s: Discrepancy.
        power: `two_thirds` of x, for loops in which x stays.
    """
    xp = library(x, noise, s)
    w = 3.0 * s * power / noise
    g, f, unit = _shape(w), 1.0 / (1.0 + w), x / noise
    change = 1.5 * (f - g)
    return unit * g, unit * change, -1.5 * unit * (w * f * f + change), xp.asarray(w * f)


def from_stabilised(z: Any, noise: Any, s: Any) -> Any:
    """x with z(x) = z, by Newton's method in u = ∛|x|; for predictive bands.

    z(u³) is convex, so that steps from above never pass the root. They begin at ∛(2a|z|) + 2s|z|: since a + 3 s u² is
    at least its larger part and at most twice that, u is at least the larger of ∛(a|z|) and s|z|.
    """
    xp = library(z, noise, s)
    size = xp.abs(z)
    u = xp.cbrt(2.0 * noise * size) + 2.0 * s * size
    for _ in range(STEPS):
        slope = 3.0 * u * u / (noise + 3.0 * s * u * u)
        u = u - (stabilised(u**3, noise, s) - size) / xp.maximum(slope, 1e-300)
    return xp.sign(z) * u**3


STEPS = 10
"""Newton's, from at most 3.3 times the root: ∛x to 15 digits."""
