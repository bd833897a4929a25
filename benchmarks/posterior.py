"""Checks emcee's posteriors by NUTS: means and both 95 % limits of every parameter on six data sets.

Each file is fitted with both default models and sampled by `fitmat.sample`; `fitmat.check_posterior` samples the same
density by blackjax and compares. The table goes to `posterior.md` beside this script. Differences are in Monte Carlo
standard errors; the script ends with an error where a sampler that converged disagrees.

Run: FITMAT_DATA=…/data python benchmarks/posterior.py
"""

import os
import sys
import time
from pathlib import Path

import jax
import machine
import numpy as np

import fitmat as fm
from fitmat.uncertainty.second_sampler import AGREEING, SecondOpinion

HERE = Path(__file__).parent
SYNTHETIC = ("dull-plastic", "no-sigma-rubber", "one-curve")
MODELS = ("lambert+blinn-phong", "lambert+ggx")
EXCHANGED = "theta_i=phi_i,phi_i=theta_i,theta_o=phi_o,phi_o=theta_o"  # a file that calls the zenith angle phi
HEADINGS = ("file", "model", "verdict", "mean", "2.5 %", "97.5 %", "divergent", "draws of NUTS", "emcee", "seconds")


def files() -> dict[str, fm.Measurements]:
    """Three of the catalogue and, where they are at hand, three measured ones."""
    found = {name: fm.read(HERE.parent / "data" / "synthetic" / f"{name}.csv") for name in SYNTHETIC}
    shared = Path(os.environ.get("FITMAT_DATA") or HERE.parents[1] / "shared" / "data")
    if shared.is_dir():
        for path in sorted((shared / "ua-loft" / "zemax").glob("*.bsdf")):
            found[path.stem] = fm.read(path)
        found["starlink chassis"] = fm.read(shared / "starlink" / "chassis_brdf.csv", columns=EXCHANGED)
    return found


def row(name: str, model: str, opinion: SecondOpinion, seconds: float) -> tuple[str, ...]:
    """One line of the table: the largest differences over the parameters."""
    worst = np.max([a.distance for a in opinion.agreements], axis=0)
    apart = (f"{x:.1f}" for x in worst)
    tail = (f"{100 * opinion.diverging:.1f} %", f"{opinion.ess:.0f}", opinion.posterior.verdict, f"{seconds:.0f}")
    return name, model, opinion.verdict, *apart, *tail


def main() -> None:
    """Sample everything twice, write the table, and fail where the samplers disagree."""
    jax.config.update("jax_enable_x64", True)
    rows, disagreeing = [], []
    for name, measurements in files().items():
        for model in MODELS:
            posterior = fm.sample(fm.fit(measurements, model), seed=1)
            begin = time.perf_counter()
            opinion = fm.check_posterior(posterior, seed=2)
            rows.append(row(name, model, opinion, time.perf_counter() - begin))
            print(" | ".join(rows[-1]), flush=True)
            if opinion.verdict == "disagree":
                disagreeing.append(opinion.words)
    lines = [f"| {' | '.join(cells)} |" for cells in (HEADINGS, ("---",) * len(HEADINGS), *rows)]
    text = (
        "# Two samplers, one posterior\n\nemcee's means and 95 % limits beside those of NUTS; largest difference over "
        f"all parameters in Monte Carlo standard errors, agreeing up to {AGREEING:g}. Made by `python "
        f"benchmarks/posterior.py`.\n\n{machine.described()}\n\n" + "\n".join(lines) + "\n"
    )
    (HERE / "posterior.md").write_text(text, encoding="utf-8")
    sys.exit("\n".join(disagreeing))


if __name__ == "__main__":
    main()
