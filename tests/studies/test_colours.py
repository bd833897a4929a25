"""The colour of a fitted material against colour-science and against quantiles by hand; what has no colour."""

from pathlib import Path
from types import ModuleType
from typing import Any

import matplotlib.image
import numpy as np
import polars as pl
import pytest

import fitmat as fm
from fitmat.cli import colour
from fitmat.colour import observers
from fitmat.errors import FitmatError
from fitmat.fitting.coordinates import channel_names
from fitmat.models.parameters import entries
from fitmat.reports import colour_plot
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


def gaussian(folder: Path, best: np.ndarray, covariance: np.ndarray) -> Fitted:
    """Lambert's model in r, g, b whose draws have exactly that mean and covariance, and are as Gaussian as chance."""
    z = np.random.default_rng(2).standard_normal((1000, 3))
    z = (z - z.mean(axis=0)) @ np.linalg.inv(np.linalg.cholesky(np.cov(z.T))).T
    draws = best + z @ np.linalg.cholesky(covariance).T
    fitted = lambert(folder, ("r", "g", "b"), best, np.ones(1))
    labels = channel_names(entries(fitted.model)[0], ("r", "g", "b"))
    pl.DataFrame(draws, schema=list(labels), orient="row").write_parquet(folder / "posterior-lambert.parquet")
    return fitted


def test_of_a_gaussian_posterior_the_ellipse_has_a_closed_form(tmp_path: Path) -> None:
    """a* = 500 (f(X/X_n) − f(Y/Y_n)), f = ∛: J Σ Jᵀ times χ²₂(0.95) = −2 ln 0.05, small errors being linear.

    The size is a quantile of 1000 draws: four standard errors of it, √(0.05 · 0.95/1000)/(p(r)), r = 2.448, are 9 %.
    """
    best, covariance = np.array([0.4, 0.2, 0.1]), 1e-8 * np.array([[4.0, 1.0, 0.0], [1.0, 2.0, -0.5], [0.0, -0.5, 1.0]])
    matrix = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    xyz, white = matrix @ best, observers.white()
    slope = matrix / (3.0 * np.cbrt(xyz**2 * white))[:, None]
    jacobian = np.array([500.0 * (slope[0] - slope[1]), 200.0 * (slope[1] - slope[2])])
    expected = -2.0 * np.log(0.05) * jacobian @ covariance @ jacobian.T
    found = colour_of(gaussian(tmp_path, best, covariance))
    assert found.ellipse is not None
    shape = found.ellipse.axes.T @ found.ellipse.axes
    np.testing.assert_allclose(shape / np.trace(shape), expected / np.trace(expected), atol=1e-3)
    np.testing.assert_allclose(np.trace(shape), np.trace(expected), rtol=0.18)
    np.testing.assert_allclose(found.ellipse.centre, found.lab[1:], atol=1e-4)
    inside = np.linalg.solve(shape, (found.draws[:, 1:] - found.ellipse.centre).T)
    held = np.sum(inside * (found.draws[:, 1:] - found.ellipse.centre).T, axis=0) <= 1.0 + 1e-9
    assert held.mean() == pytest.approx(0.95, abs=2e-3)
    assert "a* and b* together: an ellipse of ±" in found.sentence


def test_of_a_gaussian_grey_the_radius_has_a_closed_form(tmp_path: Path) -> None:
    """One direction, lightness: 1.96 sd of L* over CIEDE2000's S_L; its error at 1000 draws 9 %, as above."""
    sd, y = 1e-4, 0.3
    found = colour_of(gaussian(tmp_path, np.full(3, y), np.full((3, 3), sd**2) + 1e-14 * np.eye(3)))
    away = (116.0 * np.cbrt(y) - 16.0 - 50.0) ** 2
    s_l = 1.0 + 0.015 * away / np.sqrt(20.0 + away)
    assert found.delta_e_95 == pytest.approx(1.96 * 116.0 / 3.0 * y ** (-2.0 / 3.0) * sd / s_l, rel=0.12)


def test_one_channel_is_a_grey_under_every_light(tmp_path: Path) -> None:
    """L* = 116 ∛0.2 − 16 = 51.8; of a hue nothing is said, and there is no ellipse."""
    file = tmp_path / "posterior-lambert.parquet"
    pl.DataFrame({"kd": 0.2 * FACTORS}).write_parquet(file)
    one = Fitted("lambert", fm.model("lambert", kd=0.2), ("value",), (), "converged", "reliable", (), file)
    for light in ("D65", "A"):
        found = colour_of(one, illuminant=light)
        assert found.grey
        assert found.ellipse is None
        assert found.lab == pytest.approx([116.0 * np.cbrt(0.2) - 16.0, 0.0, 0.0], abs=1e-6)
        assert "a grey: L* 51.8 (" in found.sentence
        assert "a*" not in found.sentence


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
        (("a", "b"), {}, r"channels a, b: no colour under D65 is known"),
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
    with pytest.raises(FitmatError, match=r"--plot beside --energy, of which there is no picture"):
        colour.show(str(tmp_path / "run"), None, "D65", tmp_path / "a.png", force=False, energy=True)
    colour.show(str(tmp_path / "run"), None, "D65", tmp_path / "a.png", force=False)
    assert matplotlib.image.imread(tmp_path / "a.png").std() > 0.05
    with pytest.raises(FitmatError, match="already exists; choose another name, or --force"):
        colour.show(str(tmp_path / "run"), None, "D65", tmp_path / "a.png", force=False)


def test_the_picture_shows_every_draw_and_the_ellipse(spectral: Fitted, tmp_path: Path) -> None:
    found = colour_of(gaussian(tmp_path, np.array([0.4, 0.2, 0.1]), 1e-6 * np.eye(3)))
    plane, beside = colour_plot.colours([found]).axes
    dots, outline, best = (np.stack(line.get_data()) for line in plane.get_lines())
    np.testing.assert_array_equal(dots.T, found.draws[:, 1:])
    np.testing.assert_array_equal(best.ravel(), found.lab[1:])
    assert found.ellipse is not None
    away = np.linalg.solve(found.ellipse.axes.T, outline - found.ellipse.centre[:, None])
    np.testing.assert_allclose(np.hypot(*away), 1.0, rtol=1e-9)
    with pytest.raises(FitmatError, match="found is no colour, expected colours of several channels"):
        colour_plot.colours([])
    np.testing.assert_array_equal(beside.get_lines()[0].get_ydata(), found.lab_ci95[0])
