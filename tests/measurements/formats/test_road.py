"""Road r-tables: surfaces whose luminance coefficient is known, both layouts, and faults."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from test_zemax import outcomes

from fitmat.errors import ReadError
from fitmat.measurements import reader
from fitmat.measurements.formats import road

EXACT = 1e-9
"""Relative; a tangent, its arctangent and a cube."""

TAN = np.r_[0:2.1:0.25, 2.5:12.1:0.5]
"""Rows of the CIE's table."""

Write = Callable[[str], Path]


def q(tan: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """cd/(m² lx) of a grey asphalt that is brighter towards the mirror side, β = 0; equal along the normal."""
    return 0.05 + 0.03 * np.sin(np.arctan(tan))[:, None] * np.cos(np.deg2rad(beta))


def table(tan: np.ndarray = TAN, factor: float = 1e4) -> np.ndarray:
    """r = q cos³γ times 10⁴; what is lit from far behind the observer is not defined, 0."""
    cells = factor * q(tan, np.array(road.BETAS)) * np.cos(np.arctan(tan))[:, None] ** 3
    cells[-4:, -6:] = 0
    return cells


def matrix(mark: str = "\t", point: str = ".", corner: str = "tan γ", cells: np.ndarray | None = None) -> str:
    head = mark.join([corner, *map(str, road.BETAS)])
    found = table() if cells is None else cells
    rows = [mark.join([f"{t:g}", *(f"{cell:.12g}" for cell in row)]) for t, row in zip(TAN, found, strict=True)]
    return "# R-table\n" + head + "\n" + "\n".join(rows).replace(".", point) + "\n"


def rtb(cells: np.ndarray | None = None, name: str = "Asphalt 7", q0: float = 0.07) -> str:
    """As DIAL describes it: tan γ fastest, one number a line."""
    found = table() if cells is None else cells
    numbers = [len(TAN), *TAN, len(road.BETAS), *road.BETAS, q0, *found.T.ravel()]
    return "\n".join(["RTable.v1", name, *(f"{number:.12g}" for number in numbers)]) + "\n"


def sample(rng: np.random.Generator) -> bytes:
    """A valid table in one of the layouts."""
    cells = table() * rng.uniform(0.5, 1.5)
    if rng.integers(2):
        return rtb(cells).encode()
    mark, point = (("\t", "."), (";", ","), (",", "."), (" ", "."))[rng.integers(4)]
    return matrix(mark, point, "" if mark != " " else "x", cells).encode()


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def to_file(text: str) -> Path:
        path = tmp_path / "r3.txt"
        path.write_text(text, encoding="utf-8")
        return path

    return to_file


LAYOUTS = {
    "DIALux": rtb(),
    "tabs": matrix(),
    "semicolons, decimal commas": matrix(";", ","),
    "commas": matrix(","),
    "white space": matrix("  ", corner="tan"),
    "no corner": matrix(corner=""),
    "degrees in the head": matrix().replace("\t180\n", "\t180°\n"),
    "a comment in the head": matrix(corner="#").replace("\n0.25\t", "\n# wet\n0.25\t"),
    "carriage returns": matrix().replace("\n", "\r\n"),
}


@pytest.mark.parametrize("text", LAYOUTS.values(), ids=LAYOUTS)
def test_every_layout_gives_the_luminance_coefficient(write: Write, text: str) -> None:
    """L = q E: a lamp of I cd at height H lights the road with I cos³γ/H² and shows I r/H² cd/m² (CIE 144)."""
    found = reader.read(write(text))
    keep = found.valid[:, 0]
    tan, beta = np.tan(found.theta_i[keep]), 180 - np.rad2deg(found.phi[keep])
    expected = 0.05 + 0.03 * np.sin(found.theta_i[keep]) * np.cos(np.deg2rad(beta))
    np.testing.assert_allclose(found.value[keep, 0], expected, rtol=EXACT)
    np.testing.assert_allclose(found.theta_o[keep], np.deg2rad(89), rtol=EXACT)
    assert set(np.round(tan, 6)) == set(TAN.round(6))
    intensity, height = 1000.0, 8.0
    luminance = found.value[keep, 0] * intensity * np.cos(found.theta_i[keep]) ** 3 / height**2
    cells = table()[np.searchsorted(TAN, tan - 1e-6), np.searchsorted(road.BETAS, beta - 1e-6)]
    np.testing.assert_allclose(luminance[tan > 0], (intensity * cells / 1e4 / height**2)[tan > 0], rtol=EXACT)


def test_the_mirror_side_is_beta_0(write: Write) -> None:
    found = reader.read(write(rtb()))
    forward = found.signed_theta_o > 0
    lit = found.valid[:, 0] & np.isclose(np.tan(found.theta_i), 2.0)
    assert found.value[lit & forward].mean() > found.value[lit & ~forward].mean()
    first = np.flatnonzero(lit)[0]
    np.testing.assert_allclose(found.wo[first, :2], [-np.sin(np.deg2rad(89)), 0.0], atol=EXACT)
    assert found.wi[first, 0] > 0


def test_undefined_cells_and_the_normal_are_counted(write: Write) -> None:
    found = reader.read(write(rtb()))
    assert found.masked == {
        "0, which r-tables hold where nothing is defined": 24,
        "the same value of a direction once more: along the normal there is no β": 19,
    }
    assert "Road r-table, Asphalt 7, Q0 = 0.07: f_r = r/(10⁴ cos³γ), seen from 1° above" in found.notes[1]


def test_cells_may_be_missing(write: Write) -> None:
    """The printed tables leave the corner of steep angles empty."""
    lines = matrix().splitlines()
    lines[-1] = "\t".join(lines[-1].split("\t")[:9])
    lines[-2] = "\t".join(["-" if cell == "0" else cell for cell in lines[-2].split("\t")])
    found = reader.read(write("\n".join(lines)))
    assert found.masked["value missing or NaN"] == 12 + 6


BAD = {
    "normalised": (rtb(table() / 0.07), r"0.714 sr⁻¹ at tan γ = 0, expected .* Multiply a table normalised to Q0 = 1"),
    "plain r": (matrix(cells=table(factor=1.0)), r"5e-06 sr⁻¹ at tan γ = 0, .* Multiply the values by 10⁴"),
    "cut off": (rtb()[:2000], r"\d+ values below Q0, expected 580: 29 tan γ × 20 β\. Was the file cut off"),
    "cut off in the axis": ("\n".join(rtb().splitlines()[:20]), "row 3: 29, expected the number of tan γ that follow"),
    "two a line": (rtb().replace("\n0.25\n", "\n0.25 0.3\n"), "row 5: expected one number a line below the name"),
    "only a name": ("RTable.v1\nR3\n", "r3.txt: expected one number a line"),
    "word": (matrix().replace("\n0.25\t", "\n0.25\tO"), r"row 4: O\d.*, expected a number"),
    "too many cells": (matrix().replace("\n0.25\t", "\n0.25\t1\t"), "row 4: 22 cells, expected tan γ and up to 20"),
    "not increasing": (matrix().replace("\n0.5\t", "\n0.1\t"), "tan γ of 0, 0.25, 0.1, .* numbers that increase"),
    "no rows": ("\n".join(matrix().splitlines()[:2]), "row 2: no rows below the line of β"),
    "nothing in it": ("\n".join(matrix().splitlines()[:2]) + "\n0\t-\t-\n", "no values below β"),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD)
def test_bad_tables_are_refused_in_a_sentence(write: Write, text: str, message: str) -> None:
    with pytest.raises(ReadError, match=message):
        reader.read(write(text))


def test_what_the_format_settles_is_not_asked(write: Write) -> None:
    with pytest.raises(ReadError, match="a file of the format road, expected no quantity="):
        reader.read(write(rtb()), quantity="brdf")


def test_it_claims_its_own_content_only() -> None:
    assert all(road.claims(text.encode(), 9) for text in LAYOUTS.values())
    others = (
        "theta_i,theta_o,brdf\n0,2,5\n",
        "0,2,5,10,15,20\n",
        "RTable\n",
        "# 0 2 5 10 15\n0\n2\n5\n10\n15\n20\n25\n",
    )
    assert not any(road.claims(text.encode(), 9) for text in others)


def test_no_fault_raises_anything_but_a_read_error(tmp_path: Path) -> None:
    def to_file(raw: bytes) -> Path:
        (tmp_path / "a.rtb").write_bytes(raw)
        return tmp_path / "a.rtb"

    read, refused = outcomes(sample, to_file, np.random.default_rng(3))
    assert read > 5
    assert len(refused) > 5
