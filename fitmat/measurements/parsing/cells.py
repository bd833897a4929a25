"""Text of a table: text → lines → cells, whatever the delimiter, decimal mark, comments or header.

It knows no column name and converts no number; a ragged row is refused, never repaired.
"""

import dataclasses
import os
import re

import polars as pl

from fitmat.errors import ReadError
from fitmat.measurements.parsing import contents, units
from fitmat.measurements.parsing.table import ERROR_VALUES, MISSING, Table
from fitmat.measurements.parsing.wavelengths import wavelength

WIDEST = 4096
"""A table of more columns is refused; those of spectrometers have up to 2,000 channels."""

_SPACED = re.compile(r"\d\s+[-+.]?\d")
_COMMENT = r"^\s*(#|%|//)"
_ERROR_VALUE = rf"(?i)^\s*({'|'.join(map(re.escape, ERROR_VALUES))})\s*([,;\t]|[-+.\d#]|$)"
_STATED = r"(?i)^\s*[#%;/]+\s*(\pL[^=:\d]*?)\s*[=:\s]\s*([-+]?\d+(?:\.\d*)?)\s*(?:°|deg|degrees?|nm|([uµμ]m))?\s*$"
_SEMICOLON = r"^\s*;"
_BLANK = r"^[\s,;]*$"
_QUOTED = r'"[^"]*"'
_NUMBER = re.compile(r"[-+−]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][-+]?\d+)?|[-+]?(?i:inf|infinity)")
_SEPARATOR = re.compile(r'(?i)^\s*"?sep=(.)"?\s*$')
_SAMPLE, _NOTES = 20, 200
_DECIMAL_COMMA = r"^[-+−]?\d*,\d+([eEdD][-+]?\d+)?$"
_GROUPED = r"^[-+−]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?$"
_SURELY_GROUPED = r"^[-+−]?([1-9]\d*|[1-9]\d{0,2}(,\d{3}){2,}|[1-9]\d{0,2}(,\d{3})+\.\d*)$"
_THOUSANDS = "Commas read as thousands separators in:"
_DECIMAL_POINT = r"^[-+−]?\d*\.\d+([eEdD][-+]?\d+)?$"


def load(path: str | os.PathLike[str]) -> Table:
    """The table in a text file, its cells as text.

    Raises:
        ReadError: the file cannot be opened, is no text, or is no table of at least one row.
    """
    source = contents.name(path)
    text, notes = contents.decoded(contents.contents(path), source)
    return parse(text, source, notes)


def parse(text: str, source: str, notes: tuple[str, ...], above: int = 0) -> Table:
    """The table in a text whose first line is line `above` + 1 of its file."""
    lines = pl.DataFrame({"text": re.split(r"\r\n|\r|\n", text)}).with_row_index("line", offset=1 + above)
    lines = lines.filter(~pl.col("text").str.contains(_BLANK))
    rows, comments, delimiter, told = _laid_out(lines)
    if rows.is_empty():
        expected = "expected a header line and rows of numbers. Is it the right file?"
        raise ReadError(f"{source}: nothing but comments or blank lines, {expected}")
    rows = rows.with_columns(text=_tidy(rows["text"], delimiter))
    _refuse_ragged(rows, delimiter or "\t", source)
    cells = _cells(rows, delimiter or "\t", source)
    before = comments.filter((comments["line"] < rows["line"][0]) & comments["text"].str.contains(r"\pL"))
    names = tuple(cells.row(0))
    _refuse_missing_names(names, source, int(rows["line"][0]))
    if any(_is_number(cell) for cell in names) and not _names_wavelengths(cells):
        names = _commented(before["text"].tail(1).to_list(), delimiter, cells.width)
    else:
        rows, cells = rows.slice(1), cells.slice(1)
    if cells.height and units.is_row(below := cells.row(0)):
        told = (*told, f"Row {rows['line'][0]} read as units: {contents.listed(below)}.")
        names = tuple(units.named(*pair) for pair in zip(names, below, strict=True))
        rows, cells = rows.slice(1), cells.slice(1)
    if cells.is_empty():
        expected = "expected rows of numbers below it. Is the file complete?"
        raise ReadError(f"{source}: a header and no rows ({contents.listed(names)}), {expected}")
    stated = _stated(comments)
    table = Table(source, names, cells, rows["line"].to_numpy(), (*notes, *told), stated)
    if delimiter == ",":
        table = _without_thousands(table)
    _refuse_mixed_decimals(table)
    return table


def _laid_out(lines: pl.DataFrame) -> tuple[pl.DataFrame, pl.DataFrame, str | None, tuple[str, ...]]:
    """The lines from the header on, the comments, what separates the cells, and what stood above the header."""
    comment = lines["text"].str.contains(_COMMENT) & ~lines["text"].str.contains(_ERROR_VALUE)
    given = _SEPARATOR.match(lines["text"][0]) if len(lines) else None
    if given:
        lines, comment = lines.slice(1), comment.slice(1)
    sample = lines.filter(~comment)["text"].head(_SAMPLE).to_list()
    if (given[1] if given else _delimiter(sample)) != ";":
        comment |= lines["text"].str.contains(_SEMICOLON)
    delimiter, above = _delimiter_and_notes(lines.filter(~comment)["text"].head(_NOTES).to_list(), given)
    rows = lines.filter(~comment)
    if not above:
        return rows, lines.filter(comment), delimiter, ()
    notes = rows.head(above)
    told = contents.listed(" ".join(line.split()) for line in notes["text"])
    # A note states a number as a comment does, in one cell or in two: "Incident angle: 30", "theta_i;30;;".
    plain = notes["text"].str.strip_chars(" \t,;").str.replace(r"^([^=:,;\t]+)[,;\t]", "${1}=")
    comments = pl.concat([lines.filter(comment), notes.with_columns(text="# " + plain)])
    return rows.slice(above), comments, delimiter, (f"Read as notes, above the header: {told}.",)


def _delimiter(lines: list[str]) -> str | None:
    """Tab, semicolon or comma, whichever at least half of the lines hold; None stands for white space."""
    lines = [re.sub(_QUOTED, "", line).strip() for line in lines if not re.match(_SEMICOLON, line)]
    decimal_commas = not lines or _SPACED.search(lines[0]) or "," not in lines[0]
    for mark in "\t;" if decimal_commas else "\t;,":
        if 0 < len(lines) <= 2 * sum(mark in line for line in lines):
            return mark
    return None


def _delimiter_and_notes(lines: list[str], given: re.Match[str] | None) -> tuple[str | None, int]:
    """What separates the cells, and how many lines above the header are no part of the table.

    The header is the line above the first numbers, or above the units above them, if it has as many cells as these.
    """
    first = next((k for k, line in enumerate(lines) if _is_data(line)), 0)
    for head in (first - 1, first - 2):
        below = lines[max(head, 0) :]
        delimiter = given[1].strip(" ") or None if given else _delimiter(below[:_SAMPLE])
        cells = [[cell.strip() for cell in re.sub(_QUOTED, "x", line).split(delimiter)] for line in below[:3]]
        if head > 0 and len({len(row) for row in cells}) == 1 < len(cells[0]):
            words = not any(_is_number(cell) for cell in cells[0])
            if words and (head == first - 2 or not units.is_row(tuple(cells[0]))):
                return delimiter, head
    return given[1].strip(" ") or None if given else _delimiter(lines[:_SAMPLE]), 0


def _is_data(line: str) -> bool:
    """Whether most words of a line are numbers."""
    words = re.split(r"[,;\t\s]+", line.replace('"', " ").strip())
    return len(words) > 1 and 2 * sum(bool(_NUMBER.fullmatch(word)) for word in words) > len(words)


def _tidy(lines: pl.Series, delimiter: str | None) -> pl.Series:
    """White space as one tab; no blanks between delimiter and quote, which CSV forbids and people write."""
    if delimiter is None:
        return lines.str.strip_chars().str.replace_all(r"\s+", "\t")
    if lines.str.contains('"', literal=True).any():
        return lines.str.replace_all(rf'(^|{re.escape(delimiter)}) *("(?:[^"]|"")*") *', "${1}${2}")
    return lines


def _refuse_ragged(rows: pl.DataFrame, delimiter: str, source: str) -> None:
    text = rows["text"].str.replace_all(_QUOTED, "")
    counts = text.str.count_matches(delimiter, literal=True) + 1
    for row in (text.str.contains('"', literal=True)).arg_true()[:1]:
        got = 'a quote (") without its end, expected pairs'
        raise ReadError(f"{source} row {rows['line'][row]}: {got}. Remove it.")
    if counts[0] > WIDEST:
        expected = f"expected at most {WIDEST}, one for each angle and channel. Is it a table?"
        raise ReadError(f"{source} row {rows['line'][0]}: {counts[0]} cells, {expected}")
    for row in (counts != counts[0]).arg_true()[:1]:
        got = f"{counts[row]} cells, expected {counts[0]} as in row {rows['line'][0]}"
        raise ReadError(f"{source} row {rows['line'][row]}: {got}. Correct the line, or put # before it.")


def _cells(rows: pl.DataFrame, delimiter: str, source: str) -> pl.DataFrame:
    content = "\n".join(rows["text"].to_list()).encode()
    try:
        cells = pl.read_csv(content, separator=delimiter, has_header=False, infer_schema=False)
    except pl.exceptions.PolarsError as error:
        reason = contents.shown(str(error), 200)
        got = f"not a table ({reason}), expected plain cells"
        raise ReadError(f"{source}: {got}. Remove the quotes.") from error
    return cells.select(pl.all().fill_null("").str.strip_chars())


def _refuse_missing_names(names: tuple[str, ...], source: str, line: int) -> None:
    """Stop at a header in which a column has a name that means an empty cell, as "NA" does."""
    missing = [cell.lower() in MISSING[1:] for cell in names]
    words = [not lost and cell != "" and not _is_number(cell) for cell, lost in zip(names, missing, strict=True)]
    if any(missing) and any(words) and all(lost or word for lost, word in zip(missing, words, strict=True)):
        place = missing.index(True)
        got = f"column {place + 1} is named {names[place]}, which means empty"
        raise ReadError(f"{source} row {line}: {got}, expected a name. Rename it.")


def _is_number(cell: str) -> bool:
    return bool(_NUMBER.fullmatch(cell)) or cell.lower() in MISSING[1:]


def _stated(comments: pl.DataFrame) -> tuple[tuple[str, float, int], ...]:
    """Name, number and line of the comments that state a number by name; of one in µm in nm."""
    parts = comments["text"].str.extract_groups(_STATED).struct.unnest()
    known = parts.with_columns(comments["line"]).filter(parts.to_series(0).is_not_null())
    return tuple(
        (str(name).strip(), round(1000 * float(number), 6) if micron else float(number), int(line))
        for name, number, micron, line in known.rows()
    )


def _names_wavelengths(cells: pl.DataFrame) -> bool:
    """Whether the first row is a header in which bare numbers are wavelengths: words in it stand above numbers."""
    first, second = cells.row(0), cells.row(min(1, cells.height - 1))
    words = [not _is_number(cell) and cell != "" for cell in first]
    above = [_is_number(below) for below, word in zip(second, words, strict=True) if word]
    numbers = [cell for cell, word in zip(first, words, strict=True) if not word]
    return bool(above) and all(above) and all(wavelength(cell) for cell in numbers)


def _commented(comments: list[str], delimiter: str | None, width: int) -> tuple[str, ...]:
    """Column names from the last comment line, where it has as many words as there are columns."""
    for line in comments:
        bare = re.sub(r"^\s*(#|%|//|;)+", "", line).strip()
        for words in (bare.split(delimiter), bare.split()):
            if len(words) == width:
                return tuple(word.strip() for word in words)
    return ("",) * width


def _without_thousands(table: Table) -> Table:
    """The table with "10,691" as 10691, where the commas of its numbers have three digits behind them.

    "0,123" is a decimal comma. So is "10,691", unless the same columns have whole numbers without a comma, more commas
    than one or a point; where nothing tells, the user is asked.

    Raises:
        ReadError: the commas may be either.
    """
    texts = [table.cells.to_series(k) for k in range(len(table.names))]
    commas = [text.str.contains(_DECIMAL_COMMA) | text.str.contains(_GROUPED) for text in texts]
    places = [k for k, comma in enumerate(commas) if comma.any()]
    if not places or not all(texts[k].filter(commas[k]).str.contains(_GROUPED).all() for k in places):
        return table
    sure = any(texts[k].str.contains(_SURELY_GROUPED).any() for k in places)
    if not sure:
        expected = (
            "a number that can be read in one way: it may be {} or {}. Write it without the comma, or with a point"
        )
        cell = str(texts[places[0]].filter(commas[places[0]])[0])
        meant = expected.format(cell.replace(",", ""), cell.replace(",", "."))
        table.refuse(places[0], commas[places[0]].to_numpy(), f"{meant}.")
    plain = [texts[k].str.replace_all(",", "") if k in places else texts[k] for k in range(len(texts))]
    named = contents.listed([table.names[k] or str(k + 1) for k in places])
    note = f"{_THOUSANDS} {named}."
    return dataclasses.replace(table, cells=pl.DataFrame(plain), notes=(*table.notes, note))


def refuse_other_commas(part: Table, head: Table) -> None:
    """Stop where the commas of a part of a file are read otherwise than those of its head.

    Raises:
        ReadError: in one of them they separate thousands, in the other decimals.
    """
    grouped, decimal = ([of(table) for table in (part, head)] for of in (_has_thousands, _has_commas))
    if (grouped[0] and decimal[1]) or (grouped[1] and decimal[0]):
        got = "commas that separate thousands here, or above, and decimals elsewhere"
        raise ReadError(
            f"{part.source} row {part.lines[0]}: {got}, expected one reading. Write numbers without commas."
        )


def _has_thousands(table: Table) -> bool:
    return any(note.startswith(_THOUSANDS) for note in table.notes)


def _has_commas(table: Table) -> bool:
    return any(table.cells.select(pl.all().str.contains(_DECIMAL_COMMA).any()).row(0))


def _refuse_mixed_decimals(table: Table) -> None:
    if not any(table.cells.select(pl.all().str.contains(",", literal=True).any()).row(0)):
        return
    if any(table.cells.select(pl.all().str.contains(_DECIMAL_POINT).any()).row(0)):
        for column, commas in enumerate(table.cells.select(pl.all().str.contains(_DECIMAL_COMMA))):
            expected = "one decimal mark in the file, which also has points. Write all numbers with a point."
            table.refuse(column, commas.to_numpy(), expected)
