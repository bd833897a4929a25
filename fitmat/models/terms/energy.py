"""Energy that single scattering loses at facets that reflect everything, for GGX and Beckmann, as fitted polynomials.

Averages over the hemisphere follow from the same polynomials. What the facets absorb or transmit is not known here.
"""

import functools
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from fitmat.maths.arrays import library
from fitmat.maths.quadrature import chebyshev, gauss
from fitmat.models.glsl import AbstractShaded, scalar, table
from fitmat.models.terms.distributions import AbstractDistribution, Masking

FILE = Path(__file__).with_name("energies.npz")
"""For each distribution and masking the coefficients of `Missing`, (`DEGREES`); made by `benchmarks/energies.py`."""

DEGREES = (24, 16)
"""Terms in the cosine and in alpha."""

ERROR = 1.3e-4
"""Absolute; the largest error of the albedo for alpha from 1e-4 to 1 and any cosine: 1.2e-4 with V-cavities, 4e-5 with
Smith's masking, 5e-7 with the separable form of GGX; their root mean squares are a tenth of these."""

LEAST_ALPHA = 1e-4

SCALE = 2.0
# The cosine enters as c (1 + 2α)/(c + 2α): masking acts where c is of the order of alpha.

SMALLEST = 1e-6
# What is missing is kept positive: m becomes (m + √(m² + SMALLEST²))/2.


class Missing(AbstractShaded):
    """1 − E(c) for one alpha: what single scattering at white facets loses of the light from a cosine.

    Attributes:
        coefficients: Of Chebyshev polynomials in 2u − 1, u = c (1 + 2α)/(c + 2α).
        alpha: Slope parameter.
    """

    coefficients: Float[Any, " k"]
    alpha: Float[Any, ""]

    def __call__(self, cos: Float[Any, " *n"]) -> Float[Any, " *n"]:
        """1 − E at cosines in [0, 1], above 0; off by at most `ERROR`."""
        xp = library(cos, self.alpha, self.coefficients)
        c = xp.maximum(cos, 0.0)
        u = c * (1.0 + SCALE * self.alpha) / (c + SCALE * self.alpha)
        found = chebyshev(self.coefficients, 2.0 * u - 1.0)
        return 0.5 * (found + xp.sqrt(found**2 + SMALLEST**2))

    def glsl(self) -> str:
        """`lost(c)` for a lobe with one `alpha`, about c = 1, where it is small: m = m₁ − t q(1 − t), t = 2(1 − u)."""
        coefficients = np.asarray(self.coefficients)
        first = coefficients.sum()  # every T_k(1) is 1
        rest, _ = np.polynomial.chebyshev.chebdiv(coefficients - first * np.eye(1, len(coefficients))[0], [-1.0, 1.0])
        at_normal, slope = scalar("at_normal", first), table("slope", np.pad(rest, (0, len(coefficients) - len(rest))))
        return (
            at_normal
            + slope
            + """
// 1 - E(c): what single scattering at white facets loses of the light from a cosine, to 1.3e-4.
float lost(float c) {
    float t = 4.0 * alpha * (1.0 - c) / (c + 2.0 * alpha);
    float m = at_normal - t * chebyshev(slope, 1.0 - t);
    return 0.5 * (m + sqrt(m * m + 1e-12));
}
"""
        )

    def average(self) -> Float[Any, ""]:
        """2∫ (1 − E(c)) c dc, of light that comes evenly from the hemisphere; Gauss in √c."""
        return _SHARES @ self(_COSINES)


def missing(distribution: AbstractDistribution, masking: Masking, alpha: Float[Any, ""]) -> Missing:
    """What a lobe D G/(4 c_i c_o) with F = 1 loses; a polynomial in alpha, so that value and slope belong together.

    Args:
        distribution: GGX or Beckmann.
        masking: As `distributions.visibility`.
        alpha: Slope parameter, 1e-4 to 1; where it is a plain number, NumPy computes.
    """
    table = _tables()[f"{distribution.label}-{masking}"]
    x = 2.0 * (alpha - LEAST_ALPHA) / (1.0 - LEAST_ALPHA) - 1.0
    return Missing(chebyshev(table.T, x), alpha)


@functools.cache
def _tables() -> dict[str, np.ndarray]:
    with np.load(FILE) as file:
        return {name: np.asarray(file[name], float) for name in file.files}


_X, _WEIGHTS = gauss(48)
_COSINES = ((_X + 1) / 2) ** 2
_SHARES = 2.0 * ((_X + 1) / 2) ** 3 * _WEIGHTS
