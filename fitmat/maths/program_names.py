"""Program names: all that decides a compiled program, as text that means the same in another process.

They compile nothing and keep nothing.
"""

import dataclasses
import functools
import hashlib
import os
import platform
import types
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax
import numpy as np

PACKAGE = Path(__file__).parents[1]
"""Whose sources and tables decide what a program computes."""

ARRAYS = (jax.Array, np.ndarray, np.generic)
"""What a program takes as it comes; everything else decides which program it is."""


class Unnamed(Exception):
    """Something has no name that means the same in another process."""


def words(x: Any) -> str:
    """All of a structure that decides a program, as text; arrays by shape and type only."""
    if isinstance(x, ARRAYS):
        return f"{x.dtype}{x.shape}"
    if x is None or isinstance(x, str | bytes | bool | int | float | complex):
        return repr(x)
    if dataclasses.is_dataclass(x) and not isinstance(x, type):
        parts = (f"{f.name}={words(getattr(x, f.name))}" for f in dataclasses.fields(x) if f.compare)
        return f"{words(type(x))}({', '.join(parts)})"
    if isinstance(x, tuple | list):
        return f"{words(type(x))}({', '.join(map(words, x))})"
    if isinstance(x, set | frozenset):
        return f"{words(type(x))}({', '.join(sorted(map(words, x)))})"
    if isinstance(x, Mapping):
        return f"({', '.join(f'{words(k)}: {words(v)}' for k, v in sorted(x.items()))})"
    if isinstance(x, functools.partial):
        return f"partial({words(x.func)}, {words(x.args)}, {words(x.keywords)})"
    if isinstance(x, type | types.FunctionType):
        return _named(x)
    raise Unnamed


def _named(x: type | types.FunctionType) -> str:
    """A class or function by where it stands: the package's own, whose sources are known, or a builtin."""
    if x.__module__ != "builtins" and not x.__module__.startswith(f"{PACKAGE.name}."):
        raise Unnamed
    closed = getattr(x, "__closure__", None) or ()
    return f"{x.__module__}.{x.__qualname__}{words(tuple(cell.cell_contents for cell in closed)) if closed else ''}"


@functools.cache
def surroundings() -> str:
    """What decides a program beside its arguments: sources, versions, machine, and the settings of JAX."""
    sources = hashlib.sha256()
    for path in sorted([*PACKAGE.rglob("*.py"), *PACKAGE.rglob("*.npz")]):
        sources.update(str(path.relative_to(PACKAGE)).encode() + b"\0" + path.read_bytes())
    versions = [f"{name} {version(name)}" for name in ("jax", "jaxlib", "equinox", "optimistix", "lineax")]
    settings = f"{jax.default_backend()} {jax.config.read('jax_enable_x64')} {os.environ.get('XLA_FLAGS', '')}"
    return f"{sources.hexdigest()} {versions} {machine()} {settings}"


@functools.cache
def machine() -> str:
    """The processor with all that it can do: code compiled for one may crash on another."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
            lines = {line for line in file if line.startswith(("model name", "flags", "Features", "CPU part"))}
        return " ".join(sorted(lines))
    except OSError:
        return f"{platform.machine()} {platform.processor()}"
