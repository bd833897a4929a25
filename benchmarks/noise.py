"""How right the noise is that is estimated where no sigma is given: estimated over true, by step, lobe and noise.

A diffuse base of 0.3 under a GGX lobe (formulas of `wrong_truths`, not fitmat's), four incidences in the plane, −80° to
80°. The tables go to `noise.md` beside this script.

Run: python benchmarks/noise.py --repeats 20
"""

import argparse
from pathlib import Path

import numpy as np
from tables import replace_between, to_markdown
from wrong_truths import specular

import fitmat as fm
from fitmat.judgement.doubts import SPARSE
from fitmat.maths.directions import from_angles
from fitmat.measurements.noise import measured_noise

PAGE = Path(__file__).with_suffix(".md")
STEPS, ALPHAS = (1.0, 2.0, 5.0, 10.0, 15.0), (0.02, 0.1, 0.3, 0.5)
FLOOR = 0.03
"""Absolute noise in sr⁻¹ of relative noise 1: a third of what the base has of it."""
NOISES = {
    "0.1 %": (1e-3, 1e-3 * FLOOR, 0.0),
    "0.5 %": (5e-3, 5e-3 * FLOOR, 0.0),
    "2 %": (0.02, 0.02 * FLOOR, 0.0),
    "5 %": (0.05, 0.05 * FLOOR, 0.0),
    "0.001 sr⁻¹ only": (0.0, 1e-3, 0.0),
    "2 %, alike along the curve (ρ 0.7)": (0.02, 0.02 * FLOOR, 0.7),
}
"""Relative and absolute part, and the correlation from one angle to the next."""

TOLERATED = 0.3


def estimated(step: float, alpha: float, noise: tuple[float, float, float], seed: int) -> tuple[float, bool]:
    """Median of estimated over true σ, and whether the report says that errors are taken as independent."""
    relative, absolute, rho = noise
    rng, sensor = np.random.default_rng(seed), np.deg2rad(np.arange(-80.0, 80.01, step))
    theta_i, theta_o = (part.ravel() for part in np.meshgrid(np.deg2rad([10.0, 30, 50, 70]), sensor, indexing="ij"))
    wi = from_angles(theta_i, np.zeros_like(theta_i))
    wo = from_angles(np.abs(theta_o), np.where(theta_o >= 0, np.pi, 0.0))
    exact = 0.3 / np.pi + specular(wi, wo, alpha, 1.5)
    error = rng.normal(size=(4, len(sensor)))
    for k in range(1, len(sensor)):
        error[:, k] = rho * error[:, k - 1] + np.sqrt(1.0 - rho**2) * error[:, k]
    sigma = np.hypot(absolute, relative * exact)
    found = measured_noise(fm.from_arrays(theta_i, theta_o, exact + sigma * error.ravel()))
    return float(np.median(found.sigma[:, 0] / sigma)) if found.known else np.nan, "independent" in found.words


def cell(step: float, alpha: float, noise: tuple[float, float, float], repeats: int) -> tuple[str, bool]:
    """One cell as text, and whether it is right, or said to be a bound, unknown or conditional."""
    ratios, conditional = np.array([estimated(step, alpha, noise, seed) for seed in range(repeats)]).T
    middle = float(np.median(ratios))
    bound, if_independent = np.deg2rad(step) > SPARSE * alpha, conditional.mean() > 0.5
    right = abs(middle - 1.0) <= TOLERATED
    said = right or (middle < 1.0 and if_independent) or (middle > 1.0 and bound) or not np.isfinite(middle)
    mark = " ?" if said and not right and middle < 1.0 else " ≤" if bound else "" if right else " ✗"
    return f"{middle:.2f}{mark}", bool(said)


def main() -> None:
    """Simulate, estimate, write; fail where a cell is wrong without a word."""
    told = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    told.add_argument("--repeats", type=int, default=20, help="of each cell")
    repeats, rows, wrong = told.parse_args().repeats, [], []
    for name, noise in NOISES.items():
        for alpha in ALPHAS:
            cells = [cell(step, alpha, noise, repeats) for step in STEPS]
            rows.append((name, f"{alpha:g}", *(text for text, _ in cells)))
            wrong += [f"{name}, alpha {alpha:g}, {s:g}°" for s, (_, fine) in zip(STEPS, cells, strict=True) if not fine]
            print(*rows[-1], sep=" | ", flush=True)
    replace_between(PAGE, "noise", to_markdown(("noise", "alpha", *(f"{step:g}°" for step in STEPS)), rows))
    if wrong:
        raise SystemExit(f"wrong by more than {TOLERATED:.0%} and not said: {'; '.join(wrong)}")


if __name__ == "__main__":
    main()
