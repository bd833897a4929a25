"""MaterialX 1.39: the lobes as its standard nodes where it has them, else the closest OpenPBR surface.

It runs nothing: `materialx_shader` does.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from fitmat.errors import ModelError
from fitmat.exports.closest import Closest, closest, coloured
from fitmat.exports.material import Chosen
from fitmat.exports.materialx.elements import Inputs, element, file, whole
from fitmat.exports.materialx.models import Compensated, RoughDiffuse, template
from fitmat.models.base import AbstractBRDF, Sum
from fitmat.models.lobes.kulla_conty import KullaConty
from fitmat.models.lobes.lambert import Lambert
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.lobes.oren_nayar import EnergyPreservingOrenNayar, OrenNayar
from fitmat.models.lobes.turquin import Turquin
from fitmat.models.lobes.walter import Walter
from fitmat.models.parameters import Entry, entries, vector
from fitmat.models.terms.distributions import Anisotropic
from fitmat.models.terms.fresnel import COS_82, F82, Conductor, Dielectric, Schlick, schlick
from fitmat.text import brief

DIFFUSE = "oren_nayar_diffuse_bsdf"

SAME, FRESNELS = (Lambert, OrenNayar), (Dielectric, Schlick, F82, Conductor)
"""Lobes that a node is, and Fresnel terms that the specular nodes have."""

TURNED = "turned"
"""Instead of a type: the tangent, turned by so many degrees."""


@dataclasses.dataclass(frozen=True, eq=False)
class Document:
    """A material in MaterialX.

    Attributes:
        nodes: Category of each node of a lobe → its inputs; one `open_pbr_surface`, or BSDFs that are added up.
        found: The closest, where these nodes are not the model itself.
    """

    nodes: tuple[tuple[str, Inputs], ...]
    found: Closest | None

    __repr__ = brief


def translated(chosen: Chosen) -> Document:
    """Standard nodes where each lobe has one; of the specular ones the closest, else the closest OpenPBR surface.

    The specular nodes give back the energy of multiple scattering, which no lobe of the library does in their way.

    Raises:
        ModelError: neither 1 nor 3 channels, or a brushed material that has no nodes.
    """
    coloured(chosen, "MaterialX")
    lobes = chosen.model.lobes if isinstance(chosen.model, Sum) else (chosen.model,)
    own = tuple(_own(lobe) for lobe in lobes)
    categories = [_node(lobe)[0] for lobe in own if lobe is not None]
    if len(set(categories)) < len(lobes):
        return open_surface(chosen)
    if all(isinstance(lobe, SAME) for lobe in own):
        return Document(tuple(_node(lobe) for lobe in own if lobe is not None), None)
    into = own[0] if len(own) == 1 else Sum(tuple(lobe for lobe in own if lobe is not None))
    assert into is not None
    bare = [e.name for e in entries(into) if e.name.endswith("ks") and np.all(_value(into, e) == 1.0)]
    turned = {e.name: _value(into, e) for e in entries(into) if e.name.endswith("rotation")}
    found = closest(chosen, into, [dict.fromkeys(bare, 1.0) | turned])
    lobes = found.model.lobes if isinstance(found.model, Sum) else (found.model,)
    return Document(tuple(map(_node, lobes)), found)


def _value(model: AbstractBRDF, entry: Entry) -> np.ndarray:
    return np.asarray(vector(model))[entry.place]


def open_surface(chosen: Chosen) -> Document:
    """The closest OpenPBR surface.

    Raises:
        ModelError: neither 1 nor 3 channels, or a brushed material.
    """
    found = closest(chosen, *template(_checked(chosen)))
    v = found.values
    named: Inputs = {name: ("color3", v[name]) for name in ("base_color", "specular_color")}
    names = ("base_metalness", "base_diffuse_roughness", "specular_ior", "specular_roughness")
    named |= {name: ("float", v[name]) for name in names}
    return Document((("open_pbr_surface", named),), found)


def _checked(chosen: Chosen) -> int:
    """How many channels there are."""
    count = coloured(chosen, "MaterialX")
    if not chosen.model.isotropic:
        raise ModelError(
            f"{chosen.model.name} is brushed, expected an isotropic material: OpenPBR's anisotropy is not written. "
            "Export it with --to gltf, or ggx-aniso with --to materialx."
        )
    return count


def _own(lobe: AbstractBRDF) -> AbstractBRDF | None:
    """What the node of a lobe means, with the lobe's values; None where there is no node."""
    if isinstance(lobe, SAME):
        return lobe
    if isinstance(lobe, EnergyPreservingOrenNayar):
        return RoughDiffuse(lobe.kd, lobe.r)
    if isinstance(lobe, Microfacet | KullaConty | Turquin | Walter) and isinstance(lobe.fresnel, FRESNELS):
        return Compensated(lobe.ks, lobe.roughness, lobe.fresnel)
    return None


def _node(lobe: AbstractBRDF) -> tuple[str, Inputs]:
    """The node of a lobe with its inputs."""
    if isinstance(lobe, Lambert):
        return DIFFUSE, {"color": ("color3", lobe.kd), "roughness": ("float", 0.0)}
    if isinstance(lobe, OrenNayar):
        return DIFFUSE, {"color": ("color3", lobe.kd), "roughness": ("float", np.deg2rad(lobe.sigma_n))}
    if isinstance(lobe, RoughDiffuse):
        preserving: Inputs = {"energy_compensation": ("boolean", "true")}
        return DIFFUSE, {"color": ("color3", lobe.kd), "roughness": ("float", lobe.r)} | preserving
    assert isinstance(lobe, Compensated)
    fresnel, rough = lobe.fresnel, lobe.roughness
    slopes: Inputs = {"roughness": ("vector2", [float(slope) for slope in rough.slopes])}
    if isinstance(rough, Anisotropic) and float(rough.rotation) != 0.0:
        slopes["tangent"] = TURNED, float(rough.rotation)
    if isinstance(fresnel, Dielectric):
        return "dielectric_bsdf", {"tint": ("color3", lobe.ks), "ior": ("float", fresnel.eta), **slopes}
    weight: Inputs = {"weight": ("float", lobe.ks)}
    if isinstance(fresnel, Conductor):
        index: Inputs = {"ior": ("color3", fresnel.eta), "extinction": ("color3", fresnel.kappa)}
        return "conductor_bsdf", weight | index | slopes
    assert isinstance(fresnel, Schlick | F82)
    tint = fresnel.f82 / schlick(COS_82, np.asarray(fresnel.f0)) if isinstance(fresnel, F82) else 1.0
    return "generalized_schlick_bsdf", weight | {"color0": ("color3", fresnel.f0), "color82": ("color3", tint)} | slopes


def notes(chosen: Chosen, document: Document) -> list[str]:
    """What differs from the model, as sentences."""
    del chosen
    return document.found.words if document.found is not None else []


def facts(document: Document) -> dict[str, Any]:
    """What the record says of it."""
    return document.found.facts if document.found is not None else {}


def texts(name: str, header: Sequence[str], document: Document) -> dict[str, str]:
    """File names → texts; the material is called `material`."""
    lines = [*header, *(document.found.intervals if document.found is not None else [])]
    return {f"{name}.mtlx": file("\n".join(lines), xml(document))}


def xml(document: Document) -> str:
    """The document's element."""
    parts, names = "", []
    for k, (category, given) in enumerate(document.nodes):
        names.append(f"lobe{k + 1}")
        turned, inputs = _turned(f"tangent{k + 1}", given)
        parts += turned
        parts += element(category, names[-1] if category != "open_pbr_surface" else "surface", inputs)
    for k in range(1, len(names)):
        top = names[0] if k == 1 else f"sum{k - 1}"
        parts += element("add", f"sum{k}", {"in1": ("BSDF", top), "in2": ("BSDF", names[k])})
    if document.nodes[0][0] != "open_pbr_surface":
        added = names[0] if len(names) == 1 else f"sum{len(names) - 1}"
        parts += element("surface", "surface", {"bsdf": ("BSDF", added)})
    parts += element("surfacematerial", "material", {"surfaceshader": ("surfaceshader", "surface")})
    return whole(parts)


def _turned(name: str, inputs: Inputs) -> tuple[str, Inputs]:
    """The nodes that turn the tangent of a lobe about the normal, and its inputs with it; rotate3d turns clockwise."""
    if inputs.get("tangent", ("",))[0] != TURNED:
        return "", inputs
    world: Inputs = {"space": ("string", "world")}
    ends: Inputs = {"in": ("vector3", f"{name}_along"), "amount": ("float", -inputs["tangent"][1])}
    ends["axis"] = "vector3", f"{name}_normal"
    parts = element("tangent", f"{name}_along", world) + element("normal", f"{name}_normal", world)
    return parts + element("rotate3d", name, ends), inputs | {"tangent": ("vector3", name)}
