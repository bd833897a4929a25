"""Simulates laboratories that agree or scatter: how often they are said to differ, how often the interval holds.

x_l = μ + a_l + e_l, e_l of the standard uncertainty u_l that the laboratory states, a_l of the standard deviation u_b
between laboratories. The stated u_l are drawn between half and twice their typical value. It is `agreement` alone that
is asked, the statistics of `fitmat labs`; no surface is fitted. The table goes to laboratories.md.

Run: python benchmarks/laboratories.py [--sets 2000]
"""

import argparse
from pathlib import Path

import numpy as np
from tables import replace_between, to_markdown

from fitmat.judgement.laboratories.agreement import agreement
from fitmat.judgement.laboratories.scales import LEVEL

PAGE = Path(__file__).with_name("laboratories.md")
COUNTS, BETWEEN = (2, 3, 5, 8), (0.0, 1.0, 2.0, 4.0)


def rates(count: int, between: float, sets: int) -> tuple[float, float]:
    """How often p is below `LEVEL`, and how often the 95 % interval holds μ = 0."""
    rng = np.random.default_rng([count, int(10 * between)])
    differ = held = 0
    for _ in range(sets):
        u = np.exp(rng.uniform(-np.log(2.0), np.log(2.0), count))
        found = agreement("x", between * rng.normal(size=count) + u * rng.normal(size=count), u)
        differ += found.p < LEVEL
        held += found.ci95[0] <= 0.0 <= found.ci95[1]
    return differ / sets, held / sets


def main() -> None:
    """Simulate, write."""
    told = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    told.add_argument("--sets", type=int, default=2000, help="of laboratories in each cell")
    sets = told.parse_args().sets
    lines = []
    for count in COUNTS:
        cells = [rates(count, between, sets) for between in BETWEEN]
        lines.append([str(count), *(f"{100 * differ:.1f} % / {100 * held:.1f} %" for differ, held in cells)])
        print(*lines[-1], flush=True)
    replace_between(PAGE, "laboratories", to_markdown(["laboratories", *(f"u_b = {b:g} u" for b in BETWEEN)], lines))


if __name__ == "__main__":
    main()
