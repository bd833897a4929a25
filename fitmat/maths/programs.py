"""Programs: functions compiled once for a machine and kept on its disk, so that a later process traces none of them.

The name of a program holds all that decides it: function, structure of its arguments, shapes, the package's own
sources, versions, machine. The folder is the business of `program_files`. No formula stands here.
"""

import contextlib
import functools
import hashlib
import itertools
import os
import re
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax.core import Tracer

from fitmat.maths import defects, program_files, program_names

LAST = "last-{}"
"""File that names the programs of the last run of a command."""

MOST_AHEAD = 16
"""Programs that are loaded ahead."""

OFTEN = 32
"""Calls of one program that are worth moving what they share to the device, which takes as long as passing it to 12."""

defects.mend()  # before anything is compiled

UNFUSED: dict[str, Any] = {"xla_cpu_use_fusion_emitters": False}
"""Options of XLA, not more than one: it keeps what it compiled under a name that holds them in no certain order.

Its fusion emitters take 40 % of the seconds of compiling. A loop over values of a model becomes twice as fast by them;
normal equations, densities and fits do not.
"""

_CHECKED = ("lapack_dgeqrf_ffi", "lapack_dorgqr_ffi", "lapack_dormqr_ffi", "lapack_dgetrf_ffi", "lapack_dpotrf_ffi",
    "lapack_dtrsm_ffi", "lapack_dsyevd_ffi", "lapack_dgesdd_ffi")  # fmt: skip
# JAX does not promise that these calls mean the same in another release; the name of a program holds the release.


class Program:
    """A function of arrays as a program that is compiled once for each structure and shape of its arguments.

    Arrays among the arguments, in any dataclass, tuple or mapping, are traced; all else is part of the program. The
    function returns arrays, in tuples or mappings, and uses nothing but its arguments and the package's own constants.
    """

    def __init__(self, function: Callable[..., Any], *, fused: bool = False) -> None:
        self._fused = fused
        self._function, self._name = function, function.__name__.strip("_")
        self._lock = threading.Lock()
        self._ready: dict[Any, Callable[..., Any]] = {}
        self._making: dict[Any, threading.Lock] = {}
        functools.update_wrapper(self, function)
        _EVERY.append(self)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """What the function returns."""
        leaves, structure = jax.tree.flatten((args, kwargs))
        arrays = [leaf for leaf in leaves if isinstance(leaf, program_names.ARRAYS)]
        if any(isinstance(leaf, Tracer) for leaf in arrays):
            return self._function(*args, **kwargs)
        return self._found(leaves, structure, arrays, (args, kwargs))(*arrays)

    def _found(self, leaves: list[Any], structure: Any, arrays: list[Any], given: Any) -> Callable[..., Any]:
        rest = tuple(None if isinstance(leaf, program_names.ARRAYS) else leaf for leaf in leaves)
        kinds = tuple(map(type, rest))  # 1, 1.0 and True are equal
        key = (structure, rest, kinds, tuple((array.shape, array.dtype) for array in arrays))
        run = self._ready.get(key)
        return self._made(key, given, arrays) if run is None else run

    def bound(self, fixed: tuple[Any, ...], *free: np.ndarray) -> Callable[..., Any]:
        """The program with its first arguments in place, for a loop: a call of it takes the arrays that are left.

        Args:
            fixed: First arguments; of a loop of `OFTEN` calls their arrays are moved to the device, once.
            free: Examples of the others, which give shape and type.
        """
        leaves, structure = jax.tree.flatten(((*fixed, *free), {}))
        arrays = [leaf for leaf in leaves if isinstance(leaf, program_names.ARRAYS)]
        run = self._found(leaves, structure, arrays, ((*fixed, *free), {}))
        kept, calls = arrays[: len(arrays) - len(free)], itertools.count(1)

        def call(*given: Any) -> Any:
            nonlocal kept
            if next(calls) == OFTEN:
                kept = jax.device_put(kept)
            return run(*kept, *given)

        return call

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

        shapes = [jax.ShapeDtypeStruct(array.shape, array.dtype) for array in arrays]
        try:
            words = " ".join(
                [program_names.words(self._function), program_names.words(given), program_names.surroundings()]
            )
        except program_names.Unnamed:
            return _compiled(flat, shapes, self._fused)
        name = f"{self._name}-{hashlib.sha256(words.encode()).hexdigest()[:24]}"
        _USED.append(f"{name} {_KINDS[self._fused]}")
        early = _AHEAD.pop(_USED[-1], None)
        with _telling("loading", given):
            run = None if early is None else early.result()
            if run is not None:
                return run
            exported = program_files.read(name)
            if exported is not None:
                return _compiled(_calling(exported, name), shapes, self._fused)
        with _telling("compiling", given):
            flat.__name__ = name
            exported = _exported(flat, shapes)
            if exported is None:
                return _compiled(flat, shapes, self._fused)
            program_files.write(name, exported)
            return _compiled(_calling(exported, name), shapes, self._fused)


def _compiled(function: Callable[..., Any], shapes: list[Any], fused: bool) -> Callable[..., Any]:
    lowered = jax.jit(function).lower(*shapes)
    if _KNOWN and not (fused and not jax.config.read(_HASTE)):
        try:
            return lowered.compile(UNFUSED)
        except jax.errors.JaxRuntimeError as error:
            if "No such compile option" not in str(error):
                raise
            _KNOWN.clear()
    return lowered.compile()


_KNOWN = [True]
# Empty from when on this release of XLA is known not to know the option.

_KINDS = ("plain", "fused")

_HASTE = "jax_disable_most_optimizations"


@contextlib.contextmanager
def hasty() -> Iterator[None]:
    """Compile with little effort, in all threads, what is compiled within the block: for what is run once.

    It takes a third of the time, and runs up to five times slower.
    """
    before = jax.config.read(_HASTE)
    jax.config.update(_HASTE, True)
    try:
        yield
    finally:
        jax.config.update(_HASTE, before)


_EVERY: list[Program] = []

_TOLD: list[Callable[[str, str], None]] = []

_USED: list[str] = []

_AHEAD: dict[str, "Future[Callable[..., Any] | None]"] = {}


@contextlib.contextmanager
def announced(told: Callable[[str, str], None]) -> Iterator[None]:
    """Say when programs are made ready, for as long as the block runs.

    Args:
        told: Called with "loading" or "compiling" before it is done, with "" when it is, and the model's name or "".
    """
    _TOLD.append(told)
    try:
        yield
    finally:
        _TOLD.remove(told)


@contextlib.contextmanager
def _telling(doing: str, given: tuple[tuple, dict]) -> Iterator[None]:
    name = next((part.name for part in given[0] if isinstance(getattr(part, "name", None), str)), "")
    for told in _TOLD:
        told(doing, name)
    try:
        yield
    finally:
        for told in _TOLD:
            told("", name)


def program(function: Callable[..., Any]) -> Program:
    """A function as a `Program`; for use as a decorator."""
    return Program(function)


def program_run_often(function: Callable[..., Any]) -> Program:
    """The same of a function whose loops are worth the compiler's full effort."""
    return Program(function, fused=True)


def clear() -> None:
    """Let go of every program that is loaded."""
    for each in _EVERY:
        each.clear()
    jax.clear_caches()


def _exported(flat: Callable[..., Any], shapes: list[Any]) -> Any:
    """The module of a function; None where JAX cannot export it."""
    from jax import export

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


@contextlib.contextmanager
def ahead(command: str) -> Iterator[None]:
    """Load, in a thread, what the last run of a command used; note what this one uses where it ends well.

    Args:
        command: A word.
    """
    place = program_files.folder()
    if place is not None:
        _load_ahead(place / LAST.format(command))
    yield
    if place is not None and _USED:
        draft = place / f".{LAST.format(command)}.{os.getpid()}"
        with contextlib.suppress(OSError):
            draft.write_text("\n".join(dict.fromkeys(_USED)), encoding="ascii")
            os.replace(draft, place / LAST.format(command))


def _load_ahead(noted: Path) -> None:
    try:
        lines = noted.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return
    known = [line for line in lines[:MOST_AHEAD] if _NOTED.fullmatch(line)]
    pool = ThreadPoolExecutor(1)
    _AHEAD.update({line: pool.submit(_loaded, *line.split()) for line in known})
    pool.shutdown(wait=False)


_NOTED = re.compile(rf"\w+-[0-9a-f]{{24}} ({'|'.join(_KINDS)})")


def _loaded(name: str, kind: str) -> Callable[..., Any] | None:
    """A program of the folder, ready to run; None where there is none."""
    exported = program_files.read(name)
    if exported is None:
        return None
    shapes = [jax.ShapeDtypeStruct(given.shape, given.dtype) for given in exported.in_avals]
    with contextlib.suppress(Exception):
        return _compiled(_calling(exported, name), shapes, kind == _KINDS[True])
    return None
