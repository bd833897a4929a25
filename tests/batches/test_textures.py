"""Textures: an atlas is fitted as its arrays are, tiles are kept and used again, and wrong files are one sentence."""

import importlib
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from PIL import Image
from typer.testing import CliRunner

import fitmat as fm
from fitmat.batches import textures
from fitmat.batches.atlas import read_atlas
from fitmat.batches.maps import MAPS
from fitmat.batches.textures import fit_texture
from fitmat.cli.application import app
from fitmat.errors import FitmatError, OutputError

TOLD: dict[str, Any] = {"loss": "gaussian", "fixed": {"ks": 1.0, "eta": 1.5}}

ROWS, COLUMNS, SAMPLES = 3, 4, 24


def arrays() -> dict[str, np.ndarray]:
    """A texture of which the roughness grows to the right, in angles; one point was not measured."""
    rng = np.random.default_rng(1)
    theta_o = np.linspace(-60.0, 75.0, SAMPLES)
    wi, wo = fm.directions(np.full(SAMPLES, 30.0), degrees=True), fm.directions(theta_o, 180.0, degrees=True)
    value = np.empty((ROWS, COLUMNS, SAMPLES, 1))
    for row in range(ROWS):
        for column in range(COLUMNS):
            made = fm.model("lambert+ggx", channels=1, kd=0.2 + 0.2 * row, alpha=0.1 + 0.1 * column, eta=1.5)
            value[row, column] = fm.evaluate(made, wi, wo)
    sigma = 0.01 * value
    value += sigma * rng.normal(size=value.shape)
    value[1, 2] = np.nan
    return {"value": value, "sigma": sigma, "theta_i": np.array(30.0), "theta_o": theta_o}


@pytest.fixture
def atlas(tmp_path: Path) -> Path:
    path = tmp_path / "atlas.npz"
    told: dict[str, Any] = arrays()
    np.savez(path, **told)
    return path


def test_a_gpu_that_is_not_there_is_one_sentence(atlas: Path, tmp_path: Path) -> None:
    """Neither for a texture nor for files is another device taken in its place."""
    told = ["batch", str(atlas), "--out", str(tmp_path / "out"), "--device", "gpu"]
    found = subprocess.run(
        [sys.executable, "-m", "fitmat", *told],
        capture_output=True,
        text=True,
        env=os.environ | {"CUDA_VISIBLE_DEVICES": ""},
    )
    assert found.returncode == 1
    assert found.stderr.splitlines()[-1].startswith("fitmat: --device gpu: JAX finds no GPU here, expected one.")
    assert not (tmp_path / "out").exists()
    told[1] = str(tmp_path)
    refused = CliRunner().invoke(app, told)
    assert "for files, expected a texture" in str(refused.exception)


def test_an_atlas_is_fitted_as_its_arrays_are(atlas: Path, tmp_path: Path) -> None:
    told = arrays()
    wi = fm.directions(np.full(SAMPLES, 30.0), degrees=True)
    wo = fm.directions(told["theta_o"], 180.0, degrees=True)
    direct = fm.fit_many(wi, wo, told["value"], sigma=told["sigma"], **TOLD)
    found = fit_texture(atlas, tmp_path / "out", **TOLD)
    np.testing.assert_array_equal(found.fits.values, direct.values)
    with np.load(tmp_path / "out" / "texture.npz", allow_pickle=False) as kept:
        np.testing.assert_array_equal(kept["alpha"], direct["alpha"])
        np.testing.assert_array_equal(kept["kd_sd"], direct.sd_of("kd"))
        names = kept["outcomes"][kept["outcome"]]
    assert names[1, 2] == "too_few"
    assert np.count_nonzero(names == "converged") == ROWS * COLUMNS - 1
    steps = np.diff(np.nanmean(direct["alpha"], axis=0))
    np.testing.assert_allclose(steps, 0.1, atol=0.02)  # the roughness of the truth, 1 % noise
    assert "11 converged, 1 too_few" in str(found)


def zarr_group(path: Path) -> Path:
    """The same texture, chunks of a row; the names of its channels are an attribute."""
    group = zarr.open_group(path, mode="w")
    for name, part in arrays().items():
        group.create_array(name, data=part, chunks=(1, *part.shape[1:]) if part.ndim else ())
    group.attrs["channels"] = ["grey"]
    return path


def test_a_zarr_group_is_read_and_left_as_one(atlas: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tiles begin and end within rows; what an earlier run left is replaced."""
    monkeypatch.setattr(textures, "TILE", 5)
    expected = fit_texture(atlas, tmp_path / "npz", **TOLD).fits
    source = zarr_group(tmp_path / "atlas.zarr")
    read = read_atlas(source)
    assert not isinstance(read.value, np.ndarray)
    assert max(len(read.tile(slice(first, first + 5))[0]) for first in range(0, 12, 5)) == 5
    for _ in range(2):
        found = fit_texture(source, tmp_path / "out", **TOLD)
        np.testing.assert_array_equal(found.fits.values, expected.values)
        kept: Any = zarr.open_group(tmp_path / "out" / "texture.zarr", mode="r")
        np.testing.assert_array_equal(kept["alpha"], expected["alpha"])
        np.testing.assert_array_equal(kept["kd_sd"], expected.sd_of("kd"))
        assert kept.attrs["channels"] == ["grey"]
        assert kept.attrs["outcomes"][kept["outcome"][1, 2]] == "too_few"
    assert not [path for path in (tmp_path / "out").iterdir() if path.name.startswith(".texture")]


@pytest.mark.parametrize("end", [KeyboardInterrupt, MemoryError])
def test_tiles_are_kept_and_used_again(
    end: type[BaseException], atlas: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(textures, "TILE", 5)
    out = tmp_path / "out"
    calls: list[int] = []

    def stopping(*given: Any, **told: Any) -> fm.Fits:
        calls.append(len(given[2]))
        if len(calls) == 2:
            raise end
        return fm.fit_many(*given, **told)

    monkeypatch.setattr(textures, "fit_many", stopping)
    with pytest.raises(end):
        fit_texture(atlas, out, **TOLD)
    kept = list((out / "parts").iterdir())
    assert len(kept) == 1
    first = fit_texture(atlas, out, **TOLD)
    assert (first.earlier, sum(calls[2:])) == (4, 8)
    calls.clear()
    calls += [0, 0]
    kept[0].write_bytes(kept[0].read_bytes()[:200])
    again = fit_texture(atlas, out, **TOLD)
    assert (again.earlier, sum(calls)) == (8, 4)
    np.testing.assert_array_equal(again.fits.values, first.fits.values)
    calls.clear()
    calls += [0, 0]
    other: dict[str, Any] = {"loss": "default"}
    assert fit_texture(atlas, out, force=True, **other).earlier == 0


def test_another_texture_takes_no_results_away(atlas: Path, tmp_path: Path) -> None:
    """Of another format, of other flags, or of other values in the same file; with force nothing of it is left."""
    out, group = tmp_path / "out", zarr_group(tmp_path / "atlas.zarr")
    fit_texture(atlas, out, **TOLD)
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    with pytest.raises(OutputError, match=r"out holds results of other data or flags.*\(texture\.npz\).*--force"):
        fit_texture(group, out, **TOLD)
    with pytest.raises(OutputError, match="which would be lost"):
        fit_texture(atlas, out, loss="gaussian")
    other: dict[str, Any] = arrays() | {"value": 2.0 * arrays()["value"]}
    np.savez(atlas, **other)
    asked = ["batch", str(atlas), "--out", str(out), "--loss", "gaussian", "--fix", "ks=1", "--fix", "eta=1.5"]
    assert "which would be lost" in str(CliRunner().invoke(app, asked).exception)
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before
    assert fit_texture(group, out, force=True, **TOLD).earlier == ROWS * COLUMNS  # its values are the first's
    assert {path.name for path in out.iterdir()} == {"texture.zarr", *MAPS, "parts", "batch.json"}
    some: dict[str, Any] = other | {name: other[name].reshape(-1, SAMPLES, 1)[:2] for name in ("value", "sigma")}
    np.savez(atlas, **some)
    assert CliRunner().invoke(app, [*asked, "--force"]).exit_code == 0
    assert {path.name for path in out.iterdir()} == {"texture.npz", "parts", "batch.json"}
    assert len(list((out / "parts").iterdir())) == 1


@pytest.mark.usefixtures("handler")
def test_a_texture_of_another_precision_is_another(atlas: Path, tmp_path: Path) -> None:
    """Tiles of one are not taken for the other's, nor is its folder; of files there is none in single precision."""
    out = tmp_path / "out"
    asked = ["batch", str(atlas), "--out", str(out), "--loss", "gaussian", "--fix", "ks=1", "--fix", "eta=1.5"]
    assert CliRunner().invoke(app, [*asked, "--precision", "single"]).exit_code == 0
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    assert "12 known from an earlier run" in CliRunner().invoke(app, [*asked, "--precision", "single"]).output
    assert "which would be lost" in str(CliRunner().invoke(app, asked).exception)
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before
    single = fit_texture(atlas, tmp_path / "other", precision="single", **TOLD)
    read, told = read_atlas(atlas), arrays()
    direct = fm.fit_many(read.wi, read.wo, told["value"], sigma=told["sigma"], precision="single", **TOLD)
    np.testing.assert_array_equal(single.fits.steps, direct.steps)
    np.testing.assert_array_equal(single.fits.values, direct.values)
    assert fit_texture(atlas, tmp_path / "other", force=True, **TOLD).earlier == 0
    assert fit_texture(atlas, tmp_path / "other", precision="double", **TOLD).earlier == ROWS * COLUMNS
    refused = CliRunner().invoke(app, ["batch", str(tmp_path), "--precision", "single"])
    assert "--precision single for files, expected a texture" in str(refused.exception)


def test_a_texture_replaces_no_file_of_the_user(atlas: Path, tmp_path: Path) -> None:
    """Nor does force, nor where what should be the record is none."""
    (tmp_path / "base_color.png").write_text("mine")
    for force in (False, True):
        with pytest.raises(OutputError, match=r"base_color\.png is not known to be of an earlier batch"):
            fit_texture(atlas, tmp_path, force=force, **TOLD)
    (tmp_path / "batch.json").write_text('{"of": 5}')
    with pytest.raises(OutputError, match=r"batch\.json is no record of a batch"):
        fit_texture(atlas, tmp_path, **TOLD)


def test_what_a_fitmat_without_records_left_is_replaced_by_force(atlas: Path, tmp_path: Path) -> None:
    """It wrote no batch.json; where one file is of another name nothing is replaced, nor where parts are none."""
    out, group = tmp_path / "out", zarr_group(tmp_path / "atlas.zarr")
    fit_texture(atlas, out, **TOLD)
    (out / "batch.json").unlink()
    with pytest.raises(OutputError, match=r"out holds results of other data.* and 5 more\), which would .* or --force"):
        fit_texture(group, out, loss="gaussian")
    for mine in (out / "notes.txt", out / "parts" / "notes.npz"):
        mine.write_text("mine")
        before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
        with pytest.raises(OutputError, match=r"texture\.npz is not known to be of an earlier batch"):
            fit_texture(group, out, loss="gaussian", force=True)
        assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before
        mine.unlink()
    fit_texture(group, out, loss="gaussian", force=True)
    assert {path.name for path in out.iterdir()} - set(MAPS) == {"texture.zarr", "parts", "batch.json"}
    assert len(list((out / "parts").iterdir())) == 1


def test_maps_hold_the_parameters(atlas: Path, tmp_path: Path) -> None:
    """Of glTF 2.0, sections 3.9.2 and 5.22.2, and IEC 61966-2-1: sRGB colours, roughness √α in green."""
    found = fit_texture(atlas, tmp_path / "out", **TOLD)
    assert [path.name for path in found.maps] == [
        *("base_color.png", "metallic_roughness.png", "specular_color.png", "texture.gltf", "texture.mtlx")
    ]
    pictures = [np.asarray(Image.open(path), float) / 255.0 for path in found.maps[:3]]
    base, rough, specular = pictures
    there = found.fits.result == "converged"
    assert base.shape == (ROWS, COLUMNS, 3)
    decoded = np.where(base <= 0.04045, base / 12.92, ((base + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(decoded[there][:, 0], found.fits["kd"][there, 0], atol=0.005)
    np.testing.assert_allclose(rough[there][:, 1] ** 2, found.fits["alpha"][there], atol=0.005)
    assert (rough[..., 2] == 0.0).all()
    material = json.loads(found.maps[3].read_text())["materials"][0]
    ior = material["extensions"]["KHR_materials_ior"]["ior"]
    assert ior == pytest.approx(1.5, rel=1e-9)  # ks and eta are fixed
    assert (specular == 1.0).all()
    assert decoded[1, 2, 0] == pytest.approx(np.nanmedian(found.fits["kd"]), abs=0.005)


def test_points_in_no_rows_have_no_maps(tmp_path: Path) -> None:
    told: dict[str, Any] = arrays()
    told |= {name: told[name].reshape(-1, SAMPLES, 1)[:2] for name in ("value", "sigma")}
    np.savez(tmp_path / "points.npz", **told)
    found = fit_texture(tmp_path / "points.npz", tmp_path / "out", **TOLD)
    assert (found.maps, found.fits.outcome.shape) == ((), (2,))


def test_materialx_takes_the_document(atlas: Path, tmp_path: Path) -> None:
    """Its own library finds it valid and writes a shader of it, with the glTF file's pictures and number."""
    names = ("MaterialX", "MaterialX.PyMaterialXGenGlsl", "MaterialX.PyMaterialXGenShader")
    modules: list[Any] = [importlib.import_module(name) for name in names]  # they have no types
    mx, mx_glsl, mx_gen = modules
    found = fit_texture(atlas, tmp_path / "out", **TOLD)
    document, search = mx.createDocument(), mx.getDefaultDataSearchPath()
    mx.readFromXmlFile(document, str(found.maps[4]))
    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), search, library)
    document.importLibrary(library)
    valid, why = document.validate()
    assert valid, why
    generator = mx_glsl.EsslShaderGenerator.create()
    colours = mx_gen.DefaultColorManagementSystem.create(generator.getTarget())
    colours.loadLibrary(document)
    generator.setColorManagementSystem(colours)
    context = mx_gen.GenContext(generator)
    context.registerSourceCodeSearchPath(search)
    environments = mx_gen.HwSpecularEnvironmentMethod
    context.getOptions().hwSpecularEnvironmentMethod = environments.SPECULAR_ENVIRONMENT_FIS
    element = mx_gen.findRenderableElements(document)[0]
    shader = generator.generate("material", element, context).getSourceCode(mx_gen.PIXEL_STAGE)
    main = shader[shader.index("void main") :]
    assert [name for name in PICTURES if f"mx_image_color3({name}_file" in main] == list(PICTURES)
    assert [name for name in PICTURES if f"NG_srgb_texture_to_lin_rec709_color3({name}_out" in main] == [
        *("base", "specular")
    ]
    assert "rough_out = packed_out[" in main
    files = {node.getName(): node.getInputValue("file") for node in document.getNodes("image")}
    assert [files[name] for name in PICTURES] == [path.name for path in found.maps[:3]]
    index = json.loads(found.maps[3].read_text())["materials"][0]["extensions"]["KHR_materials_ior"]["ior"]
    assert document.getNode("surface").getInputValue("ior") == pytest.approx(index, rel=1e-6)


PICTURES = ("base", "packed", "specular")
"""Names of the nodes of pictures."""


@pytest.mark.study
def test_khronos_finds_no_fault_in_a_texture(atlas: Path, tmp_path: Path) -> None:
    node = shutil.which("node")
    if node is None or subprocess.run([node, "-e", "require('gltf-validator')"], capture_output=True).returncode:
        pytest.skip("no gltf-validator: npm install gltf-validator, and name its node_modules in NODE_PATH")
    file = fit_texture(atlas, tmp_path / "out", **TOLD).maps[3]
    ended = subprocess.run([node, "-e", VALIDATE, str(file)], capture_output=True, check=True)
    issues = json.loads(ended.stdout)
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues


VALIDATE = """
const fs = require('fs'), path = require('path'), folder = path.dirname(process.argv[1]);
require('gltf-validator').validateBytes(new Uint8Array(fs.readFileSync(process.argv[1])), {
    externalResourceFunction: (uri) => Promise.resolve(new Uint8Array(fs.readFileSync(path.join(folder, uri)))),
}).then((found) => console.log(JSON.stringify(found.issues)));
"""


def test_a_full_disk_is_one_sentence(atlas: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, content: bytes) -> None:
        raise OutputError(f"{path}: cannot be written (No space left on device); choose another place.")

    monkeypatch.setattr(textures.files, "write_bytes", full)
    with pytest.raises(FitmatError, match="No space left on device"):
        fit_texture(atlas, tmp_path / "out", **TOLD)


@pytest.fixture
def handler() -> Iterator[None]:
    """The answer to Ctrl-C, which a command changes, as it was."""
    before = signal.getsignal(signal.SIGINT)
    yield
    signal.signal(signal.SIGINT, before)


UP = np.tile([0.0, 0.0, 1.0], (SAMPLES, 1))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"value": None}, "no array value, but sigma, theta_i, theta_o, expected value and any of"),
        ({"values": np.ones(3)}, "an array 'values', expected value and any of sigma"),
        ({"value": np.ones((4, 24))}, r"value has shape \(4, 24\), expected \(rows, columns, samples, channels\) or"),
        ({"value": np.ones((4, 23, 1))}, "24 pairs of directions for 23 samples, expected as many"),
        (
            {"theta_i": np.array(0.5), "theta_o": np.linspace(-1.0, 1.2, SAMPLES)},
            "1.2, expected degrees; they look like",
        ),
        ({"value": np.array([["a"]])}, "value of .*atlas.npz"),
        ({"sigma": np.ones(3)}, r"sigma has shape \(3,\), expected one number, or"),
        ({"theta_o": None}, "directions theta_i, expected wi and wo, or theta_i and theta_o"),
        ({"wi": UP}, "directions wi, theta_i, theta_o, expected wi and wo, or"),
        ({"theta_i": np.ones(5)}, r"angles of shapes theta_i \(5,\), theta_o \(24,\)"),
        ({"theta_i": np.array(120.0)}, "120"),
        (
            {"theta_i": None, "theta_o": None, "wi": 2 * UP, "wo": UP},
            r"wi of .*atlas\.npz row 0 has length 2: expected unit vectors",
        ),
        (
            {"theta_i": None, "theta_o": None, "wi": UP[:, :2], "wo": UP},
            r"wi of shape \(24, 2\), expected \(n, 3\) unit vectors",
        ),
        ({"channels": np.array(["r", "g"])}, "channels r, g for 1 columns of values"),
    ],
)
def test_wrong_arrays_are_one_sentence(changed, message, tmp_path: Path) -> None:
    path = tmp_path / "atlas.npz"
    kept: dict[str, Any] = {name: part for name, part in (arrays() | changed).items() if part is not None}
    np.savez(path, **kept)
    with pytest.raises(FitmatError, match=message):
        read_atlas(path)


@pytest.mark.parametrize("sigma", [np.array(-0.01), np.full((ROWS, COLUMNS, SAMPLES, 1), -0.01)])
def test_a_sigma_is_positive(sigma: np.ndarray, tmp_path: Path) -> None:
    told: dict[str, Any] = arrays() | {"sigma": sigma}
    np.savez(tmp_path / "atlas.npz", **told)
    with pytest.raises(FitmatError, match=r"atlas\.npz: sigma of -0\.01, expected above 0"):
        read_atlas(tmp_path / "atlas.npz").tile(slice(0, 3))


def test_points_that_end_otherwise_end_the_command_with_3(tmp_path: Path) -> None:
    """A point that was not measured is no failure; where none is left, or one is not determined, scripts are told."""
    told: dict[str, Any] = arrays()
    np.savez(tmp_path / "good.npz", **told)
    np.savez(tmp_path / "none.npz", **(told | {"value": np.full_like(told["value"], np.nan)}))
    np.savez(tmp_path / "flat.npz", **(told | {"value": np.zeros_like(told["value"]), "sigma": np.array(0.1)}))
    asked = ["--loss", "gaussian", "--fix", "ks=1", "--fix", "eta=1.5"]
    ended = {
        name: CliRunner().invoke(app, ["batch", str(tmp_path / f"{name}.npz"), "--out", str(tmp_path / name), *asked])
        for name in ("good", "none", "flat")
    }
    assert {name: one.exit_code for name, one in ended.items()} == {"good": 0, "none": 3, "flat": 3}
    assert "no point has a fit" in ended["none"].output
    assert "of 12 points are not determined or did not converge" in ended["flat"].output
    beside = CliRunner().invoke(app, ["batch", str(tmp_path / "good.npz"), str(tmp_path / "none.npz")])
    assert "a texture beside other files" in str(beside.exception)


def test_damaged_groups_are_one_sentence(tmp_path: Path) -> None:
    """None there, a file, words for numbers, and a chunk that is cut off, which is met while points are fitted."""
    path = tmp_path / "atlas.zarr"
    with pytest.raises(FitmatError, match=r"atlas\.zarr: no atlas can be read \(.*does not exist\)"):
        read_atlas(path)
    path.write_text("theta_i,theta_o\n")
    with pytest.raises(FitmatError, match=r"atlas\.zarr: no atlas can be read"):
        read_atlas(path)
    path.unlink()
    zarr.open_group(path, mode="w").create_array("value", data=np.zeros((2, 3, 1), bool))
    with pytest.raises(FitmatError, match=r"value of .*atlas\.zarr .* real numbers"):
        read_atlas(path)
    shutil.rmtree(path)
    chunk = max((one for one in zarr_group(path).glob("value/c/1/**/*") if one.is_file()), key=str)
    chunk.write_bytes(chunk.read_bytes()[:20])
    read = read_atlas(path)
    assert np.isfinite(read.tile(slice(0, COLUMNS))[0]).all()
    with pytest.raises(FitmatError, match=r"atlas\.zarr: points 5 to 8 cannot be read \(.*\)\. Write it again"):
        read.tile(slice(COLUMNS, 2 * COLUMNS))


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 damaged", b"\x93NUMPY", b"theta_i,theta_o\n"])
def test_damaged_files_are_one_sentence(content, tmp_path: Path) -> None:
    path = tmp_path / "atlas.npz"
    path.write_bytes(content)
    with pytest.raises(FitmatError, match=r"atlas\.npz: no atlas can be read"):
        read_atlas(path)


def test_vectors_serve_as_angles_do(atlas: Path, tmp_path: Path) -> None:
    by_angle = read_atlas(atlas)
    path = tmp_path / "vectors.npz"
    np.savez(path, value=arrays()["value"], wi=by_angle.wi, wo=by_angle.wo)
    found = read_atlas(path)
    np.testing.assert_array_equal(found.wo, by_angle.wo)
    assert found.sigma is None


@pytest.mark.usefixtures("handler")
def test_the_command_fits_a_texture(atlas: Path, tmp_path: Path) -> None:
    words = [
        "batch",
        str(atlas),
        "--out",
        str(tmp_path / "out"),
        "--loss",
        "gaussian",
        "--fix",
        "ks=1",
        "--fix",
        "eta=1.5",
    ]
    ran = CliRunner().invoke(app, words)
    assert ran.exit_code == 0, ran.output
    assert "12 fits of lambert+ggx: 11 converged, 1 too_few." in ran.output
    assert (tmp_path / "out" / "texture.npz").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--models", "lambert,ggx"], "expected one: every point has the same model"),
        (["--tilt"], "is a texture, for which --tilt means nothing: leave it out."),
        (["--mcmc"], "is a texture, for which --mcmc means nothing"),
        (["--prior", "eta=1.5,0.1"], "is a texture, for which --prior means nothing"),
        (["--angle-error", "0.1"], "is a texture, for which --angle-error means nothing"),
        (["--scheduler", "tcp://10.0.0.1:8786"], "is a texture, for which --scheduler means nothing"),
        (["--theta-i", "30"], "is a texture, for which --theta-i means nothing"),
        (["--loss", "gaussian-inferred"], "loss is 'gaussian-inferred' (--loss), expected one that infers no noise"),
        (["--models", "ggx-film"], "to = 'ggx-film' (--models), expected a model"),
        (["--models", "lambert", "--fix", "kd=0.5"], "every parameter of lambert is fixed (--fix), expected one that"),
    ],
)
def test_what_means_nothing_for_a_texture_is_refused(words, message, atlas: Path, tmp_path: Path) -> None:
    ran = CliRunner().invoke(app, ["batch", str(atlas), "--out", str(tmp_path / "out"), *words])
    assert ran.exit_code == 1
    assert message in str(ran.exception) + ran.output
