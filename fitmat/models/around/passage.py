"""What a dielectric face lets into the coat and sends back to the base, as shares between the nodes of `nodes`.

A smooth face by Fresnel's equations, a rough one by a table made of photons (`benchmarks/faces.py`).
"""

import functools
from pathlib import Path
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat._types import Scalar
from fitmat.models.around.nodes import KEPT, LEAVING, cosines
from fitmat.models.terms.fresnel import dielectric

FILE = Path(__file__).with_name("faces.npz")
"""A `Passage` less that of the smooth face, and `again`, at `ALPHAS` × `ETAS`; standard errors below 0.002."""

ALPHAS = (0.001, 0.003, 0.01, 0.03, 0.06, 0.1, 0.17, 0.3, 0.5, 0.75, 1.0)
ETAS = (1.03, 1.1, 1.2, 1.35, 1.5, 1.7, 2.0, 2.4, 3.0)


class Passage(NamedTuple):
    """Where light goes at the face, no absorption counted; a row for each cosine from where it comes.

    Attributes:
        entering: Of what enters from the outer nodes: shares of the inner ones, (`LEAVING`, n); their sum is 1.
        returning: Of what comes from the inner nodes: shares that go down again, (n, n); the rest leaves.
    """

    entering: Float[Any, "k n"]
    returning: Float[Any, "n n"]


def smooth_passage(eta: Scalar) -> Passage:
    """Refracted to one direction, and mirrored to one; totally below the critical angle."""
    outer, _ = cosines(eta)
    back = jnp.where(outer > 0.0, dielectric(jnp.where(outer > 0.0, outer, 1.0), eta), 1.0)
    return Passage(jnp.eye(LEAVING, LEAVING + KEPT), jnp.diag(back))


def rough_passage(eta: Scalar, alpha: Scalar) -> Passage:
    """The smooth face's, and what is different under GGX facets: a cubic spline in ln η and √α.

    Every order of scattering at the facets (Heitz et al. 2016). The difference is 0 at alpha 0 and at eta 1.
    """
    weights, table = _weights(eta, alpha), _table()
    smooth = smooth_passage(eta)._asdict()
    return Passage(**{name: jnp.tensordot(weights, table[name], 2) + part for name, part in smooth.items()})


def rough_again(eta: Scalar, alpha: Scalar) -> Float[Array, " k"]:
    """Of all light from `nodes.again_cosines` what facets reflect more than once until it is outside."""
    return jnp.tensordot(_weights(eta, alpha), _table()["again"], 2)


def _weights(eta: Scalar, alpha: Scalar) -> Float[Array, "a e"]:
    return jnp.outer(spline(jnp.sqrt(alpha), ROUGHNESS)[1:], spline(jnp.log(eta), INDEX)[1:])


@functools.cache
def _table() -> dict[str, np.ndarray]:
    with np.load(FILE) as file:
        return {name: file[name] for name in file.files}


class Knots(NamedTuple):
    """Of a natural cubic spline.

    Attributes:
        at: Where, ascending, (k,).
        curvature: Values there to second derivatives there, (k, k).
    """

    at: np.ndarray
    curvature: np.ndarray


def knots(at: np.ndarray) -> Knots:
    """The second derivatives are 0 at both ends (C. de Boor, A Practical Guide to Splines, 1978, ch. IV)."""
    count, step = len(at), np.diff(at)
    left, right = np.eye(count), np.zeros((count, count))
    for k in range(1, count - 1):
        before, after = step[k - 1], step[k]
        left[k, k - 1 : k + 2] = before / 6.0, (before + after) / 3.0, after / 6.0
        right[k, k - 1 : k + 2] = 1.0 / before, -1.0 / before - 1.0 / after, 1.0 / after
    return Knots(at, np.linalg.solve(left, right))


def spline(x: Scalar, given: Knots) -> Float[Array, " k"]:
    """Weights of the values at the knots; x is between the ends."""
    at, curvature = jnp.asarray(given.at), jnp.asarray(given.curvature)
    k = jnp.clip(jnp.searchsorted(at, x, side="right") - 1, 0, len(given.at) - 2)
    step = at[k + 1] - at[k]
    b = (x - at[k]) / step
    a, unit = 1.0 - b, jnp.eye(len(given.at))
    bent = (a**3 - a) * curvature[k] + (b**3 - b) * curvature[k + 1]
    return a * unit[k] + b * unit[k + 1] + bent * step**2 / 6.0


ROUGHNESS = knots(np.sqrt(np.array([0.0, *ALPHAS])))
INDEX = knots(np.log(np.array([1.0, *ETAS])))
