"""Shows what waiting for the command line means: wall seconds of whole processes, imports and compilation included.

    fitmat --help                      against 0.4 s, the pause that still feels immediate
    fitmat fit FILE, the first time    both default models, posterior and report, 500 rows; nothing compiled yet
    fitmat fit FILE, afterwards        the same with the compiled programs kept from the first run

"The first time" means an empty cache folder (XDG_CACHE_HOME points to a new folder), so that matplotlib's list of
fonts is made anew as well. There is no peer to race: nothing else makes this report.

Run: python benchmarks/commands.py [--rows 500] [--repeats 5]
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import machine
import numpy as np

TARGETS = {"fitmat --help": 0.4, "fitmat fit, first time": 15.0, "fitmat fit, afterwards": 9.0}
"""Seconds, on two cores."""

INCIDENCES = ("10", "25", "40", "55", "70")


def fitmat(*arguments: str, cache: Path) -> float:
    """Wall seconds of one command with its own cache folder; its output is thrown away, a failure is not."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache)}
    command = [sys.executable, "-m", "fitmat", *arguments]
    seconds, done = machine.clocked(
        lambda: subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    )
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)} ended with code {done.returncode}:\n{done.stderr}")
    return seconds


def simulated(folder: Path, rows: int) -> Path:
    """A file of about `rows` samples of satin plastic."""
    angles = np.linspace(-80, 80, rows // len(INCIDENCES))
    grid = "--theta-o=" + ",".join(f"{angle:.3f}" for angle in angles)
    material = ("--set", "kd=0.3", "--set", "alpha=0.2", "--set", "eta=1.5")
    file = folder / "satin.csv"
    incidences = f"--theta-i={','.join(INCIDENCES)}"
    fitmat("simulate", "lambert+ggx", *material, incidences, grid, "--out", str(file), cache=folder / "warm-up")
    return file


def once(folder: Path, file: Path, run: int) -> dict[str, float]:
    """Seconds of each command, in turn."""
    cache, out = folder / f"cache-{run}", str(folder / f"report-{run}")
    fit = ("fit", str(file), "--out", out, "--force", "--seed", "1")
    seconds = (fitmat("--help", cache=cache), fitmat(*fit, cache=cache), fitmat(*fit, cache=cache))
    if not any((cache / "fitmat").rglob("*")):
        raise SystemExit(f"{cache} holds no compiled programs: XDG_CACHE_HOME is not honoured on this platform")
    return dict(zip(TARGETS, seconds, strict=True))


def main() -> None:
    """Run, time and print."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rows", type=int, default=500, help="number of samples of the file")
    options.add_argument("--repeats", type=int, default=5, help="timed runs of each command")
    chosen = options.parse_args()
    print(machine.described(), "\n")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = simulated(folder, chosen.rows)
        runs = [once(folder, file, run) for run in range(chosen.repeats)]
    rows = []
    for command, target in TARGETS.items():
        seconds = np.array([run[command] for run in runs])
        limit = machine.duration(target)
        rows.append([command, machine.duration(np.median(seconds)), machine.duration(seconds.max()), limit])
    machine.show(f"{chosen.rows} rows, medians of {chosen.repeats}", ["", "median", "slowest", "target"], rows)


if __name__ == "__main__":
    main()
