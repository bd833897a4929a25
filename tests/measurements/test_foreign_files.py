"""Files of other programs are named, with what to do; packed tables and workbooks read like plain ones."""

import gzip
from pathlib import Path

import polars as pl
import pytest

from fitmat.errors import ReadError
from fitmat.measurements.large import chunks
from fitmat.measurements.parsing import contents
from fitmat.measurements.reader import read

HEAD = "theta_i,theta_o,brdf\n"
TABLE = HEAD + "30,20,0.5\n30,30,0.25\n"


def written(folder: Path, content: str | bytes, name: str = "lab.csv") -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


FOREIGN: dict[str, tuple[bytes, str]] = {
    "zip": (b"PK\x03\x04\x14\x00data.csv", "a ZIP archive, .*Unpack it"),
    "docx": (b"PK\x03\x04\x14\x00[Content_Types].xml word/document.xml", "a Word document"),
    "ods": (b"PK\x03\x04\x14\x00mimetypeapplication/vnd.oasis.opendocument.spreadsheet", "an OpenDocument file"),
    "npz": (b"PK\x03\x04\x14\x00brdf.npy", r"an archive of NumPy arrays .*pass the arrays to fitmat\.read"),
    "xls": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(99), r"an Excel workbook of the old kind .*Save it as \.xlsx"),
    "tar": (b"a.csv".ljust(257, b"\0") + b"ustar\x0000", "an archive, .*Unpack it"),
    "packed tar": (gzip.compress(b"a.csv".ljust(257, b"\0") + b"ustar\x0000"), "an archive, .*Unpack it"),
    "bzip2": (b"BZh91AY&SY\x00", r"a compressed file, .*Unpack it; \.gz is read"),
    "xz": (b"\xfd7zXZ\x00\x00", "a compressed file"),
    "MATLAB": (b"MATLAB 5.0 MAT-file, Platform: GLNXA64", r"a MATLAB file \(\.mat\), .*writetable"),
    "HDF5": (b"\x89HDF\r\n\x1a\n\x00", "an HDF5 or NetCDF file, .*xarray"),
    "NetCDF": (b"CDF\x01\x00\x00", "a NetCDF file, .*xarray"),
    "NumPy": (b"\x93NUMPY\x01\x00v\x00{'descr': '<f8'}", r"a NumPy array \(\.npy\)"),
    "pickle": (b"\x80\x04\x95\x05\x00}q\x00.", "a Python pickle, which is never loaded"),
    "PDF": (b"%PDF-1.7\n%\xe2\xe3", "a PDF document, .*Export its numbers as CSV"),
    "PNG": (b"\x89PNG\r\n\x1a\n", "a picture, .*numbers behind it"),
    "JPEG": (b"\xff\xd8\xff\xe0\x00\x10JFIF", "a picture"),
    "TIFF": (b"II*\x00\x08\x00", "a picture"),
    "HTML": (b"\n<!DOCTYPE html>\n<html><title>Log in</title>", r"a web page \(HTML\), .*login page"),
    "XML": (b'<?xml version="1.0"?>\n<WindowElement>', "an XML file"),
    "XML without a declaration": (b"<data>\n<row/>\n</data>", "an XML file"),
    "JSON": (b'{"theta_i": [30], "theta_o": [20], "brdf": [0.5]}', r"a JSON file, .*fitmat\.read as a dict"),
    "JSON rows": (b'[\n  {"theta_i": 30}]', "a JSON file"),
    "Speos": (b"OPTIS - Anisotropic BSDF surface file v8.0\n0\n", "a file of Ansys Speos, .*as text with theta_i"),
    "TracePro": (b"TracePro Surface Property\nName\tAlu\n", "a file of TracePro"),
}


@pytest.mark.parametrize(("content", "sentence"), FOREIGN.values(), ids=FOREIGN)
def test_files_of_other_programs_are_named(tmp_path, content, sentence):
    path = written(tmp_path, content)
    with pytest.raises(ReadError, match=rf"^lab\.csv: {sentence}"):
        read(path)
    with pytest.raises(ReadError, match=sentence):
        chunks.scan(path)


@pytest.mark.parametrize(
    "first", ["[theta_i],theta_o,brdf", "OPTISCHE Messung\ntheta_i,theta_o,brdf", "# <b>\n" + HEAD[:-1]]
)
def test_a_table_that_begins_alike_is_no_foreign_file(tmp_path, first):
    columns = {"theta_i": 1, "theta_o": 2, "brdf": 3}
    assert read(written(tmp_path, first + "\n30,20,0.5\n30,30,0.25\n"), columns=columns).n_valid == 2


# --- packed ---------------------------------------------------------------------------------------


def test_what_gzip_packed_reads_like_its_plain_form(tmp_path):
    plain = read(written(tmp_path, TABLE))
    packed = read(written(tmp_path, gzip.compress(TABLE.encode()), "lab.csv.gz"))
    assert packed.value.tolist() == plain.value.tolist() == [[0.5], [0.25]]
    assert packed.source == "lab.csv.gz"
    inner = written(tmp_path, b"", "a.parquet")
    pl.DataFrame({"theta_i": [30.0], "theta_o": [20.0], "brdf": [0.5]}).write_parquet(inner)
    assert read(written(tmp_path, gzip.compress(inner.read_bytes()), "b.gz")).value.tolist() == [[0.5]]


def test_parts_of_what_gzip_packed_are_its_rows(tmp_path):
    path = written(tmp_path, gzip.compress(TABLE.encode()), "lab.csv.gz")
    assert [part.value.tolist() for part in chunks.scan(path, rows=1)] == [[[0.5]], [[0.25]]]


def test_damaged_or_endless_gzip_is_refused(tmp_path, monkeypatch):
    packed = gzip.compress(TABLE.encode())
    with pytest.raises(ReadError, match=r"^a\.gz: its gzip content is damaged .*Was its download cut off\?"):
        read(written(tmp_path, packed[:-9], "a.gz"))
    with pytest.raises(ReadError, match=r"^a\.gz: its gzip content is damaged"):
        read(written(tmp_path, packed[:12] + b"\xff\xff" + packed[14:], "a.gz"))
    with pytest.raises(ReadError, match=r"a\.gz: the file is empty \(0 bytes\)"):
        read(written(tmp_path, gzip.compress(b""), "a.gz"))
    monkeypatch.setattr(contents, "MOST_UNPACKED", 2 * contents.HEAD)
    with pytest.raises(ReadError, match=r"unpacks to more, .*gunzip -k '.*it'\"'\"'s\.gz'"):
        read(written(tmp_path, gzip.compress(bytes(3 * contents.HEAD)), "it's.gz"))
