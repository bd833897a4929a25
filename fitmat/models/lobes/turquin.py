"""Turquin's compensation: a microfacet lobe scaled up by what single scattering loses towards the viewer.

It knows isotropic roughness only.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar

import equinox as eqx

from fitmat._types import Spectrum, Vec3
from fitmat.models.glsl import spectrum
from fitmat.models.lobes.microfacet import AbstractMicrofacet
from fitmat.models.terms.distributions import Isotropic
from fitmat.models.terms.energy import Missing, missing


class Turquin(AbstractMicrofacet):
    """Microfacet reflection with the energy of multiple scattering as today's renderers have it (`ggx-turquin`).

    f = ks F D G/(4 c_i c_o) (1 + F0 (1 − E(c_o))/E(c_o))

    E(c) is the albedo of the lobe with F = 1 and F0 the reflectance at normal incidence: the lobe keeps its shape and
    is scaled until a white one reflects all light that a viewer could receive. A fit with this lobe finds the alpha
    and Fresnel level that belong into such a renderer.

    Parameters: as `ggx`: ks, 0 to 10; alpha, 0.0001 to 1; eta, f0, f0 and f82, or eta and kappa.

    Static choice: masking, as `ggx`.

    Limits: alpha → 0 is `ggx`. Not reciprocal: E is taken at the viewer, ω_o, as renderers do. With F = 1 the light
    that comes from everywhere towards one viewer is 1 (within 1e-4), while light that comes from one direction leaves
    in sum with up to twice its energy at alpha 1 near grazing, 1.15 times at alpha 0.3: `ggx-kc` is reciprocal and
    conserves energy. Isotropic roughness only. Positive.

    References: E. Turquin, Practical multiple scattering compensation for microfacet models, Industrial Light & Magic,
    2019; the same factor: R. Guy & M. Agopian, Physically based rendering in Filament, "energy loss in specular
    reflectance", 2018.

    Example: `fm.model("ggx-turquin-conductor", alpha=0.5, eta=0.2, kappa=3.5)`
    """

    label: ClassVar[str] = "{distribution.label}-turquin{fresnel.suffix}"
    numbers: ClassVar[tuple[str, ...]] = ("alpha", "eta", "f0", "f82", "kappa")
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType(
        {
            "reciprocal": "its factor is that of the viewer's direction alone",
            "energy": "with f0 = 0.999 and alpha = 1 light from 89° leaves with 2.1 times its energy",
        }
    )

    roughness: Isotropic = eqx.field(default_factory=Isotropic)  # pyright: ignore[reportIncompatibleVariableOverride]

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """Single scattering times 1 + F0 (1 − E)/E."""
        return self.single(wi, wo) * self.gain(wo[2])

    def gain(self, cos_o: Any) -> Any:
        """1 + F0 (1 − E)/E towards viewers at these cosines: a number, or (a, 1); for each channel."""
        lost = self._missing()(cos_o)
        return 1.0 + self.fresnel.normal_reflectance() * lost / (1.0 - lost)

    def _missing(self) -> Missing:
        return missing(self.distribution, self.masking, self.roughness.alpha)

    def glsl(self) -> str:
        """The same."""
        return (
            spectrum("normal", self.fresnel.normal_reflectance())
            + self._missing().glsl()
            + self.single_glsl()
            + """
vec3 lobe(vec3 wi, vec3 wo) {
    return single(wi, wo) * (1.0 + normal * lost(wo.z) / (1.0 - lost(wo.z)));
}
"""
        )
