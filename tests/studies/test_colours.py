"""The colour of a fitted material against colour-science and against quantiles by hand; what has no colour."""

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import polars as pl
import pytest

import fitmat as fm
from fitmat.cli import colour
from fitmat.colour import observers
from fitmat.errors import FitmatError
from fitmat.fitting.coordinates import channel_names
from fitmat.models.parameters import entries
from fitmat.studies.colours import colour_of
from fitmat.studies.result import Fitted

NM = np.arange(390.0, 731.0, 5.0)
KD = 0.2 + 0.3 * np.exp(-(((NM - 600.0) / 50.0) ** 2))
FACTORS = np.exp(np.random.default_rng(1).normal(0.0, 0.05, 4000))


def lambert(folder: Path, names: tuple[str, ...], kd: np.ndarray, factors: np.ndarray | None) -> Fitted:
    """Lambert's model of a run whose draws are the best fit times so much."""
    file = folder / "posterior-lambert.parquet"
    model = fm.model("lambert", channels=len(names), kd=kd)
    if factors is not None:
        labels = channel_names(entries(model)[0], names)
        pl.DataFrame(np.outer(factors, kd), schema=list(labels), orient="row").write_parquet(file)
    return Fitted("lambert", model, names, (), "converged", "reliable", (), file)


@pytest.fixture
def spectral(tmp_path: Path) -> Fitted:
    return lambert(tmp_path, tuple(f"{nm:g}" for nm in NM), KD, FACTORS)


@pytest.mark.parametrize(("illuminant", "observer"), [("D65", "2"), ("A", "10")])
def test_a_colour_is_that_of_colour_science(
    science: ModuleType, spectral: Fitted, illuminant: str, observer: str
) -> None:
    """Lambert's reflectance is kd, linear between its wavelengths, held beyond."""
    long = {"2": "CIE 1931 2 Degree Standard Observer", "10": "CIE 1964 10 Degree Standard Observer"}[observer]
    nm, power = observers.wavelengths(), science.SDS_ILLUMINANTS[illuminant]
    lit = np.interp(nm, power.wavelengths, power.values, left=0.0, right=0.0) * science.MSDS_CMFS[long].values.T
    xyz, white = (lit @ spectrum / lit[1].sum() for spectrum in (np.interp(nm, NM, KD), np.ones(len(nm))))
    found = colour_of(spectral, illuminant=illuminant, observer=observer)
    np.testing.assert_allclose(found.xyz, xyz, rtol=1e-9)
    np.testing.assert_allclose(found.lab, science.XYZ_to_Lab(xyz, science.XYZ_to_xy(white)), rtol=1e-6, atol=1e-6)


def test_intervals_are_those_of_the_draws(spectral: Fitted) -> None:
    """L* = 116 (gY)^⅓ − 16 grows with the factor g, a* and b* like g^⅓: their quantiles are those of g."""
    found = colour_of(spectral)
    root = np.quantile(FACTORS[::4], [0.025, 0.975]) ** (1.0 / 3.0)
    np.testing.assert_allclose(found.lab_ci95[0], (found.lab[0] + 16.0) * root - 16.0, rtol=1e-3)
    for k in (1, 2):
        np.testing.assert_allclose(found.lab_ci95[k], np.sort(found.lab[k] * root), rtol=1e-3)
    assert 0.5 < found.delta_e_95 < 5.0
    assert "95 % of what the data allow is within ΔE2000" in found.sentence


def test_a_grey_is_grey_and_red_is_red(tmp_path: Path) -> None:
    """r, g and b are linear sRGB; without draws nothing is said of how sure it is."""
    red = colour_of(lambert(tmp_path, ("r", "g", "b"), np.array([1.0, 0.0, 0.0]), None))
    assert red.srgb == "#ff0000"
    assert np.isnan(red.delta_e_95)
    assert "no draws tell how sure" in red.sentence
    lamp = colour_of(lambert(tmp_path, tuple(f"{nm:g}" for nm in NM), np.full(len(NM), 0.5), None), illuminant="A")
    np.testing.assert_allclose(lamp.lab, [116.0 * 0.5 ** (1.0 / 3.0) - 16.0, 0.0, 0.0], atol=1e-6)
    assert lamp.srgb[1:3] == lamp.srgb[3:5] == lamp.srgb[5:7]


@pytest.mark.parametrize(
    ("names", "given", "words"),
    [
        (("r", "g", "b"), {"illuminant": "A"}, r"channels r, g, b: no colour under A is known, expected wavelengths"),
        (("value",), {}, r"channels value: no colour under D65 is known"),
        (("450", "550", "650"), {}, r"450 to 650 nm do not cover what an eye sees: no colour under D65"),
        (("r", "g", "b"), {"illuminant": "D64"}, r"illuminant is the text 'D64', expected 'D65'"),
        (("r", "g", "b"), {"theta_i": 45.0}, r"theta_i = 45: expected 0 to π/2 radians"),
        (("r", "g", "b"), {"theta_o": np.nan}, r"theta_o is nan, expected a number"),
    ],
)
def test_what_has_no_colour_is_refused(tmp_path: Path, names: tuple[str, ...], given: Any, words: str) -> None:
    with pytest.raises(FitmatError, match=words):
        colour_of(lambert(tmp_path, names, np.full(len(names), 0.5), None), **given)


def test_the_command_says_the_colours_of_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = fm.model("lambert", channels=3, kd=np.array([0.5, 0.2, 0.1]))
    angles = np.deg2rad([20.0, 50.0]), np.deg2rad(np.arange(-60.0, 61.0, 20.0))
    m = fm.simulate(truth, *angles, relative_noise=0.02, absolute_noise=1e-3, seed=1, channels=("r", "g", "b"))
    fm.report(fm.study(m, "lambert", sampling=False, short=True), tmp_path / "run")
    colour.show(str(tmp_path / "run"), None, "D65", None, force=False)
    out = " ".join(capsys.readouterr().out.split())
    assert "lambert under daylight at noon (D65): L* 5" in out
    assert "95 % of what the data allow" in out
    assert "On a display: #b" in out  # 0.5 is 188 of 255 in sRGB
    colour.show(str(tmp_path / "run"), None, "D65", None, force=False, energy=True)
    assert "lambert: no single isotropic lobe of facets." in capsys.readouterr().out
    with pytest.raises(FitmatError, match=r"--energy without a run, expected its folder"):
        colour.show("Au", None, "D65", None, force=False, energy=True)
    with pytest.raises(FitmatError, match=r"--plot beside the run .*, expected it with a material"):
        colour.show(str(tmp_path / "run"), None, "D65", tmp_path / "a.png", force=False)
