"""Excel: the first sheet of an .xlsx workbook that holds something, as a `Table`.

It knows no column name, and reads cells, not the formulas or pictures behind them.
"""

import os

from fitmat.errors import ReadError
from fitmat.extras import needed
from fitmat.measurements.parsing import cells, contents
from fitmat.measurements.parsing.table import Table


def claims(head: bytes, size: int) -> bool:
    """Whether the file is a ZIP archive with the parts of a workbook."""
    return head.startswith(b"PK\x03\x04") and b"xl/" in head


def load(path: str | os.PathLike[str]) -> Table:
    """The cells as text, read like those of a text table: notes above the header, units below it, comments.

    Raises:
        FitmatError: the package that reads workbooks is missing.
        ReadError: the workbook is damaged, or no sheet holds a table.
    """
    source = contents.name(path)
    excel = needed("fastexcel", f"{source}: reading an Excel workbook (or save it as CSV)")
    try:
        book = excel.read_excel(contents.contents(path))
        sheets = {
            name: book.load_sheet(name, header_row=None, dtypes="string").to_polars() for name in book.sheet_names
        }
    except excel.FastExcelError as error:
        reason = contents.shown(str(error).partition("\n")[0], 200)
        expected = "expected a whole workbook without a password. Save it as CSV"
        raise ReadError(f"{source}: its Excel content cannot be read ({reason}), {expected}.") from error
    filled = [name for name, sheet in sheets.items() if sheet.height > 1 and sheet.width > 1]
    if not filled:
        raise ReadError(f"{source}: no sheet with rows of cells, expected a table. Is it the right workbook?")
    rows = sheets[filled[0]].fill_null("").rows()
    text = "\n".join("\t".join(" ".join(cell.replace('"', " ").split()) for cell in row) for row in rows)
    left = f" Not read: {contents.listed(filled[1:])}." if filled[1:] else ""
    return cells.parse(text, source, (f"Sheet {contents.shown(filled[0])} read.{left}",))
