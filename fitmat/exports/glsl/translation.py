"""Translation: a model in GLSL ES 3.00, put together from what its lobes and terms say of themselves.

It knows no lobe and no formula; a lobe that says nothing is refused.
"""

import dataclasses
import functools
import inspect
import json
import re
import unicodedata
from collections.abc import Collection, Iterator
from importlib.resources import files
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from fitmat.errors import ModelError
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF, AbstractEstimated, Sum
from fitmat.models.glsl import EVERY, AbstractShaded, scalar, spectrum
from fitmat.models.parameters import entries
from fitmat.models.registry import OVER

COLOURS = (1, 3)
"""Numbers of channels that a shader's vec3 holds: grey, or red, green and blue."""

BRDF = """
// BRDF in 1/sr, without the cosine: unit vectors wi to the light and wo to the eye, in the surface frame, n = +z.
vec3 brdf(vec3 wi, vec3 wo) {{
    if (wi.z <= 0.0 || wo.z <= 0.0) {{
        return vec3(0.0);
    }}
    return {sum};
}}
"""

_DECLARED = re.compile(r"^(?:(?:const |uniform )?(?:float|vec2|vec3|Pair|struct)|#define) (\w+)", re.MULTILINE)
_FOLLOWS = re.compile(r"^const (?:float|vec2|vec3) (\w+) = ([^;]+);", re.MULTILINE)
_PLAIN = {
    **{"−": "-", "·": ".", "×": "x", "√": "sqrt", "½": "1/2", "⅛": "1/8", "Σ": "sum", "′": "'"},
    **{"ē": "e_mean", "Ē": "E_mean"},
}
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻ⁿ", "0123456789-n")


def translated(model: AbstractBRDF) -> str:
    """The function `vec3 brdf(vec3 wi, vec3 wo)` with all that it needs, in ASCII.

    Args:
        model: Of one channel, which becomes grey, or three, which become red, green and blue.

    Raises:
        ModelError: a lobe has no form in GLSL, or there are channels of another number.
    """
    return _complete(model, free=False)


class Parametrised(NamedTuple):
    """A model in GLSL whose parameters are uniforms.

    Attributes:
        text: As `translated` writes it, but for the declarations of the parameters.
        uniforms: Names of parameters, as `entries` has them → uniforms, float where the parameter is one number for
            all channels, else vec3. What the shader holds numbers made from stays a constant and is not among them.
    """

    text: str
    uniforms: dict[str, str]


def parametrised(model: AbstractBRDF) -> Parametrised:
    """The function `vec3 brdf(vec3 wi, vec3 wo)` with uniforms instead of the parameters' values.

    Args:
        model: As of `translated`; its values count for what is no uniform.

    Raises:
        ModelError: as `translated`.

    Example:
        >>> import fitmat as fm
        >>> parametrised(fm.model("lambert+ggx-kc")).uniforms
        {'kd': 'lambert_kd', 'ks': 'ggx_kc_ks'}
    """
    material = surface(model)
    names = zip(entries(material), _uniforms(material), strict=True)
    return Parametrised(_complete(material, free=True), {entry.name: name for entry, name in names if name})


def _complete(model: AbstractBRDF, *, free: bool) -> str:
    text, total = _sum(surface(model), free=free)
    text += BRDF.format(sum=total)
    return _needed(text) + text


def _sum(model: AbstractBRDF, *, free: bool) -> tuple[str, str]:
    """The functions of a model's lobes, and the expression that adds them up."""
    lobes = model.lobes if isinstance(model, Sum) else (model,)
    return "".join(_lobe(lobe, free=free) for lobe in lobes), " + ".join(f"{_scope(lobe)}(wi, wo)" for lobe in lobes)


def _lobe(lobe: AbstractBRDF, *, free: bool) -> str:
    """The parameters of a lobe, the functions of its parts and its own, each name with the lobe's before it."""
    scope, own = _scope(lobe), lobe.glsl()
    if not own:
        why = "is estimated and has no formula; ggx-kc has" if isinstance(lobe, AbstractEstimated) else "is not"
        raise ModelError(f"{lobe.name} {why} translated into GLSL; expected a sum of lobes that have one, as ggx.")
    below, base = _base(lobe)
    values = "".join(_declaration(*each, free=free) for each in _parameters(lobe, lobe.numbers))
    body = "\n\n".join(text.strip("\n") for text in (values, *base, *_parts(lobe), own)) + "\n"
    body = _followed(body) if free else body
    named = re.compile(rf"(?<![\w.])({'|'.join(_DECLARED.findall(body))})\b")

    def scoped(line: str) -> str:
        code, comment, words = line.partition("//")
        return named.sub(lambda found: scope if found[1] == "lobe" else f"{scope}_{found[1]}", code) + comment + words

    return below + f"\n// --- {lobe.name}{_formula(lobe)}\n\n" + "\n".join(map(scoped, body.split("\n")))


def _base(lobe: AbstractBRDF) -> tuple[str, list[str]]:
    """Of a cover what lies below it: its functions, and the one that the cover calls."""
    if (inner := lobe.below()) is None:
        return "", []
    below, total = _sum(inner, free=False)
    return below, [f"vec3 base(vec3 wi, vec3 wo) {{\n    return {total};\n}}"]


def _scope(lobe: AbstractBRDF) -> str:
    """What a lobe's names begin with; a cover's without its base."""
    return re.sub(r"\W", "_", lobe.name.partition(OVER)[0])


def _parameters(module: AbstractShaded, built_in: Collection[str]) -> Iterator[tuple[str, Any, bool, bool]]:
    """Name, value, whether it is a spectrum and whether numbers are made from it, of a lobe and of its parts."""
    for field in dataclasses.fields(module):
        value = getattr(module, field.name)
        if "param" in field.metadata:
            size, p = np.size(value), field.metadata["param"]
            if size not in COLOURS:
                raise ModelError(f"{field.name} has {size} channels, expected 1 or 3: a shader has three colours.")
            yield field.name, value, p.per_channel or size > 1, field.name in built_in or EVERY in built_in
        elif isinstance(value, AbstractShaded) and not isinstance(value, AbstractBRDF):
            yield from _parameters(value, (*built_in, *value.numbers))


def _declaration(name: str, value: Any, per_channel: bool, built_in: bool, *, free: bool) -> str:
    """A parameter as the shader's constant or uniform of that name."""
    if free and not built_in:
        return f"uniform {'vec3' if per_channel else 'float'} {name};\n"
    return (spectrum if per_channel else scalar)(name, value)


def _uniforms(model: AbstractBRDF) -> Iterator[str]:
    """The uniform of every parameter of a model, in the order of `entries`; "" for one that is none."""
    for lobe in model.lobes if isinstance(model, Sum) else (model,):
        own = [("" if held else f"{_scope(lobe)}_{name}") for name, _, _, held in _parameters(lobe, lobe.numbers)]
        below = len(entries(lobe)) - len(own)  # of a cover, which holds every number
        yield from [*own, *[""] * below]


def _followed(body: str) -> str:
    """Constants that follow from uniforms, which GLSL does not allow, as macros."""
    free = set(re.findall(r"^uniform \w+ (\w+);", body, re.MULTILINE))

    def macro(found: re.Match[str]) -> str:
        if not free & set(re.findall(r"\w+", found[2])):
            return found[0]
        free.add(found[1])
        return f"#define {found[1]} ({' '.join(found[2].split())})"

    return _FOLLOWS.sub(macro, body)


def _parts(module: eqx.Module) -> list[str]:
    """What the parts of a lobe declare."""
    values = [getattr(module, field.name) for field in dataclasses.fields(module)]
    parts = (part for part in values if isinstance(part, AbstractShaded) and not isinstance(part, AbstractBRDF))
    return [part.glsl() for part in parts]


def _formula(lobe: AbstractBRDF) -> str:
    """The paragraph of the manual page that begins with f =, as comment lines."""
    paragraphs = (inspect.getdoc(type(lobe)) or "").split("\n\n")
    said = next((p for p in paragraphs if p.startswith("f = ")), "")
    return "".join(f"\n// {ascii_only(line)}" for line in said.splitlines())


def ascii_only(text: str) -> str:
    """A formula without letters that a compiler of shaders might refuse: Greek by name, powers with ^.

    Example:
        >>> ascii_only("ks (n+8)/(8π) c_hⁿ")
        'ks (n+8)/(8pi) c_h^n'
    """
    text = re.sub(r"[⁰¹²³⁴⁵⁶⁷⁸⁹⁻ⁿ]+", lambda found: "^" + found[0].translate(_RAISED), text.replace(" · ", " * "))
    return "".join(_letter(letter) for letter in text)


def _letter(letter: str) -> str:
    if letter.isascii():
        return letter if letter.isprintable() else json.dumps(letter)[1:-1]
    known = unicodedata.name(letter, "")
    if known.startswith("GREEK") and "LETTER" in known:
        greek = known.split("LETTER ")[1].split()[0].lower().replace("omega", "w")
        return greek.capitalize() if "CAPITAL" in known else greek
    return _PLAIN.get(letter, unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode() or "?")


@functools.cache
def _terms() -> list[tuple[set[str], str]]:
    """The shared declarations: what each declares, and its text."""
    text = files("fitmat.exports.glsl").joinpath("terms.glsl").read_text(encoding="utf-8")
    return [(set(_DECLARED.findall(part)), part.strip("\n")) for part in text.split("\n\n")[1:]]


def _needed(text: str) -> str:
    """The shared declarations that a text uses, and those that these use, in the order of their file."""
    terms, words = _terms(), set(re.findall(r"\w+", text))
    for names, term in reversed(terms):
        if names & words:
            words |= set(re.findall(r"\w+", term.split("\n", 1)[1] if term.startswith("//") else term))
    return "\n\n".join(term for names, term in terms if names & words) + "\n"
