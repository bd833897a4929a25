"""pab-opto files: the example of Radiance's manual, either side, both quantities, joined incidences, and faults."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from test_zemax import outcomes

from fitmat.errors import ReadError
from fitmat.measurements import reader
from fitmat.measurements.formats import pab_opto

EXACT = 1e-9
"""Relative or radians; a handful of float64 operations."""

MANUAL = """#incident_angle 82.5 180
#format: theta phi DSF
84.968 125.790 0.009744
84.889 125.610 0.007737
84.805 125.427 0.008569
"""
"""The minimal file of pabopto2bsdf(1)."""

WHOLE = "#format: theta phi DSF\n#incident_angle 82.5 180\n#intheta 82.5\n#inphi 180\n#upphi 0\n#colorimetry: CIE-Y\n"
"""Its complete head, which the manual calls equivalent."""

HEAD = '#sample_name "plate"\n#intheta 30\n#inphi 0\n#datapoints_in_file: 2\n#format: theta phi BSDF\n'

Write = Callable[[str], Path]


def sample(rng: np.random.Generator) -> bytes:
    """A valid file: either side, one channel or three, with the cosine or without it."""
    colours, behind = int(rng.choice([1, 3])), bool(rng.integers(2))
    theta, phi = rng.uniform(0, 85, 12), rng.uniform(-180, 360, 12)
    theta, lit = (180 - theta, 150) if behind else (theta, 30)
    text = f"#intheta {lit}\n#inphi {rng.uniform(0, 360):.1f}\n#upphi 90\n"
    text += f"#format: theta phi {rng.choice(['BRDF', 'DSF'])}\n"
    text += "#colorimetry: CIE-XYZ\n" if colours == 3 else ""
    cells = np.column_stack([theta, phi, rng.lognormal(size=(12, colours))])
    return (text + "\n".join("\t".join(f"{cell:.5g}" for cell in row) for row in cells) + "\n").encode()


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def to_file(text: str) -> Path:
        path = tmp_path / "plate.txt"
        path.write_text(text, encoding="utf-8")
        return path

    return to_file


@pytest.mark.parametrize("text", [MANUAL, WHOLE + MANUAL.partition("DSF\n")[2]], ids=["minimal", "complete"])
def test_the_example_of_the_manual(write: Write, text: str) -> None:
    """DSF is f_r cosθ_o; light and sensor share one system, so that 126° from light at 180° is on the light's side."""
    found = reader.read(write(text))
    theta, phi = np.deg2rad([84.968, 84.889, 84.805]), np.deg2rad([125.790, 125.610, 125.427])
    expected = np.array([0.009744, 0.007737, 0.008569]) / np.cos(theta)
    np.testing.assert_allclose(found.value[:, 0], expected, rtol=EXACT)
    np.testing.assert_allclose(found.wo.T, [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    np.testing.assert_allclose(found.wi[0], [-np.sin(np.deg2rad(82.5)), 0, np.cos(np.deg2rad(82.5))], atol=EXACT)
    np.testing.assert_allclose(np.rad2deg(found.phi), 180 - np.rad2deg(phi), atol=1e-6)
    assert (found.signed_theta_o < 0).all()


def test_the_mirror_direction_is_opposite(write: Write) -> None:
    found = reader.read(write(HEAD + "30 180 9\n30 0 1\n"))
    np.testing.assert_allclose(found.wo[0], found.wi[0] * [-1, -1, 1], atol=EXACT)
    np.testing.assert_allclose(found.wo[1], found.wi[1], atol=EXACT)
    assert found.value.tolist() == [[9.0], [1.0]]


def test_a_sample_lit_from_behind_is_turned_over(write: Write) -> None:
    """Turned about one of its axes, not mirrored: what was counter-clockwise from the light stays so."""
    front = reader.read(write("#incident_angle 30 40\n#format: theta phi BRDF\n50 100 3\n60 220 2\n"))
    back = reader.read(write("#incident_angle 150 -40\n#format: theta phi BRDF\n130 -100 3\n120 -220 2\n"))
    np.testing.assert_allclose(back.wi, front.wi, atol=EXACT)
    np.testing.assert_allclose(back.wo, front.wo, atol=EXACT)
    assert "from behind: the sample is turned over" in back.notes[1]


def test_azimuths_count_from_the_samples_up(write: Write) -> None:
    found = reader.read(write("#upphi 90\n#incident_angle 30 100\n#format: theta phi BSDF\n50 280 3\n"))
    assert np.rad2deg(found.phi_i) == pytest.approx([10])
    assert np.rad2deg(found.phi) == pytest.approx([180])


def test_colours_are_channels(write: Write) -> None:
    found = reader.read(write(HEAD + "#colorimetry: CIE-XYZ\n10 0 1 2 3\n20 0 4 5 6\n"))
    assert found.channels == ("x", "y", "z")
    assert found.value.tolist() == [[1, 2, 3], [4, 5, 6]]


def test_transmitted_light_is_masked_and_counted(write: Write) -> None:
    found = reader.read(write(HEAD + "30 180 1\n150 180 9\n"))
    assert found.masked == {"transmitted: on the other side than the light": 1}
    assert found.n_valid == 1


def test_one_file_an_incidence_is_one_measurement(tmp_path: Path) -> None:
    files = [tmp_path / f"t{theta}.txt" for theta in (10, 40, 70)]
    for path, theta in zip(files, (10, 40, 70), strict=True):
        path.write_text(HEAD.replace("#intheta 30", f"#intheta {theta}") + f"{theta} 180 2\n{theta} 0 1\n")
    found = reader.read(files)
    assert np.rad2deg(found.theta_i) == pytest.approx([10, 10, 40, 40, 70, 70])
    assert found.in_plane.all()


def test_the_users_columns_count(write: Write) -> None:
    """Such a file is a text table too; its head still says where the light is."""
    found = reader.read(write(HEAD + "30 180 9\n30 10 1\n"), columns="theta_o=1,phi=2,brdf=3")
    assert np.rad2deg(found.theta_i) == pytest.approx([30, 30])
    assert np.rad2deg(found.phi) == pytest.approx([180, 10])


def test_a_count_that_is_not_that_of_the_lines_is_said(write: Write) -> None:
    notes = reader.read(write(HEAD + "30 180 9\n")).notes
    assert "The head says 2 data points, the file has 1 lines of them." in notes
    assert not any("data points" in note for note in reader.read(write(HEAD + "30 180 9\n20 0 1\n")).notes)


BAD = {
    "other incidences": ("#incident_angle 40 0\n" + HEAD + "1 2 3\n", "row 3: intheta 30 and incident_angle 40 0"),
    "no azimuth": (HEAD.replace("#inphi 0\n", "") + "1 2 3\n", "no line inphi, expected intheta and inphi, or"),
    "incidence": (HEAD.replace("theta 30", "theta 200") + "1 2 3\n", "intheta 200, expected 0 to 180"),
    "a word": (HEAD.replace("theta 30", "theta thirty") + "1 2 3\n", "row 2: intheta thirty, expected 1 in degrees"),
    "transmission": (HEAD.replace("BSDF", "BTDF") + "1 2 3\n", "format BTDF, expected BRDF, since fitmat fits refl"),
    "transmitted": (HEAD + "130 2 3\n120 1 1\n", "light that goes through the sample only, expected reflected light"),
    "columns": (HEAD + "1 2 3 4\n", r"row 6: 4 numbers, expected 3 \(theta, phi and 1 of brdf\)"),
    "colours": (HEAD + "#colorimetry: RGB\n1 2 3\n", "row 6: colorimetry RGB, expected CIE-Y or CIE-XYZ"),
    "more columns": (HEAD.replace("BSDF", "BSDF sigma") + "1 2 3\n", "row 5: format theta phi BSDF sigma, expected"),
    "angle": (HEAD + "-10 2 3\n", "row 6: theta -10, phi 2, expected degrees, theta of 0 to 180"),
    "number": (HEAD + "1 2 x\n", "row 6: x, expected a number"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD)
def test_bad_files_are_refused_in_a_sentence(write: Write, text: str, message: str) -> None:
    with pytest.raises(ReadError, match=message):
        reader.read(write(text))


def test_a_byte_order_mark_of_another_encoding_is_refused(tmp_path: Path) -> None:
    """What reads as a head in bytes is none in UTF-16."""
    path = tmp_path / "a.txt"
    path.write_bytes(b"\xfe\xff" + HEAD.encode() + b"10 0 1\n")
    with pytest.raises(ReadError, match="no line #format that can be read, expected theta phi BSDF"):
        reader.read(path)


def test_it_claims_heads_that_say_where_the_light_is() -> None:
    assert pab_opto.claims(MANUAL.encode(), 9)
    assert pab_opto.claims(HEAD.replace(" ", "\t").replace("#", "# ").encode(), 9)
    assert not pab_opto.claims(b"#intheta 30\ntheta_o,brdf\n1,2\n", 9)
    assert not pab_opto.claims(b"#format: theta phi BSDF\n1 2 3\n", 9)


def test_no_fault_raises_anything_but_a_read_error(tmp_path: Path) -> None:
    def to_file(raw: bytes) -> Path:
        (tmp_path / "a.txt").write_bytes(raw)
        return tmp_path / "a.txt"

    read, refused = outcomes(sample, to_file, np.random.default_rng(3))
    assert read > 5
    assert len(refused) > 5
