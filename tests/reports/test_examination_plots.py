"""What is drawn of an examination: points, marks, labels, limits; never pixels."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

import fitmat as fm
from fitmat.judgement.examination.examining import Examination, examine
from fitmat.reports.examination_plots import MAPS, drawn, examination

TRUTH = {"kd": np.array([0.3, 0.1]), "alpha": 0.1, "eta": 1.5}
LIGHT = (10.0, 30.0, 50.0)


def measured(theta_i: tuple[float, ...] = LIGHT, **options) -> fm.Measurements:
    truth = fm.model("lambert+ggx", channels=2, **TRUTH)
    setup = {"theta_o": np.deg2rad(np.arange(-80, 81, 5)), "relative_noise": 0.02, "absolute_noise": 1e-3, "seed": 1}
    return fm.simulate(truth, np.deg2rad(theta_i), channels=("550", "650"), **setup | options)


@pytest.fixture(scope="module")
def plane() -> Examination:
    """Three incidences of 33 samples; the first row of the second channel is masked."""
    m = measured()
    valid = m.valid.copy()
    valid[0, 1] = False
    return examine(dataclasses.replace(m, valid=valid))


def points(sheet: Figure) -> list[np.ndarray]:
    """Azimuth and radius of the samples of every map."""
    return [
        np.asarray(ax.collections[0].get_offsets())
        for ax in sheet.axes
        if ax.name == "polar" and isinstance(ax.collections[0], PathCollection)
    ]


@pytest.mark.parametrize(("channel", "counts"), [(None, [33, 33, 33]), (0, [33, 33, 33]), (1, [32, 33, 33])])
def test_every_valid_sample_is_on_its_map(plane: Examination, channel: int | None, counts: list[int]) -> None:
    sheet = examination(plane, channel=channel)
    maps = points(sheet)
    assert [len(found) for found in maps] == counts
    for found in maps:
        signed = found[:, 1] * np.where(np.abs(found[:, 0]) < 1, 1.0, -1.0)
        assert np.sort(signed) == pytest.approx(np.arange(-80, 81, 5)[-len(found) :], abs=1e-6)
    assert sheet.get_suptitle() == f"simulated lambert+ggx, channel {'650' if channel == 1 else '550'}"


def test_maps_mark_the_light_and_the_mirror_direction(plane: Examination) -> None:
    """The mirror side is to the right: azimuth 0; the light stands opposite."""
    maps = [ax for ax in examination(plane).axes if ax.name == "polar"]
    for ax, light in zip(maps, LIGHT, strict=True):
        marks = {str(line.get_label()): np.asarray(line.get_xydata())[0] for line in ax.lines}
        assert marks["mirror direction"] == pytest.approx([0.0, light])
        assert marks["light"] == pytest.approx([np.pi, light])
        assert ax.get_title() == f"θᵢ = {light:g}°\n33 samples"
        assert ax.get_ylim() == (0, 90)


def test_curves_show_every_sample_and_the_mirror_directions(plane: Examination) -> None:
    ax = examination(plane).axes[-1]
    lines = {
        str(line.get_label()): np.asarray(line.get_xydata()) for line in ax.lines if np.size(line.get_xydata()) > 4
    }
    assert list(lines) == ["10°", "30°", "50°"]
    m = plane.measurements
    for k, found in enumerate(lines.values()):
        rows = slice(33 * k, 33 * (k + 1))
        assert found[:, 0] == pytest.approx(np.rad2deg(m.signed_theta_o[rows]), abs=1e-6)
        assert found[:, 1] == pytest.approx(m.value[rows, 0])
    dotted = [float(np.asarray(line.get_xdata())[0]) for line in ax.lines if line.get_linestyle() == ":"]
    assert dotted == pytest.approx(LIGHT)
    assert ax.get_xlim() == (-90, 90)
    assert ax.get_xlabel() == "θₒ / °  (positive = mirror side; dotted: mirror direction)"
    assert ax.get_ylabel() == "BRDF / sr⁻¹"
    assert ax.get_ylim()[0] == 0  # one decade: a linear axis from 0


def test_decades_are_drawn_on_a_logarithmic_axis(plane: Examination) -> None:
    m = plane.measurements
    steep = examine(dataclasses.replace(m, value=m.value**4))
    ax = examination(steep).axes[-1]
    assert ax.get_yscale() == "log"
    assert ax.get_ylim()[0] < steep.measurements.value[:, 0].min()
    assert ax.get_ylim()[1] > steep.measurements.value[:, 0].max()


def test_many_incidences_are_chosen_evenly() -> None:
    found = examine(measured(tuple(range(0, 81, 10))))
    chosen = [round(float(np.rad2deg(i.theta_i))) for i in drawn(found)]
    assert len(chosen) == MAPS
    assert (chosen[0], chosen[-1]) == (0, 80)
    assert len(points(examination(found))) == MAPS


def test_scattered_samples_have_maps_only(hemisphere) -> None:
    wi, wo = hemisphere(20_000, 1), hemisphere(20_000, 2)
    value = np.full((20_000, 1), 0.1)
    sheet = examination(examine(fm.Measurements(wi, wo, value, None, value > 0, ("value",))))
    assert {ax.name for ax in sheet.axes} == {"polar", "rectilinear"}
    assert [ax.get_ylabel() for ax in sheet.axes if ax.name == "rectilinear"] == ["BRDF / sr⁻¹"]  # the bar of colours


@pytest.mark.parametrize("value", [np.nan, 0.0, -0.1, 0.1])
def test_odd_files_are_drawn(value: float, tmp_path: Path) -> None:
    """Nothing valid, black, negative, a single sample; all the way to a picture."""
    m = fm.from_arrays([0.5], [0.5], [value])
    sheet = examination(examine(m))
    sheet.savefig(tmp_path / "picture.png")
    assert len(points(sheet)) == (0 if np.isnan(value) else 1)


@pytest.mark.parametrize("name", [r"$\frac{$", "a$b$c", r"\$", "_{", "$"])
def test_names_are_text_whatever_they_look_like(plane: Examination, name: str, tmp_path: Path) -> None:
    """Of the file and of its channels: no formula is sought in them."""
    m = plane.measurements
    named = dataclasses.replace(m, source=f"{name}.csv", channels=tuple(f"{name}{k}" for k in range(len(m.channels))))
    examination(examine(named)).savefig(tmp_path / "picture.png")


def test_pictures_can_be_saved_without_a_warning(plane: Examination, tmp_path: Path) -> None:
    examination(plane).savefig(tmp_path / "picture.png")
    examination(examine(measured((30.0,)))).savefig(tmp_path / "one.png")
