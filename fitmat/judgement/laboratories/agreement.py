"""Agreement: one quantity as several laboratories have it, whether they agree, and what follows from all.

χ² = Σ (x_l − x̄)²/u_l² about the weighted mean says whether they agree within their uncertainties. The value of all is
that of Paule & Mandel (J. Res. NBS 87, 1982): weights 1/(u_l² + u_b²), the variance u_b² between laboratories being
what makes the weighted sum of squares equal to its expectation, L − 1, or 0. It knows no fit.
"""

import dataclasses
from typing import Any

import numpy as np
from jaxtyping import Float

from fitmat.maths.normal import Z95
from fitmat.text import brief


@dataclasses.dataclass(frozen=True, eq=False)
class Agreement:
    """One quantity as the laboratories have it.

    Attributes:
        name: With its channel where there are several.
        values: Of each laboratory, (L,); NaN where it does not determine the quantity.
        u: Combined standard uncertainties, (L,).
        chi2: Σ (x_l − x̄)²/u_l² about the weighted mean.
        freedom: Laboratories that determine it, less one.
        p: Probability of a larger χ² where all agree.
        between: u_b, standard deviation between laboratories (Paule & Mandel).
        value: Of all.
        uncertainty: Its standard uncertainty.
        ci95: Its 95 % interval; Student's t with L − 1 degrees of freedom where the laboratories scatter more than they
            state, else the normal distribution.
        agree: Whether they do, allowing for how many quantities are looked at (Holm).
    """

    name: str
    values: Float[np.ndarray, " L"]
    u: Float[np.ndarray, " L"]
    chi2: float
    freedom: int
    p: float
    between: float
    value: float
    uncertainty: float
    ci95: tuple[float, float]
    agree: bool = True

    __repr__ = brief


def agreement(name: str, values: Float[np.ndarray, " L"], u: Float[np.ndarray, " L"]) -> Agreement:
    """One quantity: do the laboratories agree, and what follows from all.

    Args:
        name: Of the quantity.
        values: Of each laboratory.
        u: Standard uncertainties; NaN where a laboratory does not determine it, of two at least numbers.
    """
    from scipy.special import chdtrc, stdtrit

    known = np.isfinite(u) & np.isfinite(values) & (u > 0)
    x, s = values[known], u[known]
    freedom = len(x) - 1
    chi2 = float(_square(x, s, 0.0))
    between = paule_mandel(x, s)
    weight = 1.0 / (s**2 + between**2)
    value, uncertainty = float(weight @ x / weight.sum()), float(1.0 / np.sqrt(weight.sum()))
    reach = uncertainty * (float(stdtrit(freedom, 0.975)) if between > 0 else Z95)
    shown = np.where(known, values, np.nan), np.where(known, u, np.nan)
    p = float(chdtrc(freedom, chi2))
    return Agreement(name, *shown, chi2, freedom, p, between, value, uncertainty, (value - reach, value + reach))


def _square(x: np.ndarray, u: np.ndarray, between: float) -> float:
    weight = 1.0 / (u**2 + between**2)
    return float(weight @ (x - weight @ x / weight.sum()) ** 2)


def paule_mandel(x: Float[np.ndarray, " L"], u: Float[np.ndarray, " L"]) -> float:
    """u_b ≥ 0 at which Σ (x_l − x̄)²/(u_l² + u_b²) = L − 1 (Paule & Mandel 1982); 0 where it is less at 0."""
    from scipy.optimize import brentq

    if _square(x, u, 0.0) <= len(x) - 1:
        return 0.0
    largest = float(np.ptp(x))  # at which the sum is below L/4
    found: Any = brentq(lambda between: _square(x, u, between) - (len(x) - 1), 0.0, largest, xtol=1e-12 * largest)
    return float(found)
