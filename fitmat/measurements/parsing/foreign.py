"""Foreign: whose file this is, where its first bytes say that it holds no table that fitmat reads, and what to do.

It opens nothing and reads no number.
"""

import re

from fitmat.errors import ReadError

_PYTHON = "Load it in Python and pass the arrays to fitmat.read"
_TABLE = "Export its numbers as CSV"

_KINDS: tuple[tuple[bytes, str, str], ...] = (
    (rb"PK\x03\x04.*mimetypeapplication/vnd\.oasis", "an OpenDocument file", "Save the sheet as .xlsx or CSV"),
    (rb"PK\x03\x04.*\bword/", "a Word document", "Save its table as CSV"),
    (rb"PK\x03\x04.*\.npy", "an archive of NumPy arrays (.npz)", _PYTHON),
    (rb"PK(\x03\x04|\x05\x06)", "a ZIP archive", "Unpack it and name the file of the measurements"),
    (rb"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an Excel workbook of the old kind (.xls)", "Save it as .xlsx or CSV"),
    (rb"7z\xbc\xaf|Rar!|.{257}ustar", "an archive", "Unpack it and name the file of the measurements"),
    (rb"BZh[1-9]1AY|\xfd7zXZ\x00|\x28\xb5\x2f\xfd|\x1f\x9d", "a compressed file", "Unpack it; .gz is read as it is"),
    (rb"MATLAB (5\.0|7\.3) MAT-file", "a MATLAB file (.mat)", "Write it as CSV in MATLAB (writetable)"),
    (rb"\x89HDF\r\n\x1a\n", "an HDF5 or NetCDF file", "Open it with xarray and pass that to fitmat.read in Python"),
    (rb"CDF[\x01\x02\x05]", "a NetCDF file", "Open it with xarray and pass that to fitmat.read in Python"),
    (rb"\x93NUMPY", "a NumPy array (.npy)", _PYTHON),
    (rb"\x80[\x02-\x05].*\.$", "a Python pickle, which is never loaded since it may run a program", _TABLE),
    (rb"ARROW1|SQLite format 3", "a data base or an Arrow file", "Write it as Parquet or CSV"),
    (rb"%PDF-", "a PDF document", _TABLE),
    (rb"\{\\rtf", "a text document (RTF)", "Save it as plain text"),
    (
        rb"\x89PNG|\xff\xd8\xff|GIF8|II\*\x00|MM\x00\*|BM.{4}\x00\x00\x00\x00|\x76\x2f\x31\x01|#\?RADIANCE",
        "a picture",
        "Name the file of the numbers behind it",
    ),
    (rb"\s*<(!doctype html|html)", "a web page (HTML)", "Was a login page downloaded instead? Save its table as CSV"),
    (rb"\s*<\?xml|\s*<[a-z][\w:]*[ >]", "an XML file", _TABLE),
    (rb'\s*(\{\s*"|\[\s*[\[{])', "a JSON file", f"{_PYTHON} as a dict, or write it as CSV"),
    (rb"\s*OPTIS\b", "a file of Ansys Speos", "Export the BSDF there as text with theta_i, theta_o, phi and values"),
    (rb"\s*TracePro\b", "a file of TracePro", "Copy its BSDF table into a CSV with theta_i, theta_o, phi and brdf"),
)
"""How a file begins, what it is, and what to do with it; the first that fits."""


def refuse(head: bytes, source: str) -> None:
    """Stop at a file of another program.

    Raises:
        ReadError: what it is, and what to do with it.
    """
    head = head.removeprefix(b"\xef\xbb\xbf")
    for begin, what, remedy in _KINDS:
        if re.match(b"(?is)" + begin, head):
            raise ReadError(f"{source}: {what}, expected a table or a format that fitmat reads. {remedy}.")
