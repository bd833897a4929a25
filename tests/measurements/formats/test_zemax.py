"""Zemax files: directions against scipy's rotations, a real file against FRED's of its sample, writing and faults."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial.transform import Rotation

from fitmat.errors import OutputError, ReadError
from fitmat.measurements import reader
from fitmat.measurements.formats import zemax
from fitmat.measurements.samples import Measurements, from_arrays

EXACT = 1e-14
"""Unit vectors of a handful of float64 operations."""

WRITTEN = 1e-8
"""Directions: angles are written to 10⁻⁷ degrees, half a digit of which is 10⁻⁹ rad."""

TRAPEZOIDS = 0.03
"""Relative: two grids of 10°, or a grid of 5° × 2° that the horizon cuts."""

HEAD = """# a comment
Source\tMeasured
Symmetry\t{symmetry}
SpectralContent\t{content}
ScatterType\t{kind}
SampleRotation\t{rotations}
{rotation}
AngleOfIncidence\t2
30\t60
ScatterAzimuth\t3
0\t90\t180
ScatterRadial\t2
0\t15

"""
PLAIN = {"symmetry": "PlaneSymmetrical", "content": "Monochrome", "kind": "BRDF", "rotations": 1, "rotation": 0}
BLOCK = "TIS\t0.5\n{0}\t{1}\n{0}\t{2}\n{0}\t{3}\n"


def small(first: float = 1.0, label: str = "Monochrome", blocks: int = 2, **head: object) -> str:
    """A file of two incidences, three azimuths and two radial angles; values count up from `first`."""
    body = "".join(BLOCK.format(*(first + 4 * k + np.arange(4))) for k in range(blocks))
    return HEAD.format(**{**PLAIN, **head}) + f"{label}\nDataBegin\n{body}DataEnd\n"


def sample(rng: np.random.Generator) -> bytes:
    """A valid file with angles, channels and empty cells as they come."""
    content = str(rng.choice(["Monochrome", "XYZ"]))
    angles = [np.sort(rng.choice(np.arange(step, 90, step), n, replace=False)) for n, step in ((1, 20), (2, 7), (4, 5))]
    shape = [*map(len, angles), 3]
    lists = [*angles, np.array([0.0, 4.0, 30.0])]
    head = f"Source Measured\nSymmetry ASymmetrical4D\nSpectralContent {content}\nScatterType BRDF\n"
    head += "".join(f"{axis} {len(a)}\n{' '.join(map(str, a))}\n" for axis, a in zip(zemax.AXES, lists, strict=True))
    for label in ("Monochrome",) if content == "Monochrome" else ("TristimulusX", "TristimulusY", "TristimulusZ"):
        head += f"{label}\nDataBegin\n"
        for _ in range(shape[0] * shape[1]):
            cells = rng.lognormal(size=(shape[2], shape[3])) * (rng.random((shape[2], shape[3])) < 0.8)
            head += "TIS 0.1\n" + "\n".join("\t".join(f"{cell:.3e}" for cell in row) for row in cells) + "\n"
        head += "DataEnd\n"
    return head.encode()


ODD = (
    b"nan",
    b"inf",
    b"-1",
    b"0",
    b"1e999",
    b"1000000000",
    b"99999999999999999999",
    b"3.5",
    b"x",
    b"",
    b"\xb0",
    b"1e-320",
)
"""Words that a number is replaced by."""


def mutated(raw: bytes, rng: np.random.Generator) -> bytes:
    """A text file with one to three faults in its lines, words, bytes or line ends."""
    for _ in range(rng.integers(1, 4)):
        lines = raw.split(b"\n")
        one, two = rng.integers(len(lines), size=2)
        words = list(re.finditer(rb"\S+", raw)) or [re.match(rb"", raw)]
        word, other = (words[k] for k in rng.integers(len(words), size=2))
        place = int(rng.integers(len(raw) + 1))
        match rng.integers(9):
            case 0:
                raw = b"\n".join([*lines[:one], *lines[one + 1 :]])
            case 1:
                raw = b"\n".join([*lines[:one], lines[two], *lines[one:]])
            case 2:
                raw = raw[:place]
            case 3 | 4:
                raw = raw[: word.start()] + ODD[rng.integers(len(ODD))] + raw[word.end() :]
            case 5:
                raw = raw[: word.start()] + other[0] + raw[word.end() :]
            case 6:
                raw = raw[:place] + rng.bytes(int(rng.integers(1, 5))) + raw[place:]
            case 7:
                raw = raw[:place] + raw[place + int(rng.integers(1, 40)) :]
            case _:
                raw = raw.replace(b"\n", (b"\r\n", b"\r", b" ", b"\n\n")[rng.integers(4)])
    return raw


def outcomes(
    make: Callable[[np.random.Generator], bytes], write: Callable[[bytes], Path], rng: np.random.Generator
) -> tuple[int, list[str]]:
    """How many of 200 faulty files are read nevertheless, and what is said of the others."""
    refused = []
    for _ in range(200):
        try:
            reader.read(write(mutated(make(rng), rng)))
        except ReadError as error:
            refused.append(str(error))
    return 200 - len(refused), refused


@pytest.fixture
def write(tmp_path: Path):
    def to_file(text: str | bytes) -> Path:
        path = tmp_path / "a.bsdf"
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return path

    return to_file


def turned(theta_i: float, phi_i: float, azimuth: float, radial: float) -> np.ndarray:
    """The mirror direction turned towards the normal, then about itself, counter-clockwise from outside; degrees."""
    mirror = Rotation.from_euler("y", -theta_i, degrees=True).apply([0, 0, 1])
    towards = Rotation.from_euler("y", radial, degrees=True).apply(mirror)
    about = Rotation.from_rotvec(azimuth * mirror, degrees=True).apply(towards)
    return Rotation.from_euler("z", phi_i, degrees=True).apply(about)


# --- reading --------------------------------------------------------------------------------------


def test_directions_are_rotations_of_the_mirror_direction(write):
    """scipy's rotations, which share no formula with the reader."""
    angles = [(0, 40, 250), (0, 10, 50, 90), (0, 37, 90, 180, 271, 359), (0, 5, 80, 180)]
    text = "Symmetry Asymmetrical4D\nSpectralContent Monochrome\nScatterType BRDF\n"
    for axis, values in zip(zemax.AXES, angles, strict=True):
        text += f"{axis} {len(values)}\n{' '.join(map(str, values))}\n"
    grid = np.stack(np.meshgrid(*angles, indexing="ij"), axis=-1).reshape(-1, 4)
    text += "Monochrome\nDataBegin\n" + "TIS 1\n1 2 3 4 5 6\n7 8 9 10 11 12\n1 2 3 4 5 6 7 8 9 10 11 12\n" * 12
    found = zemax.load(write(text))
    expected = [turned(i, r, a, p) for r, i, a, p in grid]
    np.testing.assert_allclose(found.wo, expected, atol=EXACT)
    light = [Rotation.from_euler("yz", [i, r], degrees=True).apply([0, 0, 1]) for r, i, _, _ in grid]
    np.testing.assert_allclose(found.wi, light, atol=EXACT)


def test_azimuth_0_leads_to_the_normal_and_180_to_grazing(write):
    """In the plane of incidence, so that the angles can be checked by eye."""
    found = reader.read(write(small()))
    assert np.rad2deg(found.signed_theta_o[[1, 5, 7, 11]]).round(9).tolist() == [15, 45, 45, 75]
    assert np.rad2deg(found.theta_i).round(9).tolist() == [30] * 6 + [60] * 6
    assert found.value[[1, 3, 5, 7, 9, 11], 0].tolist() == [2, 3, 4, 6, 7, 8]


def test_the_mirror_direction_counts_once(write):
    """Six lines hold two specular values."""
    found = reader.read(write(small()))
    assert found.masked == {"the same value of a direction once more, for another azimuth": 4}
    assert found.value[found.valid[:, 0] & (np.arange(12) % 2 == 0), 0].tolist() == [1, 5]


def test_specular_values_that_differ_are_all_kept(write):
    text = small().replace("5.0\t7.0", "5.5\t7.0")
    assert reader.read(write(text)).n_valid == 9


def test_xyz_and_rotations(write):
    x = small(rotations=2, rotation="0 45", symmetry="ASymmetrical4D", content="XYZ", label="TristimulusX", blocks=4)
    body = x[x.index("Tristimulus") :]
    text = x + body.replace("sX", "sY") + body.replace("sX", "sZ").replace("16.0", "99.0")
    found = reader.read(write(text))
    assert found.channels == ("x", "y", "z")
    assert found.value[-1].tolist() == [16, 16, 99]
    assert np.rad2deg(found.phi_i).round(9).tolist() == [0] * 12 + [45] * 12
    assert any("SampleRotation" in note for note in found.notes)


def test_zeros_are_no_datum_above_and_below_the_horizon(write):
    text = small().replace("6.0", "0").replace("8.0", "0.000e+00").replace("15\n", "45\n")
    found = zemax.load(write(text))
    below, above, _ = (np.flatnonzero(doubt).tolist() for doubt in found.doubts.values())
    assert (below, above) == ([11], [7])


# --- a real file ----------------------------------------------------------------------------------

EC1 = "ua-loft/zemax/AnoBlackEC1onAlum.bsdf"


@pytest.fixture
def ec1(shared_data: Path) -> Measurements:
    return reader.read(shared_data / EC1)


def test_every_zero_of_a_real_file_and_nothing_else_is_no_datum(shared_data, ec1):
    """Zeros counted in the text; the specular value stands in 19 lines of each of 4 blocks."""
    text = (shared_data / EC1).read_text().split("DataBegin")[1]
    zeros = len(re.findall(r"\t0\.000e\+00", text))
    assert sum(count for reason, count in ec1.masked.items() if reason.startswith("0 ")) == zeros == 193
    assert ec1.n_samples - ec1.n_valid == zeros + 4 * 18
    assert (ec1.value[ec1.valid] > 0).all()


def test_the_peak_at_50_degrees_is_off_specular(ec1):
    """The folder's README: EC1 peaks off-specular, towards grazing."""
    in_plane = ec1.in_plane & np.isclose(ec1.theta_i, np.deg2rad(50))
    assert np.rad2deg(ec1.signed_theta_o[in_plane][ec1.value[in_plane, 0].argmax()]) == pytest.approx(80)


def test_the_specular_value_is_that_of_the_fred_file(shared_data, ec1):
    """Printed in both files: 0.0348 at 10° incidence."""
    other = reader.read(shared_data / "ua-loft/fred/AnoBlackEC1onAlum.txt")
    for found in (ec1, other):
        specular = np.isclose(found.theta_i, np.deg2rad(10)) & (found.wo @ [1, 0, 0] < -0.17) & found.in_plane
        specular &= np.isclose(found.theta_o, np.deg2rad(10))
        assert found.value[specular & found.valid[:, 0], 0].tolist() == [0.0348]


def test_the_sample_looks_as_in_the_fred_file(shared_data, ec1):
    """Two exports of one measurement, 6 to 12 % apart in the median; 24 to 85 % if azimuth 0 led to grazing."""
    other = reader.read(shared_data / "ua-loft/fred/AnoBlackEC1onAlum.txt")
    for angle, bound in ((10, 0.07), (30, 0.08), (50, 0.1), (70, 0.14)):
        mine, theirs = (np.isclose(m.theta_i, np.deg2rad(angle)) & m.valid[:, 0] for m in (ec1, other))
        places = np.concatenate([other.wo[theirs, :2], other.wo[theirs, :2] * [1, -1]])
        curve = LinearNDInterpolator(places, np.tile(np.log(other.value[theirs, 0]), 2))
        apart = np.abs(np.exp(curve(ec1.wo[mine, :2])) / ec1.value[mine, 0] - 1)
        assert np.nanmedian(apart) < bound
        wrong = np.abs(np.exp(curve(ec1.wo[mine, :2] * [-1, 1])) / ec1.value[mine, 0] - 1)
        assert np.nanmedian(wrong) > 2 * bound


# --- refusals -------------------------------------------------------------------------------------

BAD: dict[str, tuple[str, str]] = {
    "btdf": (small(kind="BTDF"), "a.bsdf: ScatterType BTDF, expected BRDF, since fitmat fits reflection. Choose"),
    "symmetry": (small(symmetry="Round"), "row 3: Symmetry round, expected planesymmetrical or asymmetrical or"),
    "content": (small(content="Lab"), "row 4: SpectralContent lab, expected monochrome or xyz or rgb"),
    "kind": (small(kind="BSSRDF"), "row 5: ScatterType bssrdf, expected brdf or btdf"),
    "keyword": (small().replace("TIS", "Tisch", 1), "row 17: tisch, expected a keyword of the format. Put #"),
    "count": (small().replace("Azimuth\t3", "Azimuth\t4"), "row 10: ScatterAzimuth 4 with 3 angles below it"),
    "huge count": (small().replace("Azimuth\t3", "Azimuth\t999999999999"), "ScatterAzimuth 999999999999 with 3 angles"),
    "negative count": (small().replace("Azimuth\t3", "Azimuth\t-3"), "ScatterAzimuth -3 with 3 angles"),
    "angle": (small().replace("30\t60", "30\t95"), "row 8: AngleOfIncidence holds 95, expected 0 to 90 degrees"),
    "nan angle": (small().replace("30\t60", "nan\t60"), "AngleOfIncidence holds nan, expected 0 to 90 degrees"),
    "word": (small().replace("7.0", "7,0"), r"row 23: 7,0, expected a number"),
    "number lost": (small().replace("\t7.0", ""), r"row 21: 5 numbers in the block that begins here, expected 6 \(3"),
    "block lost": (small(blocks=1), r"1 blocks \(TIS\) below 1 channels, expected 2 of each of 1: 1 rotations × 2"),
    "channels lost": (small(content="XYZ", label="TristimulusX"), r"2 blocks \(TIS\) below 1 channels, expected 2 of"),
    "no head": (small().replace("ScatterType\tBRDF\n", ""), "no line ScatterType, expected one. Is the file complete"),
    "head twice": (small().replace("Source", "Symmetry"), "2 lines Symmetry, the second on row 3, expected one"),
    "stray": (
        small().replace("DataEnd", "DataEnd\n7"),
        "row 25: numbers below dataend, expected none. Was a line lost",
    ),
    "above": ("3 4\n" + small(), "row 1: numbers above the first keyword, expected none"),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD)
def test_bad_files_are_refused_in_a_sentence(write, text, message):
    with pytest.raises(ReadError, match=message) as raised:
        zemax.load(write(text))
    assert str(raised.value).startswith("a.bsdf")
    assert "\n" not in str(raised.value)


def test_channels_in_another_order_are_refused(write):
    x = small(content="XYZ", label="TristimulusX")
    body = x[x.index("Tristimulus") :]
    text = x + body.replace("sX", "sZ") + body.replace("sX", "sY")
    with pytest.raises(ReadError, match=r"channels in the order x, z, y, expected x, y, z\. Sort"):
        zemax.load(write(text))


def test_it_claims_its_own_content_only():
    raw = small().encode()
    for text in (raw, b"\xef\xbb\xbf" + raw, raw.replace(b"\n", b"\r\n"), raw.replace(b"\n", b"\r")):
        assert zemax.claims(text[:65536], len(text))
    for other in (
        b"theta_i,theta_o,brdf\n1,2,3\n",
        b"# ScatterRadial\n1 2\n",
        b"",
        b"\x00" * 99,
        b"ScatterRadial 2\nAOI 3\n",
    ):
        assert not zemax.claims(other, len(other))


def test_no_fault_raises_anything_but_a_read_error(write):
    read, refused = outcomes(sample, write, np.random.default_rng(11))
    assert read > 20 < len(refused)
    assert not any("\n" in message for message in refused)


# --- writing --------------------------------------------------------------------------------------


def same(one: Measurements, other: Measurements) -> None:
    """Both hold the same valid samples, whatever their order."""
    rows = [np.column_stack([m.wi, m.wo, m.value])[m.valid.all(axis=1)] for m in (one, other)]
    order = [np.lexsort(np.round(found, 6).T) for found in rows]
    first, second = (found[k] for found, k in zip(rows, order, strict=True))
    np.testing.assert_allclose(first[:, :6], second[:, :6], atol=WRITTEN)
    np.testing.assert_array_equal(first[:, 6:], second[:, 6:])


def test_a_real_file_comes_back(write, ec1):
    text = zemax.dump(ec1)
    same(reader.read(write(text)), ec1)
    assert "Symmetry\tPlaneSymmetrical" in text
    assert zemax.losses(ec1) == ("265 samples masked in some channel: there the file holds 0, its mark for no datum.",)


def test_tis_is_the_integral_of_the_fred_file(shared_data, ec1):
    """2π ∫ mean(f_r) cos θ sin θ dθ over the rings about the normal that FRED's export holds, at 10° incidence."""
    other = reader.read(shared_data / "ua-loft/fred/AnoBlackEC1onAlum.txt")
    here = np.isclose(other.theta_i, np.deg2rad(10))
    theta, ring = np.unique(np.round(other.theta_o[here], 6), return_inverse=True)
    mean = np.bincount(ring, other.value[here, 0]) / np.bincount(ring)
    expected = 2 * np.pi * np.trapezoid(mean * np.sin(theta) * np.cos(theta), theta)
    assert float(re.findall(r"TIS\t(\S+)", zemax.dump(ec1))[0]) == pytest.approx(expected, rel=TRAPEZOIDS)


@pytest.mark.parametrize("theta_i", [0.0, 50.0])
def test_tis_of_a_white_surface_is_one(theta_i):
    """f_r = 1/π reflects everything, above the horizon."""
    azimuth, radial = (a.ravel() for a in np.meshgrid(np.arange(0, 181, 5.0), np.arange(0, 141.0, 2.0)))
    wo = np.array([turned(theta_i, 0, a, r) for a, r in zip(azimuth, radial, strict=True)])
    wo = wo[(wo[:, 2] > 1e-6) & ((radial > 0) | (azimuth == 0))]
    wi = np.tile([np.sin(np.deg2rad(theta_i)), 0, np.cos(np.deg2rad(theta_i))], (len(wo), 1))
    one = np.full((len(wo), 1), 1 / np.pi)
    (total,) = re.findall(r"TIS\t(\S+)", zemax.dump(Measurements(wi, wo, one, None, one > 0, ("value",))))
    assert float(total) == pytest.approx(1, rel=TRAPEZOIDS)


def test_in_plane_curves_on_both_sides_of_the_plane_and_rotated_samples_come_back(write):
    rng = np.random.default_rng(1)
    for turns, angles in (([0.0], [0, 30, 60]), ([30.0], [0, 30, 60]), ([15.0, 120.0], [20, 60])):
        grid = np.meshgrid(turns, angles, np.arange(-80, 81, 5.0), indexing="ij")
        phi_i, theta_i, theta_o = (np.deg2rad(angle.ravel()) for angle in grid)
        curves = from_arrays(theta_i, theta_o, rng.lognormal(size=theta_i.size), phi_i=phi_i)
        same(reader.read(write(zemax.dump(curves))), curves)


def test_angles_that_are_not_round_come_back(write):
    """One incidence and 40 zenith angles, drawn at random, form a grid as well."""
    rng = np.random.default_rng(2)
    curve = from_arrays(np.full(40, rng.uniform(0.3, 1)), rng.uniform(-1.4, 1.4, 40), rng.lognormal(size=40))
    same(reader.read(write(zemax.dump(curve))), curve)


def test_the_specular_value_stands_in_every_line(ec1):
    """As the specification's own example has it; the other azimuths of a mirror direction are that direction."""
    numbers = [line.split("\t") for line in zemax.dump(ec1).split("DataBegin\n")[1].splitlines()]
    first = [row[0] for row in numbers if len(row) == 12]
    assert first == ["0.0348"] * 19 + ["0.04202"] * 19 + ["0.09325"] * 19 + ["1.234"] * 19


def test_samples_beside_the_plane_keep_their_side(write):
    text = small(symmetry="ASymmetrical").replace("0\t90\t180", "0\t200\t300")
    found = reader.read(write(text))
    again = zemax.dump(found)
    assert "Symmetry\tASymmetrical\n" in again
    same(reader.read(write(again)), found)


def test_xyz_comes_back(write):
    x = small(content="XYZ", label="TristimulusX")
    body = x[x.index("Tristimulus") :]
    found = reader.read(write(x + body.replace("sX", "sY").replace("8.0", "8.5") + body.replace("sX", "sZ")))
    same(reader.read(write(zemax.dump(found))), found)


def test_scattered_samples_are_refused_with_another_way_out(hemisphere):
    wi, wo = hemisphere(50, 1), hemisphere(50, 2)
    scattered = Measurements(wi, wo, np.ones((50, 1)), None, np.ones((50, 1), bool), ("value",))
    message = r"No Zemax file can hold 50 samples at 50 × 50 × 50 × 50 distinct angles .*Write \.csv, \.parquet or ALTA"
    with pytest.raises(OutputError, match=message):
        zemax.dump(scattered)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"value": [0.0, 1.0]}, "1 valid values are 0, which a Zemax file uses for no datum, expected none. Mask"),
        ({"theta_o": [0.4, 0.4]}, "1 samples repeat the angles of another one, expected one for each cell"),
        ({"value": [[1.0, 2.0]] * 2}, "channels 1, 2, expected one, or x, y, z. Write"),
        ({"value": [[1.0, 2.0, 3.0]] * 2}, "channels r, g, b, expected one, or x, y, z"),
        ({"value": [np.nan, np.nan]}, "array: no valid sample, expected at least one. Check"),
    ],
)
def test_what_the_format_cannot_say_is_refused(change, message):
    given = {"theta_i": [0.5, 0.5], "theta_o": [0.4, 0.5], "value": [1.0, 2.0], **change}
    with pytest.raises(OutputError, match=message):
        zemax.dump(from_arrays(**given))


def test_losses_are_told():
    given = from_arrays([0.5, 0.5], [0.4, 0.5], [1.0, np.nan], sigma=[1.0, 1.0], channels=("550",))
    assert [sentence.split()[0] for sentence in zemax.losses(given)] == ["1", "sigma", "The"]
    assert zemax.losses(from_arrays([0.5], [0.4], [1.0])) == ()
