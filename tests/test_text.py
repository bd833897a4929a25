"""What a prompt shows of a result: what it is and its numbers, never the arrays behind them."""

import dataclasses
import importlib
import pkgutil
from typing import Any

import numpy as np
import pytest

import fitmat
import fitmat as fm
from fitmat.text import MOST_ROWS, MOST_SHOWN, brief, html_table

LIMIT = 2000
"""Characters; a screen holds as many."""


@dataclasses.dataclass(frozen=True, eq=False)
class Curve:
    """A result without words of its own."""

    name: str
    values: np.ndarray
    limits: np.ndarray
    parts: tuple[str, ...]
    __repr__ = brief


def test_arrays_are_shown_by_their_shape_and_few_numbers_as_they_are() -> None:
    shown = repr(Curve("kd", np.zeros((5, 3)), np.array([0.123456, 2.0]), ("a", "b")))
    assert shown == "Curve(name='kd', values=array (5, 3), limits=[0.1235, 2], parts=('a', 'b'))"


def test_what_is_long_is_cut() -> None:
    many = Curve("x" * 500, np.zeros(9), np.zeros(9), tuple("abcdefgh"))
    assert (
        repr(many)
        == f"Curve(name='{'x' * 59}…', values=array (9,), limits=array (9,), parts=('a', 'b', 'c', … 8 in all))"
    )


def noted(count: int) -> fm.Measurements:
    """Many channels, and notes of many words."""
    m = fm.from_arrays(0.5, [0.1, 0.2], np.ones((2, count)))
    return dataclasses.replace(m, notes=("A long note. " * 20,) * count)


def test_measurements_of_many_channels_stay_short() -> None:
    shown = repr(noted(200))
    assert shown.startswith("Measurements: array: 2 samples, channels 1, 2, 3, …, 200 (200)\nincidence 28.6°;")
    assert shown.endswith(" … (print it for all)")
    assert len(shown) <= LIMIT
    assert "channels 1, 2\n" in str(noted(2))


def test_a_notebook_shows_the_first_rows() -> None:
    shown = html_table("Parameters.", ("name", "value"), [("kd", str(k)) for k in range(500)])
    assert shown.count("<tr>") == 1 + MOST_ROWS
    assert f"The first {MOST_ROWS} of 500 rows; print it for all." in shown


def classes() -> list[type]:
    """Every frozen class of the package that holds arrays, for which reason it is compared by identity."""
    found: dict[type, None] = {}
    for module in pkgutil.walk_packages(fitmat.__path__, "fitmat."):
        if not module.name.endswith("__main__"):
            for one in vars(importlib.import_module(module.name)).values():
                if isinstance(one, type) and dataclasses.is_dataclass(one) and one.__module__.startswith("fitmat."):
                    found[one] = None
    by_identity = [one for one in found if one.__eq__ is object.__eq__]
    return [one for one in by_identity if not hasattr(one, "__jax_array__")]


@pytest.mark.parametrize("one", classes(), ids=lambda one: one.__name__)
def test_no_result_pours_out_its_arrays(one: Any) -> None:
    assert one.__repr__ is brief
    assert MOST_SHOWN < LIMIT
