"""What a table means: columns, conventions, quantities, channels, masks and notes of `reader.read`."""

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pytest

from fitmat.errors import ReadError
from fitmat.measurements.blocked import EQUAL
from fitmat.measurements.parsing.names import ALIASES, Role, role
from fitmat.measurements.reader import read
from fitmat.measurements.samples import Measurements

DATA = Path(os.environ.get("FITMAT_DATA", Path(__file__).parents[3] / "shared" / "data"))
EXACT = 1e-12
"""Relative: angles and values pass through a handful of float64 operations."""


@pytest.fixture
def write(tmp_path):
    def to_file(text: str | bytes, name: str = "angles.csv") -> Path:
        path = tmp_path / name
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return path

    return to_file


def degrees(measured: Measurements) -> list[list[float]]:
    """Rows of theta_i, theta_o and relative azimuth, to a billionth of a degree."""
    angles = np.rad2deg([measured.theta_i, measured.theta_o, measured.phi])
    return np.round(angles, 9).T.tolist()


def shared(name: str) -> Path:
    if not (DATA / name).exists():
        pytest.skip(f"{name} is not in {DATA.name}: point FITMAT_DATA to the folder of sample measurements")
    return DATA / name


# --- text -----------------------------------------------------------------------------------------

TABLES = {
    "comma": "theta_i,theta_o,phi,brdf\n30,45,120,0.5\n60,10,0,1.5e-1\n",
    "tab": "theta_i\ttheta_o\tphi\tbrdf\n30\t45\t120\t0.5\n60\t10\t0\t1.5e-1\n",
    "semicolon": "theta_i;theta_o;phi;brdf\n30;45;120;0.5\n60;10;0;1.5e-1\n",
    "white space": "  theta_i theta_o   phi brdf\n  30  45 120  0.5\n  60  10   0 \t 1.5e-1 \n",
    "decimal comma": "theta_i;theta_o;phi;brdf\n30,0;45,0;120,0;0,5\n60;10;0;1,5e-1\n",
    "decimal comma, spaces": "theta_i theta_o phi brdf\n30,0 45,0 120,0 0,5\n60 10 0 1,5e-1\n",
    "decimal comma, quotes": 'theta_i,theta_o,phi,brdf\n"30,0",45,120,"0,5"\n60,10,0,"1,5e-1"\n',
    "quoted": '"theta_i","theta_o","phi","brdf"\n"30","45","120","0.5"\n60,10,0,1.5e-1\n',
    "quoted and padded": '"theta_i", "theta_o" , "phi", "brdf" \n "30" , "45", 120, "0.5"\n60,10,0,1.5e-1\n',
    "padded": "theta_i, theta_o, phi, brdf\n30, 45, 120, 0.5\n60, 10, 0, 1.5e-1",
    "comments": "# by\n% me\n\ntheta_i,theta_o,phi,brdf\n//x\n30,45,120,0.5\n; x\n60,10,0,1.5e-1\n,,,\n",
    "comment header": "# Data of today\n#theta_i theta_o phi brdf\n#-----\n30 45 120 0.5\n60 10 0 1.5e-1\n",
    "comment header, comma": "% theta_i, theta_o, phi, brdf\n30,45,120,0.5\n60,10,0,1.5e-1\n",
    "windows": "theta_i,theta_o,phi,brdf\r\n30,45,120,0.5\r\n60,10,0,1.5e-1\r\n",
    "old mac": "theta_i,theta_o,phi,brdf\r30,45,120,0.5\r60,10,0,1.5e-1\r",
    "case and units": "Theta_I [deg],THETA-O (°),φ,BRDF [1/sr]\n30,45,120,0.5\n60,10,0,1.5e-1\n",
    "other order": "brdf,phi,theta_o,theta_i\n0.5,120,45,30\n1.5e-1,0,10,60\n",
    "typographic minus": "theta_i,theta_o,phi,brdf\n30,−45,−60,0.5\n60,10,0,1.5e-1\n",
    "index column": ";theta_i;theta_o;phi;brdf\n0;30;45;120;0.5\n1;60;10;0;1.5e-1\n",
    "time column": "time,theta_i,theta_o,phi,brdf\n2024 01 02,30,45,120,0.5\n2024 01 03,60,10,0,1.5e-1\n",
}


@pytest.mark.parametrize("text", TABLES.values(), ids=TABLES)
def test_every_way_to_write_a_table_is_read_alike(write, text):
    measured = read(write(text))
    assert degrees(measured) == [[30, 45, 120], [60, 10, 0]]
    assert measured.value.tolist() == [[0.5], [0.15]]
    assert measured.valid.all()
    assert measured.channels == ("value",)
    assert measured.source == "angles.csv"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_encodings(write, encoding):
    measured = read(write(("# für 20 °C\n" + TABLES["comma"]).encode(encoding)))
    assert measured.value.tolist() == [[0.5], [0.15]]
    assert ("The file is not UTF-8; read as Windows-1252." in measured.notes) == (encoding == "cp1252")


def test_utf16_big_endian(write):
    assert read(write(b"\xfe\xff" + TABLES["tab"].encode("utf-16-be"))).n_valid == 2


def test_headerless_file_by_numbers(write):
    columns = {"theta_i": 2, "theta_o": 3, "reflectance_factor": 5, "sigma": "6"}
    measured = read(write("Alu,30,45,7,0.3,0.1\nAlu,30,-45,7,0.6,0.1\n"), columns=columns)
    assert degrees(measured) == [[30, 45, 180], [30, 45, 0]]
    assert measured.value[:, 0] == pytest.approx([0.3 / math.pi, 0.6 / math.pi], rel=EXACT)
    assert measured.notes[-1] == "Columns not used: column 1, column 4."


def test_headerless_file_may_begin_with_missing_cells_or_decimal_commas(write):
    columns = "theta_i=1,theta_o=2,brdf=3"
    assert read(write("NaN,n/a,nan\n30,45,0.5\n"), columns=columns).valid.tolist() == [[False], [True]]
    assert read(write("30,5 45,0 0,5\n30,5 46,0 0,6\n"), columns=columns).value.tolist() == [[0.5], [0.6]]


def test_a_header_named_as_a_number_wins_over_the_number(write):
    measured = read(write("theta_i,theta_o,x,a3\n30,45,7,0.5\n"), columns="brdf=A3")
    assert measured.value.tolist() == [[0.5]]
    frame = pd.DataFrame({"1": [0.5], "theta_i": [30.0], "theta_o": [45.0]})
    assert read(frame, columns="brdf=1").value.tolist() == [[0.5]]


# --- sources --------------------------------------------------------------------------------------


@pytest.mark.parametrize("make", [pd.DataFrame, pl.DataFrame, dict], ids=["pandas", "polars", "dict"])
def test_frames_and_dicts(make):
    measured = read(make({"theta_i": [30, 60], "theta_o": [45.0, -10.0], "brdf": ["0.5", "0,15"]}))
    assert degrees(measured) == [[30, 45, 180], [60, 10, 0]]
    assert measured.value.tolist() == [[0.5], [0.15]]


def test_missing_entries_of_arrays_are_masked():
    nullable = pd.array([0.5, None], dtype="Float64")
    hidden = np.ma.masked_array([0.5, 7.0], mask=[False, True])
    absent = pl.Series([0.5, None])
    for column in (nullable, hidden, absent, np.array([0.5, pd.NA], dtype=object)):
        measured = read({"theta_i": [30, 30], "theta_o": [45, 46], "brdf": column})
        assert measured.value.tolist() == [[0.5], [0.0]]
        assert measured.masked == {"value missing or NaN": 1}


def test_a_path_may_be_text(write):
    assert read(str(write(TABLES["comma"]))).n_samples == 2


# --- angles ---------------------------------------------------------------------------------------


def sample(**columns: object) -> dict[str, object]:
    return {"theta_i": [30.0], "theta_o": [45.0], "brdf": [1.0], **columns}


@pytest.mark.parametrize(
    ("columns", "options", "expected"),
    [
        ({}, {}, [30, 45, 180]),
        ({"theta_o": [-45.0]}, {}, [30, 45, 0]),
        ({}, {"forward": "negative"}, [30, 45, 0]),
        ({"theta_o": [-45.0]}, {"forward": "negative"}, [30, 45, 180]),
        ({"theta_i": [-30.0]}, {"forward": "positive"}, [30, 45, 0]),
        ({"theta_i": [-30.0]}, {"forward": "negative"}, [30, 45, 180]),
        ({"theta_i": [-30.0], "theta_o": [-45.0]}, {"forward": "positive"}, [30, 45, 180]),
        ({"theta_i": [-0.01], "theta_o": [-45.0]}, {}, [0.01, 45, 180]),
        ({"phi": [100.0]}, {}, [30, 45, 100]),
        ({"phi": [100.0], "theta_o": [-45.0]}, {}, [30, 45, 80]),
        ({"phi": [260.0]}, {}, [30, 45, 100]),
        ({"phi": [100.0]}, {"specular_azimuth": 0}, [30, 45, 80]),
        ({"phi_i": [20.0], "phi_o": [-80.0]}, {}, [30, 45, 100]),
        ({"phi_i": [-350.0], "phi_o": [270.0]}, {}, [30, 45, 100]),
        ({"phi_i": [20.0], "phi_o": [20.0]}, {"specular_azimuth": 0}, [30, 45, 180]),
        ({"phi_i": [20.0], "phi_o": [20.0], "theta_i": [-30.0]}, {}, [30, 45, 180]),
    ],
)
def test_azimuth_conventions(columns, options, expected):
    assert degrees(read(sample(**columns), **options)) == [expected]


def test_directions_are_unit_vectors_of_the_stated_frame():
    measured = read(sample(phi_i=[90.0], phi_o=[180.0]))
    root = math.sqrt(0.5)
    assert measured.wi[0] == pytest.approx([0, 0.5, math.sqrt(0.75)], abs=EXACT)
    assert measured.wo[0] == pytest.approx([-root, 0, root], abs=EXACT)


def test_radians():
    angles = {"theta_i": [math.pi / 6], "theta_o": [math.pi / 4], "phi": [2 * math.pi / 3]}
    measured = read(sample(**angles), angle_unit="radians")
    assert degrees(measured) == [[30, 45, 120]]
    assert "Angles read as radians." in measured.notes


@pytest.mark.parametrize(
    ("columns", "unit", "expected"),
    [
        ({"phi": [math.pi / 2]}, "phi=radians", [30, 45, 90]),
        ({"phi": [3.0]}, "phi=degrees", [30, 45, 3]),
        ({"phi": [3.0]}, "degrees", [30, 45, 3]),
        ({"phi_i": [0.0], "phi_o": [math.pi]}, "phi_i=radians, phi_o=radians", [30, 45, 180]),
        ({"theta_o": [math.pi / 3]}, "theta_o=radians", [30, 60, 180]),
        ({"theta_i": [20.0], "theta_o": [50.0], "phi": [100.0]}, "gon", [18, 45, 90]),
        ({"phi": [150.0]}, "phi=gon", [30, 45, 135]),
    ],
)
def test_units_of_single_columns(columns, unit, expected):
    measured = read(sample(**columns), angle_unit=unit)
    assert degrees(measured) == [expected]


def test_a_full_circle_of_the_sensors_arm():
    measured = read(sample(theta_i=[30.0, 30.0], theta_o=[340.0, 20.0], brdf=[1.0, 1.0]))
    assert degrees(measured) == [[30, 20, 0], [30, 20, 180]]
    assert "theta_o from three quarters of a turn on read as negative: 340° is −20°." in measured.notes


def test_elevations_are_counted_from_the_horizon():
    table = {"Sun elevation": [60.0], "View Elevation Angle": [45.0], "phi": [100.0], "brdf": [1.0]}
    measured = read(table)
    assert degrees(measured) == [[30, 45, 100]]
    assert "theta_i is 90° − elevation_i." in measured.notes
    mapped = read(sample(height=[60.0], theta_i=[9.0]), columns="elevation_i=height")
    assert degrees(mapped) == [[30, 45, 180]]


def test_constants_stand_for_columns(write):
    path = write("theta_o,phi,brdf\n45,100,1\n50,100,2\n")
    measured = read(path, constants={"theta_i": 30.0, "wavelength": 532.0})
    assert degrees(measured) == [[30, 45, 100], [30, 50, 100]]
    assert measured.channels == ("532",)
    assert "theta_i = 30 in every row, as was said." in measured.notes
    turned = read(
        {"theta_i": [0.5], "theta_o": [0.7], "brdf": [1.0]}, angle_unit="radians", constants={"phi": math.pi / 2}
    )
    assert turned.phi == pytest.approx([math.pi / 2], rel=EXACT)


@pytest.mark.parametrize(
    "comment",
    ["#intheta 30", "# theta_i = 30 deg", "% Angle of incidence: 30.0°", "// AOI\t30", "; incident angle = +30"],
)
def test_an_angle_stated_in_a_comment(write, comment):
    path = write(f"#datapoints 2\n{comment}\ntheta_o,phi,brdf\n45,100,1\n50,100,2\n")
    measured = read(path)
    assert degrees(measured) == [[30, 45, 100], [30, 50, 100]]
    assert "theta_i = 30 in every row, by the comment in row 2." in measured.notes


@pytest.mark.parametrize(
    "note",
    ["Incident angle: 30", "theta_i = 30°", "AOI;30;;", "Angle of incidence,30", "theta_i\t30 deg", "[Set]\nAOI=30"],
)
def test_an_angle_stated_in_a_note_above_the_header(write, note):
    path = write(f"Sample: plate 7\n{note}\ntheta_o,phi,brdf\n45,100,1\n50,100,2\n")
    measured = read(path)
    assert degrees(measured) == [[30, 45, 100], [30, 50, 100]]
    line = 2 + note.count("\n")
    assert f"theta_i = 30 in every row, by the comment in row {line}." in measured.notes


def test_a_comment_serves_only_what_has_no_column(write):
    path = write("# theta_i = 10\n# phi_i = 20\n# phi = 5\ntheta_i,theta_o,phi,brdf\n30,45,100,1\n")
    assert degrees(read(path)) == [[30, 45, 100]]
    path = write("# theta_i = 10\n# phi_i = 20\n# phi = 5\ntheta_o,phi_o,brdf\n45,100,1\n")
    assert degrees(read(path)) == [[10, 45, 80]]
    assert degrees(read(path, constants={"theta_i": 40.0})) == [[40, 45, 80]]


def test_small_angles_are_degrees_when_confirmed_or_too_small_to_doubt():
    assert degrees(read(sample(theta_i=[0.0], theta_o=[1.5]), angle_unit="degrees")) == [[0, 1.5, 180]]
    assert degrees(read(sample(theta_i=[0.0], theta_o=[0.1]))) == [[0, 0.1, 180]]
    assert degrees(read(sample(theta_i=[0.0], theta_o=[1.7]))) == [[0, 1.7, 180]]


def test_rounded_radians_of_the_horizon_are_the_horizon():
    table = {"theta_i": [0.5, 0.5], "theta_o": [1.5707963, 0.1], "brdf_cos": [1.0, 1.0]}
    assert read(table, angle_unit="radians").masked == {"at or below the horizon": 1}
    full_turn = read(sample(theta_i=[0.5], theta_o=[0.7], phi=[6.283186]), angle_unit="radians")
    assert full_turn.phi[0] == pytest.approx(0, abs=1e-6)  # 2π rounded up in the sixth digit


# --- quantities and channels ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("quantity", "expected", "note"),
    [
        ("brdf", 2.0, "brdf read as f_r in sr⁻¹, no factor applied."),
        (
            "brdf_cos",
            2.0 / math.cos(math.radians(60)),
            "brdf_cos (the cosine-corrected BRDF, f_r cos θ_o) divided by cos θ_o.",
        ),
        ("reflectance_factor", 2.0 / math.pi, "reflectance_factor divided by π."),
    ],
)
def test_quantity_by_name_and_by_option(quantity, expected, note):
    angles = {"theta_i": [30.0], "theta_o": [60.0], "sigma": [1.0]}
    for measured in (
        read({**angles, quantity: [2.0]}),
        read({**angles, "value": [2.0]}, quantity=quantity),
        read(
            {**angles, "brdf": [9.0], "reflectance_factor": [9.0], "brdf_cos": [9.0], quantity: [2.0]},
            quantity=quantity,
        ),
    ):
        assert measured.value[0, 0] == pytest.approx(expected, rel=EXACT)
        assert measured.sigma is not None
        assert measured.sigma[0, 0] == pytest.approx(expected / 2, rel=EXACT)
        assert measured.notes[0] == note


def test_wide_channels_each_with_its_sigma(write):
    text = "theta_i,theta_o,brdf_550,sigma_650nm,brdf_650,sigma_550\n30,45,1,0.2,2,0.1\n"
    measured = read(write(text))
    assert measured.channels == ("550", "650")
    assert measured.value.tolist() == [[1, 2]]
    assert measured.sigma is not None
    assert measured.sigma.tolist() == [[0.1, 0.2]]


@pytest.mark.parametrize(
    "header",
    [
        "Incident_angle,Measure_angle,450nm,650.5nm",
        "AOI,VZA,450 nm,650.5 nm",
        "theta_i,theta_o,R_450,R_650.5",
        "theta_i,theta_o,450,650.5",
        "theta_i,theta_o,450 [nm],650.5 (nm)",
    ],
)
def test_columns_named_by_their_wavelength(write, header):
    path = write(header + "\n30,45,0.1,0.2\n30,50,0.3,0.4\n")
    with pytest.raises(ReadError, match=r"the columns (R_)?450.*, (R_)?650\.5.* do not say what they hold"):
        read(path)
    measured = read(path, quantity="brdf")
    assert measured.channels == ("450", "650.5")
    assert measured.value.tolist() == [[0.1, 0.2], [0.3, 0.4]]
    assert degrees(measured) == [[30, 45, 180], [30, 50, 180]]


def test_a_wavelength_beside_a_quantity_is_no_value(write):
    measured = read(write("theta_i,theta_o,brdf,550nm,2024\n30,45,0.1,7,8\n"))
    assert measured.value.tolist() == [[0.1]]
    assert measured.notes[-1] == "Columns not used: 550nm, 2024."


def test_numbers_in_a_header_that_are_no_wavelengths_are_rows(write):
    measured = read(write("30,45,450\n30,50,550\n"), columns="theta_i=1,theta_o=2,brdf=3")
    assert measured.value.tolist() == [[450], [550]]


def test_one_sigma_serves_all_channels():
    measured = read({"theta_i": [30], "theta_o": [45], "BRDF_Red": [1], "brdf_g": [2], "brdf_b": [3], "sigma": [0.5]})
    assert measured.channels == ("r", "g", "b")
    assert measured.sigma is not None
    assert measured.sigma.tolist() == [[0.5, 0.5, 0.5]]


def test_long_format_by_wavelength_masks_what_is_absent(write):
    text = """theta_i,theta_o,wavelength,brdf,sigma
30,45,650,2,0.2
30,45,550.5,1,0.1
30,50,650,4,0.4
30,45,650,5,0.5
"""
    measured = read(write(text))
    assert measured.channels == ("550.5", "650")
    assert degrees(measured) == [[30, 45, 180], [30, 50, 180], [30, 45, 180]]
    assert measured.value.tolist() == [[1, 2], [0, 4], [0, 5]]
    assert measured.valid.tolist() == [[True, True], [False, True], [False, True]]
    assert measured.sigma is not None
    assert measured.sigma.tolist() == [[0.1, 0.2], [1, 0.4], [1, 0.5]]
    assert measured.masked == {"no row for a channel of this geometry": 2}
    assert "Rows that repeat an earlier geometry, all kept: 1." in measured.notes


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (('"10,691"', "987"), [10691, 987]),
        (('"1,234,567"', '"8,765"'), [1234567, 8765]),
        (('"1,234.5"', '"8,765"'), [1234.5, 8765]),
        (('"-1,234"', "5"), [-1234, 5]),
        (('"0,123"', '"1,234"'), [0.123, 1.234]),
        (('"10,69"', '"1,234"'), [10.69, 1.234]),
        (('"10,691"', '"0,5"'), [10.691, 0.5]),
    ],
)
def test_commas_with_three_digits_behind_them(write, cells, expected):
    """Thousands, where the file shows it; decimals, where it shows that."""
    lines = (f"30,{45 + k},{cell}\n" for k, cell in enumerate(cells))
    measured = read(write("theta_i,theta_o,brdf\n" + "".join(lines)))
    assert measured.value[:, 0].tolist() == pytest.approx(expected)
    assert any("thousands" in note for note in measured.notes) == (expected[0] not in (0.123, 10.69, 10.691))


@pytest.mark.parametrize("cell", ["#N/A", "#DIV/0!", "#REF!", "#VALUE!", "#NAME?", "#NUM!", "#NULL!", "#n/a"])
@pytest.mark.parametrize("mark", [",", ";", "\t", "  "])
def test_what_spreadsheets_cannot_compute_is_missing_wherever_it_stands(write, cell, mark):
    """In the first column it is no comment: the row is kept, masked and counted."""
    rows = [("theta_i", "theta_o", "brdf"), (cell, "45", "0.5"), ("30", "45", cell), ("30", "50", "0.4")]
    measured = read(write("#N/A means missing\n# and so on\n" + "".join(mark.join(row) + "\n" for row in rows)))
    assert measured.valid.ravel().tolist() == [False, False, True]
    assert sum(measured.masked.values()) == 2


def test_long_format_by_channel_keeps_the_order_of_appearance():
    table = {
        "theta_i": [30] * 6,
        "theta_o": [45, 45, 45, 46, 46, 46],
        "channel": [*"rgbbgr"],
        "brdf": range(6),
    }
    measured = read(table)
    assert measured.channels == ("r", "g", "b")
    assert measured.value.tolist() == [[0, 1, 2], [5, 4, 3]]
    assert not measured.masked
    assert read({**table, "flag": [0, 1, 0, 0, 0, 0]}).valid.tolist() == [[True, False, True], [True] * 3]


# --- masks and notes ------------------------------------------------------------------------------


def test_each_reason_masks_and_counts_and_keeps_its_row(write):
    text = """theta_i,theta_o,brdf,sigma,valid,flag
30,45,0.5,0.1,true,0
30,46,,0.1,1,0
30,47,NaN,0.1,yes,
30,48,inf,0.1,1,0
30,90,0.5,0.1,1,0
120,10,0.5,0.1,1,0
30,,0.5,0.1,1,0
inf,10,0.5,0.1,1,0
30,49,0.5,0,1,0
30,50,0.5,n/a,1,0
30,51,0.5,-0.1,1,0
30,52,0.5,0.1,False,0
30,53,0.5,0.1,,0
30,54,0.5,0.1,1,T
30,55,,0.1,0,1
30,56,0,0.1,1,0
"""
    measured = read(write(text))
    assert measured.n_samples == 16
    assert np.flatnonzero(measured.valid[:, 0]).tolist() == [0, 15]
    assert measured.value.ravel().tolist() == [0.5] + [0.0] * 15
    assert measured.masked == {
        "flagged invalid": 4,
        "angle missing or infinite": 2,
        "at or below the horizon": 2,
        "value missing or NaN": 2,
        "value infinite": 1,
        "sigma missing, infinite or not positive": 3,
    }
    assert np.isfinite(measured.wi).all()
    assert np.isfinite(measured.wo).all()
    assert measured.sigma is not None
    assert (np.isfinite(measured.sigma) & (measured.sigma > 0)).all()


def test_one_bad_channel_masks_one_value():
    measured = read({"theta_i": [30], "theta_o": [45], "brdf_r": [1.0], "brdf_g": [np.nan], "brdf_b": [3.0]})
    assert measured.valid.tolist() == [[True, False, True]]
    assert measured.masked == {"value missing or NaN": 1}


@pytest.mark.parametrize(
    ("values", "masked", "note"),
    [
        ([1.0, -1.0, -1.0], {"sentinel -1": 2}, False),
        ([1.0, -0.01, -0.02], {}, "Negative values kept as noise: 2."),
        ([1.0, 2.0, -999.0], {"sentinel -999": 1}, False),
        ([0.1, 65535.0, 65535.0], {"sentinel 65535": 2}, False),
        ([65535.0, 32767.0, 32767.0], {}, False),
        ([1.0, -0.01, -999.0], {"sentinel -999": 1}, "Negative values kept as noise: 1."),
        ([-9999.0, 1.0, 9.96921e36], {"sentinel -9999": 1, "sentinel 9.96921e+36": 1}, False),
        ([1.0, 2.0, -998.0], {}, "Negative values kept as noise: 1."),
        ([1.0, 0.0, 0.0], {}, False),
    ],
)
def test_negative_values(values, masked, note):
    measured = read({"theta_i": [30] * 3, "theta_o": [40, 45, 50], "reflectance_factor": values})
    assert measured.masked == masked
    assert measured.valid[:, 0].tolist() == [f"sentinel {value:g}" not in masked for value in values]
    kept = [text for text in measured.notes if "Negative values" in text]
    assert kept == ([note] if note else [])


def test_a_sentinel_of_a_signal_is_no_reading():
    """Nor is its ratio to the reference, nor a σ that stands for nothing."""
    table = {"theta_i": [30] * 4, "theta_o": [40, 45, 50, 55], "signal": [1.0, -999.0, 1.0, 1.0]}
    measured = read({**table, "reference": [2.0, 2.0, -9999.0, 2.0], "sigma": [0.1, 0.1, 0.1, -99.0]}, panel=1.0)
    assert measured.valid[:, 0].tolist() == [True, False, False, False]
    assert measured.masked["sentinel -999"] == 1


def test_repeats_are_the_same_directions_however_written():
    table = {"theta_i": [0, 0, 30, 30, 30], "theta_o": [45, -45, 10, -10, 10], "phi": [0, 70, 180, 0, 181]}
    measured = read({**table, "brdf": [1.0] * 5})
    assert measured.n_samples == 5
    assert "Rows that repeat an earlier geometry, all kept: 2." in measured.notes


def test_notes_say_what_was_assumed():
    notes = read(sample(theta_o=[-45.0], phi=[180.0], temperature=[20.0]), specular_azimuth=0).notes
    assert notes == (
        "brdf read as f_r in sr⁻¹, no factor applied.",
        "Relative azimuth phi: 0° is the mirror side, turned by 180°. "
        "Negative zenith angles turn their azimuth by 180°.",
        "Columns not used: temperature.",
    )
    assert "No azimuth column: in-plane, negative theta_o is forward (mirror side)." in (
        read(sample(), forward="negative").notes
    )


# --- column names ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "alias"), [(kind, alias) for kind in ALIASES for alias in (kind, *ALIASES[kind])])
def test_documented_aliases(kind, alias):
    assert role(f" {alias.upper()} ") == Role(kind)


@pytest.mark.parametrize(
    ("names", "kind"),
    [
        ("Incident_angle, incident-angle, IncidentAngle, AOI, SZA, Solar Zenith Angle, thetaI, Theta_In", "theta_i"),
        (
            "Measure_angle, measurement angle, VZA, view-zenith, ViewZenithAngle, theta_r, ThetaR, scatter angle",
            "theta_o",
        ),
        ("RAA, Relative Azimuth, relAzimuth, Relative_Azimuth_Angle, dphi", "phi"),
        ("SAA, solar azimuth angle", "phi_i"),
        ("VAA, Sensor Azimuth", "phi_o"),
        ("BRF", "reflectance_factor"),
    ],
)
def test_names_of_instruments_and_satellites(names, kind):
    assert {role(name) for name in names.split(", ")} == {Role(kind)}


@pytest.mark.parametrize("name", ["zenith", "azimuth", "angle", "theta", "elevation", "scattering angle", "R"])
def test_names_of_several_meanings_are_not_guessed(name):
    assert role(name) is None


def test_azimuths_of_sun_and_sensor_are_subtracted():
    table = {"SZA": [30.0], "VZA": [45.0], "SAA": [150.0], "VAA": [290.0], "BRF": [math.pi]}
    measured = read(table)
    assert degrees(measured) == [[30, 45, 140]]
    assert measured.value[0, 0] == pytest.approx(1, rel=EXACT)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("brdf_cos_r", Role("brdf_cos", "r")),
        ("BRF 550.5 nm", None),
        ("brf_550.5nm", Role("reflectance_factor", "550.5")),
        ("θi (deg)", Role("theta_i")),
        ("brdf_error", None),
        ("theta_i [mrad]", None),
        ("reflectance_factor [%]", Role("reflectance_factor")),
        ("phi_r", Role("phi_o")),
    ],
)
def test_names_with_channels_and_units(name, expected):
    assert role(name) == expected


def test_a_mapping_may_swap_names():
    table = {"phi_i": [30.0], "theta_i": [-180.0], "phi_o": [-45.0], "theta_o": [0.0], "brdf": [1.0]}
    measured = read(table, columns="theta_i=phi_i,phi_i=theta_i,theta_o=phi_o, phi_o=theta_o")
    assert degrees(measured) == [[30, 45, 0]]


def test_a_mapped_column_is_no_longer_what_its_name_says():
    table = {"phi_i": [30.0], "theta_o": [45.0], "brdf": [1.0]}
    assert degrees(read(table, columns="theta_i=phi_i")) == [[30, 45, 180]]


def test_a_mapping_replaces_its_rivals():
    table = sample(phi=[100.0], phi_i=[0.0], phi_o=[50.0], reflectance_factor=[2.0], zenith=[60.0])
    measured = read(table, columns={"theta_o": "Zenith", "phi": "phi", "reflectance_factor": "reflectance_factor"})
    assert degrees(measured) == [[30, 60, 100]]
    assert measured.value[0, 0] == pytest.approx(2 / math.pi, rel=EXACT)
    both = read(table, columns={"phi_i": "phi_i", "phi_o": "phi_o", "brdf": "brdf"})
    assert degrees(both) == [[30, 45, 50]]


def test_a_mapping_may_name_any_channel():
    measured = read(sample(red=[1.0], nir=[2.0]), columns="brdf_r=red,brdf_nir=nir")
    assert measured.channels == ("r", "nir")
    assert measured.value.tolist() == [[1, 2]]


# --- foreign files --------------------------------------------------------------------------------


def test_starlink_chassis():
    path = shared("starlink/chassis_brdf.csv")
    measured = read(path, columns="theta_i=phi_i,phi_i=theta_i,theta_o=phi_o,phi_o=theta_o")
    assert measured.n_samples == 724
    # 1e-4 right after 0.46, 0.076 and 0.019 fills what was not read; the other end of each scan falls to it.
    assert measured.masked == {"at or below the horizon": 8, EQUAL: 4}
    assert measured.in_plane.all()
    assert np.unique(np.rad2deg(measured.theta_i).round(6)).tolist() == [5, 41.4, 60, 75]
    at60 = np.isclose(measured.theta_i, np.deg2rad(60))
    peak = np.rad2deg(measured.signed_theta_o[at60][np.argmax(measured.value[at60, 0])])
    assert peak == pytest.approx(60, abs=1)  # a mirror-like chassis: the peak stands on the mirror side


def test_neural_merl_curves(tmp_path):
    script = shared("merl-like/evaluate.py")
    out = tmp_path / "acrylic.csv"
    subprocess.run([sys.executable, script, "green-acrylic", out, "--noise", "0.02"], check=True)
    measured = read(out)
    assert measured.value.shape == (430, 3)
    assert measured.channels == ("r", "g", "b")
    assert measured.valid.all()
    assert measured.sigma is not None
    raw = np.loadtxt(out, delimiter=",", skiprows=1)
    assert measured.value == pytest.approx(raw[:, 2:5], rel=EXACT)
    assert measured.sigma == pytest.approx(raw[:, 5:], rel=EXACT)
    assert np.rad2deg(measured.signed_theta_o) == pytest.approx(raw[:, 1], abs=1e-9)
