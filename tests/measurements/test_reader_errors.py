"""Every wrong table gives one ReadError that says what, where, got, expected and what to do."""

import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from fitmat.errors import ReadError
from fitmat.measurements.instrument import Instrument
from fitmat.measurements.reader import read

HEAD = "theta_i,theta_o,brdf\n"
GOOD = HEAD + "30,45,0.5\n"
VALUE = "theta_i,theta_o,value\n30,45,0.5\n"


def also(names: str, cells: str) -> str:
    """The good table with more columns before its own."""
    return f"{names},{GOOD}".replace("\n", f"\n{cells},", 1)


BAD_FILES: dict[str, tuple[str | bytes, str]] = {
    "empty": (b"", r"bad\.csv: the file is empty \(0 bytes\), expected measurements"),
    "blank": ("\n \n,,\n", "nothing but comments or blank lines, expected a header line"),
    "comments": ("# a\n% b\n// c\n; d\n", "nothing but comments or blank lines"),
    "header only": (HEAD, r"a header and no rows \(theta_i, theta_o, brdf\)"),
    "NUL bytes": (b"theta_i\x00,theta_o\n", "a binary file or an unknown encoding.*Export it as CSV"),
    "undecodable": (b"theta_i,theta_o\n\x81\x8d", "a binary file or an unknown encoding"),
    "half of UTF-16": (b"\xff\xfea", "a binary file or an unknown encoding"),
    "image": (b"\x89PNG\r\n\x1a\n", "a picture, .*Name the file of the numbers behind it"),
    "ragged": ("# a\n" + GOOD + "\n30,45\n", r"bad\.csv row 5: 2 cells, expected 3 as in row 2"),
    "too many cells": (GOOD + "30,45,0,5\n", "row 3: 4 cells, expected 3 as in row 1"),
    "lone quote": (GOOD + '30,45,"0.5\n', r'row 3: a quote \("\) without its end'),
    "broken quotes": ('theta_i,theta_o,brdf\n"30"5,45,0.5\n', "not a table .*Remove the quotes"),
    "text": (GOOD + "30,45,abc\n", "row 3: brdf = abc, expected a number. Correct the cell"),
    "text in an angle": ("#\n" + GOOD + "3O,45,1\n", r"bad\.csv row 4: theta_i = 3O, expected a number"),
    "thousands or decimals": (
        HEAD + '30,45,"1,234"\n30,50,"5,678"\n',
        r"row 2: brdf = 1,234, expected .* it may be 1234 or 1\.234\. Write it without the comma, or with a point\.",
    ),
    "mixed decimals": ("theta_i;theta_o;brdf\n30;45;0.5\n30;45,5;1\n", "row 3: theta_o = 45,5, expected one"),
    "all masked": (
        HEAD + "30,95,0.5\n30,45,nan\n",
        r"every row is masked \(1 at or below the horizon, 1 value",
    ),
    "beyond 180": (GOOD + "30,181,0.5\n", "row 3: theta_o = 181, expected −180 to 180 degrees"),
    "azimuth beyond 360": ("phi," + HEAD + "361,30,45,1\n", "row 2: phi = 361, expected −360 to 360 degrees"),
    "perhaps radians": (
        HEAD + "0.5,1.5,1\n0,-1.6,1\n",
        "exceeds 1.6, .*--angle-unit radians or --angle-unit deg",
    ),
    "perhaps an azimuth in radians": (
        "phi," + HEAD + "0,30,45,1\n3.14159,30,45,1\n",
        "no azimuth exceeds 3.14159, .* Confirm with --angle-unit phi=radians or --angle-unit phi=degrees",
    ),
    "perhaps azimuths in radians": (
        "phi_i,phi_o," + HEAD + "0,-1.5708,30,45,1\n",
        "no azimuth exceeds 1.5708, .* --angle-unit phi_i=radians,phi_o=radians or --angle-unit phi_i=degrees,phi_o=",
    ),
    "perhaps one zenith in radians": (
        HEAD + "30,-1.2,1\n30,0,1\n30,1.2,1\n",
        "no theta_o exceeds 1.2, expected degrees as of the other zenith angle; .*--angle-unit theta_o=radians or",
    ),
    "comments that contradict each other": (
        "# theta_i = 30\ntheta_o,brdf\n1,2\n# theta_i = 60\n1,2\n",
        r"comments state theta_i = 30 in row 1 and 60 in row 4, expected one for the file\. Give it a column, or split",
    ),
    "elevation beside zenith": (also("elevation_i", "60"), "theta_i and elevation_i, expected one: elevation_i is 90°"),
    "below the horizon": (
        "elevation_i,theta_o,brdf\n91,45,1\n",
        "row 2: elevation_i = 91, expected −90 to 90 degrees",
    ),
    "foreign columns": (
        "Zenith,Azimuth,I\n1,2,3\n",
        r"the columns are Zenith, Azimuth, I, expected theta_i \(or .*aoi, .*…\) and theta_o .*columns=\"theta_i",
    ),
    "a name that means empty": (
        "theta_i,theta_o,brdf,NA\n20,20,0.5,1\n",
        r"bad\.csv row 1: column 4 is named NA, which means empty, expected a name\. Rename it\.",
    ),
    "a dash as a name": ("#\ntheta_i;-;theta_o\n20;1;20\n", r"row 2: column 2 is named -, which means empty"),
    "no header": ("30,45,0.5\n", "no header line and 3 columns, expected theta_i"),
    "no theta_o": ("theta_i,brdf\n30,0.5\n", r"the columns are theta_i, brdf, expected theta_o \(or theta_out, .* …\)"),
    "no quantity": ("theta_i,theta_o,I\n30,45,1\n", "expected a measured quantity: brdf, brdf_cos, refl"),
    "unsaid quantity": (VALUE, "value does not say what it holds.*refuses to guess: pass quantity="),
    "two quantities": (also("brf", "1"), "brdf and reflectance_factor at once, expected one"),
    "phi twice over": (
        also("phi,phi_i,phi_o", "1,2,3"),
        "phi and phi_i and phi_o, expected phi, or phi_i and phi_o",
    ),
    "light on a signed axis": (
        "theta_i,theta_o,brdf\n-20,20,0.5\n",
        r"row 2: theta_i = -20, expected .* pass --forward negative if that of theta_i = −20 is theta_o = 20, --forw",
    ),
    "phi_o alone": (also("phi_o", "1"), r"phi_o alone, expected phi_i.*columns=\"phi=phi_o\""),
    "duplicate names": (also("brdf", "1"), r"columns 1 and 4 \(brdf, brdf\) are both brdf"),
    "duplicate by alias": (also("AOI", "1"), r"\(AOI, theta_i\) are both theta_i, expected one"),
    "plain and channels": (also("brdf_r", "1"), "brdf and brdf_… columns, expected one kind"),
    "two ways to channels": (
        "theta_i,theta_o,wavelength,brdf_r\n30,45,550,1\n",
        "channels named in two ways, expected one channel per column",
    ),
    "wavelength and channel": (
        also("wavelength,channel", "550,r"),
        "channels named in two ways",
    ),
    "sigma without value": (
        "theta_i,theta_o,brdf_r,sigma_g\n30,45,1,1\n",
        "sigma_g given, expected sigma_r. Name them alike, or give one plain sigma",
    ),
    "sigma for some": (
        "theta_i,theta_o,brdf_r,brdf_g,sigma_g\n30,45,1,1,1\n",
        "sigma_g given, expected sigma_r, sigma_g",
    ),
    "no wavelength": (also("wavelength", ""), r"row 2: wavelength = \(empty\), expected a wavelength in nm"),
    "negative wavelength": (also("wavelength", "-5"), "wavelength = -5, expected a wavelength"),
    "no channel": (also("channel", ""), r"row 2: channel = \(empty\), expected the name of a channel"),
    "odd flag": (also("valid", "maybe"), "row 2: valid = maybe, expected true or false"),
}


@pytest.mark.parametrize(("content", "message"), BAD_FILES.values(), ids=BAD_FILES)
def test_bad_files(tmp_path, content, message):
    path = tmp_path / "bad.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(ReadError, match=message) as raised:
        read(path)
    assert str(raised.value).startswith("bad.csv")
    assert "\n" not in str(raised.value)


BAD_OPTIONS: dict[str, tuple[str, dict[str, Any], str]] = {
    "quantity": (VALUE, {"quantity": "luminance"}, "quantity = 'luminance' .*expected 'brdf' or 'brdf_cos' or"),
    "radiance without source": (VALUE, {"quantity": "radiance"}, "expected the source beside them: intensity= in W/sr"),
    "intensity alone": (VALUE, {"quantity": "radiance", "intensity": 1.0}, "intensity alone, expected intensity and"),
    "no distance": (
        VALUE,
        {"quantity": "radiance", "intensity": 1.0, "distance": 0.0},
        r"distance = 0 \(--distance\), expected a pos",
    ),
    "angle unit": (GOOD, {"angle_unit": "grad"}, r"angle_unit = 'grad' \(--angle-unit\), expected 'degrees'"),
    "angle unit of a column": (
        GOOD,
        {"angle_unit": "phi=rad"},
        "angle_unit = 'phi=rad' .*'phi=radians,theta_o=degrees'",
    ),
    "angle unit of no column": (
        GOOD,
        {"angle_unit": "phi=gon"},
        "angle_unit names phi .*expected one of .*theta_i, the",
    ),
    "constant beside its column": (
        GOOD,
        {"constants": {"theta_i": 30}},
        r"theta_i = 30 \(--theta-i\) beside a column of that meaning, theta_i, expected one of them",
    ),
    "constant beside a mapped column": (
        "1,2,3\n",
        {"columns": "theta_i=1,theta_o=2,brdf=3", "constants": {"theta_o": 5}},
        r"theta_o = 5 \(--theta-o\) beside a column of that meaning, column 2",
    ),
    "constant beside an alias": ("AOI,VZA,BRF\n1,2,3\n", {"constants": {"theta_i": 5}}, "that meaning, AOI, expected"),
    "unknown constant": (GOOD, {"constants": {"gloss": 3}}, r"gloss = 3 \(--gloss\), expected one of theta_i, theta_o"),
    "constant of no value": (
        "theta_o,brdf\n1,2\n",
        {"constants": {"theta_i": float("nan")}},
        "theta_i = nan .*expected a number",
    ),
    "constant out of range": (
        "theta_o,brdf\n1,2\n",
        {"constants": {"theta_i": 200}},
        "theta_i = 200.0, expected −180 to 180",
    ),
    "forward": (GOOD, {"forward": "up"}, "forward = 'up' .*expected 'positive' or 'negative'"),
    "specular azimuth": (GOOD, {"specular_azimuth": 45}, "specular_azimuth = 45 .*expected 180 or 0 or 90 or 270"),
    "quantity denied": (
        GOOD,
        {"quantity": "brdf_cos"},
        'column is named brdf, expected them to agree.*columns="brdf_cos=brdf"',
    ),
    "forward with azimuth": (
        also("phi", "1"),
        {"forward": "negative"},
        "forward = negative beside azimuth columns, expected only without",
    ),
    "specular azimuth without": (
        GOOD,
        {"specular_azimuth": 0},
        "specular_azimuth = 0 without an azimuth column",
    ),
    "beyond π": (GOOD, {"angle_unit": "radians"}, "theta_i = 30, expected −3.1416 to 3.1416 radians"),
    "no such column": (GOOD, {"columns": "brdf=I"}, "no column 'I'; the columns are theta_i, theta_o, brdf"),
    "no name": ("30,45,1\n", {"columns": {"brdf": ""}}, "no column ''; no header line and 3 columns"),
    "number 0": (GOOD, {"columns": {"brdf": 0}}, "no column 0, expected 1 to 3"),
    "number too large": (GOOD, {"columns": "brdf=4"}, "no column 4, expected 1 to 3"),
    "unknown role": (GOOD, {"columns": "gloss=3"}, "columns maps 'gloss', expected one of theta_i, theta_o"),
    "no pair": (GOOD, {"columns": "theta_i"}, "columns = 'theta_i', expected pairs ours=theirs"),
    "half a pair": (GOOD, {"columns": "theta_i="}, "columns = 'theta_i=', expected pairs ours=theirs"),
    "one column for two": (GOOD, {"columns": "theta_i=1,theta_o=1"}, "columns maps theta_o or '1' twice"),
    "two columns for one": (GOOD, {"columns": "theta_i=1,aoi=2"}, "columns maps aoi or '2' twice"),
    "ambiguous name": (
        also("x,x", "1,2"),
        {"columns": "brdf=x"},
        "2 columns are named x, expected one. Say which by its number, 1 to 5",
    ),
}


@pytest.mark.parametrize(("content", "options", "message"), BAD_OPTIONS.values(), ids=BAD_OPTIONS)
def test_bad_options(tmp_path, content, options, message):
    path = tmp_path / "good.csv"
    path.write_text(content)
    with pytest.raises(ReadError, match=message):
        read(path, **options)


class Foreign:
    """Has columns, but gives none of them."""

    columns = ("theta_i",)

    def __getitem__(self, name: str) -> object:
        raise KeyError(name)


BAD_SOURCES: dict[str, tuple[Any, str]] = {
    "number": (7, "int: not measurements, expected a path, a data frame or a dict of arrays"),
    "array": (np.zeros((2, 3)), "ndarray: not measurements"),
    "foreign frame": (Foreign(), "Foreign: its columns cannot be read as arrays"),
    "no column": ({}, "dict: no rows, expected at least one"),
    "no row": ({"theta_i": [], "brdf": []}, "dict: no rows"),
    "unlike lengths": ({"theta_i": [1, 2], "brdf": [1]}, r"unlike length \(theta_i: 2, brdf: 1\)"),
    "scalar": ({"theta_i": 30.0}, r"column theta_i has shape \(\), expected \(n,\)"),
    "frame with a name twice": (pd.DataFrame([[1, 2]], columns=["brdf", "brdf"]), r"brdf has shape \(1, 2\)"),
    "ragged list": ({"theta_i": [[1], [1, 2]]}, "column theta_i is not an array"),
    "text in row 2": (
        {"theta_i": [30, 30], "theta_o": ["45", "x"], "brdf": [1, 1]},
        "dict row 2: theta_o = x",
    ),
}


@pytest.mark.parametrize(("source", "message"), BAD_SOURCES.values(), ids=BAD_SOURCES)
def test_bad_sources(source, message):
    with pytest.raises(ReadError, match=message):
        read(source)


def test_odd_names_and_texts_are_shown_plainly():
    """Halves of characters, which UTF-8 cannot hold, structures, and names that a terminal would obey."""
    angles = {"theta_i": [30.0], "theta_o": [30.0]}
    with pytest.raises(ReadError, match=r"row 1: brdf = \?, expected a number"):
        read({**angles, "brdf": np.array(["\ud800"])})
    with pytest.raises(ReadError, match=r"column brdf is not an array .*, expected \(n,\) numbers or texts"):
        read({**angles, "brdf": np.zeros(1, [("a", float), ("b", int)])})
    with pytest.raises(ReadError, match=r"the columns are theta_i, theta_o, a b, \\u001b\[2J, expected a measured"):
        read({**angles, "a\n b": [1.0], "\x1b[2J": [1.0]})


def test_readings_that_overflow_are_masked():
    """∞ · 0 in the σ of a ratio is no number, not a warning."""
    signals = {"signal": [np.inf, 1e308, 1.0], "reference": [1.0, 1e-5, 2.0], "sigma": [0.1] * 3}
    found = read({"theta_i": [30.0] * 3, "theta_o": [30.0] * 3, **signals, "sigma_reference": [0.0, 0.1, 0.1]}, panel=1)
    assert found.valid[:, 0].tolist() == [False, False, True]


def test_missing_file(tmp_path):
    with pytest.raises(ReadError, match=r"none\.csv: no such file, expected measurements"):
        read(tmp_path / "none.csv")


def test_directory(tmp_path):
    with pytest.raises(ReadError, match="a directory, expected a file"):
        read(tmp_path)


@pytest.mark.parametrize("path", ["a\0b", "a" * 9000], ids=["NUL", "too long"])
def test_impossible_path(path):
    with pytest.raises(ReadError, match="cannot be opened"):
        read(path)


def test_unreadable_file(tmp_path, monkeypatch):
    def refuse(path: Path, mode: str) -> bytes:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(ReadError, match=r"cannot be opened \(Permission denied\), expected a readable file"):
        read(tmp_path / "locked.csv")


IN_PLANE_FRED = "type bsdf_data\nformat angles=deg bsdf=value scale=1\n15 0\n-15 0 0.0015\n0 0 0.002\n15 0 0.1\n"

NEEDLESS: dict[str, tuple[dict[str, Any], str]] = {
    "columns": ({"columns": "brdf=3"}, r"no columns= \(--columns\): the format settles it"),
    "quantity": ({"quantity": "brdf"}, r"no quantity= \(--quantity\): the format settles it"),
    "where": ({"where": "material=Alu"}, r"no where= \(--where\): the format settles it"),
    "angle unit": ({"angle_unit": "degrees"}, r"no angle_unit= \(--angle-unit\): the format settles it"),
    "forward": ({"forward": "negative"}, r"no forward= \(--forward\): the format settles it"),
    "specular azimuth": (
        {"specular_azimuth": 0},
        r"no specular_azimuth= \(--specular-azimuth\): the format settles it",
    ),
    "scale": ({"scale": "db"}, r"no scale= \(--scale\): the format settles it"),
    "constants": ({"constants": {"theta_i": 30.0}}, r"no theta_i= \(--theta-i\): the format settles it"),
    "panel": ({"panel": 0.99}, r"panel = 0\.99 \(--panel\), expected none: the values are brdf"),
    "source": ({"intensity": 1.0, "distance": 2.0}, r"\(--intensity, --distance\), expected none: the values are brdf"),
    "calibration": (
        {"unknown_scale": True, "instrument": Instrument(calibration=0.1)},
        r"calibration = 0\.1 \(--calibration\) beside unknown_scale",
    ),
}


@pytest.mark.parametrize(("options", "message"), NEEDLESS.values(), ids=NEEDLESS)
def test_what_a_format_settles_is_not_said_again(tmp_path, options, message):
    """Every option of `read` but unknown_scale and instrument, which speak of no format."""
    path = tmp_path / "lobe.txt"
    path.write_text(IN_PLANE_FRED)
    with pytest.raises(ReadError, match=message) as raised:
        read(path, **options)
    assert str(raised.value).startswith("lobe.txt: ")


def test_every_option_has_a_format_that_settles_it():
    said = {option for options, _ in NEEDLESS.values() for option in options}
    assert said == inspect.signature(read).parameters.keys() - {"source"}
