"""Channelwise: which parameters count in one channel only, and a model and its parameters on some of the channels.

What it cannot tell apart it leaves whole: a model that mixes channels, as Disney's do by the luminance of a colour.
"""

import functools
from collections.abc import Collection
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from fitmat.fitting.coordinates import Coordinates, coordinates
from fitmat.maths.grams import Layout
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF, evaluate_pairs
from fitmat.models.parameters import entries, of_channels, vector, with_vector
from fitmat.models.values import values

MANY = 6
"""Above this many channels a fit begins with `FEW` of them."""

FEW = 3
"""Evenly spread, and as many as an RGB file has, whose programs serve both."""

PAIRS = 64
"""Directions at which a model shows which channels a parameter counts in."""


def layout(model: AbstractBRDF, moved: Coordinates, channels: int) -> Layout | None:
    """Which of the parameters are of one channel; None where none is, or the channels of the model are not apart.

    Args:
        model: Gives names and shapes.
        moved: The parameters that are fitted.
        channels: Of the data.
    """
    at = {place: k for k, place in enumerate(moved.places)}
    groups = [tuple(at[k] for k in range(e.place.start, e.place.stop)) for e in entries(model) if e.place.start in at]
    own = tuple(group for group in groups if len(group) == channels)
    if channels == 1 or not own or any(len(group) not in (1, channels) for group in groups) or not apart(model):
        return None
    return Layout(tuple(group[0] for group in groups if len(group) == 1), own)


def apart(model: AbstractBRDF) -> bool:
    """Whether the value of each channel depends on the shared parameters and on that channel's own alone.

    Seen at values from the middle of every range: what is changed in one channel, or in all but one, must not change
    a digit of the others.
    """
    bare = surface(model)
    leaves, structure = jax.tree.flatten(bare)
    return _apart(structure, tuple(np.shape(leaf) for leaf in leaves))


@functools.lru_cache(maxsize=256)
def _apart(structure: Any, shapes: tuple[tuple[int, ...], ...]) -> bool:
    bare = jax.tree.unflatten(structure, [np.ones(shape) for shape in shapes])
    rng, every = np.random.default_rng(0), coordinates(bare)
    first = np.array([e.place.start for e in entries(bare) if e.size > 1], int)
    rest = np.array([k for e in entries(bare) if e.size > 1 for k in range(e.place.start + 1, e.place.stop)], int)
    draws = every.physical(every.low + every.span * rng.uniform(0.3, 0.7, (3, every.count)))
    draws[1, np.setdiff1d(np.arange(every.count), first)] = draws[0, np.setdiff1d(np.arange(every.count), first)]
    draws[2, np.setdiff1d(np.arange(every.count), rest)] = draws[0, np.setdiff1d(np.arange(every.count), rest)]
    w = rng.standard_normal((2, PAIRS, 3))
    w[..., 2] = np.abs(w[..., 2])
    found = values(bare, draws, *(w / np.linalg.norm(w, axis=2, keepdims=True)))
    kept = np.isfinite(found).all() and (found[1, :, 1:] == found[0, :, 1:]).all()
    return bool(kept and (found[2, :, :1] == found[0, :, :1]).all())


def divides(model: AbstractBRDF, channels: int) -> bool:
    """Whether a fit of all channels may begin with some: there are many, and the model can be had of some."""
    if channels <= MANY:
        return False
    leaves, structure = jax.tree.flatten(model)
    return _divides(structure, tuple(np.shape(leaf) for leaf in leaves), channels)


@functools.lru_cache(maxsize=256)
def _divides(structure: Any, shapes: tuple[tuple[int, ...], ...], channels: int) -> bool:
    model = jax.tree.unflatten(structure, [np.ones(shape) for shape in shapes])
    up = np.array([[0.0, 0.0, 1.0]])
    try:
        part = Part(model, channels).model
        shape = jax.eval_shape(evaluate_pairs, part, up, up).shape
    except (TypeError, ValueError):  # of JAX, where something of all channels meets something of some
        return False
    return shape == (1, FEW) and apart(model)


class Part:
    """A model of many channels, of `FEW` of them, evenly spread.

    Attributes:
        which: Their positions.
        model: The model of these.
        places: Of its parameters in the vector of all.
    """

    def __init__(self, model: AbstractBRDF, channels: int) -> None:
        self.which = ((np.arange(FEW) + 0.5) * channels / FEW).astype(int)
        self.model = of_channels(model, self.which, channels)
        numbered = with_vector(model, np.arange(len(np.asarray(vector(model)))))
        self.places = np.asarray(vector(of_channels(numbered, self.which, channels)), int)
        self._whole, self._channels = model, channels

    def spread(
        self, vectors: Float[np.ndarray, "m p"], few: Float[np.ndarray, "m q"], free: Collection[int]
    ) -> Float[np.ndarray, "m p"]:
        """Vectors of the whole model with what is free as in the part: linear between its channels, constant beyond.

        Args:
            vectors: Of the whole model.
            few: Of the part.
            free: Places of what is free in the vector of all.
        """
        found = np.array(vectors)
        for whole, mine in zip(entries(self._whole), entries(self.model), strict=True):
            if whole.place.start not in free:
                continue
            known = few[:, mine.place]
            if whole.size > 1:
                known = np.array([np.interp(np.arange(self._channels), self.which, row) for row in known])
            found[:, whole.place] = known
        return found
