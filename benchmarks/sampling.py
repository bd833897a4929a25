"""Shows how fast posteriors are sampled: effective draws per second of `fitmat.sample` beside emcee with numpy.

All sample the same posterior of Lambert + GGX from the same simulated file:

user      emcee as a user writes it: a numpy likelihood (`peer.py`), one call per walker, 32 walkers, stretch moves;
batched   the same with the numpy likelihood over all walkers at once (vectorize=True);
exchanged `fitmat.sample` itself with its compiled likelihood exchanged for the batched numpy one: what is left
          between it and `fitmat.sample` is due to compilation alone.

Effective draws: the smallest over the parameters of kept steps × walkers/τ; seconds: the whole run, burn-in included.
All start from Laplace draws. Ours is compiled and warm.

Run: python benchmarks/sampling.py [--rows 500] [--repeats 5] [--steps 4000]
"""

import argparse
import dataclasses
from unittest import mock

import emcee
import fit as fits
import jax
import machine
import numpy as np
from peer import Problem

import fitmat as fm
from fitmat.uncertainty import chains, density

WALKERS = 32
NAMES = ("kd", "ks", "ln alpha", "ln eta", "s")

SAME = 4.0
"""Means may differ by this many Monte Carlo standard errors, standard deviations likewise."""


@dataclasses.dataclass(frozen=True)
class Run:
    """What one run gave: draws (m, 5) in natural coordinates, effective draws of each coordinate, wall seconds."""

    draws: np.ndarray
    ess: np.ndarray
    seconds: float
    steps: int

    @property
    def rate(self) -> float:
        """Effective draws per second."""
        return float(self.ess.min()) / self.seconds

    def errors(self) -> np.ndarray:
        """Monte Carlo standard errors of the means."""
        return self.draws.std(axis=0) / np.sqrt(self.ess)


def natural(posterior: fm.Posterior) -> np.ndarray:
    """Draws as kd, ks, ln alpha, ln eta, s."""
    values = posterior.values
    return np.column_stack([values[:, :2], np.log(values[:, 2:]), posterior.discrepancy])


def fitmats(found: fm.Fit, seed: int) -> Run:
    """`fitmat.sample` with its defaults."""
    seconds, posterior = machine.clocked(lambda: fm.sample(found, seed=seed))
    assert posterior.diagnostics is not None
    return Run(natural(posterior), posterior.diagnostics.ess, seconds, posterior.diagnostics.steps)


def exchanged(found: fm.Fit, seed: int, peer: Problem) -> Run:
    """`fitmat.sample` with the numpy likelihood in place of the compiled one."""
    with mock.patch.object(chains, "log_posterior", return_value=peer.log_posterior):
        return fitmats(found, seed)


def users(found: fm.Fit, seed: int, peer: Problem, steps: int, *, vectorize: bool) -> Run:
    """emcee with stretch moves and the numpy likelihood."""
    start = natural(fm.laplace(found, seed=seed))[:WALKERS]

    def run() -> emcee.EnsembleSampler:
        sampler = emcee.EnsembleSampler(WALKERS, len(NAMES), peer.log_posterior, vectorize=vectorize)
        state = emcee.State(start, random_state=np.random.RandomState(seed).get_state())
        sampler.run_mcmc(state, steps)
        return sampler

    seconds, sampler = machine.clocked(run)
    tau = sampler.get_autocorr_time(tol=0)
    chain = sampler.get_chain(discard=int(np.ceil(5 * tau.max())))
    return Run(chain.reshape(-1, len(NAMES)), chain.shape[0] * WALKERS / tau, seconds, steps)


def agree(one: Run, other: Run) -> None:
    """Means and standard deviations are the same within Monte Carlo error."""
    spread = np.hypot(one.errors(), other.errors())
    means = np.abs(one.draws.mean(axis=0) - other.draws.mean(axis=0)) / spread
    # The standard error of a standard deviation is that of the mean over √2 for Gaussian tails, more for s ≥ 0.
    sds = np.abs(one.draws.std(axis=0) - other.draws.std(axis=0)) / spread
    assert max(means.max(), sds.max()) < SAME, f"not the same posterior: means {means}, sds {sds} standard errors apart"


def main() -> None:
    """Time, check and print."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rows", type=int, default=500, help="number of samples of the file")
    options.add_argument("--repeats", type=int, default=5, help="timed runs of each rival, each with its own seed")
    options.add_argument("--steps", type=int, default=4000, help="steps of emcee with numpy; 50 τ or more")
    chosen = options.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(machine.described(), "\n")
    race(chosen.rows, chosen.repeats, chosen.steps)


def race(rows: int, repeats: int, steps: int) -> dict[str, float]:
    """All of them in turn: effective draws a second, medians."""
    m = fits.measured(rows)
    found, peer = fm.fit(m, "lambert+ggx"), fits.problem(m, hoisted=True)
    check_density(found, peer)
    fitmats(found, 0)
    names = ("fitmat.sample", "user", "batched", "exchanged")
    runs: dict[str, list[Run]] = {name: [] for name in names}
    for seed in range(1, repeats + 1):
        runs["fitmat.sample"].append(fitmats(found, seed))
        runs["user"].append(users(found, seed, peer, steps, vectorize=False))
        runs["batched"].append(users(found, seed, peer, steps, vectorize=True))
        runs["exchanged"].append(exchanged(found, seed, peer))
    for name in names[1:]:
        agree(runs["fitmat.sample"][0], runs[name][0])
    return report(m.n_samples, runs)


def check_density(found: fm.Fit, peer: Problem) -> None:
    """Both log posteriors are the same function."""
    draws = natural(fm.laplace(found, seed=0))[:50]
    one, other = density.log_posterior(found)(draws), peer.log_posterior(draws)
    difference = float(np.max(np.abs(one - other)))
    singly = float(np.max(np.abs(other - [peer.log_posterior(x) for x in draws])))
    print(f"log posterior, compiled and numpy: largest difference {difference:.1e} at 50 draws")
    assert max(difference, singly) < 1e-6, "the two likelihoods differ"


def report(rows: int, runs: dict[str, list[Run]]) -> dict[str, float]:
    """Posterior means side by side, then the speeds, which are returned: effective draws a second, medians."""
    cells = [
        [name, *(f"{mean:.4f} ± {sd:.4f}" for mean, sd in zip(r.draws.mean(axis=0), r.draws.std(axis=0), strict=True))]
        for name, (r, *_) in runs.items()
    ]
    machine.show("posterior mean ± standard deviation", ["", *NAMES], cells)
    rate = {name: float(np.median([r.rate for r in every])) for name, every in runs.items()}
    ours = rate["fitmat.sample"]
    lines = []
    for name, every in runs.items():
        seconds, ess = (float(np.median(part)) for part in ([r.seconds for r in every], [r.ess.min() for r in every]))
        lines.append(
            [name, machine.duration(seconds), str(every[0].steps), f"{ess:.0f}", f"{rate[name]:.0f}",
             f"{ours / rate[name]:.1f} ×"]
        )  # fmt: skip
    headings = ["", "wall", "steps", "effective draws", "a second", "fitmat is faster"]
    machine.show(f"{rows} rows, medians of {len(runs['user'])}", headings, lines)
    return rate


if __name__ == "__main__":
    main()
