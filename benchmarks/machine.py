"""Where the numbers were taken, and how: repeats of the rivals in turn, medians, a plain table.

Knows nothing of reflectance.
"""

import importlib.metadata
import os
import platform
import time
from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np
from rich.console import Console
from rich.table import Table

T = TypeVar("T")

PACKAGES = ("fitmat", "jax", "optimistix", "scipy", "numpy", "emcee")


def described() -> str:
    """Cores, load, Python and the versions that matter."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    return (
        f"{_processor()}, {cores} cores, load {os.getloadavg()[0]:.1f}, Python {platform.python_version()}, {versions}"
    )


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def interleaved(rivals: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, np.ndarray]:
    """Seconds of each rival, (repeats,), taken in turn A B … A B … so that a busy machine hurts all alike.

    Every rival runs once before, untimed.
    """
    for run in rivals.values():
        run()
    seconds: dict[str, list[float]] = {name: [] for name in rivals}
    for _ in range(repeats):
        for name, run in rivals.items():
            seconds[name].append(clocked(run)[0])
    return {name: np.array(taken) for name, taken in seconds.items()}


def clocked(run: Callable[[], T]) -> tuple[float, T]:
    """Wall seconds of one call, and what it returned."""
    begin = time.perf_counter()
    result = run()
    return time.perf_counter() - begin, result


def duration(seconds: float) -> str:
    """`1.23 s`, or milliseconds below a second."""
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"


def show(title: str, headings: list[str], rows: list[list[str]]) -> None:
    """Print a table; numbers to the right."""
    table = Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False)
    for k, heading in enumerate(headings):
        table.add_column(heading, justify="right" if k else "left")
    for row in rows:
        table.add_row(*row)
    Console(width=120).print(table, "", highlight=False, markup=False)
