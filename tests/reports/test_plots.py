"""What was drawn: numbers of points and lines, labels, limits; never pixels."""

import dataclasses
import math

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

import fitmat
from fitmat.match.match import Match
from fitmat.models.simulation import simulate
from fitmat.reports import plot
from fitmat.studies.study import Study, study

NAMES = ["lambert+blinn-phong", "lambert+ggx"]


@pytest.fixture(scope="module")
def studied() -> Study:
    """Three channels, three incidences, 17 directions each; the first row of green is masked."""
    truth = fitmat.model("lambert+ggx", channels=3, kd=np.array([0.4, 0.1, 0.2]), alpha=0.3)
    angles = np.deg2rad([20, 45, 70]), np.deg2rad(np.arange(-80, 81, 10))
    made = simulate(truth, *angles, relative_noise=0.02, absolute_noise=1e-3, seed=1)
    valid = made.valid.copy()
    valid[0, 1] = False
    made = dataclasses.replace(made, valid=valid)
    return study(made, NAMES, sampling=False)


@pytest.fixture
def match(studied: Study) -> Match:
    assert studied.match is not None
    return studied.match


def labelled(ax: Axes) -> dict[str, np.ndarray]:
    """The lines that have a label, as (n, 2) points."""
    return {
        str(line.get_label()): np.asarray(line.get_xydata())
        for line in ax.lines
        if not str(line.get_label()).startswith("_")
    }


@pytest.mark.parametrize(("channel", "count"), [(0, 17), (1, 16)])
def test_section_shows_every_valid_point_and_every_fit(studied, channel, count):
    section = studied.findings[0].curves[0].section
    own = plot.new_axes()
    ax = plot.section(studied, 0, channel=channel, ax=own)
    assert ax is own
    lines = labelled(ax)
    assert list(lines) == [*NAMES, "measured"]
    assert len(lines["measured"]) == count
    rows = section.rows[-count:]
    measured = studied.measurements.value[rows, channel]
    np.testing.assert_array_equal(lines["measured"][:, 1], measured)
    assert len(ax.collections) == 2  # one band for each fit
    assert ax.get_title() == "incidence 20°"
    assert ax.get_xlabel() == "θₒ / °  (positive = mirror side)"
    assert ax.get_ylabel() == "BRDF / sr⁻¹"
    assert ax.get_xlim() == (-90, 90)
    low, high = ax.get_ylim()
    assert low <= measured.min()
    assert measured.max() < high < 10 * measured.max()


def test_section_follows_the_mirror_direction(studied):
    """The dotted line stands at theta_o = theta_i, and the fit is brighter on that side."""
    ax = plot.section(studied, 1)
    (mirror,) = (line for line in ax.lines if line.get_linestyle() == ":")
    assert np.asarray(mirror.get_xdata()) == pytest.approx(45.0)
    curve = labelled(ax)["lambert+ggx"]
    assert np.all(np.diff(curve[:, 0]) >= 0)
    at = np.interp([-45, 45], *curve.T)
    assert at[1] > 1.1 * at[0]


def test_decades_are_drawn_on_a_logarithmic_axis(studied):
    found = studied.findings[1]
    m, section = studied.measurements, found.curves[0].section
    value = m.value.copy()
    value[section.rows[0], 0] *= 1e3
    fit = dataclasses.replace(found.fit, measurements=dataclasses.replace(m, value=value))
    steep = dataclasses.replace(found, posterior=dataclasses.replace(found.posterior, fit=fit))
    assert plot.section(Study((found,))).get_yscale() == "linear"
    ax = plot.section(Study((steep,)))
    assert ax.get_yscale() == "log"
    assert ax.get_ylim()[1] > value.max()


def test_every_section_has_its_panel(studied):
    figure = plot.curves(studied, channel=1)
    assert [ax.get_title() for ax in figure.axes] == ["incidence 20°", "incidence 45°", "incidence 70°"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [*NAMES, "measured"]


@pytest.mark.parametrize(("channel", "count"), [(0, 51), (1, 50)])
def test_residuals_show_every_valid_sample(studied, channel, count):
    ax = plot.residuals(studied.findings[1], channel=channel)
    points = next(c for c in ax.collections if isinstance(c, PathCollection))
    z = np.asarray(points.get_offsets())[:, 1]
    assert len(z) == count
    # Standardised: about one, for a model that is right and 50 samples.
    assert 0.6 < z.std() < 1.4
    assert set(np.round(np.asarray(points.get_array()), 6)) == {20.0, 45.0, 70.0}
    assert ax.get_title() == f"lambert+ggx, channel {'rgb'[channel]}"
    assert ax.get_ylabel() == "residual / standard deviations"
    assert ax.figure.axes[1].get_ylabel() == "θᵢ / °"


def test_albedo_shows_both_models(match):
    own = plot.new_axes()
    ax = plot.albedo(match, own)
    assert ax is own
    lines = labelled(ax)
    assert list(lines) == NAMES
    np.testing.assert_allclose(lines[NAMES[1]][:, 1], match.albedo_microfacet[1])
    legend = ax.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == NAMES
    assert ax.get_ylim()[0] == 0
    assert ax.get_xlabel() == "incidence θᵢ / °"


@pytest.mark.parametrize("which", ["albedo_empirical", "albedo_microfacet"])
def test_impossible_albedos_stay_inside_the_picture(match, which):
    impossible = dataclasses.replace(match, **{which: 3 * match.albedo_microfacet / match.albedo_microfacet.max()})
    assert plot.albedo(impossible).get_ylim()[1] > 3.0


def test_corner_shows_free_parameters_only(studied):
    posterior = studied.posteriors[1]
    figure = plot.corner(posterior)
    assert isinstance(figure, Figure)
    assert len(figure.axes) == 8**2
    labels = [ax.get_xlabel() for ax in figure.axes[-8:]]
    assert labels == ["$k_d$ r", "$k_d$ g", "$k_d$ b", "$k_s$ r", "$k_s$ g", "$k_s$ b", "α", "η"]
    held = {name: np.array([1.0]) for name in ("kd", "ks")}
    fixed = dataclasses.replace(posterior, fit=dataclasses.replace(posterior.fit, held=held))
    assert [ax.get_xlabel() for ax in plot.corner(fixed).axes[-2:]] == ["α", "η"]


def test_corner_of_one_parameter_marks_the_best_fit(studied):
    posterior = studied.posteriors[1]
    held = {name: np.array([1.0]) for name in ("kd", "ks", "eta")}
    fit = dataclasses.replace(posterior.fit, held=held)
    (ax,) = plot.corner(dataclasses.replace(posterior, fit=fit)).axes
    assert ax.get_xlabel() == "α"
    alpha = float(fit.values[6])
    assert any(math.isclose(float(np.asarray(line.get_xdata())[0]), alpha) for line in ax.lines)


def test_corner_of_constant_draws(studied):
    """A chain that never moved is drawn, not refused."""
    posterior = studied.posteriors[1]
    still = dataclasses.replace(posterior, values=np.repeat(posterior.values[:1], 100, axis=0))
    assert len(plot.corner(still).axes) == 8**2
