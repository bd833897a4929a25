"""Shows that intervals hold when the model is wrong: two laboratories measure one surface, and must agree.

Six families of surfaces that neither default model describes × four splits of the angles between two laboratories. Each
fits both models; every parameter, ks·F0, albedos, the distance and ΔE of the match of one are compared with those of
the other: the 95 % interval of their difference should hold 0 in 95 of 100 surfaces. The truth itself will not serve,
for a wrong model has none. A right model is compared with the truth. All is judged twice: with the correlation of the
misfit, and as if the misfit of every sample were its own. Writes misfit.md and misfit.png beside this script.

Every surface is kept as it comes; an interrupted run goes on from there, and a finished one only draws.

Run: python benchmarks/misfit.py [--surfaces 240] [--right 500] [--chains 10] [--minutes 60] [--kept DIR]
"""

import argparse
import dataclasses
import json
import time
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax
import misfit_pages
import numpy as np
import platformdirs
from wrong_truths import FAMILIES, RIGHT, SPLITS, Laboratory, surface

import fitmat as fm
from fitmat.match.appearance.spheres import SPHERE_DRAWS, perceived
from fitmat.match.distances import extrapolation
from fitmat.maths.directions import from_angles
from fitmat.maths.normal import Z95
from fitmat.maths.quadrature import lobe_rule
from fitmat.measurements.incidences import incidences
from fitmat.models.base import AbstractBRDF
from fitmat.models.terms.fresnel import f0_from_eta
from fitmat.models.values import values
from fitmat.uncertainty.estimate import Estimate, limits

MODELS = ("lambert+blinn-phong", "lambert+ggx")

NOISE, FLOOR = 0.01, 5e-4
"""Of each reading: relative, and in sr⁻¹."""

DRAWS = 200
"""Of each posterior."""

ALBEDO_DEG = (20.0, 50.0, 70.0)

NODES = (32, 16)
"""Of the quadratures, the same for both laboratories, whose error they share."""

SPHERES = 1
"""Surfaces of each family and split whose ΔE is compared as well: a pair of spheres takes as long as a fit."""

RINGS_DEG = (7.0, 21.0, 35.0, 49.0, 63.0, 77.0)
"""Incidences over which the distance of the match is taken."""


@dataclasses.dataclass(frozen=True)
class Case:
    """One surface between two laboratories."""

    family: str
    split: str
    number: int
    seed: int

    @property
    def key(self) -> str:
        """As a line's name."""
        return f"{self.family}, {self.split}, {self.number}, seed {self.seed}"


def cases(surfaces: int, right: int, seed: int) -> list[Case]:
    """Every case, in an order in which any beginning is balanced; `surfaces` of each split, `right` in all."""
    each, found = -(-surfaces // len(FAMILIES)), []
    for k in range(max(each, -(-right // len(SPLITS)))):
        for split in SPLITS:
            found += [Case(family, split, k, seed) for family in FAMILIES if k < each]
            found += [Case(RIGHT, split, k, seed)] if k * len(SPLITS) < right else []
    return found


def judged(case: Case, method: str = "laplace") -> dict[str, Any]:
    """Both laboratories of a case; see `misfit_pages`."""
    rng = np.random.default_rng([case.seed, zlib.crc32(case.key.encode())])
    brdf, truth = surface(case.family, rng)
    posteriors = [_posteriors(lab, brdf, rng, method) for lab in SPLITS[case.split]]
    labs = [_quantities(of_one) for of_one in posteriors]
    found: dict[str, Any] = {"case": case.key, "family": case.family, "split": case.split, "method": method}
    if case.family == RIGHT:
        true = _true(truth)
        found["rows"] = [row for lab in labs for row in _against(lab, true)]
    else:
        found["rows"] = list(_between(*labs))
        if case.number < SPHERES and all(p.fit.finite for of_one in posteriors for p in of_one):
            found["rows"].append(_seen_between(*(_seen(of_one) for of_one in posteriors)))
    return found


def _posteriors(lab: Laboratory, brdf: Any, rng: np.random.Generator, method: str) -> list[fm.Posterior]:
    theta_i, theta_o = lab.directions()
    wi = from_angles(theta_i, np.zeros_like(theta_i))
    exact = brdf(wi, from_angles(np.abs(theta_o), np.where(theta_o >= 0, np.pi, 0.0)))
    sigma = np.hypot(NOISE * exact, FLOOR)
    m = fm.from_arrays(theta_i, theta_o, exact + sigma * rng.normal(size=exact.shape), sigma=sigma)
    seed, fits = int(rng.integers(2**31)), [fm.fit(m, name) for name in MODELS]
    if method == "emcee":
        return [fm.sample(fit, seed=seed) for fit in fits]
    return [fm.laplace(fit, seed=seed, corrected=False) for fit in fits]


Numbers = dict[str, np.ndarray]
"""Quantity → its best value, then its draws."""


def _quantities(posteriors: list[fm.Posterior]) -> dict[str, Numbers]:
    """Everything that is compared, from widened draws ("wide") and from those of the likelihood ("plain")."""
    found: dict[str, Numbers] = {}
    for kind in ("wide", "plain"):
        drawn = [np.vstack([p.fit.values, p.thinned(DRAWS, widened=kind == "wide")[0]]) for p in posteriors]
        found[kind] = numbers = {}
        for posterior, values_ in zip(posteriors, drawn, strict=True):
            numbers |= _of_one(posterior.fit, values_)
        sound = all(p.fit.finite for p in posteriors)
        models = posteriors[0].fit.model, posteriors[1].fit.model
        if sound:
            shuffled = np.r_[0, 1 + np.random.default_rng(0).permutation(len(drawn[1]) - 1)]
            m = posteriors[0].fit.measurements
            measured = np.deg2rad([group.theta_i_deg for group in incidences(m.wi, m.valid[:, 0], len(m.wi))])
            beyond = extrapolation(np.deg2rad(RINGS_DEG), measured, len(drawn[0])) if kind == "wide" else None
            numbers["match distance"] = _distance(models, (drawn[0], drawn[1][shuffled]), beyond)
    return found


def _of_one(fit: fm.Fit, drawn: np.ndarray) -> Numbers:
    """Parameters that are determined and on no bound, ks·F0, and albedos."""
    short = fit.name.removeprefix("lambert+")
    kept = {e.name: drawn[:, e.place.start] for e in fit.entries}
    found = {f"{short} {name}": kept[name] for name in kept if name not in (*fit.undetermined, *fit.on_bound)}
    if "eta" in kept:
        found[f"{short} ks·F0"] = kept["ks"] * f0_from_eta(kept["eta"])
    for degrees, albedo in zip(ALBEDO_DEG, _albedos(fit.model, drawn, ALBEDO_DEG), strict=True):
        found[f"{short} albedo {degrees:.0f}°"] = albedo
    return found


def _albedos(model: AbstractBRDF, drawn: np.ndarray, degrees: tuple[float, ...]) -> list[np.ndarray]:
    width = 0.1  # one rule for both laboratories
    rules = [lobe_rule(np.deg2rad(angle), width, nodes=NODES) for angle in degrees]
    return [values(model, drawn, np.broadcast_to(r.wi, r.wo.shape), r.wo)[:, :, 0] @ r.weight for r in rules]


def _distance(
    models: tuple[AbstractBRDF, AbstractBRDF], drawn: tuple[np.ndarray, np.ndarray], beyond: np.ndarray | None
) -> np.ndarray:
    """√(∫∫(f_P − f_M)² c_i c_o / ∫∫ f_M² c_i c_o), as the match has it; the difference times `beyond` at each ring."""
    top, bottom = 0.0, 0.0
    for k, angle in enumerate(np.deg2rad(RINGS_DEG)):
        rule = lobe_rule(angle, 0.1, nodes=NODES)
        wi, ring = np.broadcast_to(rule.wi, rule.wo.shape), np.sin(angle) * np.cos(angle)
        one, other = (values(m, d, wi, rule.wo)[:, :, 0] for m, d in zip(models, drawn, strict=True))
        times = 1.0 if beyond is None else beyond[:, k] ** 2
        top, bottom = top + times * ring * ((one - other) ** 2 @ rule.weight), bottom + ring * (other**2 @ rule.weight)
    return np.sqrt(top / bottom)


def _seen(posteriors: list[fm.Posterior]) -> dict[str, Estimate]:
    """What an eye sees of the difference of the two models, mean ΔE2000 of spheres."""
    found = {}
    for kind in ("wide", "plain"):
        draws = [np.vstack([p.fit.values, p.thinned(SPHERE_DRAWS, widened=kind == "wide")[0]]) for p in posteriors]
        models, channels = [p.fit.model for p in posteriors], posteriors[0].fit.measurements.channels
        found[kind] = perceived(*models, (draws[0], draws[1]), channels, pictures=False).delta_e_2000.mean
    return found


def _seen_between(one: dict[str, Estimate], other: dict[str, Estimate]) -> dict[str, Any]:
    """As `_between`, the interval of the difference from both intervals (Zou & Donner, Stat. Med. 27, 2008)."""
    row: dict[str, Any] = {"quantity": "match ΔE2000", "apart": one["wide"].value - other["wide"].value}
    for kind in ("wide", "plain"):
        a, b = one[kind], other[kind]
        below = np.hypot(a.value - a.ci95[0], b.ci95[1] - b.value)
        above = np.hypot(a.ci95[1] - a.value, b.value - b.ci95[0])
        row |= {kind: bool(-above <= a.value - b.value <= below), f"{kind} sd": float((below + above) / (2.0 * Z95))}
    return row


def _between(one: dict[str, Numbers], other: dict[str, Numbers]) -> Iterator[dict[str, Any]]:
    """Whether the interval of the difference holds 0, and how far off it is in standard deviations."""
    for name in one["wide"]:
        if name not in other["wide"]:
            continue
        row: dict[str, Any] = {"quantity": name}
        for kind in ("wide", "plain"):
            a, b = one[kind][name], other[kind][name]
            apart = a[1:] - np.random.default_rng(1).permutation(b[1:])
            low, high = limits(a[0] - b[0], apart)
            row[kind] = bool(low <= 0.0 <= high)
            row[f"{kind} sd"] = float(np.hypot(a[1:].std(), b[1:].std()))
        yield row | {"apart": float(one["wide"][name][0] - other["wide"][name][0])}


def _against(lab: dict[str, Numbers], true: dict[str, float]) -> Iterator[dict[str, Any]]:
    """Whether the interval holds the truth, of the right model."""
    for name, value in true.items():
        if name not in lab["wide"]:
            continue
        row: dict[str, Any] = {"quantity": name, "apart": float(lab["wide"][name][0] - value)}
        for kind in ("wide", "plain"):
            low, high = limits(lab[kind][name][0], lab[kind][name][1:])
            row |= {kind: bool(low <= value <= high), f"{kind} sd": float(lab[kind][name][1:].std())}
        yield row


def _true(truth: dict[str, float]) -> dict[str, float]:
    right = fm.model(MODELS[1], **truth)
    names = {e: f"ggx {e}" for e in truth}
    vector = np.array([[truth[name] for name in ("kd", "ks", "alpha", "eta")]])
    found = {names[name]: value for name, value in truth.items()}
    found["ggx ks·F0"] = truth["ks"] * float(f0_from_eta(np.array(truth["eta"])))
    for degrees, albedo in zip(ALBEDO_DEG, _albedos(right, vector, ALBEDO_DEG), strict=True):
        found[f"ggx albedo {degrees:.0f}°"] = float(albedo[0])
    return found


def main() -> None:
    """Measure what is missing, then write the page."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--surfaces", type=int, default=240, help="wrong surfaces of each split")
    options.add_argument("--right", type=int, default=500, help="surfaces of the right model, in all splits together")
    options.add_argument("--chains", type=int, default=10, help="cases that are sampled by emcee as well")
    options.add_argument("--seed", type=int, default=15)
    options.add_argument("--kept", type=Path, default=platformdirs.user_cache_path("fitmat") / "misfit")
    options.add_argument("--minutes", type=float, default=np.inf, help="begin no surface after so many minutes")
    options.add_argument("--out", type=Path, default=Path(__file__).parent)
    chosen = options.parse_args()
    jax.config.update("jax_enable_x64", True)
    chosen.kept.mkdir(parents=True, exist_ok=True)
    kept = chosen.kept / f"{chosen.seed}.jsonl"
    found = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    known, begin = {(line["case"], line["method"]) for line in found}, time.monotonic()
    every = cases(chosen.surfaces, chosen.right, chosen.seed)
    work = [(case, "laplace") for case in every] + [(case, "emcee") for case in every[: chosen.chains]]
    with kept.open("a") as lines:
        for case, method in work:
            if (case.key, method) in known or time.monotonic() - begin > 60.0 * chosen.minutes:
                continue
            found.append(judged(case, method))
            lines.write(json.dumps(found[-1]) + "\n")
            lines.flush()
            if len(found) % 50 == 0:
                print(f"{(time.monotonic() - begin) / 60:.1f} min: {len(found)} cases", flush=True)
    again = [f"--{name} {getattr(chosen, name)}" for name in ("surfaces", "right", "chains", "seed")]
    misfit_pages.write(found, chosen.out, " ".join(again))


if __name__ == "__main__":
    main()
