"""SSDD: surface scattering distribution data of libbsdf, ASCII or binary.

It reads the block of the BRDF and no other, and writes nothing.

The layout is that of R. Kimura, "Surface scattering distribution data (SSDD) file format", version 0.2 (libbsdf,
`doc/SsddFileFormatSpecification.md`): lines of a keyword and its value up to DATA, with four lists of angles in
degrees, PARAM0 to PARAM3; then the values, PARAM0 fastest, as one line for each colour, or as little-endian float32.
Angles are those of libbsdf's spherical, half-difference or specular system, whose azimuth 0 points from the mirror
direction towards the normal.
"""

import dataclasses
import math
import os
import re
from collections.abc import Iterator, Mapping

import numpy as np
import polars as pl
from jaxtyping import Float

from fitmat.errors import ReadError
from fitmat.maths.directions import from_angles
from fitmat.measurements.parsing import blocks, contents
from fitmat.measurements.parsing.recording import Recording
from fitmat.measurements.samples import default_channels
from fitmat.text import brief

COLOURS = {"monochrome": default_channels(1), "rgb": ("r", "g", "b"), "xyz": ("x", "y", "z"), "spectrum": ()}
"""COLOR_MODEL → channels; a spectrum has those of WAVELENGTH_LIST."""

SYSTEMS = ("spherical_coordinate_system", "specular_coordinate_system", "half_difference_coordinate_system")
"""PARAM_TYPE that determine both directions as published."""

LISTS = tuple(f"PARAM{k}_LIST" for k in range(4))

_LIMITS = ((0.0, 90.0), (-360.0, 360.0), (0.0, 180.0), (-360.0, 360.0))
_ENTRY = re.compile(r"^([A-Z][A-Z0-9_]*)[ \t]+(\S.*)$", re.MULTILINE)
_DATA = re.compile(rb"^DATA[ \t]+(\w+)\b[^\n]*\n", re.MULTILINE)
_TYPE = re.compile(rb"^DATA_TYPE[ \t]", re.MULTILINE)
_FLOAT = np.dtype("<f4")


def claims(head: bytes, size: int) -> bool:
    """Whether lines VERSION and DATA_TYPE are there."""
    return blocks.begins(head, rb"VERSION[ \t]+\d", rb"DATA_TYPE[ \t]+\w")


def load(path: str | os.PathLike[str]) -> Recording:
    """One row for each cell, PARAM0 slowest and PARAM2 fastest; the light at the azimuths of PARAM1, by default 0.

    Raises:
        ReadError: there is no BRDF, an entry is missing or unknown, or the values are fewer or more than the cells.
    """
    source, raw = contents.name(path), contents.contents(path)
    others: set[str] = set()
    for block in _blocks(raw, source):
        kind = block.entries.get("DATA_TYPE", "(none)")
        if kind == "brdf":
            return _recording(block)
        others.add(kind)
    got = f"data of type {blocks.shown(', '.join(sorted(others)))}" if others else "no line DATA"
    expected = "expected a block of data of type brdf, since fitmat fits reflection"
    raise ReadError(f"{source}: {got}, {expected}. Is the file complete?")


@dataclasses.dataclass(frozen=True, eq=False)
class _Block:
    """Entries of one block of data, and where in the file its values begin.

    Attributes:
        source: Name of the file.
        raw: All of its bytes.
        begin: The first byte of the values.
        entries: Keyword → value.
        mode: ascii or binary.
        notes: On the encoding.
    """

    source: str
    raw: bytes
    begin: int
    entries: Mapping[str, str]
    mode: str
    notes: tuple[str, ...]

    __repr__ = brief

    @property
    def end(self) -> int:
        """Where the next block states its type, or the file ends."""
        following = _TYPE.search(self.raw, self.begin)
        return following.start() if following else len(self.raw)

    @property
    def first(self) -> int:
        """Number of the first line of the values."""
        return self.raw.count(b"\n", 0, self.begin) + 1

    def numbers(self, key: str, lowest: float, highest: float) -> Float[np.ndarray, " j"]:
        """A list of numbers, [0] where PARAM1_LIST is absent.

        Raises:
            ReadError: it is missing, or a number is out of range.
        """
        stated = self.entries.get(key, "0" if key == "PARAM1_LIST" else "")
        found = pl.Series(stated.split(), dtype=pl.String).cast(pl.Float64, strict=False).fill_null(np.nan).to_numpy()
        if len(found) and ((found >= lowest) & (found <= highest)).all():
            return found
        got = f"{key} {blocks.shown(stated) or '(none)'}"
        raise ReadError(f"{self.source}: {got}, expected numbers from {lowest:g} to {highest:g}. Correct the entry.")

    def word(self, key: str, allowed: tuple[str, ...]) -> str:
        """An entry that is one of several words.

        Raises:
            ReadError: it is another one.
        """
        word = self.entries.get(key, "(none)")
        if word not in allowed:
            got = f"{key} {blocks.shown(word)}, expected {' or '.join(allowed)}"
            raise ReadError(f"{self.source}: {got}. Convert the file with libbsdf's lbconv.")
        return word

    def angles(self) -> list[Float[np.ndarray, " j"]]:
        """The four lists of angles, in radians."""
        pairs = zip(LISTS, _LIMITS, strict=True)
        return [np.deg2rad(self.numbers(key, *limits)) for key, limits in pairs]

    def channels(self) -> tuple[str, ...]:
        """Names of the colours."""
        model = self.word("COLOR_MODEL", tuple(COLOURS))
        if model != "spectrum":
            return COLOURS[model]
        return tuple(f"{nm:.10g}" for nm in self.numbers("WAVELENGTH_LIST", 0.0, np.finfo(float).max))


def _blocks(raw: bytes, source: str) -> Iterator[_Block]:
    """The blocks of a file, one after the other."""
    at = 0
    while found := _DATA.search(raw, at):
        head, notes = contents.decoded(raw[at : found.start()], source)
        entries = {key: value.strip() for key, value in _ENTRY.findall(re.sub(r"\r\n?", "\n", head))}
        block = _Block(source, raw, found.end(), entries, found[1].decode("latin-1").lower(), notes)
        yield block
        at = block.begin + _FLOAT.itemsize * _size(block) if block.mode == "binary" else block.end


def _size(block: _Block) -> int:
    """How many values the entries of a block announce, whatever its type."""
    lists = [block.entries.get(key, "0").split() for key in LISTS]
    colours = block.entries.get("WAVELENGTH_LIST", "").split() or COLOURS.get(block.entries.get("COLOR_MODEL", ""), ())
    return math.prod(max(len(angles), 1) for angles in lists) * max(len(colours), 1)


def _recording(block: _Block) -> Recording:
    channels, system, angles = block.channels(), block.word("PARAM_TYPE", SYSTEMS), block.angles()
    value = _values(block, [len(part) for part in angles], len(channels))
    zeroth, first, azimuth, polar = np.meshgrid(angles[0], angles[1], angles[3], angles[2], indexing="ij")
    if system == "half_difference_coordinate_system":
        wi, wo = blocks.from_half(zeroth, first, polar, azimuth)
    else:
        wi = from_angles(zeroth, first)
        offset = _offsets(block, len(angles[0]))[:, None, None, None]
        about = blocks.around(zeroth + offset, first, polar, azimuth)
        wo = about if system == "specular_coordinate_system" else from_angles(polar, azimuth)
    twice = blocks.repeated(value, angles[2], angles[3])
    return Recording(
        source=block.source,
        wi=wi.reshape(-1, 3),
        wo=wo.reshape(-1, 3),
        value=value.reshape(-1, len(channels)),
        quantity="brdf",
        channels=channels,
        doubts={"the same value of a direction once more, for another azimuth": twice.reshape(-1, len(channels))},
        notes=(*block.notes, *_conventions(block, system)),
    )


def _values(block: _Block, shape: list[int], colours: int) -> Float[np.ndarray, "i j a p c"]:
    """The values with axes PARAM0, PARAM1, PARAM3, PARAM2 and colour, as many as the entries announce."""
    cells = math.prod(shape)
    expected = f"{' × '.join(map(str, shape))} cells of {colours} colours"
    if block.mode == "binary":
        present, wanted = len(block.raw) - block.begin, _FLOAT.itemsize * cells * colours
        if present < wanted:
            got = f"{present} bytes of binary data, expected {wanted} ({expected})"
            raise ReadError(f"{block.source}: {got}. Was the file cut off?")
        with np.errstate(invalid="ignore"):
            flat = np.frombuffer(block.raw, _FLOAT, cells * colours, block.begin).astype(float)
    elif block.mode == "ascii":
        text, _ = contents.decoded(block.raw[block.begin : block.end], block.source)
        body = blocks.lines(text, block.source, first=block.first)
        flat = body.table(colours, "the colours of COLOR_MODEL")
        if len(flat) != cells:
            got = f"{len(flat)} lines of values, expected {cells} ({expected})"
            raise ReadError(f"{block.source}: {got}. Was the file cut off?")
    else:
        got = f"DATA {blocks.shown(block.mode)}, expected ascii or binary"
        raise ReadError(f"{block.source} row {block.first - 1}: {got}. Convert the file with libbsdf's lbconv.")
    return flat.reshape(*reversed(shape), colours).transpose(3, 2, 0, 1, 4)


def _offsets(block: _Block, count: int) -> Float[np.ndarray, " j"]:
    """What the mirror direction is turned by at each angle of incidence, in radians (PARAM4_LIST)."""
    if "PARAM4_LIST" not in block.entries:
        return np.zeros(count)
    found = block.numbers("PARAM4_LIST", -90.0, 90.0)
    if len(found) != count:
        got = f"PARAM4_LIST of {len(found)} offsets, expected {count} as in PARAM0_LIST"
        raise ReadError(f"{block.source}: {got}. Correct the entry.")
    return np.deg2rad(found)


def _conventions(block: _Block, system: str) -> Iterator[str]:
    yield f"SSDD angles of the {system.replace('_', ' ')} turned into directions."
    if reduced := block.entries.get("REDUCTION_TYPE"):
        yield f"REDUCTION_TYPE {blocks.shown(reduced)}: the half that it leaves out is not filled in."
    if block.entries.get("SOURCE_TYPE") == "edited":
        yield "SOURCE_TYPE edited: the values were changed after the measurement."
