"""Faulty input of every reader: seeded faults without end, and hostile heads written by hand.

FITMAT_FUZZ=200000 raises the number of inputs for each reader in the study.
"""

import gzip
import io
import os
import pickle
import struct
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path

import fuzz
import numpy as np
import polars as pl
import pytest
import test_alta
import test_astm
import test_fred
import test_lighttools
import test_ssdd
import test_tensor
import test_utia
import test_zemax

from fitmat.errors import ReadError
from fitmat.measurements import recognition
from fitmat.measurements.parsing import contents, footer, tensor
from fitmat.measurements.reader import read
from fitmat.measurements.samples import Measurements

FEW = 200
INPUTS = int(os.environ.get("FITMAT_FUZZ", "2000"))
"""Inputs for each reader: of every run, and of the study."""

SMALLEST = 20
"""Of UTIA's files of two megabytes, which take 20 ms each, there are a hundredth, but at least so many."""

LONG = 10**6
"""Characters; a search that backtracks takes minutes for them, one that does not milliseconds."""


@pytest.mark.parametrize("count", [FEW, pytest.param(INPUTS, marks=pytest.mark.study)])
@pytest.mark.parametrize("name", fuzz.READERS)
def test_whatever_a_reader_is_given_becomes_measurements_or_one_sentence(name, count):
    count = max(SMALLEST, count // 100) if name == "utia_whole" else count
    tally = fuzz.run(fuzz.READERS[name], count, 0, fuzz.measured_files())
    assert tally.inputs == count
    assert min(tally.read, tally.refused) > 0.02 * count, tally


def test_every_format_is_fuzzed():
    assert {layout.__name__.rpartition(".")[2] for layout in recognition.FORMATS} <= set(fuzz.READERS)


@pytest.mark.parametrize("name", [name for name, one in fuzz.READERS.items() if one.faults])
def test_samples_without_a_fault_are_read(name, tmp_path):
    rng = np.random.default_rng(1)
    with fuzz.READERS[name].prepare():
        for _ in range(3):
            (tmp_path / fuzz.NAME).write_bytes(fuzz.READERS[name].sample(rng))
            assert read(tmp_path / fuzz.NAME, unknown_scale=name == "text").valid.any()


# --- hostile files --------------------------------------------------------------------------------


class Trap:
    """What writes a file as soon as it is unpickled."""

    def __reduce__(self) -> tuple[Callable[..., object], tuple[str, str]]:
        return open, ("sprung", "w")


def text(module: object, **replaced: str) -> bytes:
    """A valid text file of a format, some of its words replaced."""
    raw = module.sample(np.random.default_rng(5))  # type: ignore[attr-defined]
    for old, new in replaced.items():
        assert old.encode() in raw
        raw = raw.replace(old.encode(), new.encode(), 1)
    return raw


def stored(save: Callable[[io.BytesIO], object]) -> bytes:
    buffer = io.BytesIO()
    save(buffer)
    return buffer.getvalue()


def zipped(**content: bytes) -> bytes:
    def save(buffer: io.BytesIO) -> None:
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, raw in content.items():
                archive.writestr(f"../../{name}", raw)

    return stored(save)


def parquet(**columns: object) -> bytes:
    return stored(pl.DataFrame(columns).write_parquet)


def edited(raw: bytes, old: bytes, new: bytes) -> bytes:
    assert raw.count(old) >= 1
    return raw.replace(old, new)


def material(**fields: tuple[int, ...]) -> bytes:
    """A tensor file whose head announces arrays of these shapes, without their data."""
    head = struct.pack("<12sBBI", tensor.MAGIC, 1, 0, len(fields))
    for name, shape in fields.items():
        head += struct.pack("<H", len(name)) + name.encode() + struct.pack("<HBQ", len(shape), 10, 200)
        head += struct.pack(f"<{len(shape)}Q", *shape)
    return head + bytes(400)


ANGLES = {"theta_i": [30.0], "theta_o": [30.0], "brdf": [1.0]}
PLAIN = parquet(**{name: np.arange(20.0) + 1 for name in ANGLES})
ONE = b"\x15\x28\x15\x00\x15\x06\x15\x06"
"""The DataPageHeader of a page of 20 values, in Thrift's compact protocol: 20, PLAIN, RLE, RLE."""

LISTS = "".join(f"PARAM{k}_LIST {' '.join(str(j / 50) for j in range(1000))}\n" for k in range(4))
SSDD = f"VERSION 0.2\nDATA_TYPE brdf\nCOLOR_MODEL monochrome\nPARAM_TYPE spherical_coordinate_system\n{LISTS}"

HOSTILE: dict[str, bytes] = {
    "MERL of 10⁹ cells a side": struct.pack("<3i", *[10**9] * 3) + bytes(1000),
    "MERL of 10⁹ differences": struct.pack("<3i", 90, 90, 10**9) + bytes(1000),
    "MERL of negative counts": struct.pack("<3i", 90, 90, -180) + bytes(1000),
    "MERL of two negative counts": struct.pack("<3i", -2, -2, 1) + bytes(96),
    "MERL whose product is 0 in 32 bits": struct.pack("<3i", 2**16, 2**16, 1) + bytes(1000),
    "MERL whose product is its size in 32 bits": struct.pack("<3i", 65537, 65536, 1) + bytes(24 * 65536),
    "MERL without its last plane": struct.pack("<3i", 90, 90, 180) + bytes(2 * 8 * 90 * 90 * 180),
    "MERL cut in the head": struct.pack("<2i", 90, 90),
    "RGL of 10⁹ incidences": material(theta_i=(10**9,), phi_i=(1,)),
    "RGL of 2⁶⁴ cells": material(vndf=(2**16, 2**16, 2**16, 2**16)),
    "RGL of 2³² fields": struct.pack("<12sBBI", tensor.MAGIC, 1, 0, 2**32 - 1) + bytes(1000),
    "RGL of 65,535 dimensions": struct.pack("<12sBBIHHB", tensor.MAGIC, 1, 0, 1, 0, 65535, 10) + bytes(1000),
    "RGL with a path for a name": material(**{"../../etc/passwd": (2,), "/dev/zero": (2,)}),
    "RGL cut off": test_tensor.RAW[:-9],
    "Zemax of 10⁹ azimuths": text(test_zemax, **{"ScatterAzimuth 4": "ScatterAzimuth 1000000000"}),
    "Zemax of −3 radial angles": text(test_zemax, **{"ScatterRadial 3": "ScatterRadial -3"}),
    "Zemax cut off": text(test_zemax)[:-100],
    "LightTools cut off": text(test_lighttools)[:700],
    "FRED cut off": text(test_fred).rsplit(b" ", 2)[0],
    "FRED of scale 1…1x": b"type bsdf_data\nformat scale=" + b"1" * LONG + b"x\n0 0\n1 2 3\n",
    "ASTM of 10⁹ points": text(test_astm, **{"POINTS 12": "POINTS 1000000000"}),
    "ASTM of −1 points": text(test_astm, **{"POINTS 12": "POINTS -1"}),
    "ASTM of a long wavelength": b"VARS theta_i,phi_i,theta_s,phi_s," + b"1" * LONG + b"nmx,a\n1,2,1,4,5\n",
    "ALTA of 10⁹ values": b"#DIM 4 1000000000\n#PARAM_IN SPHERICAL_TL_PL_TV_PV\n#PARAM_OUT INV_STERADIAN\n1 2 1 2 3\n",
    "ALTA of 9999 values": b"#DIM 4 9999\n#PARAM_IN SPHERICAL_TL_PL_TV_PV\n#PARAM_OUT INV_STERADIAN\n1 2 1 2 3\n",
    "ALTA of −1 values": b"#DIM 4 -1\n#PARAM_IN SPHERICAL_TL_PL_TV_PV\n#PARAM_OUT INV_STERADIAN\n1 2 1 2 3\n",
    "ALTA cut off": text(test_alta).rsplit(b"\t", 1)[0],
    "SSDD of 10¹² binary cells": SSDD.encode() + b"DATA binary\n" + bytes(4000),
    "SSDD of 10¹² lines": SSDD.encode() + b"DATA ascii\n" + b"1\n" * 1000,
    "SSDD of 10¹² cells in a block before": SSDD.replace("brdf", "btdf").encode() + b"DATA binary\n" + text(test_ssdd),
    "SSDD of a long word": b"VERSION 0.2\nDATA_TYPE brdf\nDATA " + b"a" * LONG,
    "SSDD of a path": text(test_ssdd, brdf="../../etc/passwd"),
    "UTIA cut off": test_utia.sample(np.random.default_rng(1))[:-8],
    "Parquet of 2·10⁷ equal rows": parquet(theta_i=np.zeros(2 * 10**7, np.uint8), brdf=np.zeros(2 * 10**7, np.uint8)),
    "Parquet of one cell of 300 megabytes": parquet(**ANGLES, note=["a" * (300 * 10**6)]),
    "Parquet of a page of −20 values": edited(PLAIN, ONE, b"\x15\x27" + ONE[2:]),
    "Parquet of a page of 10⁹ values": edited(PLAIN, ONE[:2] + b"\x15\x00", b"\x15\xff\x8f\xdf\xc0\x07\x15\x00"),
    "Parquet with a footer of 4 gigabytes": PLAIN[:-8] + b"\xff\xff\xff\xff" + b"PAR1",
    "Parquet cut off": PLAIN[:-20],
    "NumPy archive": stored(lambda b: np.savez(b, theta_i=ANGLES["theta_i"])),
    "NumPy archive of pickles": stored(lambda b: np.savez(b, theta_i=np.array([Trap()], object))),
    "NumPy array of pickles": stored(lambda b: np.save(b, np.array([Trap()], object))),
    "NumPy array of 10⁹ × 10⁹": b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'shape': (1000000000, 1000000000), }".ljust(
        128
    ),
    "pickle": pickle.dumps(Trap()),
    "pickle in letters": pickle.dumps(Trap(), protocol=0),
    "pickle under a table": b"theta_i,theta_o,brdf\n30,30,1\n" + pickle.dumps(Trap(), protocol=0),
    "gzip cut off": gzip.compress(b"theta_i,theta_o,brdf\n" + b"30,30,1\n" * (LONG // 10))[:-9],
    "zip of a table beside its folder": zipped(sprung=b"theta_i,theta_o,brdf\n30,30,1\n"),
    "HDF5": b"\x89HDF\r\n\x1a\n" + bytes(500),
    "text of 5·10⁵ columns": b"1," * (LONG // 2) + b"1\n",
    "text of a long number that is none": b"theta_i," + b"9" * LONG + b"x\n1,2\n",
    "text of a gap in a name": b"theta_i,a" + b" " * LONG + b"b\n1,2\n",
    "text of a long line": b"theta_i,theta_o,brdf\n30,30," + b"1" * LONG + b"e\n",
    "text of quotes": b'theta_i,"' + b'"' * LONG + b"\n1,2\n",
    "text of terminal commands": b"theta_i,\x9b2Jtheta_o\xc2\x9b31m,a\n1,2,3\n",
    "text of line separators": "theta_i,a\u2028b\u0085c\u202e,\ufeffd\n1,2,3\n".encode(),
    "text that names paths": b"theta_i,theta_o,../../etc/passwd\n30,30,file:///etc/passwd\n",
    "nothing": b"",
    "NULs": bytes(100_000),
}


@pytest.mark.parametrize("raw", HOSTILE.values(), ids=HOSTILE)
def test_hostile_files_are_refused_in_a_sentence_and_touch_nothing(raw, tmp_path, monkeypatch):
    (tmp_path / "in").mkdir()
    monkeypatch.chdir(tmp_path / "in")
    (tmp_path / "in" / fuzz.NAME).write_bytes(raw)
    with fuzz.watched():
        message, _ = fuzz.judged(tmp_path / "in" / fuzz.NAME, fuzz.NAME, len(raw), trace=True)
    assert message is not None
    assert [path.name for path in tmp_path.rglob("*")] == ["in", fuzz.NAME]


def test_the_trap_springs_where_it_is_unpickled(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pickle.loads(pickle.dumps(Trap())).close()
    assert (tmp_path / "sprung").exists()


def test_a_file_name_cannot_break_the_message(tmp_path):
    path = tmp_path / "a\nb\x1b[2J\u202e.csv"
    path.write_bytes(b"x\n1\n")
    with pytest.raises(
        ReadError, match=r"^a\\nb\\u001b\[2J\\u202e\.csv: the columns are x, expected theta_i"
    ) as raised:
        read(path)
    assert str(raised.value).isprintable()


def test_long_words_of_the_file_are_cut():
    assert contents.shown("a  b\n" * 99, 7) == "a b a b…"
    assert contents.listed(["x", "", "y" * 99, *"z" * 99], 3) == f"x, {'y' * 40}…, z …"


@pytest.mark.parametrize("packing", ["zstd", "snappy", "gzip", "lz4", "uncompressed"])
def test_pages_are_counted_as_they_unpack(packing):
    """A column of n float64 without nulls, plain, is 8 n bytes and the marks of validity; polars writes the pages."""
    number = np.random.default_rng(2).normal(size=50_000)
    raw = stored(
        lambda b: pl.DataFrame({"a": number, "b": number}).write_parquet(b, compression=packing, row_group_size=9000)
    )
    assert 8 * len(number) < footer.unpacked(raw, ["a"], len(number)) < 8.1 * len(number)
    assert footer.unpacked(raw, ["a", "b"], len(number)) == 2 * footer.unpacked(raw, ["a"], len(number))
    assert footer.unpacked(raw, [], len(number)) == 0


# --- the engine itself ----------------------------------------------------------------------------

TILTED = np.array([[0.0, 0.6, 0.8]])
GOOD = Measurements(TILTED, TILTED, np.ones((1, 1)), None, np.ones((1, 1), bool), ("value",))


def _raises(error: BaseException) -> object:
    raise error


def _warns(path: object) -> object:
    warnings.warn("odd", RuntimeWarning, stacklevel=2)
    return GOOD


def _hangs(path: object) -> object:
    while True:
        pass


def _swells(path: object) -> object:
    np.empty(10**9)
    return GOOD


def _fills(path: object) -> object:
    np.ones(2 * 10**7)
    return GOOD


def _writes(path: object) -> object:
    Path(os.fspath(path)).with_name("other").write_text("a")  # type: ignore[arg-type]
    return GOOD


def _sets(path: object) -> object:
    os.environ["FITMAT_FUZZED"] = "1"
    return GOOD


def _bent(path: object) -> object:
    return Measurements(GOOD.wi * 1.1, GOOD.wo, GOOD.value, None, GOOD.valid, GOOD.channels)


def _said(message: str) -> Callable[[object], object]:
    return lambda path: _raises(ReadError(message))


PLANTED: dict[str, tuple[Callable[[object], object], str]] = {
    "exception": (lambda path: _raises(ValueError("odd")), "ValueError: odd"),
    "exit": (lambda path: _raises(MemoryError()), "MemoryError"),
    "warning": (_warns, "RuntimeWarning: odd"),
    "endless loop": (_hangs, "it takes more than 0.5 s"),
    "memory never touched": (_swells, "bytes resident"),
    "memory": (_fills, "bytes resident"),
    "file": (_writes, "it touched the world: .*to write"),
    "environment": (_sets, "it touched the world"),
    "other noun": (lambda path: {}, "dict is not Measurements"),
    "direction": (_bent, "no unit vectors"),
    "two lines": (_said(f"{fuzz.NAME}: a\nb, expected c."), "not one plain line"),
    "terminal command": (_said(f"{fuzz.NAME}: \x1b[2J, expected c."), "not one plain line"),
    "no name": (_said("a, expected b."), "without name, expectation or end"),
    "no expectation": (_said(f"{fuzz.NAME}: a."), "without name, expectation or end"),
    "no end": (_said(f"{fuzz.NAME}: a, expected b"), "without name, expectation or end"),
    "endless message": (_said(f"{fuzz.NAME}: {'a' * 9999}, expected b."), "a message of"),
}


@pytest.mark.parametrize(("planted", "failure"), PLANTED.values(), ids=PLANTED)
def test_what_no_reader_may_do_is_found(monkeypatch, tmp_path, planted, failure):
    monkeypatch.setattr(fuzz, "read", planted)
    if planted is _hangs:  # the others have their time, on a busy machine too
        monkeypatch.setattr(fuzz, "SLOWEST", 0.5)
    monkeypatch.setattr(os, "environ", dict(os.environ))
    (tmp_path / fuzz.NAME).write_bytes(b"x")
    with fuzz.watched(), pytest.raises(fuzz.Failure, match=failure):
        fuzz.judged(tmp_path / fuzz.NAME, fuzz.NAME, 1, trace=True)


def test_a_failing_input_is_kept_and_comes_again(monkeypatch, tmp_path):
    monkeypatch.setattr(fuzz, "read", lambda path: _raises(KeyError("odd")))
    monkeypatch.setattr(fuzz.tempfile, "tempdir", str(tmp_path))
    with pytest.raises(fuzz.Failure, match=r"input 0 of seed 4, kept as .*fuzz\.dat: KeyError: 'odd'"):
        fuzz.run(fuzz.READERS["fred"], 9, 4)
    (kept,) = tmp_path.rglob(fuzz.NAME)
    assert kept.read_bytes() == next(fuzz.inputs(fuzz.READERS["fred"], 4))


def test_a_faulty_reader_is_found_by_its_own_inputs(monkeypatch, tmp_path):
    """The azimuth of a direction forgotten: what is missing in a file must not become a direction."""
    monkeypatch.setattr("fitmat.measurements.parsing.blocks.placed", lambda w: w)
    monkeypatch.setattr(fuzz.tempfile, "tempdir", str(tmp_path))
    with pytest.raises(fuzz.Failure, match="no unit vectors"):
        fuzz.run(fuzz.READERS["fred"], 2000, 0)
