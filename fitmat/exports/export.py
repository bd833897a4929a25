"""Export: a material written for a renderer, run there, with how far it is from the model, all or nothing.

It fits nothing, and knows no formula.
"""

import dataclasses
import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from fitmat import arguments, files
from fitmat.errors import ModelError, OutputError
from fitmat.exports import mitsuba, shaders, translation, verification
from fitmat.exports.verification import TOLERANCE, Difference
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import entries, vector
from fitmat.studies.result import Result
from fitmat.text import brief, plain
from fitmat.uncertainty.estimate import Quantity

if TYPE_CHECKING:
    from fitmat.fitting.result import Fit
    from fitmat.studies.study import Study


class Target(NamedTuple):
    """A renderer, or a language of renderers.

    Attributes:
        title: What it is, with its version.
        translate: Model → its form there.
        texts: Name of the files, header lines, form → file names and texts.
        difference: Model, form → how far its values there are; None where nothing runs it.
    """

    title: str
    translate: Callable[[AbstractBRDF], Any]
    texts: Callable[[str, Sequence[str], Any], dict[str, str]]
    difference: Callable[[AbstractBRDF, Any], Difference | None]
    notes: Callable[[AbstractBRDF], Sequence[str]]


TARGETS = {
    "glsl": Target("GLSL ES 3.00", translation.translated, shaders.texts, verification.difference, lambda _: ()),
    "mitsuba": Target("Mitsuba 3", mitsuba.translated, mitsuba.texts, mitsuba.difference, mitsuba.notes),
}
"""Targets by name."""

RECORD = "export.json"

FORMAT = 1
"""Of the record."""

LONGEST = 80
"""Characters of a name that files get."""

Material: TypeAlias = "AbstractBRDF | Fit | Study | Result"


@dataclasses.dataclass(frozen=True, eq=False)
class Export:
    """A material in the language of a renderer.

    Attributes:
        target: Key of `TARGETS`.
        model: The model's name.
        files: File names → texts, last the record.
        difference: From the model, where it was run.
        notes: In which conventions the target differs from the model, as sentences.
        folder: Where the files are, if they were written.
    """

    target: str
    model: str
    files: Mapping[str, str]
    difference: Difference | None
    notes: tuple[str, ...] = ()
    folder: Path | None = None

    __repr__ = brief

    def __str__(self) -> str:
        """What was written, and how far it is from the model."""
        where = "" if self.folder is None else f" in {self.folder}"
        lines = [
            f"{', '.join(self.files)}{where}: {self.model} in {TARGETS[self.target].title}.",
            _executed(self.difference),
        ]
        if self.difference is not None and self.difference.beyond:
            lines.append(f"{self.difference.beyond} directions are further apart than {TOLERANCE:g}.")
        return "\n".join(lines)


@dataclasses.dataclass(frozen=True, eq=False)
class Chosen:
    """What is exported: a model's material, where it comes from, and its intervals where there are any."""

    model: AbstractBRDF
    source: str
    channels: tuple[str, ...]
    parameters: tuple[Quantity, ...]

    __repr__ = brief


def export(
    material: Material,
    target: str = "glsl",
    folder: str | os.PathLike[str] | None = None,
    *,
    model: str | None = None,
    name: str | None = None,
    strict: bool = False,
    verify: bool = True,
    force: bool = False,
) -> Export:
    """Write a material for a renderer, run it there, and say how far it is from the model.

    GLSL: `NAME.glsl` holds the function `vec3 brdf(vec3 wi, vec3 wo)` to paste; `NAME.vert` and `NAME.frag` light with
    it (uniforms mvpMatrix, mvMatrix, source, emission; attributes position at 0 and normal at 2). Mitsuba: `NAME.py`
    holds the dictionary, `NAME.xml` the same as a scene to include. `export.json` holds the values and the difference.
    What the instrument and a tilted mount did is not part of the material.

    Args:
        material: A model, a fit, a study, or the result of one from `fitmat.load`.
        target: "glsl" or "mitsuba".
        folder: Where to; it appears complete or not at all. None to write nothing.
        model: Which model of a study; None for the one that the data prefer.
        name: Of the material, and of the files; None for that of the measurements, or of the model.
        strict: Whether to refuse where the target has another convention than the model, instead of saying so.
        verify: Whether to run it, in Chromium or in Mitsuba, where there is one.
        force: Replace the files of an earlier export in the folder.

    Raises:
        ModelError: a lobe cannot be translated, there are channels for which there are no colours, or no such model.
        OutputError: the folder holds something and `force` is off, it cannot be written, or what runs it fails.

    Example:
        >>> import fitmat as fm
        >>> print(export(fm.model("lambert", kd=0.5), verify=False).files["lambert.glsl"][-25:])
            return lambert(wi, wo);
        }
        <BLANKLINE>
    """
    arguments.choice("target", target, TARGETS)
    arguments.kind("folder", folder, str, os.PathLike, optional=True)
    for key, text in (("model", model), ("name", name)):
        arguments.kind(key, text, str, optional=True)
    arguments.flags(strict=strict, verify=verify, force=force)
    chosen = _chosen(material, model)
    if strict and (different := TARGETS[target].notes(chosen.model)):
        raise ModelError(f"{different[0]} Leave out strict to export it all the same.")
    called = name if name is not None else chosen.source or chosen.model.name
    if folder is None:
        return _made(chosen, target, called, verify=verify)
    with files.new(Path(folder), own=own, force=force) as draft:
        made = _made(chosen, target, called, verify=verify)
        for file, text in made.files.items():
            (draft / file).write_text(text, encoding="utf-8")
    return dataclasses.replace(made, folder=Path(folder))


def own(folder: Path) -> list[str]:
    """Names of the files that an export wrote into a folder, last the record, which names the others.

    Raises:
        OutputError: the folder has no record of an export.
    """
    try:
        found = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        names = [str(name) for name in found["files"] if found["fitmat"] and found["target"] in TARGETS]
    except (OSError, ValueError, LookupError, TypeError) as error:
        why = f"{folder} is not known to hold an export, and nothing in it is replaced"
        raise OutputError(f"{why}; give another --out DIR.") from error
    return [name for name in (*names, RECORD) if Path(name).name == name and os.path.lexists(folder / name)]


def file_name(name: str) -> str:
    """What files are called after a material: its letters, digits and `+-_.`, other things as one hyphen."""
    kept = re.sub(r"-{2,}", "-", re.sub(r"[^\w+.]", "-", name)).strip("-.")[:LONGEST].rstrip("-.")
    return kept or "material"


def _chosen(material: Material, name: str | None) -> Chosen:
    if isinstance(material, Result):
        one = material.fitted(name)
        return Chosen(surface(one.model), material.source, one.channels, one.parameters)
    if not isinstance(material, AbstractBRDF):
        return _of_study(material, name)
    if name is not None:
        raise ModelError(f"model {name!r} beside one model, expected it with a study or a result. Leave it out.")
    return Chosen(surface(material), "", (), ())


def _of_study(material: "Fit | Study", name: str | None) -> Chosen:
    """A model of a study, or a fit; what makes these is loaded only where somebody has one."""
    from fitmat.fitting.result import Fit
    from fitmat.studies.study import Study

    arguments.kind("material", material, AbstractBRDF, Fit, Study, Result)
    if isinstance(material, Study):
        named = {found.name: found for found in material.findings}
        best = material.choice.best.name if material.choice is not None else None
        wanted = name or best or (next(iter(named)) if len(named) == 1 else None)
        if wanted not in named:
            raise ModelError(f"model is {wanted!r}, expected one of the study: {', '.join(named)}.")
        fit, parameters = named[wanted].fit, named[wanted].parameters
    else:
        fit, parameters = material, ()
        if name not in (None, fit.name):
            raise ModelError(f"model is {name!r}, expected that of the fit, {fit.name}. Leave it out.")
    return Chosen(surface(fit.model), fit.measurements.source, fit.measurements.channels, parameters)


def _made(chosen: Chosen, target: str, name: str, *, verify: bool) -> Export:
    made = TARGETS[target]
    form = made.translate(chosen.model)
    found = made.difference(chosen.model, form) if verify else None
    called = file_name(Path(name).stem if name == chosen.source else name)
    texts = made.texts(called, _header(chosen, target, name, found), form)
    record = plain(_record(chosen, target, name, list(texts), found))
    texts[RECORD] = json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    return Export(target, chosen.model.name, texts, found, tuple(made.notes(chosen.model)))


def _header(chosen: Chosen, target: str, name: str, found: Difference | None) -> list[str]:
    """Lines of ASCII; names are quoted as JSON writes them, which ends no comment and no line."""
    lines = [f"{json.dumps(name)}: {chosen.model.name}, {TARGETS[target].title}, by fitmat {version('fitmat')}."]
    if chosen.source:
        lines.append(f"Fitted to {json.dumps(chosen.source)}.")
    if len(chosen.channels) == 3:
        lines.append(f"Red, green and blue are the channels {', '.join(map(json.dumps, chosen.channels))}.")
    of_model = {entry.name for entry in entries(chosen.model)}
    known = [words for q in chosen.parameters if q.name in of_model for words in _interval(q)]
    if known:
        lines += ["95 % intervals:", *(f"  {words}" for words in known)]
    return [*lines, *TARGETS[target].notes(chosen.model), *_executed(found).split("\n")]


def _interval(q: Quantity) -> list[str]:
    ends = [f"{low:.4g} to {high:.4g}" for low, high in q.ci95 if np.isfinite([low, high]).all() and low < high]
    return [f"{q.name} {', '.join(ends)}"] if len(ends) == len(q.ci95) else []


def _executed(found: Difference | None) -> str:
    return "Not executed here." if found is None else found.words


def _record(chosen: Chosen, target: str, name: str, names: Sequence[str], found: Difference | None) -> dict[str, Any]:
    values = np.asarray(vector(chosen.model))
    return {
        "format": FORMAT,
        "fitmat": version("fitmat"),
        "target": target,
        "version": TARGETS[target].title,
        "name": name,
        "source": chosen.source,
        "model": chosen.model.name,
        "channels": list(chosen.channels),
        "values": {e.name: values[e.place] if e.shape else values[e.place][0] for e in entries(chosen.model)},
        "files": list(names),
        "notes": list(TARGETS[target].notes(chosen.model)),
        "executed": None if found is None else dataclasses.asdict(found),
    }
