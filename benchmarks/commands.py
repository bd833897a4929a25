"""Shows what waiting for the command line means: whole processes, imports, compilation and drawing included.

"First" means an empty folder of compiled programs and an empty cache, so that Matplotlib's list of fonts is made anew
as well; "afterwards" means that the same command ran before. There is no peer to race: nothing else makes this report.
The targets are for two idle cores.

Run: python benchmarks/commands.py [--repeats 5] [--firsts 3] [--only TEXT] [--merl FILE]
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import machine
import numpy as np

DATA = Path(__file__).parents[1] / "data" / "synthetic"


class Taken(NamedTuple):
    """What one process took: wall and CPU seconds, largest memory in GB."""

    wall: float
    cpu: float
    memory: float


class Command(NamedTuple):
    """A command with its targets: wall seconds first and afterwards, None where there is none."""

    name: str
    arguments: tuple[str, ...]
    first: float | None
    afterwards: float | None


def commands(folder: Path, merl: Path | None) -> list[Command]:
    """What is timed."""
    plastic, paint = str(DATA / "satin-plastic.csv"), str(DATA / "red-paint.csv")
    report = ("--out", str(folder / "report"), "--force")
    found = [
        Command("--help", ("--help",), None, 0.4),
        Command("fit, 324 rows", ("fit", plastic, *report), 15.0, 4.0),
        Command("fit, three channels", ("fit", paint, *report), 20.0, 6.0),
        Command("fit --no-mcmc", ("fit", plastic, "--no-mcmc", *report), None, 3.0),
        Command("fit --full", ("fit", plastic, "--full", *report), None, None),
        Command("check", ("check", plastic), None, 1.2),
        Command("convert", ("convert", plastic, str(folder / "x.parquet"), "--force"), None, 0.5),
        Command("design --for eta", ("design", plastic, "--for", "eta"), None, 3.0),
        Command("models --check", ("models", "--check"), 60.0, None),
        Command("fit --models all", ("fit", plastic, "--models", "all", "--no-mcmc", *report), 120.0, 30.0),
    ]
    if merl is not None:
        found.append(Command("fit, MERL", ("fit", str(merl), "--no-mcmc", *report), 12.0, 6.0))
    return found


def run(command: Command, cache: Path) -> Taken:
    """One process; its output is thrown away, a failure is not (3: a fit ended otherwise, with its report)."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("FITMAT_", "JAX_"))}
    environment["XDG_CACHE_HOME"] = str(cache)
    line = [sys.executable, "-m", "fitmat", *command.arguments]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryFile() as errors:
        seconds, process = machine.clocked(
            lambda: subprocess.Popen(line, env=environment, stdout=subprocess.DEVNULL, stderr=errors).wait()
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if process not in (0, 3):
            errors.seek(0)
            raise SystemExit(f"{' '.join(line)} ended with code {process}:\n{errors.read().decode()}")
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Taken(seconds, cpu, after.ru_maxrss / 1e6)


def row(name: str, taken: list[Taken], target: float | None) -> list[str]:
    """Medians of the runs, and the largest memory of any process so far."""
    wall, cpu = (np.median([getattr(one, field) for one in taken]) for field in ("wall", "cpu"))
    limit = "–" if target is None else f"{target:g}"
    return [name, f"{wall:.2f}", f"{max(one.wall for one in taken):.2f}", f"{cpu:.1f}", str(len(taken)), limit]


def memory(command: Command, cache: Path) -> float:
    """Largest resident memory of one process, GB, measured in a parent of its own."""
    program = (
        "import resource, subprocess, sys; subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, "
        "stderr=subprocess.DEVNULL); print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6)"
    )
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("FITMAT_", "JAX_"))}
    environment["XDG_CACHE_HOME"] = str(cache)
    line = [sys.executable, "-c", program, sys.executable, "-m", "fitmat", *command.arguments]
    return float(subprocess.run(line, env=environment, capture_output=True, text=True, check=True).stdout)


def main() -> None:
    """Run, time and print."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--repeats", type=int, default=5, help="timed runs of each command afterwards")
    options.add_argument("--firsts", type=int, default=3, help="timed first runs of each command that has a target")
    options.add_argument("--only", default="", help="only commands whose name contains this")
    options.add_argument("--merl", type=Path, help="a MERL file")
    chosen = options.parse_args()
    print(machine.described(), "\n")
    rows, peaks = [], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for command in commands(folder, chosen.merl):
            if chosen.only not in command.name:
                continue
            caches = [folder / f"cache {command.name} {k}" for k in range(max(1, chosen.firsts))]
            if command.first is not None:
                first = [run(command, cache) for cache in caches]
                rows.append(row(f"{command.name}, first", first, command.first))
                peaks.append([f"{command.name}, first", f"{memory(command, folder / f'peak {command.name}'):.2f}"])
            else:
                run(command, caches[0])
            if command.first is None or command.afterwards is not None:
                rows.append(
                    row(command.name, [run(command, caches[0]) for _ in range(chosen.repeats)], command.afterwards)
                )
                peaks.append([command.name, f"{memory(command, caches[0]):.2f}"])
    machine.show("medians", ["fitmat", "wall s", "slowest", "CPU s", "runs", "target"], rows)
    machine.show("largest resident memory", ["fitmat", "GB"], peaks)


if __name__ == "__main__":
    main()
