"""Photographs: pictures under one light each are fitted as what made them, and wrong tables are one sentence."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from typer.testing import CliRunner

from fitmat.batches.photographs import read_photographs
from fitmat.batches.textures import fit_texture
from fitmat.cli.application import app
from fitmat.errors import Doubt, FitmatError

ROWS, COLUMNS = 3, 4

ALPHA = np.linspace(0.2, 0.5, ROWS * COLUMNS).reshape(ROWS, COLUMNS)

LIGHTS = [(theta, phi, 2.0 + 0.1 * k) for k, theta in enumerate(range(0, 84, 6)) for phi in (0, 90)]
"""θ_i, φ_i in degrees, and irradiance."""

CAMERA = 25.0
"""Its zenith angle, at azimuth 180°."""


def draw(path: Path, layers: dict[str, np.ndarray]) -> None:
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, layers).write(str(path))


def radiances(theta: float, phi: float, irradiance: float) -> np.ndarray:
    """L = f E cosθ_i of a Lambertian floor under Walter's GGX of η = 1.5, written out, (rows, columns, 3)."""
    wi, wo = (
        np.array([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)])
        for t, p in np.deg2rad([(theta, phi), (CAMERA, 180.0)])
    )
    h = (wi + wo) / np.linalg.norm(wi + wo)
    d, c, a2 = h[2], wi @ h, ALPHA**2
    distribution = a2 / (np.pi * (d * d * (a2 - 1.0) + 1.0) ** 2)
    shadowed = [(np.sqrt(1.0 + a2 * (1.0 / w[2] ** 2 - 1.0)) - 1.0) / 2.0 for w in (wi, wo)]
    g = np.sqrt(1.5**2 - 1.0 + c * c)
    fresnel = 0.5 * ((g - c) / (g + c)) ** 2 * (1.0 + ((c * (g + c) - 1.0) / (c * (g - c) + 1.0)) ** 2)
    specular = distribution * fresnel / (1.0 + sum(shadowed)) / (4.0 * wi[2] * wo[2])
    found = np.array([0.1, 0.3, 0.6]) / np.pi + specular[..., None]
    return found * irradiance * wi[2]


@pytest.fixture
def table(tmp_path: Path) -> Path:
    lines = ["picture,theta_i,phi_i,irradiance,theta_o,phi_o"]
    for k, light in enumerate(LIGHTS):
        draw(tmp_path / f"{k:02}.exr", {"RGB": radiances(*light).astype(np.float32)})
        lines.append(f"{k:02}.exr,{light[0]},{light[1]},{light[2]:g},{CAMERA:g},180")
    path = tmp_path / "lights.csv"
    path.write_text("\n".join(lines))
    return path


def test_pictures_are_the_values_that_made_them(table: Path, tmp_path: Path) -> None:
    """Every point's roughness and colours come back, against a GGX that is written out here."""
    found = fit_texture(table, tmp_path / "out", fixed={"ks": 1.0})
    assert found.file.name == "texture.npz"
    np.testing.assert_allclose(found.fits["alpha"], ALPHA, rtol=1e-4)
    np.testing.assert_allclose(found.fits["eta"], np.full((ROWS, COLUMNS), 1.5), rtol=1e-3)
    np.testing.assert_allclose(found.fits["kd"], np.broadcast_to([0.1, 0.3, 0.6], (ROWS, COLUMNS, 3)), rtol=1e-3)
    assert len(found.maps) > 0


def test_a_grey_picture_and_what_is_not_finite(tmp_path: Path) -> None:
    """f = L/(E cosθ_i); a pixel that is not finite is masked; rows are read where they are asked for."""
    grey = np.arange(12.0).reshape(ROWS, COLUMNS).astype(np.float16)
    grey[0, 0], grey[2, 3] = np.inf, np.nan
    draw(tmp_path / "a.exr", {"Y": grey})
    (tmp_path / "lights.csv").write_text("picture,theta_i,phi_i,irradiance\na.exr,60,0,4\n")
    atlas = read_photographs(tmp_path / "lights.csv")
    assert atlas.points == (ROWS, COLUMNS)
    value, _ = atlas.tile(slice(0, ROWS * COLUMNS))
    expected = np.where(np.isfinite(grey), grey, np.nan).astype(float).ravel() / 2.0
    np.testing.assert_allclose(value[:, 0, 0], expected, rtol=1e-12)
    part, _ = atlas.tile(slice(5, 7))
    np.testing.assert_array_equal(part, value[5:7])
    np.testing.assert_array_equal(atlas.wo, [[0.0, 0.0, 1.0]])


def test_tables_as_people_write_them(table: Path, tmp_path: Path) -> None:
    """Spaces, comments, empty lines, a mark of byte order and decimals far down change nothing; A < 1 is masked."""
    lines = [f"{k:03}.exr , 10, 0 ,2" for k in range(110)] + ["110.exr, 10.5, 0, 2", ",,,", ""]
    picture = np.ones((ROWS, COLUMNS), np.float32)
    alpha = np.where(np.arange(COLUMNS) == 1, 0.5, 1.0) * picture
    for k in range(111):
        draw(tmp_path / f"{k:03}.exr", {"RGB": np.stack([picture] * 3, 2)})
    draw(tmp_path / "000.exr", {"RGBA": np.stack([*([picture] * 3), alpha], 2).astype(np.float32)})
    text = "\ufeffpicture, theta_i,phi_i ,irradiance\r\n# by hand\r\n" + "\r\n".join(lines)
    (tmp_path / "lights.csv").write_text(text, encoding="utf-8")
    atlas = read_photographs(tmp_path / "lights.csv")
    value, _ = atlas.tile(slice(0, ROWS * COLUMNS))
    assert value.shape == (ROWS * COLUMNS, 111, 3)
    np.testing.assert_array_equal(np.isnan(value[:, 0, 0]), np.tile(np.arange(COLUMNS) == 1, ROWS))
    np.testing.assert_allclose(value[0, 110], 0.5 / np.cos(np.deg2rad(10.5)), rtol=1e-7)


def test_whole_numbers_have_holes_too(tmp_path: Path) -> None:
    layers = {name: np.full((ROWS, COLUMNS), 3, np.uint32) for name in "RGB"}
    alpha = np.ones((ROWS, COLUMNS), np.float32)
    alpha[1, 1] = 0.0
    draw(tmp_path / "a.exr", layers | {"A": alpha})
    (tmp_path / "lights.csv").write_text("picture,theta_i,phi_i,irradiance\na.exr,60,0,4\n")
    value, _ = read_photographs(tmp_path / "lights.csv").tile(slice(0, ROWS * COLUMNS))
    np.testing.assert_allclose(value[:, 0, 0], np.where(alpha.ravel() > 0, 1.5, np.nan), rtol=1e-12)


GOOD = "picture,theta_i,phi_i,irradiance\n00.exr,10,0,2\n01.exr,20,0,2\n"

NOISY = "picture,theta_i,phi_i,irradiance,sigma\n00.exr,10,0,2,0.1\n01.exr,20,0,2,0.2\n"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "no table of lights can be read"),
        ("picture,theta_i,phi_i,irradiance\n,,,\n", "no row, expected picture, theta_i, phi_i, irradiance"),
        ("picture,theta_i\n00.exr,10\n", "columns picture, theta_i, expected picture"),
        (GOOD.replace("phi_i", "azimuth"), "a column 'azimuth', expected picture"),
        (GOOD.replace("20", "much"), "row 2: theta_i is 'much', expected a number"),
        (GOOD.replace("20,0,2", "20,0,"), "row 2: irradiance is nothing, expected a number"),
        (GOOD.replace("20,0,2", "20,0,0"), "row 2: irradiance is 0, expected above 0"),
        (GOOD.replace("20", "90"), "row 2: theta_i is 90, expected 0 to below 90 degrees"),
        (GOOD.replace("10", "0.2").replace("20", "0.9"), "they look like radians. Convert them."),
        (GOOD.replace("01.exr", "01.png"), "01.png: expected an OpenEXR picture"),
        (GOOD.replace("01.exr", "no.exr"), "no.exr: no such file, expected a picture"),
        (GOOD.replace("01.exr", "broken.exr"), "broken.exr: no picture can be read"),
        (GOOD.replace("01.exr", "wide.exr"), "wide.exr: 5 × 3 pixels of R, G, B from 0 × 0 on, expected 4 × 3"),
        (GOOD.replace("01.exr", "depth.exr"), "depth.exr: channels Z, expected R, G and B, or Y"),
        (GOOD.replace("01.exr", "moved.exr"), "moved.exr: 4 × 3 pixels of R, G, B from 2 × 0 on, expected 4 × 3"),
        (GOOD.replace("01.exr", "stereo.exr"), "stereo.exr: 2 pictures in one file, expected one"),
        (GOOD.replace("01.exr", "chroma.exr"), "chroma.exr: channels BY, RY, Y, expected R, G and B, or Y alone"),
        (GOOD.replace("01.exr", "pipe.exr"), "pipe.exr: no such file"),
        (GOOD.replace("01.exr", ""), "row 2 has no picture, expected the name"),
        (GOOD.replace("01.exr", "00.exr"), "00.exr stands in rows 1 and 2, expected a picture of its own"),
        (GOOD.replace("20,0,2", "20,400,2"), "row 2: phi_i is 400, expected -360 to 360 degrees"),
        (GOOD.replace("20,0,2", "20,0,1e-320"), "row 2: irradiance is 9.99989e-321, expected above 0"),
        (GOOD.replace("20,0,2", "20,0,true"), "row 2: irradiance is 'true', expected a number"),
        (NOISY.replace("0.2", ""), "row 2: sigma is nothing, expected a number"),
        (NOISY.replace("0.2", "0"), "row 2: sigma is 0, expected above 0"),
        (NOISY.replace("0.1", "-1"), "row 1: sigma is -1, expected above 0"),
        (NOISY.replace("sigma", "saturation").replace("0.2", ""), "row 2: saturation is nothing, expected a number"),
        (NOISY.replace("sigma", "saturation").replace("0.2", "0"), "row 2: saturation is 0, expected above 0"),
        ("picture,theta_i,phi_i,irradiance,theta_o\n00.exr,10,0,2,30\n", "theta_o without phi_o, expected both"),
    ],
)
def test_wrong_tables_are_one_sentence(content: str, message: str, table: Path, tmp_path: Path) -> None:
    draw(tmp_path / "wide.exr", {"RGB": np.ones((3, 5, 3), np.float32)})
    draw(tmp_path / "depth.exr", {"Z": np.ones((3, 4), np.float32)})
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    pixels = {"RGB": np.ones((3, 4, 3), np.float32)}
    window = {
        "dataWindow": (np.array([2, 0], np.int32), np.array([5, 2], np.int32)),
        "displayWindow": (np.array([0, 0], np.int32), np.array([7, 2], np.int32)),
    }
    OpenEXR.File(header | window, pixels).write(str(tmp_path / "moved.exr"))
    parts = [OpenEXR.Part(dict(header), dict(pixels), name) for name in ("left", "right")]
    OpenEXR.File(parts).write(str(tmp_path / "stereo.exr"))
    draw(tmp_path / "chroma.exr", {name: np.ones((3, 4), np.float32) for name in ("Y", "RY", "BY")})
    os.mkfifo(tmp_path / "pipe.exr")
    (tmp_path / "broken.exr").write_bytes((tmp_path / "00.exr").read_bytes()[:60])
    table.write_text(content)
    with pytest.raises(FitmatError) as caught:
        read_photographs(table)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("left", [0.5, 0.9])
def test_of_a_damaged_picture_only_the_sentence_is_printed(
    left: float, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """OpenEXR's own words on both streams are not; Python's are heard before and after."""
    rng = np.random.default_rng(0)
    draw(tmp_path / "a.exr", {"Y": rng.uniform(size=(64, 64)).astype(np.float32)})
    whole = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "a.exr").write_bytes(whole[: int(left * len(whole))])
    (tmp_path / "lights.csv").write_text("picture,theta_i,phi_i,irradiance\na.exr,60,0,4\n")
    os.write(2, b"before ")
    with pytest.raises(FitmatError, match=r"a\.exr: no picture can be read"):
        read_photographs(tmp_path / "lights.csv")
    print("after", file=sys.stderr)
    out, err = capfd.readouterr()
    assert (out, err) == ("", "before after\n")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["{folder}/x.csv", "--lights", "{folder}/lights.csv"], "expected one of them: the table names its pictures"),
        (["--lights", "{folder}/lights.txt"], "whose name ends in .csv"),
        (["--lights", "{folder}/lights.csv", "--loss", "gaussian"], "the loss gaussian (--loss) needs it"),
        (["--lights", "{folder}/lights.csv", "--jobs", "{folder}/x.csv"], "for which --jobs means nothing"),
    ],
)
def test_what_means_nothing_beside_lights_is_refused(words: list[str], message: str, table: Path) -> None:
    told = [word.format(folder=table.parent) for word in words]
    ran = CliRunner().invoke(app, ["batch", *told, "--out", str(table.parent / "out")])
    assert ran.exit_code == 1
    assert message in str(ran.exception) + ran.output


def test_the_command_fits_pictures(table: Path, tmp_path: Path) -> None:
    told = ["--lights", table, "--out", tmp_path / "out", "--fix", "ks=1"]
    ran = CliRunner().invoke(app, ["batch", *map(str, told)])
    assert ran.exit_code == 0, ran.output
    assert "12 fits of lambert+ggx: 12 converged." in ran.output
    with np.load(tmp_path / "out" / "texture.npz", allow_pickle=False) as kept:
        np.testing.assert_allclose(kept["alpha"], ALPHA, rtol=1e-4)


def test_what_the_angles_leave_open_is_said(table: Path, tmp_path: Path) -> None:
    """Six lights near the normal: ks, eta and alpha trade off, and no map is drawn."""
    kept = table.read_text().split("\n")
    table.write_text("\n".join(line for k, line in enumerate(kept) if k < 7))
    ran = CliRunner().invoke(app, ["batch", "--lights", str(table), "--out", str(tmp_path / "out")])
    assert ran.exit_code == 3, ran.output
    assert "No maps: no point has a fit that is determined." in ran.output
    assert "Are the irradiance and the model what you mean?" in ran.output
    assert "--fix says" in ran.output


def test_an_atlas_of_pictures_equals_that_of_arrays(table: Path, tmp_path: Path) -> None:
    """The same values in a .npz file give the same fits, bit for bit."""
    atlas = read_photographs(table)
    value, _ = atlas.tile(slice(0, ROWS * COLUMNS))
    np.savez(tmp_path / "atlas.npz", value=value.reshape(atlas.value.shape), wi=atlas.wi, wo=atlas.wo)
    told: dict[str, Any] = {"fixed": {"ks": 1.0}}
    one, other = (fit_texture(path, tmp_path / path.stem, **told) for path in (table, tmp_path / "atlas.npz"))
    np.testing.assert_array_equal(one.fits.values, other.fits.values)


def test_noise_of_pictures_equals_that_of_arrays(table: Path, tmp_path: Path) -> None:
    """σ_L/(E cosθ_i) as `sigma` of a .npz file gives the same fits under a loss that needs it, bit for bit."""
    lines = table.read_text().split("\n")
    noise = 0.002 * (1.0 + np.arange(len(LIGHTS)))
    told = [f"{line},{sd:g}" for line, sd in zip(lines[1:], noise, strict=True)]
    table.write_text("\n".join([lines[0] + ",sigma", *told]))
    atlas = read_photographs(table)
    value, sigma = atlas.tile(slice(0, ROWS * COLUMNS))
    assert isinstance(sigma, np.ndarray)
    theta, _, irradiance = np.array(LIGHTS).T
    expected = noise / (irradiance * np.cos(np.deg2rad(theta)))
    np.testing.assert_allclose(sigma, np.broadcast_to(expected[:, None], sigma.shape), rtol=1e-12)
    part: Any = atlas.tile(slice(5, 7))[1]
    assert part.shape == (2, len(LIGHTS), 3)
    arrays: dict[str, Any] = {"value": value.reshape(atlas.value.shape), "sigma": sigma.reshape(atlas.value.shape)}
    np.savez(tmp_path / "atlas.npz", wi=atlas.wi, wo=atlas.wo, **arrays)
    how: dict[str, Any] = {"fixed": {"ks": 1.0}, "loss": "gaussian"}
    one, other = (fit_texture(path, tmp_path / path.stem, **how) for path in (table, tmp_path / "atlas.npz"))
    np.testing.assert_array_equal(one.fits.values, other.fits.values)
    np.testing.assert_array_equal(one.fits.sd, other.fits.sd)
    assert (one.fits.result == "converged").all()


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.uint32])
def test_what_a_full_camera_shows_is_masked(kind: type, tmp_path: Path) -> None:
    """At and above the number of the table, as the picture's own kind of numbers has it, channel by channel."""
    told, full = ([3, 9, 8, 2], 8) if kind is np.uint32 else ([0.3, 0.9, 0.95, 0.1], 0.9)
    layers = {name: np.full((ROWS, COLUMNS), told[3], kind) for name in "RGB"}
    layers["G"][0] = np.array(told, kind)
    draw(tmp_path / "a.exr", layers)
    draw(tmp_path / "b.exr", layers)
    lines = ["picture,theta_i,phi_i,irradiance,saturation", f"a.exr,60,0,2,{full}", "b.exr,0,0,2,1e39"]
    (tmp_path / "lights.csv").write_text("\n".join(lines))
    value, _ = read_photographs(tmp_path / "lights.csv").tile(slice(0, ROWS * COLUMNS))
    masked = np.zeros(value[:, 0].shape, bool)
    masked[1:3, 1] = True
    np.testing.assert_array_equal(np.isnan(value[:, 0]), masked)
    assert np.isfinite(value[:, 1]).all()
    np.testing.assert_allclose(value[0, 0, 1], float(kind(told[0])), rtol=1e-12)  # E cos θ_i = 1


def pictures(folder: Path, first: np.ndarray, second: np.ndarray, theta_i: float = 20.0, more: str = "") -> Path:
    """A table of two grey pictures."""
    for name, grey in (("a", first), ("b", second)):
        draw(folder / f"{name}.exr", {"Y": grey.astype(np.float32)})
    named, cell = (",saturation", f",{more}") if more else ("", "")
    lines = [f"picture,theta_i,phi_i,irradiance{named}", f"a.exr,10,0,2{cell}", f"b.exr,{theta_i:g},0,2{cell}"]
    (folder / "lights.csv").write_text("\n".join(lines))
    return folder / "lights.csv"


def test_what_may_not_be_meant_is_said(tmp_path: Path) -> None:
    """Of 20,000 values 2.5 % below 0; 30 of 10,000 pixels at the top; an error of 0.5° at 85° is tan 85° · 0.5°."""
    rng = np.random.default_rng(0)
    a, b = rng.uniform(0.1, 1.0, (2, 100, 100))
    read_photographs(pictures(tmp_path, a, b, 80.0))  # without a word
    dark, bright = b.copy(), a.copy()
    dark[:5], bright[0, :30] = -0.01, 2.0
    with pytest.warns(Doubt) as said:
        atlas = read_photographs(pictures(tmp_path, bright, dark, 85.0))
    grazing, negative, full = (str(one.message).removeprefix(f"{tmp_path / 'lights.csv'}: ") for one in said)
    assert grazing.startswith("1 of 2 lights beyond 80°: values are divided by cos θ_i, and at 85° (b.exr) an error of")
    assert f"is one of {100.0 * np.tan(np.deg2rad(85.0)) * np.deg2rad(0.5):.2g} %" in grazing
    assert negative.startswith("2.5 % of the radiances are below 0, most of them in b.exr: they stay")
    assert full.startswith("a.exr looks saturated: 0.3 % of its pixels have the largest value, 2. Say in a column")
    value, _ = atlas.tile(slice(0, 10000))
    assert np.isfinite(value).all()
    assert (value[:500, 1] < 0.0).all()
    value, _ = read_photographs(pictures(tmp_path, bright, b, more="2")).tile(slice(0, 10000))  # without a word
    assert np.isnan(value[:30, 0]).all()
    assert np.isfinite(value[30:, 0]).all()


def test_the_command_says_what_may_not_be_meant(tmp_path: Path) -> None:
    """In lines of their own, before the points are fitted, for which two pictures are too few."""
    grey = np.full((5, 5), 0.3)
    words = ["batch", "--lights", str(pictures(tmp_path, grey, grey, 85.0)), "--out", str(tmp_path / "out")]
    command = [sys.executable, "-m", "fitmat", *words, "--models", "lambert", "--fix", "kd=0.5"]
    ended = subprocess.run(command, capture_output=True, text=True)
    said = [line.partition(": ")[2] for line in ended.stderr.splitlines() if line.startswith(str(tmp_path))]
    assert [line[:13] for line in said] == ["1 of 2 lights", "a.exr and 1 m"]
    assert "a.exr and 1 more look saturated: 100 % of its pixels" in said[1]
