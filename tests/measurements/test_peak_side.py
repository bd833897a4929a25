"""Curves that peak back towards the light are said, with the flag that exchanges the sides; nothing else raises it.

The curves are closed forms: a Gaussian peak about a direction, Lambert, the qualitative model of Oren & Nayar (1994).
"""

from pathlib import Path

import numpy as np
import pytest

import fitmat as fm
from fitmat.measurements.large import chunks

INCIDENCES = np.array([20.0, 40.0, 60.0])
SENSOR = np.arange(-80.0, 81.0, 5.0)


def gaussian(theta_i: np.ndarray, theta_o: np.ndarray, at: float) -> np.ndarray:
    """0.1 and a peak of 1 where theta_o = at · theta_i, in degrees; 8° wide."""
    return 0.1 + np.exp(-(((theta_o - at * theta_i) / 8.0) ** 2))


def oren_nayar(theta_i: np.ndarray, theta_o: np.ndarray) -> np.ndarray:
    """Albedo 1, σ = 40°: A + B max(0, cos φ) sin α tan β (eq. 30), positive theta_o on the mirror side."""
    s2 = np.deg2rad(40.0) ** 2
    a, b = 1 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
    high, low = (np.deg2rad(f(theta_i, np.abs(theta_o))) for f in (np.maximum, np.minimum))
    return (a + b * (theta_o < 0) * np.sin(high) * np.tan(low)) / np.pi


def table(values, **columns: np.ndarray) -> dict[str, np.ndarray]:
    """In-plane curves of `values(theta_i, theta_o)`, theta_o positive on the mirror side."""
    theta_i, theta_o = (part.ravel() for part in np.meshgrid(INCIDENCES, SENSOR, indexing="ij"))
    return {"theta_i": theta_i, "theta_o": theta_o, "brdf": values(theta_i, theta_o)} | columns


def with_azimuth(flat: dict[str, np.ndarray], mirror: float) -> dict[str, np.ndarray]:
    """The curves with positive theta_o and the mirror side at the azimuth `mirror`."""
    forward = flat["theta_o"] > 0
    return flat | {"theta_o": np.abs(flat["theta_o"]), "phi": np.where(forward, mirror, 180.0 - mirror)}


def mirrored(theta_i: np.ndarray, theta_o: np.ndarray) -> np.ndarray:
    return gaussian(theta_i, theta_o, -1.0)


def test_a_mirror_side_at_azimuth_0_is_said_with_its_flag():
    flat = table(lambda i, o: gaussian(i, o, 1.0))
    (warning,) = fm.read(with_azimuth(flat, 0.0)).warnings
    assert "peak back towards the light, not in the mirror direction (at 20°, 40°, 60° incidence)" in warning
    assert "pass --specular-azimuth 0; or" in warning
    assert warning.endswith("confirm it with --specular-azimuth 180.")
    turned = fm.read(with_azimuth(flat, 0.0), specular_azimuth=0)
    right = fm.read(flat)
    assert turned.warnings == right.warnings == ()
    np.testing.assert_allclose(turned.wo, right.wo, atol=1e-12)


@pytest.mark.parametrize("azimuth", [90, 270])
def test_a_mirror_side_a_quarter_of_a_turn_away_is_said_with_its_flag(azimuth: int):
    """Azimuths counted from the axis across the plane of incidence, all eight of them measured."""
    columns = (part.ravel() for part in np.meshgrid(INCIDENCES, SENSOR[SENSOR > 0], 45.0 * np.arange(8), indexing="ij"))
    theta_i, theta_o, phi = columns
    lobe = fm.directions(theta_i, degrees=True) * [-1.0, 1.0, 1.0]
    away = np.degrees(np.arccos(np.clip(np.sum(lobe * fm.directions(theta_o, phi, degrees=True), axis=1), -1, 1)))
    right = {"theta_i": theta_i, "theta_o": theta_o, "phi": phi, "brdf": 0.1 + np.exp(-((away / 8.0) ** 2))}
    turned = right | {"phi": (phi + azimuth - 180.0) % 360.0}
    (warning,) = fm.read(turned).warnings
    assert f"peak at the azimuth {azimuth}°, not in the mirror direction (at 20°, 40°, 60° incidence)" in warning
    assert f"pass --specular-azimuth {azimuth}; if not, confirm it with --specular-azimuth 180." in warning
    read = fm.read(turned, specular_azimuth=azimuth)
    assert read.warnings == fm.read(right).warnings == ()
    np.testing.assert_allclose(read.wo, fm.read(right).wo, atol=1e-12)


def test_a_negative_mirror_side_is_said_with_its_flag():
    (warning,) = fm.read(table(mirrored)).warnings
    assert "pass --forward negative; or" in warning
    assert fm.read(table(mirrored), forward="negative").warnings == ()


def test_a_scan_of_the_light_side_alone_is_said():
    flat = table(mirrored)
    kept = flat["theta_o"] < 0
    assert len(fm.read({name: column[kept] for name, column in flat.items()}).warnings) == 1


@pytest.mark.parametrize(
    ("at", "origin", "mended"),
    [(0.0, "peak at the normal", "theta_o + theta_i"), (2.0, "peak at twice the mirror angle", "theta_o − theta_i")],
)
def test_an_angle_that_counts_from_elsewhere_is_said(at: float, origin: str, mended: str):
    """From the mirror direction, where every curve peaks at 0; from the light, where it peaks at twice its angle."""
    theta_i, theta_o = (part.ravel() for part in np.meshgrid([31.0, 36.0, 40.0], SENSOR, indexing="ij"))
    flat = {"theta_i": theta_i, "theta_o": theta_o, "brdf": gaussian(theta_i, theta_o, at)}
    (warning,) = fm.read(flat).warnings
    assert origin in warning
    assert f"write {mended} in its place" in warning
    assert fm.read(flat, forward="positive").warnings == ()
    assert fm.read(flat | {"brdf": gaussian(theta_i, theta_o, 1.0)}).warnings == ()


def test_a_retro_reflector_is_confirmed():
    assert fm.read(with_azimuth(table(mirrored), 180.0), specular_azimuth=180).warnings == ()
    assert fm.read(table(mirrored), forward="positive").warnings == ()


@pytest.mark.parametrize("share", [0.3, 1.0])
def test_a_retro_reflector_with_a_gloss_needs_no_confirmation(share: float):
    both = fm.read(table(lambda i, o: gaussian(i, o, -1.0) + share * gaussian(i, o, 1.0)))
    assert both.warnings == ()


@pytest.mark.parametrize("values", [oren_nayar, lambda i, o: np.full(len(i), 0.3)], ids=["Oren–Nayar", "Lambert"])
@pytest.mark.parametrize("noise", [0.0, 0.02, 0.1])
def test_diffuse_surfaces_raise_no_alarm(values, noise: float):
    rng = np.random.default_rng(1)
    for _ in range(30):
        flat = table(values)
        flat["brdf"] = flat["brdf"] * (1 + noise * rng.normal(size=len(flat["brdf"])))
        assert fm.read(flat).warnings == ()


def test_noise_alone_raises_no_alarm():
    rng = np.random.default_rng(1)
    assert not any(fm.read(table(lambda i, o: rng.normal(size=len(i)))).warnings for _ in range(100))


def test_synthetic_files_raise_no_alarm():
    for path in sorted((Path(__file__).parents[2] / "data/synthetic").glob("*.csv")):
        assert fm.read(path).warnings == (), path


def test_a_large_file_says_the_same(tmp_path):
    flat = with_azimuth(table(mirrored), 180.0)
    path = tmp_path / "large.csv"
    rows = np.stack(list(flat.values()), axis=1)
    np.savetxt(path, rows, delimiter=",", header=",".join(flat), comments="", fmt="%.8g")
    found = chunks.scan(path, rows=20)
    assert found.part.warnings == fm.read(path).warnings
    assert len(found.part.warnings) == 1


def test_an_examination_warns_and_a_print_shows_it():
    measured = fm.read(table(mirrored))
    assert measured.warnings[0] in fm.examine(measured).warnings
    assert f"WARNING: {measured.warnings[0]}" in str(measured)


@pytest.mark.parametrize("elevated", ["theta_i", "theta_o"])
def test_an_elevation_beside_a_zenith_angle_is_noticed(elevated: str) -> None:
    """The lobe of light at 20° and 65° in the file's angles; alone the elevation moves it to 70° and 25°."""
    theta_i, theta_o = (p.ravel() for p in np.meshgrid([20.0, 65.0], np.arange(1, 90, 2.0), indexing="ij"))
    value = 0.1 + np.exp(-(((theta_o - theta_i) / 8) ** 2))
    angles = {"theta_i": theta_i, "theta_o": theta_o, "phi": np.full(value.shape, 180.0)}
    assert fm.read({**angles, "brdf": value}).warnings == ()
    (warning,) = fm.read({**angles, elevated: 90 - angles[elevated], "brdf": value}).warnings
    assert "looks like an elevation above the surface" in warning


def elevated(step: float, first: float, mirror: float = 180.0) -> dict[str, np.ndarray]:
    """Curves on both sides of the normal, in zenith angles from `first` on."""
    sensor = np.arange(first, 76.0, step)
    columns = (part.ravel() for part in np.meshgrid(INCIDENCES, sensor, [0.0, 180.0], indexing="ij"))
    theta_i, theta_o, phi = columns
    value = gaussian(theta_i, np.where(phi == mirror, theta_o, -theta_o), 1.0)
    return {"theta_i": theta_i, "theta_o": theta_o, "phi": phi, "brdf": value}


@pytest.mark.parametrize(("step", "first"), [(5.0, 0.0), (5.0, 2.5), (2.5, 0.0)])
def test_two_elevations_are_said_with_the_flag_that_mends_them(step: float, first: float):
    """Both angles from the horizon: the peak stays in the mirror direction."""
    right = elevated(step, first)
    wrong = right | {name: 90.0 - right[name] for name in ("theta_i", "theta_o")}
    (warning,) = fm.read(wrong).warnings
    assert "to the horizon and not to the normal: it and theta_i look like elevations above the surface" in warning
    assert "--columns elevation_i=theta_i,elevation_o=theta_o; if not, confirm with --specular-azimuth 180" in warning
    mended = fm.read(wrong, columns="elevation_i=theta_i,elevation_o=theta_o")
    assert mended.warnings == fm.read(right).warnings == fm.read(wrong, specular_azimuth=180).warnings == ()
    np.testing.assert_allclose(mended.wo, fm.read(right).wo, atol=1e-12)


def test_a_scan_of_grazing_angles_raises_no_alarm():
    """From 30° to 87.5°, where both sides differ, and a model's table to 90°, which begins a step from the normal."""
    sensor = np.arange(30.0, 88.0, 2.5)
    columns = (part.ravel() for part in np.meshgrid([60.0, 75.0, 80.0], sensor, [0.0, 180.0], indexing="ij"))
    theta_i, theta_o, phi = columns
    value = gaussian(theta_i, np.where(phi == 180.0, theta_o, -theta_o), 1.0)
    assert fm.read({"theta_i": theta_i, "theta_o": theta_o, "phi": phi, "brdf": value}).warnings == ()
    table = elevated(10.0, 10.0)
    table["theta_o"] = np.where(table["theta_o"] == 70.0, 90.0, table["theta_o"])
    assert fm.read(table).warnings == ()
