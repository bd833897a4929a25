"""Asks how well gaps are filled: cells of measurements are held out, inferred from the others, and compared.

MERL-like materials of every kind, 2 % noise + 0.001 sr⁻¹, at 6 incidences × 10 × 10 directions, and black anodise as a
laboratory measured it (`ua-loft`). Held out are three of ten readings at random, all but the plane of incidence, or one
incidence. What `Posterior.complete` infers stands beside the model alone, the nearest reading, and linear interpolation
of ∛f between directions (the nearest reading beyond them). The table goes between the markers of completion.md.

Run: python benchmarks/completion.py [--only NAME ...]; FITMAT_DATA names the folder of shared data.
"""

import argparse
import os
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import jax
import machine
import numpy as np
from materials import reconstructions
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from tables import replace_between, to_markdown

import fitmat as fm
from fitmat.maths.directions import from_angles
from fitmat.measurements.formats import merl
from fitmat.measurements.samples import Measurements

PAGE = Path(__file__).with_name("completion.md")

MODEL = "lambert+ggx"

MATERIALS = {
    "metals": ("aluminium", "steel"),
    "metallic paints": ("silver-metallic-paint2", "color-changing-paint1"),
    "glossy plastics": ("green-acrylic", "red-specular-plastic"),
    "plain plastics": ("pink-plastic",),
    "diffuse paints": ("white-paint", "green-latex"),
    "fabrics": ("red-fabric",),
    "varnished woods": ("special-walnut-224",),
}

NOISE, FLOOR = 0.02, 1e-3

CELLS = 20_000
"""Of a MERL file, at random, to which the analytic table is completed."""

HOLES = 0.3
"""Share of the readings that are held out at random."""

Held = np.ndarray


def simulated(brdf: Callable[..., np.ndarray], angles: Callable[..., tuple[np.ndarray, ...]]) -> Measurements:
    """A material on the instrument, with its noise."""
    theta_i, theta_o = np.deg2rad([5.0, 15.0, 30.0, 45.0, 60.0, 75.0]), np.deg2rad(np.arange(5.0, 80.0, 7.5))
    grid = np.meshgrid(theta_i, theta_o, np.deg2rad(np.arange(0.0, 181.0, 20.0)), indexing="ij")
    light, sensor, phi = (part.ravel() for part in grid)
    wi, wo = from_angles(light, np.zeros_like(light)), from_angles(sensor, phi)
    theta_h, theta_d, phi_d = angles(np.array(wi), np.array(wo))
    f = brdf(theta_h, theta_d, phi_d % np.pi)
    sigma = NOISE * f + FLOOR
    value = f + sigma * np.random.default_rng(1).normal(size=f.shape)
    return Measurements(wi, wo, value, sigma, np.ones(f.shape, bool), ("r", "g", "b"))


def splits(m: Measurements) -> Iterator[tuple[str, Held]]:
    """What is held out."""
    yield "holes", np.random.default_rng(0).random(m.n_samples) < HOLES
    if not m.in_plane.all():
        yield "all but a plane", ~m.in_plane
    incidences = np.unique(np.round(m.theta_i, 3))
    yield "an incidence", np.abs(m.theta_i - incidences[len(incidences) // 2]) < 2e-3


def interpolated(known: Measurements, held: Measurements) -> dict[str, np.ndarray]:
    """The nearest reading, and linear between readings, of ∛f over both projected directions."""

    def at(m: Measurements) -> np.ndarray:
        side = np.sin(m.theta_o)
        return np.stack([np.sin(m.theta_i), side * np.cos(m.phi), side * np.sin(m.phi)], axis=1)

    value = np.cbrt(known.value)
    nearest = NearestNDInterpolator(at(known), value)(at(held))
    try:
        linear = LinearNDInterpolator(at(known), value)(at(held))
    except Exception as error:  # Qhull's, where all lie in one plane
        if "Qhull" not in type(error).__name__:
            raise
        linear = np.full_like(nearest, np.nan)
    return {"nearest": nearest**3, "linear": np.where(np.isfinite(linear), linear, nearest) ** 3}


def judged(m: Measurements, held: Held) -> dict[str, float]:
    """Error of ∛f, root of the mean square, by each way; and how often 2 sd hold what was read."""
    rows = np.flatnonzero(held)
    known, out = m.rows(np.flatnonzero(~held)), m.rows(rows)
    fit = fm.fit(known, MODEL)
    whole = fm.laplace(fit, seed=0).complete(out.wi, out.wo)
    of = np.asarray(whole.inferred).all(axis=1)
    value, sd = whole.value[of], np.asarray(whole.sigma)[of]
    sigma = out.sigma if out.sigma is not None else np.zeros_like(value)
    inside = np.abs(value - out.value) <= 2.0 * np.hypot(sd, sigma)
    ways = {"completed": value, "model": fm.evaluate(fit.model, out.wi, out.wo)} | interpolated(known, out)
    errors = {
        name: float(np.sqrt(np.mean((np.cbrt(np.maximum(guess, 0.0)) - np.cbrt(np.maximum(out.value, 0.0))) ** 2)))
        for name, guess in ways.items()
    }
    return errors | {"held": float(len(rows)), "inside": float(np.mean(inside[out.valid]))}


def cases(only: list[str]) -> Iterator[tuple[str, str, Measurements]]:
    """Kind, name and measurements."""
    shared = reconstructions()
    for kind, names in MATERIALS.items():
        for name in names:
            if not only or name in only:
                yield kind, name, simulated(shared.network(name), shared.rusinkiewicz)
    folder = Path(os.environ.get("FITMAT_DATA") or Path(__file__).parents[2] / "shared" / "data")
    for path in sorted((folder / "ua-loft" / "zemax").glob("*.bsdf")):
        if not only or path.stem in only:
            read = fm.read(path)
            yield "black anodise, measured", path.stem, read.rows(np.flatnonzero(read.valid.all(axis=1)))


def grazing(folder: Path) -> list[list[str]]:
    """An analytic table to MERL's cells, by the cosine of the flatter direction: error, sd, and within 2 sd.

    libbsdf wrote it: GGX with separable masking, α = 0.25, η = 1.5, which lambert+ggx (correlated) misses at grazing.
    """
    m = fm.read(folder / "ssdd" / "ggx_alpha0.25_eta1.5.ssdd")
    wi, wo = (w[np.random.default_rng(0).permutation(len(w))[:CELLS]] for w in merl.gaps(m))
    whole = fm.laplace(fm.fit(m, MODEL), seed=0).complete(wi, wo)
    value, sd = whole.value[-CELLS:, 0], np.asarray(whole.sigma)[-CELLS:, 0]
    truth, model = (
        np.asarray(fm.evaluate(fm.model("ggx", ks=1.0, alpha=0.25, eta=1.5, masking=kind), wi, wo))[:, 0]
        for kind in ("separable", "correlated")
    )
    flat, found = np.minimum(wi[:, 2], wo[:, 2]), []
    for low, high in pairwise((0.0, 0.05, 0.2, 0.5, 1.0)):
        some = (flat > low) & (flat <= high)
        of = [np.median(part[some] / truth[some]) for part in (abs(model - truth), abs(value - truth), sd)]
        inside = np.mean(np.abs(value - truth)[some] <= 2.0 * sd[some])
        found.append(
            [f"{low:g} – {high:g}", f"{some.sum()}", *(f"{100 * x:.2g} %" for x in of), f"{100 * inside:.0f} %"]
        )
    return found


def main() -> None:
    """Hold out, infer, compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[])
    given = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    table, ways = [], ("completed", "model", "nearest", "linear")
    for kind, name, m in cases(given.only):
        for split, held in splits(m):
            found = judged(m, held)
            errors = [f"{found[way]:.4f}" for way in ways]
            table.append([kind, name, split, f"{found['held']:.0f}", f"{100 * found['inside']:.0f} %", *errors])
            print(" | ".join(table[-1]), flush=True)
    folder = Path(os.environ.get("FITMAT_DATA") or Path(__file__).parents[2] / "shared" / "data")
    flat = to_markdown(["cosine", "cells", "model's error", "error", "sd", "within 2 sd"], grazing(folder))
    print(flat)
    replace_between(PAGE, "grazing", flat)
    head = ["kind", "material", "held out", "readings", "within 2 sd", *ways]
    if not given.only:
        replace_between(PAGE, "completion", f"{machine.described()}\n\n{to_markdown(head, table)}")


if __name__ == "__main__":
    main()
