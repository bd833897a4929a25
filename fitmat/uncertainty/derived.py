"""Derived: what follows from the parameters of a fit, f0 from eta, an exponent from alpha, with its interval.

Takes all numbers from a posterior; formats nothing.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from fitmat.fitting.quantities import Quantity
from fitmat.models.conversion import alpha_from_exponent, exponent_from_alpha
from fitmat.models.parameters import Entry
from fitmat.models.terms.fresnel import eta_from_f0, f0_from_eta
from fitmat.uncertainty.estimate import limits
from fitmat.uncertainty.posterior import Posterior


class Following(NamedTuple):
    """What follows from parameters, at many vectors of them.

    Attributes:
        name: Of the quantity.
        symbol: The letter of the literature.
        doc: What it means.
        values: At each vector, one entry per channel or a single one, (m, k).
        source: The parameter that it stands and falls with; "" where it may be known though none of its is.
    """

    name: str
    symbol: str
    doc: str
    values: np.ndarray
    source: str


def following(names: Mapping[str, Entry], draws: Float[np.ndarray, "m p"], held: Collection[str]) -> list[Following]:
    """What follows from the parameters of a model.

    f0 and eta from each other (or f0 from η + iκ), and ks·F0 where ks is fitted; the exponent 2/α² − 2 of the Blinn
    lobe as wide as a microfacet lobe and the alpha √(2/(n+2)) of a Phong lobe; the artists' roughness √α.

    Args:
        names: The parameters by name.
        draws: Vectors of them, physical.
        held: Names of those that are fixed.
    """

    def of(name: str) -> np.ndarray:
        return draws[:, names[name].place]

    found, f0 = [], None
    if "eta" in names and "kappa" in names:
        square, eta = of("kappa") ** 2, of("eta")
        f0 = ((eta - 1) ** 2 + square) / ((eta + 1) ** 2 + square)
    elif "eta" in names:
        f0 = f0_from_eta(of("eta"))
    if f0 is not None:
        found.append(Following("f0", "F0", "reflectance at normal incidence", f0, "eta"))
    elif "f0" in names:
        f0 = of("f0")
        found.append(Following("eta", "η", "index of the dielectric with that F0", eta_from_f0(f0), "f0"))
    if f0 is not None and "ks" in names and "ks" not in held:
        found.append(Following("ks·F0", "k_s·F0", "strength of the highlight seen head on", of("ks") * f0, ""))
    if "alpha" in names:
        alpha, doc = of("alpha"), "exponent of the Blinn lobe as wide, 2/α² − 2"
        found.append(Following("exponent", "n", doc, exponent_from_alpha(alpha), "alpha"))
        found.append(Following("roughness", "√α", "artists' roughness", np.sqrt(alpha), "alpha"))
    if "exponent" in names:
        width, doc = alpha_from_exponent(of("exponent")), "slope of the microfacet lobe as wide, √(2/(n+2))"
        found.append(Following("alpha", "α", doc, width, "exponent"))
    return found


def derived(posterior: Posterior, fitted: Sequence[Quantity]) -> list[Quantity]:
    """`following` with intervals from the draws; `fitted` are the `parameters`."""
    fit = posterior.fit
    some = fit.rivals if fit.elsewhere else fit.rivals[:0].reshape(0, len(fit.values))
    draws = np.vstack([fit.values, some, posterior.values])
    found = following({e.name: e for e in fit.entries}, draws, fit.held)
    return [_from_draws(item, posterior, fitted) for item in found]


def _from_draws(item: Following, posterior: Posterior, fitted: Sequence[Quantity]) -> Quantity:
    draws, channels = item.values, item.values.shape[1]
    ci95, sd = limits(draws[0], draws[1:]).T, draws[1:].std(axis=0)
    if not posterior.fit.loss.posterior:
        ci95, sd = np.full_like(ci95, np.nan), np.full_like(sd, np.nan)
    origin = next((q for q in fitted if q.name == item.source), None)
    if origin is None:
        several, remarks = channels > 1, ("",) * channels
    else:
        several, remarks, sd = origin.per_channel, origin.remarks, np.where(np.isfinite(origin.sd), sd, np.nan)
    return Quantity(item.name, item.symbol, "1", item.doc, draws[0], sd, ci95, several, remarks)
