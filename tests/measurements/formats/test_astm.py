"""ASTM files: the columns of the published readers, their unit, and faults."""

from pathlib import Path

import numpy as np
import pytest
from test_zemax import outcomes

from fitmat.errors import ReadError
from fitmat.measurements import reader
from fitmat.measurements.formats import astm

EXACT = 1e-12
"""Relative: angles pass through a handful of float64 operations."""

EXAMPLE = """MATERIAL krylon_blue
NUM_POINTS 2
VARS theta_i,phi_i,theta_s,phi_s,R,G,B
0.5,1.0,0.25,4.1,0.1,0.2,0.3

0.5,1.0,0.5,4.141592653589793,0.4,0.5,-0.01
"""
"""The columns of the Cornell files, as libbsdf's and ALTA's readers expect them."""


def sample(rng: np.random.Generator) -> bytes:
    """A valid file of any kind of channels."""
    names = str(rng.choice(["R,G,B", "X,Y,Z", "400nm,500nm,600.5nm", "Integrated(300-700)"]))
    count = names.count(",") + 1
    rows = np.column_stack(
        [rng.uniform(0, 1.5, 12), rng.uniform(-3, 6, 12), rng.uniform(0, 1.5, 12), rng.uniform(-3, 6, 12)]
    )
    rows = np.column_stack([rows, rng.lognormal(size=(12, count))])
    text = f"FILE x\nNUM_POINTS 12\nVARS theta_i,phi_i,theta_s,phi_s,{names}\n"
    return (text + "\n".join(",".join(f"{number:.6g}" for number in row) for row in rows) + "\n").encode()


@pytest.fixture
def write(tmp_path: Path):
    def to_file(text: str | bytes) -> Path:
        path = tmp_path / "a.astm"
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return path

    return to_file


def test_columns_and_azimuths(write):
    """The second row is the mirror direction of its light: θ_s = θ_i, φ_s = φ_i + π; negative values stay."""
    found = reader.read(write(EXAMPLE))
    assert found.channels == ("r", "g", "b")
    assert found.value.tolist() == [[0.1, 0.2, 0.3], [0.4, 0.5, -0.01]]
    np.testing.assert_allclose(found.phi_i, 1.0, rtol=EXACT)
    np.testing.assert_allclose(found.wo[1], found.wi[1] * [-1, -1, 1], atol=EXACT)
    np.testing.assert_allclose(found.phi[0], 3.1, rtol=EXACT)


@pytest.mark.parametrize(
    ("names", "channels", "quantity"),
    [
        ("R,G,B", ("r", "g", "b"), "brdf"),
        ("X, Y, Z", ("x", "y", "z"), "brdf"),
        ("400nm,500.5 nm,700nm", ("400", "500.5", "700"), "brdf"),
        ("Integrated(300-700)", ("value",), "brdf"),
        ("CCBRDF", ("value",), "brdf_cos"),
    ],
)
def test_channels(write, names, channels, quantity):
    text = f"VARS theta_i,phi_i,theta_s,phi_s,{names}\r\n0.5,0,0.25,1" + ",0.5" * len(channels) + "\r\n"
    found = astm.load(write(text))
    assert (found.channels, found.quantity) == (channels, quantity)


def test_columns_may_stand_in_any_order_and_phi_i_may_be_absent(write):
    found = reader.read(write("VARS phi_s,Integrated,theta_s,theta_i\n3.0,0.5,0.25,0.75\n"))
    np.testing.assert_allclose([found.theta_i, found.theta_o, found.phi], [[0.75], [0.25], [3.0]], rtol=EXACT)
    assert found.value.tolist() == [[0.5]]


def test_the_cosine_is_divided_out(write):
    """ASTM E2387's cosine-corrected BSDF is f_r cos θ_s; at θ_s = 60° half of f_r."""
    found = reader.read(write(f"VARS theta_i,theta_s,phi_s,ccbrdf\n0.5,{np.pi / 3},3.0,0.5\n"))
    np.testing.assert_allclose(found.value, [[1.0]], rtol=EXACT)


def test_a_direction_without_its_azimuth_is_missing(write):
    rows = "0.5,0,0.25,nan,1\n0.5,nan,0.25,1,1\n0.5,0,0.25,1,1\n"
    found = reader.read(write("VARS theta_i,phi_i,theta_s,phi_s,Integrated\n" + rows))
    assert found.valid[:, 0].tolist() == [False, False, True]
    assert found.masked == {"angle missing or infinite": 2}


BAD: dict[str, tuple[str, str]] = {
    "degrees": (
        EXAMPLE.replace("0.25,4.1", "45,4.1"),
        r"row 4: theta_o = 45, expected −3\.142 to 3\.142 radians.*delete",
    ),
    "azimuth": (EXAMPLE.replace("0.25,4.1", "0.25,241"), r"row 4: phi_o = 241, expected −6\.283 to 6\.283 radians"),
    "truncated": (EXAMPLE.rsplit("\n0.5", 1)[0], r"row 2: NUM_POINTS 2 and 1 rows, expected them to agree\. Was"),
    "cut line": (EXAMPLE.replace(",-0.01", ""), r"row 6: 6 numbers, expected 7 \(the columns that VARS names\)"),
    "empty cell": (EXAMPLE.replace("0.1,0.2", "0.1,"), r"row 4: 6 numbers, expected 7.*Correct the line"),
    "huge count": (EXAMPLE.replace("POINTS 2", "POINTS 99999999999"), "NUM_POINTS 99999999999 and 2 rows"),
    "no rows": (EXAMPLE[: EXAMPLE.index("0.5")].replace("NUM", "MUM"), "no rows below VARS, expected at least one"),
    "no vars": (EXAMPLE.replace("VARS", "COLUMNS"), "no line VARS, expected one with the names of the columns"),
    "no theta_s": (
        EXAMPLE.replace("theta_s", "theta"),
        r"row 3: VARS names theta_i, phi_i, theta.*expected theta_i, phi_i",
    ),
    "twice": (EXAMPLE.replace("G,B", "R,B"), "row 3: VARS names .*once each"),
    "channels": (EXAMPLE.replace("R,G,B", "brdf,sigma,x"), "VARS names brdf, sigma, x, expected R,G,B or X,Y,Z or"),
    "word": (EXAMPLE.replace("0.25", "O.25"), r"row 4: O\.25, expected a number"),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD)
def test_bad_files_are_refused_in_a_sentence(write, text, message):
    with pytest.raises(ReadError, match=message):
        astm.load(write(text))


def test_it_claims_its_own_content_only():
    raw = EXAMPLE.encode()
    for text in (raw, raw.replace(b"\n", b"\r\n")):
        assert astm.claims(text, len(text))
    for other in (b"theta_i,phi_i,theta_s,brdf\n1,2,3\n", b"VARS a,b\n", b"", b"\x00" * 99, b"VARS" + b" " * 65000):
        assert not astm.claims(other, len(other))


def test_no_fault_raises_anything_but_a_read_error(write):
    read, refused = outcomes(sample, write, np.random.default_rng(13))
    assert read > 10 < len(refused)
    assert not any("\n" in message for message in refused)
