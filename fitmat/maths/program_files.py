"""The folder of compiled programs: where it is, what is read from it and kept in it, and its bounds.

A program is an exported module (StableHLO) beside what XLA compiled of it, both under one name. Nothing is unpickled;
what is damaged is removed, and where nothing can be kept everything works, only slower. Compiles nothing itself.
"""

import contextlib
import dataclasses
import functools
import hashlib
import os
import stat
import threading
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax
import platformdirs

FOLDER = "FITMAT_CACHE"
"""Environment variable that names another folder for the programs; empty for none."""

LIMIT = 512 * 2**20
"""Bytes that the folder may hold; beyond, what was not used for longest is removed."""

SUFFIX = ".program"
"""How the names of exported modules end."""

_ZSTD = b"\x28\xb5\x2f\xfd"

_DIGEST = hashlib.sha256().digest_size


def folder() -> Path | None:
    """Where programs are kept, made for this user alone; None where there is no such place."""
    return _opened(os.environ.get(FOLDER))[0]


@functools.cache
def _opened(chosen: str | None) -> tuple[Path | None, str]:
    """The folder, or why there is none; "" where none is wanted."""
    if chosen == "":
        return None, ""
    place = Path(chosen) if chosen else platformdirs.user_cache_path("fitmat") / "programs"
    try:
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = place.stat()
        if hasattr(os, "getuid"):
            if found.st_uid != os.getuid():
                return None, f"{place} belongs to another user"
            if stat.S_IMODE(found.st_mode) & 0o077:
                place.chmod(0o700)
        if not os.access(place, os.R_OK | os.W_OK | os.X_OK):
            return None, f"{place} cannot be written"
    except OSError as error:
        return None, f"{place}: {error.strerror or error}"
    if getattr(jax.config, "jax_compilation_cache_dir", None) is None:
        jax.config.update("jax_compilation_cache_dir", str(place))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
        # JAX writes in place: what another process is writing is compiled once more.
        warnings.filterwarnings("ignore", message="Error (reading|writing) persistent compilation cache entry")
    return place, ""


def _digest(name: str, content: bytes) -> bytes:
    """Of a file: a whole program under another's name is as wrong as a damaged one."""
    return hashlib.sha256(name.encode() + content).digest()


def read(name: str) -> Any:
    """An exported program of the folder; None where there is none, or none that is whole."""
    place = folder()
    if place is None:
        return None
    from jax import export

    _mend(place, name)
    path = place / f"{name}{SUFFIX}"
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if _digest(name, content[_DIGEST:]) == content[:_DIGEST]:
        with contextlib.suppress(Exception):
            found = export.deserialize(bytearray(content[_DIGEST:]))
            for used in (path, *place.glob(f"jit_{name}-*")):
                with contextlib.suppress(OSError):
                    os.utime(used)
            return found
    with contextlib.suppress(OSError):
        path.unlink()
    return None


def _mend(place: Path, name: str) -> None:
    """Remove what XLA compiled of a program where it cannot be unpacked: JAX would complain, and keep it for ever."""
    for entry in place.glob(f"jit_{name}-*"):
        with contextlib.suppress(OSError):
            content = entry.read_bytes()
            if content[: len(_ZSTD)] == _ZSTD:  # not looked into
                continue
            try:
                zlib.decompress(content)
            except zlib.error:
                entry.unlink()


def write(name: str, exported: Any) -> None:
    """Keep an exported program; what the disk refuses is not kept."""
    place = folder()
    if place is None:
        return
    content = bytes(exported.serialize())
    draft = place / f".{name}.{os.getpid()}.{threading.get_ident()}"
    try:
        draft.write_bytes(_digest(name, content) + content)
        os.replace(draft, place / f"{name}{SUFFIX}")
        _prune(place)
    except OSError:
        with contextlib.suppress(OSError):
            draft.unlink()


@dataclasses.dataclass(frozen=True)
class Kept:
    """What the folder holds.

    Attributes:
        folder: Where it is; None where there is none.
        why: Why there is none.
        programs: How many.
        size: Of all files, bytes.
    """

    folder: Path | None
    why: str
    programs: int
    size: int

    @property
    def amount(self) -> str:
        """How many, and how much."""
        return f"{self.programs} compiled programs, {self.size / 1e6:.1f} MB"

    @property
    def words(self) -> str:
        """One sentence."""
        if self.folder is None:
            return f"Compiled programs are not kept{f' ({self.why})' if self.why else ''}: each run compiles anew."
        return f"{self.amount}, are kept in {self.folder}."


def kept() -> Kept:
    """What the folder holds."""
    place, why = _opened(os.environ.get(FOLDER))
    files = list(_files(place))
    count, size = sum(path.suffix == SUFFIX for path, _ in files), sum(found.st_size for _, found in files)
    return Kept(place, why, count, size)


def remove() -> Kept:
    """Empty the folder; returns what was there."""
    before = kept()
    for path, _ in _files(folder()):
        with contextlib.suppress(OSError):
            path.unlink()
    return before


def _files(place: Path | None) -> Iterator[tuple[Path, os.stat_result]]:
    for path in () if place is None else place.iterdir():
        with contextlib.suppress(OSError):
            found = path.lstat()
            if stat.S_ISREG(found.st_mode):
                yield path, found


def _prune(place: Path) -> None:
    """Remove the files that were not used for longest until the rest is below `LIMIT`."""
    files = sorted(_files(place), key=lambda item: item[1].st_mtime)
    excess = sum(found.st_size for _, found in files) - LIMIT
    for path, found in files:
        if excess <= 0:
            return
        with contextlib.suppress(OSError):
            path.unlink()
            excess -= found.st_size
