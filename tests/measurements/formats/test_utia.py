"""UTIA: every value against the database authors' published lookup, and the size and content by which it is known."""

import numpy as np
import pytest

from fitmat.errors import ReadError
from fitmat.measurements import reader
from fitmat.measurements.formats import utia
from fitmat.measurements.samples import Measurements

PLANE = 288 * 288
INTERPOLATED = 1e-9
"""Relative: the lookup interpolates between nodes, of which an angle is 1e-14 off."""


def sample(rng: np.random.Generator, kind: str = "<f8") -> bytes:
    """A valid file: lognormal numbers, a few of them negative, as in some of the database's materials."""
    numbers = rng.lognormal(-2.0, 1.0, 3 * PLANE) - 0.01
    return numbers.astype(kind).tobytes()


def mutated(raw: bytes, rng: np.random.Generator) -> bytes:
    """The file with one to three faults: odd numbers, flipped bits, another byte order or width, bytes cut or added."""
    content = bytearray(raw)
    odd = [np.nan, np.inf, -np.inf, 1.7e308, 5e-324, -0.0]
    for _ in range(rng.integers(1, 4)):
        place = int(rng.integers(0, max(len(content), 1)))
        match rng.integers(7):
            case 0:
                content[8 * (place // 8) : 8 * (place // 8) + 8] = np.array([odd[rng.integers(len(odd))]]).tobytes()
            case 1:
                content[8 * (place // 8) : 8 * (place // 8) + 8] = bytes.fromhex("010000000000f07f")
            case 2 if content:
                content[place] ^= 1 << int(rng.integers(8))
            case 3:
                del content[place:]
            case 4:
                content = bytearray(np.frombuffer(bytes(content[: len(content) // 8 * 8]), ">f8").astype("<f8"))
            case 5:
                content[place : place + 64] = bytes(64)
            case _:
                content += rng.bytes(int(rng.integers(1, 30)))
    return bytes(content)


def published_lookup(numbers: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Filip's interpolating lookup (TBDR, as ported in ALTA's `data_utia` and in Sztrajman's `read_brdf.py`).

    Args:
        numbers: The file's, in its order.
        angles: theta_i, phi_i, theta_v, phi_v in degrees, (n, 4), azimuths in [0, 360).
    """
    steps, last = np.array([15.0, 7.5, 15.0, 7.5]), np.array([4, 48, 4, 48])
    low = np.minimum(np.floor(angles / steps).astype(int), last)
    share = angles / steps - low
    total = np.zeros((len(angles), 3))
    for corner in np.ndindex(2, 2, 2, 2):
        weight = np.prod(np.where(corner, share, 1 - share), axis=1)
        iti, ipi, itv, ipv = (low + corner).T
        place = 288 * (48 * iti + ipi % 48) + 48 * itv + ipv % 48
        total += weight[:, None] * np.stack([numbers[place + plane * PLANE] for plane in range(3)], axis=1)
    return total


@pytest.mark.parametrize("kind", ["<f8", "<f4"])
def test_every_value_stands_where_the_published_lookup_finds_it(tmp_path, kind):
    path = tmp_path / "material.bin"
    path.write_bytes(sample(np.random.default_rng(1), kind))
    found = utia.load(path)
    angles = [
        angle % 360
        for w in (found.wi, found.wo)
        for angle in (np.rad2deg(np.arccos(w[:, 2])), np.rad2deg(np.arctan2(w[:, 1], w[:, 0])))
    ]
    tilted = (angles[0] > 1) & (angles[2] > 1)  # along the normal there is no azimuth
    numbers = np.fromfile(path, kind).astype(float)
    expected = published_lookup(numbers, np.stack(angles, axis=1)[tilted])
    assert np.count_nonzero(tilted) == (5 * 48) ** 2
    assert found.value[tilted] == pytest.approx(expected, rel=INTERPOLATED, abs=INTERPOLATED)


def test_rows_are_in_the_order_of_the_file(tmp_path):
    path = tmp_path / "material.bin"
    path.write_bytes(sample(np.random.default_rng(2)))
    found = utia.load(path)
    assert np.array_equal(found.value.T.ravel(), np.fromfile(path))
    first = found.wi.reshape(6, 48, 6, 48, 3)
    assert np.all(first[0] == [0, 0, 1])
    assert first[5, 12, 0, 0] == pytest.approx([0, np.sin(np.deg2rad(75)), np.cos(np.deg2rad(75))])


def test_numbers_are_kept_as_they_are_and_their_doubts_are_told(tmp_path):
    path = tmp_path / "material.bin"
    path.write_bytes(sample(np.random.default_rng(3)))
    measured = reader.read(path)
    numbers = np.fromfile(path)
    assert np.array_equal(measured.value.T.ravel(), numbers)
    assert measured.valid.all()
    assert "the database does not state their scale" in measured.notes[1]
    assert f"Negative values kept as noise: {np.count_nonzero(numbers < 0)}." in measured.notes


def test_it_claims_its_own_content_only():
    rng = np.random.default_rng(4)
    for kind, size in {"<f8": 1_990_656, "<f4": 995_328}.items():
        raw = sample(rng, kind)
        assert len(raw) == size
        assert utia.claims(raw[:65536], size)
        assert not utia.claims(raw[:65536], size - 1)
        text = (b"theta_i,theta_o,brdf\n" + b"30,45,0.123456\n" * size)[:size]
        utf16 = ("30\t45\t0.123456\n" * size).encode("utf-16-le")[:size]
        digits = (b"12345678 87654321\n" * size)[:size]
        others = [
            text,
            digits,
            utf16,
            bytes(size),
            rng.bytes(size),
            b"PAR1" + bytes(size - 4),
            b"\x89PNG" + rng.bytes(size),
        ]
        assert not any(utia.claims(other[:65536], size) for other in others)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\1" * 100, "100 bytes, which no UTIA file has, expected 1990656 or 995328. Was its download cut off"),
        (bytes(1_990_656), "the first 65536 bytes are not those of a UTIA file, expected numbers from 1e-09 to"),
        (np.full(3 * PLANE, np.nan).tobytes(), "the first 65536 bytes are not those of a UTIA file"),
    ],
    ids=["size", "zeros", "NaN"],
)
def test_other_content_is_refused(tmp_path, content, message):
    path = tmp_path / "bad.bin"
    path.write_bytes(content)
    with pytest.raises(ReadError, match=rf"bad\.bin: {message}"):
        utia.load(path)


@pytest.mark.study
def test_no_fault_raises_anything_but_a_read_error(tmp_path):
    rng, path = np.random.default_rng(5), tmp_path / "fuzz.bin"
    raw = sample(rng)
    outcomes = {"read": 0, "refused": 0}
    for _ in range(40):
        path.write_bytes(mutated(raw, rng))
        try:
            assert isinstance(reader.read(path), Measurements)
            outcomes["read"] += 1
        except ReadError:
            outcomes["refused"] += 1
    assert min(outcomes.values()) > 5
