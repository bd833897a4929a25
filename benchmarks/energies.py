"""Remakes the energies that single scattering loses at white facets, and says how exact they are.

`fitmat/models/terms/energies.npz` holds for GGX and Beckmann with each masking the coefficients of 1 − E(c, α) over
products of Chebyshev polynomials, (24, 16); see `fitmat/models/terms/energy.py`. E is integrated by
`quadrature.lobe_rule`; `tests/models/terms/test_energy.py` compares the file with averages over visible normals, with
Blender's tables and with closed forms.

Run: python benchmarks/energies.py
"""

import itertools
from typing import Any, get_args

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import chebyshev

from fitmat.maths.quadrature import lobe_rule
from fitmat.models.base import evaluate_pairs
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.terms.distributions import GGX, AbstractDistribution, Beckmann, Isotropic, Masking
from fitmat.models.terms.energy import DEGREES, FILE, LEAST_ALPHA, SCALE, missing
from fitmat.models.terms.fresnel import White

NODES: dict[str, tuple[int, int]] = {"correlated": (128, 48), "separable": (128, 48), "v-cavity": (256, 192)}
"""Of the quadrature; V-cavities have a crease."""

TRIED = 500
"""Cosines and alphas at random of which the error is said."""

_values = jax.jit(evaluate_pairs)


def lost(distribution: AbstractDistribution, masking: Masking, cos: float, alpha: float) -> float:
    """1 − E, by quadrature."""
    rule = lobe_rule(np.arccos(cos), alpha, nodes=NODES[masking])
    white = Microfacet(jnp.ones(()), Isotropic(jnp.array(alpha)), White(), distribution, masking)
    return 1.0 - float(rule.weight @ _values(white, np.broadcast_to(rule.wi, rule.wo.shape), rule.wo)[:, 0])


def points(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Chebyshev points in [0, 1], and the matrix from values there to coefficients."""
    x = chebyshev.chebpts1(count)
    return (x + 1) / 2, np.linalg.inv(chebyshev.chebvander(x, count - 1))


def fitted(distribution: AbstractDistribution, masking: Masking) -> np.ndarray:
    """The coefficients."""
    (u, of_cos), (v, of_alpha) = map(points, DEGREES)
    alphas = LEAST_ALPHA + (1 - LEAST_ALPHA) * v
    cosines = [SCALE * a * u / (1 + SCALE * a - u) for a in alphas]
    values = np.array(
        [[lost(distribution, masking, c, a) for c in column] for column, a in zip(cosines, alphas, strict=True)]
    )
    return of_cos @ values.T @ of_alpha.T


def main() -> None:
    """Writes the file and prints errors."""
    jax.config.update("jax_enable_x64", True)
    made = {(d, m): fitted(d, m) for d, m in itertools.product((GGX(), Beckmann()), get_args(Masking))}
    tables: dict[str, Any] = {f"{d.label}-{m}": table for (d, m), table in made.items()}
    np.savez(FILE, **tables)
    rng = np.random.default_rng(0)
    alphas = LEAST_ALPHA ** rng.uniform(size=TRIED)
    cosines = np.minimum(alphas * np.sinh(rng.uniform(size=TRIED) * np.arcsinh(1 / alphas)), 1.0)
    for d, m in made:
        found = [float(missing(d, m, jnp.array(a))(jnp.array(c))) for c, a in zip(cosines, alphas, strict=True)]
        error = np.abs(found - np.array([lost(d, m, c, a) for c, a in zip(cosines, alphas, strict=True)]))
        print(f"{d.label} {m}: worst {error.max():.1e}, root mean square {np.sqrt(np.mean(error**2)):.1e}")
    print(f"{FILE}: {FILE.stat().st_size} bytes.")


if __name__ == "__main__":
    main()
