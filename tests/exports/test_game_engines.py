"""Unreal's and Unity's materials are the engines' own code, and the file has their names and units."""

import json
from typing import Any

import numpy as np
import pytest
from oracles import game_engines as oracle
from test_materialx import pairs

import fitmat as fm
from fitmat.errors import ModelError
from fitmat.exports.closest import Closest
from fitmat.exports.game_engines import UNITY, UNREAL, Unity, Unreal
from fitmat.models.base import AbstractBRDF, evaluate

C = np.array([0.8, 0.4, 0.1])
PAINT: dict[str, Any] = {"base_color": C, "metallic": 0.3, "roughness": 0.4}


def written(model: AbstractBRDF) -> Closest:
    return Closest(model, "", 0.0, 0.0, 0.0, 0.0, 0.0, {}, True)


def test_the_models_are_the_engines_code() -> None:
    """Line by line, at 200 pairs and three channels; Unreal's dark F0 is shadowed; other numbers are seen."""
    wi, wo = pairs()
    each = list(zip(wi.tolist(), wo.tolist(), strict=True))
    for metallic, specular in ((0.3, 0.7), (0.0, 0.1)):
        values: dict[str, Any] = PAINT | {"metallic": metallic}
        more: dict[str, Any] = {"specular": specular}
        unreal, unity = evaluate(Unreal(**values, **more), wi, wo), evaluate(Unity(**values), wi, wo)
        for k in range(3):
            expected = np.array([oracle.unreal(C[k], C[1], metallic, specular, 0.4, *one) for one in each])
            assert np.abs(unreal[:, k] / expected - 1.0).max() < 1e-9
            assert np.abs(unity[:, k] / expected - 1.0).max() > 0.01
            expected = np.array([oracle.unity(C[k], metallic, 0.6, *one) for one in each])
            assert np.abs(unity[:, k] / expected - 1.0).max() < 1e-9
            assert np.abs(unreal[:, k] / expected - 1.0).max() > 0.01


def test_values_are_in_the_engines_names() -> None:
    """Unity's colours are sRGB: 0.4 is 0.66519 (IEC 61966-2-1); a name is a string of the file."""
    name, specular = "it's \"é*/ --> \\ \n}\u202e\ud800", 0.7
    more: dict[str, Any] = {"specular": specular}
    text = UNREAL.texts("m", [json.dumps(name)], written(Unreal(**PAINT, **more)))["m.json"]
    assert text.isascii()
    told = json.loads(text)
    assert told["about"][0] == json.dumps(name)
    assert told["material"] == {"Base Color": C.tolist(), "Metallic": 0.3, "Specular": 0.7, "Roughness": 0.4}
    told = json.loads(UNITY.texts("m", [], written(Unity(**PAINT)))["m.json"])["material"]
    assert told["_BaseColor"] == pytest.approx([0.90633, 0.66519, 0.34919], abs=1e-5)
    assert (told["_Metallic"], told["_Smoothness"]) == (0.3, 0.6)


@pytest.mark.study
def test_the_closest_is_said_with_what_is_left() -> None:
    made = fm.export(fm.model("lambert+ggx", kd=0.3, alpha=0.3), "unreal", name="m")
    told = json.loads(made.files["export.json"])
    assert told["closest"]["delta_e"] < 1.0
    assert "Computed by the formulas of Unreal Engine (no engine was run)" in made.files["m.json"]


def test_what_engines_cannot_hold_is_refused() -> None:
    for target, whose in (("unreal", "Unreal Engine"), ("unity", "Unity's URP")):
        with pytest.raises(ModelError, match=f"expected 1 or 3: the colours of {whose} are three"):
            fm.export(fm.model("lambert", channels=4), target)
        with pytest.raises(ModelError, match="ggx-aniso is brushed, expected an isotropic material"):
            fm.export(fm.model("ggx-aniso"), target)
