"""Faults of any file, whatever its format, for the fuzz suite: bits, bytes, words, numbers, lines, encodings.

It knows no reader and judges nothing (`fuzz` does).
"""

from collections.abc import Callable, Sequence

import numpy as np

Fault = Callable[[bytes, np.random.Generator], bytes]
"""(file, generator) → the file with a fault."""

EXTREME = (
    *(b"1e308", b"-1e308", b"1e309", b"5e-324", b"-0", b"nan", b"-inf", b"NaN", b"1e999", b"0x10", b"1_000", b"-1"),
    *(b"2147483648", b"-2147483649", b"18446744073709551616", b"9" * 400, b"0" * 400 + b"1", b"1." + b"0" * 400),
    *(
        b"1000000000",
        b"99999",
        b"3.5",
        b"1,5",
        b"",
        b"../../etc/passwd",
        b"=1+1",
        b"%s%n",
        b"{0}",
        b"\\x00",
        b"\x1b[2J",
    ),
)
LETTERS = tuple(
    text.encode()
    for text in (
        "١٢",
        "𝟗",
        "½",
        "−1",
        "１２",
        "θ",
        "\u2028",
        "\u0085",
        "\ufeff",
        "\u202e",
        "\u00a0",
        "\v",
        "\f",
        "é" * 99,
    )
)
BYTES = (
    b"\0",
    b"\0" * 64,
    b"\xff\xfe",
    b"\xfe\xff",
    b"\xef\xbb\xbf",
    b"\xed\xa0\x80",
    b"\x1a",
    b"\x80",
    b'"',
    b"#",
    b";",
)
ENDS = (b"\r\n", b"\r", b"\n\n", b"\n\r", b"\x0b", b" ", b",", b"\t")
PACKED = tuple(
    np.array(number, kind).tobytes()
    for kind, numbers in {
        "<f8": (np.nan, np.inf, -0.0, 1.7e308, 5e-324, -1.0),
        "<f4": (np.nan, -np.inf, 3.4e38),
        "<i4": (-1, 0, 2**31 - 1, -(2**31), 10**9),
        "<i8": (-1, 2**63 - 1, 2**31, 10**12),
    }.items()
    for number in numbers
)


def _place(raw: bytes, rng: np.random.Generator) -> int:
    return int(rng.integers(len(raw) + 1))


def _piece(raw: bytes, rng: np.random.Generator) -> bytes:
    at = _place(raw, rng)
    return raw[at : at + int(rng.integers(1, 200))]


def _over(raw: bytes, at: int, new: bytes) -> bytes:
    return raw[:at] + new + raw[at + len(new) :]


def _into(raw: bytes, at: int, new: bytes) -> bytes:
    return raw[:at] + new + raw[at:]


def _one(choices: Sequence[bytes], rng: np.random.Generator) -> bytes:
    return choices[int(rng.integers(len(choices)))]


def _flip(raw: bytes, rng: np.random.Generator) -> bytes:
    if not raw:
        return raw
    at = int(rng.integers(len(raw)))
    return _over(raw, at, bytes([raw[at] ^ (1 << int(rng.integers(8)))]))


def _word(raw: bytes, rng: np.random.Generator) -> bytes:
    """A number in place of a word."""
    at = _place(raw, rng)
    begin = max(raw.rfind(mark, 0, at) for mark in (b" ", b",", b"\n", b"\t", b"=")) + 1
    ends = [end for mark in (b" ", b",", b"\n", b"\t", b"\r") if (end := raw.find(mark, at)) >= 0]
    return raw[:begin] + _one(EXTREME, rng) + raw[min(ends, default=len(raw)) :]


def _long(raw: bytes, rng: np.random.Generator) -> bytes:
    at, unit = (
        _place(raw, rng),
        (b"1 ", b"1,", b"a", b" ", b"\t", b"9", b"\n", b'"', b"#", b"-", b"1\n", b"e")[rng.integers(12)],
    )
    return _into(raw, at, unit * int(rng.choice([100, 1000, 10_000])))


def _ends(raw: bytes, rng: np.random.Generator) -> bytes:
    """Other line ends in a part of the file."""
    one, two = sorted((_place(raw, rng), _place(raw, rng)))
    return raw[:one] + raw[one:two].replace(b"\n", _one(ENDS, rng)) + raw[two:]


GENERIC: tuple[Fault, ...] = (
    _flip,
    _word,
    _long,
    _ends,
    lambda raw, rng: raw[: _place(raw, rng)],
    lambda raw, rng: raw[_place(raw, rng) :],
    lambda raw, rng: _into(raw, _place(raw, rng), _piece(raw, rng)),
    lambda raw, rng: raw.replace(_piece(raw, rng), b"", 1),
    lambda raw, rng: _into(raw, _place(raw, rng), _one(EXTREME, rng)),
    lambda raw, rng: _into(raw, _place(raw, rng), _one(LETTERS, rng)),
    lambda raw, rng: _into(raw, _place(raw, rng), _one(BYTES, rng)),
    lambda raw, rng: _over(raw, _place(raw, rng), _one(PACKED, rng)),
    lambda raw, rng: _over(raw, 4 * (_place(raw, rng) // 4), _one(PACKED, rng)),
    lambda raw, rng: _into(raw, _place(raw, rng), rng.bytes(int(rng.integers(1, 30)))),
    lambda raw, rng: _one(BYTES, rng) + raw,
    lambda raw, rng: raw.decode("latin-1").encode(("utf-16", "utf-16-le", "utf-8-sig", "utf-32")[rng.integers(4)]),
    lambda raw, rng: raw + raw,
)
"""(file, generator) → the file with one fault that needs no knowledge of its format."""


def spliced(raw: bytes, other: bytes, rng: np.random.Generator) -> bytes:
    """The beginning of one file and the end of another."""
    return raw[: _place(raw, rng)] + other[_place(other, rng) :]
