"""Asks what proposed angles are worth: ten MERL-like materials by 8, 16 and 32 readings, chosen in several ways.

Each reading has noise of 2 % + 0.001 sr⁻¹. lambert+ggx is fitted to the chosen ones, and to everything: five incidences
every 2° in their plane. What an eye sees of the difference of the two fits on a lit sphere, mean ΔE2000, is what the
choice cost. Proposals begin with four readings of a grid and are asked for four at a time, each time of the fit to the
readings before. All stay in the plane of incidence, up to 75°. The table goes between the markers of planning.md.

Run: python benchmarks/planning.py [--only NAME ...]; FITMAT_DATA names the folder of shared data.
"""

import argparse
import zlib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import jax
import machine
import numpy as np
from jaxtyping import Float
from materials import reconstructions
from tables import replace_between, to_markdown

import fitmat as fm
from fitmat.judgement.design.candidates import Limits
from fitmat.match.appearance.spheres import perceived
from fitmat.maths.directions import from_angles

MODEL = "lambert+ggx"

MATERIALS = (
    "aluminium", "silver-metallic-paint2", "color-changing-paint1", "red-specular-plastic", "green-acrylic",
    "pink-plastic", "white-paint", "green-latex", "red-fabric", "special-walnut-224",
)  # fmt: skip

COUNTS = (8, 16, 32)

FIRST = 4
"""Readings of the grid before any proposal."""

AT_ONCE = 4
"""Readings that are proposed of one fit."""

NOISE, FLOOR = 0.02, 1e-3

STEEPEST = 75.0
"""Zenith angles that random and even readings reach, degrees."""


CHANNELS = ("r", "g", "b")

WAYS = "proposed", "at random", "a grid"

RANDOM = 4
"""Sets of random readings, whose mean counts."""

PAGE = Path(__file__).with_name("planning.md")

Angles = Float[np.ndarray, "n 3"]
"""θ_i, θ_o (positive on the mirror side) and φ (π is the plane of incidence), radians."""

Reader = Callable[[Angles], fm.Measurements]
"""Measures."""


def measured(materials: ModuleType, name: str, angles: Angles, seed: int) -> fm.Measurements:
    """Readings of a material; of the same seed the first are the same however many follow."""
    theta_i, theta_o, phi = angles.T
    wi = from_angles(theta_i, 0.0 * theta_i)
    wo = from_angles(np.abs(theta_o), phi + np.where(theta_o < 0, np.pi, 0.0))
    exact = materials.network(name)(*materials.rusinkiewicz(wi, wo))
    sigma = np.hypot(NOISE * exact, FLOOR)
    value = exact + sigma * np.random.default_rng(seed).normal(size=exact.shape)
    return fm.from_arrays(theta_i, theta_o, value, phi=phi, sigma=sigma, channels=CHANNELS)


def even(count: int) -> Angles:
    """A grid in the plane: twice as many θ_o as θ_i, or as many."""
    rows = 2 ** (int(np.log2(count)) // 2)
    columns = count // rows
    theta_i = STEEPEST * (np.arange(rows) + 0.5) / rows
    theta_o = STEEPEST * (2.0 * (np.arange(columns) + 0.5) / columns - 1.0)
    return _in_plane(*np.meshgrid(theta_i, theta_o))


def at_random(count: int, rng: np.random.Generator) -> Angles:
    """Anywhere in the plane."""
    return _in_plane(rng.uniform(0.0, STEEPEST, count), rng.uniform(-STEEPEST, STEEPEST, count))


def everything() -> Angles:
    """Five curves."""
    return _in_plane(*np.meshgrid([10.0, 30.0, 45.0, 60.0, 75.0], np.arange(-74.0, 75.0, 2.0)))


def _in_plane(theta_i: np.ndarray, theta_o: np.ndarray) -> Angles:
    return np.stack(
        [np.deg2rad(theta_i).ravel(), np.deg2rad(theta_o).ravel(), np.full(np.size(theta_i), np.pi)], axis=1
    )


def proposed(read: Reader, begin: Angles, count: int) -> Angles:
    """Readings as `fitmat.next_angles` proposes them, `AT_ONCE` of each fit."""
    angles, limits = begin, Limits(steepest=STEEPEST, in_plane=True)
    while len(angles) < count:
        posterior = fm.laplace(fm.fit(read(angles), MODEL), seed=0, corrected=False)
        found = fm.next_angles(posterior, count=AT_ONCE, limits=limits)
        angles = np.vstack([angles, [[p.theta_i, p.theta_o[0], p.phi] for p in found.proposals]])
    return angles


def apart(one: fm.Fit, other: fm.Fit) -> float:
    """Mean ΔE2000 of the two on a lit sphere."""
    draws = one.values[None], other.values[None]
    return perceived(one.model, other.model, draws, CHANNELS, pictures=False).delta_e_2000.mean.value


def costs(materials: ModuleType, name: str) -> dict[str, list[float]]:
    """Way → ΔE2000 after each of `COUNTS` readings."""
    seed, most = zlib.crc32(name.encode()), max(COUNTS)
    reference = fm.fit(measured(materials, name, everything(), seed), MODEL)

    def read(angles: Angles) -> fm.Measurements:
        return measured(materials, name, angles, seed + 1)

    def cost(angles: Angles) -> float:
        return apart(reference, fm.fit(read(angles), MODEL))

    nested = {
        WAYS[0]: [proposed(read, even(FIRST), most)],
        WAYS[1]: [at_random(most, np.random.default_rng([seed, k])) for k in range(RANDOM)],
    }
    found = {way: [float(np.mean([cost(a[:n]) for a in sets])) for n in COUNTS] for way, sets in nested.items()}
    return found | {WAYS[2]: [cost(even(n)) for n in COUNTS]}


def main() -> None:
    """Measure each material, print as it goes, remake the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--only", nargs="*", default=None, help="names of materials; the page stays as it is")
    chosen = options.parse_args()
    jax.config.update("jax_enable_x64", True)
    materials, found = reconstructions(), {}
    for name in chosen.only or MATERIALS:
        found[name] = costs(materials, name)
        print(name, {way: np.round(each, 2).tolist() for way, each in found[name].items()}, flush=True)
    headings = ["material", *(f"{way}, {n}" for way in WAYS for n in COUNTS)]
    numbers = np.array([[x for way in WAYS for x in each[way]] for each in found.values()])
    rows = [[name, *(f"{x:.1f}" for x in row)] for name, row in zip(found, numbers, strict=True)]
    rows.append(["**geometric mean**", *(f"{x:.1f}" for x in np.exp(np.mean(np.log(numbers), axis=0)))])
    machine.show("Mean ΔE2000 beside the fit to everything", headings, rows)
    if chosen.only is None:
        replace_between(PAGE, "planning", f"{machine.described()}\n\n{to_markdown(headings, rows)}\n")


if __name__ == "__main__":
    main()
