"""The standard normal distribution: its cumulative distribution function, the logarithm of that, and quantiles.

Plain NumPy on arrays: nothing here is compiled or differentiated, and no other distribution is known.
"""

from typing import Any

import numpy as np
from jaxtyping import Float

Z95 = 1.959964
"""Standard deviations to either end of a central 95 % interval."""

SMALL, LARGE = 0.46875, 4.0
"""Where Cody's approximations of the error function meet."""

_ERF = (
    (3.20937758913846947e3, 3.77485237685302021e2, 1.13864154151050156e2, 3.16112374387056560, 1.85777706184603153e-1),
    (2.84423683343917062e3, 1.28261652607737228e3, 2.44024637934444173e2, 2.36012909523441209e1, 1.0),
)
_ERFCX = (
    (1.23033935479799725e3, 2.05107837782607147e3, 1.71204761263407058e3, 8.81952221241769090e2, 2.98635138197400131e2,
     6.61191906371416295e1, 8.88314979438837594, 5.64188496988670089e-1, 2.15311535474403846e-8),
    (1.23033935480374942e3, 3.43936767414372164e3, 4.36261909014324716e3, 3.29079923573345963e3, 1.62138957456669019e3,
     5.37181101862009858e2, 1.17693950891312499e2, 1.57449261107098347e1, 1.0),
)  # fmt: skip
_FAR = (
    (6.58749161529837803e-4, 1.60837851487422766e-2, 1.25781726111229246e-1, 3.60344899949804439e-1,
     3.05326634961232344e-1, 1.63153871373020978e-2),
    (2.33520497626869185e-3, 6.05183413124413191e-2, 5.27905102951428412e-1, 1.87295284992346725, 2.56852019228982242,
     1.0),
)  # fmt: skip
# Numerators and denominators of Cody 1969, tables II and III, from the constant upwards.

_CENTRE = (
    (3.3871328727963666080, 1.3314166789178437745e2, 1.9715909503065514427e3, 1.3731693765509461125e4,
     4.5921953931549871457e4, 6.7265770927008700853e4, 3.3430575583588128105e4, 2.5090809287301226727e3),
    (1.0, 4.2313330701600911252e1, 6.8718700749205790830e2, 5.3941960214247511077e3, 2.1213794301586595867e4,
     3.9307895800092710610e4, 2.8729085735721942674e4, 5.2264952788528545610e3),
)  # fmt: skip
_SHOULDER = (
    (1.42343711074968357734, 4.63033784615654529590, 5.76949722146069140550, 3.64784832476320460504,
     1.27045825245236838258, 2.41780725177450611770e-1, 2.27238449892691845833e-2, 7.74545014278341407640e-4),
    (1.0, 2.05319162663775882187, 1.67638483018380384940, 6.89767334985100004550e-1, 1.48103976427480074590e-1,
     1.51986665636164571966e-2, 5.47593808499534494600e-4, 1.05075007164441684324e-9),
)  # fmt: skip
_TAIL = (
    (6.65790464350110377720, 5.46378491116411436990, 1.78482653991729133580, 2.96560571828504891230e-1,
     2.65321895265761230930e-2, 1.24266094738807843860e-3, 2.71155556874348757815e-5, 2.01033439929228813265e-7),
    (1.0, 5.99832206555887937690e-1, 1.36929880922735805310e-1, 1.48753612908506148525e-2, 7.86869131145613259100e-4,
     1.84631831751005468180e-5, 1.42151175831644588870e-7, 2.04426310338993978564e-15),
)  # fmt: skip
# Numerators and denominators of Wichura 1988, PPND16, from the constant upwards.


def cdf(x: Float[Any, "..."]) -> Float[np.ndarray, "..."]:
    """Φ(x), to 1e-15 of itself in both tails; the upper tail, 1 − Φ(x), is `cdf(-x)`.

    Φ(x) = (1 + erf(x/√2))/2, below as erfcx(−x/√2) exp(−x²/2)/2, with the approximations of W. J. Cody, Mathematics of
    Computation 23(107), 1969.

    Args:
        x: Any numbers, infinities too; NaN stays NaN.
    """
    x = np.asarray(x, float)
    below = _lower(-np.abs(x))
    return np.where(x > 0.0, 1.0 - below, below)


def log_cdf(x: Float[Any, "..."]) -> Float[np.ndarray, "..."]:
    """ln Φ(x), to 1e-14 of itself also where Φ(x) is 0 or 1 to double precision; arguments as in `cdf`.

    Below −1 it is −x²/2 + ln(erfcx(−x/√2)/2), above ln(1 − Φ(−x)).
    """
    x = np.asarray(x, float)
    found, far = np.empty(x.shape), x < -1.0
    with np.errstate(divide="ignore"):  # −∞ stays −∞
        found[far] = np.log(0.5 * _erfcx(-x[far] / np.sqrt(2.0))) - 0.5 * x[far] ** 2
    found[~far] = np.log1p(-cdf(-x[~far]))
    return found


def quantile(p: Float[Any, "..."]) -> Float[np.ndarray, "..."]:
    """The x with Φ(x) = p, to 1e-15 of itself; the upper quantile of a small p is `-quantile(p)`.

    M. J. Wichura, "Algorithm AS 241: the percentage points of the normal distribution", Applied Statistics 37(3), 1988,
    PPND16: rational functions of p − ½ in the centre and of r = √(−ln min(p, 1 − p)) in the tails.

    Args:
        p: Probabilities; 0 and 1 give −∞ and ∞, what is no probability gives NaN.
    """
    p = np.asarray(p, float)
    q, found = p - 0.5, np.full(p.shape, np.nan)
    centre, smaller = np.abs(q) <= 0.425, np.minimum(p, 1.0 - p)
    found[centre] = q[centre] * _ratio(_CENTRE, 0.180625 - q[centre] ** 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        r = np.sqrt(-np.log(smaller))
    for rows, table, offset in ((~centre & (r <= 5.0), _SHOULDER, 1.6), (np.isfinite(r) & (r > 5.0), _TAIL, 5.0)):
        found[rows] = np.copysign(_ratio(table, r[rows] - offset), q[rows])
    return np.where(smaller == 0.0, np.copysign(np.inf, q), found)


def _lower(x: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Φ(x) of x ≤ 0."""
    y, found = -x / np.sqrt(2.0), np.empty(x.shape)
    near = y <= SMALL
    found[near] = 0.5 - 0.5 * y[near] * _ratio(_ERF, y[near] ** 2)
    # x² in two parts, the first exact, lest its rounding spoil the exponential of a large number.
    t = np.maximum(x[~near], -40.0)
    first = np.trunc(16.0 * t) / 16.0
    bell = np.exp(-0.5 * first * first) * np.exp(-0.5 * (t - first) * (t + first))
    found[~near] = 0.5 * _erfcx(y[~near]) * bell
    return found


def _erfcx(y: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """exp(y²) erfc(y) of y > `SMALL`."""
    found = np.empty(y.shape)
    far = y > LARGE
    found[~far] = _ratio(_ERFCX, y[~far])
    inverse = 1.0 / y[far]
    square = inverse * inverse
    found[far] = inverse * (1.0 / np.sqrt(np.pi) - square * _ratio(_FAR, square))
    return found


def _ratio(table: tuple[tuple[float, ...], tuple[float, ...]], x: np.ndarray) -> np.ndarray:
    """A rational function, numerator and denominator by Horner's rule."""
    one, other = (np.full(x.shape, coefficients[-1]) for coefficients in table)
    for found, coefficients in zip((one, other), table, strict=True):
        for coefficient in coefficients[-2::-1]:
            found *= x
            found += coefficient
    return one / other
