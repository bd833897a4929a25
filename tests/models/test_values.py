"""One door for values: the model's own, whatever the number of draws and directions, by one program a model."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
import pytest

import fitmat as fm
from fitmat.maths import program_files
from fitmat.measurements.instrument import Instrument
from fitmat.models import values as door
from fitmat.models.around.instrument import Seen
from fitmat.models.around.noise import Noisy
from fitmat.models.base import AbstractBRDF, evaluate
from fitmat.models.parameters import vector, with_vector
from fitmat.models.values import LARGE, SMALL, blocks, surfaces, values, widths

ROUNDING = 1e-12
"""Relative; two programs of one formula."""

SIZES = {
    "one": (1, 1),
    "less than a block": (3, 5),
    "more than a small block": (SMALL[0] + 1, SMALL[1] + 1),
    "half a large block": (LARGE[0] // 2, LARGE[1] // 2),
    "more than a large block": (LARGE[0] + 1, LARGE[1] + 3),
}


def near(model: AbstractBRDF, count: int) -> np.ndarray:
    """So many vectors, each with other parameters."""
    return vector(model) * np.linspace(0.9, 1.0, count)[:, None]


@pytest.mark.parametrize("size", SIZES)
def test_values_are_those_of_every_draw(size: str, hemisphere: Callable[[int, int], np.ndarray]) -> None:
    """Also of the last draw and the last direction, which no block is filled up with."""
    (count, directions), model = SIZES[size], fm.model("lambert+ggx", channels=2, kd=np.array([0.2, 0.4]))
    draws, wi, wo = near(model, count), hemisphere(directions, 1), hemisphere(directions, 2)
    found = values(model, draws, wi, wo)
    assert found.shape == (count, directions, 2)
    for k in {0, count // 2, count - 1}:
        expected = evaluate(with_vector(model, jnp.asarray(draws[k])), wi, wo)
        np.testing.assert_allclose(found[k], expected, rtol=ROUNDING)


def test_no_count_and_no_parameter_needs_another_program(
    monkeypatch: pytest.MonkeyPatch, hemisphere: Callable[[int, int], np.ndarray]
) -> None:
    """A model is traced once for each of the two blocks, where no earlier process kept a program of it."""
    traced = []
    monkeypatch.setattr(program_files, "folder", lambda: None)
    door._block.clear()
    monkeypatch.setattr(door, "with_vector", lambda model, draw: traced.append(1) or with_vector(model, draw))
    for kd, count, directions in ((0.123, 2, 7), (0.4, 40, 1500), (0.2, 1, 3)):
        model = fm.model("tilt-over-lambert+phong", kd=kd)
        values(model, near(model, count), hemisphere(directions, 1), hemisphere(directions, 2))
        widths(model, near(model, count))
    first = len(traced)
    model = fm.model("tilt-over-lambert+phong", kd=0.3)
    values(model, near(model, 5), hemisphere(9, 1), hemisphere(9, 2))
    assert 0 < first <= 2  # one for the shape of what comes out, one for the program
    assert len(traced) == first


def test_blocks_are_the_values_of_every_set(hemisphere: Callable[[int, int], np.ndarray]) -> None:
    """Sets of 5,000 directions, one light each: three go into a large block, and 17 draws into two."""
    one, other = fm.model("lambert+ggx"), fm.model("lambert+phong")
    parts = [(one, near(one, 17)), (other, near(other, 17))]
    pairs = [(hemisphere(1, k)[0], hemisphere(5000, k)) for k in range(4)]
    found = np.full((2, 17, 4, 5000, 1), np.nan)
    for rows, place, both in blocks(parts, pairs):
        for k, f in enumerate(both):
            found[k, rows, place] = f
    for k, (model, draws) in enumerate(parts):
        for place, (wi, wo) in enumerate(pairs):
            expected = values(model, draws, np.tile(wi, (5000, 1)), wo)
            np.testing.assert_allclose(found[k, :, place], expected, rtol=ROUNDING)


def test_widths_are_those_of_every_draw() -> None:
    model = fm.model("lambert+blinn-phong", exponent=50.0)
    draws = near(model, 40)
    np.testing.assert_allclose(widths(model, draws), np.sqrt(2.0 / (draws[:, 2] + 2.0)), rtol=ROUNDING)


def test_surfaces_leave_mount_instrument_and_noise_behind() -> None:
    """In this vector the surface's own parameters come first, as `surface` says when it is asked."""
    base = fm.model("lambert+ggx", kd=0.3, alpha=0.2)
    model = Noisy(Seen(fm.model("tilt-over-lambert+ggx", kd=0.3, alpha=0.2), Instrument(), scale=jnp.asarray(1.1)))
    bare, draws = surfaces(model, near(model, 3))
    assert bare.name == base.name
    np.testing.assert_array_equal(draws, near(base, 3))
