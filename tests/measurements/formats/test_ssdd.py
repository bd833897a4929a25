"""SSDD files: libbsdf's own GGX against fitmat's, the three systems of angles against scipy's rotations, and faults."""

import time
from pathlib import Path

import numpy as np
import pytest
import test_alta
import test_astm
import test_fred
import test_lighttools
import test_zemax
from scipy.spatial.transform import Rotation
from test_zemax import outcomes, turned

import fitmat as fm
from fitmat.errors import ReadError
from fitmat.measurements import reader
from fitmat.measurements.formats import alta, astm, fred, lighttools, ssdd, zemax

EXACT = 1e-14
"""Unit vectors of a handful of float64 operations."""

PRINTED = 5e-5
"""Relative: libbsdf prints values to 6 digits, and angles likewise, by which the lobe changes 2.6·10⁻⁵."""

SLOW = 10.0
"""Seconds of this process; a search that backtracks or begins anew takes minutes."""

EXAMPLE = """VERSION 0.2

# Bluish diffuse BRDF
DATA_TYPE brdf
COLOR_MODEL rgb
PARAM_TYPE half_difference_coordinate_system
REDUCTION_TYPE bilateral_symmetry reciprocity
PARAM0_LIST 0 90
PARAM2_LIST 0 90
PARAM3_LIST 0 90
DATA ascii
# PARAM3: 0
# PARAM2: 0
0 0.0524275 0.159779
0 0.0524275 0.159779
# PARAM2: 90
0 0.0524275 0.159779
0 0.0524275 0.159779
# PARAM3: 90
# PARAM2: 0
0 0.0524275 0.159779
0 0.0524275 0.159779
# PARAM2: 90
0 0.0524275 0.159779
0 0.0524275 0.159779

DATA_TYPE specular_reflectance
COLOR_MODEL spectrum
WAVELENGTH_LIST 400 450
PARAM0_LIST 0 90
DATA ascii
0.05 0.05
0.05 0.05
"""
"""From the specification of the format."""

LISTS = ((10.0, 35.0, 60.0), (0.0, 200.0), (0.0, 20.0, 45.0, 80.0), (0.0, 75.0, 190.0))


def made(system: str, colours: int = 1, *, binary: bool = False, lists=LISTS, offsets: str = "") -> bytes:
    """A file whose values count up from 1, in the order of the format."""
    model = {1: "monochrome", 3: "xyz"}.get(colours, "spectrum")
    text = f"VERSION 0.2\nDATA_TYPE brdf\nCOLOR_MODEL {model}\n"
    text += f"WAVELENGTH_LIST {' '.join(str(400 + 10 * k) for k in range(colours))}\n" if model == "spectrum" else ""
    text += f"PARAM_TYPE {system}_coordinate_system\n"
    text += (
        "".join(f"PARAM{k}_LIST {' '.join(map(str, angles))}\n" for k, angles in enumerate(lists) if angles) + offsets
    )
    value = np.arange(1, colours * np.prod([max(len(a), 1) for a in lists]) + 1).reshape(-1, colours)
    if binary:
        return text.encode() + b"DATA binary\n" + value.astype("<f4").tobytes()
    return (text + "DATA ascii\n" + "\n".join(" ".join(map(str, row)) for row in value) + "\n").encode()


def sample(rng: np.random.Generator) -> bytes:
    """A valid file of any system, colour and mode."""
    system = str(rng.choice(["spherical", "specular", "half_difference"]))
    lists = tuple(tuple(np.sort(rng.uniform(0, 80, n)).round(2)) for n in (2, rng.integers(0, 3), 3, 2))
    return made(system, int(rng.choice([1, 3, 4])), binary=bool(rng.integers(2)), lists=lists)


@pytest.fixture
def write(tmp_path: Path):
    def to_file(content: str | bytes) -> Path:
        path = tmp_path / "a.ssdd"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return to_file


def test_libbsdfs_ggx_is_fitmats_with_separable_masking(shared_data):
    """All 3284 values above the horizon; libbsdf's `Ggx` multiplies two G1 (Walter et al. 2007)."""
    found = reader.read(shared_data / "ssdd/ggx_alpha0.25_eta1.5.ssdd")
    used = found.valid[:, 0]
    assert (found.n_samples, used.sum()) == (10 * 46 * 13, 3284)
    separable, correlated = (
        fm.evaluate(fm.model("ggx", alpha=0.25, eta=1.5, masking=masking), found.wi[used], found.wo[used])
        for masking in ("separable", "correlated")
    )
    np.testing.assert_allclose(found.value[used], separable, rtol=PRINTED)
    assert np.abs(found.value[used] / correlated - 1).max() > 100 * PRINTED
    normal = used & (found.theta_i == 0) & (found.theta_o == 0)
    assert found.value[normal, 0] == pytest.approx(0.04 / (4 * np.pi * 0.25**2), rel=PRINTED)


def test_values_stand_at_the_index_of_the_specification(write):
    """index = i0 + n0 i1 + n0 n1 i2 + n0 n1 n2 i3."""
    found = ssdd.load(write(made("spherical")))
    theta_i, phi_i, theta_o, phi_o = np.deg2rad(np.stack(np.meshgrid(*LISTS, indexing="ij"), -1).reshape(-1, 4)).T
    index = np.stack(np.meshgrid(*(np.arange(len(a)) for a in LISTS), indexing="ij"), -1).reshape(-1, 4)
    expected = 1 + index @ np.cumprod([1, *map(len, LISTS[:3])])
    wi, wo = (
        np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], 1)
        for t, p in ((theta_i, phi_i), (theta_o, phi_o))
    )
    mine, theirs = (
        np.column_stack([np.round(rows, 9), values])
        for rows, values in (
            (np.column_stack([found.wi, found.wo]), found.value[:, 0]),
            (np.column_stack([wi, wo]), expected),
        )
    )
    order = [np.lexsort(rows.T) for rows in (mine, theirs)]
    np.testing.assert_allclose(mine[order[0]], theirs[order[1]], atol=1e-9)


def directions(lists) -> dict[float, tuple[float, ...]]:
    """Value that `made` gives → its four angles in degrees."""
    shape = [len(angles) for angles in lists]
    places = np.ndindex(*reversed(shape))
    return {k + 1: tuple(a[p] for a, p in zip(lists, reversed(place), strict=True)) for k, place in enumerate(places)}


def test_specular_angles_are_rotations_of_the_mirror_direction(write):
    """scipy's rotations; offsets turn the mirror direction away from the normal."""
    for offsets, turn in (("", (0, 0, 0)), ("PARAM4_LIST 0 -5.5 12\n", (0, -5.5, 12))):
        found = ssdd.load(write(made("specular", offsets=offsets)))
        angles = directions(LISTS)
        more = dict(zip(LISTS[0], turn, strict=True))
        expected = [turned(i + more[i], p, a, r) for i, p, r, a in (angles[v] for v in found.value[:, 0])]
        np.testing.assert_allclose(found.wo, expected, atol=EXACT)
        light = [Rotation.from_euler("yz", angles[v][:2], degrees=True).apply([0, 0, 1]) for v in found.value[:, 0]]
        np.testing.assert_allclose(found.wi, light, atol=EXACT)


def test_half_and_difference_angles_are_rotations(write):
    """ω_i = R_z(φ_h) R_y(θ_h) d, and ω_o its reflection about the half vector (Rusinkiewicz 1998)."""
    found = ssdd.load(write(made("half_difference")))
    angles = directions(LISTS)
    for value, wi, wo in zip(found.value[:, 0], found.wi, found.wo, strict=True):
        theta_h, phi_h, theta_d, phi_d = angles[value]
        frame = Rotation.from_euler("yz", [theta_h, phi_h], degrees=True)
        np.testing.assert_allclose(
            wi, frame.apply(Rotation.from_euler("yz", [theta_d, phi_d], degrees=True).apply([0, 0, 1])), atol=EXACT
        )
        half = frame.apply([0, 0, 1])
        np.testing.assert_allclose(wo, Rotation.from_rotvec(np.pi * half).apply(wi), atol=EXACT)


def test_the_example_of_the_specification(write):
    found = ssdd.load(write(EXAMPLE))
    assert found.channels == ("r", "g", "b")
    assert found.value.tolist() == [[0, 0.0524275, 0.159779]] * 8
    assert "REDUCTION_TYPE bilateral_symmetry reciprocity: the half that it leaves out is not filled in." in found.notes


def test_binary_and_ascii_hold_the_same(write):
    for colours in (1, 3, 5):
        plain = ssdd.load(write(made("specular", colours)))
        binary = ssdd.load(write(made("specular", colours, binary=True)))
        np.testing.assert_array_equal(plain.value, binary.value)
        assert plain.channels == binary.channels
    assert plain.channels == ("400", "410", "420", "430", "440")


@pytest.mark.parametrize("binary", [True, False])
def test_another_block_may_stand_first(write, binary):
    """Binary data of a BTDF hold any bytes, so that its size is all that leads to the next block."""
    other = made("spherical", binary=binary).replace(b"DATA_TYPE brdf", b"DATA_TYPE btdf")
    both = other + made("specular", 3).replace(b"VERSION 0.2", b"# more")
    assert ssdd.load(write(both)).channels == ("x", "y", "z")


def test_poles_and_seams_count_once(write):
    """θ_o = 0 for 3 azimuths, and 360° beside 0°; both only where the value is the same."""
    lists = ((30.0,), (), (0.0, 40.0), (0.0, 90.0, 360.0))
    text = made("spherical", lists=lists).decode().split("ascii\n")[0] + "ascii\n1\n2\n1\n3\n1\n2\n"
    found = reader.read(write(text))
    assert found.masked == {"the same value of a direction once more, for another azimuth": 3}
    assert sorted(found.value[found.valid].tolist()) == [1, 2, 3]


GOOD = made("specular").decode()
BAD: dict[str, tuple[str | bytes, str]] = {
    "btdf": (
        GOOD.replace("TYPE brdf", "TYPE btdf"),
        "a.ssdd: data of type btdf, expected a block of data of type brdf",
    ),
    "no data": (GOOD.replace("DATA ascii", "#"), "a.ssdd: no line DATA, expected a block of data of type brdf"),
    "system": (GOOD.replace("specular_", "distorted_"), "PARAM_TYPE distorted_coordinate_system, expected spherical_"),
    "no system": (GOOD.replace("PARAM_TYPE", "# "), r"PARAM_TYPE \(none\), expected spherical_coordinate_system or"),
    "colour": (GOOD.replace("monochrome", "cmyk"), "COLOR_MODEL cmyk, expected monochrome or rgb or xyz or spectrum"),
    "no wavelengths": (GOOD.replace("monochrome", "spectrum"), r"WAVELENGTH_LIST \(none\), expected numbers from 0"),
    "mode": (GOOD.replace("DATA ascii", "DATA zip"), "row 9: DATA zip, expected ascii or binary. Convert"),
    "no list": (GOOD.replace("PARAM2_LIST", "# "), r"PARAM2_LIST \(none\), expected numbers from 0 to 180"),
    "angle": (GOOD.replace("10.0 ", "100 "), r"PARAM0_LIST 100 35\.0 60\.0, expected numbers from 0 to 90"),
    "word": (GOOD.replace("10.0 ", "1O.0 "), r"PARAM0_LIST 1O\.0 35\.0 60\.0, expected numbers"),
    "offsets": (
        made("specular", offsets="PARAM4_LIST 1 2\n"),
        "PARAM4_LIST of 2 offsets, expected 3 as in PARAM0_LIST",
    ),
    "truncated": (GOOD[:-10], "69 lines of values, expected 72 .3 × 2 × 4 × 3 cells of 1 colours.. Was the file cut"),
    "longer": (GOOD + "1\n", "73 lines of values, expected 72"),
    "colours": (GOOD.replace("monochrome", "rgb"), r"row 10: 1 numbers, expected 3 \(the colours of COLOR_MODEL\)"),
    "binary truncated": (made("specular", binary=True)[:-1], "287 bytes of binary data, expected 288"),
    "huge": (
        made("specular", binary=True, lists=(("1 " * 3000,),) * 4),
        r"bytes of binary data, expected 324000000000000 \(3000 × 3000 × 3000 × 3000 cells",
    ),
}


@pytest.mark.parametrize(("content", "message"), BAD.values(), ids=BAD)
def test_bad_files_are_refused_in_a_sentence(write, content, message):
    with pytest.raises(ReadError, match=message):
        ssdd.load(write(content))


@pytest.mark.parametrize(
    "content",
    [
        "VERSION 0.2\nDATA_TYPE btdf\n" + "DATA binary\n" * 50_000,
        "VERSION 0.2\n" + "DATA_TYPE btdf\nDATA ascii\n" * 50_000,
        "VERSION 0.2\nDATA_TYPE " + "x " * 10 + " " * 10**6 + "x\nDATA ascii\n",
    ],
    ids=["binary", "ascii", "blanks"],
)
def test_many_or_overlong_blocks_take_no_time(write, content):
    begin = time.process_time()
    with pytest.raises(ReadError, match="expected a block of data of type brdf"):
        ssdd.load(write(content))
    assert time.process_time() - begin < SLOW


def test_it_claims_its_own_content_only():
    raw = EXAMPLE.encode()
    for text in (raw, b"# Software: x\n" + raw, raw.replace(b"\n", b"\r\n")):
        assert ssdd.claims(text, len(text))
    for other in (b"theta_i,theta_o,brdf\n1,2,3\n", b"VERSION 0.2\n1 2\n", b"", b"\x00" * 99):
        assert not ssdd.claims(other, len(other))


def test_each_text_format_claims_its_own_samples_only():
    """So that the order in which the reader asks them does not matter."""
    rooms = {test_alta: alta, test_astm: astm, test_fred: fred, test_lighttools: lighttools, test_zemax: zemax}
    for tests in rooms:
        raw = tests.sample(np.random.default_rng(17))
        assert [room for room in (*rooms.values(), ssdd) if room.claims(raw, len(raw))] == [rooms[tests]]
    raw = sample(np.random.default_rng(17))
    assert not any(room.claims(raw, len(raw)) for room in rooms.values())


def test_no_fault_raises_anything_but_a_read_error(write):
    read, refused = outcomes(sample, write, np.random.default_rng(15))
    assert read > 5 < len(refused)
    assert not any("\n" in message for message in refused)
