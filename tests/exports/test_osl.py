"""OSL gets the lobes as closures, which Cycles has exactly, or the closest of them."""

import json
import re
from typing import Any

import pytest
from test_blender import C, program

import fitmat as fm
from fitmat.errors import ModelError
from fitmat.exports import osl
from fitmat.exports.blender import cycles
from fitmat.exports.material import Chosen
from fitmat.exports.verification import TOLERANCE
from fitmat.models.base import AbstractBRDF

BRUSHED: dict[str, Any] = {"alpha_x": 0.1, "alpha_y": 0.3, "rotation": 30.0}
HELD: dict[str, AbstractBRDF] = {
    "lambert": fm.model("lambert", kd=C),
    "plastic": fm.model("lambert+ggx", kd=C, ks=0.7, alpha=0.15),
    "gold": fm.model("ggx-conductor", alpha=0.1, eta=C, kappa=C + 2.0),
    "brushed": fm.model("ggx-aniso-conductor", **BRUSHED, eta=C, kappa=C + 2.0),
    "schlick": fm.model("lambert+ggx-schlick", kd=C, f0=C / 2.0, alpha=0.3),
}

PARAMETERS = {"diffuse": 1, "dielectric_bsdf": 8, "conductor_bsdf": 7, "generalized_schlick_bsdf": 10}
"""How many arguments a closure has in OSL 1.14's stdosl.h."""


def one(model: AbstractBRDF) -> str:
    return osl.shader(osl.translated(Chosen(model)))


@pytest.mark.study
@pytest.mark.parametrize("name", HELD)
def test_cycles_has_the_fits_values(name: str) -> None:
    """Over 12,288 pairs of directions, compiled and run in Blender; a hundredth brighter they are others."""
    program()
    text = one(HELD[name])
    for shader, apart in ((text, False), (text.replace("    result = ", "    result = 1.01 * "), True)):
        found = cycles.difference(HELD[name], osl.CODE, {"material.osl": shader})
        assert found is not None
        assert (found.largest > TOLERANCE) == apart, found.words


@pytest.mark.parametrize("name", HELD)
def test_lobes_are_closures_as_osl_declares_them(name: str) -> None:
    """As many arguments as the declaration has, numbers that are the fit's, and no note."""
    closures = osl.translated(Chosen(HELD[name]))
    assert osl.notes(Chosen(HELD[name]), closures) == []
    for term in closures.terms:
        weight, _, call = term.partition(" * ")
        closure, _, inner = call.partition("(")
        assert re.fullmatch(r"color\([\d.e-]+, [\d.e-]+, [\d.e-]+\)", weight)
        flat = re.sub(r"\([^()]*\)", "", inner.removesuffix(")"))
        assert len(flat.split(",")) == PARAMETERS[closure]
    text = osl.shader(closures)
    assert ("cos(0.523598" in text) == (name == "brushed")
    assert text.count("{") == text.count("}") == 1


def test_a_name_is_a_comment_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cycles, "program", lambda: None)
    name = "it's \"é*/ --> ]]>\\ \n}\nshader x() {} \u202e"
    plain, odd = (fm.export(HELD["plastic"], "osl", name=each, strict=True) for each in ("m", name))
    codes = []
    for made in (plain, odd):
        text = next(iter(made.files.values()))
        assert text.isascii()
        codes.append([line for line in text.splitlines() if not line.startswith("//")])
    assert codes[0] == codes[1]
    assert json.loads(odd.files["export.json"])["name"] == name
    assert "Not executed here." in next(iter(odd.files.values()))


def test_beckmann_is_said() -> None:
    model = fm.model("beckmann", alpha=0.2)
    assert '"beckmann")' in one(model)
    with pytest.raises(ModelError, match="Cycles' masking of Beckmann's normals is Walter's rational function"):
        fm.export(model, "osl", strict=True)


@pytest.mark.study
def test_what_is_no_closure_becomes_the_closest() -> None:
    model = fm.model("ggx-aniso-f82", **BRUSHED)
    closures = osl.translated(Chosen(model))
    calls = [term.partition(" * ")[2].partition("(")[0] for term in closures.terms]
    assert calls == ["diffuse", "generalized_schlick_bsdf"]
    assert closures.found is not None
    assert closures.found.delta_e < 1.0
    assert "The target has another model" in osl.notes(Chosen(model), closures)[0]
