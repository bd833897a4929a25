"""Microfacet statistics: distributions of normals, and masking and shadowing.

A distribution gives D(h) and c·(1+Λ(c)), the one form of Smith's Λ that stays finite at grazing angles; a masking
function turns these into G/(c_i c_o). Fresnel and the assembly into a BRDF live elsewhere.
"""

from abc import abstractmethod
from typing import Literal, get_args

import equinox as eqx
import jax.numpy as jnp
from jax.scipy.special import erf

from fitmat._types import Scalar, Vec3
from fitmat.geometry import COS_MIN

Masking = Literal["correlated", "separable", "v-cavity"]
"""Smith height-correlated (Heitz 2014), Smith separable (Walter 2007), V-cavity (Cook & Torrance 1982)."""

MASKINGS: tuple[str, ...] = get_args(Masking)


class AbstractDistribution(eqx.Module):
    """Statistics of micro-normals for one slope parameter alpha."""

    @abstractmethod
    def density(self, h: Vec3, alpha: Scalar) -> Scalar:
        """D(h) in sr⁻¹, normalised so that ∫ D(h) c_h dω_h = 1."""

    @abstractmethod
    def masked_cos(self, cos: Scalar, alpha: Scalar) -> Scalar:
        """c·(1 + Λ(c)): the cosine divided by Smith's G1(c)."""


class GGX(AbstractDistribution):
    """Trowbridge–Reitz, "GGX" (Walter et al. 2007, eqs. 33–34)."""

    def density(self, h: Vec3, alpha: Scalar) -> Scalar:
        """α²/(π((α²−1)c_h² + 1)²), with 1 − c_h² taken from h's own components."""
        sin2 = h[0] ** 2 + h[1] ** 2
        return alpha**2 / (jnp.pi * (alpha**2 * h[2] ** 2 + sin2) ** 2)

    def masked_cos(self, cos: Scalar, alpha: Scalar) -> Scalar:
        """½(c + √(c² + α²(1−c²)))."""
        return 0.5 * (cos + jnp.sqrt(cos**2 + alpha**2 * (1.0 - cos**2)))


class Beckmann(AbstractDistribution):
    """Gaussian slopes (Beckmann & Spizzichino 1963; Walter et al. 2007, eqs. 25–26)."""

    def density(self, h: Vec3, alpha: Scalar) -> Scalar:
        """exp(−tan²θ_h/α²)/(π α² c_h⁴)."""
        cos2 = jnp.maximum(h[2], COS_MIN) ** 2
        tan2 = (h[0] ** 2 + h[1] ** 2) / cos2
        return jnp.exp(-tan2 / alpha**2) / (jnp.pi * alpha**2 * cos2**2)

    def masked_cos(self, cos: Scalar, alpha: Scalar) -> Scalar:
        """½c(1 + erf a) + α s exp(−a²)/(2√π), a = c/(α s)."""
        sin = jnp.sqrt(jnp.maximum(1.0 - cos**2, 1e-16))
        a = cos / (alpha * sin)
        return 0.5 * cos * (1.0 + erf(a)) + alpha * sin * jnp.exp(-(a**2)) / (2.0 * jnp.sqrt(jnp.pi))


def visibility(
    distribution: AbstractDistribution,
    masking: Masking,
    alpha: Scalar,
    cosines: tuple[Scalar, Scalar, Scalar, Scalar],
) -> Scalar:
    """G/(c_i c_o), finite on the closed hemisphere.

    Args:
        distribution: Gives Smith's Λ.
        masking: "correlated" 1/(1+Λ_i+Λ_o); "separable" 1/((1+Λ_i)(1+Λ_o)); "v-cavity"
            min(1, 2c_h c_i/c_d, 2c_h c_o/c_d), which does not depend on alpha.
        alpha: Slope parameter.
        cosines: c_i, c_o, c_h, c_d.
    """
    ci, co, ch, cd = (jnp.maximum(c, COS_MIN) for c in cosines)
    if masking == "v-cavity":
        return jnp.minimum(1.0 / (ci * co), 2.0 * ch / cd / jnp.maximum(ci, co))
    ai, ao = distribution.masked_cos(ci, alpha), distribution.masked_cos(co, alpha)
    if masking == "separable":
        return 1.0 / (ai * ao)
    return 1.0 / (ai * co + ao * ci - ci * co)
