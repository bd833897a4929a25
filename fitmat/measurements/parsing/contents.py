"""Files: the bytes and the text of a user's file, or one sentence about why there are none.

It knows no format.
"""

import codecs
import contextlib
import gzip
import itertools
import os
import re
import stat
import tempfile
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

from fitmat.errors import ReadError
from fitmat.measurements.parsing import foreign
from fitmat.text import for_shell, visible

HEAD = 65_536
"""Bytes by which a format is recognised."""

STREAMED = 1 << 28
"""Bytes that a stream may hold."""

MOST_UNPACKED = 1 << 28
"""Bytes to which a packed file may unpack; larger tables are read block by block, from an unpacked file."""

_GZIP = b"\x1f\x8b\x08"
_BOMS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
_LEGACY = "cp1252"
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f]")


def shown(text: str, longest: int = 40) -> str:
    """Text of the user's as messages show it: in one line, not long, without what a terminal would obey."""
    begin = " ".join(text[: 8 * longest].split())
    return visible(begin[:longest]) + ("…" if len(begin) > longest or len(text) > 8 * longest else "")


def listed(names: Iterable[str], most: int = 20) -> str:
    """Names with commas between, the first ones only where there are many."""
    every = list(filter(None, names))
    return ", ".join(shown(name) for name in every[:most]) + (" …" if len(every) > most else "")


def name(path: str | os.PathLike[str]) -> str:
    """The file's name as messages show it."""
    return visible(Path(path).name)


def is_stream(path: str | os.PathLike[str]) -> bool:
    """Whether a path can be read but once: a pipe, a FIFO, a terminal."""
    try:
        kind = os.stat(path).st_mode
    except (OSError, ValueError):
        return False
    return stat.S_ISFIFO(kind) or stat.S_ISCHR(kind) or stat.S_ISSOCK(kind)


@contextlib.contextmanager
def on_disk(path: str | os.PathLike[str]) -> Iterator[str | os.PathLike[str]]:
    """A file that can be read again and again: the path itself, or what a stream gives, as a file of its name.

    Raises:
        ReadError: a stream cannot be read, is longer than `STREAMED`, or there is no room for it.
    """
    if not is_stream(path):
        yield path
        return
    try:
        with Path(path).open("rb") as file:
            content = file.read(STREAMED + 1)
    except OSError as error:
        raise _unopened(path, error) from error
    if len(content) > STREAMED:
        got = f"a stream of more than {STREAMED >> 20} MB"
        raise ReadError(f"{name(path)}: {got}, expected a file where there is so much. Save it first.")
    with contextlib.ExitStack() as kept:
        try:
            copy = Path(kept.enter_context(tempfile.TemporaryDirectory(prefix="fitmat-"))) / Path(path).name
            copy.write_bytes(content)
        except OSError as error:
            got = f"a stream that cannot be kept in {tempfile.gettempdir()} ({error.strerror})"
            raise ReadError(f"{name(path)}: {got}, expected room for it. Save it as a file first.") from error
        yield copy


def size(path: str | os.PathLike[str]) -> int:
    """Bytes in the file, of one packed by gzip when unpacked.

    Raises:
        ReadError: it cannot be opened, it is empty, or it unpacks to more than is held in memory.
    """
    with opened(path) as file:
        if isinstance(file, gzip.GzipFile):
            count = sum(map(len, itertools.takewhile(len, (file.read(HEAD) for _ in range(MOST_UNPACKED // HEAD)))))
        else:
            count = file.seek(0, os.SEEK_END)
    if count == MOST_UNPACKED:
        expected = f"expected less than {MOST_UNPACKED >> 20} MB from a packed file"
        raise ReadError(f"{name(path)}: unpacks to more, {expected}. Unpack it first: gunzip -k {for_shell(path)}")
    if not count:
        raise ReadError(f"{name(path)}: the file is empty (0 bytes), expected measurements. Was its download cut off?")
    return count


def contents(path: str | os.PathLike[str], first: int = -1) -> bytes:
    """All bytes of a file, or its first ones.

    Raises:
        ReadError: it cannot be opened, or it is empty.
    """
    size(path)
    with opened(path) as file:
        return file.read(first)


@contextlib.contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[BinaryIO | gzip.GzipFile]:
    """The bytes of a file; those of one that gzip packed, unpacked.

    Raises:
        ReadError: it cannot be opened, or what gzip packed is damaged.
    """
    try:
        with Path(path).open("rb") as file:
            packed = file.read(len(_GZIP)) == _GZIP
            file.seek(0)
            yield gzip.GzipFile(fileobj=file) if packed else file
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        expected = "expected a whole .gz file. Was its download cut off?"
        raise ReadError(f"{name(path)}: its gzip content is damaged ({error}), {expected}") from error
    except (OSError, ValueError) as error:
        raise _unopened(path, error) from error


def _unopened(path: str | os.PathLike[str], error: Exception) -> ReadError:
    if isinstance(error, FileNotFoundError):
        return ReadError(f"{path}: no such file, expected measurements. Check the path.")
    if isinstance(error, IsADirectoryError):
        return ReadError(f"{path}: a directory, expected a file. Name one file in it.")
    reason = getattr(error, "strerror", None) or error
    return ReadError(f"{path}: cannot be opened ({reason}), expected a readable file. Check its rights.")


def decoded(raw: bytes, source: str) -> tuple[str, tuple[str, ...]]:
    """Bytes as text, and a note where the encoding had to be guessed.

    Raises:
        ReadError: they are no text, or that of another program.
    """
    foreign.refuse(raw[:HEAD], source)
    stated = [encoding for bom, encoding in _BOMS.items() if raw.startswith(bom)]
    for encoding in stated or ["utf-8", _LEGACY]:
        try:
            text = raw.decode(encoding)
        except UnicodeDecodeError:
            continue
        if _CONTROL.search(text):
            break
        return text, ("The file is not UTF-8; read as Windows-1252.",) if encoding == _LEGACY else ()
    expected = "expected text (UTF-8, or UTF-16 with a byte-order mark) or a format that fitmat knows"
    raise ReadError(f"{source}: a binary file or an unknown encoding, {expected}. Export it as CSV.")
