"""OpenUSD's preview surface is Storm's, and its file a stage that OpenUSD itself finds nothing wrong with."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.storm_preview_surface import evaluate_light
from test_materialx import pairs

import fitmat as fm
from fitmat.errors import ModelError
from fitmat.exports import usd
from fitmat.exports.closest import Closest
from fitmat.exports.material import Chosen
from fitmat.exports.usd import PreviewSurface
from fitmat.models.base import AbstractBRDF, evaluate

C, F0 = np.array([0.8, 0.4, 0.1]), np.array([0.3, 0.1, 0.05])
GIVEN: dict[str, Any] = {"diffuse_color": C, "specular_color": F0, "roughness": 0.4}
PAINT = PreviewSurface(**GIVEN)

HOSTILE = 'it\'s "é*/ --> ]]> \\ \n"""\n}\n#usda 1.0\n\u202e'


def written(model: AbstractBRDF) -> Closest:
    return Closest(model, "", 0.0, 0.0, 0.0, 0.0, 0.0, {}, True)


def test_the_model_is_storms_code() -> None:
    """Line by line, at 200 pairs and three channels; another roughness is seen."""
    wi, wo = pairs()
    other: dict[str, Any] = GIVEN | {"roughness": 0.41}
    for k in range(3):
        expected = np.array(
            [evaluate_light(C[k], F0[k], 0.4, a, b) for a, b in zip(wi.tolist(), wo.tolist(), strict=True)]
        )
        assert np.abs(evaluate(PAINT, wi, wo)[:, k] / expected - 1.0).max() < 1e-9
        assert np.abs(evaluate(PreviewSurface(**other), wi, wo)[:, k] / expected - 1.0).max() > 1e-3


def test_openusd_finds_nothing_wrong(tmp_path: Path) -> None:
    """All its validators, whatever the name holds; the numbers are the material's, and a ball is bound to it."""
    names = "pxr.Usd", "pxr.UsdShade", "pxr.UsdValidation"
    modules: list[Any] = [pytest.importorskip(name, reason="no OpenUSD: pip install usd-core") for name in names]
    Usd, UsdShade, UsdValidation = modules
    (text,) = usd.texts("m", [json.dumps(HOSTILE)], written(PAINT)).values()
    assert text.isascii()

    def errors(text: str) -> list[str]:
        (tmp_path / "m.usda").write_text(text)
        opened = Usd.Stage.Open(str(tmp_path / "m.usda"))
        every = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
        return [error.GetMessage() for error in UsdValidation.ValidationContext(every).Validate(opened)]

    assert errors(text) == []
    assert "an invalid or missing defaultPrim" in " ".join(errors(text.replace('defaultPrim = "World"', "")))
    (tmp_path / "m.usda").write_text(text)
    stage = Usd.Stage.Open(str(tmp_path / "m.usda"))
    shader = UsdShade.Shader(stage.GetPrimAtPath("/World/Material/Surface"))
    told = {name: shader.GetInput(name).Get() for name in ("diffuseColor", "specularColor", "roughness")}
    assert np.allclose([*told["diffuseColor"], *told["specularColor"], told["roughness"]], [*C, *F0, 0.4], rtol=1e-6)
    bound = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath("/World/Ball")).ComputeBoundMaterial()[0]
    assert bound.ComputeSurfaceSource()[0].GetIdAttr().Get() == "UsdPreviewSurface"


def test_a_name_is_a_comment_and_nothing_else() -> None:
    texts = [next(iter(usd.texts("m", [json.dumps(name)], written(PAINT)).values())) for name in ("m", HOSTILE)]
    codes = [[line for line in text.splitlines() if not line.startswith("# ")] for text in texts]
    assert codes[0] == codes[1]
    assert codes[0][0] == "#usda 1.0"


@pytest.mark.study
def test_the_closest_is_said_with_what_is_left() -> None:
    made = fm.export(fm.model("lambert+ggx", kd=0.3, alpha=0.3), "usd", name="m")
    told = json.loads(made.files["export.json"])
    assert told["closest"]["delta_e"] < 1.5
    assert told["executed"]["how"] == "Computed by"
    assert "Computed by the formulas of Storm" in made.files["m.usda"]
    with pytest.raises(ModelError, match=r"The target has another model.*Leave out strict"):
        fm.export(fm.model("lambert+ggx", kd=0.3, alpha=0.3), "usd", strict=True, verify=False)


def test_what_usd_cannot_hold_is_refused() -> None:
    with pytest.raises(ModelError, match="there are 4 channels, expected 1 or 3: the colours of OpenUSD are three"):
        usd.translated(Chosen(fm.model("lambert", channels=4)))
    with pytest.raises(ModelError, match="ggx-aniso is brushed, expected an isotropic material: UsdPreviewSurface has"):
        fm.export(fm.model("ggx-aniso"), "usd")
