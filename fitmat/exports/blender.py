"""Blender: the closest Principled BSDF as Python that makes the material, its values those of Cycles.

It runs nothing itself: `cycles` does, where there is a Blender.
"""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from fitmat.exports.closest import Closest, closest, coloured
from fitmat.exports.cycles_models import template
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


def code(name: str, found: Closest) -> str:
    """Python for Blender that makes `material`."""
    brushed = "rotation" in found.values
    values = {socket: _value(socket, found.values[key]) for socket, key in SOCKETS.items() if key in found.values}
    made = CODE.format(values=json.dumps(values, indent=4), name=json.dumps(name))
    return made + BRUSHED * brushed


def _value(socket: str, value: Any) -> float | list[float]:
    """As the socket has it: colours with an alpha, turns as a fraction of one."""
    if socket in COLOURS:
        return [*np.broadcast_to(value, (3,)).tolist(), 1.0]
    return float(value[0]) / 360.0 % 1.0 if socket == "Anisotropic Rotation" else float(value[0])


def texts(name: str, header: Sequence[str], found: Closest) -> dict[str, str]:
    """File names → texts."""
    lines = [*header, ASSUMED, *found.intervals]
    return {f"{name}.py": "".join(f"# {line}\n" for line in lines) + "\n" + code(name, found)}
