"""OpenUSD: the closest UsdPreviewSurface on a ball, as text; its values are those of Storm, which usdview draws with.

No viewer is run.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.errors import ModelError
from fitmat.exports.closest import Closest, closest, coloured
from fitmat.exports.material import Chosen
from fitmat.exports.metallic_roughness import roughness
from fitmat.exports.verification import Difference, compared, directions, exact
from fitmat.maths.directions import above, pair
from fitmat.models.base import AbstractLobe, evaluate
from fitmat.models.parameters import param
from fitmat.models.terms.fresnel import schlick

EPSILON = 1e-3
"""What Storm adds to a numerator and to a denominator."""

EVALUATOR = "the formulas of Storm in OpenUSD 24.08 (no viewer was run)"

VIEWERS = (
    "Numbers mean Storm's previewSurface.glslfx in the specular workflow (useSpecularWorkflow 1). The specification "
    "leaves the formulas to renderers: others mask, and brighten narrow lobes, in other ways."
)


class PreviewSurface(AbstractLobe):
    """UsdPreviewSurface in the specular workflow, as Storm computes it.

    f = (1 − F) c/π + F D G/(4 c_i c_o + ε),  F = F0 + (1 − F0)(1 − c_d)⁵,  D = (α² + ε)/(π (c_h² (α² − 1) + 1)²),
    G = c_i/(c_i (1 − k) + k) c_o/(c_o (1 − k) + k),  α = roughness²,  k = α/2,  ε = 0.001

    Parameters: diffuse_color c, 0 to 1, per channel; specular_color F0, 0 to 1, per channel; roughness, 0.01 to 1.

    Limits: ε makes lobes with α below 0.1 brighter than they should be, without bound.

    Reference: Pixar, OpenUSD 24.08, pxr/usdImaging/plugin/usdShaders/shaders/previewSurface.glslfx.
    """

    label: ClassVar[str] = "usd-preview-surface"
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType({"energy": "Storm's epsilon adds to narrow lobes"})

    diffuse_color: Spectrum = param(
        0.0, 1.0, symbol="c", per_channel=True, weight=True, default=0.5, doc="albedo below the reflection"
    )
    specular_color: Spectrum = param(
        0.0, 1.0, symbol="F0", per_channel=True, default=0.04, starts=(0.04, 0.6), doc="reflectance at 0°"
    )
    roughness: Scalar = roughness()

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """What is not reflected, and the mirror part."""
        p, alpha = pair(wi, wo), self.roughness**2
        up = above(wi, wo)
        ci, co = (jnp.where(up, w[2], 1.0) for w in (wi, wo))
        flat = p.h[0] ** 2 + p.h[1] ** 2 + alpha**2 * p.h[2] ** 2  # c_h² (α² − 1) + 1 without its cancellation
        density = (alpha**2 + EPSILON) / (jnp.pi * flat**2)
        k = alpha / 2.0
        masked = ci / (ci * (1.0 - k) + k) * co / (co * (1.0 - k) + k)
        fresnel = schlick(p.cos_d, self.specular_color)
        mirror = density * masked / (4.0 * ci * co + EPSILON)
        return jnp.where(up, (1.0 - fresnel) * self.diffuse_color / jnp.pi + fresnel * mirror, 0.0)

    def width(self) -> Scalar:
        """α."""
        return self.roughness**2


def translated(chosen: Chosen) -> Closest:
    """The closest UsdPreviewSurface.

    Raises:
        ModelError: neither 1 nor 3 channels, or a brushed material.
    """
    count = coloured(chosen, "OpenUSD")
    if not chosen.model.isotropic:
        raise ModelError(
            f"{chosen.model.name} is brushed, expected an isotropic material: UsdPreviewSurface has no tangent. Export "
            "it with --to gltf, --to blender or --to osl."
        )
    given: dict[str, Any] = {"diffuse_color": np.full(count, 0.5), "specular_color": np.full(count, 0.04)}
    return closest(chosen, PreviewSurface(**given))


SCENE = """#usda 1.0
{comment}(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
)

def Xform "World" (
    kind = "component"
)
{{
    def Material "Material"
    {{
        token outputs:surface.connect = </World/Material/Surface.outputs:surface>

        def Shader "Surface"
        {{
            uniform token info:id = "UsdPreviewSurface"
            int inputs:useSpecularWorkflow = 1
            color3f inputs:diffuseColor = {diffuse_color}
            color3f inputs:specularColor = {specular_color}
            float inputs:roughness = {roughness}
            token outputs:surface
        }}
    }}

    def Sphere "Ball" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {{
        float3[] extent = [(-1, -1, -1), (1, 1, 1)]
        rel material:binding = </World/Material>
        double radius = 1
    }}
}}
"""


def texts(name: str, header: Sequence[str], found: Closest) -> dict[str, str]:
    """File names → texts: a stage with a ball that has the material `/World/Material`."""
    v = found.values
    colours = {key: _color(v[key]) for key in ("diffuse_color", "specular_color")}
    comment = "".join(f"# {line}\n" for line in [*header, VIEWERS, *found.intervals])
    return {f"{name}.usda": SCENE.format(comment=comment, roughness=repr(float(v["roughness"][0])), **colours)}


def _color(value: Any) -> str:
    return f"({', '.join(repr(float(x)) for x in np.broadcast_to(value, (3,)))})"


def difference(chosen: Chosen, found: Closest) -> Difference:
    """How far the values that Storm's formulas give for the file's numbers are from the model's."""
    wi, wo = directions()
    apart = compared(evaluate(found.model, *exact(wi, wo)), evaluate(chosen.model, *exact(wi, wo)), wi, wo, EVALUATOR)
    return dataclasses.replace(apart, how="Computed by")
