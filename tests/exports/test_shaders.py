"""The pair of shaders in its other version and with heights: glslang takes it, and the bent normal is the surface's."""

import shutil
import stat
from pathlib import Path

import numpy as np
import pytest
from test_glsl import COVERED, FEW, GILT, HOSTILE, NAMES, drawn, met, radiance, sharp

import fitmat as fm
from fitmat.errors import ModelError, OutputError
from fitmat.exports.glsl import browser, shaders
from fitmat.exports.glsl.shaders import DESKTOP, ES, Shader
from fitmat.exports.glsl.translation import translated
from fitmat.models.base import AbstractBRDF

VERSIONS = {"glsl": "300 es", "glsl-330": "330"}


@pytest.fixture
def compiler() -> str:
    found = shutil.which(shaders.COMPILER)
    if found is None:
        pytest.skip("no glslangValidator (Debian's package glslang-tools): shaders of GLSL 3.30 are compiled with it")
    return found


def assert_compiled(name: str, model: AbstractBRDF) -> None:
    """In both versions, with and without heights; and what is wrong is refused."""
    brdf = translated(model)
    for version in (ES, DESKTOP):
        for bump in (False, True):
            text = shaders.texts("m", [HOSTILE.splitlines()[0]], Shader(brdf, version, bump))
            assert str(shaders.compiled(text)).startswith("glslang 1"), name
    wrong = shaders.texts("m", (), Shader(brdf.replace("vec3 brdf(vec3 wi", "vec3 brdf(vec3 w"), DESKTOP))
    with pytest.raises(OutputError, match=r"refuses the shaders \(ERROR: .*'wi' : undeclared identifier"):
        shaders.compiled(wrong)


def test_glslang_takes_the_pair(compiler: str) -> None:
    assert_compiled("lambert+ggx", fm.model("lambert+ggx"))


@pytest.mark.study
@pytest.mark.parametrize("name", [name for name in NAMES if name not in COVERED])
def test_glslang_takes_every_lobe(compiler: str, name: str) -> None:
    assert_compiled(name, sharp(name))


def test_versions_share_all_but_their_heads(monkeypatch: pytest.MonkeyPatch) -> None:
    """No precision is said where there is one, and the functions are the same text."""
    monkeypatch.setattr(browser, "program", lambda: None)
    model = fm.model(FEW[1])
    found = {target: fm.export(model, target, name="m", verify=False).files for target in VERSIONS}
    for target, version in VERSIONS.items():
        assert found[target]["m.frag"].startswith(f"#version {version}\n// ")
        assert found[target]["m.vert"].startswith(f"#version {version}\n// ")
        assert ("precision highp" in found[target]["m.frag"]) == (target == "glsl")
    bodies = [files["m.frag"].partition("uniform mat4")[2] for files in found.values()]
    assert bodies[0] == bodies[1] != ""


def test_a_compiler_that_refuses_is_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And where there is none, nothing is said of it."""
    program = tmp_path / shaders.COMPILER
    program.write_text("#!/bin/sh\necho ERROR: no\nexit 2\n")
    program.chmod(program.stat().st_mode | stat.S_IEXEC)
    monkeypatch.setattr(browser, "program", lambda: None)
    monkeypatch.setattr(shutil, "which", lambda name: str(program))
    with pytest.raises(OutputError, match=r"glslangValidator refuses the shaders \(ERROR: no\); leave that out with"):
        fm.export(fm.model("lambert"), "glsl-330")
    monkeypatch.setattr(shutil, "which", lambda name: None)
    assert "Not executed here." in fm.export(fm.model("lambert"), "glsl-330").files["lambert.frag"]


def test_heights_are_for_shaders() -> None:
    with pytest.raises(ModelError, match="bump with target 'merl', expected it with glsl, glsl-330 only"):
        fm.export(fm.model("lambert"), "merl", bump=True)


def height(x: np.ndarray, slope: float) -> np.ndarray:
    """Eight plane waves, each as steep as the slope, in directions of a spiral over the sphere (golden angle)."""
    k = np.arange(8)
    up, around = (k + 0.5) / 4.0 - 1.0, 2.39996 * k
    along = np.stack([np.sqrt(1.0 - up**2) * np.cos(around), np.sqrt(1.0 - up**2) * np.sin(around), up], axis=1)
    waves = 18.0 + 5.0 * k
    return np.sum(slope / waves * np.sin(waves * (x @ along.T) + 1.7 * k), axis=1)


@pytest.mark.study
def test_heights_bend_the_normal_as_the_surface_does() -> None:
    """Smooth, the pixels are those of the plain shader; with waves those of the displaced sphere itself.

    Its normal is that of the surface (1 + h(w)) w, whose edges are differences of positions: no gradient of a height
    enters. The heights are up to 2.4e-3 of the radius: by so much the places differ.
    """
    slope, step = 0.01, 1e-5
    files = fm.export(GILT, "glsl", name="m", bump=True, verify=False).files
    plain = drawn(fm.export(GILT, "glsl", name="m", verify=False).files)
    assert np.abs(drawn(files, bump=0.0) - plain).max() < 2e-6 * plain.max()  # a unit vector is made one once more
    inside, position, n = met()
    t = np.cross([0.0, 1.0, 0.0], n)
    b = np.cross(n, t)

    def displaced(w: np.ndarray) -> np.ndarray:
        w = w / np.linalg.norm(w, axis=1)[:, None]
        return (1.0 + height(w, slope))[:, None] * w

    edges = [displaced(n + step * side) - displaced(n - step * side) for side in (t, b)]
    bent = np.cross(edges[0], edges[1])
    bent /= np.linalg.norm(bent, axis=1)[:, None]
    expected, smooth = radiance(GILT, position, bent), radiance(GILT, position, n)
    found = drawn(files, bump=slope).reshape(-1, 4)[inside, :3]
    assert np.abs(height(n, slope)).max() < 3e-3
    assert np.abs(found - expected).max() < 3e-3 * expected.max()
    assert np.abs(found - smooth).max() > 0.05 * expected.max()
