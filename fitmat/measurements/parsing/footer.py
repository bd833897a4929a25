"""Footer: to how many bytes the columns of a Parquet file unpack, by the headers of their pages.

It unpacks nothing and believes no count that the file cannot hold.

Layout: the Parquet format specification (apache/parquet-format, `parquet.thrift`), in Thrift's compact protocol
(apache/thrift, `thrift-compact-protocol.md`): the file ends with its FileMetaData, their length as little-endian
uint32, and "PAR1"; each page is headed by a PageHeader that states its sizes.
"""

from collections.abc import Collection, Iterator
from mmap import mmap
from typing import Any

_DEEPEST = 16
_TAIL = 8
_GROUPS, _CHUNKS, _CHUNK, _PATH, _SIZE, _DATA, _DICTIONARY = 4, 1, 3, 3, 7, 9, 11
_UNPACKED, _PACKED = 2, 3
_ENCODINGS = 16


def unpacked(raw: bytes | mmap, names: Collection[str], rows: int) -> int:
    """Bytes of all pages of the columns of these names, which hold plain cells.

    Args:
        raw: All bytes of the file, or a map of it.
        names: Of the columns.
        rows: Of the file; no page may announce more values.

    Raises:
        ValueError: the footer or a page's header contradicts itself or the file's size.
    """
    end = len(raw) - _TAIL
    begin = end - int.from_bytes(raw[end : end + 4], "little")
    if begin < 0:
        raise ValueError("the footer is longer than the file")
    groups = _Compact(raw[begin:end], 0).structure().get(_GROUPS, [])
    total = 0
    for count, size in enumerate(_pages(raw, groups, {name.encode() for name in names}, rows)):
        if count > len(raw):
            raise ValueError("the pages overlap")
        total += size
    return total


def _pages(raw: bytes | mmap, groups: Any, names: set[bytes], rows: int) -> Iterator[int]:
    """Unpacked size of each page."""
    for chunk in (chunk for group in _structures(groups) for chunk in _structures(group.get(_CHUNKS))):
        (about,) = _structures([chunk.get(_CHUNK)]) or [{}]
        path = about.get(_PATH)
        if not isinstance(path, list) or not path or not isinstance(path[0], bytes) or path[0] not in names:
            continue
        starts = [_whole(about, key) for key in (_DATA, _DICTIONARY) if key in about]
        at = min(filter(None, starts), default=len(raw))
        end = min(at + _whole(about, _SIZE), len(raw))
        while at < end:
            page = _Compact(raw, at)
            head = page.structure()
            size, packed = _sizes(head, rows)
            yield size
            at = page.at + packed


def _sizes(head: dict[int, Any], rows: int) -> tuple[int, int]:
    """Unpacked and packed size of a page, whose other counts must be of that order."""
    size, packed = _whole(head, _UNPACKED), _whole(head, _PACKED)
    most = max(size, rows, _ENCODINGS)
    for part in _structures([*head.values()]):
        if any(_whole(part, key) > most for key, count in part.items() if isinstance(count, int)):
            raise ValueError("a page announces more values than the file has rows")
    return size, packed


def _whole(found: dict[int, Any], key: int) -> int:
    """A field that must be a number from 0."""
    count = found.get(key)
    if not isinstance(count, int) or count < 0:
        raise ValueError("a count or size is missing or negative")
    return count


def _structures(found: Any) -> list[dict[int, Any]]:
    return [part for part in found if isinstance(part, dict)] if isinstance(found, list) else []


class _Compact:
    """Values of Thrift's compact protocol, one after the other.

    Attributes:
        at: The next byte.
    """

    def __init__(self, raw: bytes | mmap, at: int) -> None:
        self._raw, self.at = raw, at

    def structure(self, depth: int = 0) -> dict[int, Any]:
        """Number → value of the fields of a structure."""
        found: dict[int, Any] = {}
        number = 0
        while (head := self._take(1)[0]) != 0:
            number = number + (head >> 4) if head >> 4 else self._signed()
            kind = head & 15
            found[number] = kind == 1 if kind in (1, 2) else self._value(kind, depth + 1)
        return found

    def _value(self, kind: int, depth: int) -> Any:
        if depth > _DEEPEST:
            raise ValueError("nested too deeply")
        match kind:
            case 1 | 2 | 3:
                return self._take(1)[0]
            case 4 | 5 | 6:
                return self._signed()
            case 7:
                return self._take(8)
            case 8:
                return self._take(self._count())
            case 9 | 10:
                head = self._take(1)[0]
                length = self._count() if head >> 4 == 15 else head >> 4
                return [self._value(head & 15, depth + 1) for _ in range(length)]
            case 11:
                kinds = self._take(1)[0] if (length := self._count()) else 0
                return [self._value(part, depth + 1) for _ in range(length) for part in (kinds >> 4, kinds & 15)]
            case 12:
                return self.structure(depth)
        raise ValueError(f"type {kind} in the footer")

    def _take(self, count: int) -> bytes:
        found = self._raw[self.at : self.at + count]
        if len(found) < count:
            raise ValueError("the footer or a page is cut off")
        self.at += count
        return found

    def _count(self) -> int:
        found = 0
        for shift in range(0, 64, 7):
            byte = self._take(1)[0]
            found |= (byte & 127) << shift
            if byte < 128:
                return found
        raise ValueError("a number of more than 64 bits")

    def _signed(self) -> int:
        found = self._count()
        return (found >> 1) ^ -(found & 1)
