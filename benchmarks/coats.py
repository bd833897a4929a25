"""Coats over three bases and at three roughnesses: albedo with the mirror image, fitmat against photons one by one.

Prints the table of docs/models.md; `python benchmarks/coats.py [PHOTONS]`.
"""

import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from fitmat.maths.directions import from_angles
from fitmat.models.albedo import albedo
from fitmat.models.around.coat import RoughCoat, SmoothCoat, Varnish
from fitmat.models.base import AbstractBRDF
from fitmat.models.lobes.lambert import Lambert
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.terms.distributions import GGX, Isotropic
from fitmat.models.terms.fresnel import Schlick, White

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from oracles import coat_photons as photons

ANGLES, ETA, SEED = [0.0, 30.0, 60.0, 80.0], 1.5, 1
GOLD = 0.73
"""F0 of gold, green."""


def ours(model: AbstractBRDF) -> list[float]:
    """Albedo with the mirror image at `ANGLES`."""
    theta = np.deg2rad(ANGLES)
    mirror = [float(np.ravel(model.mirror(jnp.array(w)))[0]) for w in from_angles(theta, 0 * theta)]
    return list(albedo(model, theta).value[:, 0] + np.array(mirror))


def show(name: str, found: list[float], theirs: list[tuple[float, float]], bare: list[float] | None = None) -> None:
    """One row: fitmat / photons ± standard error (/ bare base)."""
    bases = [""] * len(found) if bare is None else [f" / {b:.3f}" for b in bare]
    cells = [f"{f:.4f} / {m:.4f} ± {e:.4f}{b}" for f, (m, e), b in zip(found, theirs, bases, strict=True)]
    print("| " + " | ".join([name, *cells]) + " |", flush=True)


def main(count: int) -> None:
    """Smooth varnish over white and gold-like facets, rough varnish over grey, white and gold."""
    zero = jnp.zeros(())
    metals = {"white facets": (White(), photons.schlick(1.0)), "gold-like facets": (Schlick(jnp.array(GOLD)), None)}
    for name, (fresnel, curve) in metals.items():
        for alpha in (0.05, 0.2, 0.5):
            facets = Microfacet(jnp.ones(()), Isotropic(jnp.array(alpha)), fresnel, GGX())
            base = photons.Facets(alpha, curve or photons.schlick(GOLD))
            theirs = [photons.albedo(base, np.deg2rad(a), ETA, count=count, seed=SEED) for a in ANGLES]
            found = ours(Varnish(SmoothCoat(jnp.array(ETA), zero), facets))
            show(f"smooth, {name} {alpha}", found, theirs, ours(facets))
    rough = {
        "grey Lambert": (Lambert(jnp.array(0.5)), photons.Lambert(0.5)),
        "white facets 0.2": (
            Microfacet(jnp.ones(()), Isotropic(jnp.array(0.2)), White(), GGX()),
            photons.Facets(0.2, photons.schlick(1.0)),
        ),
        "gold-like facets 0.2": (
            Microfacet(jnp.ones(()), Isotropic(jnp.array(0.2)), Schlick(jnp.array(GOLD)), GGX()),
            photons.Facets(0.2, photons.schlick(GOLD)),
        ),
    }
    for name, (base, theirs_base) in rough.items():
        for alpha in (0.1, 0.3, 1.0):
            theirs = [
                photons.rough_albedo(theirs_base, np.deg2rad(a), ETA, alpha, count=count, seed=SEED) for a in ANGLES
            ]
            show(
                f"rough {alpha}, {name}", ours(Varnish(RoughCoat(jnp.array(ETA), jnp.array(alpha), zero), base)), theirs
            )


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
