"""Export: a material written for a renderer, run there, with how far it is from the model, all or nothing.

It fits nothing, and knows no formula.
"""

import dataclasses
import json
import os
import re
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fitmat import arguments, files
from fitmat.errors import ModelError, OutputError
from fitmat.exports.material import Chosen, Material, chosen
from fitmat.exports.targets import TARGETS, Target
from fitmat.exports.verification import TOLERANCE, Difference
from fitmat.fitting.quantities import Quantity
from fitmat.models.parameters import entries, vector
from fitmat.text import brief, plain

RECORD = "export.json"

FORMAT = 1
"""Of the record."""

LONGEST = 80
"""Characters of a name that files get."""


@dataclasses.dataclass(frozen=True, eq=False)
class Export:
    """A material in the language of a renderer.

    Attributes:
        target: Key of `TARGETS`.
        model: The model's name.
        files: File names → their contents, bytes where they are no text; last the record.
        difference: From the model, where it was run.
        notes: In which conventions the target differs from the model, as sentences.
        folder: Where the files are, if they were written.
    """

    target: str
    model: str
    files: Mapping[str, Any]
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
        executor = TARGETS[self.target].executor
        if self.difference is None and executor:
            lines.append(f"Where there is {executor}, it is run and compared with the model.")
        lines[1:1] = self.notes
        return "\n".join(lines)


def export(
    material: Material,
    target: str = "glsl",
    folder: str | os.PathLike[str] | None = None,
    *,
    model: str | None = None,
    name: str | None = None,
    theta_i: ArrayLike | None = None,
    step: float | None = None,
    bump: bool = False,
    strict: bool = False,
    verify: bool = True,
    force: bool = False,
) -> Export:
    """Write a material for a renderer, run it there, and say how far it is from the model.

    GLSL, of ES 3.00 or of 3.30: `NAME.glsl` holds the function `vec3 brdf(vec3 wi, vec3 wo)` to paste; `NAME.vert` and
    `NAME.frag` light with it (uniforms mvpMatrix, mvMatrix, source, emission; attributes position at 0 and normal at
    2). Mitsuba: `NAME.py`
    holds the dictionary, `NAME.xml` the same as a scene to include. MaterialX: `NAME.mtlx`, standard nodes or the
    closest OpenPBR surface. The closest material that they hold: glTF, `NAME.gltf`; OpenUSD, `NAME.usda`; pbrt,
    `NAME.pbrt`; Radiance, `NAME.rad`; Blender, `NAME.py`, which makes it; Unreal and Unity,
    `NAME.json`, the values to type in. OSL: `NAME.osl`. A table: `NAME.csv`, `NAME.parquet` and `NAME.json`, the values
    at a goniometer's angles. MERL: `NAME.binary`; Zemax: `NAME.bsdf`; a Klems matrix: `NAME.xml`. `export.json`
    holds the values and the difference.
    What the instrument and a tilted mount did is not part of the material.

    Args:
        material: A model, a fit, a study, or the result of one from `fitmat.load`.
        target: "glsl", "glsl-330", "mitsuba", "materialx", "openpbr", "gltf", "usd", "pbrt", "radiance",
            "klems", "blender", "unreal", "unity", "osl", "zemax", "table" or "merl".
        folder: Where to; it appears complete or not at all. None to write nothing.
        model: Which model of a study; None for the one that the data prefer.
        name: Of the material, and of the files; None for that of the measurements, or of the model.
        theta_i: Zenith angles of incidence of a table in radians, (k,); None for those of reflection.
        step: Between its angles of reflection and between azimuths, radians; None for 5°, 15° of anisotropic materials.
        bump: Whether the fragment shader bends the normal by the surface gradient of a height, its uniform `bump`.
        strict: Whether to refuse where the target differs from the model, instead of saying so.
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
    arguments.kind("name", name, str, optional=True)
    arguments.flags(bump=bump, strict=strict, verify=verify, force=force)
    more = {"theta_i": theta_i, "step": step, "bump": bump or None}
    more = {key: value for key, value in more.items() if value is not None}
    for key in more:
        if key not in TARGETS[target].options:
            having = ", ".join(name for name, one in TARGETS.items() if key in one.options)
            raise ModelError(f"{key} with target {target!r}, expected it with {having} only. Leave it out.")
    what = chosen(material, model)
    called = name if name is not None else what.source or what.model.name
    options = {"strict": strict, "verify": verify}
    if folder is None:
        return _made(what, target, called, more, **options)
    with files.new(Path(folder), own=own, force=force) as draft:
        made = _made(what, target, called, more, **options)
        for file, content in made.files.items():
            (draft / file).write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
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


def _made(chosen: Chosen, target: str, name: str, more: Mapping[str, Any], *, strict: bool, verify: bool) -> Export:
    made = TARGETS[target]
    form = made.translate(chosen, **more)
    notes = tuple(made.notes(chosen, form))
    if strict and notes:
        raise ModelError(f"{' '.join(notes)} Leave out strict to export it all the same.")
    found = made.difference(chosen, form) if verify else None
    called = file_name(Path(name).stem if name == chosen.source else name)
    header = [*_header(chosen, made, name), *notes, *_executed(found).split("\n")]
    contents = dict(made.texts(called, header, form))
    record = _record(chosen, target, name) | dict(made.facts(form))
    record |= {"files": list(contents), "notes": list(notes)}
    record |= {"executed": None if found is None else dataclasses.asdict(found)}
    contents[RECORD] = json.dumps(plain(record), indent=1, allow_nan=False) + "\n"
    return Export(target, chosen.model.name, contents, found, notes)


def _header(chosen: Chosen, made: Target, name: str) -> list[str]:
    """Lines of ASCII; names are quoted as JSON writes them, which ends no comment and no line."""
    lines = [f"{json.dumps(name)}: {chosen.model.name}, {made.title}, by fitmat {version('fitmat')}."]
    if chosen.source:
        lines.append(f"Fitted to {json.dumps(chosen.source)}.")
    if len(chosen.channels) == 3:
        lines.append(f"Red, green and blue are the channels {', '.join(map(json.dumps, chosen.channels))}.")
    of_model = {entry.name for entry in entries(chosen.model)}
    known = [words for q in chosen.parameters if q.name in of_model for words in _interval(q)]
    return lines + (["95 % intervals:", *(f"  {words}" for words in known)] if known else [])


def _interval(q: Quantity) -> list[str]:
    ends = [f"{low:.4g} to {high:.4g}" for low, high in q.ci95 if np.isfinite([low, high]).all() and low < high]
    return [f"{q.name} {', '.join(ends)}"] if len(ends) == len(q.ci95) else []


def _executed(found: Difference | None) -> str:
    return "Not executed here." if found is None else found.words


def _record(chosen: Chosen, target: str, name: str) -> dict[str, Any]:
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
    }
