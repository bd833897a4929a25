"""What one scattering at a rough GGX interface reflects and transmits, from either side, in plain numpy.

Averages over Heitz's visible normals, on a fine grid or on the Gauss rule of Mitsuba 3 (include/mitsuba/render/
microfacet.h, `eval_reflectance` and `eval_transmittance`; its tables: src/bsdfs/roughplastic.cpp, read from the
wheel's headers and the repository; no code of theirs is here). Sources of the formulas: Walter et al. 2007 (refracted
direction, eq. 40), Heitz 2018.
"""

import numpy as np
from oracles import ggx

Rule = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Two numbers in the unit square and a weight for each micro-normal, (m,); the weights sum to 1."""

TABLE = np.arange(64) / 63
"""Cosines at which `roughplastic` tabulates its transmittance; it evaluates the first at 1e-6."""


def fine(cells: int) -> Rule:
    """Midpoints of u1 = 1 − (1−t)² and u2: dense in the tail of slopes."""
    t, u2 = (part.ravel() for part in np.meshgrid(*[(np.arange(cells) + 0.5) / cells] * 2))
    return 1 - (1 - t) ** 2, u2, 2 * (1 - t) / cells**2


def gauss(count: int) -> Rule:
    """Gauss–Legendre on the square mapped to the disk by Shirley & Chiu's concentric map; an even count."""
    x, weights = np.polynomial.legendre.leggauss(count)
    a, b = np.meshgrid(x, x, indexing="ij")
    steep = np.abs(a) < np.abs(b)
    radius, across = np.where(steep, b, a), np.where(steep, a, b)
    turn = np.pi / 4 * across / radius
    turn = np.where(steep, np.pi / 2 - turn, turn)
    flat_x, flat_y = radius * np.cos(turn), radius * np.sin(turn)
    azimuth = np.arctan2(flat_y, flat_x) / (2 * np.pi)
    return (flat_x**2 + flat_y**2).ravel(), azimuth.ravel(), np.outer(weights, weights).ravel() / 4


def _fresnel(cos: np.ndarray, eta: float) -> tuple[np.ndarray, np.ndarray]:
    """Reflectance and the cosine behind the facet, for any eta; 1 beyond total reflection."""
    sin2 = (1 - cos**2) / eta**2
    inside = np.sqrt(np.maximum(1 - sin2, 0))
    r_s = (cos - eta * inside) / (cos + eta * inside)
    r_p = (eta * cos - inside) / (eta * cos + inside)
    return np.where(sin2 >= 1, 1.0, (r_s**2 + r_p**2) / 2), inside


def _seen(direction: np.ndarray, alpha: float) -> np.ndarray:
    """G1, 0 below the horizon."""
    up = direction[:, 2] > 1e-12
    return np.where(up, 1 / (1 + ggx.smith(np.where(up[:, None], direction, [0.0, 0.0, 1.0]), alpha)), 0.0)


def share(cos: float, alpha: float, eta: float, rule: Rule) -> tuple[float, float]:
    """(reflected, transmitted) of light from a cosine; `eta` is the index behind the interface over that before it."""
    wi = np.array([np.sqrt(1 - cos**2), 0.0, cos])
    h = ggx.visible_normals(wi, alpha, rule[0], rule[1])
    c = np.maximum(h @ wi, 0)
    fresnel, inside = _fresnel(c, eta)
    through = wi / eta - (c / eta - inside)[:, None] * h
    mirrored = 2 * c[:, None] * h - wi
    kept = fresnel * _seen(mirrored, alpha), (1 - fresnel) * _seen(through, alpha)
    return float(rule[2] @ kept[0]), float(rule[2] @ kept[1])
