"""Albedo of white facets that light meets once: Blender's tables, and an average over normals in plain numpy.

Sources: Heitz 2014, "Understanding the masking-shadowing function", eqs. 54, 61, 63, 72, 99; Cook & Torrance 1982 for
V-cavities. Nothing here comes from fitmat.
"""

import numpy as np
from scipy.special import erf

ROUGH = np.array([3, 5, 10, 16, 22, 31]) / 31
"""Cycles' roughness, √alpha, at some columns of its tables."""

CYCLES = {
    3 / 31: (0.994519, 0.959460, 0.884058, 0.893246, 0.862365, 0.765057),
    15 / 31: (0.999762, 0.998053, 0.964995, 0.843295, 0.698566, 0.457779),
    1.0: (0.999911, 0.999296, 0.987261, 0.903873, 0.684249, 0.306853),
}
"""Cosine → albedo of white GGX, single scattering, Smith height-correlated, at `ROUGH`; the first at cosine 3/31.

Blender Cycles (Apache-2.0), intern/cycles/scene/shader.tables, `table_ggx_E`, computed with 10⁸ samples a number.
"""

CYCLES_MEAN = (0.999548, 0.997199, 0.970160, 0.870874, 0.697631, 0.409137)
"""E_avg at `ROUGH`, `table_ggx_Eavg` of the same file."""


def albedo(distribution: str, alpha: float, cos: float, masking: str = "correlated", cells: int = 700) -> float:
    """E = ∫ D c_h G2 (ω_i·h)/(c_i c_h) dω_h with F = 1, over quantiles of D c_h."""

    def smith(w: np.ndarray) -> np.ndarray:
        a = w[2] / (alpha * np.sqrt(np.maximum(1 - w[2] ** 2, 1e-30)))
        if distribution == "ggx":
            return (np.sqrt(1 + 1 / a**2) - 1) / 2
        return (erf(a) - 1) / 2 + np.exp(-(a**2)) / (2 * a * np.sqrt(np.pi))

    t, u2 = (part.ravel() for part in np.meshgrid(*[(np.arange(cells) + 0.5) / cells] * 2))
    u, density = 1 - (1 - t) ** 2, 2 * (1 - t)
    slope = alpha * np.sqrt(u / (1 - u) if distribution == "ggx" else -np.log1p(-u))
    h = np.stack([slope * np.cos(np.pi * u2), slope * np.sin(np.pi * u2), np.ones_like(u)])
    h /= np.sqrt(1 + slope**2)
    wi = np.array([np.sqrt(1 - cos**2), 0.0, cos])
    cos_d = wi @ h
    wo = 2 * cos_d * h - wi[:, None]
    seen = (wo[2] > 1e-12) & (cos_d > 0)
    one, other = smith(wi), smith(np.where(seen, wo, np.array([[0.0], [0.0], [1.0]])))
    if masking == "v-cavity":
        both = np.minimum(1.0, 2 * h[2] * np.minimum(cos, wo[2]) / np.where(seen, cos_d, 1.0))
    else:
        both = 1 / ((1 + one) * (1 + other)) if masking == "separable" else 1 / (1 + one + other)
    return float(np.sum(density * np.where(seen, both * cos_d / (cos * h[2]), 0.0)) / len(u))
