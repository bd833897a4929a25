"""Recovers the exponent n of Blinn–Phong from GGX data of known alpha, and alpha from Blinn–Phong data of known n.

Each pair is simulated as an instrument would see it (in the plane of incidence, 2 % + 1e-3 sr⁻¹ noise) and fitted by
the other model with `fitmat.fit`; the closed formula n = 2/α² − 2 stands beside what is found. What is left is smooth
in ln α, so that a cubic describes it, and the script checks that `fitmat.models.conversion` holds its coefficients. The
settings show what the relation owes to the incidences measured, to the diffuse part and to the index.

Run: python benchmarks/conversion.py [--seeds 3] [--figure FILE.png]
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import jax
import machine
import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from tables import replace_between, to_markdown

import fitmat as fm
from fitmat.models.base import AbstractBRDF
from fitmat.models.conversion import (
    ALPHA_CORRECTION,
    EXPONENT_CORRECTION,
    alpha_from_exponent,
    exponent_from_alpha,
    fitted_alpha,
    fitted_exponent,
)

ALPHAS = np.geomspace(0.02, 0.8, 14)

SETTINGS = {
    "10–70°": {"incidence": (10, 30, 50, 70), "kd": 0.3, "eta": 1.5},
    "10–50°": {"incidence": (10, 30, 50), "kd": 0.3, "eta": 1.5},
    "30–80°": {"incidence": (30, 55, 80), "kd": 0.3, "eta": 1.5},
    "dark": {"incidence": (10, 30, 50, 70), "kd": 0.02, "eta": 1.5},
    "η = 3": {"incidence": (10, 30, 50, 70), "kd": 0.3, "eta": 3.0},
}
"""What the relation might depend on; the first is the reference, to which the correction is fitted."""

SENSOR = np.deg2rad(np.arange(-85.0, 85.5, 1.0))

RELATIVE, ABSOLUTE = 0.02, 1e-3

DEGREE = 3
"""Of the correction."""

SAME = 0.05
"""The library's correction may differ from a new one by so much of the width, well below the spread of the settings."""

TICKS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)
"""Of the plot's abscissa."""

PAGE = Path(__file__).with_name("match.md")

COLOURS = ("#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7")
"""Okabe & Ito's palette, which colour-blind readers can tell apart."""


def simulated(truth: AbstractBRDF, incidence: tuple[float, ...], seed: int) -> fm.Measurements:
    """One measurement with noise."""
    lights = np.deg2rad(incidence)
    return fm.simulate(truth, lights, SENSOR, relative_noise=RELATIVE, absolute_noise=ABSOLUTE, seed=seed)


def exponent_found(alpha: float, incidence: tuple[float, ...], kd: float, eta: float, seed: int) -> float:
    """ln of α_n/α, where α_n = √(2/(n+2)) is the width of the Blinn–Phong lobe fitted to GGX data."""
    measured = simulated(fm.model("lambert+ggx", kd=kd, alpha=alpha, eta=eta), incidence, seed)
    found = fm.fit(measured, "lambert+blinn-phong")
    n = found.values[next(e.place for e in found.entries if e.name == "exponent")][0]
    return float(np.log(alpha_from_exponent(n) / alpha))


def alpha_found(alpha: float, incidence: tuple[float, ...], kd: float, eta: float, seed: int) -> float:
    """ln of the fitted α over √(2/(n+2)), fitted to Blinn–Phong data as bright at the peak as GGX would be."""
    n = exponent_from_alpha(alpha)
    f0 = ((eta - 1) / (eta + 1)) ** 2
    truth = fm.model("lambert+blinn-phong", kd=kd, ks=f0 * (n + 2) / (n + 8), exponent=n)
    found = fm.fit(simulated(truth, incidence, seed), "lambert+ggx")
    fitted = found.values[next(e.place for e in found.entries if e.name == "alpha")][0]
    return float(np.log(fitted / alpha))


Recover = Callable[..., float]


def residuals(recover: Recover, seeds: int) -> dict[str, np.ndarray]:
    """Setting → ln of found over closed-form width, (alphas, seeds); other settings than the first need one seed."""
    found = {}
    for name, setting in SETTINGS.items():
        some = range(seeds if name == next(iter(SETTINGS)) else 1)
        found[name] = np.array([[recover(alpha, seed=seed, **setting) for seed in some] for alpha in ALPHAS])
        print(name, np.round(found[name].mean(axis=1), 3), flush=True)
    return found


def correction(found: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The cubic through the mean of all settings, and the rms of its and of the closed form's errors at each width."""
    each = np.array([values.mean(axis=1) for values in found.values()])
    cubic = np.polynomial.polynomial.polyfit(np.log(ALPHAS), each.mean(axis=0), DEGREE)
    left = each - np.polynomial.polynomial.polyval(np.log(ALPHAS), cubic)
    return cubic, np.sqrt((left**2).mean(axis=0)), np.sqrt((each**2).mean(axis=0))


def figure(found: tuple[dict[str, np.ndarray], ...], cubics: list[np.ndarray]) -> Figure:
    """Both residuals against the width, one line for each setting, with the correction."""
    mpl.use("Agg")
    drawn = Figure(figsize=(11, 4.2), layout="constrained")
    titles = "Blinn–Phong fitted to GGX of slope α", "GGX fitted to Blinn–Phong of exponent n"
    labels = "ln( √(2/(n+2)) found / α )", "ln( α found / √(2/(n+2)) )"
    abscissas = "α", "√(2/(n+2))"
    for k, ax in enumerate(drawn.subplots(1, 2, sharey=True)):
        for (name, values), colour in zip(found[k].items(), COLOURS, strict=True):
            ax.plot(ALPHAS, values.mean(axis=1), ".-", color=colour, lw=0.9, label=name)
        fine = np.geomspace(ALPHAS[0], ALPHAS[-1], 200)
        polynomial = np.polynomial.polynomial.polyval(np.log(fine), cubics[k])
        ax.plot(fine, polynomial, color="0.6", lw=4, alpha=0.6, zorder=0, label="cubic")
        ax.axhline(0.0, color="0.5", lw=0.8, ls="--")
        ax.set(xscale="log", title=titles[k], xlabel=abscissas[k], ylabel=labels[k])
        ax.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
        ax.minorticks_off()
    drawn.axes[0].legend(fontsize="small", title="incidences; diffuse; index")
    drawn.suptitle("What a fit finds beside the closed form n = 2/α² − 2 (dashed)")
    return drawn


def table(found: tuple[dict[str, np.ndarray], ...]) -> str:
    """Exponent and alpha by both formulas beside what the first setting finds, and the spread of all settings."""
    first = next(iter(SETTINGS))
    errors, lines = [correction(part) for part in found], []
    for k, alpha in enumerate(ALPHAS):
        n = exponent_from_alpha(alpha)
        recovered = exponent_from_alpha(alpha * np.exp(found[0][first][k].mean()))
        slope = alpha * np.exp(found[1][first][k].mean())
        lines.append(
            [f"{alpha:.3f}", f"{n:.4g}", f"{recovered:.4g}", f"{fitted_exponent(alpha):.4g}",
             f"{errors[0][2][k]:.2f} → {errors[0][1][k]:.2f}", f"{slope:.3f}", f"{fitted_alpha(n):.3f}",
             f"{errors[1][2][k]:.2f} → {errors[1][1][k]:.2f}"]
        )  # fmt: skip
    headings = ["α", "n = 2/α² − 2", "n fitted to GGX(α)", "n corrected", "rms of ln width: closed → corrected",
                "α fitted to Blinn–Phong(n)", "α corrected", "rms of ln width: closed → corrected"]  # fmt: skip
    return to_markdown(headings, lines)


def main() -> None:
    """Fit, check the coefficients that the library holds, remake the page and the plot."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--seeds", type=int, default=3, help="noise draws of the first setting")
    options.add_argument("--figure", type=Path, default=Path(__file__).with_suffix(".png"), help="where to draw")
    chosen = options.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(machine.described(), "\n")
    found = residuals(exponent_found, chosen.seeds), residuals(alpha_found, chosen.seeds)
    cubics = [correction(part)[0] for part in found]
    for cubic, held in zip(cubics, (EXPONENT_CORRECTION, ALPHA_CORRECTION), strict=True):
        print("coefficients of 1, x, x², x³:", np.round(cubic, 4))
        apart = np.polynomial.polynomial.polyval(np.log(ALPHAS), cubic - np.array(held))
        assert np.abs(apart).max() < SAME, f"the library's correction is off by {np.abs(apart).max():.3f}"
    figure(found, cubics).savefig(chosen.figure, dpi=110)
    replace_between(PAGE, "conversion", table(found))


if __name__ == "__main__":
    main()
