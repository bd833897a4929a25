"""Bytes of a user's file: streams, which can be read but once, are read as files are."""

import os
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import ReadError
from fitmat.measurements.parsing import contents

ROWS = "theta_i,theta_o,brdf\n30,-30,0.25\n30,30,0.5\n"


@pytest.fixture
def fifo(tmp_path: Path) -> Iterator[Path]:
    """A FIFO into which somebody writes `ROWS`."""
    path = tmp_path / "scan.csv"
    os.mkfifo(path)
    writer = threading.Thread(target=lambda: path.write_text(ROWS))
    writer.start()
    yield path
    writer.join()


def test_a_stream_is_read_as_a_file_of_its_name(fifo: Path, tmp_path: Path) -> None:
    found = fm.read(fifo)
    np.testing.assert_array_equal(found.value[:, 0], [0.25, 0.5])
    assert found.source == "scan.csv"
    assert os.listdir(tmp_path) == ["scan.csv"]


def test_a_columnar_stream_is_read_too(tmp_path: Path) -> None:
    fm.write(fm.read({"theta_i": [30, 30], "theta_o": [-30, 30], "brdf": [0.25, 0.5]}), tmp_path / "a.parquet")
    reading, writing = os.pipe()
    os.write(writing, (tmp_path / "a.parquet").read_bytes())
    os.close(writing)
    np.testing.assert_array_equal(fm.read(f"/dev/fd/{reading}").value[:, 0], [0.25, 0.5])
    os.close(reading)


def test_a_file_is_read_where_it_is(tmp_path: Path) -> None:
    path = tmp_path / "scan.csv"
    path.write_text(ROWS)
    with contents.on_disk(path) as found:
        assert found is path
    assert not contents.is_stream(tmp_path / "none")


def test_an_endless_stream_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(contents, "STREAMED", 3 << 20)
    with pytest.raises(ReadError, match=r"zero: a stream of more than 3 MB, expected a file .*\. Save it first\."):
        fm.read("/dev/zero")
    with pytest.raises(ReadError, match=r"null: the file is empty"):
        fm.read("/dev/null")


def test_a_stream_without_room_is_refused(fifo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(contents.tempfile, "TemporaryDirectory", full)
    with pytest.raises(ReadError, match=r"scan\.csv: a stream that cannot be kept in \S+ \(No space left on device\)"):
        fm.read(fifo)
