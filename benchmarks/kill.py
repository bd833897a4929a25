"""Kills sampling runs and batches with `kill -9` and shows that they go on to the very same result.

A process fits a simulated file and samples the posterior with checkpoints; it is killed at random moments of the
sampling, several times in one run, and started again until it finishes. Then its chain must be, bit for bit, that of a
run that nobody killed.

With --batch, `fitmat batch` of two workers studies small files, of which some are broken; at random moments it or one
of its workers is killed, and the same command goes on. Then its table must be that of a run that nobody killed.

Run: python benchmarks/kill.py [--batch] [--kills 20] [--seed 0]
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import batch
import numpy as np

ATTEMPTS = 4
"""Kills that one run meets at most before it is left to finish."""

STEPS = 2000
"""Cap on the steps of a run: some seconds."""

GOOD, BROKEN = 14, 2
"""Files of a batch."""


def child(folder: Path, out: Path, cache: Path) -> None:
    """Fit, say that sampling begins and from which step, sample, and write the chain."""
    import jax

    import fitmat as fm
    from fitmat.uncertainty.chains import resumable_steps

    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_compilation_cache_dir", str(cache))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    truth = fm.model("lambert+ggx", kd=0.3, ks=1.0, alpha=0.3, eta=1.5)
    measured = fm.simulate(
        truth,
        np.deg2rad([20.0]),
        np.deg2rad(np.linspace(-80, 80, 500)),
        relative_noise=0.02,
        absolute_noise=1e-3,
        seed=1,
    )
    found = fm.fit(measured, "lambert+ggx")
    fm.sample(found, seed=1, max_steps=1)  # compiled before the clock starts
    print(resumable_steps(found, seed=1, checkpoint=folder, max_steps=STEPS), flush=True)
    begin = time.perf_counter()
    posterior = fm.sample(found, seed=1, checkpoint=folder, max_steps=STEPS)
    seconds = time.perf_counter() - begin
    assert posterior.chain is not None
    np.savez(out, chain=posterior.chain, seconds=seconds)


def started(folder: Path, out: Path, cache: Path) -> tuple[subprocess.Popen[str], int]:
    """The process at the moment when its sampling begins, and the step from which it goes on."""
    command = [sys.executable, __file__, "--child", str(folder), str(out), str(cache)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    return process, int(process.stdout.readline())


def finished(folder: Path, out: Path, cache: Path) -> dict[str, np.ndarray]:
    """What a process writes that nobody kills."""
    process, at = started(folder, out, cache)
    assert process.wait() == 0
    with np.load(out) as arrays:
        return {"from": np.array(at), **arrays}


def main() -> None:
    """Sampling or batches."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--kills", type=int, default=20, help="how many in all")
    options.add_argument("--seed", type=int, default=0, help="of the moments")
    options.add_argument("--batch", action="store_true", help="batches instead of sampling")
    options.add_argument("--child", nargs=3, type=Path, help=argparse.SUPPRESS)
    chosen = options.parse_args()
    if chosen.child:
        child(*chosen.child)
        return
    kill = batches if chosen.batch else samplings
    kill(chosen.kills, np.random.default_rng(chosen.seed))


def batches(kills: int, rng: np.random.Generator) -> None:
    """Kill a batch or one of its workers, go on, compare."""
    left, run = kills, 0
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        scans, cache = place / "scans", place / "cache"
        batch.write(scans, GOOD, BROKEN)
        batch.run([scans], place / "compiling", 2, cache)
        whole = batch.run([scans], place / "whole", 2, cache)
        print(f"not killed: {len(whole.table)} rows, {whole.wall:.1f} s")
        while left:
            run += 1
            out, met = place / f"run {run}", []
            line, environment = batch.line([scans], out, 2), batch.environment(cache)
            for _ in range(min(left, int(rng.integers(1, ATTEMPTS + 1)))):
                process = subprocess.Popen(line, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                time.sleep(rng.uniform(0.0, 0.9) * whole.wall)
                victims = {process.pid: "the batch"} | dict.fromkeys(workers(process.pid), "a worker")
                pid = int(rng.choice(list(victims)))
                if process.poll() is not None:
                    break  # too late
                os.kill(pid, signal.SIGKILL)
                process.wait()
                met.append(victims[pid])
                left -= 1
            end = batch.run([scans], out, 2, cache)
            same = end.table.drop("seconds").equals(whole.table.drop("seconds"))
            told = "the same table" if same else "ANOTHER TABLE"
            print(f"run {run}: killed {', '.join(met) or 'nothing'}; {told}", flush=True)
            assert same


def workers(parent: int) -> list[int]:
    """Processes in which a batch works, by Linux's list of children."""
    children = Path(f"/proc/{parent}/task/{parent}/children")
    if not children.exists():
        return []
    commands = {int(pid): Path(f"/proc/{pid}/cmdline").read_bytes() for pid in children.read_text().split()}
    return [pid for pid, command in commands.items() if b"spawn_main" in command]


def samplings(kills: int, rng: np.random.Generator) -> None:
    """Kill, resume, compare."""
    left, run = kills, 0
    with tempfile.TemporaryDirectory() as name:
        place, cache = Path(name), Path(name) / "compiled"
        whole = finished(place / "whole", place / "whole.npz", cache)
        steps, seconds = whole["chain"].shape, float(whole["seconds"])
        print(f"not killed: {steps[0]} steps of {steps[1]} walkers after burn-in, {seconds:.2f} s")
        while left:
            run += 1
            folder, moments = place / f"run{run}", []
            for _ in range(min(left, int(rng.integers(1, ATTEMPTS + 1)))):
                process, at = started(folder, place / "killed.npz", cache)
                time.sleep(rng.uniform(0.0, 0.8) * seconds * (1.0 - at / STEPS))
                process.kill()
                if process.wait() == 0:
                    break  # too late
                moments.append(at)
                left -= 1
            end = finished(folder, place / f"run{run}.npz", cache)
            same = end["chain"].tobytes() == whole["chain"].tobytes()
            print(f"run {run}: killed {len(moments)} times; began at steps {[*moments, int(end['from'])]}; ", end="")
            print("the same chain, bit for bit" if same else "ANOTHER CHAIN", flush=True)
            assert same


if __name__ == "__main__":
    main()
