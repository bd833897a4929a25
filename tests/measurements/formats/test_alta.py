"""ALTA files: its parametrisations turned back by ALTA's own formulas, exact round trips, and faults."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_zemax import outcomes

from fitmat.errors import OutputError, ReadError
from fitmat.measurements import reader
from fitmat.measurements.formats import alta
from fitmat.measurements.samples import Measurements, from_arrays

INVERTED = 2e-7
"""Cosines: ALTA's formulas end in an arc cosine, which loses half the digits near 0."""

ROUND = 1e-15
"""Directions: angles are written exactly; sine and cosine round once."""

SLOW = 10.0
"""Seconds of this process; a search that backtracks takes minutes."""

EXAMPLE = """#SAMPLE "Gray tape"
# a comment
#DIM 3 1
#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI
#PARAM_OUT INV_STERADIAN
0.25  -0.25 0.0 0.5
0.25  0.0  0.5  0.125
"""


def coordinates(wi: np.ndarray, wo: np.ndarray) -> dict[str, list[float]]:
    """A port of `params::from_cartesian` (ALTA, `core/params.cpp`) for one pair; its vectors are view, then light."""
    half = (wi + wo) / np.linalg.norm(wi + wo)
    phi_h, theta_h = np.arctan2(half[1], half[0]), np.arccos(half[2])
    diff = Rotation.from_euler("zy", [-phi_h, -theta_h]).apply(wo)
    theta_d, phi_d = np.arccos(diff[2]), np.arctan2(diff[1], diff[0])
    theta_l, theta_v = np.arccos(wi[2]), np.arccos(wo[2])
    phi_l, phi_v = np.arctan2(wi[1], wi[0]), np.arctan2(wo[1], wo[0])
    cos_vl = wi @ wo
    sin_l, sin_v, sin_vl = np.sqrt(1 - wi[2] ** 2), np.sqrt(1 - wo[2] ** 2), np.sqrt(1 - cos_vl**2)
    cos_phi = (wo[2] - wi[2] * cos_vl) / (sin_l * sin_vl)
    sin_phi = np.sin(phi_l - phi_v) * sin_v / sin_vl
    theta = np.arccos(cos_vl)
    return {
        "SPHERICAL_TL_PL_TV_PV": [theta_l, phi_l, theta_v, phi_v],
        "CARTESIAN": [*wo, *wi],
        "RUSIN_TH_PH_TD_PD": [theta_h, phi_h, theta_d, phi_d],
        "RUSIN_TH_TD_PD": [theta_h, theta_d, phi_d],
        "ISOTROPIC_TV_TL_DPHI": [theta_v, theta_l, phi_l - phi_v],
        "ISOTROPIC_TL_TV_PROJ_DPHI": [theta_l, theta_v * np.cos(phi_l - phi_v), theta_v * np.sin(phi_l - phi_v)],
        "RETRO_TL_TVL_PROJ_DPHI": [theta_l, theta * cos_phi, theta * sin_phi],
    }


def sample(rng: np.random.Generator) -> bytes:
    """A valid file of any parametrisation, with or without bounds."""
    name = str(rng.choice(list(alta.PARAMETRISATIONS)))
    given, bounds = alta.PARAMETRISATIONS[name][0], int(rng.integers(3))
    output = str(rng.choice(list(alta.OUTPUTS)))
    values = 3 if "COLOR" in output else int(rng.integers(1, 4))
    x = rng.uniform(0, 0.9, (8, given))
    if name == "CARTESIAN":
        x = np.concatenate([part / np.linalg.norm(part, axis=1, keepdims=True) for part in np.split(x, 2, 1)], 1)
    rows = np.column_stack([x, rng.lognormal(size=(8, values * (1 + bounds)))])
    text = f"#DIM {given} {values}\n#PARAM_IN  {name}\n#PARAM_OUT {output}\n#VS {' '.join([str(bounds)] * values)}\n"
    return (text + "\n".join("\t".join(f"{number:.8g}" for number in row) for row in rows) + "\n").encode()


@pytest.fixture
def write(tmp_path: Path):
    def to_file(text: str | bytes) -> Path:
        path = tmp_path / "a.alta"
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return path

    return to_file


# --- reading --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", list(coordinates(np.array([0.6, 0, 0.8]), np.array([0, 0.6, 0.8]))))
def test_parametrisations_are_those_of_alta(name, write, hemisphere):
    """Both zenith angles and the angle between the directions come back from ALTA's coordinates of them."""
    wi, wo = hemisphere(40, 3), hemisphere(40, 4)
    rows = [coordinates(*pair)[name] for pair in zip(wi, wo, strict=True)]
    text = f"#DIM {len(rows[0])} 1\n#PARAM_IN {name}\n#PARAM_OUT INV_STERADIAN\n"
    found = reader.read(write(text + "".join(" ".join(map(repr, map(float, row))) + " 1\n" for row in rows)))
    for mine, theirs in ((found.wi[:, 2], wi[:, 2]), (found.wo[:, 2], wo[:, 2])):
        np.testing.assert_allclose(mine, theirs, atol=INVERTED)
    np.testing.assert_allclose((found.wi * found.wo).sum(axis=1), (wi * wo).sum(axis=1), atol=INVERTED)
    if name in ("SPHERICAL_TL_PL_TV_PV", "CARTESIAN", "RUSIN_TH_PH_TD_PD"):
        np.testing.assert_allclose([found.wi, found.wo], [wi, wo], atol=INVERTED)


def reduced(write: Callable[[str], Path], name: str, *x: float) -> Measurements:
    text = f"#DIM {len(x)} 1\n#PARAM_IN {name}\n#PARAM_OUT INV_STERADIAN\n{' '.join(map(str, x))} 1\n"
    return reader.read(write(text))


def test_parametrisations_that_leave_directions_open(write):
    """Placed as `params::to_cartesian` does, and said so."""
    found = reduced(write, "COS_TH", 0.5)
    np.testing.assert_allclose([found.wi, found.wo], np.tile([np.sqrt(0.75), 0, 0.5], (2, 1, 1)), atol=ROUND)
    found = reduced(write, "COS_TH_TD", np.cos(0.3), np.cos(0.5))
    np.testing.assert_allclose([found.theta_i, found.theta_o], [[0.2], [0.8]], rtol=1e-12)
    found = reduced(write, "RUSIN_TH_TD", 0.3, 0.5)
    np.testing.assert_allclose(found.wi[:, 2], np.cos(0.3) * np.cos(0.5), rtol=1e-12)
    np.testing.assert_allclose(found.wo[:, 2], found.wi[:, 2], rtol=1e-12)
    found = reduced(write, "ISOTROPIC_TV_PROJ_DPHI", -0.3, 0.4)
    np.testing.assert_allclose([found.theta_i, found.theta_o], [[0], [0.5]], rtol=1e-12)
    assert (
        "ISOTROPIC_TV_PROJ_DPHI leaves directions open; placed as ALTA does: the light along the normal." in found.notes
    )


def test_projected_azimuths_by_hand(write):
    """−0.25 along x lies opposite the light: the mirror direction of θ_L = 0.25."""
    found = reader.read(write(EXAMPLE))
    np.testing.assert_allclose(found.wo[0], found.wi[0] * [-1, -1, 1], atol=1e-15)
    np.testing.assert_allclose([found.theta_o[1], found.phi[1]], [0.5, np.pi / 2], rtol=1e-12)


@pytest.mark.parametrize(
    ("output", "values", "quantity", "channels"),
    [
        ("INV_STERADIAN", 1, "brdf", ("value",)),
        ("INV_STERADIAN", 2, "brdf", ("1", "2")),
        ("INV_STERADIAN_COSINE_FACTOR", 1, "brdf_cos", ("value",)),
        ("RGB_COLOR", 3, "brdf", ("r", "g", "b")),
        ("XYZ_COLOR", 3, "brdf", ("x", "y", "z")),
    ],
)
@pytest.mark.parametrize("bounds", [None, "0", "1", "2", "each"])
def test_outputs_and_bounds(write, output, values, quantity, channels, bounds):
    """`#VS` stands once, for the first value or for all of them, or once for each value."""
    each = [2, 0, 1][:values] if bounds == "each" else [int(bounds or 0)] + [0] * (values - 1)
    stated = "" if bounds is None else f"#VS {' '.join(map(str, each)) if bounds == 'each' else bounds}\n"
    row = "1.5 0 0.5 3 " + " ".join(map(str, range(values))) + " 9" * sum(each)
    found = alta.load(
        write(f"#DIM 4 {values}\n#PARAM_IN SPHERICAL_TL_PL_TV_PV\n#PARAM_OUT {output}\n{stated}{row}\n{row}\n")
    )
    assert (found.quantity, found.channels, found.sigma) == (quantity, channels, None)
    assert found.value.tolist() == [list(range(values))] * 2
    assert any("no standard deviations" in note for note in found.notes) == (sum(each) > 0)


def test_bounds_of_every_value_may_be_stated_by_one_number(write):
    row = "1.5 0 0.5 3 0.1 0.2 9 9 9 9\n"
    found = alta.load(write(f"#VS 2\n#DIM 4 2\n#PARAM_IN SPHERICAL_TL_PL_TV_PV\n#PARAM_OUT INV_STERADIAN\n{row}"))
    assert found.value.tolist() == [[0.1, 0.2]]


def test_a_direction_without_its_azimuth_is_missing(write):
    head = "#DIM 4 1\n#PARAM_IN SPHERICAL_TL_PL_TV_PV\n#PARAM_OUT INV_STERADIAN\n"
    found = reader.read(write(head + "0.5 0 0.25 nan 1\n0.5 nan 0.25 1 1\n0.5 0 0.25 1 1\n"))
    assert found.valid[:, 0].tolist() == [False, False, True]
    assert found.masked == {"angle missing or infinite": 2}


def test_vectors_off_unit_length_are_missing(write):
    text = (
        "#DIM 6 1\n#PARAM_IN CARTESIAN\n#PARAM_OUT INV_STERADIAN\n0 0 1.0001 0 0 1 2\n0 0 0.5 0 0 1 2\n0 0 0 0 0 1 2\n"
    )
    found = reader.read(write(text))
    assert found.masked == {"angle missing or infinite": 2}
    assert found.wo[0].tolist() == [0, 0, 1]


BAD: dict[str, tuple[str | bytes, str]] = {
    "unknown": (
        EXAMPLE.replace("ISOTROPIC_TL_TV_PROJ_DPHI", "STARK_3D"),
        "a.alta: #PARAM_IN STARK_3D, expected one of SPH",
    ),
    "no input": (
        EXAMPLE.replace("#PARAM_IN", "# PARAM_IN"),
        r"#PARAM_IN \(none\), expected one of .*Convert it with ALTA's",
    ),
    "energy": (
        EXAMPLE.replace("INV_STERADIAN", "ENERGY"),
        "#PARAM_OUT ENERGY, expected one of INV_STERADIAN, INV_STERADIAN_",
    ),
    "dimensions": (
        EXAMPLE.replace("DIM 3 1", "DIM 4 1"),
        "#DIM 4 1 with ISOTROPIC_TL_TV_PROJ_DPHI .*expected #DIM 3 1",
    ),
    "colours": (EXAMPLE.replace("INV_STERADIAN", "RGB_COLOR"), "#DIM 3 1 with .* and RGB_COLOR, expected #DIM 3 3"),
    "no dim": (EXAMPLE.replace("DIM 3 1", "DIM 3"), "#DIM 3, expected two counts, as in #DIM 4 1"),
    "huge dim": (EXAMPLE.replace("DIM 3 1", "DIM 3 1000000000"), "#DIM 3 1000000000, expected two counts"),
    "negative dim": (EXAMPLE.replace("DIM 3 1", "DIM -3 1"), "#DIM -3 1, expected two counts"),
    "bounds": (EXAMPLE.replace("#DIM", "#VS 3\n#DIM"), "#VS 3, expected 0, 1 or 2 for each value"),
    "degrees": (
        EXAMPLE.replace("0.25  0.0", "25  0.0"),
        r"row 7: coordinates 25, 0, 0\.5, expected none beyond ±6\.283",
    ),
    "cut off": (EXAMPLE[:-7], r"row 7: 3 numbers, expected 4 \(#DIM 3 1, #VS 0\)\. Was the file cut off"),
    "no rows": (EXAMPLE[: EXAMPLE.index("0.25")], "a.alta: no line of numbers, expected at least one"),
    "word": (EXAMPLE.replace("0.125", "O.125"), r"row 7: O\.125, expected a number"),
    "function": ("#FUNC lafortune\n" + EXAMPLE, "a fitted function of ALTA, expected its data"),
    "binary": (
        EXAMPLE.encode() + b"#FORMAT binary\n#BEGIN_STREAM\n\x00\x01",
        "#FORMAT binary, expected ALTA's text data",
    ),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD)
def test_bad_files_are_refused_in_a_sentence(write, text, message):
    with pytest.raises(ReadError, match=message):
        alta.load(write(text))


def test_an_overlong_header_takes_no_time(write):
    begin = time.process_time()
    with pytest.raises(ReadError, match="#PARAM_IN x y, expected one of"):
        alta.load(write("#DIM 1 1\n#PARAM_IN x y\n#NOTE " + "x " * 9 + " " * 10**6 + "x\n#" + "a" * 10**6 + "\n"))
    assert time.process_time() - begin < SLOW


def test_it_claims_its_own_content_only():
    raw = EXAMPLE.encode()
    for text in (raw, raw.replace(b"\n", b"\r\n")):
        assert alta.claims(text, len(text))
    for other in (b"theta_i,theta_o,brdf\n1,2,3\n", b"#DIM 1 2\n1 2\n", b"# theta_i theta_o\n", b"", b"\x00" * 99):
        assert not alta.claims(other, len(other))


def test_no_fault_raises_anything_but_a_read_error(write):
    read, refused = outcomes(sample, write, np.random.default_rng(16))
    assert read > 20 < len(refused)
    assert not any("\n" in message for message in refused)


# --- writing --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "channels", [("value",), ("r", "g", "b"), ("x", "y", "z"), ("450", "550"), ("a", "b", "c", "d")], ids=str
)
def test_what_is_written_comes_back(write, hemisphere, channels):
    """Values bit for bit, directions to the rounding of one sine; azimuths of both sides, and the poles."""
    wi, wo = (np.concatenate([hemisphere(200, seed), [[0, 0, 1], [1, 0, 0]]]) for seed in (5, 6))
    wi[-1], wo[-1] = [0.6, 0, 0.8], [-0.6, 0, 0.8]
    value = np.random.default_rng(7).lognormal(0, 8, (202, len(channels)))
    value[0] *= -1e-300
    given = Measurements(wi, wo, value, None, np.ones(value.shape, bool), channels, "a\nb")
    found = reader.read(write(alta.dump(given)))
    assert found.channels == channels
    np.testing.assert_array_equal(found.value, value)
    np.testing.assert_allclose([found.wi, found.wo], [wi, wo], atol=ROUND)
    assert alta.losses(given) == ()


def test_masked_samples_are_left_out_and_told():
    given = from_arrays(
        [0.5] * 3,
        [0.1, 0.2, 0.3],
        [[1.0, 2.0], [np.nan, 3.0], [np.nan, np.nan]],
        sigma=np.ones((3, 2)),
        channels=("a b", "c"),
    )
    assert alta.dump(given).count("\n0.5\t") == 1
    assert "#CHANNELS" not in alta.dump(given)
    assert [sentence.split()[:2] for sentence in alta.losses(given)] == [
        ["1", "masked"],
        ["1", "samples"],
        ["sigma", "not"],
        ["Names", "of"],
    ]
    with pytest.raises(OutputError, match="array: no sample that is valid in all channels, expected at least one"):
        alta.dump(from_arrays([0.5], [0.1], [np.nan]))
