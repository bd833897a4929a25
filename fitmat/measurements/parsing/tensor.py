"""Tensor container: named arrays in one little-endian file, as RGL-EPFL and Mitsuba exchange them.

It gives the arrays no meaning, copies none of them, and believes no size that the file cannot hold.

Layout (`mitsuba/core/tensor.h`, and `read_tensor` and `write_tensor` of the BRDF loader that RGL-EPFL publishes):

========  =================================================================================================
bytes     content
========  =================================================================================================
12        "tensor_file" and NUL
2         version: 1, 0
4         uint32, number of fields
          for each field:
2 + n     uint16 n, and the name in UTF-8
2         uint16, number of dimensions
1         type: 1 uint8, 2 int8, 3 uint16, 4 int16, 5 uint32, 6 int32, 7 uint64, 8 int64, 9–11 float16, 32, 64
8         uint64, byte of the file at which the data start
8 each    uint64, length of each dimension, the last one contiguous in the data
========  =================================================================================================

The data follow in the order of the fields, each padded in front to a multiple of the alignment (8). A field of no
elements has an offset too, and nothing is written for it: at the end of a file it points past its last byte.
"""

import itertools
import math
import os
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fitmat.errors import OutputError, ReadError
from fitmat.measurements.parsing import contents

MAGIC = b"tensor_file\0"

TYPES = {
    1: np.dtype("<u1"),
    2: np.dtype("<i1"),
    3: np.dtype("<u2"),
    4: np.dtype("<i2"),
    5: np.dtype("<u4"),
    6: np.dtype("<i4"),
    7: np.dtype("<u8"),
    8: np.dtype("<i8"),
    9: np.dtype("<f2"),
    10: np.dtype("<f4"),
    11: np.dtype("<f8"),
}
"""Type in the file → type in memory."""

FIELDS_MAX = 65_536
"""A file of more fields is refused; those of RGL have ten."""

DIMENSIONS_MAX = 32
"""An array of more dimensions is refused."""

_VERSION = (1, 0)
_START = struct.Struct("<12sBBI")
_LENGTH = struct.Struct("<H")
_ARRAY = struct.Struct("<HBQ")
_DIMENSION = struct.Struct("<Q")
_ADDRESSABLE = 2**63


class Field(NamedTuple):
    """What the head of a file says of one array."""

    name: str
    dtype: np.dtype
    shape: tuple[int, ...]
    offset: int

    @property
    def bytes(self) -> int:
        """Its size; 0 where a dimension is."""
        return math.prod(self.shape) * self.dtype.itemsize

    @property
    def end(self) -> int:
        """The byte behind its data."""
        return self.offset + self.bytes


def claims(head: bytes, size: int) -> bool:
    """Whether a file is a tensor container, by its first 12 bytes."""
    return head[: len(MAGIC)] == MAGIC


def read(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """The arrays of a file by name, in its order; see `parsed`."""
    return parsed(contents.contents(path), contents.name(path))


def parsed(raw: bytes, source: str) -> dict[str, np.ndarray]:
    """The arrays of a container by name, in its order: read-only views, little-endian, not necessarily aligned.

    Args:
        raw: All bytes of the file.
        source: Its name, for messages.

    Raises:
        ReadError: it is no such container, is cut off, or its head contradicts itself or the file's size.

    Example:
        >>> parsed(packed({"a": np.float32([[1, 2]]), "none": np.zeros((0, 3))}), "x")
        {'a': array([[1., 2.]], dtype=float32), 'none': array([], shape=(0, 3), dtype=float64)}
    """
    fields = _head(raw, source)
    return {
        field.name: np.frombuffer(raw, field.dtype, math.prod(field.shape), field.offset if field.bytes else 0).reshape(
            field.shape
        )
        for field in fields
    }


def _head(raw: bytes, source: str) -> list[Field]:
    if not claims(raw, len(raw)):
        raise ReadError(f"{source}: it does not begin with 'tensor_file', expected a tensor file. Name another file.")
    if len(raw) < _START.size:
        raise _cut_off(raw, source, "its head")
    _, *version, count = _START.unpack_from(raw)
    if tuple(version) != _VERSION:
        expected = "expected version 1.0. Was it written by a later program?"
        raise ReadError(f"{source} byte 12: tensor file of version {version[0]}.{version[1]}, {expected}")
    if count > FIELDS_MAX:
        raise ReadError(f"{source} byte 14: {count} fields, expected at most {FIELDS_MAX}. Is the file damaged?")
    fields: dict[str, Field] = {}
    position = _START.size
    for number in range(1, count + 1):
        field, position = _field(raw, position, f"{source} field {number} of {count}", source)
        if field.name in fields:
            raise ReadError(f"{source}: two fields are named {_shown(field.name)}, expected one. Is the file damaged?")
        fields[field.name] = field
    _refuse_impossible(list(fields.values()), position, len(raw), source)
    return list(fields.values())


def _field(raw: bytes, position: int, place: str, source: str) -> tuple[Field, int]:
    """The description of one field at a byte of the file, and the byte behind it."""
    if position + _LENGTH.size > len(raw):
        raise _cut_off(raw, source, place)
    name = position + _LENGTH.size
    array = name + _LENGTH.unpack_from(raw, position)[0]
    dimensions = array + _ARRAY.size
    if dimensions > len(raw):
        raise _cut_off(raw, source, place)
    try:
        label = raw[name:array].decode()
    except UnicodeDecodeError as error:
        raise ReadError(f"{place}: its name is not UTF-8 (byte {name}), expected text. Is the file damaged?") from error
    rank, kind, offset = _ARRAY.unpack_from(raw, array)
    if kind not in TYPES:
        raise ReadError(f"{place}, {_shown(label)}: type {kind}, expected 1 to 11. Is the file damaged?")
    if rank > DIMENSIONS_MAX:
        expected = f"expected at most {DIMENSIONS_MAX}. Is the file damaged?"
        raise ReadError(f"{place}, {_shown(label)}: {rank} dimensions, {expected}")
    end = dimensions + rank * _DIMENSION.size
    if end > len(raw):
        raise _cut_off(raw, source, place)
    shape = struct.unpack_from(f"<{rank}Q", raw, dimensions)
    return Field(label, TYPES[kind], shape, offset), end


def _refuse_impossible(fields: list[Field], head: int, size: int, source: str) -> None:
    """Data outside the file, inside its head or inside other data, and empty arrays that no program can hold."""
    for field in fields:
        extent = "×".join(map(str, field.shape))
        if math.prod(length for length in field.shape if length) * field.dtype.itemsize >= _ADDRESSABLE:
            expected = "expected one that fits into memory. Is the file damaged?"
            raise ReadError(f"{source}: {_shown(field.name)} is an array of {extent}, {expected}")
        if field.bytes and not head <= field.offset <= field.end <= size:
            expected = f"expected them between byte {head} and the file's end at {size}. Was its download cut off?"
            place = f"{_shown(field.name)} ({extent} {field.dtype.name}) has bytes {field.offset} to {field.end}"
            raise ReadError(f"{source}: {place}, {expected}")
    stored = sorted((field for field in fields if field.bytes), key=lambda field: field.offset)
    for one, other in itertools.pairwise(stored):
        if other.offset < one.end:
            names = f"{_shown(one.name)} and {_shown(other.name)}"
            expected = "expected each to have its own. Is the file damaged?"
            raise ReadError(f"{source} byte {other.offset}: fields {names} share bytes, {expected}")


def _cut_off(raw: bytes, source: str, place: str) -> ReadError:
    where = place.removeprefix(source).strip()
    return ReadError(f"{source}: the file ends at byte {len(raw)}, in {where}, expected more. Was it cut off?")


def _shown(name: str) -> str:
    """A name from the file, on one line and not longer than a message bears."""
    return ascii(name) if len(name) <= 40 else f"{name[:40]!a}…"


def write(path: str | os.PathLike[str], fields: Mapping[str, np.ndarray | str], *, align: int = 8) -> None:
    """Write arrays to a file; see `packed`.

    Raises:
        OutputError: it cannot be written, or an array is of a type that the format does not have.
    """
    raw = packed(fields, align=align)
    try:
        Path(path).write_bytes(raw)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise OutputError(f"{path}: cannot be written ({reason}). Name a file in a folder that exists.") from error


def packed(fields: Mapping[str, np.ndarray | str], *, align: int = 8) -> bytes:
    """Arrays as a container, byte for byte as the published writer makes it.

    A dimensionless array stays one, which Mitsuba reads; the published writer would give it the shape (1,).

    Args:
        fields: Name → array, or text, which becomes an array of its UTF-8 bytes.
        align: Data start at multiples of this number of bytes, at least 1.

    Raises:
        OutputError: an array is of a type that the format does not have, or a number is beyond its fields.
    """
    if align < 1:
        raise OutputError(f"align = {align}, expected a number of bytes from 1. Leave it out for 8.")
    arrays = {name: _little_endian(name, value) for name, value in fields.items()}
    labels = {name: name.encode() for name in arrays}
    codes = {dtype: code for code, dtype in TYPES.items()}
    head = _START.size + sum(
        _LENGTH.size + len(labels[name]) + _ARRAY.size + _DIMENSION.size * array.ndim for name, array in arrays.items()
    )
    raw, data, end = bytearray(_START.pack(MAGIC, *_VERSION, len(arrays))), bytearray(), head
    for name, array in arrays.items():
        if len(labels[name]) >= 2**16:
            raise OutputError(f"field {_shown(name)}: a name of {len(labels[name])} bytes, expected at most 65535.")
        offset = -(-end // align) * align
        raw += _LENGTH.pack(len(labels[name])) + labels[name] + _ARRAY.pack(array.ndim, codes[array.dtype], offset)
        raw += struct.pack(f"<{array.ndim}Q", *array.shape)
        if array.size:
            data += bytes(offset - head - len(data)) + array.tobytes()
        end = offset + array.nbytes
    return bytes(raw + data)


def _little_endian(name: str, value: np.ndarray | str) -> np.ndarray:
    array = np.frombuffer(value.encode(), np.uint8) if isinstance(value, str) else np.asarray(value)
    dtype = array.dtype.newbyteorder("<")
    if dtype not in TYPES.values():
        expected = "expected integers or floats of 8 to 64 bits, or text. Convert it"
        raise OutputError(f"field {_shown(name)}: an array of {array.dtype}, {expected}.")
    return array.astype(dtype, copy=False)
