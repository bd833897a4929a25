"""Maps: a texture's parameters as pictures, and a glTF and a MaterialX material that bind them.

Numbers are renamed, none is imitated: a point's material is glTF's with the same albedo, slope and F0. What was
smoothed is drawn so.
"""

import io

import numpy as np
from jaxtyping import Bool, Float

from fitmat.colour.spaces import encoded
from fitmat.exports import gltf
from fitmat.exports.materialx.elements import SRGB, Inputs, element, file, whole
from fitmat.fitting.many.fits import Fits
from fitmat.models.terms.fresnel import eta_from_f0, f0_from_eta

BASE, ROUGH, SPECULAR = "base_color.png", "metallic_roughness.png", "specular_color.png"
SCENE, NODES = "texture.gltf", "texture.mtlx"
"""Names of the files."""

MAPS = (BASE, ROUGH, SPECULAR, SCENE, NODES)
"""All of them."""

PICTURES = (("base", SRGB, BASE), ("packed", "filename", ROUGH), ("specular", SRGB, SPECULAR))
"""MaterialX's node of each picture, its kind, and its file."""

LEVELS = 255.0
"""Of a picture's channel."""

ABOUT = (
    "Parameters of a fit by their glTF names: baseColor is kd (sRGB), roughness is sqrt(alpha) (green, linear), "
    "metallic is 0, and F0 is ks times the Fresnel term's (sRGB, relative to the index of refraction). glTF's diffuse "
    "part is lessened by 1 - F, the fit's is not. Points without a fit that is determined have the texture's median.",
    gltf.VIEWERS,
)


def maps(fits: Fits) -> dict[str, bytes]:
    """File names → contents; none where the points are in no rows and columns, or the model has no such parameters."""
    drawn = shown(fits)
    if fits.outcome.ndim != 2 or len(fits.channels) not in (1, 3) or not drawn or not determined(fits).any():
        return {}
    level, parts = drawn[-1], {name: _coloured(_drawn(fits, name)) for name in drawn}
    f0 = (parts[level] if level == "f0" else f0_from_eta(parts[level])) * parts.get("ks", 1.0)
    base, rough = _filled(parts["kd"], _known(fits, "kd")), _filled(np.sqrt(parts["alpha"]), _known(fits, "alpha"))
    f0 = _filled(f0, _known(fits, *drawn[2:]))
    most = float(np.clip(f0.max(), 1e-4, gltf.MOST_F0))
    packed = np.stack([np.zeros(rough.shape[:2]), rough[..., 1], np.zeros(rough.shape[:2])], axis=-1)
    return {
        BASE: _png(encoded(np.clip(base, 0.0, 1.0))),
        ROUGH: _png(packed),
        SPECULAR: _png(encoded(np.clip(f0 / most, 0.0, 1.0))),
        SCENE: _scene(most).encode("ascii"),
        NODES: _nodes(most).encode("ascii"),
    }


def shown(fits: Fits) -> tuple[str, ...]:
    """The parameters that maps show, f0 or eta last; none of a model without kd, alpha and one of these."""
    names = {entry.name for entry in fits.entries}
    level = next((name for name in ("f0", "eta") if name in names), None)
    if level is None or not {"kd", "alpha"} <= names:
        return ()
    return ("kd", "alpha", *(["ks"] if "ks" in names else []), level)


def smoothed(fits: Fits) -> tuple[str, ...]:
    """Those of them that maps show as they were smoothed."""
    return tuple(n for n in shown(fits) if n in fits.smoothed and np.isfinite(fits.smoothed[n].value).all())


def _drawn(fits: Fits, name: str) -> np.ndarray:
    if name in fits.held:
        return np.broadcast_to(fits.held[name], fits[name].shape)
    return fits.smoothed[name].value if name in smoothed(fits) else fits[name]


def _known(fits: Fits, *names: str) -> Bool[np.ndarray, "rows columns"]:
    """Points at which all of these are fitted, smoothed, or held."""
    return determined(fits) | ({*smoothed(fits), *fits.held} >= set(names))


def determined(fits: Fits) -> Bool[np.ndarray, "..."]:
    """Which points have a fit that a map shows."""
    return np.isin(fits.result, ("converged", "at_bound"))


def _coloured(part: np.ndarray) -> Float[np.ndarray, "rows columns 3"]:
    """What is shared by the channels, or there is one of, three times."""
    shaped = part[..., None] if part.ndim == 2 else part
    return np.broadcast_to(shaped, (*shaped.shape[:2], 3))


def _filled(
    part: Float[np.ndarray, "rows columns 3"], fitted: Bool[np.ndarray, "rows columns"]
) -> Float[np.ndarray, "rows columns 3"]:
    return np.where(fitted[..., None], part, np.median(part[fitted], axis=0))


def _png(values: Float[np.ndarray, "rows columns 3"]) -> bytes:
    from PIL import Image

    memory = io.BytesIO()
    Image.fromarray(np.rint(LEVELS * np.clip(values, 0.0, 1.0)).astype(np.uint8)).save(memory, "PNG", optimize=True)
    return memory.getvalue()


def _scene(most: float) -> str:
    """A square with the material; the texture's first row is at its upper edge."""
    material = {
        "name": "texture",
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0},
            "metallicRoughnessTexture": {"index": 1},
            "metallicFactor": 0.0,
        },
        "extensions": {
            "KHR_materials_ior": {"ior": _index(most)},
            "KHR_materials_specular": {"specularColorTexture": {"index": 2}},
        },
    }
    corners = {
        "POSITION": np.array([[-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0]]),
        "NORMAL": np.tile([0.0, 0.0, 1.0], (4, 1)),
        "TEXCOORD_0": np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]]),
    }
    faces = np.array([[0, 1, 2], [2, 1, 3]])
    return gltf.document("texture", ABOUT, material, corners, faces, (BASE, ROUGH, SPECULAR))


def _nodes(most: float) -> str:
    """The same material by MaterialX's node of it; a picture's first row is at v = 1 there."""
    channel: Inputs = {"in": ("color3", "packed"), "index": ("integer", 1)}
    surface: Inputs = {"base_color": ("color3", "base"), "metallic": ("float", 0.0), "roughness": ("float", "rough")}
    surface |= {"specular_color": ("color3", "specular"), "ior": ("float", _index(most))}
    nodes = (
        *(("image", name, {"file": (kind, path)}) for name, kind, path in PICTURES),
        ("extract", "rough", channel),
        ("gltf_pbr", "surface", surface),
        ("surfacematerial", "material", {"surfaceshader": ("surfaceshader", "surface")}),
    )
    return file(ABOUT[0], whole("".join(element(*node) for node in nodes)))


def _index(f0: float) -> float:
    """The index of refraction that reflects so much at normal incidence."""
    return float(eta_from_f0(np.array(f0)))
