"""Files of other programs are named, with what to do; packed tables and workbooks read like plain ones."""

import gzip
import importlib
import zipfile
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from fitmat.errors import FitmatError, ReadError
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


def workbook(path: Path, **sheets: list[list[str | float]]) -> Path:
    """An .xlsx file after ECMA-376, part 1, with text in the cells themselves, written without a library."""
    kind = "http://schemas.openxmlformats.org"
    rels = f'<Relationships xmlns="{kind}/package/2006/relationships">{{}}</Relationships>'
    rel = f'<Relationship Id="r{{0}}" Type="{kind}/officeDocument/2006/relationships/{{1}}" Target="{{2}}"/>'
    main = f'xmlns="{kind}/spreadsheetml/2006/main" xmlns:r="{kind}/officeDocument/2006/relationships"'
    with zipfile.ZipFile(path, "w") as file:
        file.writestr(
            "[Content_Types].xml",
            f'<Types xmlns="{kind}/package/2006/content-types"><Default Extension="xml" ContentType="application/xml"/>'
            '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
            "</Types>",
        )
        file.writestr("_rels/.rels", rels.format(rel.format(1, "officeDocument", "xl/workbook.xml")))
        listed = "".join(f'<sheet name="{name}" sheetId="{k}" r:id="r{k}"/>' for k, name in enumerate(sheets, 1))
        file.writestr("xl/workbook.xml", f"<workbook {main}><sheets>{listed}</sheets></workbook>")
        targets = "".join(rel.format(k, "worksheet", f"worksheets/sheet{k}.xml") for k in range(1, len(sheets) + 1))
        file.writestr("xl/_rels/workbook.xml.rels", rels.format(targets))
        for k, rows in enumerate(sheets.values(), 1):
            lines = (
                f'<row r="{row}">'
                + "".join(_cell(f"{chr(64 + c)}{row}", cell) for c, cell in enumerate(cells, 1))
                + "</row>"
                for row, cells in enumerate(rows, 1)
            )
            file.writestr(
                f"xl/worksheets/sheet{k}.xml", f"<worksheet {main}><sheetData>{''.join(lines)}</sheetData></worksheet>"
            )
    return path


def _cell(place: str, value: str | float) -> str:
    if isinstance(value, str):
        return f'<c r="{place}" t="inlineStr"><is><t>{value}</t></is></c>' if value else ""
    return f'<c r="{place}"><v>{value!r}</v></c>'


def test_a_workbook_reads_like_its_table(tmp_path):
    """The layout is that of ECMA-376; the notes, the units and the second sheet are as people leave them."""
    rows = [
        ["Sample: Alu"],
        ["theta_i", "theta_o", "brdf"],
        ["deg", "deg", "1/sr"],
        [30, -20.5, 0.5],
        [30, 30, 1.25e-3],
    ]
    found = read(workbook(tmp_path / "lab.xlsx", About=[["Lab 3"]], Scan=rows, Old=[["a", "b"], ["c", "d"]]))
    assert found.value.tolist() == [[0.5], [0.00125]]
    assert np.rad2deg(found.signed_theta_o) == pytest.approx([-20.5, 30.0], abs=1e-9)
    assert "Sheet Scan read. Not read: Old." in found.notes


def test_a_damaged_or_empty_workbook_is_refused(tmp_path):
    path = workbook(tmp_path / "lab.xlsx", A=[["x"]])
    with pytest.raises(ReadError, match=r"lab\.xlsx: no sheet with rows of cells"):
        read(path)
    path.write_bytes(path.read_bytes()[:-60])
    with pytest.raises(ReadError, match=r"lab\.xlsx: its Excel content cannot be read \(.*\), .* Save it as CSV"):
        read(path)


def test_a_workbook_without_its_package_says_what_to_install(tmp_path, monkeypatch):
    def missing(package: str) -> None:
        raise ImportError(package)

    path = workbook(tmp_path / "lab.xlsx", A=[["theta_i", "theta_o", "brdf"], [30, 20, 0.5]])
    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(FitmatError, match=r"lab\.xlsx: .*or save it as CSV.*pip install 'fitmat\[excel\]'"):
        read(path)
