"""Shows what a batch of many small files takes: wall, CPU a file, and what a second worker is worth.

The files are the one-channel materials of the catalogue with other parameters and other noise, and some that are
broken, of many kinds. Every good file must have its rows, and every broken one its sentence, whatever the number of
workers; the tables must be the same, but for which of two models a sentence names, the one that was refused first, and
the same as studies of single files.

Run: python benchmarks/batch.py [--files 1000] [--broken 30] [--processes 1 2]
"""

import argparse
import dataclasses
import itertools
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import jax
import machine
import numpy as np
import polars as pl

from fitmat.batches import workers
from fitmat.batches.jobs import Job, digest
from fitmat.measurements.formats import csv
from fitmat.models.catalogue import MATERIALS, Material
from fitmat.studies import DEFAULT_MODELS

ONE_CHANNEL = tuple(material for material in MATERIALS if material.setup.channels is None)

APART = 0.3
"""Parameters differ from those of the catalogue by up to so much in the logarithm."""

MOST = {"kd": 0.6, "ks": 1.0, "alpha": 0.8}
"""Above these a surface reflects more than it receives, or is rougher than the model allows."""

HEAD, TWENTY = "theta_i,theta_o,brdf\n", range(20)

BROKEN: dict[str, str | bytes] = {
    "nothing at all": "",
    "no rows": HEAD,
    "a word for a number": f"{HEAD}10,20,much\n10,30,0.1\n",
    "no column of values": "theta_i,theta_o\n10,20\n10,30\n",
    "fewer rows than parameters": f"{HEAD}10,20,0.1\n10,30,0.1\n",
    "incidence below the horizon": HEAD + "".join(f"100,{4 * k},0.1\n" for k in TWENTY),
    "no numbers": HEAD + "".join(f"30,{4 * k},nan\n" for k in TWENTY),
    "infinite values": HEAD + "".join(f"30,{4 * k},inf\n" for k in TWENTY),
    "cells that lack": HEAD + "".join(f"30,{4 * k}\n" for k in TWENTY),
    "two columns of values": "theta_i,theta_o,brdf,brdf\n" + "".join(f"30,{4 * k},0.1,0.2\n" for k in TWENTY),
    "another quantity": "theta_i,theta_o,luminance\n" + "".join(f"30,{4 * k},0.1\n" for k in TWENTY),
    "noise below zero": "theta_i,theta_o,brdf,sigma\n" + "".join(f"30,{4 * k},0.1,-1\n" for k in TWENTY),
    "a web page": "<!DOCTYPE html><html><body>404 Not Found</body></html>\n",
    "a picture": b"\x89PNG\r\n\x1a\n" + bytes(range(256)),
    "the beginning of an archive": b"PK\x03\x04" + bytes(40),
}
"""Content of files that cannot be fitted, each in its own way."""

APART_FROM = ("message", "seconds")
"""Columns in which two runs of the same files may differ."""

ALONE = 5
"""Files of which the rows of a study by itself are compared with those of the batch, number by number."""


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


def good_text(k: int, rng: np.random.Generator) -> str:
    """Content of the k-th file that can be fitted."""
    return csv.dump(varied(ONE_CHANNEL[k % len(ONE_CHANNEL)], rng).measured())


def write(folder: Path, good: int, broken: int) -> None:
    """The files, the broken ones among the others."""
    rng = np.random.default_rng(0)
    folder.mkdir()
    bad = np.linspace(0, good + broken - 1, broken).astype(int).tolist()
    kinds = dict(zip(bad, itertools.cycle(BROKEN.values()), strict=False))
    for k in range(good + broken):
        content = kinds[k] if k in kinds else good_text(k, rng)
        (folder / f"scan {k:04}.csv").write_bytes(content if isinstance(content, bytes) else content.encode())


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


def refuse_other_than_alone(every: list[Path], table: pl.DataFrame) -> None:
    """Stop where a batch has other numbers of some files than studies of them one by one in this process."""
    told = {"sampling": False, "models": DEFAULT_MODELS}
    fitted = [path for path in every if str(path) in set(table.filter(pl.col("model").is_not_null())["file"])]
    for path in fitted[:: max(1, len(fitted) // ALONE)]:
        alone = workers.studied(Job(path, {}, told), digest(path))
        for row, found in zip(alone, table.filter(pl.col("file") == str(path)).iter_rows(named=True), strict=True):
            told = {name: cell for name, cell in row.items() if name in found and name != "seconds"}
            differ = [name for name, cell in told.items() if found[name] != cell and cell is not None]
            if differ:
                raise SystemExit(
                    f"{path.name}, {row['model']}: {', '.join(differ)} differ from those of a study alone."
                )


def main() -> None:
    """Write the files, then one worker and two in turn."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--files", type=int, default=1000, help="files, the broken ones among them")
    options.add_argument("--broken", type=int, default=30, help="how many of them are broken")
    options.add_argument("--processes", type=int, nargs="+", default=[1, 2], help="workers, one run for each number")
    chosen = options.parse_args()
    count, broken = chosen.files, chosen.broken
    jax.config.update("jax_enable_x64", True)
    print(machine.described(), "\n")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write(folder / "scans", count - broken, broken)
        every = sorted((folder / "scans").iterdir())
        first = run(every[: len(ONE_CHANNEL) + 2], folder / "first", 1, folder / "cache")
        taken = {k: run([folder / "scans"], folder / f"out {k}", k, folder / "cache") for k in chosen.processes}
        tables = [found.table for found in taken.values()]
        for table in tables:
            refuse_other_than(count - broken, broken, table)
            if not tables[0].drop(APART_FROM).equals(table.drop(APART_FROM)):
                raise SystemExit("another number of workers makes another table.")
        refuse_other_than_alone(every, tables[0])
    rows = [
        [f"{k} workers", f"{found.wall:.0f}", f"{found.cpu:.0f}", f"{found.cpu / count:.2f}"]
        for k, found in taken.items()
    ]
    machine.show(f"{count} files, {broken} of them broken", ["", "wall s", "CPU s", "CPU s a file"], rows)
    kinds = min(broken, len(BROKEN))
    print(f"All {count - broken} files have rows, all {broken} broken ones, of {kinds} kinds, a sentence.")
    first_count, *others = taken
    for k in others:
        print(f"{k} workers make the same table, {taken[first_count].wall / taken[k].wall:.2f} times as fast.")
    print(f"The first {len(ONE_CHANNEL) + 2} files, all programs compiled: {first.wall:.0f} s, {first.cpu:.0f} CPU s.")


if __name__ == "__main__":
    main()
