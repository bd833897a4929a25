"""Fits of spectra: whether their intervals hold what was planted, and how long they take beside a fit of one band.

Random plastics and metals of 31 bands, written here in NumPy from the papers and not from fitmat; fitted with a law of
the refractive index. Shares of the 95 % intervals of kd(λ), η(λ) and κ(λ) that hold the truth, and the seconds of CPU
of both numbers of bands, taken in turn, go to `spectra.md` beside this script.

Run: python benchmarks/spectra.py --repeats 200; --bands 1 3 31 1000 --repeats 0 prints times alone.
"""

import argparse
import dataclasses
import resource
import time
from collections.abc import Callable
from pathlib import Path

import jax
import machine
import numpy as np
from tables import replace_between, to_markdown

import fitmat as fm

PAGE = Path(__file__).with_suffix(".md")
ROWS = 500
NM = np.linspace(400.0, 700.0, 31)
THETA_I, THETA_O = (10.0, 30.0, 45.0, 60.0, 75.0), np.arange(-78.0, 79.0, 4.0)
RELATIVE, FLOOR = 0.02, 1e-3
"""Noise, as a fraction of the true value and in sr⁻¹."""

Z95 = 1.959963984540054
TIMES = 4
"""Repeats of each time, of which the least counts."""


@dataclasses.dataclass(frozen=True)
class Surface:
    """A surface of 31 bands: Lambert under GGX, ks = 1.

    Attributes:
        kd: (31,).
        alpha: Slope.
        index: η + iκ, (31,).
    """

    kd: np.ndarray
    alpha: float
    index: np.ndarray

    def measured(self, rng: np.random.Generator) -> fm.Measurements:
        """Five incidences in the plane, with noise whose σ is told."""
        theta_i, theta_o = (np.deg2rad(part.ravel()) for part in np.meshgrid(THETA_I, THETA_O, indexing="ij"))
        exact = self.kd / np.pi + facets(theta_i, theta_o, self.alpha, self.index)
        sigma = np.hypot(FLOOR, RELATIVE * exact)
        noisy = exact + sigma * rng.standard_normal(exact.shape)
        return fm.from_arrays(theta_i, theta_o, noisy, sigma=sigma, channels=[f"{nm:g}" for nm in NM])


def facets(theta_i: np.ndarray, theta_o: np.ndarray, alpha: float, index: np.ndarray) -> np.ndarray:
    """F D G/(4 c_i c_o) in the plane of incidence, theta_o positive on the mirror side, (n, c).

    GGX of Walter et al. 2007, eq. 33; masking and shadowing height-correlated (Heitz 2014, eqs. 72 and 99); Fresnel's
    amplitudes with the complex Snell's law (Born & Wolf, sec. 14.4), (|r_s|² + |r_p|²)/2.
    """
    lean, half = 0.5 * (theta_o - theta_i), 0.5 * (theta_o + theta_i)
    density = alpha**2 / (np.pi * np.cos(lean) ** 4 * (alpha**2 + np.tan(lean) ** 2) ** 2)
    hidden = sum((np.sqrt(1.0 + alpha**2 * np.tan(theta) ** 2) - 1.0) / 2.0 for theta in (theta_i, theta_o))
    inside = np.arcsin(np.sin(half)[:, None] / index.astype(complex))
    c, t = np.cos(half)[:, None], np.cos(inside)
    r_s, r_p = (c - index * t) / (c + index * t), (index * c - t) / (index * c + t)
    fresnel = 0.5 * (np.abs(r_s) ** 2 + np.abs(r_p) ** 2)
    return fresnel * (density / (1.0 + hidden) / (4.0 * np.cos(theta_i) * np.cos(theta_o)))[:, None]


def plastic(rng: np.random.Generator) -> Surface:
    """A coloured base under a clear solid of Cauchy's law, from acrylic to dense flint."""
    kd = rng.uniform(0.05, 0.2) + rng.uniform(0.1, 0.4) * np.exp(-(((NM - rng.uniform(430, 670)) / 60.0) ** 2))
    eta = rng.uniform(1.4, 1.7) + rng.uniform(0.003, 0.013) / (1e-3 * NM) ** 2
    return Surface(kd, rng.uniform(0.08, 0.3), eta)


def metal(rng: np.random.Generator) -> Surface:
    """Free electrons of Drude over a dull haze, from silver to aluminium."""
    energy = 1239.8419843320026 / NM  # eV
    first, plasma, damping = rng.uniform(1.5, 6.0), rng.uniform(8.0, 13.0), rng.uniform(0.1, 0.6)
    index = np.sqrt(first - plasma**2 / (energy * (energy + 1j * damping)))
    return Surface(rng.uniform(0.01, 0.05) * (1.0 + NM / 700.0), rng.uniform(0.08, 0.3), index)


@dataclasses.dataclass(frozen=True)
class Case:
    """Which surfaces, and how they are fitted."""

    make: Callable[[np.random.Generator], Surface]
    model: str
    law: str
    fixed: dict[str, float]


CASES = {
    "plastic": Case(plastic, "lambert+ggx", "cauchy", {"ks": 1.0}),
    "plastic, no formula": Case(plastic, "lambert+ggx", "smooth", {"ks": 1.0}),
    "metal": Case(metal, "lambert+ggx-conductor", "drude", {"ks": 1.0}),
    "metal, no formula": Case(metal, "lambert+ggx-conductor", "smooth-metal", {"ks": 1.0}),
}


def scores(case: Case, seed: int) -> dict[str, np.ndarray]:
    """(estimate − truth)/sd of kd, η and κ of every band."""
    rng = np.random.default_rng(seed)
    truth = case.make(rng)
    fit = fm.fit(truth.measured(rng), case.model, dispersion=case.law, fixed=case.fixed)
    index, kd = fm.indices(fit), fit["kd"]
    found = {"kd(λ)": (kd.value - truth.kd) / kd.sd, "η(λ)": (index.eta - np.real(truth.index)) / index.eta_sd}
    if np.iscomplexobj(truth.index):
        found["κ(λ)"] = (index.kappa - np.imag(truth.index)) / index.kappa_sd
    return found


def covered(repeats: int) -> list[list[str]]:
    """A row of the table for each case and quantity: the share, its standard error, how many have no interval."""
    rows = []
    for name, case in CASES.items():
        every = [scores(case, seed) for seed in range(repeats)]
        for quantity in every[0]:
            z = np.stack([one[quantity] for one in every])
            shares = (np.abs(z) < Z95).mean(axis=1)  # no interval holds nothing
            error = shares.std(ddof=1) / np.sqrt(repeats)
            told = [f"{100 * shares.mean():.1f} ± {100 * error:.1f} %", f"{z[np.isfinite(z)].std():.2f}"]
            rows.append([name, case.law, quantity, *told, str(int((~np.isfinite(z)).any(axis=1).sum()))])
            print(*rows[-1], sep=" | ", flush=True)
    return rows


def timed(bands: int) -> fm.Measurements:
    """A plastic whose colour is a band of light, five incidences, with noise that is told."""
    nm, rng = np.linspace(400.0, 700.0, bands), np.random.default_rng(0)
    kd = 0.2 + 0.3 * np.exp(-(((nm - 600.0) / 60.0) ** 2))
    truth = fm.model("lambert+ggx", channels=bands, kd=kd, alpha=0.2, eta=1.5)
    theta_i = np.repeat(np.deg2rad([10.0, 30.0, 45.0, 60.0, 70.0]), ROWS // 5)
    theta_o = np.tile(np.deg2rad(np.linspace(-80.0, 80.0, ROWS // 5)), 5)
    empty = fm.from_arrays(theta_i, theta_o, np.ones((ROWS, bands)))
    value = fm.evaluate(truth, empty.wi, empty.wo)
    sigma = 0.02 * value + 1e-3
    noisy = value + sigma * rng.standard_normal(value.shape)
    return fm.from_arrays(theta_i, theta_o, noisy, sigma=sigma, channels=[f"{x:g}" for x in nm])


def seconds(bands: list[int]) -> list[list[str]]:
    """A row for each number of bands and law: least seconds of CPU, programs at hand, the rivals in turn."""
    ways = [(count, law) for count in bands for law in ((None,) if count == 1 else (None, "cauchy"))]
    found: dict[tuple[int, str | None], list[tuple[float, float]]] = {way: [] for way in ways}
    data = {count: timed(count) for count in bands}
    for turn in range(TIMES + 1):
        for count, law in ways:
            begin = time.process_time()
            fit = fm.fit(data[count], "lambert+ggx", dispersion=law, fixed={} if law is None else {"ks": 1.0})
            middle = time.process_time()
            fit.covariance  # noqa: B018
            if turn:  # the first compiles
                found[count, law].append((middle - begin, time.process_time() - middle))
    best = {way: np.min(each, axis=0) for way, each in found.items()}
    one = best[ways[0]]
    rows = [
        [str(count), law or "an index a band", f"{fit:.3f}", f"{fit / one[0]:.1f}", f"{interval:.3f}"]
        for (count, law), (fit, interval) in best.items()
    ]
    for row in rows:
        print(*row, sep=" | ", flush=True)
    print(f"at most {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")
    return rows


def main() -> None:
    """Cover, time, write; without repeats print times alone."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--bands", type=int, nargs="+", default=[1, 3, 31], help="the first is what others are beside")
    options.add_argument("--repeats", type=int, default=200, help="surfaces of each kind; 0 for times alone")
    chosen = options.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(machine.described(), "\n")
    times = seconds(chosen.bands)
    if not chosen.repeats:
        return
    heads = ["bands", "index", "`fm.fit`, s of CPU", "times one band", "intervals, s of CPU"]
    shares = [
        "surface",
        "law",
        "of",
        "95 % intervals that hold the truth",
        "sd of (found − true)/sd",
        "without interval",
    ]
    replace_between(PAGE, "times", f"{machine.described()}\n\n{to_markdown(heads, times)}")
    told = f"{chosen.repeats} surfaces of each kind.\n\n{to_markdown(shares, covered(chosen.repeats))}"
    replace_between(PAGE, "coverage", told)


if __name__ == "__main__":
    main()
