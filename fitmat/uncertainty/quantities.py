"""Parameters as people read them: value, standard deviation, interval, unit, symbol; and what follows from them.

Takes all numbers from a posterior; formats nothing.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from fitmat.fitting.coordinates import channel_names, coordinates
from fitmat.fitting.result import Fit
from fitmat.maths.normal import Z95
from fitmat.models.conversion import alpha_from_exponent, exponent_from_alpha
from fitmat.models.parameters import Entry
from fitmat.models.terms.fresnel import eta_from_f0, f0_from_eta
from fitmat.uncertainty.estimate import Quantity, limits
from fitmat.uncertainty.posterior import Posterior

UNDETERMINED = "not determined"
"""Remark on what has an interval but no value to rely on."""

SEVERAL = "another optimum fits as well"
"""Remark on what has several values, which its interval holds, and none to rely on."""


def parameters(posterior: Posterior, undetermined: Collection[str] = ()) -> list[Quantity]:
    """The model's parameters, then the discrepancy s where the loss infers it; an objective gives values only.

    Value: the best fit. Intervals: `estimate.limits` of the draws where these follow the posterior itself; otherwise
    Laplace, computed in the logarithm for parameters whose scale is log.

    Args:
        posterior: Of the fit.
        undetermined: Names of parameters, with their channel where there are several, that are not determined beside
            those of the fit.
    """
    fit = posterior.fit
    sampled = posterior.exact
    sd = posterior.sd() if sampled else np.sqrt(np.diagonal(fit.covariance))
    if not fit.loss.posterior:
        sd = np.full_like(sd, np.nan)
    ci95 = posterior.interval() if sampled else _laplace_interval(posterior, sd)
    every = coordinates(fit.model)
    sure = np.where(every.side(fit.values) != 0, np.nan, sd)
    for name, place in zip(fit.coordinates.names, fit.coordinates.places, strict=True):
        others = fit.elsewhere.get(name, ())
        ci95[place] = min(ci95[place, 0], *others, np.inf), max(ci95[place, 1], *others, -np.inf)
        sure[place] = np.nan if others else sure[place]
    result = []
    for entry in fit.entries:
        held, p = entry.name in fit.held, entry.param
        remark = "fixed" if held else ""
        if entry.name in fit.undetermined:
            remark = UNDETERMINED
        elif entry.name in fit.on_bound:
            remark = f"at its {fit.on_bound[entry.name]} bound"
        names = channel_names(entry, fit.measurements.channels)
        given = np.full(entry.size, np.nan) if held else sure[entry.place]
        result.append(
            Quantity(
                *(entry.name, p.symbol, p.unit, p.doc, fit.values[entry.place], given, ci95[entry.place]),
                per_channel=bool(entry.shape),
                remarks=tuple(_remark(fit, name, remark, undetermined) for name in names),
            )
        )
    return [*result, _discrepancy(posterior)] if fit.loss.infers_discrepancy else result


def _remark(fit: Fit, name: str, remark: str, undetermined: Collection[str]) -> str:
    if name in undetermined:
        return UNDETERMINED
    return SEVERAL if name in fit.elsewhere and remark != UNDETERMINED else remark


def _discrepancy(posterior: Posterior) -> Quantity:
    """s; where the best fit has none, its interval is one-sided."""
    best, draws = posterior.fit.discrepancy, posterior.discrepancy
    ends = limits(np.asarray(best), draws) if best > 0 else np.array([0.0, np.quantile(draws, 0.95)])
    words = "spread of ∛(f cosθ_i) that the model cannot explain"
    return Quantity(
        *("discrepancy", "s", "sr^(-1/3)", words, np.array([best]), np.array([draws.std()]), ends[None]),
        per_channel=False,
        remarks=("",),
    )


def _laplace_interval(posterior: Posterior, sd: np.ndarray) -> np.ndarray:
    every, v = coordinates(posterior.fit.model), posterior.fit.values
    with np.errstate(over="ignore"):
        ratio = np.exp(Z95 * sd / every.slope(v))
        low = np.where(every.ratio, v / ratio, v - Z95 * sd)
        high = np.where(every.ratio, v * ratio, v + Z95 * sd)
    ends = zip(every.around(every.natural(v)), (every.lower, every.upper), strict=True)
    least, most = (np.where(every.ratio, bound, seen) for seen, bound in ends)
    return np.stack([np.maximum(low, least), np.minimum(high, most)], axis=1)


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
