"""pbrt-v4: the closest of its diffuse, its rough conductor, and a mixture of the two, as blocks of a scene.

No pbrt is run. Its coated materials, whose values are estimated by random walks, are not here.
"""

from collections.abc import Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.errors import ModelError
from fitmat.exports.closest import Closest, closest, coloured
from fitmat.exports.material import Chosen
from fitmat.exports.metallic_roughness import fraction, tangent
from fitmat.maths.directions import above
from fitmat.models.base import AbstractLobe
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.parameters import param
from fitmat.models.terms.distributions import AbstractRoughness, Anisotropic, Isotropic
from fitmat.models.terms.fresnel import Conductor

SMOOTH = 1e-3
"""Slopes below which pbrt takes a conductor for a mirror."""

NONE = 0.01
"""The extinction of a dielectric: the least that the Fresnel term has, which adds 2e-5 to its reflectance."""

ENDS = 360, 830
"""Nanometres that pbrt samples, over which a grey value is constant."""

ASSUMED = (
    "Numbers mean the formulas of pbrt-v4: GGX with alpha itself (remaproughness false), Smith's masking correlated in "
    "height, the exact conductor, single scattering; a dielectric is a conductor of extinction 0.01. No pbrt was run."
)

COLOURED = (
    "pbrt is spectral: it makes spectra of the three numbers, and its red, green and blue differ a little from theirs, "
    "most where light is reflected several times."
)


class Mixture(AbstractLobe):
    """pbrt-v4's mix of a diffuse material and a rough conductor.

    f = (1 − a) c/π + a F D G/(4 c_i c_o)

    F is the exact conductor's, D GGX, G Smith's height-correlated masking.

    Parameters: reflectance c, 0 to 1, per channel; amount a, 0 to 1; eta and kappa, per channel; alpha, or alpha_x,
    alpha_y and rotation.

    Reference: M. Pharr, W. Jakob & G. Humphreys, pbrt-v4: src/pbrt/bxdfs.h (DiffuseBxDF, ConductorBxDF),
    src/pbrt/util/scattering.h, src/pbrt/materials.h (MixMaterial).
    """

    label: ClassVar[str] = "pbrt{roughness.suffix}"

    reflectance: Spectrum = param(
        0.0, 1.0, symbol="c", per_channel=True, weight=True, default=0.5, doc="albedo of the diffuse material"
    )
    amount: Scalar = fraction("a", 0.5, (0.3, 0.8), "share of the conductor")
    roughness: AbstractRoughness = eqx.field(default_factory=Isotropic)
    fresnel: Conductor = eqx.field(default_factory=Conductor)

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """Both, weighted."""
        white: dict[str, Any] = {"ks": jnp.ones(())}
        mirror = Microfacet(**white, roughness=self.roughness, fresnel=self.fresnel)(wi, wo)
        mixed = (1.0 - self.amount) * self.reflectance / jnp.pi + self.amount * mirror
        return jnp.where(above(wi, wo), mixed, 0.0)

    def width(self) -> Scalar:
        """The smaller slope."""
        return self.roughness.width()


def translated(chosen: Chosen) -> Closest:
    """The closest material: a metal alone, diffuse with a dielectric's reflection, or diffuse alone.

    Raises:
        ModelError: neither 1 nor 3 channels, or a lobe so narrow that pbrt takes it for a mirror.
    """
    count, isotropic = coloured(chosen, "pbrt"), chosen.model.isotropic
    colour: Any = np.ones(count)
    held: dict[str, Any] = {} if isotropic else {"rotation": tangent(chosen.model)}
    slopes = {"alpha": 0.1} if isotropic else {"alpha_x": 0.1, "alpha_y": 0.1}
    into = Mixture(
        reflectance=0.5 * colour,
        roughness=Isotropic() if isotropic else Anisotropic(),
        fresnel=Conductor(eta=1.5 * colour, kappa=NONE * colour),
    )
    diffuse = {"amount": 0.0, "eta": 1.5, "kappa": NONE, **slopes}
    metal, plastic = {"amount": 1.0, "reflectance": 0.0}, {"kappa": NONE}
    found = closest(chosen, into, [held | way for way in (diffuse, metal, plastic)])
    model = found.model
    assert isinstance(model, Mixture)
    if float(max(model.roughness.slopes)) < SMOOTH and float(model.amount) > 0.0:
        raise ModelError(
            f"{chosen.model.name} is narrower than slopes of {SMOOTH:g}, which pbrt takes for a mirror; expected a "
            "rougher material. Export it with --to glsl."
        )
    return found


def block(found: Closest) -> str:
    """The materials, of which `material` is the one to name."""
    model = found.model
    assert isinstance(model, Mixture)
    amount = float(model.amount)
    slopes = zip(("uroughness", "vroughness"), model.roughness.slopes, strict=True)
    index = [_spectrum("eta", model.fresnel.eta), _spectrum("k", model.fresnel.kappa)]
    rough = [f'"float {name}" {float(slope)!r}' for name, slope in slopes]
    diffuse = [_spectrum("reflectance", model.reflectance)]
    conductor = [*index, *rough, '"bool remaproughness" false']
    if amount in (0.0, 1.0):
        return _named("material", "conductor", conductor) if amount else _named("material", "diffuse", diffuse)
    parts = ['"string materials" [ "material-below" "material-mirror" ]', f'"float amount" {amount!r}']
    below, mirror = _named("material-below", "diffuse", diffuse), _named("material-mirror", "conductor", conductor)
    return below + mirror + _named("material", "mix", parts)


def _named(name: str, kind: str, parameters: Sequence[str]) -> str:
    return "\n    ".join([f'MakeNamedMaterial "{name}" "string type" "{kind}"', *parameters]) + "\n"


def _spectrum(name: str, value: Any) -> str:
    """Constant over the wavelengths where channels are alike, else red, green and blue."""
    numbers = [float(x) for x in np.ravel(np.asarray(value))]
    if len(set(numbers)) == 1:
        return f'"spectrum {name}" [ {ENDS[0]} {numbers[0]!r} {ENDS[1]} {numbers[0]!r} ]'
    return f'"rgb {name}" [ {" ".join(map(repr, numbers))} ]'


def _turned(found: Closest) -> list[str]:
    """How a brushed material lies, where pbrt has no parameter for it."""
    rough = getattr(found.model, "roughness", None)
    if not isinstance(rough, Anisotropic) or float(rough.rotation) == 0.0:
        return []
    return [f"The tangent (uroughness) lies at {float(rough.rotation):g} degrees: turn the shape's coordinates so."]


def notes(chosen: Chosen, found: Closest) -> list[str]:
    """What differs from the model, as sentences."""
    del chosen
    return [*found.words, *_turned(found)]


def texts(name: str, header: Sequence[str], found: Closest) -> dict[str, str]:
    """File names → texts."""
    lines = [*header, ASSUMED, *([COLOURED] if '"rgb ' in block(found) else []), *found.intervals]
    return {f"{name}.pbrt": "".join(f"# {line}\n" for line in lines) + "\n" + block(found)}
