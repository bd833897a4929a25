"""Kulla and Conty's lobe in the white furnace, against Cycles' albedo tables, by hand, and in its limits."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import white_facets
from selection import always

import fitmat as fm
from fitmat.fitting.coordinates import coordinates
from fitmat.maths.directions import from_angles
from fitmat.models.albedo import albedo
from fitmat.models.base import evaluate_pairs
from fitmat.models.lobes.kulla_conty import KullaConty
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.parameters import entries, vector, with_vector
from fitmat.models.terms.distributions import GGX, AbstractDistribution, Beckmann, Isotropic
from fitmat.models.terms.fresnel import White

FURNACE = 5e-4
"""Absolute; 1e-4 that the manual page claims, and the error of the average over normals."""

BY_HAND = 0.01
"""Relative; three albedos, each known to 0.002, enter as 1 − E ≈ 0.3 to 0.5."""

DIFFERENCES = 1e-6
"""Relative to |∂f/∂p| + |f|/p."""

Hemisphere = Any
Pairs = dict[str, tuple[np.ndarray, np.ndarray]]
DISTRIBUTIONS: dict[str, AbstractDistribution] = {"ggx": GGX(), "beckmann": Beckmann()}


def _white(distribution: str, alpha: float) -> KullaConty:
    return KullaConty(jnp.ones(()), Isotropic(jnp.array(alpha)), White(), DISTRIBUTIONS[distribution])


def _multiple(model: KullaConty, cos: float) -> float:
    """2π∫ (f − f_single) c dc; it has no azimuth, so it is taken where the lobe is dark."""
    x, weights = np.polynomial.legendre.leggauss(64)
    co = ((x + 1) / 2) ** 2
    across = np.stack([0 * co, np.sqrt(1 - co**2), co], axis=1)
    wi = np.tile([np.sqrt(1 - cos**2), 0.0, cos], (64, 1))
    bare = Microfacet(model.ks, model.roughness, model.fresnel, model.distribution)
    difference = fm.evaluate(model, wi, across)[:, 0] - fm.evaluate(bare, wi, across)[:, 0]
    return float(2 * np.pi * np.sum(weights * np.sqrt(co) * co * difference))


@pytest.mark.parametrize("alpha", always({0.001, 0.1, 1.0}, [0.001, 0.01, 0.1, 0.3, 0.6, 1.0]))
@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
def test_the_white_furnace_gives_back_all_light(distribution: str, alpha: float) -> None:
    """Single scattering by an integral of its own, multiple scattering by Gauss in √c."""
    model = _white(distribution, alpha)
    for degrees in (0.1, 30.0, 60.0, 80.0, 85.0, 89.0):
        cos = float(np.cos(np.deg2rad(degrees)))
        assert white_facets.albedo(distribution, alpha, cos) + _multiple(model, cos) == pytest.approx(1, abs=FURNACE), (
            degrees
        )


def test_multiple_scattering_by_hand() -> None:
    """Cycles' albedos at alpha (22/31)², cosines 15/31 and 1, and Schlick's average F0 + (1 − F0)/21."""
    alpha, f0, ks = (22 / 31) ** 2, 0.6, 0.8
    ei, eo, mean = white_facets.CYCLES[15 / 31][4], white_facets.CYCLES[1.0][4], white_facets.CYCLES_MEAN[4]
    f_avg = f0 + (1 - f0) / 21
    f_ms = f_avg**2 * mean / (1 - f_avg * (1 - mean))
    by_hand = ks * f_ms * (1 - ei) * (1 - eo) / (np.pi * (1 - mean))
    wi, up = np.array([[np.sqrt(1 - (15 / 31) ** 2), 0, 15 / 31]]), np.array([[0.0, 0.0, 1.0]])
    both, single = (
        fm.evaluate(fm.model(name, alpha=alpha, f0=f0, ks=ks), wi, up)[0, 0]
        for name in ("ggx-kc-schlick", "ggx-schlick")
    )
    assert both - single == pytest.approx(by_hand, rel=BY_HAND)


def test_a_smooth_surface_has_nothing_to_give_back(hemisphere: Hemisphere) -> None:
    """At alpha 0.001 and cosines above 0.2 what is missing is of the order alpha², 1e-5."""
    wi, wo = (w[w[:, 2] > 0.2][:40] for w in (hemisphere(80, 1), hemisphere(80, 2)))
    compensated, bare = (fm.evaluate(fm.model(name, alpha=1e-3), wi, wo) for name in ("ggx-kc", "ggx"))
    np.testing.assert_allclose(compensated, bare, atol=1e-5)


def test_a_coloured_metal_gets_more_saturated() -> None:
    """Light that met several facets took the colour several times: red over blue of rough gold grows."""
    compensated, bare = (
        albedo(fm.model(name, f0=np.array([0.95, 0.4]), alpha=0.8, channels=2), np.zeros(1)).value[0]
        for name in ("ggx-kc-schlick", "ggx-schlick")
    )
    assert np.all(compensated > bare)
    assert compensated[0] / compensated[1] > 1.05 * bare[0] / bare[1]


@pytest.mark.parametrize("name", ["ggx-kc-conductor", "beckmann-kc-schlick"])
def test_the_lobe_is_reciprocal(hemisphere: Hemisphere, name: str) -> None:
    wi, wo, model = hemisphere(60, 3), hemisphere(60, 4), fm.model(name, alpha=0.7)
    np.testing.assert_allclose(fm.evaluate(model, wi, wo), fm.evaluate(model, wo, wi), rtol=1e-10)


def test_gradients_are_finite_differences(hemisphere: Hemisphere, singular: Pairs) -> None:
    """By jacfwd in alpha, f0 and ks; finite at the singular pairs and at the bounds."""
    model = fm.model("ggx-kc-schlick", alpha=0.5, f0=0.3)
    special_i, special_o = (np.array(column) for column in zip(*singular.values(), strict=True))
    wi, wo = (jnp.array(np.concatenate(p)) for p in ((hemisphere(20, 5), special_i), (hemisphere(20, 6), special_o)))

    @jax.jit
    def both(point: jax.Array) -> tuple[jax.Array, jax.Array]:
        def values(point: jax.Array) -> jax.Array:
            return evaluate_pairs(with_vector(model, point), wi, wo)[:, 0]

        return values(point), jax.jacfwd(values)(point)

    bounds, point = coordinates(model), np.asarray(vector(model))
    for corner in (bounds.lower, bounds.upper):
        assert all(np.isfinite(part).all() for part in both(jnp.array(corner)))
    value, slopes = (np.asarray(part)[:20] for part in both(jnp.array(point)))
    for k, entry in enumerate(entries(model)):
        step = 1e-3 * point[k]
        at = [np.asarray(both(jnp.array(point + j * step * (np.arange(3) == k)))[0])[:20] for j in (-2, -1, 1, 2)]
        expected = (at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * step)
        assert np.all(np.abs(slopes[:, k] - expected) < DIFFERENCES * (np.abs(expected) + value / point[k])), entry.name


def test_light_from_below_gives_nothing() -> None:
    below = from_angles(np.deg2rad([100.0, 30.0]), np.zeros(2))
    assert (fm.evaluate(fm.model("ggx-kc"), below, below[::-1]) == 0).all()
