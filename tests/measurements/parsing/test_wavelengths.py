"""Channels named by wavelengths that cannot all be what they say, and those that can."""

import re

import pytest

import fitmat as fm
from fitmat.errors import ReadError


def table(*channels: str) -> dict[str, list[float]]:
    angles = {"theta_i": [10.0, 30.0, 50.0, 70.0], "theta_o": [10.0, 25.0, 50.0, 60.0]}
    return angles | {f"brdf_{name}": [0.1, 0.2, 0.15, 0.12 + 0.01 * k] for k, name in enumerate(channels)}


@pytest.mark.parametrize(
    ("channels", "message"),
    [
        (("450", "550", "450.0"), "channels 450 and 450.0 are one wavelength, expected it once. Remove one."),
        (
            ("450", "0.55", "650"),
            "channels 0.55 and 450 are wavelengths in two units, expected nm. Rename the columns.",
        ),
        (("0.45", "0.55"), "channels 0.45, 0.55 look like wavelengths in µm, expected nm: 450, 550. Rename"),
        (("1.55", "10.6", "3.39"), "look like wavelengths in µm, expected nm: 1550, 10600, 3390"),
    ],
)
def test_wavelengths_of_two_units_or_twice_are_refused(channels: tuple[str, ...], message: str) -> None:
    with pytest.raises(ReadError, match=message.replace(".", r"\.")):
        fm.read(table(*channels))


@pytest.mark.parametrize("channels", [("650", "450", "550"), ("1550", "1064", "905"), ("1", "2", "3"), ("r", "g", "b")])
def test_others_are_read_in_the_order_of_the_file(channels: tuple[str, ...]) -> None:
    assert fm.read(table(*channels)).channels == channels


@pytest.mark.parametrize(
    ("name", "lengths", "message"),
    [
        (
            "wavelength",
            [550.0, 0.65],
            "wavelength = 0.65, expected all wavelengths of the column in one unit, nm or µm",
        ),
        ("wavelength [µm]", [0.55, 650.0], "= 650.0, expected all wavelengths of the column in one unit"),
        (
            "wavelength [µm]",
            [550.0, 650.0],
            "expected less than 100 µm; if it is in nm, name the column wavelength [nm]",
        ),
        ("wavelength", [550.0, -650.0], "= -650.0, expected a wavelength in nm"),
        ("channel", ["550", "0.65"], "channels 0.65 and 550 are wavelengths in two units, expected nm"),
        ("channel", ["550", "550.0"], "channels 550 and 550.0 are one wavelength, expected it once"),
    ],
)
def test_a_column_of_wavelengths_in_two_units_is_refused(name: str, lengths: list, message: str) -> None:
    with pytest.raises(ReadError, match=re.escape(message)):
        fm.read({"theta_i": [10.0, 10.0], "theta_o": [20.0, 20.0], "brdf": [0.1, 0.2], name: lengths})


@pytest.mark.parametrize(
    ("name", "lengths", "channels"),
    [
        ("wavelength [µm]", [0.55, 10.6], ("550", "10600")),
        ("wavelength", [550.0, 10600.0], ("550", "10600")),
        ("channel", ["1", "2"], ("1", "2")),
    ],
)
def test_a_column_of_wavelengths_in_one_unit_is_read(name: str, lengths: list, channels: tuple[str, ...]) -> None:
    given = {"theta_i": [10.0, 10.0], "theta_o": [20.0, 20.0], "brdf": [0.1, 0.2], name: lengths}
    assert fm.read(given).channels == channels
