"""GGX reflection in plain numpy, from the papers and not from fitmat; vectors have the normal along +z.

Sources: Walter et al. 2007 (D, Smith's G1, dielectric Fresnel by Snell's law), Heitz 2014 (height-correlated G2),
Heitz 2018, "Sampling the GGX distribution of visible normals", JCGT 7(4), listing 1.
"""

import numpy as np
from numpy.typing import ArrayLike

Vectors = np.ndarray
"""(…, 3)."""

Slopes = float | tuple[float, float]
"""One alpha, or alpha_x and alpha_y."""


def fresnel(cos: np.ndarray, eta: float) -> np.ndarray:
    """(R_s + R_p)/2 with Snell's law, eta > 1."""
    inside = np.sqrt(1 - (1 - cos**2) / eta**2)
    r_s = (cos - eta * inside) / (cos + eta * inside)
    r_p = (eta * cos - inside) / (eta * cos + inside)
    return (r_s**2 + r_p**2) / 2


def smith(v: Vectors, alpha: Slopes) -> np.ndarray:
    """Λ(v) = (−1 + √(1 + (α_x² v_x² + α_y² v_y²)/v_z²))/2 (Heitz 2014, eqs. 72 and 80)."""
    stretched = v[..., :2] * alpha / v[..., 2:]
    return (np.sqrt(1 + np.sum(stretched**2, axis=-1)) - 1) / 2


def brdf(wi: Vectors, wo: Vectors, alpha: float, eta: float) -> np.ndarray:
    """F D G2/(4 c_i c_o); both above the surface."""
    h = wi + wo
    h = h / np.linalg.norm(h, axis=-1, keepdims=True)
    tan2 = (1 - h[..., 2] ** 2) / h[..., 2] ** 2
    d = alpha**2 / (np.pi * h[..., 2] ** 4 * (alpha**2 + tan2) ** 2)
    g2 = 1 / (1 + smith(wi, alpha) + smith(wo, alpha))
    return fresnel(np.sum(wi * h, axis=-1), eta) * d * g2 / (4 * wi[..., 2] * wo[..., 2])


def visible_normals(wi: Vectors, alpha: Slopes, u1: np.ndarray, u2: np.ndarray) -> Vectors:
    """Heitz's map of the unit square to micro-normals as often as they are seen from wi, (3,) → (m, 3)."""
    stretch = np.append(np.broadcast_to(alpha, 2), 1.0)
    v = wi * stretch
    v = v / np.linalg.norm(v)
    flat = np.hypot(v[0], v[1])
    t1 = np.array([-v[1], v[0], 0.0]) / flat if flat > 0 else np.array([1.0, 0.0, 0.0])
    t2 = np.cross(v, t1)
    radius, angle, s = np.sqrt(u1), 2 * np.pi * u2, (1 + v[2]) / 2
    p1 = radius * np.cos(angle)
    p2 = (1 - s) * np.sqrt(1 - p1**2) + s * radius * np.sin(angle)
    n = np.stack([p1, p2, np.sqrt(np.maximum(0, 1 - p1**2 - p2**2))], axis=-1) @ np.stack([t1, t2, v])
    n = n * stretch
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


def albedo(theta: float, alpha: Slopes, eta: float, cells: int = 500, phi: float = 0.0) -> float:
    """∫ f c_o dω_o = mean of F G2/G1 over visible normals; the grid u1 = 1 − (1−t)² is dense in the tail of slopes."""
    t, u2 = (part.ravel() for part in np.meshgrid(*[(np.arange(cells) + 0.5) / cells] * 2))
    wi = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    h = visible_normals(wi, alpha, 1 - (1 - t) ** 2, u2)
    cos = h @ wi
    wo = 2 * cos[:, None] * h - wi
    up = wo[:, 2] > 1e-9
    g2_g1 = (1 + smith(wi, alpha)) / (1 + smith(wi, alpha) + smith(wo[up], alpha))
    return float(np.sum(2 * (1 - t[up]) * fresnel(cos[up], eta) * g2_g1) / len(up))


def hemisphere(zenith: ArrayLike, azimuth: ArrayLike) -> Vectors:
    """Unit vectors (…, 3) at angles in radians."""
    zenith, azimuth = np.broadcast_arrays(zenith, azimuth)
    sin = np.sin(zenith)
    return np.stack([sin * np.cos(azimuth), sin * np.sin(azimuth), np.cos(zenith)], axis=-1)
