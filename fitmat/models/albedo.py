"""Energy: what fraction of the light a surface reflects, from one direction and from all, each with an error bound.

Integrals of a model; it judges nothing.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from fitmat.maths.quadrature import AZIMUTH_NODES, ZENITH_NODES, incidence_rule, lobe_rule
from fitmat.models.base import AbstractBRDF

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


def directional_albedo(model: AbstractBRDF, theta_i: ArrayLike, phi_i: ArrayLike = 0.0) -> Albedo:
    """Fraction of the light from each direction that the surface reflects, ∫ f c_o dω_o.

    Args:
        model: From `fitmat.model`.
        theta_i: Zenith angles of incidence in radians, 0 to π/2, (k,).
        phi_i: Azimuths of incidence in radians, (k,) or one; of no consequence for isotropic models.

    Returns:
        The albedo with its error bound: about 10⁻³ (relative) for lobes down to α = 10⁻³ and θ_i up to 80°.

    Example:
        >>> import fitmat as fm
        >>> directional_albedo(fm.model("lambert", kd=0.5), [0.0, 1.0]).value.round(3).ravel()
        array([0.5, 0.5])
    """
    theta, phi = np.broadcast_arrays(np.atleast_1d(np.asarray(theta_i, float)), np.asarray(phi_i, float))
    fine, coarse = (np.asarray(_albedo(model, jnp.asarray(theta), jnp.asarray(phi), n)) for n in (FINE, COARSE))
    return Albedo(fine, 2.0 * np.abs(fine - coarse) + LEAST)


def hemispherical_albedo(model: AbstractBRDF) -> Albedo:
    """Fraction reflected of light that comes evenly from the whole hemisphere, ∫∫ f c_o c_i dω_o dω_i/π; one row."""
    theta, weight = incidence_rule()
    phi = np.zeros(1) if model.isotropic else (np.arange(AZIMUTHS) + 0.5) * np.pi / AZIMUTHS
    found = directional_albedo(model, np.tile(theta, len(phi)), np.repeat(phi, len(theta)))
    share = np.tile(weight, len(phi)) / np.pi / len(phi)
    return Albedo((share @ found.value)[None], (share @ found.error)[None])


@eqx.filter_jit
def _albedo(model: AbstractBRDF, theta_i: Array, phi_i: Array, nodes: tuple[int, int]) -> Float[Array, "k c"]:
    def one(theta: Array, phi: Array) -> Array:
        rule = lobe_rule(theta, model.width(), phi_i=None if model.isotropic else phi, nodes=nodes)
        return rule.weight @ jax.vmap(lambda wo: jnp.atleast_1d(model(rule.wi, wo)))(rule.wo)

    return jax.lax.map(lambda pair: one(*pair), (theta_i, phi_i))
