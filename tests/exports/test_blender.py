"""Blender gets Cycles' own material, as Python that makes it, and Cycles has its values."""

import ast
import json
import stat
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.cycles_principled import principled
from test_materialx import pairs

import fitmat as fm
from fitmat.errors import ModelError, OutputError
from fitmat.exports.blender import cycles, script
from fitmat.exports.blender.models import Coated, Drawn, Principled
from fitmat.exports.closest import Closest
from fitmat.exports.metallic_roughness import Squared
from fitmat.exports.verification import TOLERANCE
from fitmat.models.base import AbstractBRDF, evaluate
from fitmat.models.terms.distributions import Isotropic

C, T = np.array([0.8, 0.4, 0.1]), np.array([0.9, 0.5, 0.3])


def node(shape: Any, **values: Any) -> Principled:
    given: dict[str, Any] = {"base_color": C, "specular_tint": T} | values
    return Principled(**given, shape=shape)


def squared(roughness: Any) -> Squared:
    return Squared(roughness=roughness)


def drawn(**values: Any) -> Drawn:
    return Drawn(**values)


SATIN = node(squared(0.4), ior=1.7, diffuse_roughness=0.6)
HALF: dict[str, Any] = {"weight": 0.5}
THIN: dict[str, Any] = {"alpha": 0.09}
RUN: dict[str, Principled | Coated] = {
    "satin": SATIN,
    "glossy": node(squared(0.15), ior=2.0),
    "metal": node(squared(0.3), metallic=1.0),
    "brushed": node(drawn(roughness=0.4, anisotropic=0.6, rotation=30.0), metallic=1.0),
    "varnished": Coated(SATIN, **HALF, coat=Isotropic(**THIN)),
    "polished": Coated(SATIN, **HALF),
}


def written(model: AbstractBRDF) -> Closest:
    """A Principled BSDF as if it had been found."""
    return Closest(model, "", 0.0, 0.0, 0.0, 0.0, 0.0, {}, True)


def test_the_model_is_cycles_code() -> None:
    """Line by line, at pairs and three channels, the table integrated anew; another metallic is seen."""
    wi, wo = (w[:15] for w in pairs())
    for metallic in (0.0, 0.3):
        model = node(squared(0.43), metallic=metallic, ior=1.7, diffuse_roughness=0.6)
        found = evaluate(model, wi, wo)
        for k, (color, tint) in enumerate(zip(C, T, strict=True)):
            given = color, metallic, 0.43, 1.7, tint, T.max(), 0.6
            expected = np.array([principled(*given, *pair) for pair in zip(wi.tolist(), wo.tolist(), strict=True)])
            assert np.abs(found[:, k] / expected - 1.0).max() < 1e-3  # what is left is our quadrature of the table
            assert np.abs(evaluate(SATIN, wi, wo)[:, k] / expected - 1.0).max() > 0.01


def program() -> str:
    found = cycles.program()
    if found is None:
        pytest.skip("no Blender: materials are run in it where a program called blender is found")
    return found


@pytest.mark.study
@pytest.mark.parametrize("name", RUN)
def test_cycles_has_the_models_values(name: str) -> None:
    """Over 12,288 pairs of directions; with the roughness changed they are others."""
    program()
    made = script.code("m", written(RUN[name]))
    found = cycles.difference(RUN[name], made)
    assert found is not None
    assert found.largest < TOLERANCE, found.words
    model = RUN[name]
    base = model.base if isinstance(model, Coated) else model
    rough = f'"Roughness": {float(base.shape.roughness)}'
    assert rough in made
    other = cycles.difference(RUN[name], made.replace(rough, '"Roughness": 0.5'))
    assert other is not None
    assert other.largest > 0.1


def test_facets_are_where_a_lobe_is_hard() -> None:
    """More than 10,000; about the half vector, grazing, and light and eye on one line."""
    light, corners = cycles.facets()
    wi, wo = cycles.frames(light, corners)
    assert len(wi) > 10_000
    for w in (wi, wo):
        assert np.abs(np.linalg.norm(w, axis=1) - 1.0).max() < 1e-12
        assert np.count_nonzero(w[:, 2] < np.cos(np.deg2rad(85.0))) > 500
        assert w[:, 2].min() > 0.9 * cycles.LOWEST
    between = np.repeat(light[:, 2], cycles.SIZE**2)
    assert np.abs(np.sum(wi * wo, axis=1) - between).max() < 1e-12
    h = (wi + wo) / np.linalg.norm(wi + wo, axis=1)[:, None]
    slope = np.hypot(h[:, 0], h[:, 1]) / h[:, 2]
    for low in 10.0 ** np.arange(-3.0, 0.0):
        assert np.count_nonzero((slope > low) & (slope < 10 * low)) > 500


def test_the_text_makes_the_material_and_nothing_else() -> None:
    """Whatever the name holds: Python in ASCII of the same statements, with the sockets' own units."""
    name = 'it\'s "é*/ --> ]]> \\ \n\u202e """\nimport os'
    plain, odd = (
        script.texts(file, [json.dumps(said)], written(RUN["brushed"])) for file, said in (("m", "m"), ("é", name))
    )
    (benign,), (hostile,) = plain.values(), odd.values()
    assert hostile.isascii()
    kinds = [[type(each) for each in ast.parse(text).body] for text in (benign, hostile)]
    assert kinds[0] == kinds[1]
    assert [each.names[0].name for each in ast.parse(hostile).body if isinstance(each, ast.Import)] == ["bpy"]
    values = ast.literal_eval(benign.partition("VALUES = ")[2].partition("\n\n")[0])
    assert values["Base Color"] == [0.8, 0.4, 0.1, 1.0]
    assert values["Anisotropic Rotation"] == pytest.approx(30.0 / 360.0)
    assert "ShaderNodeTangent" in benign
    assert "ShaderNodeTangent" not in script.code("m", written(SATIN))


def test_a_blender_that_fails_is_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = script.code("m", written(SATIN))
    monkeypatch.setattr(cycles, "program", lambda: None)
    assert cycles.difference(SATIN, made) is None
    for text, sentence in (("echo no >&2; exit 1", r"cannot run the material \(no\)"), ("exit 0", "made no values of")):
        file = tmp_path / "blender"
        file.write_text(f"#!/bin/sh\n{text}\n")
        file.chmod(file.stat().st_mode | stat.S_IEXEC)
        monkeypatch.setattr(cycles, "program", lambda file=file: str(file))
        with pytest.raises(OutputError, match=sentence):
            cycles.difference(SATIN, made)
    monkeypatch.setattr(cycles, "program", lambda: "/nowhere/blender")
    with pytest.raises(OutputError, match=r"cannot run the material \(.*No such file"):
        cycles.difference(SATIN, made)


def test_other_channels_are_refused() -> None:
    for target, whose in (("blender", "Blender"), ("osl", "OSL")):
        with pytest.raises(ModelError, match=f"there are 4 channels, expected 1 or 3: the colours of {whose} are thr"):
            fm.export(fm.model("lambert", channels=4), target)


@pytest.mark.study
def test_what_blender_holds_is_found_and_passes_strict(monkeypatch: pytest.MonkeyPatch) -> None:
    """A metal of Schlick's curve: the tint is 1, and roughness is √α."""
    monkeypatch.setattr(cycles, "program", lambda: None)
    made = fm.export(fm.model("ggx-schlick", f0=0.6, alpha=0.2), "blender", name="m", strict=True)
    told = json.loads(made.files["export.json"])["closest"]
    assert told["values"]["roughness"][0] == pytest.approx(0.2**0.5, rel=1e-3)
    assert "Not executed here." in made.files["m.py"]
