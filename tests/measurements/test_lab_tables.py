"""Tables as laboratories keep them: notes and units around the numbers, runs among which one is chosen."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from fitmat.errors import ReadError
from fitmat.measurements.large import chunks
from fitmat.measurements.parsing import units
from fitmat.measurements.reader import read

HEAD = "theta_i,theta_o,brdf\n"
TABLE = HEAD + "30,20,0.5\n30,30,0.25\n"


def written(folder: Path, content: str) -> Path:
    path = folder / "lab.csv"
    path.write_text(content, encoding="utf-8")
    return path


# --- what stands around the numbers ---------------------------------------------------------------

ROUND: dict[str, tuple[str, str]] = {
    "notes": ("Sample: Alu, brushed\nOperator AM\n\n" + TABLE, "above the header: Sample: Alu, brushed, Operator AM"),
    "padded notes": ("Sample,,\nLamp 3,,\n" + TABLE, "Read as notes, above the header: Sample,,, Lamp 3"),
    "notes above semicolons": ("Probe A\n" + TABLE.replace(",", ";").replace(".", ","), "header: Probe A"),
    "notes above white space": ("Scan of 3 May\n" + TABLE.replace(",", "  "), "header: Scan of 3 May"),
    "notes and units": ("Probe A\n" + TABLE.replace(HEAD, HEAD + "deg,deg,1/sr\n"), "Row 3 read as units: deg, deg"),
    "units": (TABLE.replace(HEAD, HEAD + "[deg],[deg],[1/sr]\n"), "Row 2 read as units: [deg], [deg]"),
    "sep": ("sep=;\n" + TABLE.replace(",", ";"), ""),
    "quoted sep": ('"sep=|"\n' + TABLE.replace(",", "|"), ""),
    "sep and decimal commas": ("SEP=;\n" + TABLE.replace(",", ";").replace(".", ","), ""),
    "Fortran": (HEAD + "3.0D+01,2.0D+01,5.0D-01\n3.0d1,3.0D1,+2.5D-01\n", ""),
}  # fmt: skip


@pytest.mark.parametrize(("content", "note"), ROUND.values(), ids=ROUND)
def test_what_stands_around_the_numbers_is_understood(tmp_path, content, note):
    found = read(written(tmp_path, content))
    assert found.value.tolist() == [[0.5], [0.25]]
    assert np.rad2deg(found.theta_o) == pytest.approx([20, 30], abs=1e-9)
    assert any(words.startswith(note) or note in words for words in found.notes)
    parts = list(chunks.scan(tmp_path / "lab.csv", rows=1))
    assert [part.value.tolist() for part in parts] == [[[0.5]], [[0.25]]]


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("My scan\n30,20,0.5\n30,30,0.25\n", "row 2: .* cells, expected"),
        ("Angles 1 2 3 4\n" + TABLE, r"row 2: .* cells, expected"),
        (HEAD + "30,abc,def\n30,30,0.25\n", "row 2: theta_o = abc, expected a number"),
        (TABLE + "the end\n", "row 4: 1 cells, expected 3"),
    ],
)
def test_words_that_may_be_anything_are_refused(tmp_path, content, sentence):
    with pytest.raises(ReadError, match=sentence):
        read(written(tmp_path, content))


# --- units in the header --------------------------------------------------------------------------


@pytest.mark.parametrize(
    "header",
    [
        "theta_i [rad],theta_o (Rad),phi / rad,brdf [1/sr]",
        "theta_i_rad,theta_o [radians],phi (rad),brdf",
        "θ_i [rad],θ_o [rad],φ [rad],f_r",
    ],
)
def test_radians_in_the_header_are_turned_into_degrees(tmp_path, header):
    text = f"{header}\n{np.pi / 6!r},{np.pi / 4!r},{np.pi!r},0.5\n0,{np.pi / 3!r},{np.pi!r},0.25\n"
    for found in (read(written(tmp_path, text)), *chunks.scan(tmp_path / "lab.csv")):
        assert np.rad2deg(found.theta_i) == pytest.approx([30, 0], abs=1e-9)
        assert np.rad2deg(found.theta_o) == pytest.approx([45, 60], abs=1e-9)
        assert np.rad2deg(found.phi[:1]) == pytest.approx([180], abs=1e-6)
        assert "Angles read as radians." in found.notes


def test_each_angle_has_its_own_unit(tmp_path):
    text = f"theta_i [deg],theta_o (°),phi [rad],brdf\n30,45,{np.pi / 2!r},0.5\n"
    found = read(written(tmp_path, text))
    assert np.rad2deg([found.theta_i[0], found.theta_o[0], found.phi[0]]) == pytest.approx([30, 45, 90], abs=1e-9)
    assert "Angles read: theta_i in degrees, theta_o in degrees, phi in radians." in found.notes


def test_units_below_the_header_count_like_those_in_it(tmp_path):
    text = f"Zenith,theta_o,reflectance_factor\nrad,deg,%\n{np.pi / 6!r},45,50\n"
    found = read(written(tmp_path, text), columns={"theta_i": "Zenith"})
    assert np.rad2deg(found.theta_i) == pytest.approx([30], abs=1e-9)
    assert found.value == pytest.approx(0.5 / np.pi, rel=1e-15)


@pytest.mark.parametrize("names", ["brf [%],sigma", "reflectance_factor / %,sigma [%]", "R (%),sigma (percent)"])
def test_percentages_are_divided_by_a_hundred(tmp_path, names):
    path = written(tmp_path, f"theta_i,theta_o,{names}\n30,20,50,0.5\n")
    found = read(path, columns={"reflectance_factor": "R (%)"} if names.startswith("R") else None)
    assert found.value == pytest.approx(0.5 / np.pi, rel=1e-15)
    assert found.sigma == pytest.approx(0.005 / np.pi, rel=1e-15)
    assert "Values read as percent: divided by 100." in found.notes


def test_gon_in_the_header_are_four_hundred_a_turn(tmp_path):
    """Beside a flag that says the same of another column."""
    text = f"theta_i [gon],theta_o,phi,brdf\n50,{np.pi / 4!r},90,0.5\n"
    found = read(written(tmp_path, text), angle_unit="theta_o=radians")
    assert np.rad2deg([found.theta_i[0], found.theta_o[0], found.phi[0]]) == pytest.approx([45, 45, 90], abs=1e-9)


def test_micrometres_are_nanometres(tmp_path):
    found = read(written(tmp_path, "theta_i,theta_o,wavelength [µm],brdf\n30,20,0.55,0.5\n30,20,1.064,0.25\n"))
    assert found.channels == ("550", "1064")


@pytest.mark.parametrize(
    ("header", "options", "sentence"),
    [
        ("theta_i [rad],theta_o [rad],brdf", {"angle_unit": "degrees"}, r"the header says theta_i \[rad\], --angle"),
        ("theta_i,theta_o,brdf [%]", {}, r"brdf or its sigma in %, expected brdf in its own unit\. Is it a ref"),
        ("theta_i,theta_o,brf,sigma [%]", {}, r"only sigma \[%\] in %, expected all values alike"),
        ("theta_i,theta_o,brdf,sigma [%]", {}, r"brdf or its sigma in %.*multiply it out"),
        ("theta_i,theta_o,phi [turns],brdf", {}, r"the column phi \[turns\] is in turns, expected deg, rad or gon"),
        ("theta_i [mrad],theta_o,brdf", {}, r"the column theta_i \[mrad\] is in mrad, expected deg, rad or gon"),
        ("theta_i,theta_o,brf [%]", {"scale": "db"}, r"the header says %, --scale says db, expected them to agree"),
        ("theta_i,theta_o,wavelength (Å),brdf", {}, r"is in Å, expected nm or µm"),
    ],
)  # fmt: skip
def test_units_that_cannot_be_meant_are_refused(tmp_path, header, options, sentence):
    row = ",".join(["30"] * len(header.split(",")))
    with pytest.raises(ReadError, match=sentence):
        read(written(tmp_path, f"{header}\n{row}\n{row}\n"), **options)


def test_a_name_without_a_unit_stays_as_it_is():
    assert units.split("brdf_r") == ("brdf_r", "")
    assert units.split("brdf [1/sr]") == ("brdf", "")
    assert units.split("theta_i / °") == ("theta_i", "deg")
    assert units.split("rad") == ("rad", "")


# --- the rows to read -----------------------------------------------------------------------------

RUNS = "theta_i,theta_o,brdf,run,batch\n" + "".join(
    f"30,{k},{k},{run},{batch}\n"
    for k, (run, batch) in enumerate(
        [("20", "7"), ("20.0", "007"), ("2e1", "A"), ("2.0D+01", "7"), ("30", "7.0"), ("", "x")], 1
    )
)


@pytest.mark.parametrize("value", ["20", "20.0", "2e1", "+20", "2,0e1"])
def test_a_number_is_chosen_however_it_is_written(tmp_path, value):
    path = written(tmp_path, RUNS)
    assert read(path, where=f"run={value}").value.ravel().tolist() == [1, 2, 3, 4]
    assert np.concatenate([part.value.ravel() for part in chunks.scan(path, where=f"run={value}")]).tolist() == [
        1,
        2,
        3,
        4,
    ]


def test_text_is_chosen_as_it_is_written(tmp_path):
    path = written(tmp_path, RUNS)
    assert read(path, where="batch=7").value.ravel().tolist() == [1, 4]
    assert read(path, where="batch=007").value.ravel().tolist() == [2]
    assert np.concatenate([part.value.ravel() for part in chunks.scan(path, where="batch=7")]).tolist() == [1, 4]


def test_a_number_is_chosen_in_columns_of_numbers(tmp_path):
    path = tmp_path / "a.parquet"
    pl.DataFrame({"theta_i": [30.0, 30.0], "theta_o": [1.0, 2.0], "brdf": [1.0, 2.0], "run": [20, 30]}).write_parquet(
        path
    )
    assert read(path, where="run=20").value.tolist() == [[1.0]]
    assert [part.value.tolist() for part in chunks.scan(path, where="run=30.0")] == [[[2.0]]]


def test_parts_of_a_column_must_agree_on_what_they_hold(tmp_path):
    path = written(tmp_path, RUNS)
    with pytest.raises(ReadError, match=r"numbers and, from row 4 on, text in the column batch, expected one of both"):
        chunks.scan(path, where="batch=7", rows=2)


def test_points_that_may_separate_thousands_are_said(tmp_path):
    """1.234 beside 987, where German counts are meant; a number with other decimals settles it."""
    text = "theta_i;theta_o;signal;reference\n20;-10;1.234;10.000\n20;10;2.345;10.000\n20;20;987;10.000\n"
    said = "signal has 1.234 beside 987: the point was read as a decimal mark. If it separates thousands, write"
    assert [words for words in read(written(tmp_path, text), panel=1.0).warnings if said in words]
    for other in ("987.5", "0.987", "987.000", "1.23e2"):
        found = read(written(tmp_path, text.replace(";987;", f";{other};")), panel=1.0)
        assert not [words for words in found.warnings if "separates thousands" in words], other
