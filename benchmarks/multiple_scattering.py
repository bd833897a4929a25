"""Shows what leaving out depths gains: variance × seconds of `evaluate_slab` beside `evaluate_walk`, GGX, alpha 0.5.

Both sides estimate the same BRDF values with the same number of paths; the script checks first that they agree within
Monte Carlo error. Efficiency is 1/(variance × seconds); programs are compiled and warm, rivals run in turn.

It prints how much of what the walk gives back Kulla & Conty and Turquin do, and draws the answers to
"where does the energy of a rough surface go?", for white and gold, alpha 0.5 and 1: single scattering, Kulla & Conty's
compensation, Heitz's walk, and Bitterli & d'Eon's position-free integral.

Run: python benchmarks/multiple_scattering.py [--samples 200000] [--repeats 7] [--figure FILE.png]
"""

import argparse
from pathlib import Path

import jax
import jax.numpy as jnp
import machine
import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fitmat.maths.directions import from_angles
from fitmat.maths.quadrature import lobe_rule
from fitmat.models.albedo import albedo
from fitmat.models.base import AbstractBRDF, evaluate
from fitmat.models.lobes.kulla_conty import KullaConty
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.multiple_scattering.position_free import evaluate_slab
from fitmat.models.multiple_scattering.random_walk import albedo_walk, evaluate_walk
from fitmat.models.multiple_scattering.surface import Surface
from fitmat.models.registry import model
from fitmat.models.terms.distributions import GGX, Isotropic
from fitmat.models.terms.fresnel import AbstractFresnel, Conductor, Schlick, White

PAIRS = ((10, 30, 180), (45, 45, 180), (60, 20, 90), (75, 75, 180), (75, 60, 40))
"""theta_i, theta_o, phi in degrees."""

SAME = 4.0
"""Two estimates may differ by this many standard errors."""

# Red of gold at 642 nm (Johnson & Christy 1972), rounded.
METALS: dict[str, AbstractFresnel] = {"white": White(), "gold (red)": Conductor(jnp.array(0.16), jnp.array(3.5))}

COLOURS = {"single": "#888888", "Kulla–Conty": "#E69F00", "walk": "#0072B2", "position-free": "#D55E00"}
"""Okabe & Ito's palette, which colour-blind readers can tell apart."""


def surface(fresnel: AbstractFresnel, alpha: float) -> Surface:
    """GGX."""
    return Surface(GGX(), (alpha, alpha), fresnel)


def efficiency(name: str, samples: int, repeats: int) -> list[list[str]]:
    """One row per pair: values, variances, seconds, and the ratio of variance × seconds."""
    theta_i, theta_o, phi = np.deg2rad(np.array(PAIRS, float)).T
    wi, wo = from_angles(theta_i, 0 * phi), from_angles(theta_o, phi)
    rough = surface(METALS[name], 0.5)
    walked, exact = (f(rough, wi, wo, samples=samples, seed=1) for f in (evaluate_walk, evaluate_slab))
    apart = np.abs(walked.value - exact.value) / np.hypot(walked.standard_error, exact.standard_error)
    assert apart.max() < SAME, f"not the same mean: {apart.ravel()} standard errors apart"
    seconds = machine.interleaved(
        {
            "walk": lambda: evaluate_walk(rough, wi, wo, samples=samples, seed=2),
            "slab": lambda: evaluate_slab(rough, wi, wo, samples=samples, seed=2),
        },
        repeats,
    )
    slower = float(np.median(seconds["slab"]) / np.median(seconds["walk"]))
    variance = (walked.standard_error / exact.standard_error)[:, 0] ** 2
    return [
        [f"{name}, {i}°/{o}°/{p}°", f"{walked.value[k, 0]:.4f} ± {walked.standard_error[k, 0]:.4f}",
         f"{exact.value[k, 0]:.5f} ± {exact.standard_error[k, 0]:.5f}", f"{variance[k]:.1f}", f"{slower:.1f}",
         f"{variance[k] / slower:.1f} ×"]
        for k, (i, o, p) in enumerate(PAIRS)
    ]  # fmt: skip


def lobes(fresnel: AbstractFresnel, alpha: float) -> dict[str, AbstractBRDF]:
    """The closed forms."""
    rough, one = Isotropic(jnp.array(alpha)), jnp.ones(())
    return {"single": Microfacet(one, rough, fresnel), "Kulla–Conty": KullaConty(one, rough, fresnel)}


def compensated(samples: int) -> list[list[str]]:
    """What a viewer sees of light from everywhere, F0 = 0.6 (Schlick): closed forms beside the walk."""
    rows, degrees = [], (0.0, 30.0, 60.0, 80.0)
    wi = from_angles(np.deg2rad(degrees), np.zeros(len(degrees)))
    for alpha in (0.1, 0.3, 0.6, 1.0):
        rough = Surface(GGX(), (alpha, alpha), Schlick(jnp.array(0.6)))
        walked = albedo_walk(rough, wi, samples=samples, seed=1).reflected
        made = [model(f"ggx{part}-schlick", alpha=alpha, f0=0.6) for part in ("", "-kc", "-turquin")]
        for k, angle in enumerate(degrees):
            rule = lobe_rule(np.deg2rad(angle), alpha)
            viewer = np.broadcast_to(rule.wi, rule.wo.shape)
            seen = [f"{float(rule.weight @ evaluate(one, rule.wo, viewer)[:, 0]):.3f}" for one in made]
            walk = f"{walked.value[k, 0]:.3f} ± {walked.standard_error[k, 0]:.4f}"
            rows.append([f"{alpha:g}", f"{angle:g}°", *seen, walk])
    return rows


def draw_albedo(ax: Axes, name: str, alpha: float, samples: int) -> None:
    """Directional albedo against the angle of incidence."""
    fine = np.deg2rad(np.linspace(0, 88, 45))
    for label, lobe in lobes(METALS[name], alpha).items():
        ax.plot(np.rad2deg(fine), albedo(lobe, fine).value[:, 0], color=COLOURS[label], label=label)
    rough, degrees = surface(METALS[name], alpha), np.arange(5.0, 86.0, 10.0)
    wi = from_angles(np.deg2rad(degrees), np.zeros(len(degrees)))
    walked = albedo_walk(rough, wi, samples=samples, seed=3).reflected
    ax.errorbar(degrees, walked.value[:, 0], 2 * walked.standard_error[:, 0], fmt="o", ms=4, color=COLOURS["walk"],
                label="Heitz's walk")  # fmt: skip
    integrals = np.array([position_free_albedo(rough, angle, alpha) for angle in degrees])
    ax.errorbar(degrees, integrals[:, 0], 2 * integrals[:, 1], fmt="x", ms=6, color=COLOURS["position-free"],
                label="position-free")  # fmt: skip
    ax.set(title=f"{name}, α = {alpha:g}", xlabel="angle of incidence θ_i / °", ylabel="directional albedo")


def position_free_albedo(rough: Surface, degrees: float, alpha: float) -> tuple[float, float]:
    """∫ f c_o dω_o over values of the position-free estimator, with its standard error."""
    rule = lobe_rule(np.deg2rad(degrees), alpha, nodes=(48, 24))
    weight = np.asarray(rule.weight)
    wo = np.where(np.asarray(rule.wo)[:, 2:] > 0, rule.wo, [0.0, 0.0, 1.0])
    found = evaluate_slab(rough, np.tile(np.asarray(rule.wi), (len(wo), 1)), wo, samples=64, seed=4)
    return float(weight @ found.value[:, 0]), float(np.linalg.norm(weight * found.standard_error[:, 0]))


def draw_slice(ax: Axes, name: str, alpha: float, samples: int) -> None:
    """BRDF in the plane of incidence for light from 45°."""
    for drawn, signed in (("lines", np.linspace(-88, 88, 177)), ("points", np.linspace(-80, 80, 17))):
        theta, phi = np.deg2rad(np.abs(signed)), np.where(signed > 0, np.pi, 0.0)
        wo, wi = from_angles(theta, phi), np.tile(from_angles(np.deg2rad([45.0]), np.zeros(1)), (len(signed), 1))
        if drawn == "lines":
            for label, lobe in lobes(METALS[name], alpha).items():
                ax.plot(signed, evaluate(lobe, wi, wo)[:, 0], color=COLOURS[label])
            continue
        for label, f, marker in (("walk", evaluate_walk, "o"), ("position-free", evaluate_slab, "x")):
            found = f(surface(METALS[name], alpha), wi, wo, samples=samples, seed=5)
            ax.errorbar(
                signed, found.value[:, 0], 2 * found.standard_error[:, 0], fmt=marker, ms=4, color=COLOURS[label]
            )
    ax.set(title=f"{name}, α = {alpha:g}, θ_i = 45°", xlabel="θ_o / ° (mirror side positive)", ylabel="f / sr⁻¹")


def figure(samples: int) -> Figure:
    """Albedo above, slices of the BRDF below; error bars are two standard errors."""
    mpl.use("Agg")
    drawn = Figure(figsize=(15, 7.5), layout="constrained")
    axes = drawn.subplots(2, 4)
    for column, (name, alpha) in enumerate((n, a) for n in METALS for a in (0.5, 1.0)):
        draw_albedo(axes[0, column], name, alpha, samples)
        draw_slice(axes[1, column], name, alpha, samples)
    for ax in axes[0]:
        ax.set_ylim(0.25, 1.05)
    axes[0, 0].legend(loc="lower left", fontsize="small")
    drawn.suptitle("Energy of rough GGX surfaces; error bars: two standard errors")
    return drawn


def main() -> None:
    """Check, time, print, draw."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--samples", type=int, default=200_000, help="paths per pair")
    options.add_argument("--repeats", type=int, default=7, help="timed runs of each rival")
    options.add_argument("--figure", type=Path, default=Path(__file__).with_suffix(".png"), help="where to draw")
    chosen = options.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(machine.described(), "\n")
    headings = ["θ_i/θ_o/φ", "walk", "position-free", "variance, times less", "time, times more", "gain"]
    rows = [row for name in METALS for row in efficiency(name, chosen.samples, chosen.repeats)]
    machine.show(f"GGX, alpha 0.5, {chosen.samples} paths per pair", headings, rows)
    headings = ["alpha", "angle of view", "single", "-kc", "-turquin", "walk"]
    machine.show("Light that a viewer sees, F0 = 0.6", headings, compensated(chosen.samples))
    figure(chosen.samples // 10).savefig(chosen.figure, dpi=110)


if __name__ == "__main__":
    main()
