"""Energy: what fraction of the light a surface reflects, from one direction and from all, each with an error bound.

Integrals of a model; it judges nothing.
"""

import dataclasses

import numpy as np
from jaxtyping import ArrayLike, Float

from fitmat import arguments
from fitmat.errors import ModelError
from fitmat.maths.quadrature import AZIMUTH_NODES, ZENITH_NODES, incidence_rule, lobe_rule
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import vector
from fitmat.models.values import Draws, blocks, widths
from fitmat.text import brief

FINE = (ZENITH_NODES, AZIMUTH_NODES)

COARSE = (ZENITH_NODES * 3 // 4, AZIMUTH_NODES * 3 // 4)
"""Nodes of the second, coarser rule; the error of a converging rule is well below its distance from a coarser one."""

LEAST = 1e-4
"""What the bound never falls below: two rules may agree by chance."""

AZIMUTHS = 8
"""Azimuths of incidence over half a turn in the hemispherical albedo of anisotropic models."""


@dataclasses.dataclass(frozen=True, eq=False)
class Albedo:
    """Reflected fractions of the light.

    Attributes:
        value: One row per incidence, one column per channel; 1 is all of it.
        error: Bound of the quadrature's error, same shape: twice the distance of two rules, of which the finer gave
            `value`, and `LEAST`.
    """

    value: Float[np.ndarray, "k c"]
    error: Float[np.ndarray, "k c"]

    __repr__ = brief


def albedo(model: AbstractBRDF, theta_i: ArrayLike | None = None, phi_i: ArrayLike = 0.0) -> Albedo:
    """Fraction of the light that the surface reflects: from each direction, ∫ f c_o dω_o, or from all together.

    Args:
        model: From `fitmat.model`.
        theta_i: Zenith angles of incidence in radians, 0 to π/2, (k,); None for light that comes evenly from the whole
            hemisphere, ∫∫ f c_o c_i dω_o dω_i/π, one row.
        phi_i: Azimuths of incidence in radians, (k,) or one; of no consequence for isotropic models.

    Returns:
        The albedo with its error bound: about 10⁻³ (relative) for lobes down to α = 10⁻³ and θ_i up to 80°.

    Raises:
        FitmatError: no model, angles out of range, as in degrees, or of unlike shapes.

    Example:
        >>> import fitmat as fm
        >>> albedo(fm.model("lambert", kd=0.5), [0.0, 1.0]).value.round(3).ravel()
        array([0.5, 0.5])
    """
    arguments.kind("model", model, AbstractBRDF)
    phi = arguments.angles("phi_i", phi_i, arguments.AZIMUTH, signed=True)
    if theta_i is None:
        if phi.any():
            raise ModelError("phi_i without theta_i: light from everywhere has no azimuth. Give both, or neither.")
        return _from_everywhere(model)
    theta = np.atleast_1d(arguments.angles("theta_i", theta_i, arguments.ZENITH))
    if theta.ndim != 1 or phi.shape not in ((), (1,), theta.shape) or not theta.size:
        raise ModelError(f"theta_i and phi_i have shapes {theta.shape} and {phi.shape}: expected the same (k,), k ≥ 1.")
    theta, phi = np.broadcast_arrays(theta, phi)
    part = model, vector(model)[None]
    fine, coarse = (_albedo(part, float(widths(*part)[0]), (theta, phi), nodes) for nodes in (FINE, COARSE))
    return Albedo(fine, 2.0 * np.abs(fine - coarse) + LEAST)


def _from_everywhere(model: AbstractBRDF) -> Albedo:
    """The mean over the hemisphere, weighted with c_i."""
    theta, weight = incidence_rule()
    phi = np.zeros(1) if model.isotropic else (np.arange(AZIMUTHS) + 0.5) * np.pi / AZIMUTHS
    found = albedo(model, np.tile(theta, len(phi)), np.repeat(phi, len(theta)))
    share = np.tile(weight, len(phi)) / np.pi / len(phi)
    return Albedo((share @ found.value)[None], (share @ found.error)[None])


def _albedo(
    part: Draws, width: float, angles: tuple[np.ndarray, np.ndarray], nodes: tuple[int, int]
) -> Float[np.ndarray, "k c"]:
    turned = not part[0].isotropic
    rules = [
        lobe_rule(theta, width, phi_i=phi if turned else None, nodes=nodes) for theta, phi in zip(*angles, strict=True)
    ]
    found = blocks([part], [(rule.wi, rule.wo) for rule in rules])
    return np.stack([rules[k].weight @ f[0] for _, k, (f,) in found])
