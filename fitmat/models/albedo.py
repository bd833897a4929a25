"""Energy: what fraction of the light a surface reflects, from one direction and from all, each with an error bound.

Integrals of a model; it judges nothing.
"""

import dataclasses

import numpy as np
from jaxtyping import ArrayLike, Float

from fitmat import arguments
from fitmat.errors import ModelError
from fitmat.maths.parts import slices
from fitmat.maths.quadrature import AZIMUTH_NODES, ZENITH_NODES, incidence_rule, lobe_rule
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import vector
from fitmat.models.values import LARGE, Draws, blocks, widths
from fitmat.text import brief

COARSER = 5 / 8
"""Nodes of two coarser rules, one in zenith and one in azimuth, over those of the rule that gives the value.

The error of a converging rule is well below its distance from a coarser one.
"""

GOAL = 1e-3
"""What the bound is brought below where nothing else is asked for."""

MOST_NODES = (512, 2048)
"""In zenith, and in azimuth on one side."""

STREAK = 2.0
"""Azimuths on one side times the width for anisotropic models: the streak of a brushed surface is that narrow."""

FEW_AZIMUTHS = 256
"""The most of them that come first where a larger bound than `GOAL` is good enough."""

LEAST = 1e-4
"""What the bound never falls below: two rules may agree by chance."""

AZIMUTHS = 8
"""Azimuths of incidence over half a turn in the hemispherical albedo of anisotropic models."""


@dataclasses.dataclass(frozen=True, eq=False)
class Albedo:
    """Reflected fractions of the light.

    Attributes:
        value: One row per incidence, one column per channel; 1 is all of it.
        error: Bound of the quadrature's error, same shape: twice the distances of two coarser rules from that which
            gave `value`, and `LEAST`.
    """

    value: Float[np.ndarray, "k c"]
    error: Float[np.ndarray, "k c"]

    __repr__ = brief


def albedo(
    model: AbstractBRDF, theta_i: ArrayLike | None = None, phi_i: ArrayLike = 0.0, *, goal: float = GOAL
) -> Albedo:
    """Fraction of the light that the surface reflects: from each direction, ∫ f c_o dω_o, or from all together.

    Args:
        model: From `fitmat.model`.
        theta_i: Zenith angles of incidence in radians, 0 to π/2, (k,); None for light that comes evenly from the whole
            hemisphere, ∫∫ f c_o c_i dω_o dω_i/π, one row.
        phi_i: Azimuths of incidence in radians, (k,) or one; of no consequence for isotropic models.
        goal: Where the bound is larger (relative above 1), the nodes that cause it are doubled until it is not; above
            10⁻³ fewer come first, so that 1 is the quickest answer.

    Returns:
        The albedo with its error bound: at most 10⁻³, where that is the goal, for isotropic lobes, and for anisotropic
        ones down to α = 10⁻³.

    Raises:
        FitmatError: no model, angles out of range, as in degrees, or of unlike shapes.

    Example:
        >>> import fitmat as fm
        >>> albedo(fm.model("lambert", kd=0.5), [0.0, 1.0]).value.round(3).ravel()
        array([0.5, 0.5])
    """
    arguments.kind("model", model, AbstractBRDF)
    goal = float(arguments.numbers("goal", goal, 2.0 * LEAST, 1.0, single=True))
    phi = arguments.angles("phi_i", phi_i, arguments.AZIMUTH, signed=True)
    if theta_i is None:
        if phi.any():
            raise ModelError("phi_i without theta_i: light from everywhere has no azimuth. Give both, or neither.")
        return _from_everywhere(model, goal)
    theta = np.atleast_1d(arguments.angles("theta_i", theta_i, arguments.ZENITH))
    if theta.ndim != 1 or phi.shape not in ((), (1,), theta.shape) or not theta.size:
        raise ModelError(f"theta_i and phi_i have shapes {theta.shape} and {phi.shape}: expected the same (k,), k ≥ 1.")
    theta, phi = np.broadcast_arrays(theta, phi)
    return _refined(*_first_rule(model, MOST_NODES[1] if goal <= GOAL else FEW_AZIMUTHS), (theta, phi), goal)


def _first_rule(model: AbstractBRDF, most: int) -> tuple[Draws, float, tuple[int, int]]:
    """A model with its values, its width, and how many nodes in zenith and azimuth, `most` at most, come first."""
    part = model, vector(model)[None]
    width = float(widths(*part)[0])
    azimuths = AZIMUTH_NODES if model.isotropic else max(AZIMUTH_NODES, min(int(STREAK / width), most))
    return part, width, (ZENITH_NODES, azimuths)


def _from_everywhere(model: AbstractBRDF, goal: float) -> Albedo:
    """The mean over the hemisphere, weighted with c_i."""
    theta, weight = incidence_rule()
    phi = np.zeros(1) if model.isotropic else (np.arange(AZIMUTHS) + 0.5) * np.pi / AZIMUTHS
    found = albedo(model, np.tile(theta, len(phi)), np.repeat(phi, len(theta)), goal=goal)
    share = np.tile(weight, len(phi)) / np.pi / len(phi)
    return Albedo((share @ found.value)[None], (share @ found.error)[None])


def _refined(
    part: Draws, width: float, nodes: tuple[int, int], angles: tuple[np.ndarray, np.ndarray], wanted: float
) -> Albedo:
    """By that many nodes; incidences with a larger bound than wanted again by twice as many where these are too few."""
    fine = _albedo(part, width, angles, nodes)
    sparse = [(round(nodes[0] * COARSER), nodes[1]), (nodes[0], round(nodes[1] * COARSER))]
    apart = np.stack([2.0 * np.abs(fine - _albedo(part, width, angles, few)) for few in sparse])
    found = Albedo(fine, apart.sum(axis=0) + LEAST)
    goal = wanted * np.maximum(1.0, fine)
    far = (found.error > goal).any(axis=1)
    few = np.any(apart[:, far] > (goal / 4)[far], axis=(1, 2))
    more = min(nodes[0] * (1 + few[0]), MOST_NODES[0]), min(nodes[1] * (1 + few[1]), MOST_NODES[1])
    if far.any() and more != nodes:
        again = _refined(part, width, more, (angles[0][far], angles[1][far]), wanted)
        found.value[far], found.error[far] = again.value, again.error
    return found


def _albedo(
    part: Draws, width: float, angles: tuple[np.ndarray, np.ndarray], nodes: tuple[int, int]
) -> Float[np.ndarray, "k c"]:
    turned, found = not part[0].isotropic, []
    for some in slices(len(angles[0]), max(1, LARGE[1] // (nodes[0] * nodes[1]))):
        each = zip(*(angle[some] for angle in angles), strict=True)
        rules = [lobe_rule(theta, width, phi_i=phi if turned else None, nodes=nodes) for theta, phi in each]
        reflected = blocks([part], [(rule.wi, rule.wo) for rule in rules])
        found += [rules[k].weight @ f[0] for _, k, (f,) in reflected]
    return np.stack(found)
