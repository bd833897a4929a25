"""Blender: the closest Principled BSDF as Python that makes the material, its values those of Cycles.

It runs nothing itself: `cycles` does, where there is a Blender.
"""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from fitmat.exports.blender.models import Coated, template
from fitmat.exports.closest import Closest, closest, coloured
from fitmat.exports.material import Chosen

SOCKETS = {
    "Base Color": "base_color",
    "Metallic": "metallic",
    "Roughness": "roughness",
    "IOR": "ior",
    "Specular Tint": "specular_tint",
    "Diffuse Roughness": "diffuse_roughness",
    "Anisotropic": "anisotropic",
    "Anisotropic Rotation": "rotation",
    "Coat Weight": "weight",
    "Coat Roughness": "alpha",
}
"""Inputs of the node → parameters of the model; those that it has not stay out."""

COLOURS = ("Base Color", "Specular Tint")

ASSUMED = (
    "Values are those of Cycles in Blender 4 and 5, distribution GGX, single scattering; Multiscatter GGX shows "
    "rough metals brighter, and EEVEE approximates. Colours are linear, Rec. 709. Diffuse Roughness needs Blender 4.3."
)

CODE = """import bpy

VALUES = {values}

material = bpy.data.materials.new({name})
if material.node_tree is None:
    material.use_nodes = True
nodes, links = material.node_tree.nodes, material.node_tree.links
principled = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
principled.distribution = "GGX"
for socket, value in VALUES.items():
    if socket in principled.inputs:
        principled.inputs[socket].default_value = value
"""

BRUSHED = """tangent = nodes.new("ShaderNodeTangent")  # azimuth 0: along the u of the mesh's coordinates
tangent.direction_type = "UV_MAP"
links.new(tangent.outputs["Tangent"], principled.inputs["Tangent"])
"""


def translated(chosen: Chosen) -> Closest:
    """The closest Principled BSDF.

    Raises:
        ModelError: neither 1 nor 3 channels.
    """
    return closest(chosen, *template(chosen.model, coloured(chosen, "Blender")))


def notes(chosen: Chosen, found: Closest) -> list[str]:
    """What differs from the model, as sentences."""
    del chosen
    mirror = "The mirror image in the polished coat is written as a coat of roughness 0 and index 1.5."
    polished = isinstance(found.model, Coated) and found.model.coat is None
    return [*found.words, *([mirror] if polished else [])]


def code(name: str, found: Closest) -> str:
    """Python for Blender that makes `material`."""
    brushed = "rotation" in found.values
    polished = {"Coat Roughness": 0.0} if "weight" in found.values else {}
    values = polished | {
        socket: _value(socket, found.values[key]) for socket, key in SOCKETS.items() if key in found.values
    }
    made = CODE.format(values=json.dumps(values, indent=4), name=json.dumps(name))
    return made + BRUSHED * brushed


def _value(socket: str, value: Any) -> float | list[float]:
    """As the socket has it: colours with an alpha, turns as a fraction of one, roughness of a coat."""
    if socket in COLOURS:
        return [*np.broadcast_to(value, (3,)).tolist(), 1.0]
    number = float(value[0])
    turned, root = number / 360.0 % 1.0, abs(number) ** 0.5
    return {"Anisotropic Rotation": turned, "Coat Roughness": root}.get(socket, number)


def texts(name: str, header: Sequence[str], found: Closest) -> dict[str, str]:
    """File names → texts."""
    lines = [*header, ASSUMED, *found.intervals]
    return {f"{name}.py": "".join(f"# {line}\n" for line in lines) + "\n" + code(name, found)}
