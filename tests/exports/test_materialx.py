"""What MaterialX computes is a model of ours, its document is valid, and its own shader gives the same values."""

import importlib.util
import json
import xml.etree.ElementTree as ElementTree
from typing import Any

import numpy as np
import pytest
from oracles import materialx_genglsl as genglsl

import fitmat as fm
from fitmat.errors import ModelError, OutputError
from fitmat.exports.glsl import browser
from fitmat.exports.material import Chosen
from fitmat.exports.materialx import document, generated
from fitmat.exports.materialx.models import Compensated, OpenPBR, RoughDiffuse
from fitmat.maths.directions import from_angles
from fitmat.models.base import AbstractBRDF, evaluate
from fitmat.models.terms.distributions import Anisotropic, Isotropic
from fitmat.models.terms.fresnel import F82, Conductor

AGREE = 1e-3
"""Relative; single precision and numbers of six decimals in MaterialX's shader, up to 89.9 degrees."""

K = np.array([0.3, 0.2, 0.1])
GOLD: dict[str, Any] = {"eta": np.array([0.2, 0.4, 1.4]), "kappa": np.array([3.9, 2.4, 1.6])}
SURFACE: dict[str, Any] = {
    "base_color": K,
    "base_metalness": 0.3,
    "base_diffuse_roughness": 0.4,
    "specular_color": 1.0 - K,
    "specular_ior": 1.7,
    "specular_roughness": 0.5,
}


def pairs() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    wi, wo = (from_angles(np.arccos(rng.uniform(0.03, 1.0, 200)), rng.uniform(0.0, 2.0 * np.pi, 200)) for _ in range(2))
    return wi, wo


def test_open_pbr_is_materialxs_code() -> None:
    """Line by line, at 200 pairs and three channels; another metalness is seen."""
    wi, wo = pairs()
    found = evaluate(OpenPBR(**SURFACE), wi, wo)
    other: dict[str, Any] = SURFACE | {"base_metalness": 0.31}
    rest = SURFACE["base_metalness"], SURFACE["base_diffuse_roughness"]
    for k, (color, tint) in enumerate(zip(K, 1.0 - K, strict=True)):
        expected = np.array(
            [
                genglsl.open_pbr(color, *rest, tint, 1.7, 0.5, a, b)
                for a, b in zip(wi.tolist(), wo.tolist(), strict=True)
            ]
        )
        assert np.abs(found[:, k] / expected - 1.0).max() < 1e-8  # theirs clamps cosines at 1e-8
        assert np.abs(evaluate(OpenPBR(**other), wi, wo)[:, k] / expected - 1.0).max() > 1e-3


def chromium_and_materialx() -> str:
    program = browser.program()
    if program is None or importlib.util.find_spec("MaterialX") is None:
        pytest.skip("needs Chromium and the wheel MaterialX (pip install MaterialX)")
    return program


def node(**values: Any) -> Compensated:
    if "alpha" in values:
        rough: Any = {"alpha": values.pop("alpha")}
        return Compensated(roughness=Isotropic(**rough), **values)
    rough = {key: values.pop(key) for key in ("alpha_x", "alpha_y", "rotation")}
    return Compensated(roughness=Anisotropic(**rough), **values)


F82_TERM: dict[str, Any] = {"f0": K + 0.5, "f82": K + 0.6}
ROUGH: dict[str, Any] = {"kd": K, "r": 0.5}
RUN: dict[str, AbstractBRDF] = {
    "open-pbr": OpenPBR(**SURFACE),
    "lambert": fm.model("lambert", kd=K),
    "oren-nayar": fm.model("oren-nayar", kd=K, sigma_n=20.0),
    "eon": RoughDiffuse(**ROUGH),
    "f82": node(alpha=0.3, fresnel=F82(**F82_TERM)),
    "dielectric": node(alpha=0.1),
    "brushed": node(alpha_x=0.1, alpha_y=0.3, rotation=30.0, fresnel=Conductor(**GOLD)),
}
CHANGED = ("open-pbr", "eon", "brushed")
"""Of which a changed number is tried as well."""


@pytest.mark.study
@pytest.mark.parametrize("name", RUN)
def test_materialxs_own_shader_has_the_models_values(name: str) -> None:
    """Over 12,288 pairs of directions, in Chromium; with a number changed they are others."""
    chromium_and_materialx()
    model = RUN[name]
    if isinstance(model, OpenPBR):
        nodes = (("open_pbr_surface", {key: ("color3" if np.ndim(v) else "float", v) for key, v in SURFACE.items()}),)
    else:
        nodes = (document._node(model),)
    found = generated.difference(Chosen(model), document.Document(nodes, None))
    assert found is not None
    assert found.largest < AGREE, found.words
    if name not in CHANGED:
        return
    category, inputs = nodes[0]
    key = "specular_roughness" if name == "open-pbr" else "roughness"
    kind = inputs[key][0]
    wrong: Any = inputs | {key: (kind, [0.35, 0.35] if kind == "vector2" else 0.6)}
    other = generated.difference(Chosen(model), document.Document(((category, wrong),), None))
    assert other is not None
    assert other.largest > 0.05


@pytest.mark.study
def test_a_document_that_is_not_valid_is_refused() -> None:
    chromium_and_materialx()
    wrong: Any = (("oren_nayar_diffuse_bsdf", {"colour": ("color3", K)}),)
    with pytest.raises(OutputError, match=r"MaterialX 1\.\S+ refuses the document"):
        generated.difference(Chosen(RUN["lambert"]), document.Document(wrong, None))


def elements(text: str) -> list[str]:
    return [child.tag for child in ElementTree.fromstring(text)]


def test_a_diffuse_material_is_its_node(monkeypatch: pytest.MonkeyPatch) -> None:
    """Exactly, and whatever its name holds; nothing runs it without a browser."""
    monkeypatch.setattr(browser, "program", lambda: None)
    name = "it's \"é*/ --> ]]> <surface> & </materialx>\\ \n\u202e"
    made = fm.export(fm.model("lambert", kd=K), "materialx", name=name, strict=True)
    text, record = made.files.values()
    assert text.isascii()
    assert elements(text) == ["oren_nayar_diffuse_bsdf", "surface", "surfacematerial"]
    assert ElementTree.fromstring(text)[0][0].get("value") == "0.3, 0.2, 0.1"
    assert json.loads(record)["executed"] is None
    assert "Not executed here." in text


@pytest.mark.study
def test_lobes_become_nodes_or_the_closest_open_pbr() -> None:
    plastic = fm.export(fm.model("lambert+ggx", kd=K, ks=np.ones(3), alpha=0.2), "materialx", name="m", verify=False)
    parts = ["oren_nayar_diffuse_bsdf", "dielectric_bsdf", "add", "surface", "surfacematerial"]
    assert elements(plastic.files["m.mtlx"]) == parts
    told = json.loads(plastic.files["export.json"])["closest"]
    assert told["delta_e"] < 0.2
    assert told["values"]["ks"] == [1.0, 1.0, 1.0]
    gold = fm.export(fm.model("ggx-conductor", alpha=0.3, **GOLD), "materialx", name="m", verify=False)
    assert elements(gold.files["m.mtlx"])[0] == "conductor_bsdf"
    surface = fm.export(fm.model("lambert+ward"), "materialx", name="m", verify=False)
    assert elements(surface.files["m.mtlx"]) == ["open_pbr_surface", "surfacematerial"]
    assert "The target has another model" in surface.notes[0]
    with pytest.raises(ModelError, match=r"The target has another model.*Leave out strict"):
        fm.export(fm.model("ggx", alpha=0.5), "openpbr", strict=True)


def test_what_materialx_cannot_hold_is_refused() -> None:
    with pytest.raises(ModelError, match="there are 4 channels, expected 1 or 3: the colours of MaterialX are three"):
        fm.export(fm.model("lambert", channels=4), "materialx")
    with pytest.raises(ModelError, match="ggx-aniso is brushed, expected an isotropic material: OpenPBR"):
        fm.export(fm.model("ggx-aniso"), "openpbr")
