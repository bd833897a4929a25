"""glTF 2.0: the closest metallic-roughness material on a sphere, in one file that viewers open.

Its values are those of the specification's Appendix B, computed from the file's own numbers; no viewer is run.
"""

import base64
import dataclasses
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from fitmat.exports.closest import Closest, closest, coloured
from fitmat.exports.material import Chosen
from fitmat.exports.metallic_roughness import Clearcoated, template
from fitmat.exports.verification import Difference, compared, directions, exact
from fitmat.models.base import evaluate

RINGS, SEGMENTS = 24, 48
"""Of the sphere."""

MOST_F0 = 0.9
"""Up to which F0 is said as an index of refraction; the rest is specularColor."""

EVALUATOR = "the formulas of the specification's Appendix B (no viewer was run)"

VIEWERS = (
    "Numbers mean the specification's Appendix B: single scattering. Viewers that add multiple scattering, as three.js "
    "and Cycles, show rough metals brighter."
)


def translated(chosen: Chosen) -> Closest:
    """The closest material of glTF.

    Raises:
        ModelError: neither 1 nor 3 channels.
    """
    return closest(chosen, *template(chosen.model, coloured(chosen, "glTF")))


def notes(chosen: Chosen, found: Closest) -> list[str]:
    """What differs from the model, as sentences."""
    mirror = "The mirror image in the polished coat is written as a clearcoat of roughness 0 and index 1.5."
    polished = isinstance(found.model, Clearcoated) and found.model.coat is None
    return [*found.words, *([mirror] if polished else [])]


def material(name: str, found: Closest) -> dict[str, Any]:
    """The material's object, in the names and conventions of the specification."""
    v: dict[str, Any] = {key: float(value[0]) for key, value in found.values.items()}
    v |= {key: np.broadcast_to(found.values[key], (3,)).tolist() for key in ("base_color", "f0")}
    most = float(np.clip(max(v["f0"]), 0.0, MOST_F0))
    root = most**0.5
    extensions: dict[str, Any] = {
        "KHR_materials_ior": {"ior": (1.0 + root) / (1.0 - root)},
        "KHR_materials_specular": {
            "specularFactor": v["specular"],
            "specularColorFactor": [f0 / most if most > 0.0 else 1.0 for f0 in v["f0"]],
        },
    }
    if "strength" in v:
        turn = float(np.deg2rad(v["rotation"]))
        extensions["KHR_materials_anisotropy"] = {"anisotropyStrength": v["strength"], "anisotropyRotation": turn}
    if "clearcoat" in v:
        rough = v["alpha"] ** 0.5 if "alpha" in v else 0.0
        extensions["KHR_materials_clearcoat"] = {"clearcoatFactor": v["clearcoat"], "clearcoatRoughnessFactor": rough}
    return {
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*v["base_color"], 1.0],
            "metallicFactor": v["metallic"],
            "roughnessFactor": v["roughness"],
        },
        "extensions": extensions,
    }


def texts(name: str, header: Sequence[str], found: Closest) -> dict[str, str]:
    """File names → texts: a scene of one sphere with the material, what there is to say in `asset.extras`."""
    made = material(name, found)
    about = [*header, *found.intervals, VIEWERS]
    return {f"{name}.gltf": document(name, about, made, *_sphere("KHR_materials_anisotropy" in made["extensions"]))}


def document(
    name: str,
    about: Sequence[str],
    made: Mapping[str, Any],
    corners: Mapping[str, Float[np.ndarray, "v d"]],
    faces: Int[np.ndarray, "f 3"],
    pictures: Sequence[str] = (),
) -> str:
    """A scene of one body.

    Args:
        name: Of the body.
        about: What there is to say, in `asset.extras`.
        made: The material's object.
        corners: Attribute → its values at every corner, `POSITION` first.
        faces: Three corners each.
        pictures: Files that the material's textures show, by their numbers.
    """
    buffer, views, accessors = _packed(list(corners.values()), faces)
    attributes = {attribute: k for k, attribute in enumerate(corners)}
    whole: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "fitmat", "extras": {"about": list(about)}},
        "extensionsUsed": sorted(made["extensions"]),
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": len(attributes), "material": 0}]}],
        "materials": [made],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [
            {
                "byteLength": len(buffer),
                "uri": "data:application/octet-stream;base64," + base64.b64encode(buffer).decode("ascii"),
            }
        ],
    }
    if pictures:
        whole["images"] = [{"uri": picture} for picture in pictures]
        whole["textures"] = [{"source": k} for k in range(len(pictures))]
    return json.dumps(whole, indent=1, allow_nan=False) + "\n"


def _sphere(brushed: bool) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Corners and faces of a unit sphere, where needed with tangents."""
    polar, around = np.meshgrid(
        np.linspace(0.0, np.pi, RINGS + 1), np.linspace(0.0, 2.0 * np.pi, SEGMENTS + 1), indexing="ij"
    )
    normal = np.stack([np.sin(polar) * np.cos(around), np.cos(polar), -np.sin(polar) * np.sin(around)], -1)
    tangent = np.stack([-np.sin(around), 0.0 * around, -np.cos(around), np.ones_like(around)], -1)
    corner = (np.arange(RINGS)[:, None] * (SEGMENTS + 1) + np.arange(SEGMENTS)).ravel()
    below = corner + SEGMENTS + 1
    upper, lower = np.stack([corner, below, corner + 1], 1), np.stack([corner + 1, below, below + 1], 1)
    corners = {"POSITION": normal, "NORMAL": normal} | ({"TANGENT": tangent} if brushed else {})
    return corners, np.concatenate([upper[SEGMENTS:], lower[:-SEGMENTS]])


def _packed(
    corners: Sequence[np.ndarray], faces: np.ndarray
) -> tuple[bytes, list[dict[str, int]], list[dict[str, Any]]]:
    """Bytes, views and accessors of attributes of corners, and of faces."""
    flat = [part.reshape(-1, part.shape[-1]).astype("<f4") for part in corners]
    views, accessors, content = [], [], b""
    for part in (*flat, faces.reshape(-1, 1).astype("<u2")):
        of_face = part.dtype == np.dtype("<u2")
        target, kind = (34963, 5123) if of_face else (34962, 5126)
        views.append({"buffer": 0, "byteOffset": len(content), "byteLength": part.nbytes, "target": target})
        shape = "SCALAR" if of_face else f"VEC{part.shape[1]}"
        accessors.append({"bufferView": len(accessors), "componentType": kind, "count": len(part), "type": shape})
        content += part.tobytes()
    accessors[0] |= {"min": flat[0].min(0).tolist(), "max": flat[0].max(0).tolist()}
    return content, views, accessors


def difference(chosen: Chosen, found: Closest) -> Difference:
    """How far the values that Appendix B gives for the file's numbers are from the model's."""
    wi, wo = directions()
    values = evaluated(material("", found), *exact(wi, wo))
    apart = compared(values, evaluate(chosen.model, *exact(wi, wo)), wi, wo, EVALUATOR)
    return dataclasses.replace(apart, how="Computed by")


def evaluated(
    told: Mapping[str, Any], wi: Float[np.ndarray, "n 3"], wo: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 3"]:
    """Appendix B and the extensions' formulas, from a material's object; 0 below the surface."""
    basic, more = told["pbrMetallicRoughness"], told["extensions"]
    color, alpha = np.array(basic["baseColorFactor"][:3]), basic["roughnessFactor"] ** 2
    h = wi + wo
    h = h / np.maximum(np.linalg.norm(h, axis=1), 1e-12)[:, None]
    v_dot_h = np.clip(np.sum(wo * h, axis=1), 0.0, 1.0)[:, None]
    stretched = more.get("KHR_materials_anisotropy", {"anisotropyStrength": 0.0, "anisotropyRotation": 0.0})
    along = alpha + (1.0 - alpha) * stretched["anisotropyStrength"] ** 2
    mirror = _specular(wi, wo, h, (along, alpha), stretched["anisotropyRotation"])
    ior, specular = more["KHR_materials_ior"]["ior"], more["KHR_materials_specular"]
    f0 = np.minimum(((ior - 1.0) / (ior + 1.0)) ** 2 * np.array(specular["specularColorFactor"]), 1.0)
    f0, f90 = f0 * specular["specularFactor"], specular["specularFactor"]
    fresnel = f0 + (f90 - f0) * (1.0 - v_dot_h) ** 5
    dielectric = (1.0 - fresnel.max(axis=1, keepdims=True)) * color / np.pi + fresnel * mirror
    metal = (color + (1.0 - color) * (1.0 - v_dot_h) ** 5) * mirror
    found = dielectric + basic["metallicFactor"] * (metal - dielectric)
    if "KHR_materials_clearcoat" in more:
        coat = more["KHR_materials_clearcoat"]
        share = coat["clearcoatFactor"] * (0.04 + 0.96 * (1.0 - np.clip(wo[:, 2:], 0.0, 1.0)) ** 5)
        rough = coat["clearcoatRoughnessFactor"] ** 2
        found = found * (1.0 - share) + (share * _specular(wi, wo, h, (rough, rough), 0.0) if rough > 0.0 else 0.0)
    return np.where((wi[:, 2:] > 0.0) & (wo[:, 2:] > 0.0), found, 0.0)


def _specular(
    wi: np.ndarray, wo: np.ndarray, h: np.ndarray, slopes: tuple[float, float], turn: float
) -> Float[np.ndarray, "n 1"]:
    """V D of Appendix B.3.2, in its anisotropic form."""
    at, ab = slopes
    t, b = np.array([np.cos(turn), np.sin(turn), 0.0]), np.array([-np.sin(turn), np.cos(turn), 0.0])
    across = (h @ t / at) ** 2 + (h @ b / ab) ** 2 + h[:, 2] ** 2
    density = 1.0 / (np.pi * at * ab * across**2)
    light, eye = (np.sqrt((at * (w @ t)) ** 2 + (ab * (w @ b)) ** 2 + w[:, 2] ** 2) for w in (wi, wo))
    ci, co = (np.maximum(w[:, 2], 1e-7) for w in (wi, wo))
    return (density * 0.5 / (ci * eye + co * light))[:, None]
