"""The tensor container against its published reader and writer (Mitsuba 3.9's `tensor_io`), and against wrong heads."""

import itertools
import struct
import tracemalloc
from collections.abc import Callable
from types import ModuleType
from typing import NamedTuple

import numpy as np
import pytest

from fitmat.errors import OutputError, ReadError
from fitmat.measurements.parsing import tensor

ROOM = 100_000
"""Bytes that Python itself takes while it refuses a small file."""

KINDS = ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8")

FIELDS: dict[str, np.ndarray] = {
    **{f"type {kind}": np.arange(6, dtype=kind).reshape(2, 3) for kind in KINDS},
    "odd bytes": np.arange(3, dtype=np.uint8),
    "nothing": np.zeros(0, np.float32),
    "nothing long": np.zeros((2, 0, 5), np.float64),
    "σ": np.array([[1.5], [-0.0]], np.float32),
    "": np.array([7], np.int16),
    "nothing at the end": np.zeros((0, 3), np.uint8),
    "nothing behind it": np.zeros(0, np.uint64),
}
"""All types of the format, empty arrays in the middle and at the end, odd sizes, and names beyond ASCII."""


def same(got: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> bool:
    """Whether names, order, types, shapes and every bit agree."""
    described = [
        [(name, array.dtype, array.shape, array.tobytes()) for name, array in fields.items()]
        for fields in (got, expected)
    ]
    return described[0] == described[1]


# --- the published reader and writer --------------------------------------------------------------


@pytest.mark.parametrize("align", [1, 8, 64])
def test_files_are_those_of_the_published_writer_byte_for_byte(mitsuba: ModuleType, tmp_path, align):
    mitsuba.tensor_io.write(str(tmp_path / "theirs"), align=align, text="Ω µ", **FIELDS, none="")
    tensor.write(tmp_path / "ours", {"text": "Ω µ", **FIELDS, "none": ""}, align=align)
    assert (tmp_path / "ours").read_bytes() == (tmp_path / "theirs").read_bytes()


def test_files_of_the_published_writer_are_read_bit_for_bit(mitsuba: ModuleType, tmp_path):
    mitsuba.tensor_io.write(str(tmp_path / "theirs"), **FIELDS)
    assert same(tensor.read(tmp_path / "theirs"), FIELDS)


def test_the_published_reader_reads_our_files(mitsuba: ModuleType, tmp_path):
    tensor.write(tmp_path / "ours", FIELDS)
    assert same(mitsuba.tensor_io.read(str(tmp_path / "ours")), FIELDS)


def test_the_c_plus_plus_reader_sees_every_field_of_our_files(mitsuba: ModuleType, tmp_path):
    tensor.write(tmp_path / "ours", FIELDS)
    seen = str(mitsuba.TensorFile(str(tmp_path / "ours")))
    assert all(f'"{name}" => [' in seen for name in FIELDS)
    assert "shape = [2, 0, 5]" in seen


@pytest.mark.parametrize("align", [1, 2, 8, 4096])
def test_writing_what_was_read_gives_the_same_bytes(align):
    raw = tensor.packed({**FIELDS, "scalar": np.array(2.5)}, align=align)
    assert tensor.packed(tensor.parsed(raw, "x"), align=align) == raw


def test_a_container_packed_by_hand_from_the_published_table_is_read():
    """Data in another order than the fields, unaligned, with gaps, behind a dimensionless field and before junk."""
    head = struct.pack("<12sBBI", b"tensor_file", 1, 0, 3)
    head += struct.pack("<H1sHBQ", 1, b"a", 0, 10, 94)
    head += struct.pack("<H2sHBQQQ", 2, b"bb", 2, 3, 87, 1, 3)
    head += struct.pack("<H1sHBQQ", 1, b"c", 1, 11, 2**63, 0)
    assert len(head) == 85
    raw = head + b"??" + struct.pack("<3H", 1, 2, 65535) + b"?" + struct.pack("<f", -2.5) + b"junk"
    expected = {"a": np.array(-2.5, "f4"), "bb": np.array([[1, 2, 65535]], "u2"), "c": np.zeros(0)}
    assert same(tensor.parsed(raw, "x"), expected)


def test_arrays_of_other_layouts_are_written_as_what_they_hold():
    swapped, turned = np.array([1.5, 2.5], ">f8"), np.arange(6.0).reshape(2, 3).T
    fields = tensor.parsed(tensor.packed({"swapped": swapped, "turned": turned}), "x")
    assert fields["swapped"].tolist() == [1.5, 2.5]
    assert fields["turned"].tolist() == turned.tolist()


@pytest.mark.parametrize("array", [np.zeros(2, complex), np.zeros(2, bool), np.array(["a"]), np.array([object()])])
def test_types_without_a_code_are_not_written(array):
    with pytest.raises(OutputError, match=r"field 'x': an array of .*, expected integers or floats of 8 to 64 bits"):
        tensor.packed({"x": array})


def test_what_cannot_be_written_is_said(tmp_path):
    with pytest.raises(OutputError, match="a name of 65536 bytes, expected at most 65535"):
        tensor.packed({"x" * 65536: np.zeros(1)})
    with pytest.raises(OutputError, match="align = 0, expected a number of bytes from 1"):
        tensor.packed({}, align=0)
    with pytest.raises(OutputError, match=r"cannot be written .*Name a file in a folder that exists"):
        tensor.write(tmp_path / "none" / "x", {})


# --- wrong heads ----------------------------------------------------------------------------------


class Place(NamedTuple):
    """Bytes at which the description of a field has its parts; a mutation overwrites them."""

    name_length: int
    name: int
    rank: int
    kind: int
    offset: int
    shape: int
    end: int


def places(raw: bytes) -> list[Place]:
    """Where the head of a valid container describes its fields."""
    found, position = [], 18
    for _ in range(struct.unpack_from("<I", raw, 14)[0]):
        rank = position + 2 + struct.unpack_from("<H", raw, position)[0]
        end = rank + 11 + 8 * struct.unpack_from("<H", raw, rank)[0]
        found.append(Place(position, position + 2, rank, rank + 2, rank + 3, rank + 11, end))
        position = end
    return found


def patched(raw: bytes, position: int, layout: str, *values: int) -> bytes:
    """The bytes with numbers written over them."""
    return raw[:position] + (new := struct.pack(layout, *values)) + raw[position + len(new) :]


NUMBERS = (0, 1, 2, 255, 65535, 2**31, 2**32 - 1, 2**32, 2**60, 2**63, 2**64 - 1)


def _one_of(raw: bytes, rng: np.random.Generator) -> Place:
    return places(raw)[rng.integers(len(places(raw)))]


def _dimension(raw: bytes, rng: np.random.Generator) -> bytes:
    place = _one_of(raw, rng)
    position = place.shape + 8 * int(rng.integers(max(1, (place.end - place.shape) // 8)))
    return patched(raw, position, "<Q", int(rng.choice(np.array(NUMBERS, np.uint64))))


def _all_dimensions(raw: bytes, rng: np.random.Generator) -> bytes:
    place, number = _one_of(raw, rng), int(rng.choice(np.array(NUMBERS, np.uint64)))
    return patched(
        raw, place.shape, f"<{(place.end - place.shape) // 8}Q", *[number] * ((place.end - place.shape) // 8)
    )


def _offset(raw: bytes, rng: np.random.Generator) -> bytes:
    return patched(raw, _one_of(raw, rng).offset, "<Q", int(rng.choice(np.array([*NUMBERS, len(raw)], np.uint64))))


def _overlap(raw: bytes, rng: np.random.Generator) -> bytes:
    one, other = _one_of(raw, rng), _one_of(raw, rng)
    return patched(raw, one.offset, "<Q", *struct.unpack_from("<Q", raw, other.offset))


def _name(raw: bytes, rng: np.random.Generator) -> bytes:
    place = _one_of(raw, rng)
    new = (b"../../etc/passwd", b"\xff\xfe\x00\r\n", b"\xed\xa0\x80", b"")[rng.integers(4)][: place.rank - place.name]
    return raw[: place.name] + new + raw[place.name + len(new) :]


def _data(raw: bytes, rng: np.random.Generator) -> bytes:
    """A few numbers of the data as NaN, infinity, zeros or noise."""
    position = int(rng.integers(places(raw)[-1].end, len(raw) - 4)) // 4 * 4
    new = (b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\0\0\x80\xff", bytes(16), rng.bytes(12))[rng.integers(5)]
    return raw[:position] + new + raw[position + len(new) :]


MUTATORS: dict[str, Callable[[bytes, np.random.Generator], bytes]] = {
    "count": lambda raw, rng: patched(raw, 14, "<I", int(rng.choice([0, 1, 5, 11, 65535, 65536, 2**32 - 1]))),
    "version": lambda raw, rng: patched(raw, 12, "<BB", *rng.integers(0, 256, 2).tolist()),
    "name length": lambda raw, rng: patched(
        raw, _one_of(raw, rng).name_length, "<H", int(rng.choice([0, 1, 9, 65535]))
    ),
    "name": _name,
    "rank": lambda raw, rng: patched(raw, _one_of(raw, rng).rank, "<H", int(rng.choice([0, 1, 3, 5, 255, 65535]))),
    "type": lambda raw, rng: patched(raw, _one_of(raw, rng).kind, "<B", int(rng.integers(256))),
    "dimension": _dimension,
    "all dimensions": _all_dimensions,
    "offset": _offset,
    "overlap": _overlap,
    "data": _data,
    "cut": lambda raw, rng: raw[: int(rng.integers(12, len(raw)))],
    "noise": lambda raw, rng: patched(raw, int(rng.integers(12, len(raw) - 1)), "<B", int(rng.integers(256))),
}
"""Name → (a valid container, generator) → a damaged one that still begins like a container."""


def test_damaged_containers_are_read_or_refused_in_one_sentence():
    rng, raw = np.random.default_rng(3), tensor.packed(FIELDS)
    refused: dict[str, list[str]] = {name: [] for name in MUTATORS}
    for name, mutate in MUTATORS.items():
        for _ in range(40):
            try:
                fields = tensor.parsed(mutate(raw, rng), "damaged.bsdf")
            except ReadError as error:
                refused[name].append(str(error))
            else:
                assert all(array.size <= len(raw) for array in fields.values())
    assert all(refused[name] for name in MUTATORS if name != "data")
    for message in itertools.chain(*refused.values()):
        assert message.startswith("damaged.bsdf")
        assert message.isprintable()


RAW = tensor.packed({"a": np.zeros((2, 3), np.float32), "b": np.zeros(4)})
A, B = places(RAW)

WRONG = {
    "other file": (b"tensor_fool\0" + RAW[12:], "it does not begin with 'tensor_file', expected a tensor file"),
    "magic alone": (RAW[:12], r"the file ends at byte 12, in its head, expected more\. Was it cut off\?"),
    "version": (patched(RAW, 12, "<BB", 2, 0), "byte 12: tensor file of version 2.0, expected version 1.0"),
    "minor version": (patched(RAW, 12, "<BB", 1, 1), "byte 12: tensor file of version 1.1, expected version 1.0"),
    "65535 fields": (patched(RAW, 14, "<I", 65535), "field 3 of 65535, '': type 0, expected 1 to 11"),
    "a field too many": (
        patched(RAW[:72], 14, "<I", 3),
        r"the file ends at byte 72, in field 3 of 3, expected more\. Was it cut off\?",
    ),
    "2³² − 1 fields": (patched(RAW, 14, "<I", 2**32 - 1), "byte 14: 4294967295 fields, expected at most 65536"),
    "long name": (patched(RAW, A.name_length, "<H", 65535), "the file ends at byte 128, in field 1 of 2"),
    "name in Latin-1": (patched(RAW, A.name, "<B", 0xE9), "field 1 of 2: its name is not UTF-8 .byte 20., expected"),
    "same name": (patched(RAW, B.name, "<B", ord("a")), "two fields are named 'a', expected one"),
    "type 0": (patched(RAW, A.kind, "<B", 0), "field 1 of 2, 'a': type 0, expected 1 to 11"),
    "type 12": (patched(RAW, B.kind, "<B", 12), "field 2 of 2, 'b': type 12, expected 1 to 11"),
    "255 dimensions": (patched(RAW, A.rank, "<H", 255), "'a': 255 dimensions, expected at most 32"),
    "no room for dimensions": (patched(RAW, B.rank, "<H", 32), "the file ends at byte 128, in field 2 of 2"),
    "2⁶⁰ numbers": (patched(RAW, A.shape, "<Q", 2**60), "'a' is an array of 1152921504606846976×3, expected one that"),
    "product beyond 2⁶⁴": (
        patched(RAW, A.shape, "<QQ", 2**40, 2**40),
        "'a' is an array of 1099511627776×1099511627776",
    ),
    "empty, yet too long": (patched(RAW, A.shape, "<QQ", 0, 2**62), "'a' is an array of 0×4611686018427387904, exp"),
    "too many numbers": (patched(RAW, A.shape, "<Q", 4), "'a' .4×3 float32. has bytes .*, expected|fields 'a' and 'b'"),
    "beyond the end": (patched(RAW, B.offset, "<Q", 97), "'b' .4 float64. has bytes 97 to 129, expected them between"),
    "offset 2⁶⁴ − 1": (
        patched(RAW, B.offset, "<Q", 2**64 - 1),
        "has bytes 18446744073709551615 to 18446744073709551647",
    ),
    "in the head": (patched(RAW, A.offset, "<Q", 0), "'a' .2×3 float32. has bytes 0 to 24, expected them between byte"),
    "shared bytes": (
        patched(RAW, A.offset, "<Q", 90),
        "byte 96: fields 'a' and 'b' share bytes, expected each to have",
    ),
}


@pytest.mark.parametrize(("raw", "message"), WRONG.values(), ids=WRONG)
def test_wrong_heads_are_refused_with_the_reason(raw, message):
    with pytest.raises(ReadError, match=message) as raised:
        tensor.parsed(raw, "x.bsdf")
    assert str(raised.value).startswith("x.bsdf")
    assert str(raised.value).isprintable()


def test_wrong_heads_allocate_nothing():
    for raw, _ in WRONG.values():
        tracemalloc.start()
        with pytest.raises(ReadError):
            tensor.parsed(raw, "x.bsdf")
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < ROOM


def test_a_name_from_the_file_cannot_break_the_message():
    name = "../../x\n\x1b[31m" + "y" * 1000
    raw = tensor.packed({name: np.zeros(1)})
    with pytest.raises(ReadError, match=r"'\.\./\.\./x\\n\\x1b\[31my{26,40}'…: type 0") as raised:
        tensor.parsed(patched(raw, places(raw)[0].kind, "<B", 0), "x.bsdf")
    assert str(raised.value).isprintable()
    assert len(str(raised.value)) < 200


def test_claims_goes_by_the_first_twelve_bytes():
    assert tensor.claims(RAW, len(RAW))
    for head in (b"", b"tensor_file", b"tensor_files", b"theta_i,brdf\n", b"PK\3\4", RAW[1:]):
        assert not tensor.claims(head, len(head))
