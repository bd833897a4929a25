"""Parameters: names, order, bounds, and what is refused."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import ModelError
from fitmat.models.laws import examples
from fitmat.models.parameters import (
    as_parameter,
    assignments,
    check_range,
    entries,
    param,
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


@pytest.mark.parametrize("name", [*(examples(lobe)[0] for lobe in LOBES), "lambert+ggx"])
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


def test_what_goes_in_as_numpy_comes_out_as_numpy() -> None:
    """Outside of programs no array is moved to JAX; inside, none is taken from it."""
    model = fm.model("lambert+ggx", channels=2, kd=np.array([0.1, 0.2]))
    values = vector(model)
    assert isinstance(values, np.ndarray)
    moved = with_vector(model, 2.0 * values)
    assert isinstance(vector(moved), np.ndarray)
    np.testing.assert_array_equal(vector(moved), 2.0 * values)
    traced = vector(with_vector(model, jnp.asarray(values)))
    assert isinstance(traced, jax.Array)
    np.testing.assert_array_equal(traced, values)


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


def test_a_parameter_is_given_once() -> None:
    with pytest.raises(ModelError, match=r"--fix kd is given twice, expected one value of it\. Leave one out"):
        assignments(["kd=0.5", "ks=1", "kd = 0.4"], "--fix")
