"""OSL: a material as closures with MaterialX's names, added up; exactly where the closures are its lobes.

What a closure's values are is the renderer's: here those of Cycles, which `cycles` runs where there is a Blender.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from fitmat.exports.closest import Closest, closest, coloured
from fitmat.exports.material import Chosen
from fitmat.exports.metallic_roughness import tangent
from fitmat.models.base import AbstractBRDF, Sum
from fitmat.models.lobes.lambert import Lambert
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.registry import model
from fitmat.models.terms.distributions import Anisotropic, Beckmann
from fitmat.models.terms.fresnel import Conductor, Dielectric, Schlick
from fitmat.text import brief

ASSUMED = (
    "What a closure is, is the renderer's: the values are those of Cycles, in which ggx and beckmann scatter once and "
    "mask light and eye by their heights together. Renderers that add multiple scattering show rough lobes brighter."
)

MASKED = (
    "Cycles' masking of Beckmann's normals is Walter's rational function, off by up to 0.35 %: no parameter was moved "
    "for that."
)

SHADER = """shader material(
    vector along = dPdu,  // azimuth 0 of brushed lobes
    output closure color result = 0)
{{
    vector t = normalize(along - N * dot(N, along));
    vector b = cross(N, t);
    result = {sum};
}}
"""

CODE = """import bpy

material = bpy.data.materials.new("osl")
if material.node_tree is None:
    material.use_nodes = True
nodes, links = material.node_tree.nodes, material.node_tree.links
nodes.clear()
script, tangent = nodes.new("ShaderNodeScript"), nodes.new("ShaderNodeTangent")
tangent.direction_type = "UV_MAP"
bpy.context.scene.render.engine = "CYCLES"
bpy.context.scene.cycles.shading_system = True
script.mode = "EXTERNAL"
script.filepath = FOLDER + "/material.osl"
links.new(tangent.outputs["Tangent"], script.inputs["along"])
links.new(script.outputs["result"], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
"""
"""What runs a shader in Blender."""


@dataclasses.dataclass(frozen=True, eq=False)
class Closures:
    """A material as closures.

    Attributes:
        terms: What is added up, in OSL.
        beckmann: Whether a lobe has Beckmann's normals.
        found: The closest, where the closures are not the model itself.
    """

    terms: tuple[str, ...]
    beckmann: bool
    found: Closest | None

    __repr__ = brief


def translated(chosen: Chosen) -> Closures:
    """The closures of the lobes, or those that come closest: a diffuse one and GGX with Schlick's Fresnel term.

    Raises:
        ModelError: neither 1 nor 3 channels.
    """
    count, held = coloured(chosen, "OSL"), all(map(_is_closure, _lobes(chosen.model)))
    found = None if held else closest(chosen, *_template(chosen.model, count))
    lobes = _lobes(chosen.model if found is None else found.model)
    beckmann = any(isinstance(lobe, Microfacet) and isinstance(lobe.distribution, Beckmann) for lobe in lobes)
    return Closures(tuple(map(_closure, lobes)), beckmann, found)


def _lobes(material: AbstractBRDF) -> tuple[AbstractBRDF, ...]:
    return material.lobes if isinstance(material, Sum) else (material,)


def _is_closure(lobe: AbstractBRDF) -> bool:
    if isinstance(lobe, Microfacet):
        return isinstance(lobe.fresnel, Dielectric | Schlick | Conductor) and lobe.masking == "correlated"
    return isinstance(lobe, Lambert)


def _template(material: AbstractBRDF, count: int) -> tuple[AbstractBRDF, list[dict[str, Any]]]:
    """What the closures are, its Fresnel term alone saying how strong it is."""
    brushed = {} if material.isotropic else {"rotation": tangent(material)}
    into = model(f"lambert+ggx{'-aniso' * bool(brushed)}-schlick", channels=count)
    return into, [{"ks": 1.0, **brushed}]


def _closure(lobe: AbstractBRDF) -> str:
    """A lobe in OSL."""
    if isinstance(lobe, Lambert):
        return f"{_color(lobe.kd)} * diffuse(N)"
    assert isinstance(lobe, Microfacet)
    rough, fresnel, u = lobe.roughness, lobe.fresnel, "t"
    if isinstance(rough, Anisotropic):
        turned = float(np.deg2rad(float(rough.rotation)))
        u = f"cos({turned!r}) * t + sin({turned!r}) * b"
    slopes, kind = ", ".join(repr(float(slope)) for slope in rough.slopes), f'"{lobe.distribution.label}"'
    if isinstance(fresnel, Conductor):
        index = f"{_color(fresnel.eta)}, {_color(fresnel.kappa)}"
        return f"{_color(lobe.ks)} * conductor_bsdf(N, {u}, {slopes}, {index}, {kind})"
    none = "color(0)"
    if isinstance(fresnel, Dielectric):
        eta = repr(float(fresnel.eta))
        return f"{_color(lobe.ks)} * dielectric_bsdf(N, {u}, color(1), {none}, {slopes}, {eta}, {kind})"
    assert isinstance(fresnel, Schlick)
    ends = f"{_color(fresnel.f0)}, color(1), 5.0"
    return f"{_color(lobe.ks)} * generalized_schlick_bsdf(N, {u}, color(1), {none}, {slopes}, {ends}, {kind})"


def _color(value: Any) -> str:
    return f"color({', '.join(repr(float(x)) for x in np.broadcast_to(np.ravel(np.asarray(value)), (3,)))})"


def shader(closures: Closures) -> str:
    """The shader `material`."""
    return SHADER.format(sum="\n        + ".join(closures.terms))


def notes(chosen: Chosen, closures: Closures) -> list[str]:
    """What differs from the model, as sentences."""
    del chosen
    return [*(closures.found.words if closures.found is not None else []), *([MASKED] if closures.beckmann else [])]


def facts(closures: Closures) -> dict[str, Any]:
    """What the record says of it."""
    return closures.found.facts if closures.found is not None else {}


def texts(name: str, header: Sequence[str], closures: Closures) -> dict[str, str]:
    """File names → texts."""
    lines = [*header, ASSUMED, *(closures.found.intervals if closures.found is not None else [])]
    return {f"{name}.osl": "".join(f"// {line}\n" for line in lines) + "\n" + shader(closures)}
