"""Models whose values are estimated: multiple scattering on Smith surfaces, by name, beside lobes with a formula.

What a path does on the surface, `multiple_scattering` knows; nothing here is fitted.
"""

from collections.abc import Iterator
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.errors import ModelError
from fitmat.models.base import AbstractBRDF, AbstractEstimated, MonteCarlo, evaluate, padded_length
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.multiple_scattering.position_free import evaluate_slab
from fitmat.models.multiple_scattering.random_walk import evaluate_walk
from fitmat.models.multiple_scattering.surface import Surface

Estimator = Literal["walk", "slab"]
"""Heitz et al. 2016; Bitterli & d'Eon 2022."""

ESTIMATORS = {"walk": evaluate_walk, "slab": evaluate_slab}

ROWS = 1024
"""Pairs that are followed at the same time."""


class Walked(AbstractEstimated):
    """Multiple scattering on rough GGX or Beckmann surfaces, without approximation: `ggx-walk`, `ggx-slab`, ….

    f = ks Σ_k f_k: light that left the surface after k collisions with its facets. f_1 is the lobe `ggx`; the sum is
    what `ggx-kc` and `ggx-turquin` approximate. `-walk` follows light in random walks on the Smith surface (Heitz et
    al. 2016), `-slab` in paths without depths, which have the same mean and less variance (Bitterli & d'Eon 2022).

    Parameters: as `ggx`: ks, 0 to 10; alpha, 0.0001 to 1; eta, f0, f0 and f82, or eta and kappa.

    Limits: an estimate from random numbers, with a standard error that falls like 1/√samples; it has no slopes and is
    not fitted: fit `ggx-kc`, or `ggx-turquin`. With F = 1 the albedo is 1. What a dielectric's facets do not reflect
    is absorbed; `fm.Surface(..., transmits=True)` lets it through. Isotropic roughness and correlated masking only;
    stands alone or beside other lobes, not below a cover. Positive, reciprocal, conserves energy for ks ≤ 1.

    References: E. Heitz, J. Hanika, E. d'Eon & C. Dachsbacher, Multiple-scattering microfacet BSDFs with the Smith
    model, ACM TOG 35(4), 2016; B. Bitterli & E. d'Eon, A position-free path integral for homogeneous slabs and multiple
    scattering on Smith microfacets, Computer Graphics Forum 41(4), 2022.

    Example: `fm.evaluate(fm.model("ggx-walk-schlick", alpha=0.5, f0=0.9), wi, wo, samples=10_000, seed=1)` gives a
    `MonteCarlo` with `value` and `standard_error`; `fitmat simulate ggx-slab-schlick --set f0=0.9 --samples 4096`.

    """

    lobe: Microfacet
    rest: AbstractBRDF | None
    label: str = eqx.field(static=True)
    estimator: Estimator = eqx.field(static=True)
    # Single scattering of the rough surface; the other lobes of the sum, which have a formula; names.

    def __check_init__(self) -> None:
        """Refuse what is no Smith surface."""
        if self.lobe.masking != "correlated":
            raise ModelError(f"masking {self.lobe.masking!r} of {self.label}: expected correlated, as light walks.")

    @property
    def name(self) -> str:
        """As it was built."""
        return self.label

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """No formula.

        Raises:
            ModelError: always; says what can be done.
        """
        raise ModelError(unfitted(self.label))

    def width(self) -> Scalar:
        """Of the narrowest lobe."""
        return self.lobe.width() if self.rest is None else jnp.minimum(self.lobe.width(), self.rest.width())

    @property
    def isotropic(self) -> bool:
        """Where the other lobes are."""
        return self.rest is None or self.rest.isotropic

    @property
    def surface(self) -> Surface:
        """What light walks on, without ks; for `fitmat.albedo_walk`."""
        alpha = self.lobe.roughness.slopes[0]
        return Surface(self.lobe.distribution, alpha, jax.tree.map(jnp.asarray, self.lobe.fresnel))

    def estimate(
        self, wi: Float[np.ndarray, "n 3"], wo: Float[np.ndarray, "n 3"], *, samples: int, seed: int
    ) -> MonteCarlo:
        """By paths for each pair, a part of the pairs at a time."""
        surface, rest = self.surface, self.rest
        up = (wi[:, 2] > 0.0) & (wo[:, 2] > 0.0)
        parts = [
            ESTIMATORS[self.estimator](surface, *pair, samples=samples, seed=own)
            for pair, own in _parts(wi[up], wo[up], seed)
        ]
        ks = np.atleast_1d(np.asarray(self.lobe.ks))
        added = np.zeros((len(wi), 1)) if rest is None else evaluate(rest, wi, wo)
        shape = len(wi), np.broadcast_shapes(ks.shape, added.shape[1:], *(p.value.shape[1:] for p in parts[:1]))[0]
        value, error, omitted = np.broadcast_to(added, shape).copy(), np.zeros(shape), np.zeros(len(wi))
        if parts:
            count = np.count_nonzero(up)
            value[up] += ks * np.concatenate([p.value for p in parts])[:count]
            error[up] = ks * np.concatenate([p.standard_error for p in parts])[:count]
            omitted[up] = np.concatenate([p.omitted for p in parts])[:count]
        return MonteCarlo(value, error, omitted, parts[0].samples if parts else samples)


def unfitted(name: str) -> str:
    """Why a model without a formula is not fitted, and what to do."""
    return (
        f"{name} is estimated from random walks and has no formula to fit or to integrate, expected another model: "
        "take ggx-kc, which gives back the same energy. fitmat.evaluate and simulate take it, with samples and a seed, "
        "and fitmat.albedo_walk(model.surface, …) has its albedo."
    )


def _parts(wi: np.ndarray, wo: np.ndarray, seed: int) -> Iterator[tuple[tuple[np.ndarray, np.ndarray], int]]:
    """At most `ROWS` pairs, filled up with the last one to a length that many files share, and a seed for each."""
    for k, start in enumerate(range(0, len(wi), ROWS)):
        some = [w[start : start + ROWS] for w in (wi, wo)]
        more = padded_length(len(some[0])) - len(some[0]) if start + ROWS >= len(wi) else 0
        own = int(np.random.SeedSequence([seed, k]).generate_state(1)[0])
        light, sensor = (np.pad(w, ((0, more), (0, 0)), mode="edge") for w in some)
        yield (light, sensor), own
