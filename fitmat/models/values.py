"""Values: a model at many parameter vectors and many pairs of directions, by programs that all callers share.

It knows no measurement and no draw's meaning; what is done with the values is NumPy's.
"""

from collections.abc import Iterator, Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from fitmat._types import Samples
from fitmat.maths.mapping import mapped
from fitmat.maths.parts import slices
from fitmat.maths.programs import program_run_often
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF, evaluate_pairs
from fitmat.models.parameters import vector, with_vector

SMALL, LARGE = (32, 1024), (16, 12288)
"""Draws and directions of the two blocks that are compiled; the large one where its directions are filled by half.

What a match asks for, hemispheres of 48 and 24 nodes and the sky over a sphere, fills the large one to nine tenths and
more. A block takes 0.01–0.02 µs a value and 0.2 ms; a coat takes 0.2–1 ms a draw besides, however many directions
follow. Draws that fill up a block cost nothing.
"""

HELD = 2_000_000
"""Values of a model that `blocks` holds at a time."""


Draws = tuple[AbstractBRDF, Float[np.ndarray, "d p"]]
"""A model and parameter vectors of it."""


def values(
    model: AbstractBRDF,
    draws: Float[np.ndarray, "d p"],
    wi: Float[np.ndarray, "n 3"],
    wo: Float[np.ndarray, "n 3"],
) -> Float[np.ndarray, "d n c"]:
    """BRDF values in sr⁻¹ (no cosine) of every draw at every pair of directions.

    Args:
        model: Its shapes and static choices; its own parameter values do not count.
        draws: Parameter vectors as `parameters.vector` has them, physical units.
        wi: Unit vectors to the light.
        wo: Unit vectors to the sensor.

    Example:
        >>> import fitmat as fm, numpy as np
        >>> up = np.array([[0.0, 0.0, 1.0]])
        >>> values(fm.model("lambert"), np.array([[np.pi / 4], [np.pi / 2]]), up, up).ravel()
        array([0.25, 0.5 ])
    """
    most = LARGE if len(wi) >= LARGE[1] // 2 else SMALL
    found = None
    for places in slices(len(wi), most[1]):
        light, sensor = (_filled(w[places], most[1]) for w in (wi, wo))
        for rows in slices(len(draws), most[0]):
            block, _ = _block(model, _filled(draws[rows], most[0]), light, sensor, np.array(rows.stop - rows.start))
            if found is None:
                found = np.empty((len(draws), len(wi), block.shape[2]))
            found[rows, places] = np.asarray(block)[: rows.stop - rows.start, : places.stop - places.start]
    assert found is not None
    return found


def at(model: AbstractBRDF, wi: Float[np.ndarray, "n 3"], wo: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n c"]:
    """`values` at the model's own parameters."""
    return values(model, vector(model)[None], wi, wo)[0]


def blocks(
    parts: Sequence[Draws], pairs: Sequence[tuple[np.ndarray, np.ndarray]]
) -> Iterator[tuple[slice, int, list[np.ndarray]]]:
    """Values of several models at many sets of directions, a few at a time, so that nobody need hold them all.

    Args:
        parts: Models with their draws, as many of each.
        pairs: Sets of m unit vectors to the light and to the sensor, (m, 3), or (3,) where one serves all.

    Yields:
        Which draws, the place of the set, and the values of every model, (draws, m, c).
    """
    count = max(len(np.atleast_2d(w)) for w in pairs[0])
    for some in slices(len(pairs), max(1, LARGE[1] // count)):
        wi, wo = (np.concatenate([np.broadcast_to(pair[k], (count, 3)) for pair in pairs[some]]) for k in range(2))
        for rows in slices(len(parts[0][1]), max(LARGE[0], HELD // len(wi))):
            found = [values(model, draws[rows], wi, wo) for model, draws in parts]
            for k in range(some.stop - some.start):
                yield rows, some.start + k, [f[:, k * count : (k + 1) * count] for f in found]


def channel_mean(f: np.ndarray) -> np.ndarray:
    """Mean over the last axis, which takes as long as all else where it is of one channel and not seen to be."""
    return f[..., 0] if f.shape[-1] == 1 else f.mean(axis=-1)


def widths(model: AbstractBRDF, draws: Float[np.ndarray, "d p"]) -> Float[np.ndarray, " d"]:
    """Slope-like width of the narrowest lobe of every draw, as `AbstractBRDF.width`; by the program of `values`."""
    up = np.tile([0.0, 0.0, 1.0], (SMALL[1], 1))
    found = []
    for rows in slices(len(draws), SMALL[0]):
        count = rows.stop - rows.start
        found.append(np.asarray(_block(model, _filled(draws[rows], SMALL[0]), up, up, np.array(count))[1])[:count])
    return np.concatenate(found)


def surfaces(model: AbstractBRDF, draws: Float[np.ndarray, "d p"]) -> Draws:
    """The material without what instrument and mount do, and its part of every draw; see `instrument.surface`."""
    places = vector(surface(with_vector(model, np.arange(draws.shape[1]))))
    return surface(model), draws[:, places]


def _filled(part: np.ndarray, count: int) -> np.ndarray:
    """So many rows, the last one repeated."""
    filled = np.empty((count, part.shape[1]))
    filled[: len(part)], filled[len(part) :] = part, part[-1:]
    return filled


@program_run_often
def _block(
    template: AbstractBRDF, draws: ArrayLike, wi: ArrayLike, wo: ArrayLike, count: ArrayLike
) -> tuple[Float[Array, "D N c"], Float[Array, " D"]]:
    """Values and widths of the first `count` draws."""
    every, light, sensor = (jnp.asarray(part) for part in (draws, wi, wo))

    def one(draw: Array) -> tuple[Samples, Array]:
        model = with_vector(template, draw)
        return evaluate_pairs(model, light, sensor), model.width()

    return mapped(one, every, count)
