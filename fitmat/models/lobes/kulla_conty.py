"""Kulla and Conty's compensation: a microfacet lobe that gives back the energy which single scattering loses.

It knows isotropic roughness only.
"""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from fitmat._types import Spectrum, Vec3
from fitmat.maths.directions import above
from fitmat.models.glsl import scalar, spectrum
from fitmat.models.lobes.microfacet import AbstractMicrofacet
from fitmat.models.terms.distributions import Isotropic
from fitmat.models.terms.energy import missing
from fitmat.models.terms.fresnel import average


class KullaConty(AbstractMicrofacet):
    """Microfacet reflection that conserves energy (`ggx-kc`, `beckmann-kc`), after Kulla & Conty 2017.

    f = ks (F D G/(4 c_i c_o) + F_ms (1 − E(c_i))(1 − E(c_o))/(π (1 − E_avg))),
    F_ms = F_avg² E_avg/(1 − F_avg (1 − E_avg))

    E(c) is the albedo of the lobe with F = 1, E_avg and F_avg are averages over the hemisphere, 2∫ · c dc. A fit with
    this lobe finds the alpha and Fresnel level that belong into a renderer which conserves energy.

    Parameters: as `ggx`: ks, 0 to 10; alpha, 0.0001 to 1; eta, f0, f0 and f82, or eta and kappa.

    Static choice: masking, as `ggx`.

    Limits: alpha → 0 is `ggx`. With F = 1 the albedo is 1 at every angle, within 1.3e-4: E is a polynomial in alpha and
    a function of the cosine that was fitted to the integral once (`terms/energy.py`).
    What a dielectric transmits stays lost: combine with a diffuse lobe. Isotropic roughness only. Positive,
    reciprocal, conserves energy for ks ≤ 1.

    References: C. Kulla & A. Conty, Revisiting physically based shading at Imageworks, SIGGRAPH course 2017; the
    square of F_avg: S. Hill, A multi-faceted exploration, 2018 (the first bounce is in the single scattering, so what
    is left has met at least two facets).

    Example: `fm.model("ggx-kc-conductor", alpha=0.5, eta=0.2, kappa=3.5)`
    """

    label: ClassVar[str] = "{distribution.label}-kc{fresnel.suffix}"
    numbers: ClassVar[tuple[str, ...]] = ("alpha", "eta", "f0", "f82", "kappa")

    roughness: Isotropic = eqx.field(default_factory=Isotropic)  # pyright: ignore[reportIncompatibleVariableOverride]

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """Single scattering plus what the other facets return."""
        single = self.single(wi, wo)
        lost, f_avg = missing(self.distribution, self.masking, self.roughness.alpha), average(self.fresnel)
        mean = lost.average()
        f_ms = f_avg**2 * (1.0 - mean) / (1.0 - f_avg * mean)
        multiple = f_ms * lost(wi[2]) * lost(wo[2]) / (jnp.pi * mean)
        return single + jnp.where(above(wi, wo), self.ks * multiple, 0.0)

    def glsl(self) -> str:
        """The same; what depends on no direction is a number."""
        lost, f_avg = missing(self.distribution, self.masking, self.roughness.alpha), average(self.fresnel)
        mean = lost.average()
        f_ms = f_avg**2 * (1.0 - mean) / (1.0 - f_avg * mean)
        return (
            scalar("mean", mean)
            + spectrum("f_ms", f_ms)
            + lost.glsl()
            + self.single_glsl()
            + """
vec3 lobe(vec3 wi, vec3 wo) {
    return single(wi, wo) + ks * f_ms * lost(wi.z) * lost(wo.z) / (PI * mean);
}
"""
        )
