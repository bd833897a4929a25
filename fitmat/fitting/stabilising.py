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
