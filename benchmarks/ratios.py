"""Shows every ratio against a peer in one run, and how time grows with rows and with fits: ratios.md and ratios.png.

One fit of so many rows beside scipy's Levenberg–Marquardt (`fit.py`), so many small fits beside scipy in a pool of
processes (`textures.py`), and effective draws a second beside emcee with numpy (`sampling.py`); each checks first that
both sides find the same. The growth exponent is the slope of ln(time) against ln(size) by least squares, once over all
sizes and once from the middle one on: what does not grow with the size weighs on the small ones.

Run: python benchmarks/ratios.py [--repeats 5] [--out benchmarks]
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import fit
import jax
import machine
import matplotlib as mpl
import numpy as np
import sampling
import textures
from matplotlib.figure import Figure
from tables import replace_between, to_markdown

ROWS = (100, 1_000, 10_000, 100_000)
FITS = (1_000, 10_000, 100_000)
PEERS_FITS = (100, 400, 1_600)
"""Sizes; scipy fits fewer points, of which the time grows as their number."""

SAMPLED, STEPS = 500, 2000
"""Rows of the file that is sampled, and steps of emcee's own chains."""


class Line(NamedTuple):
    """Median seconds at each size."""

    name: str
    sizes: Sequence[int]
    seconds: np.ndarray

    def growth(self, begin: int = 0) -> float:
        """The slope of ln(seconds) against ln(size), from one of the sizes on."""
        return float(np.polyfit(np.log(self.sizes[begin:]), np.log(self.seconds[begin:]), 1)[0])

    def told(self) -> list[str]:
        """Its line of the table of growth."""
        ends = ", ".join(
            f"{size:,}: {machine.duration(taken)}" for size, taken in zip(self.sizes, self.seconds, strict=True)
        )
        return [self.name, ends, f"{self.growth():.2f}", f"{self.growth(len(self.sizes) // 2):.2f}"]


def of_rows(repeats: int) -> list[Line]:
    """One fit, by its rows."""
    every = [fit.race(rows, repeats, whole=True) for rows in ROWS]
    names = (fit.OURS, fit.PEER, fit.WHOLE)
    return [Line(name, ROWS, np.array([np.median(taken[name]) for taken in every])) for name in names]


def of_fits(repeats: int) -> list[Line]:
    """Many fits of 64 samples, by how many."""
    wi, wo = textures.geometry()
    value, sigma = textures.measured(max(FITS), wi, wo)
    taken, found = [], None
    for count in FITS:
        told = {"wi": wi, "wo": wo, "value": value[:count], "sigma": sigma[:count], "loss": "gaussian"}
        seconds, _, fits = textures.raced(["double"], repeats, **told)
        taken.append(np.median(seconds["double"]))
        found = fits["double"]
    assert found is not None
    textures.agree(found, wi, wo, value, sigma, 8, "gaussian")
    theirs = [
        np.median([count / textures.peers(wi, wo, value[:count], sigma[:count])[0] for _ in range(repeats)])
        for count in PEERS_FITS
    ]
    return [
        Line("fitmat.fit_many", FITS, np.array(taken)),
        Line("scipy, a pool of processes", PEERS_FITS, np.array(theirs)),
    ]


def figure(rows: Sequence[Line], fits: Sequence[Line]) -> Figure:
    """Time against rows and against fits, the growth exponent of each line beside it."""
    mpl.use("Agg")
    drawn = Figure(figsize=(11, 4.2), layout="constrained")
    for ax, lines, what in zip(
        drawn.subplots(1, 2), (rows, fits), ("rows of one fit", "fits of 64 samples"), strict=True
    ):
        for line in lines:
            growth = f"grows as size^{line.growth(len(line.sizes) // 2):.2f} at the end"
            ax.plot(line.sizes, line.seconds, "o-", label=f"{line.name}: {growth}")
        ax.set(xscale="log", yscale="log", xlabel=what, ylabel="seconds, warm")
        ax.grid(alpha=0.3)
        ax.legend(fontsize="small", loc="lower right")
        ax.set_ylim(bottom=min(line.seconds.min() for line in lines) / 20.0)
    return drawn


def ratios(rows: Sequence[Line], fits: Sequence[Line], draws: dict[str, float]) -> list[list[str]]:
    """Ours beside the peer's, ratio last."""
    found = []
    one, peer = rows[:2]
    for size, ours, theirs in zip(ROWS, one.seconds, peer.seconds, strict=True):
        found.append([f"one fit, {size:,} rows", *map(machine.duration, (ours, theirs)), f"{theirs / ours:.1f}"])
    best = fits[1].sizes[-1] / fits[1].seconds[-1]
    for size, ours in zip(FITS, fits[0].seconds, strict=True):
        found.append([f"{size:,} fits, a second", f"{size / ours:,.0f}", f"{best:,.0f}", f"{size / ours / best:.1f}"])
    for name, words in (("user", "one call a walker"), ("batched", "all walkers in one call")):
        ours, theirs = draws["fitmat.sample"], draws[name]
        what = f"effective draws a second, {SAMPLED} rows, emcee with numpy, {words}"
        found.append([what, f"{ours:,.0f}", f"{theirs:,.0f}", f"{ours / theirs:.1f}"])
    return found


def main() -> None:
    """Race, check, print, write the page and draw."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--repeats", type=int, default=5, help="timed runs of each rival")
    options.add_argument("--out", type=Path, default=Path(__file__).parent, help="folder of ratios.md and ratios.png")
    chosen = options.parse_args()
    jax.config.update("jax_enable_x64", True)
    where = machine.described()
    print(where, "\n")
    rows, fits = of_rows(chosen.repeats), of_fits(chosen.repeats)
    draws = sampling.race(SAMPLED, chosen.repeats, STEPS)
    tables = [
        to_markdown(["what", "fitmat", "peer", "ratio"], ratios(rows, fits, draws)),
        to_markdown(
            ["line", "seconds by size", "growth", "from the middle on"], [one.told() for one in (*rows, *fits)]
        ),
    ]
    told = f"{where}. Medians of {chosen.repeats} runs, compiled and warm."
    print("\n\n".join([told, *tables]))
    replace_between(chosen.out / "ratios.md", "ratios", "\n\n".join([told, *tables]))
    figure(rows, fits).savefig(chosen.out / "ratios.png", dpi=110)


if __name__ == "__main__":
    main()
