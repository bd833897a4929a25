"""Radiance's plastic and metal are our model of them, as rtrace has it, and the closest of them is found."""

import json
import stat
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import ModelError, OutputError
from fitmat.exports import radiance
from fitmat.exports.closest import Closest
from fitmat.exports.material import Chosen
from fitmat.exports.radiance import WardMaterial
from fitmat.exports.verification import compared, directions, exact
from fitmat.models.base import AbstractBRDF, evaluate
from fitmat.models.terms.distributions import Anisotropic, Isotropic

AGREE = 2e-5
"""Relative; colours of single precision in Radiance."""

C = np.array([0.8, 0.4, 0.1])


def material(rough: Any, **values: Any) -> WardMaterial:
    color: Any = C
    return WardMaterial(color=color, roughness=rough, **values)


def slopes(**values: Any) -> Any:
    return Isotropic(**values) if "alpha" in values else Anisotropic(**values)


RUN = {
    "plastic": material(slopes(alpha=0.15), specularity=0.1),
    "metal": material(slopes(alpha=0.05), specularity=0.7, metal=1.0),
    "brushed": material(slopes(alpha_x=0.1, alpha_y=0.3, rotation=30.0), specularity=0.3),
}


def rtrace() -> None:
    if radiance.program() is None:
        pytest.skip("no Radiance: rtrace, or pip install pyradiance")


def apart(model: AbstractBRDF, run: AbstractBRDF, every: int) -> float:
    wi, wo = (w[::every] for w in directions())
    values, executor = radiance.run(lambda name, frame: radiance.primitive(run, name, frame), *exact(wi, wo))
    assert executor.startswith("Radiance 6.") or executor.startswith("Radiance 5.")
    return compared(values, evaluate(model, *exact(wi, wo)), wi, wo, executor, least=radiance.LEAST).largest


def assert_agrees(name: str, every: int) -> None:
    assert apart(RUN[name], RUN[name], every) < AGREE
    rough = slopes(alpha=0.16) if name == "plastic" else slopes(alpha_x=0.11, alpha_y=0.3, rotation=30.0)
    assert apart(RUN[name], material(rough, specularity=0.3), every) > 1e-2


def test_rtrace_has_the_models_values() -> None:
    rtrace()
    assert_agrees("plastic", 24)


@pytest.mark.study
@pytest.mark.parametrize("name", ["metal", "brushed"])
def test_rtrace_has_the_models_values_everywhere(name: str) -> None:
    """Over 12,288 pairs of directions, brushed with a tangent; with a slope changed they are others."""
    rtrace()
    assert_agrees(name, 1)


@pytest.mark.study
def test_what_radiance_holds_is_found_and_passes_strict() -> None:
    """lambert+ward-gmd: s = ks, c = kd/(1 − ks)."""
    made = fm.export(fm.model("lambert+ward-gmd", kd=C / 2.0, ks=0.1, alpha=0.15), "radiance", name="m", strict=True)
    values = json.loads(made.files["export.json"])["closest"]["values"]
    assert values["specularity"][0] == pytest.approx(0.1, rel=1e-3)
    assert values["color"] == pytest.approx((C / 1.8).tolist(), rel=1e-3)
    if radiance.program() is not None:
        assert "Executed in Radiance" in made.files["m.rad"]


def written(model: AbstractBRDF) -> Closest:
    return Closest(model, "", 0.0, 0.0, 0.0, 0.0, 0.0, {}, True)


def test_primitives_have_the_arguments_of_the_manual() -> None:
    """Type, identifier, strings, integers and reals; the tangent is a vector of the surface."""
    words = radiance.primitive(RUN["plastic"]).split()
    assert words == ["void", "plastic", "material", "0", "0", "5", "0.8", "0.4", "0.1", "0.1", "0.15"]
    words = radiance.primitive(RUN["brushed"]).split()
    assert words[:4] == ["void", "plastic2", "material", "4"]
    assert np.allclose([float(x) for x in words[4:7]], [3.0**0.5 / 2.0, 0.5, 0.0])
    assert words[7:10] == [".", "0", "6"]
    assert radiance.primitive(RUN["metal"]).startswith("void metal material\n")


def test_a_name_is_a_comment_and_nothing_else() -> None:
    name = "it's \"é*/ --> \\ \n!rm\nvoid glow x\n\u202e"
    texts = [radiance.texts("m", [json.dumps(each)], written(RUN["metal"]))["m.rad"] for each in ("m", name)]
    assert texts[1].isascii()
    codes = [[line for line in text.splitlines() if not line.startswith("# ")] for text in texts]
    assert codes[0] == codes[1]


def test_programs_that_are_not_there_or_fail_are_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found, chosen = written(RUN["plastic"]), Chosen(RUN["plastic"])
    monkeypatch.setattr(radiance, "program", lambda: None)
    assert radiance.difference(chosen, found) is None
    for name in ("rtrace", "oconv"):
        (tmp_path / name).write_text("#!/bin/sh\necho no >&2\nexit 1\n")
        (tmp_path / name).chmod((tmp_path / name).stat().st_mode | stat.S_IEXEC)
    monkeypatch.setattr(radiance, "program", lambda: (tmp_path, {}))
    with pytest.raises(OutputError, match=r"oconv cannot run the material \(no\); leave it out with --no-verify"):
        radiance.difference(chosen, found)
    monkeypatch.setattr(radiance, "program", lambda: (tmp_path / "nowhere", {}))
    with pytest.raises(OutputError, match=r"oconv cannot run the material .*No such file"):
        radiance.difference(chosen, found)


def test_other_channels_are_refused() -> None:
    with pytest.raises(ModelError, match="there are 4 channels, expected 1 or 3: the colours of Radiance are three"):
        fm.export(fm.model("lambert", channels=4), "radiance")
