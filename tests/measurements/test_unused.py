"""Columns that play no part and may have meant something; what they tell is said, and nothing is read by them."""

from typing import Any

import numpy as np
import pytest

from fitmat.errors import ReadError
from fitmat.measurements.reader import read

ANGLES = {"theta_i": [30.0] * 5, "theta_o": [-20.0, 0.0, 20.0, 30.0, 40.0], "brdf": [0.1, 0.1, 0.2, 0.3, 0.2]}
TWICE = {name: cells * 2 for name, cells in ANGLES.items()}
SETTING = ["a"] * 5 + ["b"] * 5


def scaled(factor: float) -> dict[str, Any]:
    """Every geometry twice, the second time so many times brighter."""
    return TWICE | {"brdf": ANGLES["brdf"] + [factor * value for value in ANGLES["brdf"]]}


@pytest.mark.parametrize("name", ["uncertainty", "BRDF_err", "U(k=2)", "variance", "rel. sigma", "brdf error [%]"])
def test_what_looks_like_noise_is_said_where_there_is_none(name: str) -> None:
    cells = [0.01] * 5
    (warning,) = read(ANGLES | {name: cells}).warnings
    assert f"pass --columns sigma={name}; turn an expanded uncertainty" in warning
    assert read(ANGLES | {name: cells, "sigma": cells}).warnings == ()
    assert read(ANGLES | {name: [np.nan] * 5}).warnings == ()
    found = read(ANGLES | {name: cells}, columns={"sigma": name} if "%" not in name else None)
    assert (found.sigma is None) == ("%" in name)


def test_a_standard_deviation_by_any_of_its_names_is_read() -> None:
    for name in ("stdev", "Std.Dev", "standard deviation", "std"):
        found = read(ANGLES | {name.replace(".", "_"): [0.01] * 5})
        assert found.sigma is not None, name
        assert found.sigma.tolist() == [[0.01]] * 5


@pytest.mark.parametrize("name", ["mask", "Quality", "saturated", "qc flag 2", "detector status"])
def test_what_looks_like_a_flag_is_said_where_it_varies(name: str) -> None:
    found = read(ANGLES | {name: ["ok"] * 4 + ["bad"]})
    assert f"pass --columns invalid={name} (true leaves a row out)" in found.warnings[0]
    assert found.n_valid == 5
    assert read(ANGLES | {name: ["ok"] * 5}).warnings == ()
    assert "Columns not used" in read(ANGLES | {"operator": ["ok"] * 4 + ["bad"]}).notes[-1]
    assert read(ANGLES | {"operator": ["ok"] * 4 + ["bad"]}).warnings == ()


@pytest.mark.parametrize("name", ["dark", "gain", "Exposure (ms)", "ND filter", "integration time"])
def test_what_readings_may_need_is_said_beside_readings_alone(name: str) -> None:
    readings = {"theta_i": [30.0], "theta_o": [20.0], "signal": [3.0], "reference": [5.0], name: [0.1]}
    (warning,) = read(readings, panel=0.99).warnings
    assert f"The column {name} is not used: readings are taken as they stand" in warning
    assert read(ANGLES | {name: [0.1] * 5}).warnings == ()


@pytest.mark.parametrize("labels", [SETTING, [20.0] * 5 + [80.0] * 5, ["s"] * 5 + ["p"] * 5])
def test_different_things_in_one_geometry_are_said(labels: list[Any]) -> None:
    """A second sample, half as bright: else the two would be the noise of one."""
    found = read(scaled(0.5) | {"what": labels})
    (warning,) = found.warnings
    assert warning.startswith("Rows of one geometry differ in the column what (")
    assert "choose with --where what=…" in warning
    assert read(scaled(0.5) | {"what": labels}, where=f"what={labels[0]}").warnings == ()


def test_repeats_of_one_thing_raise_no_alarm() -> None:
    """Two runs that agree within 2 %; a counter of rows; a column that tells nothing apart; one wavelength each."""
    assert read(scaled(1.02) | {"run": SETTING}).warnings == ()
    assert read(scaled(0.5) | {"row": list(range(10))}).warnings == ()
    assert read(scaled(0.5) | {"side": ["a", "b", "a", "b", "a"] * 2}).warnings == ()
    assert read(scaled(0.5) | {"wavelength": [450.0] * 5 + [650.0] * 5, "lamp": SETTING}).warnings == ()


@pytest.mark.parametrize(("sigma", "doubted"), [(2.0, True), (0.02, False), (0.25, False)])
def test_a_sigma_above_its_values_is_said(sigma: float, doubted: bool) -> None:
    warnings = read(ANGLES | {"sigma": [sigma] * 5}).warnings
    assert (
        any("times its value in the middle one of the rows: is it in percent?" in text for text in warnings) == doubted
    )


def test_an_arm_that_counts_from_the_horizon_is_said() -> None:
    """70° to 130° where 90° is the normal."""
    warnings = read(ANGLES | {"theta_o": [90.0 + angle for angle in ANGLES["theta_o"]]}).warnings
    assert warnings == (
        "theta_o is beyond 90° in 3 of 5 rows, which are not used: is it the angle of an arm that counts from "
        "elsewhere than the normal? Count it from the normal, in the file.",
    )
    assert read(ANGLES | {"theta_o": [-20.0, 0.0, 20.0, 80.0, 95.0]}).warnings == ()


@pytest.mark.parametrize("wavelengths", [[0.45, 0.65], [4.5e-7, 6.5e-7]])
def test_wavelengths_that_are_none_in_nm_are_refused(wavelengths: list[float]) -> None:
    with pytest.raises(ReadError, match=r"expected 100 nm and more; if it is in µm, name the column wavelength \[µm\]"):
        read({"theta_i": [1.0, 1.0], "theta_o": [2.0, 2.0], "brdf": [1.0, 2.0], "wavelength": wavelengths})
    named = {"theta_i": [1.0], "theta_o": [2.0], "brdf": [1.0], "wavelength [µm]": [0.45]}
    assert read(named).channels == ("450",)
