"""Values in percent or as logarithms are asked about, and read as what the user says."""

import math

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import ReadError
from fitmat.measurements.large import chunks
from fitmat.measurements.parsing.scales import stated

EXACT = 1e-12
"""Relative; one exponential and one product."""

THETA_O = np.arange(-60.0, 61.0, 10.0)
BRDF = 0.02 + np.exp(-(((THETA_O - 30.0) / 9.0) ** 2))


def curve(**columns: object) -> dict[str, object]:
    return {"theta_i": np.full(len(THETA_O), 30.0), "theta_o": THETA_O} | columns


@pytest.mark.parametrize(
    ("scale", "number", "sigma", "value", "spread"),
    [
        ("linear", 0.5, 0.1, 0.5, 0.1),
        ("percent", 50.0, 10.0, 0.5, 0.1),
        ("db", -20.0, 1.0, 0.01, 0.01 * math.log(10) / 10),
        ("db", 30.0, 0.1, 1000.0, 10 * math.log(10)),
        ("log10", -2.0, 0.1, 0.01, 0.001 * math.log(10)),
        ("ln", -2.0, 0.1, math.exp(-2), 0.1 * math.exp(-2)),
    ],
)
def test_numbers_and_their_sigma_in_every_scale(scale, number, sigma, value, spread):
    """dB = 10 log₁₀ (IEC 60027-3); σ of g(x) is |g'| σ_x (JCGM 100:2008, eq. 10)."""
    table = {"theta_i": [30.0], "theta_o": [45.0], "brdf": [number], "sigma": [sigma]}
    measured = fm.read(table, scale=scale)
    assert measured.value[0, 0] == pytest.approx(value, rel=EXACT)
    assert measured.sigma is not None
    assert measured.sigma[0, 0] == pytest.approx(spread, rel=EXACT)


@pytest.mark.parametrize(("numbers", "scale"), [(10 * np.log10(BRDF), "db"), (np.log10(BRDF), "log10")])
def test_logarithms_are_asked_about(numbers, scale):
    with pytest.raises(
        ReadError, match=r"92% of the values are negative, .*--scale db, --scale log10 or --scale ln; if"
    ):
        fm.read(curve(brdf=numbers))
    assert fm.read(curve(brdf=numbers), scale=scale).value[:, 0] == pytest.approx(BRDF, rel=EXACT)


def test_a_channel_of_logarithms_is_named():
    with pytest.raises(ReadError, match="dict, channel g: 92% of the values are negative"):
        fm.read(curve(brdf_r=BRDF, brdf_g=np.log10(BRDF)))


def test_a_sentinel_among_logarithms_is_no_datum():
    numbers = np.log10(BRDF)
    numbers[3] = -999.0
    assert fm.read(curve(brdf=numbers), scale="log10").masked == {"sentinel -999": 1}


def test_noise_about_zero_and_a_floor_subtracted_twice_are_no_logarithms():
    rng = np.random.default_rng(1)
    for _ in range(100):
        assert fm.read(curve(brdf=BRDF - 0.02 + 0.01 * rng.normal(size=len(BRDF)))).n_valid == len(BRDF)
    floor = np.where(np.abs(THETA_O - 30) < 5, 100.0, -0.01 + 1e-4 * THETA_O / 60)
    assert fm.read(curve(brdf=floor)).n_valid == len(BRDF)


def test_decibels_of_a_bright_surface_are_asked_about():
    """A reflectance factor of 0.79 is −1 dB; half of the values lie in the lobe, and above 0."""
    angle = np.arange(-70.0, 71.0, 2.5)
    rng = np.random.default_rng(3)
    factor = (0.79 + 20 * np.exp(-(((angle - 30) / 25) ** 2))) * (1 + 0.01 * rng.normal(size=len(angle)))
    table = {"theta_i": np.full(len(angle), 30.0), "theta_o": angle, "brf": 10 * np.log10(factor)}
    assert np.mean(table["brf"] < 0) < 0.4
    with pytest.raises(ReadError, match=r"of the values are negative, .*--scale db"):
        fm.read(table)
    np.testing.assert_allclose(np.pi * fm.read(table, scale="db").value[:, 0], factor, rtol=1e-12)


def test_a_dark_signal_subtracted_twice_under_a_peak_is_no_logarithm():
    """Of 1 % of the peak, half of the rows; and noise about zero of any size."""
    angle = np.arange(-70.0, 71.0, 2.5)
    table = {"theta_i": np.full(len(angle), 30.0), "theta_o": angle}
    peak = np.exp(-(((angle - 30) / 10) ** 2))
    assert fm.read(table | {"brdf": peak - 0.01}).n_valid == len(angle)
    for seed in range(30):
        noise = np.random.default_rng(seed).normal(size=len(angle))
        assert fm.read(table | {"brdf": 3 * peak + noise}).n_valid == len(angle)


def test_what_is_confirmed_is_not_asked_about():
    measured = fm.read(curve(brdf=np.log10(BRDF)), scale="linear")
    assert measured.value[:, 0] == pytest.approx(np.log10(BRDF), rel=EXACT)


@pytest.mark.parametrize(
    ("name", "scale"),
    [("log10(BRDF)", "log10"), ("brdf [dB]", "db"), ("BRDF_dB", "db"), ("10*log10(f_r)", "db"), ("ln_brdf", "ln")],
)
def test_names_of_logarithms_are_asked_about(name, scale):
    table = curve(**{name: np.full(len(BRDF), 1.0)})
    with pytest.raises(ReadError, match=f"says that it holds logarithms of .* pass --scale {scale}; if they are plain"):
        fm.read(table)
    assert len(fm.read(table, scale=scale).notes) == 3


@pytest.mark.parametrize("name", ["brdf", "brdf_b", "reflectance_factor", "log", "wood_b", "db"])
def test_names_without_a_logarithm(name):
    assert stated(name) == (name, "")


def test_a_plain_column_is_preferred_to_its_logarithm():
    measured = fm.read(curve(**{"brdf [dB]": 10 * np.log10(BRDF), "brdf": BRDF}))
    assert measured.value[:, 0] == pytest.approx(BRDF, rel=EXACT)
    assert "Columns not used: brdf [dB]." in measured.notes


@pytest.mark.parametrize(
    ("numbers", "floor"), [(100 * math.pi * BRDF, "6.28"), (np.full(len(BRDF), 95.0), "95")], ids=["gloss", "white"]
)
def test_percent_is_asked_about(numbers, floor):
    with pytest.raises(
        ReadError, match=f"reflectance factors of {floor} and more far from .* pass --scale percent; if"
    ):
        fm.read(curve(reflectance_factor=numbers))
    measured = fm.read(curve(reflectance_factor=numbers), scale="percent")
    assert measured.value[:, 0] == pytest.approx(numbers / 100 / math.pi, rel=EXACT)


def test_a_mirror_and_a_retro_reflector_are_no_percent():
    peaks = sum(1e4 * np.exp(-(((THETA_O - at) / 5.0) ** 2)) for at in (-30.0, 30.0))
    assert fm.read(curve(reflectance_factor=0.1 + peaks)).n_valid == len(BRDF)


@pytest.mark.parametrize(("numbers", "flag"), [(np.log10(BRDF), "--scale db"), (300 * BRDF, "--scale percent")])
def test_a_large_file_asks_the_same(tmp_path, numbers, flag):
    path = tmp_path / "large.csv"
    rows = np.stack([np.full(len(BRDF), 30.0), THETA_O, numbers], axis=1)
    np.savetxt(path, rows, delimiter=",", header="theta_i,theta_o,reflectance_factor", comments="", fmt="%.6g")
    said = []
    for read in (fm.read, lambda path: chunks.scan(path, rows=5)):
        with pytest.raises(ReadError, match=flag) as raised:
            read(path)
        said.append(str(raised.value))
    assert said[0] == said[1]
    scale = flag.split()[-1]
    whole, parts = fm.read(path, scale=scale), chunks.scan(path, rows=5, scale=scale)
    np.testing.assert_array_equal(np.concatenate([part.value for part in parts]), whole.value)
    assert parts.part.notes == whole.notes


def test_a_sentinel_in_one_block_of_a_large_file_of_logarithms(tmp_path):
    numbers = np.log10(BRDF)
    numbers[8] = -999.0
    path = tmp_path / "large.csv"
    rows = np.stack([np.full(len(BRDF), 30.0), THETA_O, numbers], axis=1)
    np.savetxt(path, rows, delimiter=",", header="theta_i,theta_o,brdf", comments="", fmt="%.6g")
    found, whole = chunks.scan(path, rows=5, scale="log10"), fm.read(path, scale="log10")
    assert found.part.masked == whole.masked == {"sentinel -999": 1}
    np.testing.assert_array_equal(found.part.valid, whole.valid)
