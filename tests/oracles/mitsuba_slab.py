"""Light in a coat over a base, as Mitsuba 3 traces it: two wide parallel planes, the upper one a dielectric.

The scene is geometry and plugins only; how often light goes back and forth is the path tracer's business. What comes
from an even sky towards a sensor is by reciprocity what a beam from there reflects in all. The planes are 1 apart and
a thousand times as wide.

Mitsuba's facets scatter once: what its rough faces and its facets mask is lost, and its masking is separable.
"""

from types import ModuleType
from typing import Any

import numpy as np

HALF_WIDTH, DEPTH = 500.0, 1000
"""Of the planes; and the most segments of a path."""

GROUPS = 16
"""Renderings of which the scatter gives the standard error."""

DIFFUSE: dict[str, Any] = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}}


def facets(alpha: float, reflectance: float) -> dict[str, Any]:
    """A base of GGX facets that all reflect the same share."""
    colour = {"type": "rgb", "value": reflectance}
    return {
        **{"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": alpha},
        "specular_reflectance": colour,
    }


def albedo(
    mi: ModuleType, base: dict[str, Any], theta: float, eta: float, alpha: float | None, *, count: int, seed: int
) -> tuple[float, float]:
    """Reflected fraction under a polished face (None) or a rough one, and its standard error; theta in radians."""
    index = {"int_ior": eta, "ext_ior": 1.0}
    face = {"type": "dielectric", **index}
    if alpha is not None:
        face = {"type": "roughdielectric", "distribution": "ggx", "alpha": alpha, **index}
    plane, along = mi.ScalarTransform4f().scale([HALF_WIDTH, HALF_WIDTH, 1.0]), [np.sin(theta), 0.0, np.cos(theta)]
    place = mi.ScalarTransform4f().look_at(
        origin=[10 * along[0], 0.0, 10 * along[2] + 1.0], target=[0.0, 0.0, 1.0], up=[0.0, 1.0, 0.0]
    )
    film = {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}, "pixel_format": "luminance"}
    scene = mi.load_dict(
        {
            **{"type": "scene", "integrator": {"type": "path", "max_depth": DEPTH, "rr_depth": 50}},
            "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}},
            "face": {
                "type": "rectangle",
                "to_world": mi.ScalarTransform4f().translate([0, 0, 1]) @ plane,
                "bsdf": face,
            },
            "base": {"type": "rectangle", "to_world": plane, "bsdf": base},
            "sensor": {"type": "radiancemeter", "to_world": place, "film": film},
        }
    )
    found = [
        float(np.ravel(mi.render(scene, spp=-(-count // GROUPS), seed=seed * GROUPS + k))[0]) for k in range(GROUPS)
    ]
    return float(np.mean(found)), float(np.std(found, ddof=1) / np.sqrt(GROUPS))
