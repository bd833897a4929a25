"""Pieces: a CSV or Parquet file of any length as a sequence of tables of bounded length.

It masks and converts nothing. Text that polars cannot take at once goes the way of small files, block by block.
"""

import codecs
import dataclasses
import itertools
import mmap
import os
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
import polars as pl

from fitmat.errors import ReadError
from fitmat.measurements.formats import parquet
from fitmat.measurements.parsing import cells, contents, footer
from fitmat.measurements.parsing.table import Table

TEXT_BLOCK = 2**23
"""Bytes of text that are read at once."""

_COMMENTS = (b"#", b"%", b"//", b";")
_WIDE = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def tables(path: str | os.PathLike[str], rows: int, words: str = "") -> Iterator[Table]:
    """The rows of a file in their order, as tables of at most so many; only one is in memory at a time.

    Args:
        path: A Parquet file or a text table.
        rows: Most rows of a table.
        words: Name of a column of text whose cells stay as they are written, were they numbers.

    Raises:
        ReadError: the file cannot be opened or is no table, or a line is not what it should be.
    """
    if parquet.claims(contents.contents(path, len(parquet.MAGIC)), contents.size(path)):
        yield from _parquet(path, rows)
        return
    for table in _text(path, words):
        for start in range(0, len(table.lines), rows):
            cells, lines = table.cells.slice(start, rows), table.lines[start : start + rows]
            yield dataclasses.replace(table, cells=cells, lines=lines)


def _parquet(path: str | os.PathLike[str], rows: int) -> Iterator[Table]:
    source = contents.name(path)
    with parquet.refused_if_damaged(source):
        lazy = pl.scan_parquet(Path(path), glob=False)
        plain = {name: kind for name, kind in lazy.collect_schema().items() if not _nested(kind)}
        lazy = lazy.select(pl.col(name).cast(_number_or_text(kind), strict=False) for name, kind in plain.items())
        count = lazy.select(pl.len()).collect().item()
        _refuse_contradictions(path, plain, count)
    if not count:
        raise ReadError(f"{source}: no rows, expected at least one measured value. Check how it was made.")
    for start in range(0, count, rows):
        with parquet.refused_if_damaged(source):
            cells = lazy.slice(start, rows).collect(engine="streaming")
        yield Table(source, tuple(plain), cells, np.arange(start + 1, start + 1 + cells.height))


def _refuse_contradictions(path: str | os.PathLike[str], names: Collection[str], rows: int) -> None:
    """Stop where a page announces more than it can hold: polars would ask for as much memory, and end the process.

    Raises:
        ValueError: as `footer.unpacked`.
    """
    with Path(path).open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as raw:
        footer.unpacked(raw, names, rows)


def _nested(kind: pl.DataType) -> bool:
    return kind.is_nested() or kind in (pl.Binary, pl.Object)


def _number_or_text(kind: pl.DataType) -> type[pl.DataType]:
    return pl.Float64 if kind.is_numeric() or kind in (pl.Boolean, pl.Null) else pl.String


@dataclasses.dataclass(frozen=True)
class _Layout:
    """How the rows of a text table are written, as its beginning shows.

    Attributes:
        head: The table at the beginning of the file.
        prelude: All bytes before the first row: header and comments.
        schema: A number or text for each column.
        separator: For polars; None where only `text` can read the rows.
        decimal_comma: For polars.
    """

    head: Table
    prelude: bytes
    schema: dict[str, type[pl.DataType]]
    separator: str | None = None
    decimal_comma: bool = False


def _text(path: str | os.PathLike[str], words: str) -> Iterator[Table]:
    layout = _layout(path, words)
    first = int(layout.head.lines[0])
    for block in _raw(path, len(layout.prelude)):
        cells = _quick(block, layout)
        if cells is None:
            yield from _thorough(block, layout, first)
        else:
            yield dataclasses.replace(layout.head, cells=cells, lines=first + np.arange(cells.height))
        first += block.count(b"\n")


def _raw(path: str | os.PathLike[str], start: int) -> Iterator[bytes]:
    """The file from a byte on, in blocks of whole lines."""
    with contents.opened(path) as file:
        file.seek(start)
        rest = b""
        while read := file.read(TEXT_BLOCK):
            cut = read.rfind(b"\n") + 1
            if not cut and len(read) == TEXT_BLOCK:
                got = f"no line end within {TEXT_BLOCK} bytes, expected rows"
                raise ReadError(f"{contents.name(path)}: {got}. Is it a table of text?")
            if cut:
                yield rest + read[:cut]
                rest = b""
            rest += read[cut:]
        if rest:
            yield rest


def _layout(path: str | os.PathLike[str], words: str) -> _Layout:
    source, raw = contents.name(path), contents.contents(path, contents.HEAD)
    if raw.startswith(_WIDE) or b"\r" in raw[:-1].replace(b"\r\n", b""):
        got = "UTF-16, or carriage returns alone as line ends"
        raise ReadError(f"{source}: {got}, expected UTF-8 and line feeds in so large a file. Save it so.")
    if contents.size(path) > len(raw):
        raw = raw[: raw.rfind(b"\n") + 1] or raw
    content, notes = contents.decoded(raw, source)
    head = cells.parse(content, source, notes)
    prelude = b"".join(raw.splitlines(keepends=True)[: head.lines[0] - 1])
    kinds = (pl.String if words and name == words else _kind(head, k) for k, name in enumerate(head.names))
    layout = _Layout(head, prelude, {f"{k}": kind for k, kind in enumerate(kinds)})
    for separator, comma in itertools.product(",;\t", (False, True)):
        trial = dataclasses.replace(layout, separator=separator, decimal_comma=comma)
        if _agrees(trial, raw[len(prelude) :]):
            return trial
    return layout


def _kind(head: Table, column: int) -> type[pl.DataType]:
    try:
        head.numbers(column)
    except ReadError:
        return pl.String
    return pl.Float64


def _agrees(layout: _Layout, rows: bytes) -> bool:
    """Whether polars reads the rows as `text` did."""
    cells = _quick(rows, layout)
    if cells is None or cells.height != len(layout.head.lines):
        return False
    quick = dataclasses.replace(layout.head, cells=cells)
    numbers = [k for k, kind in enumerate(layout.schema.values()) if kind == pl.Float64]
    return all(np.array_equal(quick.numbers(k), layout.head.numbers(k), equal_nan=True) for k in numbers)


def _quick(block: bytes, layout: _Layout) -> pl.DataFrame | None:
    """The block's cells if all of them are plain; None where polars stumbles or may have passed over a short row."""
    if layout.separator is None or (layout.decimal_comma and b"." in block):
        return None
    try:
        cells = pl.read_csv(
            block,
            has_header=False,
            schema=layout.schema,
            separator=layout.separator,
            decimal_comma=layout.decimal_comma,
            quote_char=None,
        )
    except pl.exceptions.PolarsError:
        return None
    return None if cells.to_series(-1).null_count() else cells


def _thorough(block: bytes, layout: _Layout, first: int) -> Iterator[Table]:
    """The block as `text` reads it, below the prelude; nothing where it is all comments."""
    if all(not line.strip(b" \t,;\r") or line.lstrip().startswith(_COMMENTS) for line in block.split(b"\n")):
        return
    head, above = layout.head, layout.prelude.count(b"\n")
    content, notes = contents.decoded(layout.prelude + block, head.source)
    table = cells.parse(content, head.source, notes, above=first - above - 1)
    cells.refuse_other_commas(table, head)
    stated = (*head.stated, *(comment for comment in table.stated if comment[2] >= first))
    table = dataclasses.replace(table, names=head.names, stated=stated)
    if table.cells.width != len(head.names):
        got = f"{table.cells.width} cells, expected {len(head.names)} as in row {head.lines[0]}"
        raise ReadError(f"{table.source} row {table.lines[0]}: {got}. Correct the line, or put # before it.")
    yield table
