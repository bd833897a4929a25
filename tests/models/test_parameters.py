"""Parameters: names, order, bounds, and the change of variables that keeps a fit inside them."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fitmat as fm
from fitmat.errors import ModelError
from fitmat.models.laws import example
from fitmat.models.parameters import (
    AT_BOUND,
    EDGE,
    as_parameter,
    check_range,
    entries,
    param,
    space,
    vector,
    with_vector,
)
from fitmat.models.registry import LOBES

ROUNDING = 1e-12
"""Relative; log, sine and their inverses lose some digits of 1e-16 near a bound, where the sine is flat."""


class Toy(eqx.Module):
    """One linear parameter per channel and one logarithmic."""

    weight: Any = param(0.0, 2.0, symbol="w", doc="a weight", per_channel=True, weight=True, default=0.5)
    width: Any = param(1e-3, 10.0, symbol="s", doc="a width", unit="mm", scale="log", default=1.0)


def test_entries_name_and_place_every_number() -> None:
    weight, width = entries(Toy(weight=[0.1, 0.2, 0.3]))
    assert (weight.name, weight.place, weight.shape, weight.size) == ("weight", slice(0, 3), (3,), 3)
    assert (width.name, width.place, width.shape, width.size) == ("width", slice(3, 4), (), 1)
    assert (width.param.symbol, width.param.unit, width.param.scale) == ("s", "mm", "log")


def test_shared_names_carry_their_lobe() -> None:
    names = [entry.name for entry in entries(fm.model("phong+ggx"))]
    assert names == ["phong.ks", "exponent", "ggx.ks", "alpha", "eta"]
    names = [entry.name for entry in entries(fm.model("lambert+ggx-schlick+beckmann-schlick"))]
    assert names[0] == "kd"
    assert names[1:4] == ["ggx-schlick.ks", "ggx-schlick.alpha", "ggx-schlick.f0"]
    assert names[4:] == ["beckmann-schlick.ks", "beckmann-schlick.alpha", "beckmann-schlick.f0"]


def _holders(module: Any) -> list[Any]:
    """The module and all modules in it."""
    values = [getattr(module, field.name) for field in dataclasses.fields(module)]
    inner = [part for value in values for part in (value if isinstance(value, tuple) else (value,))]
    return [module, *(found for part in inner if isinstance(part, eqx.Module) for found in _holders(part))]


@pytest.mark.parametrize("name", [*(example(lobe) for lobe in LOBES), "lambert+ggx"])
def test_every_entry_points_at_its_own_number(name: str) -> None:
    """Names and vector come from two walks over the model; they must agree on the order."""
    built = fm.model(name, channels=2)
    values = np.arange(1.0, 1 + len(vector(built)))
    numbered = with_vector(built, jnp.array(values))
    for entry in entries(numbered):
        (holder,) = (part for part in _holders(numbered) if hasattr(part, entry.name))
        np.testing.assert_array_equal(np.ravel(getattr(holder, entry.name)), values[entry.place])


def test_vector_round_trip() -> None:
    toy = Toy(weight=[0.1, 0.2], width=3.0)
    np.testing.assert_array_equal(vector(toy), [0.1, 0.2, 3.0])
    moved = with_vector(toy, jnp.array([1.0, 1.5, 2.0]))
    np.testing.assert_array_equal(moved.weight, [1.0, 1.5])
    assert moved.width == 2.0


@given(st.floats(0.001, 0.999), st.floats(0.001, 0.999))
def test_coordinates_round_trip(linear: float, log: float) -> None:
    coordinates = space(Toy())
    values = jnp.array([2 * linear, 1e-3 * 1e4**log])
    natural = coordinates.natural(values)
    np.testing.assert_allclose(natural, [2 * linear, np.log(1e-3) + log * np.log(1e4)], rtol=ROUNDING, atol=ROUNDING)
    np.testing.assert_allclose(coordinates.physical(natural), values, rtol=ROUNDING)
    np.testing.assert_allclose(coordinates.from_free(coordinates.to_free(values)), values, rtol=ROUNDING)


def test_middle_of_the_range_is_the_origin() -> None:
    """Half of a linear range, the geometric mean of a logarithmic one (sin 0 = 0)."""
    np.testing.assert_allclose(space(Toy()).from_free(jnp.zeros(2)), [1.0, 0.1], rtol=ROUNDING)


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=2))
def test_any_free_value_is_within_the_bounds(free: list[float]) -> None:
    """MINUIT's promise; 1e-12 because exp(log(bound)) may round past the bound."""
    coordinates = space(Toy())
    values = np.asarray(coordinates.from_free(jnp.array(free)))
    assert np.all(values >= coordinates.lower * (1 - ROUNDING))
    assert np.all(values <= coordinates.upper * (1 + ROUNDING))


@pytest.mark.parametrize("values", [[0.0, 1e-3], [2.0, 10.0], [-5.0, 1e-9], [7.0, 1e9]])
def test_starts_on_or_outside_a_bound_are_nudged_inside(values: list[float]) -> None:
    """By 1 − cos(EDGE) of half the range; there the slope of the sine is EDGE, so a solver can move away."""
    coordinates = space(Toy())
    free = coordinates.to_free(jnp.array(values))
    slope = jax.jacfwd(coordinates.from_free)(free)
    inside = np.asarray(coordinates.from_free(free))
    assert np.all((inside > coordinates.lower) & (inside < coordinates.upper))
    np.testing.assert_allclose(np.abs(free), np.pi / 2 - EDGE, rtol=1e-6)
    np.testing.assert_allclose(np.diag(slope)[0], EDGE, rtol=1e-5)


def test_at_bound_tells_lower_from_upper() -> None:
    coordinates = space(Toy())
    assert coordinates.at_bound(np.array([0.0, 10.0])).tolist() == [-1, 1]
    assert coordinates.at_bound(np.array([2.0, 1e-3])).tolist() == [1, -1]
    near, far = 2 * 0.5 * AT_BOUND, 2 * 2 * AT_BOUND
    assert coordinates.at_bound(np.array([near, 1.0])).tolist() == [-1, 0]
    assert coordinates.at_bound(np.array([far, 1.0])).tolist() == [0, 0]


@pytest.mark.parametrize(
    ("toy", "message"),
    [
        (Toy(weight=[0.5, 2.5]), r"parameter weight = 2\.5: expected a value from 0 to 2\."),
        (Toy(width=0.0), r"parameter width = 0: expected a value from 0\.001 to 10\."),
        (Toy(width=np.nan), r"parameter width = nan: expected a value from 0\.001 to 10\."),
    ],
)
def test_values_out_of_range_are_refused(toy: Toy, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        check_range(toy)


def test_bounds_belong_to_the_range() -> None:
    check_range(Toy(weight=[0.0, 2.0], width=10.0))


@pytest.mark.parametrize("value", [None, "0.5", b"1", True])
def test_values_that_are_no_numbers_are_refused(value: object) -> None:
    with pytest.raises(ModelError, match=r"parameter value .*: expected a number or one number per channel"):
        as_parameter(value)
