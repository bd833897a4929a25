"""Parquet of others: cells of every plain kind, hostile files, and faults that become one plain sentence."""

import io
import os
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from fitmat.errors import ReadError
from fitmat.measurements.formats import parquet
from fitmat.measurements.large import tables
from fitmat.measurements.parsing.footer import unpacked


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


def damaged(step: int) -> Iterator[bytes]:
    """A small file with one bit turned over, in every `step`-th byte between its magic numbers."""
    memory = io.BytesIO()
    table = {"theta_i": [30.0, 30.0, 30.0], "theta_o": [-30.0, 0.0, 30.0], "brdf": [1.0, None, 2.0]}
    pl.DataFrame(table).write_parquet(memory, compression="uncompressed", statistics=False)
    whole = memory.getvalue()
    for place in range(4, len(whole) - 4, step):
        for bit in (2, 8):
            torn = bytearray(whole)
            torn[place] ^= bit
            yield bytes(torn)


def in_memory(path: Path) -> None:
    parquet.load(path)


def block_by_block(path: Path) -> None:
    list(tables.tables(path, 2))


@pytest.mark.study
@pytest.mark.parametrize(("read", "step"), [(in_memory, 2), (block_by_block, 5)], ids=["in memory", "block by block"])
def test_a_damaged_file_is_one_sentence(read, step, tmp_path, capfd):
    """Where polars' threads panic, too: they print on the descriptor of stderr, which belongs to whoever called."""
    path = tmp_path / "torn.parquet"
    reasons = []
    for content in damaged(step):
        path.write_bytes(content)
        try:
            read(path)
        except ReadError as error:
            reasons.append(str(error))
    assert len(reasons) > 50
    assert all(reason.startswith("torn.parquet") and reason.count("\n") == 0 for reason in reasons)
    assert not any(word in reason for reason in reasons for word in ("unwrap", "Panic", "assertion"))
    assert read is block_by_block or any("its parts contradict each other" in reason for reason in reasons)
    assert capfd.readouterr() == ("", "")


def test_what_is_no_panic_is_printed_afterwards(capfd):
    with parquet.refused_if_damaged("x"):
        os.write(2, b"a hint\n")
        assert capfd.readouterr().err == ""
    assert capfd.readouterr().err == "a hint\n"


def test_a_name_that_is_a_list_is_no_column():
    """Thrift by hand: groups {1: [chunks]}, a chunk {3: {3: path}}, and a path that begins with a list."""
    path = b"\x39\x19\x09\x00"  # field 3, a list of one list of no lists; the end of the column's metadata
    chunk = b"\x3c" + path + b"\x00"  # field 3, a structure; the end of the chunk
    footer = b"\x49\x1c" + b"\x19\x1c" + chunk + b"\x00" + b"\x00"  # field 4, a list of one group, field 1 its chunks
    raw = b"PAR1" + footer + len(footer).to_bytes(4, "little") + b"PAR1"
    assert unpacked(raw, ["brdf"], 3) == 0
