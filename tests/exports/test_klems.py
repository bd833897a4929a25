"""A Klems matrix holds means over patches, in the order and the directions in which Radiance reads them."""

import json
import xml.etree.ElementTree as ElementTree
from typing import Any

import numpy as np
import pytest
from test_radiance import rtrace

import fitmat as fm
from fitmat.errors import ModelError
from fitmat.exports import klems, radiance
from fitmat.exports.material import Chosen

SPACE = "{http://windows.lbl.gov}"
BRUSHED: dict[str, Any] = {"alpha_x": 0.2, "alpha_y": 0.6, "rotation": 20.0}


def projected() -> np.ndarray:
    """Projected solid angles of the patches, sr."""
    return np.concatenate(
        [
            np.full(n, np.pi / n * (np.cos(np.deg2rad(low)) ** 2 - np.cos(np.deg2rad(high)) ** 2))
            for low, high, n in klems.RINGS
        ]
    )


def centres() -> np.ndarray:
    return klems._patches(np.array([[0.5, 0.5]]))[:, 0]


def test_patches_are_the_full_basis() -> None:
    """145 of them, as WINDOW's manual lists: zenith angles, and the first azimuth in the middle of its patch."""
    assert klems.COUNT == 145
    assert projected().sum() == pytest.approx(np.pi)
    assert [low for low, _, _ in klems.RINGS] == [0, 5, 15, 25, 35, 45, 55, 65, 75]
    w = centres()
    azimuth = np.rad2deg(np.arctan2(w[:, 1], w[:, 0])) % 360.0
    assert np.allclose(azimuth[1:9], np.arange(0.0, 360.0, 45.0), atol=1e-9)
    assert np.allclose(azimuth[-12:], np.arange(0.0, 360.0, 30.0), atol=1e-9)
    theta = np.rad2deg(np.arccos(w[:, 2]))
    assert np.all((theta[-12:] > 75.0) & (theta[-12:] < 90.0))


@pytest.mark.study
def test_values_are_means_over_patches() -> None:
    """Beside a fine grid in both, and for light near the mirror direction, which has the incident patch's number."""
    model = fm.model("lambert+ggx", kd=0.3, alpha=0.3)
    found = klems.translated(Chosen(model))[0]
    places = (np.arange(24) + 0.5) / 24
    grid = np.stack([a.ravel() for a in np.meshgrid(places, places)], axis=1)
    every = klems._patches(grid)
    for i, o in ((0, 0), (40, 40), (40, 52), (100, 101), (30, 100)):
        wi, wo = every[i] * [-1.0, -1.0, 1.0], every[o]
        rows = [fm.evaluate(model, np.tile(w, (len(wo), 1)), wo)[:, 0].mean() for w in wi[::7]]
        assert found[o, i] == pytest.approx(np.mean(rows), rel=0.02)
    assert found[50, 50] > 1.5 * found[50 + 12, 50]  # half a turn away light goes back where it came from


@pytest.mark.study
def test_radiance_reads_the_entries(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a brushed surface, at the patches' centres; with the incident azimuths turned they are others."""
    rtrace()
    monkeypatch.setattr(klems, "SAMPLES", 64)
    matrix = klems.translated(Chosen(fm.model("lambert+ggx-aniso", **BRUSHED)))[0]
    i, o = np.random.default_rng(0).integers(klems.COUNT, size=(2, 1000))
    w = centres()
    values, executor = klems.looked_up(matrix, w[i] * [-1.0, -1.0, 1.0], w[o])
    assert executor.startswith("Radiance")
    assert np.abs(values[:, 0] / matrix[o, i] - 1.0).max() < 2e-3
    turned, _ = klems.looked_up(matrix, w[i], w[o])
    assert np.abs(turned[:, 0] / matrix[o, i] - 1.0).max() > 0.5


def parts(text: str) -> list[ElementTree.Element]:
    return list(ElementTree.fromstring(text).iter(f"{SPACE}WavelengthDataBlock"))


def test_the_file_is_what_lbnl_describes(monkeypatch: pytest.MonkeyPatch) -> None:
    """A matrix for each side, 145 rows of 145; of white paper all are kd/π, and what it reflects is kd."""
    monkeypatch.setattr(klems, "SAMPLES", 2)
    monkeypatch.setattr(radiance, "program", lambda: None)
    name = "it's \"é*/ --> ]]> <Layer> & </WindowElement>\\ \n\u202e\ud800"
    made = fm.export(fm.model("lambert", kd=np.array([0.5, 0.2, 0.1])), "klems", name=name, strict=True)
    assert len(made.files) == 4
    assert "Not executed here." in next(iter(made.files.values()))
    for text, kd in zip(made.files.values(), (0.5, 0.2, 0.1), strict=False):
        assert text.isascii()
        assert [part.findtext(f"{SPACE}WavelengthDataDirection") for part in parts(text)] == [
            "Reflection Front",
            "Reflection Back",
        ]
        for part in parts(text):
            rows = str(part.findtext(f"{SPACE}ScatteringData")).split("\n")[1:-1]
            matrix = np.array([[float(x) for x in row.rstrip(",").split(",")] for row in rows])
            assert matrix.shape == (145, 145)
            assert np.allclose(projected() @ matrix, kd, rtol=1e-5)
    assert json.loads(made.files["export.json"])["name"] == name


def test_a_narrow_highlight_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(klems, "SAMPLES", 1)
    with pytest.raises(ModelError, match=r"The highlight of ggx \(slope 0\.05\) is narrower than Klems's patches"):
        fm.export(fm.model("ggx", alpha=0.05), "klems", strict=True)


def test_reciprocal_models_are_the_same_both_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(klems, "SAMPLES", 1)
    found = klems.translated(Chosen(fm.model("ggx", alpha=0.3)))[0]
    assert np.array_equal(found, found.T)
