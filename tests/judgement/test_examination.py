"""An examination against closed forms, planted faults, and clean data that must raise no alarm."""

import dataclasses
import itertools
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.optimize

import fitmat as fm
from fitmat.judgement.examination.coverage import coverage, mirror_frame
from fitmat.judgement.examination.examining import Examination, examine
from fitmat.judgement.examination.features import peak
from fitmat.judgement.examination.implied_albedo import implied_albedo
from fitmat.judgement.examination.prospects import prospects
from fitmat.measurements.noise import channel_laws, measured_noise, noise_law

SEEDS = 20
"""Draws of the noise; a check that raises a false alarm in 14 % of clean files is caught in 95 of 100 cases."""

FOUR = np.deg2rad([10.0, 30.0, 50.0, 70.0])
EVEN = np.deg2rad(np.arange(-80.0, 80.1, 2.0))
SHARP = np.deg2rad(np.unique(np.r_[np.arange(-80, 81, 10), *(a + np.arange(-8, 9) for a in (10, 30, 50, 70))]))
ROUND = {"phi": np.deg2rad(np.arange(0.0, 360.0, 15.0)), "theta_o": np.deg2rad(np.r_[0:86:5, 88])}

NOISE = 0.01
"""Relative; sums of 80 samples of 2 % noise are known to 0.2 %, and the rim beyond 88° is 0.1 % of the whole."""

LINEAR = 0.04
"""Relative; a grid of 5° by 15° cuts up to 3 % off a lobe of α = 0.3, at 70°."""

TURNED = 0.06
"""Relative; a microfacet lobe is round about the mirror direction to first order in α = 0.15 only (70°: F and G tilt
it by 6 %)."""

ROUNDING = 1e-9
"""Radians or relative; double precision through sine and arctangent."""


def measured(name: str = "lambert+ggx", seed: int = 1, **options: Any) -> fm.Measurements:
    """Simulated measurements; `options` are those of `simulate` and parameters of the model."""
    setup: dict[str, Any] = {"theta_i": FOUR, "theta_o": EVEN, "relative_noise": 0.02, "absolute_noise": 1e-3}
    keys = {*setup, "phi", "phi_i", "give_sigma", "channels"}
    setup |= {key: value for key, value in options.items() if key in keys}
    values = {key: value for key, value in options.items() if key not in keys}
    return fm.simulate(fm.model(name, **values), seed=seed, **setup)


def scaled(m: fm.Measurements, factor: Any) -> fm.Measurements:
    """Values and their noise times a factor."""
    assert m.sigma is not None
    return dataclasses.replace(m, value=m.value * factor, sigma=m.sigma * factor)


def alarms(found: Examination) -> list[str]:
    """The subjects of the warnings, by their first words."""
    return [warning.split(":")[0] for warning in found.warnings]


# --- geometry --------------------------------------------------------------------------------------


def test_coverage_of_one_curve() -> None:
    m = fm.from_arrays(np.full(8, np.deg2rad(30)), np.deg2rad([-40, -20, 0, 10, 20, 28, 31, 50]), np.ones(8))
    (incidence,) = coverage(m).incidences
    degrees = incidence.as_dict()
    expected = {"theta_i_deg": 30, "step_deg": 10, "largest_gap_deg": 20, "nearest_to_mirror_deg": 1}
    expected |= {"theta_o_min_deg": 0, "theta_o_max_deg": 50, "samples": 8, "in_plane": 8, "relative_azimuths": 1}
    assert {key: degrees[key] for key in expected} == pytest.approx(expected, abs=1e-3)


def test_a_plane_covers_what_archimedes_says() -> None:
    """Within 10° of the plane through the normal lies sin 10° of the hemisphere (Archimedes, On the Sphere)."""
    m = fm.from_arrays(0.5, np.deg2rad(np.arange(-89.5, 90, 1.0)), np.ones(180))
    assert coverage(m).incidences[0].covered == pytest.approx(math.sin(math.radians(10)), abs=0.005)  # 2000 directions


def test_a_full_grid_covers_everything() -> None:
    found = coverage(measured("lambert", **ROUND))
    assert [i.covered for i in found.incidences] == [1.0] * 4
    assert [i.azimuths for i in found.incidences] == [12] * 4  # the plane, and 15° to 165° by 15°, left as right
    assert not found.in_plane


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_one_side_of_the_plane_covers_the_other(side: float) -> None:
    phi = side * np.deg2rad(np.arange(0.0, 181.0, 15.0))
    assert coverage(measured("lambert", theta_o=ROUND["theta_o"], phi=phi)).incidences[0].covered == 1.0


def test_the_mirror_frame_has_the_angles_of_the_measurements(hemisphere) -> None:
    wi, wo = hemisphere(200, 1), hemisphere(200, 2)
    m = fm.Measurements(wi, wo, np.ones((200, 1)), None, np.ones((200, 1), bool), ("value",))
    local = mirror_frame(wi, wo)
    assert np.arctan2(np.hypot(local[:, 0], local[:, 1]), local[:, 2]) == pytest.approx(m.theta_o, abs=ROUNDING)
    assert np.pi - np.abs(np.arctan2(local[:, 1], local[:, 0])) == pytest.approx(m.phi, abs=ROUNDING)
    assert np.sign(local[:, 0]) == pytest.approx(np.sign(m.signed_theta_o))
    turned = mirror_frame(wi @ _turn(0.7).T, wo @ _turn(0.7).T)
    assert turned == pytest.approx(local, abs=ROUNDING)


def _turn(angle: float) -> np.ndarray:
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])


def test_scattered_directions_are_described_in_bins(hemisphere) -> None:
    wi, wo = hemisphere(20_000, 1), hemisphere(20_000, 2)
    value = np.full((20_000, 1), 0.6 / np.pi)
    found = examine(fm.Measurements(wi, wo, value, None, value > 0, ("value",)))
    assert found.coverage.scattered
    assert [round(np.rad2deg(i.theta_i)) for i in found.coverage.incidences] == list(range(5, 90, 10))
    assert [a.value[0] for a in found.albedos] == pytest.approx([0.6] * 9, rel=0.15)  # the rim: 30 samples at 5°
    assert found.warnings == []


# --- implied albedo --------------------------------------------------------------------------------


def added(m: fm.Measurements) -> list[Any]:
    assert m.sigma is not None
    return [implied_albedo(m, m.sigma, incidence) for incidence in coverage(m).incidences]


@pytest.mark.parametrize("grid", [{"theta_o": np.deg2rad(np.arange(-88, 88.1, 2))}, ROUND], ids=["plane", "full"])
def test_lambert_adds_up_to_its_albedo(grid: dict[str, Any]) -> None:
    """∫ kd/π cosθ dω = kd at every incidence."""
    for a in added(measured("lambert", kd=0.5, **grid)):
        assert a.value[0] == pytest.approx(0.5 * (a.covered if a.assumed else 1.0), rel=NOISE)
        assert a.assumed == (grid is not ROUND)
        assert 0.98 < a.covered < 1 + ROUNDING  # a polygon of 24 corners at 88° has 0.987 of the disc


@pytest.mark.parametrize("theta_i", [0.2, 0.8, 1.2])
@pytest.mark.parametrize("model", ["lambert", "lambert+ggx"])
def test_what_was_not_measured_is_in_the_error(model: str, theta_i: float) -> None:
    """Azimuths every 10°, sensor up to 55°: two thirds of the projected hemisphere, beside the whole by quadrature."""
    theta_o, phi = np.deg2rad(np.arange(0, 56, 5.0)), np.deg2rad(np.arange(0, 360, 10.0))
    lobe: dict[str, Any] = {} if model == "lambert" else {"alpha": 0.4, "eta": 1.5}
    truth = fm.model(model, kd=0.3, **lobe)
    (found,) = added(fm.simulate(truth, [theta_i], theta_o, phi=phi, relative_noise=1e-3, absolute_noise=1e-6, seed=1))
    exact = float(fm.albedo(truth, theta_i).value[0, 0])
    assert not found.assumed
    assert found.covered == pytest.approx(np.sin(np.deg2rad(55)) ** 2, rel=0.02)  # a polygon of 36 corners
    assert abs(found.value[0] - exact) < found.error[0]
    assert found.error[0] < 0.6 * exact
    assert found.value[0] - found.error[0] > 0.5 * exact  # what is there is used


@pytest.mark.parametrize("theta_i", FOUR)
def test_a_turned_slope_adds_up_as_stated(theta_i: float) -> None:
    """The assumption evaluated at 10⁶ points of the disc: the mean of the two sides of (1 + x/2)/2π.

    Where one side has left the disc the other stands in for it.
    """
    angle, centre = np.deg2rad(np.arange(-89.9, 89.91, 0.2)), np.sin(theta_i)
    value = (1 + np.sin(angle) / 2) / (2 * np.pi)
    (a,) = added(fm.from_arrays(theta_i, angle, value, sigma=1e-6 * value))
    grid = (np.arange(1000) + 0.5) / 500 - 1
    x, y = np.meshgrid(grid, grid)
    r = np.hypot(x - centre, y)
    ahead, behind = centre + r, centre - r
    ahead, behind = np.where(ahead > 1, behind, ahead), np.where(behind < -1, ahead, behind)
    turned = (1 + (ahead + behind) / 4) / (2 * np.pi)
    assert a.assumed
    assert a.value[0] == pytest.approx(
        turned[np.hypot(x, y) < 1].sum() * 4e-6, rel=1e-3
    )  # the edge: 1/1000 of the disc


def test_phong_at_normal_incidence_adds_up_to_its_weight() -> None:
    """2π ∫ (n+2)/(2π) cⁿ⁺¹ dc = 1; from one side of one curve."""
    m = measured("phong", ks=0.7, exponent=50.0, theta_i=[0.0], theta_o=np.deg2rad(np.arange(0, 89, 1.0)))
    (a,) = added(m)
    assert a.value[0] == pytest.approx(0.7, rel=NOISE)
    assert a.value[0] == pytest.approx(0.7, abs=3 * a.error[0] + 1e-3 * 0.7)


def test_a_microfacet_lobe_adds_up_to_its_directional_albedo() -> None:
    """The quadrature of `energy`, which is proved against closed forms, over the model itself."""
    truth: dict[str, Any] = {"kd": 0.2, "alpha": 0.3, "eta": 6.0}
    expected = fm.albedo(fm.model("lambert+ggx", **truth), FOUR).value[:, 0]
    found = added(measured(**truth, **ROUND))
    assert [a.value[0] / a.covered for a in found] == pytest.approx(expected, rel=LINEAR)


def test_a_curve_turned_about_the_mirror_direction_adds_up() -> None:
    truth: dict[str, Any] = {"kd": 0.2, "alpha": 0.15, "eta": 6.0}
    expected = fm.albedo(fm.model("lambert+ggx", **truth), FOUR).value[:, 0]
    found = added(measured(**truth, theta_o=np.deg2rad(np.arange(-88, 88.1, 1))))
    assert [a.value[0] for a in found] == pytest.approx(expected, rel=TURNED)


def test_an_unresolved_lobe_has_an_uncertain_albedo() -> None:
    """α = 0.01 on a grid of 4°: the sum depends on where the samples fall, and says so."""
    truth: dict[str, Any] = {"kd": 0.2, "alpha": 0.01, "eta": 6.0}
    expected = fm.albedo(fm.model("lambert+ggx", **truth), np.deg2rad([20.0])).value[0, 0]
    (a,) = added(measured(**truth, theta_i=np.deg2rad([20.0]), **ROUND))
    assert abs(a.value[0] - expected) < a.error[0]
    assert not a.too_large.any()


@pytest.mark.parametrize("factor", [1.3, np.pi])
def test_more_light_than_falls_on_it_is_a_warning(factor: float) -> None:
    """A wrong scale, and a reflectance factor read as BRDF."""
    found = examine(scaled(measured("lambert", kd=0.9), factor))
    assert len([w for w in found.warnings if "more light than falls on the sample" in w]) == 4
    (value,) = re.findall(r"At 10° incidence the values add up to an albedo of ([\d.]+)", found.warnings[0])
    assert float(value) == pytest.approx(0.9 * factor, rel=NOISE)


# --- clean data raise no alarm ---------------------------------------------------------------------

CLEAN: dict[str, dict[str, Any]] = {
    "dull": {"kd": 0.3, "alpha": 0.4},
    "satin": {"kd": 0.3, "alpha": 0.15, "theta_o": SHARP},
    "glossy, no sigma": {"kd": 0.3, "alpha": 0.03, "theta_o": SHARP, "give_sigma": False},
    "metal": {"name": "ggx", "alpha": 0.1, "eta": 6.0, "absolute_noise": 1e-6},
    "lacquer": {"name": "lambert+blinn-phong", "kd": 0.2, "ks": 0.04, "exponent": 800.0, "theta_o": SHARP},
    "white": {"name": "lambert", "kd": 1.0},
}


@pytest.mark.parametrize("options", CLEAN.values(), ids=list(CLEAN))
def test_clean_data_raise_no_alarm(options: dict[str, Any]) -> None:
    found = [examine(measured(seed=seed, **options)).warnings for seed in range(SEEDS)]
    assert list(itertools.chain(*found)) == []


def test_clean_data_of_the_whole_hemisphere_raise_no_alarm() -> None:
    turns = {"phi_i": np.deg2rad([0.0, 90.0]), **ROUND}
    found = [examine(measured(seed=seed, kd=0.3, alpha=0.2, **turns)) for seed in range(SEEDS // 4)]
    assert [e.warnings for e in found] == [[]] * len(found)
    for kind in ("reciprocity", "sides", "azimuths"):
        agreements = [getattr(e.consistency, kind) for e in found]
        assert all(a.judged for a in agreements)
        # √(2/pairs)/2 is the standard error of a root mean square about 1; four of them, the fewest pairs.
        assert np.array([a.noise for a in agreements]) == pytest.approx(1.0, abs=2 * math.sqrt(2 / agreements[0].pairs))


# --- planted faults --------------------------------------------------------------------------------


def test_planted_non_reciprocity_is_found() -> None:
    """10 % between a pair and its exchange, on 12 pairs of 2 % noise."""
    for seed in range(SEEDS):
        m = measured(seed=seed, kd=0.3, alpha=0.2, theta_o=SHARP)
        found = examine(scaled(m, 1 + 0.05 * np.sign(m.theta_i - m.theta_o)[:, None]))
        assert alarms(found) == ["Reciprocity"]
        assert found.consistency.reciprocity.pairs == 12
        assert found.consistency.reciprocity.median == pytest.approx(0.1, abs=0.04)  # 2.8 % noise a pair


@pytest.mark.parametrize("lean", [0.5, -1.0])
def test_a_planted_lean_is_found(lean: float) -> None:
    """The light stands at azimuth 0, so that a lean towards +x is towards the light: peaks move back by twice it."""
    for seed in range(SEEDS):
        m = measured("tilt-over-lambert+ggx", seed=seed, kd=0.3, alpha=0.1, tilt_x=lean, theta_o=SHARP)
        found = examine(m)
        assert found.tilt is not None
        assert found.tilt.certain
        assert np.rad2deg(found.tilt.angle) == pytest.approx(-lean, abs=0.3)  # a rough lobe's own shift is not ∝ tanθ_i
        assert any(f"towards the {'light' if lean > 0 else 'mirror'} side" in w for w in found.warnings)


def test_a_lean_across_the_plane_is_found() -> None:
    m = measured("tilt-over-lambert+ggx", kd=0.3, alpha=0.2, tilt_y=1.0, **ROUND)
    found = examine(m)
    assert "Left and right" in alarms(found)
    assert found.consistency.sides.noise is not None
    assert found.consistency.sides.noise > 1.2  # most of the hemisphere is diffuse and looks the same


def test_planted_anisotropy_is_found_and_is_not_called_non_reciprocal() -> None:
    turns = np.deg2rad([0.0, 90.0])
    for seed in range(SEEDS):
        found = examine(measured("lambert+ggx-aniso", seed=seed, kd=0.3, alpha_x=0.15, alpha_y=0.3, phi_i=turns))
        assert alarms(found) == ["Azimuth of incidence"]


def test_an_anisotropic_surface_is_reciprocal() -> None:
    turns = np.deg2rad([0.0, 90.0, 180.0, 270.0])
    m = measured("lambert+ggx-aniso", kd=0.3, alpha_x=0.15, alpha_y=0.3, phi_i=turns, theta_o=SHARP)
    found = examine(m).consistency
    assert found.azimuths.differ
    assert found.reciprocity.judged
    assert not found.reciprocity.differ


def test_a_detectors_floor_is_told_from_diffuse_reflection() -> None:
    """A constant signal is a BRDF ∝ 1/cosθ_o; diffuse reflection a constant BRDF."""
    options = {"alpha": 0.02, "eta": 6.0, "relative_noise": 0.01, "absolute_noise": 1e-6, "theta_o": SHARP}
    for seed in range(SEEDS):
        m = measured("ggx", seed=seed, **options)
        found = examine(dataclasses.replace(m, value=m.value + 2e-3 / m.wo[:, 2:]))
        assert [w for w in found.warnings if "may be the instrument's floor" in w]
        diffuse = examine(measured(seed=seed, kd=0.1, **options))
        assert diffuse.levels
        assert not any(level.instrumental for level in diffuse.levels)
        assert np.array([level.value for level in diffuse.levels]) == pytest.approx(
            0.1 / np.pi, rel=0.15
        )  # and the lobe's tail
        assert diffuse.warnings == []


@pytest.mark.parametrize(("theta_i", "alpha"), [(30.0, 0.15), (50.0, 0.15), (45.0, 0.3), (60.0, 0.1)])
def test_an_off_specular_peak_is_placed(theta_i: float, alpha: float) -> None:
    """Against the maximum of the model itself on a fine grid."""
    truth = fm.model("lambert+ggx", kd=0.02, alpha=alpha, eta=6.0)
    fine = np.deg2rad(np.arange(0, 85, 0.01))
    m = fm.simulate(truth, np.deg2rad([theta_i]), fine, relative_noise=0, absolute_noise=0, seed=1)
    highest = fine[m.value[:, 0].argmax()] - np.deg2rad(theta_i)
    seen = measured(
        kd=0.02, alpha=alpha, eta=6.0, theta_i=np.deg2rad([theta_i]), theta_o=np.deg2rad(np.arange(-84, 85))
    )
    assert seen.sigma is not None
    found = peak(seen, seen.sigma, coverage(seen).incidences[0], 0)
    assert found is not None
    assert found.error < np.deg2rad(1.0)
    assert found.offset == pytest.approx(highest, abs=4 * found.error)


def test_a_peak_between_coarse_samples_is_a_warning() -> None:
    found = examine(measured(kd=0.3, alpha=0.01, eta=1.5))
    assert any("narrower than two angular steps" in w for w in found.warnings)
    assert "cut off" not in str(found)


def test_values_that_were_cut_off_are_a_warning() -> None:
    m = measured(kd=0.03, alpha=0.1)
    floor = np.quantile(m.value, 0.2)
    found = examine(dataclasses.replace(m, value=np.maximum(m.value, floor)))
    assert any("values were probably cut off there" in w for w in found.warnings)
    assert found.values[0].clipped >= 0.2 * m.n_samples


# --- prospects -------------------------------------------------------------------------------------


def test_prospects_are_the_inverse_of_the_fisher_information() -> None:
    """Against central differences of `evaluate` and numpy's inverse; relative standard deviations, in ln p."""
    m = measured(kd=0.3, alpha=0.15)
    assert m.sigma is not None
    truth: dict[str, Any] = {"kd": 0.3, "ks": 1.0, "alpha": 0.15, "eta": 1.5}
    exact = fm.evaluate(fm.model("lambert+ggx", **truth), m.wi, m.wo)[:, 0]
    slopes = []
    for name, value in truth.items():
        ends = [fm.evaluate(fm.model("lambert+ggx", **truth | {name: value * f}), m.wi, m.wo) for f in (1.001, 0.999)]
        slopes.append((ends[0] - ends[1])[:, 0] / 0.002 / np.hypot(1e-3, 0.02 * exact))
    expected = np.sqrt(np.diagonal(np.linalg.inv(np.array(slopes) @ np.array(slopes).T)))
    found = [
        p for p in prospects(m, channel_laws(m, measured_noise(m))) if (p.model, p.gloss) == ("lambert+ggx", "satin")
    ]
    assert [p.name for p in found] == list(truth)
    assert [p.sd for p in found] == pytest.approx(expected, rel=1e-2)  # the law of σ is estimated from the file
    assert {p.verdict for p in found} == {"determined"}


def test_what_the_catalogue_calls_not_determined_is_not() -> None:
    """The truth beside `normal-incidence.csv`: weight and index act alike at normal incidence."""
    folder = Path(__file__).parents[2] / "data" / "synthetic"
    stated = json.loads((folder / "normal-incidence.truth.json").read_text(encoding="utf-8"))["not_determined"]
    found = examine(fm.read(folder / "normal-incidence.csv"))
    glossy = [p for p in found.prospects if (p.model, p.gloss) == ("lambert+ggx", "glossy")]
    assert [p.name for p in glossy if p.verdict == "not determined"] == stated
    assert any("glossy plastic" in line and line.endswith("not determined: ks, eta.") for line in found.lines())


def test_a_noise_law_is_the_non_negative_least_squares_solution() -> None:
    rng = np.random.default_rng(7)
    for _ in range(200):
        value, sigma = np.exp(rng.normal(size=30) * 2), np.exp(rng.normal(size=30) * rng.uniform(0.1, 2))
        sigma /= sigma.max()
        squares = np.stack([1 / sigma**2, (value / sigma) ** 2], axis=1)
        scale = squares.max(axis=0)
        (a2, b2), _ = scipy.optimize.nnls(squares / scale, np.ones(30))
        a, b = noise_law(value, sigma)
        assert a == pytest.approx(max(np.sqrt(a2 / scale[0]), 1e-3 * sigma.min()), rel=1e-6)
        assert b == pytest.approx(np.sqrt(b2 / scale[1]), rel=1e-6, abs=1e-12)


@pytest.mark.parametrize(("absolute", "relative"), [(1e-3, 0.02), (1e-3, 0.0), (0.0, 0.02)])
def test_the_law_of_given_noise_is_found(absolute: float, relative: float) -> None:
    value = np.geomspace(1e-2, 10, 50)
    a, b = noise_law(value, np.hypot(absolute, relative * value))
    assert a == pytest.approx(absolute, rel=1e-6, abs=1e-3 * 2e-4)
    assert b == pytest.approx(relative, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("azimuths", [5, 24, 25, 72])
def test_anisotropy_is_judged_however_many_azimuths_there_are(azimuths: int) -> None:
    """Of a brushed sample and of one that is not."""
    angles = np.deg2rad([20, 50]), np.deg2rad(np.arange(0, 81, 10))
    turned = np.arange(azimuths) * 2 * np.pi / azimuths
    for name, differ in (("ggx-aniso", True), ("ggx", False)):
        made = fm.simulate(fm.model(name), *angles, phi_i=turned, relative_noise=0.01, absolute_noise=1e-4, seed=1)
        found = examine(made).consistency.azimuths
        assert found.judged
        assert found.differ == differ


def test_a_law_is_sought_where_some_sigma_is_nothing() -> None:
    """The σ of readings of exactly 0, of which 1/σ² is infinite."""
    a, b = noise_law(np.array([0.0, 0.5, 1.0]), np.array([5e-324, 0.01, 0.02]))
    assert np.isfinite([a, b]).all()


# --- odd files -------------------------------------------------------------------------------------


def one_sample() -> fm.Measurements:
    return fm.from_arrays([0.5], [0.5], [0.1])


def nothing_valid() -> fm.Measurements:
    return fm.from_arrays([0.5, 0.6], [0.5, 0.1], [np.nan, np.nan])


def empty_channel() -> fm.Measurements:
    m = measured("lambert", kd=np.array([0.5, 0.4, 0.3]), channels=("r", "g", "b"), give_sigma=False)
    valid = m.valid.copy()
    valid[:, 1] = False
    return dataclasses.replace(m, valid=valid, value=np.where(valid, m.value, 0.0))


def black() -> fm.Measurements:
    return fm.from_arrays(0.5, EVEN, np.zeros(len(EVEN)))


def all_negative() -> fm.Measurements:
    return fm.from_arrays(0.5, EVEN, np.full(len(EVEN), -0.1), sigma=0.1 * np.ones(len(EVEN)))


def one_geometry() -> fm.Measurements:
    return fm.from_arrays(np.full(30, 0.5), np.full(30, 0.5), np.linspace(1, 1.1, 30))


def many_channels() -> fm.Measurements:
    return measured("lambert", kd=np.linspace(0.1, 0.5, 195), theta_o=EVEN[::4], theta_i=FOUR[:2])


ODD = (one_sample, nothing_valid, empty_channel, black, all_negative, one_geometry, many_channels)


@pytest.mark.parametrize("odd", ODD, ids=lambda odd: odd.__name__)
def test_odd_files_are_described_without_nan(odd: Any) -> None:
    found = examine(odd())
    text = json.dumps(found.as_dict(), allow_nan=False)
    assert "nan" not in str(found).lower()
    assert "inf" not in str(found).lower()
    assert json.loads(text)["samples"] == found.measurements.n_samples
    assert all(line.endswith(".") for line in found.lines())


def test_an_empty_channel_is_a_warning() -> None:
    found = examine(empty_channel())
    assert found.warnings == ["Nothing can be used of channel g: every value is masked."]
    green = found.as_dict()["channels"]["g"]
    assert green["highest"] is None
    assert [a["value"] for a in green["implied_albedo"]] == [None] * 4


def test_warnings_come_before_the_description() -> None:
    lines = examine(scaled(measured("lambert", kd=0.9), 1.3)).lines()
    assert lines[0] == "simulated lambert: 324 samples, channel value."
    assert [line.startswith("WARNING: ") for line in lines[:6]] == [False, True, True, True, True, False]
    assert not any(line.startswith("WARNING") for line in lines[5:])


def test_masked_rows_and_notes_are_repeated() -> None:
    m = dataclasses.replace(measured(), masked={"value missing or NaN": 3}, notes=("brdf read as f_r.",))
    lines = examine(m).lines()
    assert "Not used, value missing or NaN: 3 rows." in lines
    assert "brdf read as f_r." in lines


def test_notebooks_get_escaped_lines() -> None:
    found = examine(dataclasses.replace(measured(), source="<b>.csv"))
    assert found._repr_html_().startswith("&lt;b&gt;.csv: 324 samples, channel value.<br>")
    assert found._repr_html_().count("<br>") == len(found.lines()) - 1


# --- real data -------------------------------------------------------------------------------------


def test_the_chassis_levels_off_far_below_its_peak(shared_data: Path) -> None:
    """A satellite's chassis over 8 decades: the README of the data names its instrument floor.

    Seven readings are 1e-4; four of them, right after readings 190 to 4,600 times brighter, are masked.
    """
    path = shared_data / "starlink" / "chassis_brdf.csv"
    m = fm.read(path, columns="theta_i=phi_i,phi_i=theta_i,theta_o=phi_o,phi_o=theta_o")
    found = examine(m)
    assert len(found.levels) == 4
    assert all(0.005 < level.value < 0.02 for level in found.levels)
    assert any("decades below the peak: stray light or the instrument's floor" in w for w in found.warnings)
    assert found.values[0].clipped == int(np.count_nonzero(m.value[m.valid] == 1e-4)) == 3
    assert found.values[0].decades == pytest.approx(7.9, abs=0.05)
    assert [round(np.rad2deg(p.theta_i), 1) for p in found.peaks] == [5.0, 41.4, 60.0, 75.0]
    assert all(abs(p.offset) < np.deg2rad(0.5) for p in found.peaks)  # half a step
