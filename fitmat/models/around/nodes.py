"""Cosines at which the light in a coat is known, and functions that are 1 at one of them and 0 at the others.

Outer cosines, whose light can leave, and inner ones below the critical angle; knows no face and no base.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from fitmat._types import Scalar
from fitmat.maths.arrays import library
from fitmat.maths.directions import COS_MIN
from fitmat.maths.quadrature import gauss

LEAVING, KEPT = 10, 5
"""How many of each."""

_TINY = 1e-16


def inside(eta: Scalar, outer: Array) -> Array:
    """Cosine inside from that outside: √(η² − 1 + c²)/η."""
    square = (eta - 1.0) * (eta + 1.0) + outer**2  # without the cancellation of 1 − sin² θ/η²
    return jnp.sqrt(jnp.maximum(square, COS_MIN**2)) / eta


def critical(eta: Scalar) -> Scalar:
    """Cosine of the critical angle inside, √(1 − 1/η²)."""
    return jnp.sqrt(jnp.maximum((eta - 1.0) * (eta + 1.0), _TINY)) / eta


def leaving(eta: Scalar, cos: Array) -> Array:
    """Cosine outside from that inside; 0 beyond the critical angle."""
    square = 1.0 - eta**2 * (1.0 - cos**2)
    leaves = square > 0.0
    return jnp.where(leaves, jnp.sqrt(jnp.where(leaves, square, 1.0)), 0.0)


def cosines(eta: Scalar) -> tuple[Array, Array]:
    """The nodes outside, 0 for light that cannot leave, and inside, (`LEAVING` + `KEPT`) each."""
    nodes = jnp.asarray(ROOTS**2)
    outer = jnp.concatenate([nodes, jnp.zeros(KEPT)])
    return outer, jnp.concatenate([inside(eta, nodes), critical(eta) * jnp.asarray(_BELOW)])


def cardinal(eta: Scalar, cos: Array) -> Array:
    """At inner cosines, last axis: polynomials in √c of the outer one, below the critical angle in c′."""
    outer = leaving(eta, cos)
    above = _polynomials(_root(outer), LEAVING) @ TO_LEAVING
    below = _polynomials(jnp.minimum(cos / critical(eta), 1.0), KEPT) @ _TO_KEPT
    leaves = (outer > 0.0)[..., None]
    return jnp.concatenate([jnp.where(leaves, above, 0.0), jnp.where(leaves, 0.0, below)], axis=-1)


def shares(eta: Scalar) -> Array:
    """2∫ φ c′ dc′ of the cardinal functions inside; the sum is 1."""
    edge = critical(eta) ** 2
    return jnp.concatenate([(1.0 - edge) * _SHARES_LEAVING, edge * _SHARES_KEPT])


def series(coefficients: Array, outer: Array) -> Array:
    """Chebyshev polynomials in 2√c − 1 with coefficients (k, c) at outer cosines (…), as (…, c)."""
    return _polynomials(_root(outer), LEAVING) @ coefficients


class Curve(NamedTuple):
    """A function of the outer cosine that never swings between its values.

    Attributes:
        roots: √c at which they are, ascending, (k,).
        values: There, (k, c).
        slopes: Along √c, (k, c).
    """

    roots: np.ndarray
    values: Array
    slopes: Array

    def __call__(self, outer: Array) -> Array:
        """At outer cosines (…), as (…, c)."""
        at, along = hermite(self.roots, outer)
        return at @ self.values + along @ self.slopes


def curve(roots: np.ndarray, values: Array) -> Curve:
    """Slopes are those of parabolas, limited so that it is monotone between values (J. M. Hyman, SISSC 4, 1983)."""
    steps = np.diff(roots)[:, None]
    secant = jnp.diff(values, axis=0) / steps
    before, after, share = secant[:-1], secant[1:], steps[1:] / (steps[1:] + steps[:-1])
    most = 3.0 * jnp.where(before * after > 0.0, jnp.minimum(jnp.abs(before), jnp.abs(after)), 0.0)
    within = jnp.clip(share * before + (1.0 - share) * after, -most, most)
    return Curve(roots, values, jnp.concatenate([secant[:1], within, secant[-1:]]))


def hermite(roots: np.ndarray, outer: Array) -> tuple[Array, Array]:
    """Weights of a `Curve`'s values and slopes, (…, k) each: cubic between two values, straight beyond the last."""
    x, at, steps = _root(outer), jnp.asarray(roots), jnp.asarray(np.diff(roots))
    k = jnp.clip(jnp.searchsorted(at, x) - 1, 0, len(roots) - 2)
    t = (x - at[k]) / steps[k]
    u = jnp.clip(t, 0.0, 1.0)
    rise = u**2 * (3.0 - 2.0 * u)
    first = steps[k] * (u * (1.0 - u) ** 2 + jnp.minimum(t, 0.0))
    last = steps[k] * (u**2 * (u - 1.0) + jnp.maximum(t - 1.0, 0.0))
    near, far = ((jnp.arange(len(roots)) == (k + j)[..., None]).astype(x.dtype) for j in (0, 1))
    low, high = ((1.0 - rise)[..., None], first[..., None]), (rise[..., None], last[..., None])
    return low[0] * near + high[0] * far, low[1] * near + high[1] * far


def finer(values: Array) -> Array:
    """From values at the outer nodes those at `FINE`."""
    return curve(ROOTS, values)(jnp.asarray(FINE**2))


def again_cosines(alpha: Scalar) -> Array:
    """Outer cosines at which it is known what facets of slope alpha reflect more than once, (`LEAVING`,)."""
    u = jnp.asarray(ROOTS)
    return 2.0 * alpha * u / (1.0 + 2.0 * alpha - u)


def again_series(coefficients: Array, alpha: Scalar, outer: Array) -> Array:
    """v² times polynomials in u = c (1 + 2α)/(c + 2α) at outer cosines, v = 2α/(c + 2α).

    Masking acts where c is like α, and falls with the square of a slope above.
    """
    v = 2.0 * alpha / (outer + 2.0 * alpha)
    return v**2 * (_polynomials(outer * (1.0 + 2.0 * alpha) / (outer + 2.0 * alpha), LEAVING) @ coefficients)


def again_coefficients(values: Array, alpha: Scalar) -> Array:
    """Of the series with values at `again_cosines`."""
    v = 2.0 * alpha / (again_cosines(alpha) + 2.0 * alpha)
    return jnp.asarray(TO_LEAVING) @ (values / v**2)


def _root(outer: Array) -> Array:
    """√c, with a slope at 0."""
    return jnp.sqrt(jnp.maximum(outer, 1e-8))


def _polynomials(x: Any, count: int) -> Any:
    """T₀ … of 2x − 1, last axis."""
    xp, y = library(x), 2.0 * x - 1.0
    found = [xp.ones_like(y), y]
    for _ in range(count - 2):
        found.append(2.0 * y * found[-1] - found[-2])
    return xp.stack(found, axis=-1)


def _points(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Chebyshev points on [0, 1], and the matrix from values at them to coefficients of `_polynomials`."""
    x = (np.polynomial.chebyshev.chebpts1(count) + 1.0) / 2.0
    return x, np.linalg.inv(_polynomials(x, count))


ROOTS, TO_LEAVING = _points(LEAVING)
"""√c of the outer nodes; from values there to coefficients of a `series`."""

_BELOW, _TO_KEPT = _points(KEPT)

FINE = np.insert(ROOTS, np.arange(1, LEAVING), (ROOTS[1:] + ROOTS[:-1]) / 2.0)
"""And the middles between them."""

_X, _WEIGHTS = (gauss(16)[0] + 1.0) / 2.0, gauss(16)[1] / 2.0
_SHARES_LEAVING = (4.0 * _WEIGHTS * _X**3) @ _polynomials(_X, LEAVING) @ TO_LEAVING
_SHARES_KEPT = (2.0 * _WEIGHTS * _X) @ _polynomials(_X, KEPT) @ _TO_KEPT
