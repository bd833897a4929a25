"""Swatches: small pictures of a fitted material on a sphere, and of both models of a match, as PNG in a data URI.

It judges no colour; `match.appearance` does.
"""

import base64
import functools
import struct
import zlib
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from fitmat.colour.channels import colouring
from fitmat.colour.spaces import to_srgb
from fitmat.match.appearance.spheres import Perceived
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF
from fitmat.models.values import at

SIZE = 112
"""Pixels of a swatch along a side."""

TOWARDS = np.array([-0.4, 0.5, 0.77])
"""Direction of the only light of a swatch: from the upper left, before the sphere."""

MOST = 10.0
"""ΔE2000 from which on the map of a sphere is equally bright."""

_MAGMA = np.array([[0, 0, 4], [59, 15, 112], [140, 41, 129], [222, 73, 104], [254, 159, 109], [252, 253, 191]])
# Six colours of Matplotlib's map "magma" (CC0), evenly spaced.


def swatch(model: AbstractBRDF, channels: tuple[str, ...]) -> str:
    """A sphere of the material in one light; where it faces the light, a white diffuser would be white."""
    inside, edge, lit, wi, wo = _sphere()
    weights = colouring(channels).weights
    f = at(surface(model), wi, wo)
    xyz = np.zeros((len(lit), 3))
    xyz[lit] = np.pi * wi[:, 2:] * (np.broadcast_to(f, (len(f), len(weights))) @ weights)
    picture = np.zeros((SIZE, SIZE, 4), np.uint8)
    picture[inside, :3] = np.round(255.0 * to_srgb(np.nan_to_num(xyz)))
    picture[..., 3] = np.round(255.0 * edge)
    return png(picture)


@functools.cache
def _sphere() -> tuple[np.ndarray, ...]:
    """Which pixels see the sphere, how much of each, which of those are lit, and the directions there."""
    axis = (np.arange(SIZE) + 0.5) * 2.0 / SIZE - 1.0
    x, y = np.meshgrid(axis, -axis)
    inside = x**2 + y**2 < 1.0
    edge = np.clip((1.0 - np.hypot(x, y)) * SIZE / 2.0, 0.0, 1.0)
    n = np.stack([x[inside], y[inside], np.sqrt(1.0 - x[inside] ** 2 - y[inside] ** 2)], axis=1)
    light = TOWARDS / np.linalg.norm(TOWARDS)
    lit = n @ light > 1e-3
    wi, wo = (_local(n[lit], np.broadcast_to(w, n[lit].shape)) for w in (light, np.array([0.0, 0.0, 1.0])))
    return inside, edge, lit, wi, wo


def _local(n: Float[np.ndarray, "m 3"], w: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m 3"]:
    """Directions seen from surfaces with normals n, their x axis across the view."""
    tangent = np.stack([n[:, 2], np.zeros(len(n)), -n[:, 0]], axis=1)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    across = np.cross(n, tangent)
    found = np.stack([(w * part).sum(axis=1) for part in (tangent, across, n)], axis=1)
    found[:, 2] = np.maximum(found[:, 2], 1e-4)
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def spheres(seen: Perceived) -> list[dict[str, Any]]:
    """Each light's spheres of both models and the map of ΔE2000, where pictures were asked for."""
    found = []
    for lighting in seen.lightings:
        drawn = lighting.pictures
        if drawn is not None:
            brightness = np.clip(drawn.difference / MOST, 0.0, 1.0) * (len(_MAGMA) - 1)
            places = np.arange(len(_MAGMA))
            colours = np.stack([np.interp(brightness, places, part) for part in _MAGMA.T], axis=-1) / 255.0
            found.append(
                {
                    "light": lighting.name,
                    "empirical": _encoded(drawn.empirical),
                    "microfacet": _encoded(drawn.microfacet),
                    "difference": _encoded(colours),
                }
            )
    return found


def _encoded(picture: Float[np.ndarray, "h w 3"]) -> str:
    """Colours from 0 to 1, clear where they are not a number."""
    seen = np.isfinite(picture).all(axis=2)
    whole = np.zeros((*seen.shape, 4), np.uint8)
    whole[seen, :3] = np.round(255.0 * picture[seen])
    whole[seen, 3] = 255
    return png(whole)


def png(picture: UInt8[np.ndarray, "h w 4"]) -> str:
    """A picture with opacity as a data URI (PNG, ISO/IEC 15948: one IDAT, the filter Sub)."""
    height, width = picture.shape[:2]
    apart = np.diff(picture, axis=1, prepend=np.zeros((height, 1, 4), np.uint8))
    rows = np.concatenate([np.ones((height, 1), np.uint8), apart.reshape(height, -1)], axis=1)

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    head = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    parts = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows.tobytes())) + chunk(b"IEND", b"")
    return "data:image/png;base64," + base64.b64encode(b"\x89PNG\r\n\x1a\n" + parts).decode("ascii")
