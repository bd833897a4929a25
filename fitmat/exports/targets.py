"""Targets: for what a material can be written, and which room does it.

It writes nothing itself.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from fitmat.exports import gltf, klems, mitsuba, osl, pbrt, radiance, table, usd, verification, zemax
from fitmat.exports.blender import cycles, script
from fitmat.exports.closest import Closest
from fitmat.exports.game_engines import UNITY, UNREAL
from fitmat.exports.glsl import shaders, translation
from fitmat.exports.material import Chosen
from fitmat.exports.materialx import document, generated
from fitmat.exports.verification import Difference


def _none(chosen: Chosen, form: Any) -> tuple[()]:
    del chosen, form
    return ()


def _nothing(form: Any) -> Mapping[str, Any]:
    del form
    return {}


class Target(NamedTuple):
    """A renderer, or a language of renderers.

    Attributes:
        title: What it is, with its version.
        translate: What is exported, and what of `options` was chosen → its form there.
        texts: Name of the files, header lines, form → file names and contents.
        difference: What is exported, form → how far its values there are; None where nothing runs it.
        notes: The same → what differs from the model, as sentences; `strict` refuses where there are any.
        facts: Form → what the record holds besides.
        options: What else of it can be chosen: theta_i and step of a grid of angles, bump of a shader.
        executor: Programs that `difference` needs; none where it needs none, or where nothing runs it.
    """

    title: str
    translate: Callable[..., Any]
    texts: Callable[[str, Sequence[str], Any], Mapping[str, str | bytes]]
    difference: Callable[[Chosen, Any], Difference | None]
    notes: Callable[[Chosen, Any], Sequence[str]] = _none
    facts: Callable[[Any], Mapping[str, Any]] = _nothing
    options: tuple[str, ...] = ()
    executor: str = ""


GRID = ("theta_i", "step")

CHROMIUM, BLENDER = "Chromium", "Blender"

MATERIALX = "MaterialX (pip install MaterialX) and Chromium"

MITSUBA = "Mitsuba (pip install mitsuba)"

RADIANCE = "Radiance (rtrace, or pip install pyradiance)"


def _words(chosen: Chosen, found: Closest) -> Sequence[str]:
    """Of a target that always gets the closest of its materials."""
    del chosen
    return found.words


def _unexecuted(chosen: Chosen, found: Any) -> None:
    """Of a target that nothing runs."""
    del chosen, found


def _facts(found: Closest) -> Mapping[str, Any]:
    return found.facts


def _shader(version: str) -> Target:
    """GLSL in one of its versions; the values are those of its functions in a browser, which has the first."""

    def translate(chosen: Chosen, *, bump: bool = False) -> shaders.Shader:
        return shaders.Shader(translation.translated(chosen.model), version, bump)

    def difference(chosen: Chosen, shader: shaders.Shader) -> Difference | None:
        compiler = shaders.compiled(shaders.texts("material", (), shader))
        found = verification.difference(chosen.model, shader.brdf)
        if found is None or version == shaders.ES:
            return found
        taken = f", compiled as {title} by {compiler}" if compiler else f"; not compiled as {title}"
        return dataclasses.replace(found, executor=f"{found.executor} as GLSL ES 3.00{taken}")

    title = "GLSL ES 3.00" if version == shaders.ES else "GLSL 3.30"
    return Target(title, translate, shaders.texts, difference, options=("bump",), executor=CHROMIUM)


TARGETS = {
    "glsl": _shader(shaders.ES),
    "glsl-330": _shader(shaders.DESKTOP),
    "mitsuba": Target(
        "Mitsuba 3",
        lambda chosen: mitsuba.translated(chosen.model),
        mitsuba.texts,
        lambda chosen, plugin: mitsuba.difference(chosen.model, plugin),
        lambda chosen, plugin: mitsuba.notes(chosen.model),
        executor=MITSUBA,
    ),
    "gltf": Target("glTF 2.0", gltf.translated, gltf.texts, gltf.difference, gltf.notes, _facts),
    "materialx": Target(
        "MaterialX 1.39.5",
        document.translated,
        document.texts,
        generated.difference,
        document.notes,
        document.facts,
        executor=MATERIALX,
    ),
    "openpbr": Target(
        "OpenPBR 1.1.1 in MaterialX 1.39.5",
        document.open_surface,
        document.texts,
        generated.difference,
        document.notes,
        document.facts,
        executor=MATERIALX,
    ),
    "usd": Target("OpenUSD's UsdPreviewSurface", usd.translated, usd.texts, usd.difference, _words, _facts),
    "radiance": Target(
        "Radiance's plastic or metal",
        radiance.translated,
        radiance.texts,
        radiance.difference,
        _words,
        _facts,
        executor=RADIANCE,
    ),
    "pbrt": Target("pbrt-v4", pbrt.translated, pbrt.texts, _unexecuted, pbrt.notes, _facts),
    "unreal": Target("Unreal Engine's Default Lit", UNREAL.translated, UNREAL.texts, UNREAL.difference, _words, _facts),
    "unity": Target("Lit of Unity's URP", UNITY.translated, UNITY.texts, UNITY.difference, _words, _facts),
    "klems": Target("a Klems matrix", klems.translated, klems.texts, klems.difference, klems.notes, executor=RADIANCE),
    "blender": Target(
        "Blender's Principled BSDF, in Cycles 5.0",
        script.translated,
        script.texts,
        lambda chosen, found: cycles.difference(chosen.model, script.code("material", found)),
        script.notes,
        _facts,
        executor=BLENDER,
    ),
    "osl": Target(
        "OSL, in Cycles 5.0",
        osl.translated,
        osl.texts,
        lambda chosen, closures: cycles.difference(chosen.model, osl.CODE, {"material.osl": osl.shader(closures)}),
        osl.notes,
        osl.facts,
        executor=BLENDER,
    ),
    "table": Target("a table of angles", table.measured, table.texts, table.difference, options=GRID),
    "zemax": Target("Zemax's tabulated BSDF", zemax.translated, zemax.texts, zemax.difference, options=GRID),
    "merl": Target("a MERL file", table.in_cells, table.file, table.looked_up, table.notes),
}
"""Targets by name."""
