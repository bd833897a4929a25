"""Symmetries: other values of a model's parameters that are the same surface, and the nearest of them.

Axes that a quarter turn exchanges, and whole periods; two alike lobes in one model are refused where it is built.
"""

from collections.abc import Iterator
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Float

from fitmat.fitting.coordinates import Coordinates
from fitmat.models.base import AbstractBRDF, AbstractShape
from fitmat.models.parameters import vector, with_vector

QUARTER = 90.0
"""Degrees by which a rotation turns when its axes are exchanged."""

SAME = 1e-4
"""Of what a parameter can differ by: nearer vectors are one."""


def nearest(best: AbstractBRDF, others: Float[np.ndarray, "m p"], moved: Coordinates) -> Float[np.ndarray, "m p"]:
    """Of all vectors that are the same surfaces as the others, those nearest to the best; none that is the best itself.

    Args:
        best: Gives the structure, and what is held.
        others: Physical parameter vectors.
        moved: The parameters that are fitted; what is held is not exchanged.
    """
    centre, free = np.asarray(vector(best)), set(moved.places)
    found = moved.near(others, centre)
    for first, second, turned in _exchanges(best):
        if not {first, second, turned} <= free:
            continue
        other = np.array(found)
        other[:, [first, second]] = found[:, [second, first]]
        other[:, turned] += QUARTER
        other = moved.near(other, centre)
        closer = _distance(other, centre, moved) < _distance(found, centre, moved)
        found = np.where(closer[:, None], other, found)
    return found[_distance(found, centre, moved) > SAME**2]


def _exchanges(model: eqx.Module) -> list[tuple[int, int, int]]:
    """Places of two axes and of their rotation, for each shape that has them."""
    places = with_vector(model, np.arange(len(np.asarray(vector(model)))))
    fields = [(vars(shape), (*shape.exchanged, "rotation")) for shape in _shapes(places) if shape.exchanged]
    return [(int(part[a]), int(part[b]), int(part[turned])) for part, (a, b, turned) in fields]


def _shapes(part: Any) -> Iterator[AbstractShape]:
    if isinstance(part, AbstractShape):
        yield part
    inner = part if isinstance(part, tuple) else vars(part).values() if isinstance(part, eqx.Module) else ()
    for one in inner:
        yield from _shapes(one)


def _distance(values: np.ndarray, centre: np.ndarray, moved: Coordinates) -> Float[np.ndarray, " m"]:
    return np.sum(((moved.natural(values) - moved.natural(centre)) / moved.extent) ** 2, axis=1)
