"""Laws of reading: what is written comes back, however written; no content raises but a ReadError."""

import contextlib
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fitmat.errors import ReadError
from fitmat.measurements.reader import read

ANGLE = st.floats(0, 89.9)
NUMBER = st.floats(1e-9, 1e6)
ROWS = st.lists(st.tuples(ANGLE, ANGLE, st.floats(-360, 360), NUMBER, NUMBER), min_size=1, max_size=12)
NAMES = ("theta_i", "theta_o", "phi", "brdf", "sigma")
WAYS = [(mark, ".") for mark in ",;\t "] + [(mark, ",") for mark in ";\t "]
ROUNDING = 1e-12
"""Cosines and sines of angles that went to text and back."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("tables")


def expected_wo(angles: np.ndarray) -> np.ndarray:
    _, theta, phi = np.deg2rad(angles).T
    return np.column_stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


@settings(deadline=None, derandomize=True)
@given(
    rows=ROWS,
    way=st.sampled_from(WAYS),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]),
    end=st.sampled_from(["\n", "\r\n", "\r"]),
    order=st.permutations(range(len(NAMES))),
    comment=st.sampled_from(["", "# für\n", "% a,b;c\td\n", "// 1 2 3 4 5\n"]),
)
def test_what_is_written_comes_back(folder, rows, way, encoding, end, order, comment):
    delimiter, decimal = way
    table = np.array(rows)
    lines = [[NAMES[k] for k in order]] + [[repr(row[k]).replace(".", decimal) for k in order] for row in rows]
    text = comment + "\n".join(delimiter.join(line) for line in lines) + "\n"
    path = folder / "written.txt"
    path.write_bytes(text.replace("\n", end).encode(encoding))

    measured = read(path, angle_unit="degrees")

    assert measured.value[:, 0].tolist() == table[:, 3].tolist()
    assert measured.sigma is not None
    assert measured.sigma[:, 0].tolist() == table[:, 4].tolist()
    assert np.rad2deg(measured.theta_i) == pytest.approx(table[:, 0], abs=1e-9)
    assert measured.wo == pytest.approx(expected_wo(table[:, :3]), abs=ROUNDING)


@settings(deadline=None, derandomize=True)
@given(rows=ROWS, channels=st.lists(st.sampled_from("rgbxyz"), min_size=1, max_size=4, unique=True))
def test_long_and_wide_are_the_same(rows, channels):
    table = np.array(rows)
    angles = dict(zip(NAMES[:3], table[:, :3].T, strict=True))
    wide = {f"brdf_{name}": table[:, 3] * (k + 1) for k, name in enumerate(channels)}
    long = {name: np.repeat(column, len(channels)) for name, column in angles.items()}
    value = np.stack(list(wide.values()), axis=1)
    one = read({**angles, **wide}, angle_unit="degrees")
    other = read({**long, "channel": channels * len(rows), "brdf": value.ravel()}, angle_unit="degrees")
    assert one.channels == other.channels
    assert one.value.tolist() == other.value.tolist()
    assert one.wo.tolist() == other.wo.tolist()


@settings(deadline=None, derandomize=True, max_examples=300)
@given(
    st.binary(max_size=60)
    | st.text(max_size=60).map(str.encode)
    | st.text("theta_io,brdf0123.;\t \n\"#-+eE'naif", max_size=80).map(lambda t: b"theta_i,theta_o,brdf\n" + t.encode())
)
def test_no_content_raises_anything_but_read_errors(folder, content):
    path = folder / "fuzz.csv"
    path.write_bytes(content)
    with contextlib.suppress(ReadError):
        assert read(path).n_valid > 0


def test_a_hundred_thousand_rows_take_about_a_second(folder):
    rng = np.random.default_rng(7)
    table = np.column_stack([rng.uniform(0, 89, (100_000, 2)), rng.uniform(0.1, 1, (100_000, 2))])
    path = folder / "large.csv"
    lines = "\n".join(",".join(map(repr, row)) for row in table.tolist())
    path.write_text("theta_i,theta_o,brdf,sigma\n" + lines)
    start = time.process_time()
    measured = read(path)
    assert measured.value[:, 0].tolist() == table[:, 2].tolist()
    assert time.process_time() - start < 5  # measured 0.4 s; a loop over rows takes more than 5
