"""MERL: every value and direction against Matusik's published lookup, and back to the file bit for bit."""

import struct
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

from fitmat.errors import OutputError, ReadError
from fitmat.measurements import reader
from fitmat.measurements.formats import merl
from fitmat.measurements.samples import Measurements, from_arrays
from fitmat.measurements.writing import write

MATERIALS = ("green-acrylic", "silver-paint", "red-fabric")
CELLS = 90 * 90 * 180
SCALES = (1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0)
UNIT = 1e-11
"""Nearest the normal a direction is a quotient of numbers near 1e-4, so that 1e-16 becomes 1e-12."""


@pytest.fixture(scope="module")
def standins(shared_data, tmp_path_factory) -> list[Path]:
    """Three files of the database's own size, written by the script that comes with the shared measurements."""
    folder = tmp_path_factory.mktemp("merl")
    script = shared_data / "merl-like" / "evaluate.py"
    paths = [folder / f"{material}.binary" for material in MATERIALS]
    for path in paths:
        subprocess.run([sys.executable, script, path.stem, path], check=True)
    return paths


def sample(rng: np.random.Generator, shape: tuple[int, int, int] = (6, 5, 10)) -> bytes:
    """A valid file of few cells, some of them invalid, as the database has them."""
    planes = rng.lognormal(3.0, 2.0, (3, *shape))
    planes[:, rng.random(shape) < 0.2] = -1.0
    return struct.pack("<3i", *shape) + planes.astype("<f8").tobytes()


def mutated(raw: bytes, rng: np.random.Generator) -> bytes:
    """The file with one to three faults: another count, odd numbers, flipped bits, bytes cut off, lost or added."""
    content = bytearray(raw)
    counts = [0, 1, -1, 90, 180, 360, 2**16, 2**31 - 1, -(2**31)]
    numbers = [np.nan, np.inf, -np.inf, -0.0, 5e-324, -5e-324, 1.7e308, -1.7e308, -1.0]
    odd = [*(struct.pack("<d", number) for number in numbers), bytes.fromhex("010000000000f07f")]
    for _ in range(rng.integers(1, 4)):
        place = int(rng.integers(0, max(len(content), 1)))
        match rng.integers(6):
            case 0:
                at = 4 * int(rng.integers(3))
                content[at : at + 4] = struct.pack("<i", counts[rng.integers(len(counts))])
            case 1:
                at = 12 + 8 * (place // 8)
                content[at : at + 8] = odd[rng.integers(len(odd))]
            case 2 if content:
                content[place] ^= 1 << int(rng.integers(8))
            case 3:
                del content[place:]
            case 4:
                del content[place : place + int(rng.integers(1, 30))]
            case _:
                content[place:place] = rng.bytes(int(rng.integers(1, 30)))
    return bytes(content)


def published_index(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """Place of a pair of directions in a plane, as `lookup_brdf_val` of MERL's BRDFRead.cpp (2005) finds it.

    Half vector, its angles, two rotations of the incoming vector (Rodrigues' formula), the angles of the result, and
    truncation: sqrt(90 · 90 θ_h/(π/2)), 90 θ_d/(π/2), 180 φ_d/π with φ_d + π where φ_d < 0.
    """

    def turned(vector: np.ndarray, axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
        cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
        return vector * cos + axis * (vector @ axis)[:, None] * (1 - cos) + np.cross(axis, vector) * sin

    half = (wi + wo) / 2
    half /= np.sqrt((half**2).sum(axis=1, keepdims=True))
    theta_half, phi_half = np.arccos(half[:, 2]), np.arctan2(half[:, 1], half[:, 0])
    level = turned(wi, np.array([0.0, 0.0, 1.0]), -phi_half)
    difference = turned(level, np.array([0.0, 1.0, 0.0]), -theta_half)
    theta_diff = np.arccos(np.clip(difference[:, 2], -1, 1))
    phi_diff = np.arctan2(difference[:, 1], difference[:, 0])
    phi_diff = np.where(phi_diff < 0, phi_diff + np.pi, phi_diff)
    h = np.clip(np.sqrt(theta_half / (np.pi / 2) * 90 * 90).astype(int), 0, 89)
    d = np.clip((theta_diff / (np.pi / 2) * 90).astype(int), 0, 89)
    p = np.clip((phi_diff / np.pi * 180).astype(int), 0, 179)
    return p + d * 180 + h * 180 * 90


def test_every_value_stands_where_the_published_lookup_finds_it(standins):
    for path in standins:
        found = merl.load(path)
        raw = np.fromfile(path, "<f8", offset=12)
        place = published_index(found.wi, found.wo)
        assert np.array_equal(place, np.arange(CELLS))
        for channel, scale in enumerate(SCALES):
            assert np.array_equal(found.value[:, channel], raw[place + channel * CELLS] * scale)


def test_a_file_is_a_stack_of_arrays_in_fortran_order(standins):
    """Source: `readMERLBRDF` of the public Python module merlFunctions (repository NPs-BRDF)."""
    numbers = np.fromfile(standins[0], "<f8", offset=12)
    axes = np.reshape(numbers, (180, 90, 90, 3), "F") * SCALES
    assert np.array_equal(axes.transpose(2, 1, 0, 3).reshape(-1, 3), merl.load(standins[0]).value)


def test_a_row_stands_for_the_centre_of_its_cell(tmp_path):
    """Rusinkiewicz (1998): spherical angles of h, and of the light in the frame where h is the pole."""
    path = tmp_path / "small.binary"
    shape = (6, 5, 10)
    path.write_bytes(sample(np.random.default_rng(1), shape))
    found = merl.load(path)
    half = found.wi + found.wo
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    theta_h, phi_h = np.arccos(half[:, 2]), np.arctan2(half[:, 1], half[:, 0])
    pole = np.stack([np.cos(theta_h) * np.cos(phi_h), np.cos(theta_h) * np.sin(phi_h), -np.sin(theta_h)], axis=1)
    side = np.cross(half, pole)
    theta_d = np.arccos((found.wi * half).sum(axis=1))
    phi_d = np.arctan2((found.wi * side).sum(axis=1), (found.wi * pole).sum(axis=1))
    h, d, p = (index.ravel() for index in np.indices(shape))
    assert np.rad2deg(theta_h) == pytest.approx(90 * ((h + 0.5) / 6) ** 2, abs=1e-9)
    assert np.rad2deg(theta_d) == pytest.approx(90 * (d + 0.5) / 5, abs=1e-9)
    assert np.rad2deg(phi_d) == pytest.approx(180 * (p + 0.5) / 10, abs=1e-9)


def test_directions_are_unit_vectors_with_light_at_azimuth_0(standins):
    found = merl.load(standins[0])
    for directions in (found.wi, found.wo):
        assert np.abs(np.linalg.norm(directions, axis=1) - 1).max() < UNIT
    assert np.all(found.wi[:, 1] == 0)
    assert np.all(found.wi[:, 0] > 0)


def test_invalid_cells_are_masked_and_no_value_is_clamped(standins):
    raw = np.fromfile(standins[0], "<f8", offset=12).reshape(3, CELLS).T
    found = reader.read(standins[0])
    below = (found.wi[:, 2] <= 1e-6) | (found.wo[:, 2] <= 1e-6)
    assert np.array_equal(found.valid, (raw >= 0) & ~below[:, None])
    assert np.array_equal(found.value, np.where(found.valid, raw * SCALES, 0))
    invalid = (raw < 0).any(axis=1)
    assert found.masked == {
        "negative, which MERL uses for invalid": invalid.sum(),
        "at or below the horizon": (below & ~invalid).sum(),
    }
    assert found.channels == ("r", "g", "b")
    assert found.notes[0] == "brdf read as f_r in sr⁻¹, no factor applied."
    assert merl.load(standins[0]).value.min() == -1.66 / 1500


def test_a_table_beside_a_file_tells_that_values_were_inferred(tmp_path):
    (tmp_path / "small.binary").write_bytes(sample(np.random.default_rng(3)))
    assert not reader.read(tmp_path / "small.binary").warnings
    (tmp_path / "small.cells.parquet").write_bytes(b"")
    (warning,) = reader.read(tmp_path / "small.binary").warnings
    assert warning.startswith("small.cells.parquet beside this file says that some of its values were inferred")


def test_four_times_as_many_azimuths_as_difference_angles_cover_a_whole_turn(tmp_path):
    """Source: the 90 × 90 × 360 files of the PQBA dataset (LIRIS), whose models are not reciprocal."""
    path = tmp_path / "full.binary"
    path.write_bytes(sample(np.random.default_rng(2), (6, 5, 20)))
    found = merl.load(path)
    wi, wo = found.wi.reshape(6, 5, 20, 3), found.wo.reshape(6, 5, 20, 3)
    cos_i, cos_o = wi[..., 2], wo[..., 2]
    assert cos_i[:, :, 10:] == pytest.approx(cos_o[:, :, :10], abs=1e-12)  # half a turn on, light and sensor swap
    assert "MERL grid of 6 × 5 × 20 cells: φ_d taken to cover a whole turn." in found.notes
    path.write_bytes(sample(np.random.default_rng(2), (6, 5, 12)))
    assert "MERL grid of 6 × 5 × 12 cells: φ_d taken to cover half a turn." in merl.load(path).notes


def test_it_claims_its_own_content_only():
    raw = sample(np.random.default_rng(3))
    assert merl.claims(raw, len(raw))
    database = struct.pack("<3i", 90, 90, 180)
    assert merl.claims(database, 12 + 24 * CELLS)
    assert merl.claims(database, 5000)  # cut off, and said so
    others = [b"", b"\0" * 50, b"PAR1" + raw, b"\x89PNG\r\n\x1a\n" + raw, b"theta_i,theta_o,brdf\n30,45,0.5\n" * 9]
    others += [raw[:40], raw + b"\0", struct.pack("<3d", 0.1, 0.2, 0.3), "theta_i".encode("utf-16-le") * 9]
    assert not any(merl.claims(other[:65536], len(other)) for other in others)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (struct.pack("<3i", 90, 90, 180) + bytes(80), r"90 × 90 × 180 cells and 92 bytes, expected 34992012 bytes"),
        (struct.pack("<3i", 1, 1, 2) + bytes(49), "and 61 bytes, expected 60 bytes. Was its download cut off"),
        (struct.pack("<3i", 2**30, 2**30, 16) + bytes(24), "and 36 bytes, expected 442721857769029238796 bytes"),
        (struct.pack("<3i", -1, -1, 1) + bytes(24), "-1 × -1 × 1 cells and 36 bytes, expected three positive counts"),
        (b"\0\0", "0 × 0 × 0 cells and 2 bytes, expected three positive counts"),
    ],
    ids=["cut off", "too long", "beyond 64 bits", "negative", "tiny"],
)
def test_a_header_that_does_not_fit_is_refused(tmp_path, content, message):
    path = tmp_path / "bad.binary"
    path.write_bytes(content)
    with pytest.raises(ReadError, match=rf"bad\.binary: a MERL header of .*{message}"):
        merl.load(path)


def test_no_fault_raises_anything_but_a_read_error(tmp_path):
    rng, path = np.random.default_rng(4), tmp_path / "fuzz.binary"
    outcomes = {"read": 0, "refused": 0}
    for _ in range(300):
        path.write_bytes(mutated(sample(rng, (4, 3, 6)), rng))
        try:
            assert isinstance(reader.read(path), Measurements)
            outcomes["read"] += 1
        except ReadError:
            outcomes["refused"] += 1
    assert min(outcomes.values()) > 30


def test_reading_takes_a_fraction_of_a_second(standins):
    def seconds(function) -> float:
        start = time.process_time()
        function(standins[0])
        return time.process_time() - start

    assert min(seconds(merl.load) for _ in range(3)) < 0.5  # measured 0.06 s; sines of each cell take 0.3 s
    assert min(seconds(reader.read) for _ in range(2)) < 2  # measured 0.5 s; a loop over rows takes more


# --- writing --------------------------------------------------------------------------------------


def test_what_is_read_is_written_back_bit_for_bit(standins, tmp_path):
    rng = np.random.default_rng(5)
    numbers = np.fromfile(standins[0], "<f8", offset=12)
    numbers[numbers > 0] *= rng.lognormal(0, 5, np.count_nonzero(numbers > 0))
    path = tmp_path / "first.binary"
    path.write_bytes(struct.pack("<3i", 90, 90, 180) + numbers.tobytes())
    first = reader.read(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # nothing is lost, so nothing is warned of
        second = reader.read(write(first, tmp_path / "second.binary"))
    assert np.array_equal(second.valid, first.valid)
    assert np.array_equal(second.value, first.value)
    assert np.array_equal(second.wi, first.wi)
    written = np.fromfile(tmp_path / "second.binary", "<f8", offset=12).reshape(3, CELLS).T
    assert np.all(written[~first.valid] == -1)


def test_samples_go_to_the_cell_of_the_published_lookup_and_are_averaged(tmp_path):
    rng = np.random.default_rng(6)
    theta_i, theta_o = np.tile(rng.uniform(0, 1.5, (2, 400)), 2)
    phi, phi_i = np.tile(rng.uniform(-np.pi, np.pi, (2, 400)), 2)
    value = rng.uniform(0.1, 1.0, (400, 3))
    measured = from_arrays(theta_i, theta_o, np.concatenate([value, 3 * value]), phi=phi, phi_i=phi_i)
    with pytest.warns(UserWarning, match=r"scattered\.binary: 800 samples moved .* 400 MERL cells hold the mean of"):
        path = write(measured, tmp_path / "scattered.binary")
    place = published_index(measured.wi[:400], measured.wo[:400])
    alone = np.flatnonzero(np.bincount(place, minlength=CELLS)[place] == 1)
    assert len(alone) == len(place)
    planes = np.fromfile(path, "<f8", offset=12).reshape(3, CELLS).T
    assert planes[place[alone]] * SCALES == pytest.approx(2 * value[alone], rel=1e-15)
    assert np.count_nonzero(planes[:, 0] != -1) == len(np.unique(place))


def test_swapping_light_and_sensor_finds_the_same_cell():
    """The format is reciprocal (Matusik's φ_d and φ_d + π are one)."""
    measured = from_arrays([0.3, 0.7], [0.7, 0.3], [1.0, 3.0], phi=[2.0, -2.0])
    planes = np.frombuffer(merl.dump(measured), "<f8", offset=12)
    assert planes[planes != -1] * np.array(SCALES) == pytest.approx(2.0)


def test_losses_are_counted():
    measured = from_arrays([0.3, 0.3, 0.8], [0.3, 0.3, 0.2], [1.0, 3.0, -0.1], sigma=[0.1] * 3)
    assert merl.losses(measured) == (
        "3 samples moved to the centre of their MERL cell; 2 of 1458000 cells are filled.",
        "1 MERL cells hold the mean of several samples.",
        "1 MERL cells of negative value written as invalid.",
        "One channel written to all three planes of the MERL file.",
        "sigma not written: a MERL file has no place for it.",
    )
    planes = np.frombuffer(merl.dump(measured), "<f8", offset=12).reshape(3, CELLS)
    assert [plane[plane != -1].tolist() for plane in planes] == [[pytest.approx(2.0 / scale)] for scale in SCALES]


def test_a_masked_channel_is_written_as_invalid_in_its_plane_only():
    measured = from_arrays([0.3], [0.4], [[1.0, np.nan, 2.0]])
    planes = np.frombuffer(merl.dump(measured), "<f8", offset=12).reshape(3, CELLS)
    assert [np.count_nonzero(plane != -1) for plane in planes] == [1, 0, 1]


@pytest.mark.parametrize("channels", [2, 4])
def test_other_numbers_of_channels_are_refused(channels):
    measured = from_arrays([0.3], [0.4], np.ones((1, channels)))
    for function in (merl.dump, merl.losses):
        with pytest.raises(OutputError, match=rf"MERL files hold r, g and b, got {channels} channels, expected 1 or 3"):
            function(measured)
