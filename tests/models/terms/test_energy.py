"""Energy that white facets lose: against Blender's tables, averages over normals and closed forms; its slope."""

from typing import cast

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import white_facets
from selection import always

from fitmat.models.terms.distributions import GGX, MASKINGS, AbstractDistribution, Beckmann, Masking
from fitmat.models.terms.energy import ERROR, missing

DISTRIBUTIONS: dict[str, AbstractDistribution] = {"ggx": GGX(), "beckmann": Beckmann()}

GRID = 5e-5
"""Absolute; error of the average over normals, 700 by 700 of them."""

CYCLES = 2e-4
"""Absolute; Blender's tables, of 10⁸ samples a number: their standard error is 5e-5."""

DIFFERENCES = 1e-6
"""Relative; central differences of fourth order with steps of a thousandth."""

ALL = [f"{name} {masking}" for name in DISTRIBUTIONS for masking in MASKINGS]


@pytest.mark.parametrize("column", range(len(white_facets.ROUGH)))
def test_albedos_are_those_of_cycles(column: int) -> None:
    lost = missing(GGX(), "correlated", jnp.array(white_facets.ROUGH[column] ** 2))
    expected = [row[column] for row in white_facets.CYCLES.values()]
    np.testing.assert_allclose(1 - lost(jnp.array(list(white_facets.CYCLES))), expected, atol=CYCLES)
    assert 1 - lost.average() == pytest.approx(white_facets.CYCLES_MEAN[column], abs=CYCLES)


@pytest.mark.parametrize("masking", ["correlated", "separable"])
def test_albedo_at_alpha_1_and_normal_incidence_is_closed(masking: Masking) -> None:
    """D = 1/π, G1(o) = (2c²−1)/c² for θ_o = 2θ_h: 2∫ (2c²−1)/c dc from 1/√2 to 1 is 1 − ln 2."""
    assert 1 - missing(GGX(), masking, jnp.ones(()))(jnp.ones(())) == pytest.approx(1 - np.log(2), abs=ERROR)
    assert white_facets.albedo("ggx", 1.0, 1 - 1e-12, masking) == pytest.approx(1 - np.log(2), abs=GRID)


@pytest.mark.parametrize("name", always({"ggx correlated"}, ALL))
def test_the_error_is_as_small_as_stated(name: str) -> None:
    distribution, masking = cast(tuple[str, Masking], name.split())
    cosines = np.array([0.02, 0.05, 0.2, 0.5, 0.9])
    for alpha in (0.002, 0.01, 0.05, 0.2, 0.7, 1.0):
        found = 1 - missing(DISTRIBUTIONS[distribution], masking, jnp.array(alpha))(jnp.array(cosines))
        expected = [white_facets.albedo(distribution, alpha, cos, masking) for cos in cosines]
        np.testing.assert_allclose(found, expected, atol=ERROR + GRID, err_msg=f"{alpha}")


@pytest.mark.parametrize("alpha", [1e-4, 1e-3, 0.03, 0.4, 1.0])
def test_something_is_missing_everywhere_and_its_mean_is_that_of_the_curve(alpha: float) -> None:
    """Positive to the horizon and below; 2∫ (1 − E) c dc by 400 nodes in c^(1/3)."""
    lost = missing(Beckmann(), "correlated", jnp.array(alpha))
    at = np.r_[-0.5, -2 * alpha, 0.0, np.geomspace(1e-9, 1, 50)]
    assert (lost(jnp.array(at)) > 0).all()
    x, weights = np.polynomial.legendre.leggauss(400)
    root = (x + 1) / 2
    mean = weights / 2 @ (6 * root**5 * np.asarray(lost(jnp.array(root**3))))
    assert lost.average() == pytest.approx(mean, rel=1e-3, abs=1e-12)


def test_the_slope_is_that_of_the_value() -> None:
    """In the cosine and in alpha."""

    @jax.jit
    def value(at: jax.Array) -> jax.Array:
        return missing(GGX(), "correlated", at[1])(at[0])

    for cos, alpha in ((0.3, 0.4), (0.02, 0.1), (0.9, 0.8)):
        slope, at = jax.grad(value)(jnp.array([cos, alpha])), np.array([cos, alpha])
        for k in range(2):
            step = 1e-3 * at[k] * (np.arange(2) == k)
            near = [float(value(jnp.array(at + j * step))) for j in (-2, -1, 1, 2)]
            expected = (near[0] - 8 * near[1] + 8 * near[2] - near[3]) / (12e-3 * at[k])
            assert slope[k] == pytest.approx(expected, rel=DIFFERENCES)
