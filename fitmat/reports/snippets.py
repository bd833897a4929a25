"""Snippets: the fitted parameters as text to paste, into JSON, Python and a shader.

It translates no model; `exports` does.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from fitmat.models.registry import LOBES, lobe_names
from fitmat.models.terms.film import Film

Record = Mapping[str, Any]
"""A part of the record of a study, as JSON types."""

DIGITS = 6
"""Significant digits of what is pasted."""


def snippets(fit: Record) -> list[tuple[str, str]]:
    """What to call it, and the text, of each language, without instrument and misfit; none of a model without values.

    Args:
        fit: One of the record's `fits`.
    """
    if fit.get("dispersion") is not None or _has_film(fit["model"]):  # of whose wavelengths a model by name knows none
        return []
    own = {key for part in lobe_names(fit["model"]) for key in LOBES[part].defaults()}
    told = {name: q["value"] for name, q in fit["parameters"].items() if name.rpartition(".")[2] in own}
    if not told or any(v is None for value in told.values() for v in _listed(value)):
        return []
    return [("JSON", _json(fit["model"], told)), ("Python", _python(fit, told)), ("shader", _shader(told))]


def _has_film(name: str) -> bool:
    return any(LOBES[part].parts.get("fresnel") is Film for part in lobe_names(name))


def _listed(value: Any) -> Sequence[Any]:
    return value if isinstance(value, list) else [value]


def _short(value: float) -> str:
    return f"{value:.{DIGITS}g}"


def _json(name: str, told: Record) -> str:
    rounded = {k: [float(_short(x)) for x in v] if isinstance(v, list) else float(_short(v)) for k, v in told.items()}
    return json.dumps({"model": name, **rounded}, ensure_ascii=False)


def _python(fit: Record, told: Record) -> str:
    """A call that builds the model; names that are no Python name go by a dict."""
    parts = [repr(fit["model"])] + ([f"masking={fit['masking']!r}"] if fit["masking"] else [])
    texts = {k: f"[{', '.join(map(_short, v))}]" if isinstance(v, list) else _short(v) for k, v in told.items()}
    parts += [f"{k}={text}" for k, text in texts.items() if k.isidentifier()]
    odd = [f"{k!r}: {text}" for k, text in texts.items() if not k.isidentifier()]
    if odd:
        parts.append(f"**{{{', '.join(odd)}}}")
    return f"fm.model({', '.join(parts)})"


def _shader(told: Record) -> str:
    """Constants of GLSL; of three channels a vec3."""
    lines = []
    for name, value in told.items():
        numbers = [_float(x) for x in _listed(value)]
        word = name.replace(".", "_").replace("-", "_")
        if not isinstance(value, list):
            lines.append(f"const float {word} = {numbers[0]};")
        elif len(numbers) == 3:
            lines.append(f"const vec3 {word} = vec3({', '.join(numbers)});")
        else:
            lines.append(f"const float {word}[{len(numbers)}] = float[]({', '.join(numbers)});")
    return "\n".join(lines)


def _float(value: float) -> str:
    """A literal that GLSL takes for a float."""
    text = _short(value)
    return text if any(c in text for c in ".e") else f"{text}.0"
