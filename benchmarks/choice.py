"""Simulates five kinds of surfaces and asks which of seven models the data prefer: how often is it the right one?

Each surface has parameters of its own, drawn at random, and is measured in the plane of incidence: 4 incidences × 31
angles, noise of 2 % + 0.001 sr⁻¹, σ stated. Candidates are fitted, approximated by `fitmat.laplace` and weighed by
`fitmat.choose`. The tables go to `choice.md` beside this script.

Run: python benchmarks/choice.py --surfaces 20
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import jax
import machine
import numpy as np
from tables import replace_between, to_markdown

import fitmat as fm
from fitmat.uncertainty.laplace import laplace_each

PAGE = Path(__file__).with_suffix(".md")
CANDIDATES = ("lambert+ggx", "lambert+beckmann", "oren-nayar", "oren-nayar+ggx", "lambert+blinn-phong",
    "ashikhmin-shirley", "lambert+ward")  # fmt: skip
INCIDENCES, SENSOR = np.deg2rad([10.0, 30.0, 50.0, 70.0]), np.deg2rad(np.arange(-75.0, 76.0, 5.0))


class Row(NamedTuple):
    """One surface.

    Attributes:
        truth: Its model.
        best: The candidate that `choose` names first.
        equals: How many are not clearly behind, it included.
        kept: Whether the truth is among these.
        by_value: The candidate with the highest elpd, single values left out.
        by_incidence: The same, incidences left out.
    """

    truth: str
    best: str
    equals: int
    kept: bool
    by_value: str
    by_incidence: str


def surfaces(rng: np.random.Generator) -> Mapping[str, dict[str, Any]]:
    """A surface of each kind."""
    alpha, kd, eta = (
        float(np.exp(rng.uniform(np.log(0.08), np.log(0.35)))),
        rng.uniform(0.05, 0.5),
        rng.uniform(1.4, 1.9),
    )
    exponent = 2.0 / alpha**2 - 2.0
    return {
        "lambert+ggx": {"kd": kd, "alpha": alpha, "eta": eta},
        "lambert+beckmann": {"kd": kd, "alpha": alpha, "eta": eta},
        "oren-nayar+ggx": {"kd": max(kd, 0.2), "sigma_n": rng.uniform(20.0, 40.0), "alpha": alpha, "eta": eta},
        "lambert+blinn-phong": {"kd": kd, "ks": rng.uniform(0.05, 0.3), "exponent": exponent},
        "ashikhmin-shirley": {"kd": kd, "f0": rng.uniform(0.04, 0.2), "exponent": exponent},
    }


def weighed(truth: str, values: Mapping[str, Any], seed: int) -> Row:
    """What the data say of one surface."""
    noise = {"relative_noise": 0.02, "absolute_noise": 1e-3}
    m = fm.simulate(fm.model(truth, **values), INCIDENCES, SENSOR, seed=seed, **noise)
    found = fm.choose(laplace_each(m, {name: {} for name in CANDIDATES}, seed=1))
    singly = {c.name: c.evidence.elpd for c in found.candidates if c.evidence is not None and c.weighed}
    whole = {c.name: float(c.left_out.elpd.sum()) for c in found.candidates if c.left_out is not None and c.weighed}
    equals = [c.name for c in found.equals]
    best = (max(scores, key=lambda name: scores[name]) for scores in (singly, whole))
    return Row(truth, found.best.name, len(equals), truth in equals, *best)


def write(rows: list[Row]) -> None:
    """The page."""
    lines = []
    for truth in dict.fromkeys(row.truth for row in rows):
        own = [row for row in rows if row.truth == truth]
        counts = (sum(part) for part in zip(*((r.best == truth, r.by_value == truth, r.by_incidence == truth, r.kept)
            for r in own), strict=True))  # fmt: skip
        wrong = sorted({row.best for row in own} - {truth})
        among = f"{np.mean([row.equals for row in own]):.1f}"
        lines.append((truth, *(f"{n} of {len(own)}" for n in counts), among, ", ".join(wrong) or "–"))
    headings = ("truth", "named first", "highest elpd, values", "highest elpd, incidences", "not clearly behind",
        "models not clearly behind", "named first instead")  # fmt: skip
    replace_between(PAGE, "choice", f"{machine.described()}\n\n{to_markdown(headings, lines)}")


def main() -> None:
    """Simulate, choose, write."""
    told = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    told.add_argument("--surfaces", type=int, default=20, help="of each kind")
    jax.config.update("jax_enable_x64", True)
    rows = []
    for seed in range(told.parse_args().surfaces):
        for truth, values in surfaces(np.random.default_rng(seed)).items():
            rows.append(weighed(truth, values, seed))
            print(seed, *rows[-1], flush=True)
    write(rows)


if __name__ == "__main__":
    main()
