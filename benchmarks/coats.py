"""Coats over three bases and at three roughnesses: albedo with the mirror image, fitmat against two programs.

Photons followed one by one (`tests/oracles/coat_photons.py`), and Mitsuba 3 tracing paths between two planes
(`tests/oracles/mitsuba_slab.py`; left out where it is not installed). Prints the tables of docs/models.md and how many
cells are further off than three standard errors and 1 %; `python benchmarks/coats.py [PHOTONS]`.
"""

import importlib.util
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from fitmat.maths.directions import from_angles
from fitmat.models.albedo import albedo
from fitmat.models.around.coat import RoughCoat, SmoothCoat
from fitmat.models.around.varnish import Varnish
from fitmat.models.base import AbstractBRDF
from fitmat.models.lobes.lambert import Lambert
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.terms.distributions import GGX, Isotropic
from fitmat.models.terms.fresnel import Schlick, White

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from oracles import coat_photons as photons
from oracles import mitsuba_slab

ANGLES, ETA, SEED = [0.0, 30.0, 60.0, 80.0], 1.5, 1
GOLD = 0.73
"""F0 of gold, green; also the share that Mitsuba's facets reflect, which have no Schlick."""

ONE = jnp.ones(())

Estimate = tuple[float, float]
"""An albedo and its standard error."""


class Row(NamedTuple):
    """A coat over a base, and who else knows its albedo: (angle in radians, photons) to an estimate."""

    name: str
    model: AbstractBRDF
    other: Callable[[float, int], Estimate]


def coated(base: AbstractBRDF, alpha: float | None) -> Varnish:
    """Polished (None) or rough."""
    eta, zero = jnp.array(ETA), jnp.zeros(())
    return Varnish(SmoothCoat(eta, zero) if alpha is None else RoughCoat(eta, jnp.array(alpha), zero), base)


def by_photons() -> Iterator[Row]:
    """Polished over white and gold-like facets, rough over grey, white and gold-like."""
    metals = {"white facets": (White(), photons.schlick(1.0)), "gold-like facets": (Schlick(jnp.array(GOLD)), None)}

    def facets(name: str, alpha: float) -> tuple[AbstractBRDF, photons.Facets]:
        fresnel, curve = metals[name]
        base = Microfacet(ONE, Isotropic(jnp.array(alpha)), fresnel, GGX())
        return base, photons.Facets(alpha, curve or photons.schlick(GOLD))

    for name in metals:
        for alpha in (0.05, 0.2, 0.5):
            base, theirs = facets(name, alpha)

            def smooth(theta: float, count: int, theirs: photons.Facets = theirs) -> Estimate:
                return photons.albedo(theirs, theta, ETA, count=count, seed=SEED)

            yield Row(f"smooth, {name} {alpha}", coated(base, None), smooth)
    grey = Lambert(jnp.array(0.5)), photons.Lambert(0.5)
    for name, (base, theirs) in {"Lambert 0.5": grey, **{f"{n} 0.2": facets(n, 0.2) for n in metals}}.items():
        for alpha in (0.1, 0.3, 1.0):

            def rough(theta: float, count: int, theirs: photons.Base = theirs, alpha: float = alpha) -> Estimate:
                return photons.rough_albedo(theirs, theta, ETA, alpha, count=count, seed=SEED)

            yield Row(f"rough {alpha}, {name}", coated(base, alpha), rough)


def by_mitsuba(mi: Any) -> Iterator[Row]:
    """Polished over grey, white and golden facets; its facets scatter once, so that its rough faces lose light."""
    bases: dict[str, tuple[AbstractBRDF, dict[str, Any]]] = {
        "Lambert 0.5": (Lambert(jnp.array(0.5)), mitsuba_slab.DIFFUSE)
    }
    for name, share in (("white", 1.0), ("golden", GOLD)):
        for alpha in (0.05, 0.2, 0.5):
            lobe = Microfacet(jnp.array(share), Isotropic(jnp.array(alpha)), White(), GGX(), "separable")
            bases[f"{name} facets {alpha}"] = lobe, mitsuba_slab.facets(alpha, share)
    for coat in (None, 0.1):
        for name, (base, theirs) in bases.items():
            if coat is None or name in ("Lambert 0.5", "white facets 0.2", "golden facets 0.2"):

                def traced(theta: float, count: int, theirs: Any = theirs, coat: float | None = coat) -> Estimate:
                    return mitsuba_slab.albedo(mi, theirs, theta, ETA, coat, count=count, seed=SEED)

                yield Row(f"{'smooth' if coat is None else f'rough {coat}'}, {name}", coated(base, coat), traced)


def ours(model: AbstractBRDF) -> np.ndarray:
    """Albedo with the mirror image at `ANGLES`."""
    theta = np.deg2rad(ANGLES)
    mirror = [float(np.ravel(model.mirror(jnp.array(w)))[0]) for w in from_angles(theta, 0 * theta)]
    return albedo(model, theta).value[:, 0] + np.array(mirror)


def show(rows: Iterator[Row], count: int) -> None:
    """A table of fitmat / the other ± standard error."""
    print("| coat, base | " + " | ".join(f"{angle:g}°" for angle in ANGLES) + " |\n|---|---|---|---|---|")
    far, cells = 0, 0
    for row in rows:
        found, theirs = ours(row.model), [row.other(angle, count) for angle in np.deg2rad(ANGLES)]
        far += sum(abs(f - m) > max(3 * e, 0.01 * m) for f, (m, e) in zip(found, theirs, strict=True))
        cells += len(found)
        told = [f"{f:.4f} / {m:.4f} ± {e:.4f}" for f, (m, e) in zip(found, theirs, strict=True)]
        print("| " + " | ".join([row.name, *told]) + " |", flush=True)
    print(f"{far} of {cells} cells are off by more than three standard errors and 1 %.\n")


def main(count: int) -> None:
    """Both tables."""
    jax.config.update("jax_enable_x64", True)
    show(by_photons(), count)
    if importlib.util.find_spec("mitsuba"):
        import mitsuba as mi

        mi.set_variant("scalar_rgb")
        show(by_mitsuba(mi), count)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
