"""Several files as one measurement of one sample: what is joined, whose each row is, and what cannot be one."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fitmat.errors import FitmatError, ReadError
from fitmat.measurements.instrument import Instrument
from fitmat.measurements.joining import join
from fitmat.measurements.reader import read
from fitmat.measurements.samples import from_arrays

PLAIN = "theta_i,theta_o,brdf\n30,20,0.5\n30,30,0.25\n"

Write = Callable[[str, str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def written(name: str, content: str) -> Path:
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(content, encoding="utf-8")
        return path

    return written


def test_each_file_is_read_by_its_own_header(write: Write) -> None:
    """Degrees, decimal commas and sr⁻¹ beside radians, points and a reflectance factor, which is π f_r."""
    one = write("one.csv", PLAIN)
    other = write("other.txt", "AOI;VZA [rad];phi [deg];BRF\n45;0,5;180;0,31415926536\n45;0,25;0;0,62831853072\n")
    found = read([one, other])
    assert found.source == "one.csv + other.txt"
    assert np.rad2deg(found.theta_i) == pytest.approx([30, 30, 45, 45])
    assert found.signed_theta_o == pytest.approx([np.deg2rad(20), np.deg2rad(30), 0.5, -0.25])
    assert found.value[:, 0] == pytest.approx([0.5, 0.25, 0.1, 0.2])
    assert "Joined, as one measurement of one sample: one.csv (2 rows), other.txt (2 rows)." in found.notes
    assert "one.csv: brdf read as f_r in sr⁻¹, no factor applied." in found.notes


def test_what_is_masked_assumed_or_doubted_names_its_file(write: Write) -> None:
    one = write("one.csv", PLAIN + "30,40,\n30,95,0.1\n")
    other = write("other.csv", PLAIN.replace("30,", "60,"))
    found = read([one, other])
    assert found.masked == {"one.csv: at or below the horizon": 1, "one.csv: value missing or NaN": 1}
    assert (found.n_samples, found.n_valid) == (6, 4)
    shared = [note for note in found.notes if "brdf read as" in note]
    assert shared == ["brdf read as f_r in sr⁻¹, no factor applied."]  # of both, so of none by name
    with pytest.raises(ReadError, match=r"^other\.csv row 4: brdf = x, expected a number"):
        read([one, write("other.csv", PLAIN + "60,50,x\n")])


def test_what_was_inferred_stays_marked() -> None:
    """Of one part, whose channels are in another order; its sd is no noise that the other part would lack."""
    value = np.array([[0.1, 0.2], [0.3, 0.4]])
    plain = from_arrays([0.5, 0.5], [0.1, 0.2], value, channels=["r", "g"], source="plain")
    inferred = np.array([[False, False], [True, False]])
    turned = from_arrays([0.9, 0.9], [0.1, 0.2], value, channels=["g", "r"], source="turned")
    filled = dataclasses.replace(turned, inferred=inferred, sigma=np.where(inferred, 0.01, np.nan))
    for parts, rows in (([plain, filled], slice(2, 4)), ([filled, plain], slice(0, 2))):
        found = join(parts)
        k = found.channels.index("g")
        assert found.inferred is not None
        assert found.inferred[rows, k].tolist() == [False, True]
        assert np.count_nonzero(found.inferred) == 1
        assert found.sigma is not None
        assert (np.isfinite(found.sigma) == found.inferred).all()
        assert not found.sigma_given


def test_files_of_one_name_are_told_apart_by_their_folders(write: Write) -> None:
    one, other = write("monday/scan.csv", PLAIN), write("friday/scan.csv", PLAIN + "40,10,\n")
    found = read([one, other])
    assert found.source == "monday/scan.csv + friday/scan.csv"
    assert found.masked == {"friday/scan.csv: value missing or NaN": 1}
    assert "Rows that repeat an earlier geometry, all kept: 2." in found.notes
    with pytest.raises(ReadError, match=r"^friday/scan\.csv row 5: brdf = x"):
        read([one, write("friday/scan.csv", PLAIN + "40,10,\n40,20,x\n")])


def test_one_file_per_incidence_keeps_the_angle_of_its_head(write: Write) -> None:
    files = [write(f"{angle}.txt", f"#intheta {angle}\ntheta_o,brdf\n10,0.3\n20,0.2\n") for angle in (15, 30, 45, 60)]
    found = read(files)
    assert found.source == "15.txt + 3 others"
    assert np.rad2deg(found.theta_i) == pytest.approx(np.repeat([15, 30, 45, 60], 2))
    assert "45.txt: theta_i = 45 in every row, by the comment in row 1." in found.notes


def test_channels_in_another_order_are_the_same(write: Write) -> None:
    one = write("one.csv", "theta_i,theta_o,brdf_r,brdf_g,sigma_r,sigma_g\n30,20,1,2,0.1,0.2\n")
    other = write("other.csv", "theta_i,theta_o,sigma_g,sigma_r,brdf_g,brdf_r\n30,40,0.4,0.3,4,3\n")
    found = read([one, other])
    assert found.channels == ("r", "g")
    assert found.value.tolist() == [[1, 2], [3, 4]]
    assert found.sigma is not None
    assert found.sigma.tolist() == [[0.1, 0.2], [0.3, 0.4]]


def test_an_unknown_scale_is_one_for_all_files(write: Write) -> None:
    """Divided by a factor each, as they would be alone, they would lose their proportion."""
    found = read([write("one.csv", PLAIN), write("other.csv", PLAIN.replace("0.", "10."))], unknown_scale=True)
    assert found.value[2] / found.value[0] == pytest.approx(10.5 / 0.5)
    apart = [read(write(f"{k}.csv", PLAIN), unknown_scale=True) for k in range(2)]
    with pytest.raises(ReadError, match=r"0\.csv, 1\.csv: a scale that is not known.* expected one scale for all"):
        join(apart)


def test_peaks_are_judged_file_by_file(write: Write) -> None:
    """One laboratory counts its azimuth from the light, the other from the mirror side."""

    def lab(name: str, toward: int) -> Path:
        rows = "".join(
            f"45,{angle},{phi},{np.exp(-((((angle if phi == toward else -angle) - 45) / 8) ** 2)) + 0.05:.5f}\n"
            for phi in (0, 180)
            for angle in range(5, 85, 5)
        )
        return write(name, "theta_i,theta_o,phi,brdf\n" + rows)

    warnings = read([lab("mirror.csv", 180), lab("light.csv", 0)]).warnings
    assert len(warnings) == 1
    assert warnings[0].startswith("light.csv: The values peak back towards the light")


APART = {
    "channels": ("theta_i,theta_o,brdf_r\n1,2,3\n", "channels value beside r, expected the same in every file"),
    "wavelengths in comments": (
        "# wavelength: 650 nm\n" + PLAIN,
        "channels value beside 650, expected the same in every file",
    ),
    "sigma": (
        "theta_i,theta_o,brdf,sigma\n1,2,3,0.1\n",
        r"sigma in b\.csv only, expected it in every file that is joined, or in none\. Add it to a\.csv, or rename",
    ),
}


@pytest.mark.parametrize(("content", "sentence"), APART.values(), ids=APART)
def test_what_is_not_one_measurement_is_refused(write: Write, content: str, sentence: str) -> None:
    with pytest.raises(ReadError, match=rf"^a\.csv and b\.csv: {sentence}"):
        read([write("a.csv", PLAIN), write("b.csv", content)])


def test_two_wavelengths_in_comments_are_no_repeats(write: Write) -> None:
    """One in µm; both would else be the one unnamed channel."""
    with pytest.raises(ReadError, match="channels 550 beside 650"):
        read([write("a.csv", "# Wavelength = 0.55 µm\n" + PLAIN), write("b.csv", "// lambda: 650nm\n" + PLAIN)])


def test_instruments_are_one() -> None:
    one = from_arrays([0.5], [0.1], [0.2], source="one")
    other = dataclasses.replace(one, source="other", instrument=Instrument(calibration=0.03))
    with pytest.raises(ReadError, match=r"one and other: an ideal instrument beside .*calibration good to 3 %"):
        join([one, other])


def test_a_file_there_twice_is_refused(write: Write, tmp_path: Path) -> None:
    path = write("a.csv", PLAIN)
    with pytest.raises(ReadError, match=r"a\.csv: there twice, expected each file once"):
        read([path, path])
    (tmp_path / "link.csv").symlink_to(path)
    with pytest.raises(ReadError, match=r"link\.csv: the same file as .*a\.csv, expected each file once"):
        read([path, tmp_path / "link.csv"])


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ([], "no measurements, expected at least one"),
        ([3], "int: not measurements, expected a path"),
        (["none.csv", "none.csv"], "none.csv: no such file"),
        ([["a.csv"]], "list: not measurements"),
    ],
)
def test_what_is_no_list_of_files_is_refused(given: list, sentence: str) -> None:
    with pytest.raises(FitmatError, match=sentence):
        read(given)
    with pytest.raises(FitmatError, match="a part is"):
        join([3])  # pyright: ignore[reportArgumentType]
