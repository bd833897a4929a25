"""Targets: for what a material can be written, and which room does it.

It writes nothing itself.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from fitmat.exports import gltf, materialx, materialx_shader, mitsuba, shaders, table, translation, verification, zemax
from fitmat.exports.material import Chosen
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
        translate: What is exported → its form there; where `gridded` also theta_i and step.
        texts: Name of the files, header lines, form → file names and contents.
        difference: What is exported, form → how far its values there are; None where nothing runs it.
        notes: The same → what differs from the model, as sentences; `strict` refuses where there are any.
        facts: Form → what the record holds besides.
        gridded: Whether it has a grid of angles, which can be chosen.
    """

    title: str
    translate: Callable[..., Any]
    texts: Callable[[str, Sequence[str], Any], Mapping[str, str | bytes]]
    difference: Callable[[Chosen, Any], Difference | None]
    notes: Callable[[Chosen, Any], Sequence[str]] = _none
    facts: Callable[[Any], Mapping[str, Any]] = _nothing
    gridded: bool = False


TARGETS = {
    "glsl": Target(
        "GLSL ES 3.00",
        lambda chosen: translation.translated(chosen.model),
        shaders.texts,
        lambda chosen, source: verification.difference(chosen.model, source),
    ),
    "mitsuba": Target(
        "Mitsuba 3",
        lambda chosen: mitsuba.translated(chosen.model),
        mitsuba.texts,
        lambda chosen, plugin: mitsuba.difference(chosen.model, plugin),
        lambda chosen, plugin: mitsuba.notes(chosen.model),
    ),
    "gltf": Target("glTF 2.0", gltf.translated, gltf.texts, gltf.difference, gltf.notes, lambda found: found.facts),
    "materialx": Target(
        "MaterialX 1.39.5",
        materialx.translated,
        materialx.texts,
        materialx_shader.difference,
        materialx.notes,
        materialx.facts,
    ),
    "openpbr": Target(
        "OpenPBR 1.1.1 in MaterialX 1.39.5",
        materialx.open_surface,
        materialx.texts,
        materialx_shader.difference,
        materialx.notes,
        materialx.facts,
    ),
    "table": Target("a table of angles", table.measured, table.texts, table.difference, gridded=True),
    "zemax": Target("Zemax's tabulated BSDF", zemax.translated, zemax.texts, zemax.difference, gridded=True),
    "merl": Target("a MERL file", table.in_cells, table.file, table.looked_up, table.notes),
}
"""Targets by name."""
