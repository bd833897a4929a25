"""The laws of reflection, for every lobe of the registry and two sums; `BROKEN` declares the exceptions."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fitmat as fm
from fitmat.brdf import LOBES, AbstractBRDF, evaluate_pairs
from fitmat.geometry import from_angles
from fitmat.microfacet import MASKINGS
from fitmat.params import entries, space, vector, with_vector

ALL = [*LOBES, "lambert+phong", "lambert+ggx-schlick"]
NAMES = pytest.mark.parametrize("name", ALL)

EXACT = 1e-10
"""Relative; the order of additions differs, and a sharp lobe multiplies their rounding, 1e-16, by 1/alpha."""

QUADRATURE = 2e-3
"""Absolute; a midpoint grid of 400 × 160 directions; the narrowest lobe tried spans 25 of its rows."""

BROKEN: dict[str, tuple[dict[str, Any], float]] = {
    "blinn-phong": (
        {"exponent": 10.0},
        18 * (2**-5 + 10) / (12 * 14),
    ),  # (n+8)/(8π) over the exact normalisation
    "cook-torrance": (
        {"alpha": 0.1, "eta": 20.0},
        4 * (19 / 21) ** 2,
    ),  # 4 F0: D' = π D, and π where Walter has 4
    "cook-torrance-schlick": ({"alpha": 0.1, "f0": 0.999}, 4 * 0.999),
    "cook-torrance-conductor": (
        {"alpha": 0.1, "eta": 0.2, "kappa": 3.5},
        4 * (0.8**2 + 3.5**2) / (1.2**2 + 3.5**2),
    ),
    "lambert+phong": (
        {"kd": 1.0, "ks": 1.0, "exponent": 10.0},
        2.0,
    ),  # kd + ks: lobes of a sum do not share the light
    "lambert+ggx-schlick": ({"kd": 1.0, "f0": 0.04, "alpha": 0.1}, 1.04),  # kd + F0
}
"""Model: parameters, and its albedo at normal incidence by hand (for narrow lobes, but for Blinn)."""

Pairs = dict[str, tuple[np.ndarray, np.ndarray]]


@eqx.filter_jit
def _value(model: AbstractBRDF, wi: jax.Array, wo: jax.Array) -> jax.Array:
    return jnp.atleast_1d(model(wi, wo))


@eqx.filter_jit
def _slopes(model: AbstractBRDF, wi: jax.Array, wo: jax.Array) -> tuple[jax.Array, ...]:
    def total(values: jax.Array, wi: jax.Array, wo: jax.Array) -> jax.Array:
        return jnp.sum(with_vector(model, values)(wi, wo))

    return jax.vmap(jax.grad(total, argnums=(0, 1, 2)), (None, 0, 0))(vector(model), wi, wo)


def _corners(model: AbstractBRDF) -> list[AbstractBRDF]:
    """All parameters at their lower or upper bounds, and each alone at either with the rest at default."""
    bounds, default = space(model), np.asarray(vector(model))
    points = [bounds.lower, bounds.upper]
    for k in range(len(default)):
        points += [np.where(np.arange(len(default)) == k, bound, default) for bound in (bounds.lower, bounds.upper)]
    return [with_vector(model, jnp.array(point)) for point in points]


def _albedo(model: AbstractBRDF, theta: float) -> float:
    """∫ f cosθ_o dω_o for light at `theta` radians."""
    rows, columns = 400, 160
    theta_o, phi = (np.arange(rows) + 0.5) * np.pi / 2 / rows, (np.arange(columns) + 0.5) * np.pi / columns
    grid_theta, grid_phi = (part.ravel() for part in np.meshgrid(theta_o, phi, indexing="ij"))
    wo = from_angles(grid_theta, grid_phi)
    wi = np.broadcast_to(from_angles(np.array([theta]), np.zeros(1)), wo.shape)
    cell = 2 * (np.pi / 2 / rows) * (np.pi / columns)
    return float(np.sum(fm.evaluate(model, wi, wo)[:, 0] * wo[:, 2] * np.sin(grid_theta)) * cell)


def _shapes(name: str) -> list[AbstractBRDF]:
    """Narrow, middling and wide lobes of weight 1, which sums share, each with its Fresnel level."""
    tried: dict[str, Any] = {
        "alpha": (0.1, 0.3, 1.0),
        "exponent": (100.0, 10.0, 0.1),
        "eta": (1.2, 1.5, 20.0),
        "kappa": (0.1, 3.0, 50.0),
        "f0": (0.02, 0.2, 0.999),
    }
    names = [entry.name for entry in entries(fm.model(name))]
    weight = 0.5 if "+" in name else 1.0
    draws: list[dict[str, Any]] = [{key: tried[key][k] if key in tried else weight for key in names} for k in range(3)]
    return [fm.model(name, **values) for values in draws]


@NAMES
def test_positive_and_reciprocal(name: str) -> None:
    """For any directions and parameters within their bounds: f ≥ 0 and f(ω_i, ω_o) = f(ω_o, ω_i)."""
    model = fm.model(name)
    bounds, angle, turn = space(model), st.floats(0, np.pi / 2), st.floats(-np.pi, np.pi)
    parts = st.lists(st.floats(0, 1), min_size=len(vector(model)), max_size=len(vector(model)))

    @settings(max_examples=60)
    @given(st.tuples(angle, angle), st.tuples(turn, turn), parts)
    def law(theta: tuple[float, float], phi: tuple[float, float], part: list[float]) -> None:
        wi, wo = jnp.array(from_angles(np.array(theta), np.array(phi)))
        natural = bounds.natural_lower + (bounds.natural_upper - bounds.natural_lower) * np.array(part)
        drawn = with_vector(model, bounds.physical(jnp.array(natural)))
        there, back = _value(drawn, wi, wo), _value(drawn, wo, wi)
        assert there >= 0
        np.testing.assert_allclose(there, back, rtol=EXACT)

    law()


@NAMES
def test_dark_below_the_horizon(name: str) -> None:
    model = fm.model(name)
    up, down = (from_angles(np.deg2rad([angle]), np.zeros(1)) for angle in (30.0, 120.0))
    flat = np.array([[1.0, 0.0, 0.0]])
    for wi, wo in [(up, down), (down, up), (down, down), (up, flat), (flat, up)]:
        assert fm.evaluate(model, wi, wo) == 0
    assert fm.evaluate(model, up, up) > 0


@pytest.mark.parametrize("theta", [0.0, 30.0, 60.0, 80.0, 88.0])
@pytest.mark.parametrize("name", [name for name in ALL if name not in BROKEN or "+" in name])
def test_reflects_no_more_than_it_receives(name: str, theta: float) -> None:
    """∫ f cosθ_o dω_o ≤ 1; for sums, with weights that share the light."""
    for model in _shapes(name):
        assert _albedo(model, np.deg2rad(theta)) < 1 + QUADRATURE


@pytest.mark.parametrize("masking", MASKINGS)
@pytest.mark.parametrize("name", ["ggx-schlick", "beckmann-schlick"])
def test_no_masking_reflects_more_than_it_receives(name: str, masking: str) -> None:
    """Nearly white facets; V cavities are the tightest."""
    for theta in (0.0, 60.0, 85.0):
        for alpha in (0.1, 0.4, 1.0):
            model = fm.model(name, f0=0.999, alpha=alpha, masking=masking)
            assert 0.3 < _albedo(model, np.deg2rad(theta)) < 1 + QUADRATURE


@pytest.mark.parametrize("name", BROKEN)
def test_declared_models_reflect_more_than_they_receive(name: str) -> None:
    values, by_hand = BROKEN[name]
    albedo = _albedo(fm.model(name, **values), 0.0)
    assert albedo > 1 + 10 * QUADRATURE
    assert albedo == pytest.approx(by_hand, rel=QUADRATURE)


@NAMES
def test_finite_value_and_gradient_at_every_bound(name: str, singular: Pairs) -> None:
    """In all parameters, and in both directions (a tilted mount moves them)."""
    wi, wo = (jnp.array(column) for column in zip(*singular.values(), strict=True))
    for model in _corners(fm.model(name)):
        for numbers in (fm.evaluate(model, wi, wo), *_slopes(model, wi, wo)):
            bad = [
                where for where, row in zip(singular, np.asarray(numbers), strict=True) if not np.isfinite(row).all()
            ]
            assert not bad, (bad, vector(model))


@NAMES
def test_compiled_mapped_and_plain_agree(name: str, hemisphere: Callable[[int, int], np.ndarray]) -> None:
    model = fm.model(name)
    wi, wo = jnp.array(hemisphere(3, 20)), jnp.array(hemisphere(3, 21))
    plain = np.array([np.atleast_1d(model(a, b)) for a, b in zip(wi, wo, strict=True)])
    np.testing.assert_allclose(evaluate_pairs(model, wi, wo), plain, rtol=EXACT)
    np.testing.assert_allclose(fm.evaluate(model, wi, wo), plain, rtol=EXACT)


@NAMES
def test_parameters_round_trip(name: str) -> None:
    """`vector` and `with_vector` are inverse, and the leaves of a model are its parameters, no more."""
    model = fm.model(name, channels=3)
    values = vector(model)
    other = with_vector(model, values * 0.5)
    np.testing.assert_array_equal(vector(other), values * 0.5)
    assert eqx.tree_equal(with_vector(other, values), model)
    leaves, structure = jax.tree.flatten(model)
    assert sum(leaf.size for leaf in leaves) == sum(entry.size for entry in entries(model)) == len(values)
    assert eqx.tree_equal(jax.tree.unflatten(structure, leaves), model)
