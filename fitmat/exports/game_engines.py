"""Game engines: the values that a material has in Unreal Engine and in Unity, closest by the engines' own formulas.

No engine is run; what is assumed of each stands in the file. A value is a number to type in, not an asset.
"""

import dataclasses
import json
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.colour.spaces import encoded
from fitmat.errors import ModelError
from fitmat.exports.closest import Closest, closest, coloured
from fitmat.exports.material import Chosen
from fitmat.exports.metallic_roughness import fraction, roughness
from fitmat.exports.verification import Difference, compared, directions, exact
from fitmat.maths.directions import above, pair
from fitmat.models.base import AbstractLobe, evaluate
from fitmat.models.parameters import param
from fitmat.models.terms.distributions import GGX

F0_OF_SPECULAR = 0.08
"""Reflectance at normal incidence of Unreal's Specular 1."""

F0_OF_UNITY = 0.04
"""Of every dielectric in Unity's metallic workflow."""

SHADOWED = 50.0
"""Unreal takes F0 below 1/50 for shadowed, and lowers the reflectance at grazing incidence."""


class AbstractEngine(AbstractLobe):
    """What both engines have: a base colour that is the albedo of a dielectric or F0 of a metal."""

    base_color: Spectrum
    metallic: Scalar
    roughness: Scalar

    @property
    @abstractmethod
    def inputs(self) -> dict[str, Any]:
        """Name in the engine → value."""

    def width(self) -> Scalar:
        """α."""
        return self.roughness**2


def base_color() -> Any:
    """The parameter base_color of an engine's material."""
    return param(
        0.0, 1.0, symbol="c", per_channel=True, weight=True, default=0.5, doc="albedo of a dielectric, F0 of a metal"
    )


class Unreal(AbstractEngine):
    """Default Lit of Unreal Engine 4 and 5.

    f = (1 − m) c/π + D V (F0 (1 − (1 − c_d)⁵) + min(50 F0_green, 1) (1 − c_d)⁵),  F0 = (1 − m) 0.08 s + m c,
    V = ½/(c_i (c_o (1 − α) + α) + c_o (c_i (1 − α) + α)),  α = roughness²

    D is GGX. The diffuse part does not lose what is reflected.

    Parameters: base_color c, 0 to 1, per channel; metallic m; specular s, 0 to 1; roughness, 0.01 to 1.

    References: B. Karis, Real shading in Unreal Engine 4, SIGGRAPH course 2013; Engine/Shaders/Private/BRDF.ush
    (D_GGX, Vis_SmithJointApprox, F_Schlick), ShadingCommon.ush (ComputeF0).
    """

    label: ClassVar[str] = "unreal"
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType({"energy": "its diffuse part keeps what is reflected"})

    base_color: Spectrum = base_color()
    metallic: Scalar = fraction("m", 0.0, (0.5,), "0 is a dielectric, 1 a metal")
    specular: Scalar = fraction("s", 0.5, (0.5, 0.9), "F0 of a dielectric over 0.08")
    roughness: Scalar = roughness()

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """Lambert and the mirror part."""
        p, alpha, up = pair(wi, wo), self.roughness**2, above(wi, wo)
        ci, co = (jnp.where(up, w[2], 1.0) for w in (wi, wo))
        f0 = (1.0 - self.metallic) * F0_OF_SPECULAR * self.specular + self.metallic * self.base_color
        weak = (1.0 - p.cos_d) ** 5
        green = jnp.atleast_1d(f0)[jnp.size(f0) // 2]
        fresnel = f0 * (1.0 - weak) + jnp.minimum(SHADOWED * green, 1.0) * weak
        visible = 0.5 / (ci * (co * (1.0 - alpha) + alpha) + co * (ci * (1.0 - alpha) + alpha))
        mirror = fresnel * GGX().density(p.h, (alpha, alpha)) * visible
        return jnp.where(up, (1.0 - self.metallic) * self.base_color / jnp.pi + mirror, 0.0)

    @property
    def inputs(self) -> dict[str, Any]:
        """Of the material's main node."""
        numbers = {key: float(getattr(self, key.lower())) for key in ("Metallic", "Specular", "Roughness")}
        return {"Base Color": _three(self.base_color).tolist(), **numbers}


class Unity(AbstractEngine):
    """Lit of Unity's Universal Render Pipeline, in the metallic workflow.

    f = (0.96 (1 − m) c + (0.04 (1 − m) + m c) α²/(d² max(0.1, c_d²) (4 α + 2)))/π,  d = c_h² (α² − 1) + 1.00001,
    α = roughness²,  roughness = 1 − smoothness

    A light of intensity 1 shows white paper as 1: irradiance is π times the intensity. There is no Fresnel term in
    direct light.

    Parameters: base_color c, 0 to 1, per channel; metallic m; roughness, 0.01 to 1.

    Reference: Unity Technologies, com.unity.render-pipelines.universal, ShaderLibrary/BRDF.hlsl (InitializeBRDFData,
    DirectBRDFSpecular).
    """

    label: ClassVar[str] = "unity"
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType({"energy": "its mirror part is not normalised"})

    base_color: Spectrum = base_color()
    metallic: Scalar = fraction("m", 0.0, (0.5,), "0 is a dielectric, 1 a metal")
    roughness: Scalar = roughness("1 − smoothness")

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """Lambert and the mirror part."""
        p, alpha = pair(wi, wo), self.roughness**2
        d = p.h[0] ** 2 + p.h[1] ** 2 + alpha**2 * p.h[2] ** 2 + 1e-5
        mirror = alpha**2 / (d**2 * jnp.maximum(0.1, p.cos_d**2) * (4.0 * alpha + 2.0))
        f0 = F0_OF_UNITY * (1.0 - self.metallic) + self.metallic * self.base_color
        diffuse = (1.0 - F0_OF_UNITY) * (1.0 - self.metallic) * self.base_color
        return jnp.where(above(wi, wo), (diffuse + f0 * mirror) / jnp.pi, 0.0)

    @property
    def inputs(self) -> dict[str, Any]:
        """Properties of the shader; the inspector's colours are sRGB."""
        colour = encoded(_three(self.base_color)).tolist()
        return {"_BaseColor": colour, "_Metallic": float(self.metallic), "_Smoothness": 1.0 - float(self.roughness)}


def _three(value: Any) -> Float[np.ndarray, " 3"]:
    return np.broadcast_to(np.asarray(value, float), (3,))


@dataclasses.dataclass(frozen=True)
class Engine:
    """One of the two.

    Attributes:
        name: In sentences.
        kind: Its model.
        held: Parameters of it that are held for a metal.
        assumed: What its numbers mean.
    """

    name: str
    kind: type[AbstractEngine]
    held: Mapping[str, float]
    assumed: str

    def translated(self, chosen: Chosen) -> Closest:
        """The closest material.

        Raises:
            ModelError: neither 1 nor 3 channels, or a brushed material.
        """
        count = coloured(chosen, self.name)
        if not chosen.model.isotropic:
            raise ModelError(
                f"{chosen.model.name} is brushed, expected an isotropic material: {self.name}'s brushed materials are "
                "not written. Export it with --to gltf or --to blender."
            )
        given: dict[str, Any] = {"base_color": np.full(count, 0.5)}
        return closest(chosen, self.kind(**given), [{"metallic": 1.0, **self.held}, {"metallic": 0.0}])

    def texts(self, name: str, header: Sequence[str], found: Closest) -> dict[str, str]:
        """File names → texts."""
        assert isinstance(found.model, AbstractEngine)
        told = {"about": [*header, self.assumed, *found.intervals], "material": found.model.inputs}
        return {f"{name}.json": json.dumps(told, indent=1, allow_nan=False) + "\n"}

    def difference(self, chosen: Chosen, found: Closest) -> Difference:
        """How far the values that the engine's formulas give are from the model's."""
        wi, wo = directions()
        own, theirs = (evaluate(each, *exact(wi, wo)) for each in (chosen.model, found.model))
        apart = compared(theirs, own, wi, wo, f"the formulas of {self.name} (no engine was run)")
        return dataclasses.replace(apart, how="Computed by")


UNREAL = Engine(
    "Unreal Engine",
    Unreal,
    {"specular": 0.5},
    "Numbers mean Default Lit in direct light: alpha is Roughness squared, F0 is 0.08 Specular, colours are linear; "
    "r.Material.EnergyConservation 0 and no Substrate are assumed.",
)

UNITY = Engine(
    "Unity's URP",
    Unity,
    {},
    "Numbers mean Lit of the Universal Render Pipeline in direct light, metallic workflow: alpha is (1 - Smoothness) "
    "squared, F0 0.04, _BaseColor as the inspector has it, sRGB. HDRP has other formulas.",
)
