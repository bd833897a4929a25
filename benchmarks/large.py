"""A table of 2 GB, as CSV and as Parquet: fitted by chunks in bounded memory, each in a process of its own.

    python benchmarks/large.py --gigabytes 2

Peak memory is the resident set of the whole process, imports included, as the operating system counts it.
"""

import argparse
import json
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import machine  # noqa: E402
import numpy as np  # noqa: E402
import polars as pl  # noqa: E402

import fitmat as fm  # noqa: E402
from fitmat.measurements.large import chunks  # noqa: E402

TRUTH: dict[str, Any] = {"kd": 0.3, "ks": 0.8, "alpha": 0.25, "eta": 1.5}
BATCH = 400_000
JITTER = 1e-4
"""Degrees; encoders that are read at every sample make columns that do not compress."""
MARGIN = 1.2
"""Free disk space asked for, in units of the files."""
MEMORY = 1.5e9
"""Bytes of resident memory that a fit may take."""
SIGMAS = 5.0


def rows(count: int, seed: int, sigma: bool) -> Iterator[pl.DataFrame]:
    """Batches of measurements in their scanning order: incidence, azimuth, then the sensor from normal to grazing."""
    truth, rng = fm.model("lambert+ggx", **TRUTH), np.random.default_rng(seed)
    sensor = np.linspace(0.5, 85.0, 339)
    azimuth = np.linspace(0.0, 180.0, 361)
    incidences = np.linspace(2.0, 80.0, max(2, -(-count // (len(sensor) * len(azimuth)))))
    for first in range(0, count, BATCH):
        index = np.arange(first, min(first + BATCH, count))
        theta_o, scan = sensor[index % len(sensor)], index // len(sensor)
        phi, theta_i = azimuth[scan % len(azimuth)], incidences[scan // len(azimuth)]
        theta_i, theta_o, phi = (angle + JITTER * rng.normal(size=len(index)) for angle in (theta_i, theta_o, phi))
        light, sensed = np.deg2rad(theta_i), np.deg2rad(theta_o)
        wi = np.stack([np.sin(light), 0 * light, np.cos(light)], axis=1)
        turn = np.deg2rad(phi)
        wo = np.stack([np.sin(sensed) * np.cos(turn), np.sin(sensed) * np.sin(turn), np.cos(sensed)], axis=1)
        exact = fm.evaluate(truth, wi, wo)[:, 0]
        spread = np.hypot(1e-3, 0.02 * exact)
        table = {"theta_i": theta_i, "theta_o": theta_o, "phi": phi, "brdf": exact + spread * rng.normal(size=len(phi))}
        yield pl.DataFrame(table | ({"sigma": spread} if sigma else {}))


def written(folder: Path, gigabytes: float, sigma: bool) -> tuple[list[Path], int]:
    """The two files and their rows; as many as make a CSV of that size."""
    sample = next(rows(10_000, 0, sigma)).write_csv(float_precision=8)
    count = int(gigabytes * 1e9 / (len(sample) / 10_000))
    csv, pieces, parquet = folder / "large.csv", folder / "pieces", folder / "large.parquet"
    pieces.mkdir()
    with csv.open("wb") as file:
        for k, batch in enumerate(rows(count, 0, sigma)):
            batch.write_csv(file, include_header=k == 0, float_precision=8)
            batch.write_parquet(pieces / f"{k:06d}.parquet")
    pl.scan_parquet(pieces / "*.parquet").sink_parquet(parquet)
    shutil.rmtree(pieces)
    return [csv, parquet], count


def child(path: str) -> None:
    """Fit one file and print what it took as JSON."""
    passes: list[tuple[str, float]] = []

    def progress(what: str, done: int, total: int) -> None:
        if not passes or passes[-1][0] != what:
            passes.append((what, time.perf_counter()))
        del done, total

    begin = time.perf_counter()
    found = passes.fit_chunks(chunks.scan(path, progress=progress), "lambert+ggx", progress=progress)
    seconds = time.perf_counter() - begin
    sd = np.sqrt(np.diagonal(found.covariance))
    print(
        json.dumps(
            {
                "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024),
                "seconds": seconds,
                "begins": [(what, at - begin) for what, at in passes],
                "result": found.result,
                "discrepancy": found.discrepancy,
                "parameters": {e.name: [found.values[e.place.start], sd[e.place.start]] for e in found.entries},
            }
        )
    )


def report(path: Path, count: int) -> bool:
    """Fit a file in a fresh process and print the outcome; whether it is as it should be."""
    command = [sys.executable, __file__, "--child", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        print(f"{path.name}: failed\n{done.stderr}")
        return False
    found = json.loads(done.stdout.splitlines()[-1])
    size = path.stat().st_size / 1e9
    print(f"{path.name}: {size:.2f} GB, {count:,} rows; {found['result']} in {machine.duration(found['seconds'])}, ")
    print(f"  peak memory {found['peak'] / 1e9:.2f} GB; discrepancy {found['discrepancy']:.3g}")
    print("  " + ", ".join(f"{what} from {at:.0f} s" for what, at in found["begins"]))
    right = found["peak"] < MEMORY
    for name, (value, sd) in found["parameters"].items():
        off = (value - TRUTH[name]) / sd
        print(f"  {name} = {value:.7f} ± {sd:.1g}, {off:+.1f} sd from the truth")
        right &= abs(off) < SIGMAS
    return right


def main() -> int:
    """Make the files, fit them, remove them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gigabytes", type=float, default=2.0, help="size of the CSV")
    parser.add_argument("--no-sigma", action="store_true", help="leave σ out, so that it is estimated")
    parser.add_argument("--folder", type=Path, help="where to make the files; default the system's temporary folder")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        child(given.child)
        return 0
    with tempfile.TemporaryDirectory(dir=given.folder) as name:
        needed, free = 2 * MARGIN * given.gigabytes * 1e9, shutil.disk_usage(name).free
        if needed > free:
            print(f"{free / 1e9:.1f} GB free in {name}, {needed / 1e9:.1f} needed: give --folder or less --gigabytes.")
            return 0
        print(machine.described())
        paths, count = written(Path(name), given.gigabytes, not given.no_sigma)
        right = [report(path, count) for path in paths]
        return 0 if all(right) else 1


if __name__ == "__main__":
    sys.exit(main())
