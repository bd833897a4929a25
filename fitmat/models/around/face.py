"""What a rough dielectric face reflects of the light from one direction, by a rule over its visible normals."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat._types import Scalar, Vec3
from fitmat.maths.directions import COS_MIN, Pair, cos_difference
from fitmat.maths.quadrature import Curve, curve, gauss, incidence
from fitmat.models.terms.distributions import GGX, Masking, visibility
from fitmat.models.terms.fresnel import AbstractFresnel

NODES = (12, 12)
"""Visible normals: radii, and azimuths over half a turn."""


def face_albedo(alpha: Scalar, fresnel: AbstractFresnel, masking: Masking) -> Callable[[Array], Array]:
    """Cosine → ∫ f c_o dω_o of a GGX lobe: the mean of F G2/G1 over the visible normals (Heitz 2018).

    The normals move with alpha as they are seen, so that a mirror's rule is one direction; value and slope belong
    together.
    """
    known = face_curve(alpha, fresnel, masking)
    return lambda cos: jnp.clip(known(cos), 0.0, 1.0)


def face_curve(alpha: Scalar, fresnel: AbstractFresnel, masking: Masking) -> Curve:
    """The same as a polynomial, which may leave [0, 1] by its error."""

    def at(cos: Scalar) -> Scalar:
        w = incidence(jnp.arccos(cos))
        return jnp.asarray(_SHARES) @ jax.vmap(lambda p: _reflected(w, p, alpha, fresnel, masking))(jnp.asarray(_DISC))

    return curve(at)


def _reflected(w: Vec3, point: Float[Any, "2"], alpha: Scalar, fresnel: AbstractFresnel, masking: Masking) -> Scalar:
    """F G2/G1 at the normal that a point of the unit disc stands for (E. Heitz, JCGT 7(4), 2018, listing 1)."""
    v = jnp.stack([alpha * w[0], jnp.zeros_like(w[0]), w[2]])
    v = v / jnp.sqrt(v[0] ** 2 + v[2] ** 2)
    p1, s = point[0], (1.0 + v[2]) / 2.0
    p2 = (1.0 - s) * jnp.sqrt(1.0 - p1**2) + s * point[1]
    p3 = jnp.sqrt(jnp.maximum(1.0 - p1**2 - p2**2, 1e-16))
    h = jnp.stack([alpha * (p2 * -v[2] + p3 * v[0]), alpha * p1, jnp.maximum(p2 * v[0] + p3 * v[2], COS_MIN)])
    h = h / jnp.sqrt(h @ h)
    out = 2.0 * (w @ h) * h - w
    seen = Pair(w, out, h, cos_difference(w, out))
    slopes = (alpha, alpha)
    kept = visibility(GGX(), masking, slopes, seen) * jnp.maximum(out[2], 0.0) * GGX().masked_cos(w, slopes)
    return fresnel(jnp.clip(w @ h, 0.0, 1.0)) * kept


def _disc() -> tuple[np.ndarray, np.ndarray]:
    """Points of half the unit disc and shares that sum to 1: r² = 1 − (1−t)², dense in the tail of slopes."""
    (x, wx), (y, wy) = (gauss(count) for count in NODES)
    t, phi = (x + 1.0) / 2.0, (y + 1.0) / 2.0 * np.pi
    r = np.sqrt(1.0 - (1.0 - t) ** 2)[:, None]
    points = np.stack([r * np.sin(phi), r * np.cos(phi)], axis=-1).reshape(-1, 2)
    return points, np.outer(wx * (1.0 - t), wy / 2.0).ravel()


_DISC, _SHARES = _disc()
