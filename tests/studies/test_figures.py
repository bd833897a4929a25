"""What is drawn: the numbers of the study in few digits, what is left out said, whatever the file is like."""

import base64
import dataclasses
import json
import struct
import zlib
from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.judgement.prediction import curve
from fitmat.studies import figures
from fitmat.studies.numbers import NEAR, NEAR_RATIO, needed, quantised, short
from fitmat.studies.study import Study, study
from fitmat.studies.swatches import SIZE, png

NAMES = ("lambert+blinn-phong", "lambert+ggx")


def made(channels: int = 1, theta_i: Any = (20, 45, 70), theta_o: Any = range(-80, 81, 10), **options: Any) -> Any:
    truth = fm.model("lambert+ggx", channels=channels, kd=np.linspace(0.4, 0.1, channels), alpha=0.2)
    names = tuple(str(400 + 10 * k) for k in range(channels))
    told = {"relative_noise": 0.02, "absolute_noise": 1e-3, "seed": 1, "channels": names} | options
    return fm.simulate(truth, np.deg2rad(list(theta_i)), np.deg2rad(list(theta_o)), **told)


@pytest.fixture(scope="module")
def studied() -> Study:
    m = made(3)
    valid = m.valid.copy()
    valid[0, 1] = False
    return study(dataclasses.replace(m, valid=valid), NAMES, sampling=False)


@pytest.fixture(scope="module")
def drawn(studied: Study) -> dict[str, Any]:
    return json.loads(json.dumps(figures.to_dict(studied), allow_nan=False))


def test_curves_are_those_of_the_study(studied: Study, drawn: dict[str, Any]) -> None:
    m = studied.measurements
    assert (drawn["channels"], drawn["models"], drawn["left_out"]) == (list(m.channels), list(NAMES), [])
    assert [one["theta_i"] for one in drawn["curves"]] == [20.0, 45.0, 70.0]
    for k, one in enumerate(drawn["curves"]):
        for found in studied.findings:
            section, told = found.curves[k].section, one["models"][found.name]
            np.testing.assert_allclose(np.array(one["theta_o"]), np.rad2deg(section.theta_o), rtol=1e-4)
            exact = curve(found.fit, section, np.deg2rad(told["theta_o"])).T
            np.testing.assert_allclose(np.array(told["value"]), exact, rtol=2e-4)
            band = np.array([told["low"], told["high"]], float)
            expected = np.moveaxis(found.curves[k].band, 2, 1)
            valid = m.valid[section.rows].T
            np.testing.assert_allclose(band[:, valid], expected[:, valid], rtol=1e-4)
            assert np.isnan(band[:, ~valid]).all()
    assert [one["measured"][1].count(None) for one in drawn["curves"]] == [1, 0, 0]


def test_residuals_stand_beside_their_points(studied: Study, drawn: dict[str, Any]) -> None:
    """Of the row that is masked in one channel too; they share the sign of measured minus fitted."""
    m = studied.measurements
    for k, one in enumerate(drawn["curves"]):
        for found in studied.findings:
            rows = found.curves[k].section.rows
            z = np.array(one["models"][found.name]["residual"], float).T
            apart = m.value[rows] - curve(found.fit, found.curves[k].section, found.curves[k].section.theta_o)
            valid = m.valid[rows]
            assert (np.isnan(z) == ~valid).all()
            clear = valid & (np.abs(z) > 0.05)
            assert (np.sign(z[clear]) == np.sign(apart[clear])).all()


def test_the_straight_lines_between_points_are_near_the_curve() -> None:
    """A peak of 0.5° on a floor, five decades high: off by less than said between the points that are kept."""
    x = np.sort(np.r_[np.linspace(-89, 89, 357), 30 + np.linspace(-3, 3, 121)])
    y = np.stack([1e-3 + 100.0 * np.exp(-(((x - 30) / 0.5) ** 2)), np.full_like(x, 0.2)], axis=1)
    kept = needed(x, y)
    assert len(kept) < 120
    again = np.interp(x, x[kept], y[kept, 0])
    assert np.abs(np.cbrt(again) - np.cbrt(y[:, 0])).max() < 10 * NEAR * np.ptp(np.cbrt(y[:, 0]))
    steady = y[:, 0] < 2e-3
    assert np.abs(again / y[:, 0] - 1)[steady].max() < 3 * NEAR_RATIO
    assert len(needed(x, np.full((len(x), 1), 0.3))) < 50


def test_draws_are_those_of_the_posterior(studied: Study, drawn: dict[str, Any]) -> None:
    """To a ten-thousandth of their range; of one channel and of what all share."""
    found = studied.findings[1]
    told = drawn["draws"][NAMES[1]]
    assert told["names"] == ["kd 410", "ks 410", "alpha", "eta"]
    alpha = told["low"][2] + told["step"][2] * np.array(told["values"][2])
    exact = found.posterior.thinned(figures.DRAWS)[0][:, 6]
    assert np.abs(alpha - exact).max() < np.ptp(exact) / 9000
    assert (told["left_out"], len(alpha)) == (4, len(exact))


def test_the_match_is_that_of_the_study(studied: Study, drawn: dict[str, Any]) -> None:
    match, told = studied.match, drawn["match"]
    assert match is not None
    np.testing.assert_allclose(told["albedo"]["microfacet"], match.albedo_microfacet, rtol=1e-4)
    np.testing.assert_allclose(told["distance"], match.distances.by_incidence["relative"], rtol=1e-4)
    assert list(told["by_region"]) == ["core", "tail", "grazing", "diffuse"]
    assert told["measured_deg"] == [20.0, 70.0]


@pytest.mark.study
def test_many_channels_and_incidences_are_thinned_and_that_is_said() -> None:
    found = study(made(31, range(2, 82, 4), range(-80, 81, 20)), ["lambert"], sampling=False)
    drawn = figures.to_dict(found)
    assert drawn["channels"] == ["400", "550", "700"]
    assert len(drawn["curves"]) == 8
    assert drawn["left_out"] == [
        "3 of 31 channels are drawn, evenly spread; fitmat fit --full draws up to 12.",
        "Of 20 angles of incidence 8 as curves are drawn, evenly spread.",
    ]
    assert drawn["match"] is None
    assert len(json.dumps(drawn)) < 200_000


@pytest.mark.study
def test_what_was_seen_out_of_the_plane_has_maps(hemisphere: Any) -> None:
    wi, wo = np.tile(hemisphere(1, 3), (900, 1)), hemisphere(900, 2)
    value = np.full((900, 1), 0.1)
    m = fm.Measurements(wi, wo, value, 0.01 * value, value > 0, ("value",))
    (one,) = figures.to_dict(study(m, ["lambert"], sampling=False))["maps"]
    assert (one["points"], len(one["theta_o"])) == (900, figures.MAP_POINTS)
    theta = np.deg2rad(one["theta_o"])
    turned = np.stack([np.sin(theta) * np.cos(np.deg2rad(one["phi"])), np.sin(theta) * np.sin(np.deg2rad(one["phi"]))])
    light = wi[0, :2] / np.hypot(*wi[0, :2])
    along = -(wo[:, :2] @ light)  # the mirror side is at azimuth 0
    assert all(np.abs(along - x).min() < 1e-3 for x in turned[0])


def test_few_points_of_different_incidences_draw_nothing_and_fail_nowhere() -> None:
    m = fm.from_arrays([0.1, 0.3, 0.5], [0.1, 0.2, 0.3], [0.1] * 3, sigma=[0.01] * 3)
    drawn = figures.to_dict(study(m, ["lambert"], sampling=False))
    assert (drawn["curves"], drawn["maps"]) == ([], [])
    json.dumps(drawn, allow_nan=False)


def test_pictures_are_png_of_these_pixels() -> None:
    picture = np.random.default_rng(0).integers(0, 256, (5, 7, 4), np.uint8)
    content = base64.b64decode(png(picture).partition(",")[2])
    assert struct.unpack(">II", content[16:24]) == (7, 5)
    start = content.index(b"IDAT") + 4
    (length,) = struct.unpack(">I", content[start - 8 : start - 4])
    rows = np.frombuffer(zlib.decompress(content[start : start + length]), np.uint8).reshape(5, 29)
    assert (rows[:, 0] == 1).all()  # Sub: each byte less that of the pixel to its left
    again = np.cumsum(rows[:, 1:].reshape(5, 7, 4).astype(int), axis=1) % 256
    assert (again == picture).all()


def test_a_swatch_of_a_diffuse_surface_is_lit_by_the_cosine(drawn: dict[str, Any]) -> None:
    assert set(drawn["swatches"]) == set(NAMES)
    for link in drawn["swatches"].values():
        content = base64.b64decode(link.partition(",")[2])
        assert struct.unpack(">II", content[16:24]) == (SIZE, SIZE)


def test_numbers_are_short() -> None:
    assert short(np.array([[0.123456789, np.nan], [1e-9, -np.inf]])) == [[0.12346, None], [1e-9, None]]
    told = quantised(np.array([[1.0, 5.0], [3.0, 5.0], [2.0, 5.0]]))
    assert (told["low"], told["step"][1], told["values"]) == ([1.0, 5.0], 0.0, [[0, 9999, 5000], [0, 0, 0]])
