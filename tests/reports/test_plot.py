"""Pictures of a study and of a run: what is drawn is what was found; a file for a paper has its numbers beside it."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from typer.testing import CliRunner

import fitmat as fm
from fitmat.cli.application import app
from fitmat.errors import FitmatError
from fitmat.maths.directions import from_angles
from fitmat.reports import paper, plot
from fitmat.reports.drawn import KINDS
from fitmat.studies.study import Study

NAMES = ["lambert+blinn-phong", "lambert+ggx"]

DIGITS = 1e-4
"""Relative; what is drawn has five significant digits."""


@pytest.fixture(scope="module")
def studied() -> Study:
    """Three channels, one value of which is masked."""
    truth = fm.model("lambert+ggx", channels=3, kd=np.array([0.4, 0.2, 0.1]), alpha=0.3, eta=1.5)
    theta_o = np.deg2rad(np.arange(-80.0, 81.0, 10.0))
    noise = {"relative_noise": 0.02, "absolute_noise": 1e-3, "seed": 1}
    m = fm.simulate(truth, np.deg2rad([20.0, 45.0, 70.0]), theta_o, channels=("r", "g", "b"), **noise)
    valid = m.valid.copy()
    valid[0, 1] = False
    return fm.study(dataclasses.replace(m, valid=valid), NAMES, sampling=False)


@pytest.fixture(scope="module")
def run(studied: Study, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plot") / "run"
    fm.report(studied, folder)
    return folder


def labelled(ax: Axes) -> dict[str, np.ndarray]:
    """The lines that have a label, as (n, 2) points."""
    lines = {str(line.get_label()): np.asarray(line.get_xydata()) for line in ax.lines}
    return {label: points for label, points in lines.items() if not label.startswith("_")}


@pytest.mark.parametrize(("channel", "place", "count"), [("r", 0, 17), (1, 1, 16)])
def test_curves_show_every_valid_point_and_every_fit(
    studied: Study, channel: str | int, place: int, count: int
) -> None:
    section = studied.findings[0].curves[0].section
    figure = plot.curves(studied, channel=channel)
    assert [ax.get_title() for ax in figure.axes] == ["incidence 20°", "incidence 45°", "incidence 70°"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [*NAMES, "measured"]
    ax = figure.axes[0]
    lines = labelled(ax)
    measured = studied.measurements.value[section.rows[-count:], place]
    np.testing.assert_allclose(lines["measured"][:, 1], measured, rtol=DIGITS)
    assert ax.get_xlabel() == "θₒ / °  (positive = mirror side)"
    assert ax.get_ylabel() == "BRDF / sr⁻¹"
    assert ax.get_xlim() == (-90, 90)
    low, high = ax.get_ylim()
    assert low <= measured.min()
    assert measured.max() < high < 10 * measured.max()


def test_curves_follow_the_mirror_direction(studied: Study) -> None:
    """The dotted grey line stands at theta_o = theta_i, and the fit is brighter on that side."""
    ax = plot.curves(studied).axes[1]
    (mirror,) = (line for line in ax.lines if line.get_linestyle() == ":" and line.get_color() == "0.75")
    assert np.asarray(mirror.get_xdata()) == pytest.approx(45.0)
    curve = labelled(ax)["lambert+ggx"]
    assert np.all(np.diff(curve[:, 0]) >= 0)
    at = np.interp([-45, 45], *curve.T)
    assert at[1] > 1.1 * at[0]


def test_a_band_that_would_flood_the_picture_is_outlined(studied: Study) -> None:
    doubtful = [found.name for found in studied.findings if found.doubts.inadequate]
    ax = plot.curves(studied).axes[0]
    assert doubtful == ["lambert+blinn-phong"]
    assert len(ax.collections) == 1  # the band of the other


def test_decades_are_drawn_on_a_logarithmic_axis(studied: Study) -> None:
    found = studied.findings[1]
    m, section = studied.measurements, found.curves[0].section
    value = m.value.copy()
    value[section.rows[0], 0] *= 1e3
    fit = dataclasses.replace(found.fit, measurements=dataclasses.replace(m, value=value))
    steep = dataclasses.replace(found, posterior=dataclasses.replace(found.posterior, fit=fit))
    assert plot.curves(Study((found,))).axes[0].get_yscale() == "linear"
    ax = plot.curves(Study((steep,))).axes[0]
    assert ax.get_yscale() == "log"
    assert ax.get_ylim()[1] > value[section.rows, 0].max()


@pytest.mark.parametrize(("channel", "count"), [(0, 51), (1, 50)])
def test_residuals_show_every_valid_sample(studied: Study, channel: int, count: int) -> None:
    figure = plot.residuals(studied, channel=channel)
    ax = next(ax for ax in figure.axes if ax.get_title() == "lambert+ggx")
    points = next(c for c in ax.collections if isinstance(c, PathCollection))
    z = np.asarray(points.get_offsets())[:, 1]
    assert len(z) == count
    assert 0.6 < z.std() < 1.4  # standardised: about one, for a model that is right and 50 samples
    assert set(np.round(np.asarray(points.get_array()), 6)) == {20.0, 45.0, 70.0}
    assert ax.get_ylabel() == "residual / standard deviations"
    assert figure.axes[-1].get_ylabel() == "θᵢ / °"


def test_albedo_and_distance_are_those_of_the_match(studied: Study) -> None:
    match = studied.match
    assert match is not None
    (ax,) = plot.albedo(studied).axes
    lines = labelled(ax)
    assert list(lines) == NAMES
    np.testing.assert_allclose(lines[NAMES[1]][:, 1], match.albedo_microfacet[1], rtol=DIGITS)
    assert ax.get_ylim()[0] == 0
    (ax,) = plot.distances(studied).axes
    lines = labelled(ax)
    np.testing.assert_allclose(lines["all directions"][:, 1], match.distances.by_incidence["relative"][1], rtol=DIGITS)
    np.testing.assert_allclose(lines["all directions"][:, 0], np.rad2deg(match.distances.theta_i), rtol=DIGITS)


def test_corner_shows_free_parameters_only(studied: Study) -> None:
    """Those that all channels share, and those of the channel in the middle."""
    figure = plot.corner(studied)
    assert isinstance(figure, Figure)
    assert [ax.get_xlabel() for ax in figure.axes[-4:]] == ["$k_d$ g", "$k_s$ g", "α", "η"]
    held = fm.study(studied.measurements, "lambert+ggx", fixed={"ks": 1.0, "eta": 1.5, "kd": 0.2}, sampling=False)
    (ax,) = plot.corner(held).axes
    assert ax.get_xlabel() == "α"
    best = held.findings[0].fit["alpha"].value[0]
    assert any(np.asarray(line.get_xdata())[0] == pytest.approx(best, rel=DIGITS) for line in ax.lines)


def test_corner_of_constant_draws(studied: Study) -> None:
    """A chain that never moved is drawn, not refused."""
    found = studied.findings[1]
    posterior = dataclasses.replace(found.posterior, drawn=np.repeat(found.posterior.drawn[:1], 100, axis=0))
    assert len(plot.corner(Study((dataclasses.replace(found, posterior=posterior),))).axes) == 4**2


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_on_disk_is_drawn_as_its_study(kind: str, studied: Study, run: Path, tmp_path: Path) -> None:
    """The same numbers beside both, and a picture of the width that was asked for."""
    both = [paper.save(what, tmp_path / f"{k}.svg", kind) for k, what in enumerate((studied, fm.load(run)))]
    tables = [numbers.read_text(encoding="utf-8") for _, numbers in both]
    assert tables[0] == tables[1]
    assert len(pl.read_csv(both[0][1])) > 30
    text = both[1][0].read_text(encoding="utf-8")
    (width,) = re.findall(r'<svg [^>]*?width="([\d.]+)pt"', text)
    assert float(width) == pytest.approx(84.0 / 25.4 * 72.0, abs=0.01)
    assert "<text" not in text  # letters are outlines: no font is asked for


def test_the_numbers_beside_a_picture_are_those_in_it(studied: Study, tmp_path: Path) -> None:
    _, numbers = paper.save(studied, tmp_path / "a.png", "curves", channel="g")
    table = pl.read_csv(numbers)
    assert set(table["series"]) == {"measured", *NAMES, *(f"{name}, band" for name in NAMES)}
    section = studied.findings[0].curves[0].section
    first = table.filter(pl.col("series") == "measured", pl.col("theta_i") == 20.0)
    expected = np.where(studied.measurements.valid, studied.measurements.value, np.nan)[section.rows, 1]
    np.testing.assert_allclose(first["value"].cast(float).to_numpy(), expected, rtol=DIGITS)


def test_lobes_go_around_the_normal_with_the_cube_root_as_radius(studied: Study) -> None:
    figure = plot.lobes(studied, channel="g")
    assert len(figure.axes) == 3
    section, m = studied.findings[1].curves[1].section, studied.measurements
    points = labelled(figure.axes[1])
    np.testing.assert_allclose(points["measured"][:, 0], section.theta_o, rtol=DIGITS, atol=DIGITS)
    np.testing.assert_allclose(points["measured"][:, 1] ** 3, m.value[section.rows, 1], rtol=3 * DIGITS)
    angle, radius = points["lambert+ggx"].T
    wi = from_angles(np.full(len(angle), section.theta_i), np.zeros(len(angle)))
    found = fm.evaluate(studied.findings[1].fit.model, wi, from_angles(np.abs(angle), np.where(angle > 0, np.pi, 0.0)))
    np.testing.assert_allclose(radius**3, found[:, 1], rtol=0.02)  # straight lines between points that are kept


def test_a_slice_is_the_models_value_at_half_vector_and_difference(studied: Study, tmp_path: Path) -> None:
    """A cell against fm.evaluate of directions built from θ_h and θ_d; a point against what was measured there."""
    _, numbers = paper.save(studied, tmp_path / "a.png", "slice", channel="b")
    cells = pl.read_csv(numbers, infer_schema_length=None).filter(pl.col("model") == "lambert+ggx")
    at = cells.filter(pl.col("theta_h") == 12.5, pl.col("theta_d") == 40.5)
    h = np.deg2rad(12.5)
    wi, wo = (np.array([[np.sin(h + s), 0.0, np.cos(h + s)]]) for s in np.deg2rad([-40.5, 40.5]))
    model = studied.findings[1].fit.model
    assert at["value"].item() == pytest.approx(fm.evaluate(model, wi, wo)[0, 2], rel=DIGITS)
    points, m = cells.filter(pl.col("measured_over_fitted").is_not_null()), studied.measurements
    expected = (m.value / fm.evaluate(model, m.wi, m.wo))[:, 2]
    np.testing.assert_allclose(np.sort(points["measured_over_fitted"]), np.sort(expected), rtol=3 * DIGITS)
    assert cells.filter(pl.col("value").is_not_null())["theta_h"].len() == 89 * 90 // 2  # θ_h + θ_d < 90°


def test_coverage_shows_every_geometry_once(studied: Study) -> None:
    """Angles of half vector and difference by the formulas of the plane: half the sum and half the difference."""
    found = plot.coverage(studied).axes[0].collections[0].get_offsets()
    m = studied.measurements
    light, sensor = np.rad2deg(m.theta_i), np.rad2deg(m.signed_theta_o)
    expected = np.stack([np.abs(sensor - light), np.abs(sensor + light)], axis=1) / 2
    assert sorted(map(tuple, np.round(np.asarray(found), 3))) == sorted(map(tuple, np.round(expected, 3)))


def test_what_cannot_be_drawn_is_said(studied: Study, run: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    with pytest.raises(FitmatError, match=r"channel is the text 'red', expected one of r, g, b, or its place from 0"):
        paper.save(studied, path, channel="red")
    with pytest.raises(FitmatError, match=r"no draws of ggx; lambert\+blinn-phong, lambert\+ggx has some"):
        paper.save(studied, path, "corner", model="ggx")
    with pytest.raises(FitmatError, match=r"kind is the text 'lobe', expected 'curves' or"):
        paper.save(studied, path, "lobe")
    with pytest.raises(FitmatError, match=r"width_mm is 5000\.0, expected a number from 40 to 500"):
        paper.save(studied, path, width_mm=5000.0)
    with pytest.raises(FitmatError, match=r"no match to draw, expected an empirical and a microfacet model"):
        paper.save(Study(studied.findings[:1]), tmp_path / "b.svg", "match")
    with pytest.raises(FitmatError, match=r"what is the text .*, expected a Study, from fitmat\.study"):
        plot.curves(str(run))  # pyright: ignore[reportArgumentType]
    (tmp_path / "c.csv").write_text("mine", encoding="utf-8")
    with pytest.raises(FitmatError, match=r"c\.csv: already exists; choose another name, or --force"):
        paper.save(studied, tmp_path / "c.svg")
    assert not (tmp_path / "c.svg").exists()


def test_the_command_says_what_it_draws_before_it_does(run: Path, tmp_path: Path) -> None:
    """On stderr; on stdout are the files alone."""
    ended = CliRunner().invoke(app, ["plot", str(run), "--out", str(tmp_path / "a.svg")])
    assert ended.exit_code == 0, ended.output
    assert ended.stderr.splitlines()[0] == "Drawing curves."
    assert ended.stdout.splitlines() == [str(tmp_path / "a.svg"), str(tmp_path / "a.csv")]
