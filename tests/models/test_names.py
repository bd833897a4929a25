"""Parameters by the names of renderers and papers: read in the published convention, which is said, or refused."""

import warnings
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import fitmat as fm
from fitmat.cli.application import app
from fitmat.errors import ModelError, ReadAs
from fitmat.models.parameters import entries, vector


def values(model: Any) -> dict[str, np.ndarray]:
    found = np.asarray(vector(model))
    return {e.name: found[e.place] for e in entries(model)}


# What the definitions say, written out: Burley 2012 for roughness and specular, the glTF 2.0 specification (appendix B)
# for metallic, KHR_materials_pbrSpecularGlossiness for glossiness, Born & Wolf for the reflectance at normal incidence.
READ: list[tuple[str, dict[str, Any], dict[str, Any], str]] = [
    ("lambert+ggx", {"roughness": 0.4}, {"alpha": 0.16}, "roughness=0.4 read as √α: alpha = 0.16."),
    ("ggx", {"glossiness": 0.6}, {"alpha": 0.16}, "glossiness=0.6 read as 1 − √α: alpha = 0.16."),
    ("eon", {"roughness": 0.4}, {"r": 0.4}, "roughness=0.4 read as the roughness of EON: r = 0.4."),
    ("ggx", {"F0": 0.04}, {"eta": 1.5}, r"F0=0.04 read as \(\(η−1\)/\(η\+1\)\)²: eta = 1.5."),
    ("ggx", {"f0": 0.25}, {"eta": 3.0}, "f0=0.25 read as .*: eta = 3."),
    ("ggx-schlick", {"F0": [0.9, 0.5, 0.1]}, {"f0": [0.9, 0.5, 0.1]}, "F0=0.9,0.5,0.1 read as the reflectance at"),
    ("ggx", {"ior": 1.33}, {"eta": 1.33}, "ior=1.33 read as η: eta = 1.33."),
    ("ggx-schlick", {"ior": 1.5}, {"f0": 0.04}, "ior=1.5 read as η with F0 = .*: f0 = 0.04."),
    ("beckmann", {"m": 0.2}, {"alpha": 0.2}, "m=0.2 read as the rms slope of Beckmann's normals, .*: alpha = 0.2."),
    ("cook-torrance", {"m": 0.2}, {"alpha": 0.2}, "m=0.2 read as the rms slope"),
    ("ggx", {"specular": 0.5}, {"eta": 1.5}, "specular=0.5 read as F0/0.08, F0 = .*: eta = 1.5."),
    ("ggx-schlick", {"specular": 1.0}, {"f0": 0.08}, "specular=1 read as F0/0.08: f0 = 0.08."),
    ("lambert+phong", {"specular": 0.3}, {"ks": 0.3}, "specular=0.3 read as the weight of the highlight: ks = 0.3."),
    ("phong", {"shininess": 32.0}, {"exponent": 32.0}, "shininess=32 read as the exponent: exponent = 32."),
    (
        "lambert+ggx-schlick",
        {"metallic": 0.25, "base_color": 0.8},
        {"kd": 0.6, "f0": 0.23},
        "metallic=0.25, base_color=0.8 read as glTF's: kd = 0.6, f0 = 0.23.",
    ),
    ("lambert+ggx", {"ggx.roughness": 0.3}, {"alpha": 0.09}, r"ggx\.roughness=0\.3 read as √α: ggx\.alpha = 0\.09"),
]


@pytest.mark.parametrize(("name", "given", "expected", "sentence"), READ)
def test_a_name_is_read_in_its_published_convention(
    name: str, given: dict[str, Any], expected: dict[str, Any], sentence: str
) -> None:
    with pytest.warns(ReadAs, match=sentence):
        found = values(fm.model(name, **given))
    for key, value in expected.items():
        assert found[key] == pytest.approx(value, rel=1e-12), key


def test_own_names_are_never_read_as_others() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = values(fm.model("disney-2012", roughness=0.4, specular=0.3, metallic=0.2))
    assert (found["roughness"][0], found["specular"][0], found["metallic"][0]) == (0.4, 0.3, 0.2)


@pytest.mark.parametrize(
    ("name", "given", "sentence"),
    [
        ("ggx", {"roughness": 0.4, "alpha": 0.1}, "alpha and roughness both say alpha, expected one of them"),
        ("ggx", {"roughness": 0.4, "glossiness": 0.6}, "roughness and glossiness both say alpha"),
        ("ggx", {"ior": 1.5, "F0": 0.04}, "ior and F0 both say eta, expected one of them. Leave one out"),
        ("eon+ggx", {"roughness": 0.4}, r"roughness could be alpha or r of eon\+ggx, expected one of these names"),
        ("ggx-conductor", {"F0": 0.9}, "F0 alone does not tell eta and kappa of ggx-conductor, expected both"),
        ("ggx", {"m": 0.2}, "m is the rms slope of Beckmann's normals, which ggx does not have; expected alpha"),
        ("ggx", {"metallic": 1.0}, "metallic without base_color, expected both names with a model of kd and f0"),
        ("lambert+ggx", {"metallic": 1.0, "base_color": 0.5}, r"metallic with lambert\+ggx, which has no kd and f0"),
        ("ggx", {"base_color": 0.5}, "has no parameter 'base_color'"),
        ("lambert+phong", {"roughness": 0.4}, "has no parameter 'roughness'; it has exponent, kd, ks"),
        ("ggx", {"roughness": 1.4}, r"roughness .*1\.4.* expected"),
        ("ggx", {"F0": 1.0}, "F0 .*expected"),
        ("ggx", {"ior": 0.9}, "ior .*expected"),
    ],
)
def test_what_could_mean_two_things_is_refused(name: str, given: dict[str, Any], sentence: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReadAs)
        with pytest.raises(fm.FitmatError, match=sentence):
            fm.model(name, **given)


@pytest.mark.study
def test_a_fit_holds_what_is_read_so() -> None:
    angles = np.linspace(-1.2, 1.2, 25)
    measured = fm.simulate(
        fm.model("lambert+ggx", alpha=0.16), 0.5, angles, relative_noise=0.01, absolute_noise=1e-4, seed=1
    )
    with pytest.warns(ReadAs, match=r"roughness=0\.4 read as √α: alpha = 0\.16"):
        found = fm.fit(measured, "lambert+ggx", fixed={"roughness": 0.4, "ks": 1.0})
    assert found.values[[e.name for e in found.entries].index("alpha")] == pytest.approx(0.16)
    with pytest.raises(ModelError, match=r"cannot fix 'shininess': lambert\+ggx has kd"):
        fm.fit(measured, "lambert+ggx", fixed={"shininess": 3.0})


def test_the_command_takes_them_and_says_how(tmp_path: Any) -> None:
    out = tmp_path / "s.csv"
    with pytest.warns(ReadAs, match="roughness=0.4 read as √α: alpha = 0.16"):
        ended = CliRunner().invoke(
            app, ["simulate", "lambert+ggx", "--set", "roughness=0.4", "--out", str(out)], prog_name="fitmat"
        )
    assert ended.exit_code == 0
    assert out.exists()
