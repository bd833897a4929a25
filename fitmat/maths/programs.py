"""Programs: functions compiled once for a machine and kept on its disk, so that a later process traces none of them.

A program is exported (StableHLO) and lies beside what XLA compiled of it, both under a name that holds all that decides
it: function, structure of its arguments, shapes, the package's own sources, versions, machine. Nothing is unpickled;
what is damaged is made anew, and where nothing can be kept everything works, only slower. No formula stands here.
"""

import contextlib
import dataclasses
import functools
import hashlib
import os
import platform
import re
import stat
import threading
import types
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax
import numpy as np
import platformdirs
from jax.core import Tracer

PACKAGE = Path(__file__).parents[1]
"""Whose sources decide what a program computes."""

FOLDER = "FITMAT_CACHE"
"""Environment variable that names another folder for the programs; empty for none."""

LIMIT = 512 * 2**20
"""Bytes that the folder may hold; beyond, what was not used for longest is removed."""

LAST = "last-run"
"""File that names the programs of the last run."""

MOST_AHEAD = 16
"""Programs that are loaded ahead."""

HASTE = {"xla_backend_optimization_level": 0}
"""Options of the compiler for programs that are run once."""

SUFFIX = ".program"
"""How the names of exported modules end."""

_ZSTD = b"\x28\xb5\x2f\xfd"

_DIGEST = hashlib.sha256().digest_size

_CHECKED = ("lapack_dgeqrf_ffi", "lapack_dorgqr_ffi", "lapack_dormqr_ffi", "lapack_dgetrf_ffi", "lapack_dpotrf_ffi",
    "lapack_dtrsm_ffi", "lapack_dsyevd_ffi", "lapack_dgesdd_ffi")  # fmt: skip
# JAX does not promise that these calls mean the same in another release; the name of a program holds the release.


class Program:
    """A function of arrays as a program that is compiled once for each structure and shape of its arguments.

    Arrays among the arguments, in any dataclass, tuple or mapping, are traced; all else is part of the program. The
    function returns arrays, in tuples or mappings, and uses nothing but its arguments and the package's own constants.
    """

    def __init__(self, function: Callable[..., Any], *, once: bool = False) -> None:
        self._options = HASTE if once else None
        self._function, self._name = function, function.__name__.strip("_")
        self._lock = threading.Lock()
        self._ready: dict[Any, Callable[..., Any]] = {}
        self._making: dict[Any, threading.Lock] = {}
        functools.update_wrapper(self, function)
        _EVERY.append(self)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """What the function returns."""
        leaves, structure = jax.tree.flatten((args, kwargs))
        arrays = [leaf for leaf in leaves if isinstance(leaf, _ARRAYS)]
        if any(isinstance(leaf, Tracer) for leaf in arrays):
            return self._function(*args, **kwargs)
        return self._found(leaves, structure, arrays, (args, kwargs))(*arrays)

    def _found(self, leaves: list[Any], structure: Any, arrays: list[Any], given: Any) -> Callable[..., Any]:
        rest = tuple(None if isinstance(leaf, _ARRAYS) else leaf for leaf in leaves)
        kinds = tuple(map(type, rest))  # 1, 1.0 and True are equal
        key = (structure, rest, kinds, tuple((array.shape, array.dtype) for array in arrays))
        run = self._ready.get(key)
        return self._made(key, given, arrays) if run is None else run

    def bound(self, fixed: tuple[Any, ...], *free: np.ndarray) -> Callable[..., Any]:
        """The program with its first arguments in place, for a loop: a call of it takes the arrays that are left.

        Args:
            fixed: First arguments; their arrays are moved to the device once.
            free: Examples of the others, which give shape and type.
        """
        leaves, structure = jax.tree.flatten(((*fixed, *free), {}))
        arrays = [leaf for leaf in leaves if isinstance(leaf, _ARRAYS)]
        run = self._found(leaves, structure, arrays, ((*fixed, *free), {}))
        kept = jax.device_put(arrays[: len(arrays) - len(free)])
        return lambda *given: run(*kept, *given)

    def clear(self) -> None:
        """Let go of what is loaded; what is kept on disk stays."""
        self._ready.clear()

    def _made(self, key: Any, given: tuple[tuple, dict], arrays: list[Any]) -> Callable[..., Any]:
        with self._lock:
            making = self._making.setdefault(key, threading.Lock())
        with making:
            if key not in self._ready:
                self._ready[key] = self._load_or_compile(key, given, arrays)
        return self._ready[key]

    def _load_or_compile(self, key: Any, given: tuple[tuple, dict], arrays: list[Any]) -> Callable[..., Any]:
        structure, rest, *_ = key

        def flat(*found: Any) -> Any:
            following = iter(found)
            leaves = [next(following) if leaf is None else leaf for leaf in rest]
            args, kwargs = jax.tree.unflatten(structure, leaves)
            return self._function(*args, **kwargs)

        try:
            words = f"{_words(self._function)} {_words(given)} {_surroundings()}"
        except _Unnamed:
            return self._jit(flat)
        name = f"{self._name}-{hashlib.sha256(words.encode()).hexdigest()[:24]}"
        _USED.append(name)
        early = _AHEAD.pop(name, None)
        run = None if early is None else early.result()
        if run is not None:
            return run
        exported = _read(name)
        if exported is None:
            _tell(given)
            flat.__name__ = name
            exported = _exported(flat, arrays)
            if exported is None:
                return self._jit(flat)
            _write(name, exported)

        return self._jit(_calling(exported, name))

    def _jit(self, function: Callable[..., Any]) -> Callable[..., Any]:
        return jax.jit(function, compiler_options=self._options)


_EVERY: list[Program] = []

_TOLD: list[Callable[[str], None]] = []

_USED: list[str] = []

_AHEAD: dict[str, "Future[Callable[..., Any] | None]"] = {}


@contextlib.contextmanager
def announced(told: Callable[[str], None]) -> Iterator[None]:
    """Call `told` with the name of the model, or "", before a program is compiled, for as long as the block runs."""
    _TOLD.append(told)
    try:
        yield
    finally:
        _TOLD.remove(told)


def _tell(given: tuple[tuple, dict]) -> None:
    name = next((part.name for part in given[0] if isinstance(getattr(part, "name", None), str)), "")
    for told in _TOLD:
        told(name)


_ARRAYS = (jax.Array, np.ndarray, np.generic)


def program(function: Callable[..., Any]) -> Program:
    """A function as a `Program`; for use as a decorator."""
    return Program(function)


def program_run_once(function: Callable[..., Any]) -> Program:
    """The same of a function that is not run often: compiled in a third of the time, and half as fast."""
    return Program(function, once=True)


def clear() -> None:
    """Let go of every program that is loaded."""
    for each in _EVERY:
        each.clear()
    jax.clear_caches()


def _exported(flat: Callable[..., Any], arrays: list[Any]) -> Any:
    """The module of a function; None where JAX cannot export it."""
    from jax import export

    shapes = [jax.ShapeDtypeStruct(array.shape, array.dtype) for array in arrays]
    checks = [export.DisabledSafetyCheck.custom_call(name) for name in _CHECKED]
    try:
        return export.export(jax.jit(flat), disabled_checks=checks)(*shapes)
    except (NotImplementedError, ValueError):
        return None


def _calling(exported: Any, name: str) -> Callable[..., Any]:
    """A call of what was exported, under the name by which XLA keeps it."""

    def call(*found: Any) -> Any:
        return exported.call(*found)

    call.__name__ = name
    return call


class _Unnamed(Exception):
    """Something has no name that means the same in another process."""


def _words(x: Any) -> str:
    """All of a structure that decides a program, as text; arrays by shape and type only."""
    if isinstance(x, _ARRAYS):
        return f"{x.dtype}{x.shape}"
    if x is None or isinstance(x, str | bytes | bool | int | float | complex):
        return repr(x)
    if dataclasses.is_dataclass(x) and not isinstance(x, type):
        parts = (f"{f.name}={_words(getattr(x, f.name))}" for f in dataclasses.fields(x) if f.compare)
        return f"{_words(type(x))}({', '.join(parts)})"
    if isinstance(x, tuple | list):
        return f"{_words(type(x))}({', '.join(map(_words, x))})"
    if isinstance(x, set | frozenset):
        return f"{_words(type(x))}({', '.join(sorted(map(_words, x)))})"
    if isinstance(x, Mapping):
        return f"({', '.join(f'{_words(k)}: {_words(v)}' for k, v in sorted(x.items()))})"
    if isinstance(x, functools.partial):
        return f"partial({_words(x.func)}, {_words(x.args)}, {_words(x.keywords)})"
    if isinstance(x, type | types.FunctionType):
        return _named(x)
    raise _Unnamed


def _named(x: type | types.FunctionType) -> str:
    """A class or function by where it stands: the package's own, whose sources are known, or a builtin."""
    if x.__module__ != "builtins" and not x.__module__.startswith(f"{PACKAGE.name}."):
        raise _Unnamed
    closed = getattr(x, "__closure__", None) or ()
    return f"{x.__module__}.{x.__qualname__}{_words(tuple(cell.cell_contents for cell in closed)) if closed else ''}"


@functools.cache
def _surroundings() -> str:
    """What decides a program beside its arguments: sources, versions, machine, and the settings of JAX."""
    sources = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        sources.update(str(path.relative_to(PACKAGE)).encode() + b"\0" + path.read_bytes())
    versions = [f"{name} {version(name)}" for name in ("jax", "jaxlib", "equinox", "optimistix", "lineax")]
    return f"{sources.hexdigest()} {versions} {machine()} {jax.default_backend()} {jax.config.read('jax_enable_x64')}"


@functools.cache
def machine() -> str:
    """The processor with all that it can do: code compiled for one may crash on another."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
            lines = {line for line in file if line.startswith(("model name", "flags", "Features", "CPU part"))}
        return " ".join(sorted(lines))
    except OSError:
        return f"{platform.machine()} {platform.processor()}"


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


def _read(name: str) -> Any:
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


def _write(name: str, exported: Any) -> None:
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


def load_ahead() -> None:
    """Load, in a thread, what the last run used, while this one has other things to do; `remember` ends a run."""
    place = folder()
    if place is None:
        return
    try:
        names = (place / LAST).read_text(encoding="ascii", errors="replace").split()
    except OSError:
        return
    known = [name for name in names[:MOST_AHEAD] if re.fullmatch(r"\w+-[0-9a-f]{24}", name)]
    pool = ThreadPoolExecutor(1)
    _AHEAD.update({name: pool.submit(_loaded, name) for name in known})
    pool.shutdown(wait=False)


def _loaded(name: str) -> Callable[..., Any] | None:
    """A program of the folder, ready to run; None where there is none."""
    exported = _read(name)
    if exported is None:
        return None

    shapes = [jax.ShapeDtypeStruct(given.shape, given.dtype) for given in exported.in_avals]
    with contextlib.suppress(Exception):
        return jax.jit(_calling(exported, name)).lower(*shapes).compile()
    return None


def remember() -> None:
    """Note which programs this run used, for `load_ahead` of the next."""
    place = folder()
    if place is not None and _USED:
        draft = place / f".{LAST}.{os.getpid()}"
        with contextlib.suppress(OSError):
            draft.write_text("\n".join(dict.fromkeys(_USED)), encoding="ascii")
            os.replace(draft, place / LAST)


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
