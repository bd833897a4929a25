"""FRED files: the published example, real files against their own text, units against one another, and faults."""

import time
from pathlib import Path

import numpy as np
import pytest
from test_zemax import outcomes

from fitmat.errors import ReadError
from fitmat.measurements import reader
from fitmat.measurements.formats import fred

EXACT = 1e-12
"""Relative: angles pass through a handful of float64 operations."""

SLOW = 10.0
"""Seconds of this process; a search that backtracks takes minutes."""

EXAMPLE = """type bsdf_data
format angles=deg bsdf=value scale=1
0 0
-30 0 0.0003
-20 0 0.0005
-10 0 0.0015
0 0 0.1
10 0 0.0015
20 0 0.0005
30 0 0.0003
15 0
-30 0 0.0003
0 0 0.0015
15 0 0.1
"""
"""After the example in the descriptions of FRED's format, mirror directions at 0° and 15°."""


def sample(rng: np.random.Generator) -> bytes:
    """A valid file: two mirror directions, directions in all azimuths, any of the three units."""
    unit = str(rng.choice(["deg", "rad", "sin"]))
    text = f"type bsdf_data\nformat angles={unit} bsdf=value scale={rng.uniform(0.1, 3):.3f}\n"
    for _ in range(2):
        theta, phi = rng.uniform(0, 1.5, 9), rng.uniform(0, 6, 9)
        pairs = {
            "rad": np.stack([theta, phi]),
            "deg": np.rad2deg([theta, phi]),
            "sin": np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)]),
        }[unit]
        text += f"{pairs[0, 0]}\t{pairs[1, 0]}\n"
        text += "".join(f"{a} {b} {value}\n" for a, b, value in zip(*pairs, rng.lognormal(size=9), strict=True))
    return text.encode()


@pytest.fixture
def write(tmp_path: Path):
    def to_file(text: str | bytes) -> Path:
        path = tmp_path / "a.txt"
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return path

    return to_file


def test_the_published_example(write):
    """Positive zenith angles are on the side of the mirror direction."""
    found = reader.read(write(EXAMPLE))
    assert np.rad2deg(found.theta_i).round(9).tolist() == [0] * 7 + [15] * 3
    assert np.rad2deg(found.signed_theta_o[[7, 9]]).round(9).tolist() == [-30, 15]
    mirror = found.value[:, 0] == 0.1
    np.testing.assert_allclose(found.wo[mirror], found.wi[mirror] * [-1, -1, 1], atol=EXACT)


@pytest.mark.parametrize("name", ["AnoBlackEC1onAlum.txt", "AnoBlackEC1onAlum_fullAz.txt"])
def test_a_real_file_line_by_line(shared_data, name):
    """The numbers of the text: the zenith angles, and the azimuth counted from the mirror side."""
    found = reader.read(shared_data / "ua-loft/fred" / name)
    rows, block = [], 0.0
    for line in (shared_data / "ua-loft/fred" / name).read_text().splitlines()[2:]:
        numbers = [float(word) for word in line.split()]
        block = numbers[0] if len(numbers) == 2 else block
        rows += [[block, *numbers]] if len(numbers) == 3 else []
    theta_i, theta_o, phi, value = np.array(rows).T
    assert found.n_valid == len(rows)
    np.testing.assert_array_equal(found.value[:, 0], value)
    np.testing.assert_allclose(np.rad2deg([found.theta_i, found.theta_o]), [theta_i, theta_o], atol=EXACT * 1e2)
    aside = np.minimum(phi, 360 - phi)
    oblique = theta_o > 0
    np.testing.assert_allclose(180 - np.rad2deg(found.phi[oblique]), aside[oblique], atol=1e-6)


def test_units_and_scale(write):
    """30° and 60°, the latter at azimuth 90°, as degrees, radians and direction cosines, in half the value's unit."""
    texts = {
        "deg": "30 0\n60 90 4\n",
        "rad": f"{np.pi / 6} 0\n{np.pi / 3} {np.pi / 2} 4\n",
        "sin": f"0.5 0\n0 {np.sqrt(0.75)} 4\n",
    }
    for unit, text in texts.items():
        found = reader.read(write(f"TYPE bsdf_data\n# x\nformat  scale = 5e-1 angles = {unit} bsdf=value\n{text}"))
        np.testing.assert_allclose([found.theta_i, found.theta_o], np.deg2rad([[30], [60]]), rtol=EXACT)
        np.testing.assert_allclose(found.phi, np.pi / 2, rtol=EXACT)
        assert found.value.tolist() == [[2.0]]
        assert fred.ANGLES[unit] in found.notes[1]


def test_the_light_keeps_the_azimuth_of_the_file(write):
    found = reader.read(write(EXAMPLE.replace("15 0\n", "15 40\n", 1)))
    assert np.rad2deg(found.phi_i[-1]) == pytest.approx(40, rel=EXACT)
    assert found.phi[-1] == pytest.approx(np.deg2rad(140), rel=EXACT)


BAD: dict[str, tuple[str, str]] = {
    "unit": (EXAMPLE.replace("=deg", "=grad"), "row 2: angles=grad, expected deg or rad or sin"),
    "logarithm": (EXAMPLE.replace("=value", "=log"), "row 2: bsdf=log, expected bsdf=value: the format does not state"),
    "scale": (EXAMPLE.replace("scale=1", "scale=0"), "row 2: scale=0, expected a positive number"),
    "nan scale": (EXAMPLE.replace("scale=1", "scale=nan"), "scale=nan, expected a positive number"),
    "infinite scale": (EXAMPLE.replace("scale=1", "scale=1e999"), "scale=1e999, expected a positive number"),
    "no format": (EXAMPLE.replace("format ", ""), r"angles=deg bsdf=value scale=1, expected type bsdf_data and format"),
    "no second line": ("type bsdf_data\n", "a.txt: no second line, expected type bsdf_data"),
    "no blocks": ("\n".join(EXAMPLE.splitlines()[:2]), "0 lines of numbers, expected a mirror direction"),
    "no head": (
        EXAMPLE.replace("0 0\n", "", 1),
        "11 lines of numbers, expected a mirror direction .two angles. above each block",
    ),
    "four numbers": (
        EXAMPLE.replace("0.0015", "0.0015 7", 1),
        r"row 6: 4 numbers, expected 2 \(a mirror direction\) or 3",
    ),
    "word": (EXAMPLE.replace("0.0015", "O.0015", 1), r"row 6: O\.0015, expected a number"),
    "angle": (EXAMPLE.replace("-20 0", "-20 400", 1), "row 5: -20 and 400, expected angles .* of at most 360"),
    "cosines": (
        EXAMPLE.replace("=deg", "=sin"),
        r"row 11: 15 and 0, expected direction cosines \(angles=sin\) of at most 1\. Is the unit another one",
    ),
    "empty": ("", r"a\.txt: the file is empty \(0 bytes\)"),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD)
def test_bad_files_are_refused_in_a_sentence(write, text, message):
    with pytest.raises(ReadError, match=message):
        fred.load(write(text))


@pytest.mark.parametrize(("unit", "row"), [("deg", "20 nan 1"), ("rad", "nan 1 1"), ("sin", "0.5 nan 1")])
def test_a_direction_without_one_of_its_angles_is_missing(write, unit, row):
    found = reader.read(write(f"type bsdf_data\nformat angles={unit}\n0.1 0\n0.2 0.3 1\n{row}\n"))
    assert found.valid[:, 0].tolist() == [True, False]
    assert found.masked == {"angle missing or infinite": 1}


def test_rounded_cosines_beyond_the_horizon_are_on_it(write):
    found = fred.load(write("type bsdf_data\nformat angles=sin\n0 0\n0.6 0.8000005 1\n0 0 1\n"))
    np.testing.assert_allclose(np.linalg.norm(found.wo, axis=1), 1, rtol=EXACT)
    assert found.wo[0, 2] == 0


def test_an_overlong_second_line_takes_no_time(write):
    begin = time.process_time()
    with pytest.raises(ReadError, match="expected a mirror direction"):
        fred.load(write("type bsdf_data\nformat " + "a" * 10**6 + " " * 10**6 + "scale=1\n"))
    assert time.process_time() - begin < SLOW


def test_it_claims_its_own_content_only():
    raw = EXAMPLE.encode()
    for text in (raw, b"\xef\xbb\xbf" + raw, raw.replace(b"\n", b"\r"), b"# a\n" + raw):
        assert fred.claims(text, len(text))
    for other in (
        b"theta_i,theta_o,brdf\n1,2,3\n",
        b"# type bsdf_data\n1 2\n",
        b"",
        b"\x00" * 99,
        b"type bsdf_database\n",
    ):
        assert not fred.claims(other, len(other))


def test_no_fault_raises_anything_but_a_read_error(write):
    read, refused = outcomes(sample, write, np.random.default_rng(12))
    assert read > 20 < len(refused)
    assert not any("\n" in message for message in refused)
