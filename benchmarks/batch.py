"""Shows what a batch of many small files takes: wall, CPU a file, and what a second worker is worth.

The files are the one-channel materials of the catalogue with other parameters and other noise, and some that are
broken, of five kinds. Every good file must have its rows, and every broken one its sentence, whatever the number of
workers; the tables must be the same, but for which of two models a sentence names, the one that was refused first.

Run: python benchmarks/batch.py [--files 1000] [--broken 30]
"""

import argparse
import dataclasses
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import machine
import numpy as np
import polars as pl

from fitmat.measurements.formats import csv
from fitmat.models.catalogue import MATERIALS, Material

ONE_CHANNEL = tuple(material for material in MATERIALS if material.setup.channels is None)

APART = 0.3
"""Parameters differ from those of the catalogue by up to so much in the logarithm."""

MOST = {"kd": 0.6, "ks": 1.0, "alpha": 0.8}
"""Above these a surface reflects more than it receives, or is rougher than the model allows."""

BROKEN = (
    "",
    "theta_i,theta_o,brdf\n",
    "theta_i,theta_o,brdf\n10,20,much\n10,30,0.1\n",
    "theta_i,theta_o\n10,20\n10,30\n",
    "theta_i,theta_o,brdf\n10,20,0.1\n10,30,0.1\n",
)
"""Nothing at all, no rows, a word for a number, no column of values, fewer rows than parameters."""


class Taken(NamedTuple):
    """Wall and CPU seconds of a batch, and its table."""

    wall: float
    cpu: float
    table: pl.DataFrame


def varied(material: Material, rng: np.random.Generator) -> Material:
    """Another surface under the same instrument."""

    def other(name: str, value: float) -> float:
        moved = value * float(np.exp(rng.uniform(-APART, APART)))
        return 1.0 + (value - 1.0) * moved / value if name == "eta" else min(moved, MOST.get(name, np.inf))

    parameters = {name: other(name, float(np.mean(x))) for name, x in material.parameters.items()}
    return dataclasses.replace(material, parameters=parameters, seed=int(rng.integers(2**31)))


def text(k: int, broken: bool, rng: np.random.Generator) -> str:
    """Content of the k-th file."""
    if broken:
        return BROKEN[k % len(BROKEN)]
    return csv.dump(varied(ONE_CHANNEL[k % len(ONE_CHANNEL)], rng).measured())


def write(folder: Path, good: int, broken: int) -> None:
    """The files, the broken ones among the others."""
    rng = np.random.default_rng(0)
    folder.mkdir()
    bad = set(np.linspace(0, good + broken - 1, broken).astype(int).tolist())
    for k in range(good + broken):
        (folder / f"scan {k:04}.csv").write_text(text(k, k in bad, rng), encoding="utf-8")


def line(sources: list[Path], out: Path, processes: int) -> list[str]:
    """The command of a batch."""
    words = [sys.executable, "-m", "fitmat", "batch", *map(str, sources), "--out", str(out)]
    return [*words, "--processes", str(processes)]


def environment(cache: Path) -> dict[str, str]:
    """The environment without what changes how fitmat computes, and with a cache of its own."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("FITMAT_", "JAX_", "OPENBLAS_"))}
    return kept | {"XDG_CACHE_HOME": str(cache)}


def run(sources: list[Path], out: Path, processes: int, cache: Path) -> Taken:
    """One batch by the command line."""
    words, told = line(sources, out, processes), environment(cache)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    wall, ended = machine.clocked(lambda: subprocess.run(words, env=told, capture_output=True, text=True, check=False))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if ended.returncode not in (0, 3):  # 3: some files were refused
        raise SystemExit(f"{' '.join(words)} ended with code {ended.returncode}:\n{ended.stderr}")
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Taken(wall, cpu, pl.read_parquet(out / "results.parquet"))


def refuse_other_than(good: int, broken: int, table: pl.DataFrame) -> None:
    """Stop where a file has not its rows or its sentence."""
    fitted = table.filter(pl.col("model").is_not_null())
    lost = table.filter(pl.col("outcome") == "refused")
    right = fitted.filter(pl.col("match_distance").is_finite())
    told = lost.filter(pl.col("message").str.contains("scan "))
    if (right["file"].n_unique(), len(fitted), len(told), len(table)) != (good, 2 * good, broken, 2 * good + broken):
        why = f"{right['file'].n_unique()} files with rows, {len(fitted)} rows, {len(told)} sentences"
        raise SystemExit(f"{why}; expected {good}, {2 * good} and {broken}.")


def main() -> None:
    """Write the files, then one worker and two in turn."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--files", type=int, default=1000, help="files, the broken ones among them")
    options.add_argument("--broken", type=int, default=30, help="how many of them are broken")
    chosen = options.parse_args()
    count, broken = chosen.files, chosen.broken
    print(machine.described(), "\n")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write(folder / "scans", count - broken, broken)
        every = sorted((folder / "scans").iterdir())
        first = run(every[: len(ONE_CHANNEL) + 2], folder / "first", 1, folder / "cache")
        taken = {k: run([folder / "scans"], folder / f"out {k}", k, folder / "cache") for k in (1, 2)}
        tables = [found.table for found in taken.values()]
        for table in tables:
            refuse_other_than(count - broken, broken, table)
        if not tables[0].drop("message").equals(tables[1].drop("message")):
            raise SystemExit("one worker and two make different tables.")
    rows = [
        [f"{k} workers", f"{found.wall:.0f}", f"{found.cpu:.0f}", f"{found.cpu / count:.2f}"]
        for k, found in taken.items()
    ]
    machine.show(f"{count} files, {broken} of them broken", ["", "wall s", "CPU s", "CPU s a file"], rows)
    print(f"All {count - broken} files have rows, all {broken} broken ones a sentence; both tables are the same.")
    print(f"Two workers are {taken[1].wall / taken[2].wall:.2f} times as fast as one.")
    print(f"The first {len(ONE_CHANNEL) + 2} files, all programs compiled: {first.wall:.0f} s, {first.cpu:.0f} CPU s.")


if __name__ == "__main__":
    main()
