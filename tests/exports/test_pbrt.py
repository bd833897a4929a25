"""pbrt gets the closest of its materials, whose formulas are its own, in the words of its scene format."""

import json
import re
from typing import Any

import numpy as np
import pytest
from oracles.pbrt_v4 import conductor, mixed
from test_materialx import pairs

import fitmat as fm
from fitmat.errors import ModelError
from fitmat.exports import pbrt
from fitmat.exports.closest import Closest
from fitmat.exports.material import Chosen
from fitmat.exports.pbrt import Mixture
from fitmat.models.base import AbstractBRDF, evaluate
from fitmat.models.terms.distributions import Anisotropic, Isotropic
from fitmat.models.terms.fresnel import Conductor

C = np.array([0.8, 0.4, 0.1])


def mixture(rough: Any, amount: Any, kappa: Any = 2.0, reflectance: Any = C) -> Mixture:
    index: dict[str, Any] = {"eta": C + 0.5, "kappa": np.full(3, kappa)}
    return Mixture(reflectance=reflectance, amount=amount, roughness=rough, fresnel=Conductor(**index))


def brushed(**values: Any) -> Anisotropic:
    return Anisotropic(**values)


def round_(alpha: Any) -> Isotropic:
    return Isotropic(alpha=alpha)


BRUSHED = brushed(alpha_x=0.1, alpha_y=0.3, rotation=0.0)


def written(model: AbstractBRDF) -> Closest:
    return Closest(model, "", 0.0, 0.0, 0.0, 0.0, 0.0, {}, True)


def test_the_model_is_pbrts_code() -> None:
    """Line by line, at 200 pairs and three channels, round and brushed; another amount is seen."""
    wi, wo = pairs()
    for rough, ax, ay in ((round_(0.2), 0.2, 0.2), (BRUSHED, 0.1, 0.3)):
        found, other = (evaluate(mixture(rough, amount), wi, wo) for amount in (0.3, 0.31))
        for k in range(3):
            mirror = [
                conductor(complex(C[k] + 0.5, 2.0), ax, ay, b, a) for a, b in zip(wi.tolist(), wo.tolist(), strict=True)
            ]
            expected = np.array([mixed(C[k], 0.3, one) for one in mirror])
            assert np.abs(found[:, k] / expected - 1.0).max() < 1e-9
            assert np.abs(other[:, k] / expected - 1.0).max() > 5e-3


def parameters(text: str) -> dict[str, dict[str, str]]:
    """Named materials of a scene: `"type name" value` pairs, as pbrt's parser takes them."""
    found, said = {}, "\n".join(line for line in text.splitlines() if not line.startswith("#"))
    for name, rest in re.findall(r'MakeNamedMaterial "([\w-]+)"((?:\s+"\w+ \w+" (?:\[[^\]]*\]|\S+))+)', said):
        found[name] = dict(re.findall(r'"(\w+ \w+)" (\[[^\]]*\]|\S+)', rest))
    assert said.count("MakeNamedMaterial") == len(found)
    return found


def test_blocks_are_in_pbrts_words() -> None:
    """Types and names of parameters as in the file format; grey values are spectra, and nothing is remapped."""
    told = parameters(pbrt.block(written(mixture(BRUSHED, 0.25))))
    assert list(told) == ["material-below", "material-mirror", "material"]
    assert told["material-below"] == {"string type": '"diffuse"', "rgb reflectance": "[ 0.8 0.4 0.1 ]"}
    mirror = told["material-mirror"]
    assert mirror["rgb eta"] == "[ 1.3 0.9 0.6 ]"
    assert mirror["spectrum k"] == "[ 360 2.0 830 2.0 ]"
    assert (mirror["float uroughness"], mirror["float vroughness"]) == ("0.1", "0.3")
    assert mirror["bool remaproughness"] == "false"
    assert told["material"]["string materials"] == '[ "material-below" "material-mirror" ]'
    assert told["material"]["float amount"] == "0.25"
    assert parameters(pbrt.block(written(mixture(BRUSHED, 1.0))))["material"]["string type"] == '"conductor"'
    assert parameters(pbrt.block(written(mixture(BRUSHED, 0.0))))["material"]["string type"] == '"diffuse"'


def test_a_name_is_a_comment_and_nothing_else() -> None:
    name = 'it\'s "é*/ --> \\ \nWorldEnd\nInclude "/etc/passwd"\u202e'
    found = written(mixture(BRUSHED, 0.25))
    texts = [pbrt.texts("m", [json.dumps(each)], found)["m.pbrt"] for each in ("m", name)]
    assert texts[1].isascii()
    codes = [[line for line in text.splitlines() if not line.startswith("# ")] for text in texts]
    assert codes[0] == codes[1]


@pytest.mark.study
def test_what_pbrt_holds_is_found_and_passes_strict() -> None:
    """A metal, and a sum within 1."""
    gold = fm.model("ggx-conductor", alpha=0.2, eta=0.2, kappa=3.9)
    metal = fm.export(gold, "pbrt", name="m", strict=True)
    assert list(parameters(metal.files["m.pbrt"])) == ["material"]
    slope = parameters(metal.files["m.pbrt"])["material"]["float uroughness"]
    assert float(slope) == pytest.approx(0.2, rel=1e-6)
    assert "Not executed here." in metal.files["m.pbrt"]
    plastic = fm.export(fm.model("lambert+ggx", kd=0.3, ks=0.5, alpha=0.2), "pbrt", name="m", strict=True)
    told = json.loads(plastic.files["export.json"])["closest"]
    assert told["relative"] < 1e-3


def test_what_pbrt_cannot_hold_is_refused() -> None:
    with pytest.raises(ModelError, match="there are 4 channels, expected 1 or 3: the colours of pbrt are three"):
        pbrt.translated(Chosen(fm.model("lambert", channels=4)))
    turned = written(mixture(brushed(alpha_x=0.1, alpha_y=0.3, rotation=30.0), 1.0))
    assert "lies at 30 degrees: turn the shape's" in pbrt.notes(Chosen(turned.model), turned)[0]


@pytest.mark.study
def test_a_mirror_is_refused() -> None:
    with pytest.raises(ModelError, match=r"narrower than slopes of 0\.001, which pbrt takes for a mirror"):
        pbrt.translated(Chosen(fm.model("ggx-conductor", alpha=0.0005)))
