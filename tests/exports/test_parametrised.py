"""A model whose parameters are uniforms has the values that the same model has with its numbers in the text."""

import re

import numpy as np
import pytest
from test_glsl import COVERED, NAMES, TOLERANCE, chromium, own, sharp

import fitmat as fm
from fitmat.exports.glsl.translation import Parametrised, parametrised, translated
from fitmat.exports.verification import compared, directions, exact, run
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import bounds, entries, vector, with_vector

DEFAULTS = ("lambert+blinn-phong", "lambert+ggx")


def set_to(model: AbstractBRDF, free: Parametrised) -> dict[str, list[float]]:
    """What the uniforms are for the values of a model; one number for all channels serves red, green and blue."""
    values = np.asarray(vector(model), float)
    sizes = {name: 3 if kind == "vec3" else 1 for kind, name in re.findall(r"^uniform (\w+) (\w+);", free.text, re.M)}
    named = {free.uniforms[e.name]: values[e.place] for e in entries(model) if e.name in free.uniforms}
    return {name: np.broadcast_to(each, sizes[name]).tolist() for name, each in named.items()}


def moved(model: AbstractBRDF, place: int) -> AbstractBRDF:
    """The same with one number further from its bounds, or a little further on."""
    low, high = bounds(model)
    values = np.array(vector(model), float)
    values[place] = 0.9 * values[place] + 0.1 * (low[place] + high[place]) / 2.0 + 1e-3
    return with_vector(model, values)


@pytest.mark.parametrize("name", [name for name in NAMES if name not in COVERED])
def test_the_text_depends_on_no_uniform(name: str) -> None:
    """And on every parameter that is none: whatever a lobe makes numbers of is said by it, and nothing else."""
    model = sharp(name)
    text, uniforms = parametrised(model)
    for entry in entries(model):
        same = [parametrised(moved(model, k)).text == text for k in range(entry.place.start, entry.place.stop)]
        assert same == [entry.name in uniforms] * entry.size, entry.name
    declared = set(re.findall(r"^uniform (?:float|vec3) (\w+);$", text, re.MULTILINE))
    assert declared == set(uniforms.values())


@pytest.mark.study
def test_what_a_cover_makes_numbers_of_is_no_uniform() -> None:
    assert parametrised(sharp("plastic")).uniforms.keys() == {"ks", "kd"}
    model = sharp("varnish-over-lambert")
    assert parametrised(model) == (translated(model), {})


def test_uniforms_are_the_numbers_of_the_text() -> None:
    """Run with values that are not those of the text's model: the values are the other's."""
    models = [fm.model(name) for name in DEFAULTS] + [fm.model("disney-2012+ggx-aniso-f82", channels=3)]
    others = [with_vector(m, 0.9 * np.asarray(vector(m)) + 0.02) for m in models]
    free = [parametrised(m) for m in models]
    wi, wo = directions()
    told = [set_to(m, each) for m, each in zip(others, free, strict=True)]
    found, executor = run([each.text for each in free], wi, wo, chromium(), uniforms=told)
    for values, model, before in zip(found, others, models, strict=True):
        light, eye = exact(wi, wo)
        assert compared(values, own(model, light, eye), wi, wo, executor).largest <= TOLERANCE
        assert compared(values, own(before, light, eye), wi, wo, executor).mean > TOLERANCE


def test_nothing_but_the_declarations_differs() -> None:
    for name in DEFAULTS:
        text, uniforms = parametrised(fm.model(name))
        pattern = (
            rf"^(?:const (?:float|vec[23])|uniform \w+|#define) (?:{'|'.join(uniforms.values())}|\w+_slopes)\b.*\n"
        )
        fixed, free = (re.sub(pattern, "", each, flags=re.MULTILINE) for each in (translated(fm.model(name)), text))
        assert fixed == free
