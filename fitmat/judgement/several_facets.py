"""Light that meets several facets: how much of it a fitted lobe of single scattering leaves out, in a sentence.

An estimate from tabulated energies; Heitz's walk (`ggx-walk`) has the true values.
"""

import jax
import numpy as np
from jaxtyping import Float

from fitmat.fitting.result import Fit
from fitmat.models.around.shown import surface
from fitmat.models.base import Sum
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.terms.distributions import Isotropic
from fitmat.models.terms.energy import missing
from fitmat.models.terms.fresnel import average

SMALL = 5e-4
"""A fraction of the light below which a number says nothing."""


def left_out(fit: Fit) -> str:
    """What `-kc` would add to the albedo at the measured incidences; "" where no lobe is one of single scattering.

    F_ms (1 − E(c_i)) ks, the energy of Kulla & Conty's term, within 0.04 of Heitz's walk (docs/models.md).
    """
    model = surface(fit.model)
    lobes = [lobe for lobe in (model.lobes if isinstance(model, Sum) else (model,)) if isinstance(lobe, Microfacet)]
    known = [lobe for lobe in lobes if isinstance(lobe.roughness, Isotropic)]
    if not fit.finite or not known:
        return ""
    incidences = np.unique(np.round(fit.measurements.theta_i, 6))
    added = np.sum([_added(lobe, np.cos(incidences)) for lobe in known], axis=0)
    name, most = " and ".join(lobe.name for lobe in known), int(np.argmax(added))
    begin = f"{name} counts light that meets one facet; light that meets several would add"
    if added[most] < SMALL:
        return f"{begin} less than 0.001 to the albedo at the measured incidences."
    instead = " and ".join(f"{lobe.distribution.label}-kc{lobe.fresnel.suffix}" for lobe in known)
    least = f" (of the measured incidences the most; {added.min():.3f} at least)" if len(added) > 1 else ""
    at = f"{np.rad2deg(incidences[most]):.3g}°{least}"
    return f"{begin} about {added[most]:.3f} to the albedo at {at}: {instead} fits with it."


def _added(lobe: Microfacet, cos: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """By one lobe, the mean over channels."""
    lobe = jax.tree.map(np.asarray, lobe)
    lost, f_avg = missing(lobe.distribution, lobe.masking, lobe.roughness.slopes[0]), average(lobe.fresnel)
    mean = lost.average()
    f_ms = f_avg**2 * (1.0 - mean) / (1.0 - f_avg * mean)
    return float(np.mean(lobe.ks * f_ms)) * np.asarray(lost(cos))
