"""Maps: a texture's parameters as pictures, and a glTF material that binds them, for viewers and engines.

Numbers are renamed, none is imitated: a point's material is glTF's with the same albedo, slope and F0.
"""

import io

import numpy as np
from jaxtyping import Bool, Float

from fitmat.colour.spaces import encoded
from fitmat.exports import gltf
from fitmat.fitting.many.fits import Fits
from fitmat.models.terms.fresnel import f0_from_eta

BASE, ROUGH, SPECULAR, SCENE = "base_color.png", "metallic_roughness.png", "specular_color.png", "texture.gltf"
"""Names of the files."""

MAPS = (BASE, ROUGH, SPECULAR, SCENE)
"""All of them."""

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
    names = {entry.name for entry in fits.entries}
    level = next((name for name in ("f0", "eta") if name in names), None)
    if fits.outcome.ndim != 2 or len(fits.channels) not in (1, 3) or level is None or not {"kd", "alpha"} <= names:
        return {}
    fitted = np.isfinite(fits["alpha"]) & np.isin(fits.result, ("converged", "at_bound", "max_steps"))
    if not fitted.any():
        return {}
    reflected = fits[level] if level == "f0" else f0_from_eta(fits[level])
    f0 = _coloured(reflected) * (_coloured(fits["ks"]) if "ks" in names else 1.0)
    base, rough, f0 = (_filled(part, fitted) for part in (_coloured(fits["kd"]), _coloured(np.sqrt(fits["alpha"])), f0))
    most = float(np.clip(f0.max(), 1e-4, gltf.MOST_F0))
    packed = np.stack([np.zeros(rough.shape[:2]), rough[..., 1], np.zeros(rough.shape[:2])], axis=-1)
    return {
        BASE: _png(encoded(np.clip(base, 0.0, 1.0))),
        ROUGH: _png(packed),
        SPECULAR: _png(encoded(np.clip(f0 / most, 0.0, 1.0))),
        SCENE: _scene(most).encode("ascii"),
    }


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
    root = most**0.5
    material = {
        "name": "texture",
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0},
            "metallicRoughnessTexture": {"index": 1},
            "metallicFactor": 0.0,
        },
        "extensions": {
            "KHR_materials_ior": {"ior": (1.0 + root) / (1.0 - root)},
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
