"""Portraits: radiances are those of the model in the light, and pictures are what they say."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from PIL import Image

import fitmat as fm
from fitmat.cli.render import drawn, refuse
from fitmat.errors import FitmatError, OutputError
from fitmat.match.appearance import scene
from fitmat.reports.portrait import LIGHTS
from fitmat.studies.result import Fitted, Result

KD = np.array([0.6, 0.3, 0.1])
LAMBERT = fm.model("lambert", kd=KD)


def normals(size: int) -> np.ndarray:
    """At the middles of pixels, rows from the top; NaN beside the ball."""
    place = (np.arange(size) + 0.5) * 2.0 / size - 1.0
    x, y = np.meshgrid(place, -place)
    with np.errstate(invalid="ignore"):
        return np.stack([x, y, np.sqrt(1.0 - x * x - y * y)], axis=-1)


def towards(angle: float, direction: float) -> np.ndarray:
    return scene.frame(np.deg2rad(angle), np.deg2rad(direction))[2]


def test_a_light_shines_by_the_cosine() -> None:
    """π f cosθ_i, f = kd/π, away from the rim and the edge of the shadow; two lights add up."""
    size, places = 64, (LIGHTS["side"], (30.0, 250.0))
    cosines = [normals(size) @ towards(*place) for place in places]
    inside = np.nan_to_num(normals(size)[..., 2]) > 0.5
    for cosine, light in zip(cosines, ("side", places[1]), strict=True):
        found = fm.render(LAMBERT, light, size=size)
        lit, dark = inside & (cosine > 0.1), inside & (cosine < -0.1)
        assert found.radiance[lit] == pytest.approx(cosine[lit, None] * KD, rel=5e-3)
        assert (found.radiance[dark] == 0.0).all()
    both = fm.render(LAMBERT, ["side", places[1]], size=size).radiance
    apart = [fm.render(LAMBERT, [light], size=size).radiance for light in ("side", places[1])]
    assert both == pytest.approx(sum(apart), abs=1e-12)


def test_the_highlight_is_where_the_light_is_mirrored() -> None:
    """Half of the light's angle from the middle, in its direction; a narrow one is not missed between pixels."""
    for alpha in (0.2, 0.003):
        shown = fm.render(fm.model("ggx", alpha=alpha), (80.0, 150.0), size=65).radiance[..., 1]
        row, column = np.unravel_index(np.argmax(shown), shown.shape)
        assert normals(65)[row, column] == pytest.approx(towards(40.0, 150.0), abs=0.05)


def test_the_sky_is_an_integral_over_the_hemisphere() -> None:
    """Of the formula of the environment, at three normals, by another rule: within 1 %."""
    size = 33
    found = fm.render(LAMBERT, "sky", size=size).radiance
    cos, turn = np.meshgrid((np.arange(300) + 0.5) / 300, 2.0 * np.pi * (np.arange(600) + 0.5) / 600)
    sin = np.sqrt(1.0 - cos**2)
    wi = np.stack([sin * np.cos(turn), sin * np.sin(turn), cos], axis=-1).reshape(-1, 3)
    for row, column in ((16, 16), (6, 16), (24, 10)):
        axes = scene.tangents(normals(size)[row, column][None])[0]
        irradiance = np.mean(scene.radiance(wi @ axes) * wi[:, 2]) * 2.0 * np.pi
        assert found[row, column] == pytest.approx(KD / np.pi * irradiance, rel=0.01)


def test_a_picture_is_what_it_says(tmp_path: Path) -> None:
    """sRGB of the exposed radiance, transparent beside the ball, mean luminance 0.18; the linear file unexposed."""
    found = fm.render(LAMBERT, "front", size=32)
    luminance = found.radiance @ [0.2126, 0.7152, 0.0722]
    assert (found.exposure * luminance)[luminance > 0].mean() == pytest.approx(0.18, rel=1e-3)
    shown = np.asarray(Image.open(io.BytesIO(found.png()))).astype(float) / 255.0
    linear = np.clip(found.exposure * found.radiance, 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    assert shown[..., :3] == pytest.approx(encoded, abs=0.003)
    assert shown[0, 0, 3] == 0.0
    assert shown[16, 16, 3] == 1.0
    assert found._repr_png_() == found.png()
    assert "20° from the viewer at 120°" in str(found)
    picture, beside = fm.render(LAMBERT, "front", size=32, exposure=2.0).save(tmp_path / "sub" / "ball.png", hdr=True)
    assert picture.read_bytes().startswith(b"\x89PNG")
    stored = OpenEXR.File(str(beside)).channels()["RGBA"].pixels
    assert stored[..., :3] == pytest.approx(found.radiance * found.opacity[..., None], rel=1e-5)
    assert fm.render(LAMBERT, "front", size=32, exposure=2.0).exposure == 2.0


def test_a_run_and_a_model_are_drawn_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = Fitted("lambert", LAMBERT, ("b", "g", "r"), (), "", "", (), tmp_path)
    result = Result(tmp_path, {"file": "paint", "choice": None, "fits": []}, (one,))
    monkeypatch.setattr("fitmat.cli.render.load", lambda _: result)
    options: dict[str, Any] = {"model": None, "size": 16, "exposure": None}
    told: list[str] = []

    def say(what: str, done: int, total: int) -> None:
        told.append(what)

    run = drawn(str(tmp_path), [], None, ["30,250"], say, **options)
    named = drawn("lambert", ["kd=0.1,0.3,0.6"], None, ["30,250"], say, **options)
    assert run.radiance == pytest.approx(named.radiance)
    assert run.radiance[8, 8] == pytest.approx(fm.render(LAMBERT, (30.0, 250.0), size=16).radiance[8, 8, ::-1])
    with pytest.raises(FitmatError, match=r"--set beside the run .* Leave it out, or name a model"):
        drawn(str(tmp_path), ["kd=0.1"], None, [], say, **options)
    with pytest.raises(FitmatError, match="--model beside lambert, which is no run's folder"):
        drawn("lambert", [], None, [], say, **options | {"model": "ggx"})
    assert told == [f"drawing {tmp_path}", "drawing lambert"]


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"light": "moon"}, "light is 'moon', expected one of front, side, rim, sky, or two angles in degrees"),
        ({"light": (200.0, 3.0)}, r"light is \(200.0, 3.0\), expected one of"),
        ({"light": []}, r"light is \[\], expected one of"),
        ({"light": 3}, "light is 3, expected"),
        ({"size": 5}, "size is 5, expected a whole number of at least 16"),
        ({"size": 9999}, "size is 9999, expected at most 512 pixels"),
        ({"exposure": 0.0}, "exposure is 0.0, expected a factor above 0"),
        ({"material": "ggx"}, "material is the text 'ggx', expected"),
        ({"material": fm.model("lambert+ggx-walk")}, "ggx-walk is estimated and has no formula to draw it with"),
    ],
)
def test_bad_input_is_a_sentence(given: dict[str, Any], sentence: str) -> None:
    with pytest.raises(FitmatError, match=sentence):
        fm.render(**{"material": LAMBERT, **given})


def test_what_cannot_be_written_is_refused_before_any_work(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"ball\.svg: no picture, expected a name that ends in \.png"):
        refuse(tmp_path / "ball.svg", hdr=False, force=True)
    (tmp_path / "ball.exr").touch()
    refuse(tmp_path / "ball.png", hdr=False, force=False)
    with pytest.raises(OutputError, match=r"ball\.exr: already exists; choose another name, or --force"):
        refuse(tmp_path / "ball.png", hdr=True, force=False)
    with pytest.raises(OutputError, match=r"cannot be written .* choose another place"):
        fm.render(LAMBERT, "front", size=16).save("/dev/null/ball.png")
