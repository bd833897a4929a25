"""Shows how fast many small fits are: lambert+ggx at every point of a texture, beside scipy in a pool of processes.

Points of one channel, 64 samples each at the same directions, 2 % noise that is known, four parameters. A sample of the
points is fitted by `fitmat.fit` one by one, and must agree; another by `scipy.optimize.least_squares`, one process for
each core, from one start. Ours is compiled and warm, and includes starts, standard deviations and outcomes. With
`--precision double single` both take turns, and it says how far apart they end, in standard deviations.

Run: python benchmarks/textures.py [--points 1000 10000 100000] [--repeats 3] [--precision double single]
"""

import argparse
import multiprocessing
import os
import resource
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import jax
import machine
import numpy as np
import scipy.optimize

import fitmat as fm
from fitmat.measurements.samples import Measurements
from fitmat.models.values import values

SAMPLES = 64
"""Samples of a point."""

SAME = 1e-8
"""Largest relative difference of the parameters of two converged fits."""

LOW, HIGH = np.array([0.0, 0.0, 1e-4, 1.0]), np.array([1.0, 10.0, 1.0, 50.0])
START = np.array([0.4, 1.0, 0.3, 1.6])


def geometry() -> tuple[np.ndarray, np.ndarray]:
    """Directions of which most see the highlight."""
    rng = np.random.default_rng(3)
    turn = rng.uniform(0.0, 360.0, (3, SAMPLES))
    wi = fm.directions(rng.uniform(5.0, 75.0, SAMPLES), turn[0], degrees=True)
    h = fm.directions(np.abs(rng.normal(0.0, 18.0, SAMPLES)).clip(0.0, 80.0), turn[1], degrees=True)
    wo = 2.0 * np.sum(wi * h, axis=1, keepdims=True) * h - wi
    return wi, np.where(wo[:, 2:] > 0.1, wo, fm.directions(rng.uniform(0.0, 70.0, SAMPLES), turn[2], degrees=True))


def measured(count: int, wi: np.ndarray, wo: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values and σ of so many points, (count, n, 1)."""
    rng = np.random.default_rng(5)
    truth = rng.uniform([0.1, 0.5, 0.08, 1.3], [0.8, 1.5, 0.6, 2.2], (count, 4))
    value = values(fm.model("lambert+ggx", channels=1), truth, wi, wo)
    sigma = 0.02 * value + 1e-3
    return value + sigma * rng.normal(size=value.shape), sigma


def scipys(told: tuple[np.ndarray, ...]) -> np.ndarray:
    """One fit by scipy: the geometry once, then plain numpy."""
    wi, wo, value, sigma = told
    h = wi + wo
    h = h / np.linalg.norm(h, axis=1, keepdims=True)
    ci, co, ch2, c = wi[:, 2], wo[:, 2], h[:, 2] ** 2, np.sum(wi * h, axis=1)

    def residual(p: np.ndarray) -> np.ndarray:
        kd, ks, alpha, eta = p
        a2, g = alpha**2, np.sqrt(eta**2 + c**2 - 1.0)
        density = a2 / (np.pi * (ch2 * (a2 - 1.0) + 1.0) ** 2)
        ai, ao = (0.5 * (cos + np.sqrt(cos**2 + a2 * (1.0 - cos**2))) for cos in (ci, co))
        fresnel = 0.5 * ((g - c) / (g + c)) ** 2 * (1.0 + ((c * (g + c) - 1.0) / (c * (g - c) + 1.0)) ** 2)
        return (kd / np.pi + ks * fresnel * density / (ai * co + ao * ci - ci * co) / 4.0 - value) / sigma

    return scipy.optimize.least_squares(residual, START, bounds=(LOW, HIGH), x_scale=START).x


def peers(wi: np.ndarray, wo: np.ndarray, value: np.ndarray, sigma: np.ndarray) -> tuple[float, np.ndarray]:
    """Fits per second of a pool of processes, started before, and what it found."""
    cores = os.cpu_count() or 1
    told = [(wi, wo, value[k, :, 0], sigma[k, :, 0]) for k in range(len(value))]
    with ProcessPoolExecutor(cores, multiprocessing.get_context("spawn")) as pool:
        list(pool.map(scipys, told[: 4 * cores]))
        begin = time.perf_counter()
        found = np.array(list(pool.map(scipys, told, chunksize=20)))
        return len(value) / (time.perf_counter() - begin), found


def raced(
    precisions: Sequence[str], repeats: int, **told: Any
) -> tuple[dict[str, list[float]], dict[str, list[float]], dict[str, fm.Fits]]:
    """Wall and CPU seconds of each warm run in turn, and what was found, by precision."""
    fits = {name: fm.fit_many(**told, precision=name) for name in precisions}
    taken, busy = ({name: [] for name in precisions} for _ in range(2))
    for _ in range(repeats):
        for name in precisions:
            begin = time.process_time()
            seconds, fits[name] = machine.clocked(lambda name=name: fm.fit_many(**told, precision=name))
            taken[name].append(seconds)
            busy[name].append(time.process_time() - begin)
    return taken, busy, fits


def main() -> None:
    """Time, check and print."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--points", type=int, nargs="+", default=[1_000, 10_000, 100_000], help="sizes of textures")
    options.add_argument("--repeats", type=int, default=3, help="timed runs of each size")
    options.add_argument("--loss", nargs="+", default=["gaussian", "default"], help="losses; the first is compared")
    options.add_argument(
        "--precision", nargs="+", default=["double"], help="those of fm.fit_many; the first is compared"
    )
    options.add_argument("--single", type=int, default=40, help="points that are fitted one by one")
    options.add_argument("--peer", type=int, default=400, help="points that scipy fits")
    chosen = options.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(machine.described(), "\n")
    wi, wo = geometry()
    value, sigma = measured(max(chosen.points), wi, wo)
    rows, found = [], None
    for loss in chosen.loss:
        for count in chosen.points:
            told = {"value": value[:count], "sigma": sigma[:count], "loss": loss}
            fits = timed(rows, f"{count} points, {loss}", chosen.precision, chosen.repeats, wi=wi, wo=wo, **told)
            found = fits if loss == chosen.loss[0] else found
    machine.show(f"fastest of {chosen.repeats}", ["", "fits a second", "CPU a fit", "peak memory", ""], rows)
    assert found is not None
    agree(found, wi, wo, value, sigma, chosen.single, chosen.loss[0])
    rate, theirs = peers(wi, wo, value[: chosen.peer], sigma[: chosen.peer])
    apart = np.abs(theirs / found.values[: chosen.peer] - 1.0).max(axis=1)
    print(
        f"scipy, {os.cpu_count()} processes: {rate:,.0f} fits a second; {np.mean(apart < 1e-3):.1%} end at our optimum"
    )


def timed(rows: list[list[str]], what: str, precisions: Sequence[str], repeats: int, **told: Any) -> fm.Fits:
    """A row for each precision, and of all but the first how far it ends from the first, whose fits are returned."""
    taken, busy, fits = raced(precisions, repeats, **told)
    peak, first = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6, precisions[0]
    for name, one in fits.items():
        count = one.outcome.size
        rate, work = count / min(taken[name]), 1e6 * min(busy[name]) / count
        rows.append([f"{what}, {name}", f"{rate:,.0f}", f"{work:.1f} µs", f"{peak:.2f} GB", str(one)])
    for name in precisions[1:]:
        both = (fits[first].result == "converged") & (fits[name].result == "converged")
        apart = (np.abs(fits[name].values - fits[first].values) / fits[first].sd)[both].max(axis=-1)
        other = np.count_nonzero(fits[name].outcome != fits[first].outcome)
        print(
            f"{what}: {name} is {min(taken[first]) / min(taken[name]):.2f} times as fast as {first}; parameters are "
            f"{np.median(apart):.1e} sd apart (99.9 %: {np.quantile(apart, 0.999):.1e}, most: {apart.max():.1e}), "
            f"{other} outcomes differ"
        )
    return fits[first]


def agree(
    found: fm.Fits, wi: np.ndarray, wo: np.ndarray, value: np.ndarray, sigma: np.ndarray, count: int, loss: str
) -> None:
    """Say how far the fits are from single ones."""
    apart, score = [], []
    for k in np.linspace(0, len(found.outcome) - 1, count).astype(int):
        m = Measurements(wi, wo, value[k], sigma[k], np.ones_like(value[k], bool), ("value",))
        one = fm.fit(m, "lambert+ggx", loss=loss)
        if one.result == found.result[k] == "converged":
            apart.append(np.abs(found.values[k] / one.values - 1.0).max())
            score.append(found.log_likelihood[k] - one.log_likelihood)
    print(
        f"{len(apart)} of {count} single fits converged as well: parameters within {max(apart):.1e} (median "
        f"{np.median(apart):.1e}), log-likelihoods within {np.abs(score).max():.1e}"
    )
    assert max(apart) < SAME, "many fits are not the single ones"


if __name__ == "__main__":
    main()
