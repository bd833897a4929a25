"""Shows that posteriors are as sure as they say: simulation-based calibration of both default models.

Truths are drawn from the priors that the fits are given, data from the likelihood; 3 geometries × 3 noises × 2 models,
by Laplace's approximation, corrected, and by emcee. Then the same with a planted fault: fits that are told another
noise than there was. Writes calibration.md, calibration-ranks.png and calibration-coverage.png beside this script.

Every batch is kept in a folder; an interrupted run goes on from there, and a finished one only draws.

Run: python benchmarks/calibration.py [--rounds 1] [--kept DIR] [--minutes 30]
"""

import argparse
import dataclasses
import itertools
import time
import zlib
from pathlib import Path
from typing import Any

import calibration_pages
import jax
import numpy as np
import platformdirs

import fitmat as fm
from fitmat.judgement.calibration import Calibration, calibrate

NOISES = {"0.5 %": (0.005, 5e-4), "2 %": (0.02, 1e-3), "10 %": (0.1, 5e-3)}
"""Fraction of the value, and floor in sr⁻¹."""

PRIORS: dict[str, dict[str, Any]] = {
    "lambert+blinn-phong": {"kd": (0.3, 0.1), "ks": (0.3, 0.1), "exponent": (30.0, 12.0), "discrepancy": (0.0, 0.005)},
    "lambert+ggx": {
        "kd": (0.3, 0.1),
        "ks": (1.0, 0.3),
        "alpha": (0.3, 0.09),
        "eta": (1.5, 0.2),
        "discrepancy": (0.0, 0.005),
    },
}
"""Centre and standard deviation."""

BATCH = {"laplace": 56, "emcee": 23}
"""Simulations of each cell in a round: 504 and 207 of a model."""

FAULTS = (0.5, 1.5)
"""Multiples of the true noise that a fit is told."""

FAULTY, FAULTY_BATCH = ("four curves", "2 %"), 60
"""Where the faults are planted, and in how many simulations."""


@dataclasses.dataclass(frozen=True)
class Cell:
    """One batch of simulations."""

    model: str
    geometry: str
    noise: str
    method: str
    told: float = 1.0
    part: int = 0

    @property
    def name(self) -> str:
        """As a file name."""
        parts = (self.model, self.geometry, self.noise, self.method, f"told {self.told:g}", str(self.part))
        return ", ".join(parts).replace(" %", "pc").replace(" ", "_").replace(",", "")

    @property
    def simulations(self) -> int:
        """How many."""
        return BATCH[self.method] if self.told == 1.0 else FAULTY_BATCH

    def result(self, kept: Path) -> Calibration:
        """As kept, or simulated."""
        path = kept / f"{self.name}.npz"
        if not path.exists():
            geometry, seed = geometries()[self.geometry], zlib.crc32(self.name.encode())
            found = calibrate(
                self.model,
                geometry,
                NOISES[self.noise],
                PRIORS[self.model],
                simulations=self.simulations,
                seed=seed,
                method=self.method,  # pyright: ignore[reportArgumentType]
                told=self.told,
            )
            draft = kept / f"{self.name}.draft.npz"
            np.savez(draft, ranks=found.ranks, covered=found.covered, trusted=found.trusted, names=found.quantities)
            draft.replace(path)
        with np.load(path) as arrays:
            quantities = tuple(str(name) for name in arrays["names"])
            return Calibration(
                self.model, self.method, quantities, arrays["ranks"], arrays["covered"], arrays["trusted"]
            )


def geometries() -> dict[str, fm.Measurements]:
    """A curve, four curves in the plane of incidence, and a scan of the hemisphere."""
    plane, side = np.arange(-80.0, 81.0, 5.0), np.arange(0.0, 181.0, 22.5)
    angles = {
        "one curve": ([45.0], plane, [180.0]),
        "four curves": ([15.0, 35.0, 55.0, 70.0], plane[::2], [180.0]),
        "hemisphere": ([20.0, 50.0], np.arange(10.0, 81.0, 10.0), side),
    }
    found = {}
    for name, grid in angles.items():
        theta_i, theta_o, phi = (np.deg2rad(part).ravel() for part in np.meshgrid(*grid, indexing="ij"))
        found[name] = fm.from_arrays(theta_i, theta_o, np.ones(len(theta_i)), phi=phi, source=name)
    return found


def cells(rounds: int) -> list[Cell]:
    """Everything that is simulated, in an order in which any beginning is balanced."""
    grid = list(itertools.product(PRIORS, geometries(), NOISES))
    faulty = [Cell(model, *FAULTY, "laplace", told) for told in FAULTS for model in PRIORS]
    turns = [[Cell(*one, method, part=k) for method in BATCH for one in grid] for k in range(rounds)]
    return turns[0] + faulty + [cell for turn in turns[1:] for cell in turn]


def main() -> None:
    """Simulate what is missing, then write the page."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rounds", type=int, default=1, help="batches of every cell")
    options.add_argument("--kept", type=Path, default=platformdirs.user_cache_path("fitmat") / "calibration")
    options.add_argument("--minutes", type=float, default=np.inf, help="begin no batch after so many minutes")
    options.add_argument("--out", type=Path, default=Path(__file__).parent)
    chosen = options.parse_args()
    jax.config.update("jax_enable_x64", True)
    chosen.kept.mkdir(parents=True, exist_ok=True)
    begin, found = time.monotonic(), {}
    for cell in cells(chosen.rounds):
        late = time.monotonic() - begin > 60.0 * chosen.minutes
        if late and not (chosen.kept / f"{cell.name}.npz").exists():
            continue
        found[cell] = cell.result(chosen.kept)
        print(f"{(time.monotonic() - begin) / 60:.1f} min: {cell.name}", flush=True)
    calibration_pages.write(found, chosen.out, PRIORS, NOISES)


if __name__ == "__main__":
    main()
