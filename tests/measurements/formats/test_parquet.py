"""Parquet of others: cells of every plain kind, hostile files, and faults that become one plain sentence."""

import io
import struct

import numpy as np
import polars as pl
import pytest

from fitmat.errors import ReadError
from fitmat.measurements.formats import parquet


def pack(**columns: object) -> bytes:
    buffer = io.BytesIO()
    pl.DataFrame(columns).write_parquet(buffer)
    return buffer.getvalue()


def sample(rng: np.random.Generator) -> bytes:
    """A valid file of a few rows."""
    angles = {"theta_i": rng.uniform(5, 80, 20), "theta_o": rng.uniform(5, 80, 20)}
    return pack(**angles, brdf=rng.uniform(0.1, 1, 20), note=["a", "b"] * 10)


def mutated(raw: bytes, rng: np.random.Generator) -> bytes:
    """The file with one to three faults: flipped bits, numbers of the footer replaced, bytes cut off, lost or added."""
    content = bytearray(raw)
    for _ in range(rng.integers(1, 4)):
        place = int(rng.integers(4, max(len(content), 5)))
        match rng.integers(5):
            case 0 if place < len(content):
                content[place] ^= 1 << int(rng.integers(8))
            case 1:
                content[place : place + 4] = struct.pack("<i", [0, -1, 2**31 - 1, len(raw)][rng.integers(4)])
            case 2:
                del content[place:]
            case 3:
                del content[place : place + int(rng.integers(1, 30))]
            case _:
                content[place:place] = rng.bytes(int(rng.integers(1, 30)))
    return bytes(content)


def test_cells_of_every_plain_kind_are_read(tmp_path):
    path = tmp_path / "kinds.parquet"
    columns = {
        "theta_i": [30, 30, None],
        "theta_o": pl.Series([10.0, None, 20.0], dtype=pl.Float32),
        "brdf": ["0.5", "0,25", None],
        "valid": [True, False, None],
        "when": pl.Series(["2026-01-01"] * 3).str.to_date(),
        "lasted": pl.Series([1, 2, 3]).cast(pl.Duration),
        "kind": pl.Series(["a", None, "a"], dtype=pl.Categorical),
        "spectrum": [[1.0, 2.0], [3.0], []],
        "bytes": [b"1", b"2", b"3"],
        "void": pl.Series([None, None, None]),
    }
    path.write_bytes(pack(**columns))
    table = parquet.load(path)
    assert table.names == ("theta_i", "theta_o", "brdf", "valid", "when", "kind", "void")
    assert table.notes == ("Columns that hold no plain cells, not read: lasted, spectrum, bytes.",)
    assert table.numbers(0) == pytest.approx([30, 30, np.nan], nan_ok=True)
    assert table.numbers(1) == pytest.approx([10, np.nan, 20], nan_ok=True)
    assert table.numbers(2) == pytest.approx([0.5, 0.25, np.nan], nan_ok=True)
    assert table.truths(3) == pytest.approx([1, 0, np.nan], nan_ok=True)
    assert table.words(5).tolist() == ["a", "", "a"]
    assert table.where(2) == "kinds.parquet row 3"


def test_parquet_is_claimed_by_its_magic():
    raw = sample(np.random.default_rng(1))
    assert parquet.claims(raw[:65536], len(raw))
    assert not any(parquet.claims(other, len(other)) for other in [b"", b"PAR1", b"theta_i,theta_o,brdf\n", raw[1:]])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"PAR1" + bytes(50), "its Parquet content cannot be read .* Was its download cut off"),
        (sample(np.random.default_rng(1))[:-9], "its Parquet content cannot be read"),
        (pack(theta_i=[], brdf=[]), "no rows of plain cells, expected at least one"),
        (pack(spectrum=[[1.0], [2.0]]), "no rows of plain cells, expected at least one"),
        (pack(theta_i=np.zeros(5_000_000), brdf=np.zeros(5_000_000)), r"\d+ bytes that unpack to 80000000, expected"),
        (pack(note=["a" * 100_000] * 1000), r"\d+ bytes that unpack to 100000000, expected at most 16777216"),
    ],
    ids=["zeros", "cut off", "no rows", "only lists", "swelling", "swelling text"],
)
def test_bad_parquet_is_refused(tmp_path, content, message):
    path = tmp_path / "bad.parquet"
    path.write_bytes(content)
    with pytest.raises(ReadError, match=rf"bad\.parquet: {message}"):
        parquet.load(path)


def test_no_fault_of_parquet_raises_anything_but_a_read_error(tmp_path):
    rng, path = np.random.default_rng(2), tmp_path / "fuzz.parquet"
    outcomes = {"read": 0, "refused": 0}
    for _ in range(300):
        path.write_bytes(mutated(sample(rng), rng))
        try:
            assert parquet.load(path).cells.height > 0
            outcomes["read"] += 1
        except ReadError:
            outcomes["refused"] += 1
    assert min(outcomes.values()) > 10
