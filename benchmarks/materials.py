"""Asks which kinds of material Blinn–Phong serves: 30 MERL-like materials through fit, posterior and match.

Each material is "measured" in the plane of incidence at five incidences with 2 % noise (the shared data's own script
writes the curves), lambert+blinn-phong and lambert+ggx are fitted, and `fitmat.compare` says how far apart they are.
The tables go between the markers of match.md.

Run: python benchmarks/materials.py [--noise 0.02] [--only NAME ...]; FITMAT_DATA names the folder of shared data.
"""

import argparse
import importlib.util
import os
import tempfile
from pathlib import Path
from types import ModuleType

import jax
import machine
import numpy as np
from tables import replace_between, to_markdown

import fitmat as fm
from fitmat.match.match import Match

MODELS = ("lambert+blinn-phong", "lambert+ggx")

PAGE = Path(__file__).with_name("match.md")

KINDS = {
    "metals and carbides": ("aluminium", "silicon-nitrade", "steel", "tungsten-carbide", "two-layer-silver"),
    "metallic and changing paints": ("metallic-paint", "color-changing-paint", "silver-paint"),
    "glossy plastics": ("specular", "acrylic"),
    "other plastics and rubbers": ("plastic", "pvc"),
    "diffuse paints": ("latex", "white-paint"),
    "fabrics": ("fabric",),
    "varnished woods": ("cherry", "oak", "walnut"),
}
"""Kind → what a material's name holds; the first kind that matches counts."""


def reconstructions() -> ModuleType:
    """The shared data's evaluator of the neural materials."""
    folder = Path(os.environ.get("FITMAT_DATA") or Path(__file__).parents[2] / "shared" / "data")
    spec = importlib.util.spec_from_file_location("evaluate", folder / "merl-like" / "evaluate.py")
    if spec is None or spec.loader is None or not (folder / "merl-like").is_dir():
        raise SystemExit(f"no merl-like materials in {folder}: set FITMAT_DATA to the folder of shared data")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def matched(materials: ModuleType, name: str, noise: float) -> Match:
    """Measure, fit both models, and compare."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.csv"
        materials.write_csv(name, path, noise, 1)
        measured = fm.read(path)
    return fm.compare(*(fm.laplace(fm.fit(measured, model), seed=1) for model in MODELS))


def kind_of(name: str) -> str:
    """The first kind of `KINDS` that the name belongs to."""
    return next(kind for kind, parts in KINDS.items() if any(part in name for part in parts))


def row(match: Match) -> dict[str, float]:
    """The numbers of one line of the table."""
    seen = match.perceived
    assert seen is not None
    return {
        "distance": match.hemisphere_distance.value,
        "measured": match.measured_distance.value,
        "cube": match.distances.whole["cube-root"].value,
        "mean": seen.delta_e_2000.mean.value,
        "worst": seen.delta_e_2000.worst_twentieth.value,
        "gap": match.albedo_gap_sign * match.albedo_gap_max.value,
        "gap_at": match.albedo_gap_theta_i_deg,
        "bic": match.delta_bic,
        "blinn": match.empirical.fit.misfit_ratio,
        "ggx": match.microfacet.fit.misfit_ratio,
    }


def line(name: str, r: dict[str, float]) -> list[str]:
    """One line as text."""
    gap = f"{100 * r['gap']:+.1f} % at {r['gap_at']:.0f}°"
    return [
        name, f"{100 * r['distance']:.0f} %", f"{100 * r['measured']:.0f} %", f"{r['mean']:.1f}", f"{r['worst']:.1f}",
        gap, f"{r['bic']:,.0f}", f"{r['blinn']:.1f}", f"{r['ggx']:.1f}",
    ]  # fmt: skip


HEADINGS = [
    "material", "distance", "at the measured incidences", "ΔE2000 mean", "ΔE2000 worst 5 %", "largest albedo gap",
    "ΔBIC", "misfit/noise Blinn–Phong", "misfit/noise GGX",
]  # fmt: skip


def by_kind(found: dict[str, dict[str, float]]) -> list[list[str]]:
    """Medians of the materials of a kind."""
    lines = []
    for kind in KINDS:
        rows = [r for name, r in found.items() if kind_of(name) == kind]
        if rows:
            median = {key: float(np.median([r[key] for r in rows])) for key in rows[0]}
            lines.append(line(f"{kind} ({len(rows)})", median))
    return sorted(lines, key=lambda cells: float(cells[3]))


def main() -> None:
    """Match each material, print as it goes, remake the page."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--noise", type=float, default=0.02, help="relative noise of the curves")
    options.add_argument("--only", nargs="*", default=None, help="names of materials; the page stays as it is")
    chosen = options.parse_args()
    jax.config.update("jax_enable_x64", True)
    materials = reconstructions()
    with np.load(materials.HERE / "networks.npz") as networks:
        names = sorted({key.split("/")[0] for key in networks.files})
    print(machine.described(), "\n")
    found = {}
    for name in chosen.only or names:
        seconds, match = machine.clocked(lambda name=name: matched(materials, name, chosen.noise))
        found[name] = row(match)
        print(f"{name}: {seconds:.1f} s. {match.verdict}\n", flush=True)
    ordered = sorted(found, key=lambda name: found[name]["mean"])
    lines = [line(name, found[name]) for name in ordered]
    machine.show("Blinn–Phong and GGX fitted to the same curves", HEADINGS, lines)
    if chosen.only is None:
        table = to_markdown(["kind (materials), medians", *HEADINGS[1:]], by_kind(found))
        replace_between(PAGE, "materials", f"{table}\n\n{to_markdown(HEADINGS, lines)}\n")


if __name__ == "__main__":
    main()
