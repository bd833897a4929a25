"""glTF's material is the specification's, its file is valid, and the one exported is the closest of them."""

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles.gltf_appendix_b import material as appendix_b

import fitmat as fm
from fitmat.errors import ModelError
from fitmat.exports import gltf
from fitmat.exports.closest import SAME, Closest, judged
from fitmat.exports.material import Chosen
from fitmat.exports.metallic_roughness import (
    AbstractSquared,
    Clearcoated,
    MetallicRoughness,
    Squared,
    Stretched,
    template,
)
from fitmat.match.carried import carried
from fitmat.match.imitation import imitate, quadrature
from fitmat.maths.directions import from_angles
from fitmat.models.base import AbstractBRDF, evaluate, evaluate_pairs
from fitmat.models.parameters import vector, with_vector
from fitmat.models.terms.distributions import Isotropic

COLOR, F0 = np.array([0.8, 0.4, 0.1]), np.array([0.3, 0.1, 0.05])


def squared(roughness: Any) -> Squared:
    return Squared(roughness=roughness)


def gltf_material(shape: AbstractSquared, base_color: Any, f0: Any, **values: Any) -> MetallicRoughness:
    return MetallicRoughness(base_color=base_color, f0=f0, shape=shape, **values)


def smooth(alpha: Any) -> Isotropic:
    return Isotropic(alpha=alpha)


PAINT = gltf_material(squared(0.4), COLOR, F0, metallic=0.3, specular=0.7)
SATIN = fm.model("lambert+ggx", kd=0.3, alpha=0.15)


def pairs(count: int = 200) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    wi, wo = (
        from_angles(np.arccos(rng.uniform(0.02, 1.0, count)), rng.uniform(0.0, 2.0 * np.pi, count)) for _ in range(2)
    )
    return wi, wo


def written(model: AbstractBRDF) -> Closest:
    """A material of glTF as if it had been found."""
    return Closest(model, "", 0.0, 0.0, 0.0, 0.0, 0.0, {}, True)


@pytest.mark.parametrize("coat", [None, smooth(0.04)])
def test_the_model_is_appendix_b(coat: Isotropic | None) -> None:
    """The model, and the evaluator of the file's numbers, at 200 pairs; a slip of a power is seen."""
    strength: dict[str, Any] = {"clearcoat": 0.6}
    model = PAINT if coat is None else Clearcoated(PAINT, **strength, coat=coat)
    wi, wo = pairs()
    told = gltf.material("m", written(model))
    basic, more = told["pbrMetallicRoughness"], told["extensions"]
    given: Any = [basic["baseColorFactor"][:3], basic["metallicFactor"], basic["roughnessFactor"]]
    given += [more["KHR_materials_ior"]["ior"], *more["KHR_materials_specular"].values()]
    coated = list(more.get("KHR_materials_clearcoat", {}).values())
    expected = np.array(
        [appendix_b(*given, light=a, view=b, coat=coated) for a, b in zip(wi.tolist(), wo.tolist(), strict=True)]
    )
    for found in (evaluate(model, wi, wo), gltf.evaluated(told, wi, wo)):
        assert np.abs(found / expected - 1.0).max() < 1e-9
    wrong = told | {"pbrMetallicRoughness": basic | {"roughnessFactor": 0.4**2}}
    assert np.abs(gltf.evaluated(wrong, wi, wo) / expected - 1.0).max() > 0.1


def test_slopes_are_finite_where_channels_are_alike() -> None:
    """The largest of three equal reflectances has one; the search for the closest would stand still without it."""
    into = template(SATIN, 3)[0]
    at = quadrature(SATIN, "cube-root")
    slopes = jax.jit(jax.jacfwd(lambda v: evaluate_pairs(with_vector(into, v), at.wi, at.wo)))(
        jnp.asarray(vector(into))
    )
    assert bool(jnp.isfinite(slopes).all())


def test_brushed_materials_are_stretched_along_the_files_tangent() -> None:
    """At strength 0 as isotropic; else as the extension's formula, which is GGX with slopes α_t and α_b."""
    wi, wo = pairs()
    for strength, rotation in ((0.0, 30.0), (0.6, 30.0)):
        values: dict[str, Any] = {"roughness": 0.4, "strength": strength, "rotation": rotation}
        metal = gltf_material(Stretched(**values), COLOR, F0, metallic=1.0)
        slopes: dict[str, Any] = {"alpha_x": 0.16 + 0.84 * strength**2, "alpha_y": 0.16, "rotation": rotation}
        same = fm.model("ggx-aniso-schlick", f0=COLOR, **slopes)
        expected = evaluate(same, wi, wo)
        for found in (evaluate(metal, wi, wo), gltf.evaluated(gltf.material("m", written(metal)), wi, wo)):
            assert np.abs(found / expected - 1.0).max() < 1e-9


@pytest.mark.study
def test_the_closest_is_nearer_than_a_renaming() -> None:
    """Base colour = kd, roughness = √α, F0 from η: what looks alike is further."""
    named = gltf_material(squared(0.15**0.5), np.array([0.3]), np.array([0.04]))
    chosen = Chosen(SATIN)
    found = gltf.translated(chosen)
    renamed = judged(chosen, named)
    assert found.delta_e < 0.6 * renamed.delta_e
    assert found.relative < renamed.relative
    assert not found.same
    assert "relative BRDF distance 3." in found.words[1]


@pytest.mark.study
def test_what_gltf_holds_is_found_and_passes_strict() -> None:
    metal = fm.model("ggx-schlick", f0=COLOR, alpha=0.2)
    made = fm.export(metal, "gltf", name="m", strict=True)
    record = json.loads(made.files["export.json"])
    assert record["closest"]["relative"] < SAME
    assert made.notes == ()
    assert record["closest"]["values"]["roughness"][0] == pytest.approx(0.2**0.5, rel=1e-3)
    with pytest.raises(ModelError, match=r"The target has another model.*Leave out strict"):
        fm.export(SATIN, "gltf", strict=True)


@pytest.mark.study
def test_a_name_is_text_and_nothing_else() -> None:
    name = "it's \"é*/ --> <script>\\ \n\u202e\ud800"
    made = fm.export(SATIN, "gltf", name=name, verify=False)
    (text, _), files = made.files.values(), list(made.files)
    assert text.isascii()
    assert json.loads(text)["materials"][0]["name"] == files[0].removesuffix(".gltf")
    assert json.loads(text)["asset"]["extras"]["about"][0].startswith(json.dumps(name))


def test_other_channels_are_refused() -> None:
    with pytest.raises(ModelError, match="there are 4 channels, expected 1 or 3: the colours of glTF are three"):
        fm.export(fm.model("lambert", channels=4), "gltf")


VALIDATE = """
const fs = require('fs');
require('gltf-validator').validateBytes(new Uint8Array(fs.readFileSync(process.argv[1])))
    .then((found) => console.log(JSON.stringify(found.issues)));
"""


def validated(file: Path) -> dict[str, Any]:
    """What Khronos's validator says of a file."""
    node = shutil.which("node")
    if node is None or subprocess.run([node, "-e", "require('gltf-validator')"], capture_output=True).returncode:
        pytest.skip("no gltf-validator: npm install gltf-validator, and name its node_modules in NODE_PATH")
    ended = subprocess.run([node, "-e", VALIDATE, str(file)], capture_output=True, check=True, env=os.environ)
    return json.loads(ended.stdout)


BRUSHED: dict[str, Any] = {"roughness": 0.4, "strength": 0.5, "rotation": 30.0}
KINDS: dict[str, AbstractBRDF] = {
    "plain": PAINT,
    "brushed": gltf_material(Stretched(**BRUSHED), COLOR, F0),
    "polished coat": Clearcoated(PAINT),
    "rough coat": Clearcoated(PAINT, coat=smooth(0.04)),
}


@pytest.mark.study
@pytest.mark.parametrize("kind", KINDS)
def test_khronos_finds_no_fault(tmp_path: Path, kind: str) -> None:
    file = tmp_path / "m.gltf"
    file.write_text(gltf.texts("m", ['"quoted"'], written(KINDS[kind]))["m.gltf"])
    found = validated(file)
    assert (found["numErrors"], found["numWarnings"]) == (0, 0), found
    told = json.loads(file.read_text())
    told["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] = 1.5
    file.write_text(json.dumps(told))
    assert validated(file)["numErrors"] == 1


@pytest.mark.study
def test_intervals_are_carried_as_refits_move() -> None:
    """Standard deviations of the imitating parameters, linearised, beside those of imitations of 40 draws."""
    rng = np.random.default_rng(2)
    best, sd = np.asarray(vector(SATIN)), np.array([0.004, 0.02, 0.003, 0.02])
    draws = best + sd * rng.standard_normal((40, len(best)))
    into, held = template(SATIN, 1)[0], {"metallic": 0.0, "specular": 1.0}
    found = imitate(SATIN, into, fixed=held)
    moved = carried(found, SATIN, draws)
    again = [vector(imitate(with_vector(SATIN, draw), into, fixed=held).model) for draw in draws]
    linear, refitted = moved.std(axis=0), np.std(again, axis=0)
    free = refitted > 1e-6
    assert free.sum() == 3
    assert np.abs(linear[free] / refitted[free] - 1.0).max() < 0.15
    assert np.abs(moved[:, free] - np.array(again)[:, free]).max() < 0.5 * refitted[free].max()
