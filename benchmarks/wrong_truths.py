"""Surfaces that no model here describes, and where two laboratories measure them; written from the papers, in NumPy.

Fits nothing, and shares no formula with fitmat.
"""

import dataclasses
from collections.abc import Callable

import numpy as np

Brdf = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Unit vectors to the light and to the sensor, (n, 3) both, to values in sr⁻¹, (n,)."""

FAMILIES = {
    "two lobes": "GGX + GGX two to four times as wide, a fifth to seven tenths of the specular light",
    "Beckmann core": "Beckmann's distribution with Smith's masking (Walter et al. 2007, eqs. 25–27)",
    "Oren–Nayar base": "Oren & Nayar 1994, qualitative model, σ 15–40°, under GGX",
    "tilt": "Lambert + GGX on a mount that leans by 0.4° in the plane of incidence",
    "tail": "generalised Trowbridge–Reitz with γ = 1.5 or 2.8 (Burley 2012, eq. 4) instead of 2",
    "base by angle": "a base under a dielectric: k_d (1 − F(θ_i)) (1 − F(θ_o)) / π",
}
"""What is wrong with a fit of Lambert + GGX, and with one of Lambert + Blinn–Phong beside its lobe."""

RIGHT = "Lambert + GGX"

LEAN = np.deg2rad(0.4)


@dataclasses.dataclass(frozen=True)
class Laboratory:
    """Where one laboratory measures in the plane of incidence, in degrees."""

    theta_i: tuple[float, ...]
    step: float
    first: float = 0.0

    def directions(self) -> tuple[np.ndarray, np.ndarray]:
        """Incidence and signed reflection in radians, where the sensor does not hide the light."""
        angles = np.meshgrid(self.theta_i, np.arange(-78.0 + self.first, 78.01, self.step), indexing="ij")
        theta_i, theta_o = (np.deg2rad(part.ravel()) for part in angles)
        seen = np.abs(theta_i + theta_o) > np.deg2rad(3.0)
        return theta_i[seen], theta_o[seen]


SPLITS = {
    "two laboratories, 4°": (Laboratory((10, 30, 50, 70), 4.0), Laboratory((20, 40, 60), 4.0, 2.0)),
    "two laboratories, 1°": (Laboratory((10, 30, 50, 70), 1.0), Laboratory((20, 40, 60), 1.0, 0.5)),
    "low against high": (Laboratory((10, 20, 30), 2.0), Laboratory((50, 60, 70), 2.0)),
    "interleaved": (Laboratory((10, 30, 50, 70), 4.0), Laboratory((10, 30, 50, 70), 4.0, 2.0)),
}
"""Two disjoint measurements of one surface."""


def surface(family: str, rng: np.random.Generator) -> tuple[Brdf, dict[str, float]]:
    """A surface of a family, and its parameters as Lambert + GGX would name them, drawn at random."""
    kd, ks, eta = rng.uniform(0.03, 0.5), rng.uniform(0.6, 1.0), rng.uniform(1.35, 2.0)
    alpha, (u, v) = float(np.exp(rng.uniform(np.log(0.08), np.log(0.4)))), rng.uniform(size=2)

    def lobe(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        if family == "two lobes":
            wide, share = min(alpha * (2 + 2 * u), 0.9), 0.2 + 0.5 * v
            return (1 - share) * specular(wi, wo, alpha, eta) + share * specular(wi, wo, wide, eta)
        if family == "tail":
            return specular(wi, wo, alpha, eta, gamma=1.5 if u < 0.5 else 2.8)
        return specular(wi, wo, alpha, eta, beckmann=family == "Beckmann core")

    def base(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        if family == "Oren–Nayar base":
            return oren_nayar(wi, wo, np.deg2rad(15 + 25 * u))
        if family == "base by angle":
            return (1 - fresnel(wi[:, 2], eta)) * (1 - fresnel(wo[:, 2], eta)) / np.pi
        return np.full(len(wi), 1 / np.pi)

    def brdf(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        return kd * base(wi, wo) + ks * lobe(wi, wo)

    def leaning(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        c, s = np.cos(LEAN), np.sin(LEAN) * (1 if u < 0.5 else -1)
        turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        return brdf(wi @ turn.T, wo @ turn.T) * (wi @ turn.T)[:, 2] / wi[:, 2]  # by the irradiance as reported

    return leaning if family == "tilt" else brdf, {"kd": kd, "ks": ks, "alpha": alpha, "eta": eta}


def fresnel(cos: np.ndarray, eta: float) -> np.ndarray:
    """Cook & Torrance 1982, eq. 9."""
    g = np.sqrt(eta**2 - 1 + cos**2)
    return 0.5 * ((g - cos) / (g + cos)) ** 2 * (1 + ((cos * (g + cos) - 1) / (cos * (g - cos) + 1)) ** 2)


def specular(
    wi: np.ndarray, wo: np.ndarray, alpha: float, eta: float, *, gamma: float = 2.0, beckmann: bool = False
) -> np.ndarray:
    """F D G/(4 c_i c_o), the masking height-correlated (Heitz 2014, eq. 99); GTR with the masking of γ = 2."""
    h = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
    ci, co, ch, cd = wi[:, 2], wo[:, 2], h[:, 2], np.sum(wi * h, axis=1)
    if beckmann:
        density = np.exp(-(1 / ch**2 - 1) / alpha**2) / (np.pi * alpha**2 * ch**4)
        masked = _lambda_beckmann(ci, alpha) + _lambda_beckmann(co, alpha)
    else:
        masked = sum((np.sqrt(1 + alpha**2 * (1 / c**2 - 1)) - 1) / 2 for c in (ci, co))
        scale = alpha**2 if gamma == 2 else (gamma - 1) * (alpha**2 - 1) / (1 - alpha ** (2 - 2 * gamma))
        density = scale / np.pi / (1 + (alpha**2 - 1) * ch**2) ** gamma
    return fresnel(cd, eta) * density / (1 + masked) / (4 * ci * co)


def _lambda_beckmann(cos: np.ndarray, alpha: float) -> np.ndarray:
    """Walter et al. 2007, the rational form beside eq. 27."""
    a = 1 / (alpha * np.sqrt(np.maximum(1 / cos**2 - 1, 1e-30)))
    return np.where(a < 1.6, (1 - 1.259 * a + 0.396 * a**2) / (3.535 * a + 2.181 * a**2), 0.0)


def oren_nayar(wi: np.ndarray, wo: np.ndarray, sigma: float) -> np.ndarray:
    """Oren & Nayar 1994, eq. 30, of albedo 1, in the plane of incidence (azimuths 0 or π apart)."""
    a, b = 1 - 0.5 * sigma**2 / (sigma**2 + 0.33), 0.45 * sigma**2 / (sigma**2 + 0.09)
    theta = np.sort(np.arccos([wi[:, 2], wo[:, 2]]), axis=0)
    same_side = wi[:, 0] * wo[:, 0] > 0
    return (a + b * same_side * np.sin(theta[1]) * np.tan(theta[0])) / np.pi
