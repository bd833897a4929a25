"""Indices: the refractive index of every channel that a fit found by a law, with what the data leave open of it.

It fits nothing: the law's parameters carry their covariance to η and κ, to first order.
"""

import dataclasses

import numpy as np
from jaxtyping import Float

from fitmat import arguments
from fitmat.errors import ModelError
from fitmat.fitting.dispersed import laws_of
from fitmat.fitting.result import Fit
from fitmat.models.parameters import with_vector
from fitmat.text import brief

STEP = 1e-3
"""Of the differences, in standard deviations."""


@dataclasses.dataclass(frozen=True, eq=False)
class Indices:
    """The refractive index of each channel.

    Attributes:
        nm: Wavelength in vacuum, (c,).
        eta: Real part, (c,).
        eta_sd: Its standard deviation, (c,); NaN where the loss knows none.
        kappa: Imaginary part, (c,); 0 of a dielectric.
        kappa_sd: Its standard deviation, (c,).
    """

    nm: Float[np.ndarray, " c"]
    eta: Float[np.ndarray, " c"]
    eta_sd: Float[np.ndarray, " c"]
    kappa: Float[np.ndarray, " c"]
    kappa_sd: Float[np.ndarray, " c"]

    __repr__ = brief


def indices(fit: Fit) -> Indices:
    """η + iκ of every channel, from a fit with a law (`fit(…, dispersion="cauchy")`).

    Args:
        fit: Of a model whose lobes share one law; of several, that of the first.

    Raises:
        FitmatError: no law was fitted.

    Example:
        >>> indices(fit("plastic.csv", "lambert+ggx", dispersion="cauchy")).eta  # doctest: +SKIP
    """
    arguments.kind("fit", fit, Fit)
    if not laws_of(fit.model):
        raise ModelError(f"{fit.name} has no law of its refractive index; fit it with dispersion='cauchy' or another.")
    covariance = np.nan_to_num(fit.covariance)  # of what sits on a bound nothing is known
    sd = np.sqrt(np.diagonal(covariance))
    found, slopes = _of(fit, fit.values), np.zeros((len(sd), 2, len(fit.measurements.channels)))
    for k in np.flatnonzero(sd > 0):
        step = STEP * sd[k] * np.eye(len(sd))[k]
        slopes[k] = (_of(fit, fit.values + step) - _of(fit, fit.values - step)) / (2.0 * STEP * sd[k])
    spread = np.sqrt(np.einsum("pqc,pr,rqc->qc", slopes, covariance, slopes))
    if not fit.loss.posterior:
        spread = np.full_like(spread, np.nan)
    nm = 1e3 * np.array(laws_of(fit.model)[0].um)
    return Indices(nm, found[0], spread[0], found[1], spread[1])


def _of(fit: Fit, values: Float[np.ndarray, " p"]) -> Float[np.ndarray, "2 c"]:
    return np.stack([np.asarray(part) for part in laws_of(with_vector(fit.model, values))[0].index()])
