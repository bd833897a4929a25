"""Coordinates: names with channels, the change of variables that keeps a fit inside its bounds, points and draws."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

import fitmat as fm
from fitmat.fitting.coordinates import AT_BOUND, EDGE, Coordinates, coordinates
from fitmat.maths.least_squares import least_squares
from fitmat.models.parameters import param, vector

ROUNDING = 1e-12
"""Relative; log, sine and their inverses lose some digits of 1e-16 near a bound, where the sine is flat."""

BASE = jnp.zeros(2)


class Toy(eqx.Module):
    """One linear parameter and one logarithmic."""

    weight: Any = param(0.0, 2.0, symbol="w", doc="a weight", per_channel=True, weight=True, default=0.5)
    width: Any = param(1e-3, 10.0, symbol="s", doc="a width", unit="mm", scale="log", default=1.0)


TOY = coordinates(Toy())


def test_names_carry_their_channel_where_there_are_several() -> None:
    model = fm.model("lambert+ggx", channels=3)
    every = coordinates(model, channels=("r", "g", "b"))
    assert every.names == ("kd r", "kd g", "kd b", "ks r", "ks g", "ks b", "alpha", "eta")
    some = coordinates(model, {"ks": 1.0, "eta": 1.5}, ("r", "g", "b"))
    assert some.names == ("kd r", "kd g", "kd b", "alpha")
    assert some.places == (0, 1, 2, 6)
    assert coordinates(fm.model("lambert+ggx"), channels=("value",)).names == ("kd", "ks", "alpha", "eta")


def test_models_of_one_shape_share_a_program() -> None:
    """Names and values do not count, shapes and what is held do."""
    one, other = fm.model("lambert+ggx", kd=0.1), fm.model("lambert+ggx", kd=0.2)
    assert coordinates(one, channels=("a",)) == coordinates(other, channels=("b",))
    assert hash(coordinates(one)) == hash(coordinates(other))
    assert coordinates(one) != coordinates(one, {"kd": 0.1})


@given(st.floats(0.001, 0.999), st.floats(0.001, 0.999))
def test_coordinates_round_trip(linear: float, log: float) -> None:
    values = jnp.array([2 * linear, 1e-3 * 1e4**log])
    natural = TOY.natural(values)
    np.testing.assert_allclose(natural, [2 * linear, np.log(1e-3) + log * np.log(1e4)], rtol=ROUNDING, atol=ROUNDING)
    np.testing.assert_allclose(TOY.physical(natural), values, rtol=ROUNDING)
    np.testing.assert_allclose(TOY.from_unbounded(BASE, TOY.unbounded(values)), values, rtol=ROUNDING)


def test_draws_are_filled_as_points_are_in_either_library() -> None:
    model = fm.model("lambert+ggx", kd=0.3, ks=0.7, alpha=0.2, eta=1.4)
    some, base = coordinates(model, {"ks": 0.7}), np.asarray(vector(model))
    natural = np.array([[0.1, np.log(0.05), np.log(1.3)], [0.2, np.log(0.5), np.log(2.0)]])
    expected = [[0.1, 0.7, 0.05, 1.3], [0.2, 0.7, 0.5, 2.0]]
    np.testing.assert_allclose(some.filled(base, natural), expected, rtol=ROUNDING)
    np.testing.assert_allclose(some.filled(base, natural[0]), expected[0], rtol=ROUNDING)
    np.testing.assert_allclose(some.filled(jnp.asarray(base), jnp.asarray(natural)), expected, rtol=ROUNDING)
    np.testing.assert_allclose(some.natural(np.array(expected)), natural, rtol=ROUNDING)
    np.testing.assert_allclose(some.slope(np.array(expected)), [[1, 0.05, 1.3], [1, 0.5, 2.0]], rtol=ROUNDING)
    assert base.tolist() == [0.3, 0.7, 0.2, 1.4]


def test_weights_are_scaled_and_come_back() -> None:
    """x = g w, ln g itself and what stands behind stay; by hand."""
    some = Coordinates((0, 1, 2), (0.0,) * 3, (1.0,) * 3, (False, False, True), weights=(0, 1), scale=2)
    t = np.array([[0.3, 0.5, np.log(2.0), 7.0], [0.1, 0.2, 0.0, 8.0]])
    expected = [[0.6, 1.0, np.log(2.0), 7.0], [0.1, 0.2, 0.0, 8.0]]
    np.testing.assert_allclose(some.scaled(t), expected, rtol=ROUNDING)
    np.testing.assert_allclose(some.unscaled(np.array(expected)), t, rtol=ROUNDING)
    np.testing.assert_allclose(some.unscaled(jnp.array(expected[0])), t[0], rtol=ROUNDING)


def test_middle_of_the_range_is_the_origin() -> None:
    """Half of a linear range, the geometric mean of a logarithmic one (sin 0 = 0)."""
    np.testing.assert_allclose(TOY.from_unbounded(BASE, jnp.zeros(2)), [1.0, 0.1], rtol=ROUNDING)


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=2))
def test_any_unbounded_value_is_within_the_bounds(unbounded: list[float]) -> None:
    """MINUIT's promise; 1e-12 because exp(log(bound)) may round past the bound."""
    values = np.asarray(TOY.from_unbounded(BASE, jnp.array(unbounded)))
    assert np.all(values >= np.array(TOY.lower) * (1 - ROUNDING))
    assert np.all(values <= np.array(TOY.upper) * (1 + ROUNDING))


@pytest.mark.parametrize("values", [[0.0, 1e-3], [2.0, 10.0], [-5.0, 1e-9], [7.0, 1e9]])
def test_starts_on_or_outside_a_bound_are_nudged_inside(values: list[float]) -> None:
    """By 1 − cos(EDGE) of half the range; there the slope of the sine is EDGE, so a solver can move away."""
    unbounded = TOY.unbounded(jnp.array(values))
    slope = jax.jacfwd(lambda u: TOY.from_unbounded(BASE, u))(unbounded)
    inside = np.asarray(TOY.from_unbounded(BASE, unbounded))
    assert np.all((inside > TOY.lower) & (inside < TOY.upper))
    np.testing.assert_allclose(np.abs(unbounded), np.pi / 2 - EDGE, rtol=1e-6)
    np.testing.assert_allclose(np.diag(slope)[0], EDGE, rtol=1e-5)


def test_sides_tell_lower_from_upper() -> None:
    assert TOY.side(np.array([0.0, 10.0])).tolist() == [-1, 1]
    assert TOY.side(np.array([2.0, 1e-3])).tolist() == [1, -1]
    near, far = 2 * 0.5 * AT_BOUND, 2 * 2 * AT_BOUND
    assert TOY.side(np.array([near, 1.0])).tolist() == [-1, 0]
    assert TOY.side(np.array([far, 1.0])).tolist() == [0, 0]


@pytest.mark.parametrize("first", [0.1, 0.5, 0.9])
def test_a_solver_slides_along_a_bound(first: float) -> None:
    """To SciPy's bounded minimum of linear residuals, from a start on the bound beyond which the free minimum lies."""
    columns = np.random.default_rng(4).normal(size=(200, 2)) @ np.array([[1.0, 0.9], [0.0, 0.3]])
    target = columns @ np.array([0.2, 3.0]) + np.random.default_rng(5).normal(size=200)
    box = Coordinates((0, 1), (0.0, 0.0), (4.0, 1.0), (False, False))
    begin = box.unbounded(np.array([4.0 * first, 1.0]))

    def residual(u: jax.Array, _: None) -> tuple[jax.Array, None]:
        return jnp.asarray(columns) @ box.from_unbounded(BASE, u) - target, None

    end = least_squares(residual, jnp.asarray(begin), bend=box.bend)
    expected = lsq_linear(columns, target, ([0, 0], [4, 1]), method="bvls")
    assert end.solved
    assert int(end.steps) < 20
    np.testing.assert_allclose(box.from_unbounded(BASE, end.x), expected.x, rtol=1e-6)  # 1e-8 of steps, with room
    assert expected.active_mask.tolist() == [0, 1]
