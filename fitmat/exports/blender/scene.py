"""Blender's side: facets under a sun, each turned so that light and eye meet it as told; run inside of Blender.

It imports nothing of the library, which Blender does not have, and knows no material: it is given one as code.
"""

import importlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

STRENGTH = 1.0
"""Irradiance of the sun at normal incidence, W/m²."""


def measured(told: dict[str, Any], folder: Path) -> None:
    """Write `values.npy`, (k, n, n, 3): radiance over irradiance of facets with the vertices of `facets.npy`.

    Args:
        told: `code`, which makes `material`; `size`, n facets a side; `lights`, directions to the sun, (k, 3).
        folder: Where the files are.
    """
    bpy: Any = importlib.import_module("bpy")
    made: dict[str, Any] = {"FOLDER": str(folder)}
    exec(compile(told["code"], "material", "exec"), made)
    scene, size = bpy.context.scene, told["size"]
    _set_up(bpy, scene, size)
    sun = _sun(bpy, scene)
    vertices, every = np.load(folder / "facets.npy"), []
    for k, light in enumerate(told["lights"]):
        _faces(bpy, scene, vertices[k], made["material"])
        mathutils: Any = importlib.import_module("mathutils")
        sun.rotation_euler = mathutils.Vector(light).to_track_quat("Z", "Y").to_euler()
        scene.render.filepath = str(folder / f"{k}.exr")
        bpy.ops.render.render(write_still=True)
        picture = bpy.data.images.load(scene.render.filepath)
        picture.colorspace_settings.name = "Non-Color"
        every.append(np.array(picture.pixels[:], np.float64).reshape(size, size, 4)[..., :3] / STRENGTH)
        bpy.data.images.remove(picture)
    np.save(folder / "values.npy", np.array(every))
    (folder / "version").write_text(bpy.app.version_string)


def _set_up(bpy: Any, scene: Any, size: int) -> None:
    """Cycles on the processor, one ray a pixel through its middle, no light but the sun's, numbers as they are."""
    scene.render.engine = "CYCLES"
    for name, value in {"device": "CPU", "samples": 1, "use_adaptive_sampling": False, "use_denoising": False}.items():
        setattr(scene.cycles, name, value)
    scene.cycles.max_bounces, scene.cycles.pixel_filter_type = 0, "BOX"
    scene.cycles.filter_width, scene.cycles.shading_system = 0.01, True
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    image = scene.render.image_settings
    image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR", "32", "NONE"
    scene.view_settings.view_transform = "Raw"
    scene.world = None
    camera = bpy.data.cameras.new("eye")
    camera.type, camera.ortho_scale, camera.clip_end = "ORTHO", size, 1e4
    eye = bpy.data.objects.new("eye", camera)
    eye.location = 0.0, 0.0, 1e3
    scene.collection.objects.link(eye)
    scene.camera = eye


def _sun(bpy: Any, scene: Any) -> Any:
    lamp = bpy.data.lights.new("sun", "SUN")
    lamp.energy, lamp.angle, lamp.use_shadow = STRENGTH, 0.0, False
    sun = bpy.data.objects.new("sun", lamp)
    scene.collection.objects.link(sun)
    return sun


def _faces(bpy: Any, scene: Any, vertices: np.ndarray, material: Any) -> None:
    """The facets of one sun, four vertices each, instead of those before."""
    for old in [each for each in scene.collection.objects if each.type == "MESH"]:
        bpy.data.objects.remove(old)
    mesh = bpy.data.meshes.new("facets")
    corners = vertices.reshape(-1, 3)
    mesh.from_pydata(corners.tolist(), [], np.arange(len(corners)).reshape(-1, 4).tolist())
    mesh.materials.append(material)
    square = mesh.uv_layers.new(name="UVMap")  # the tangent is along a facet's first edge
    square.data.foreach_set("uv", np.tile([0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0], len(corners) // 4))
    scene.collection.objects.link(bpy.data.objects.new("facets", mesh))


if __name__ == "__main__":
    place = Path(sys.argv[-1])
    measured(json.loads((place / "told.json").read_text(encoding="utf-8")), place)
