"""pbrt-v4's diffuse and rough conductor, one pair of directions and one wavelength at a time, line by line.

M. Pharr, W. Jakob & G. Humphreys, src/pbrt/bxdfs.h (ConductorBxDF::f), src/pbrt/util/scattering.h (FrComplex,
TrowbridgeReitzDistribution), src/pbrt/materials.h (MixMaterial::ChooseMaterial, in its mean).
"""

import cmath
import math
from collections.abc import Sequence


def tan2_theta(w: Sequence[float]) -> float:
    return max(0.0, 1 - w[2] ** 2) / w[2] ** 2


def cos_phi(w: Sequence[float]) -> float:
    sin_theta = math.sqrt(max(0.0, 1 - w[2] ** 2))
    return 1.0 if sin_theta == 0 else min(max(w[0] / sin_theta, -1), 1)


def sin_phi(w: Sequence[float]) -> float:
    sin_theta = math.sqrt(max(0.0, 1 - w[2] ** 2))
    return 0.0 if sin_theta == 0 else min(max(w[1] / sin_theta, -1), 1)


def fr_complex(cos_theta_i: float, eta: complex) -> float:
    sin2_theta_i = 1 - cos_theta_i**2
    sin2_theta_t = sin2_theta_i / eta**2
    cos_theta_t = cmath.sqrt(1 - sin2_theta_t)
    r_parl = (eta * cos_theta_i - cos_theta_t) / (eta * cos_theta_i + cos_theta_t)
    r_perp = (cos_theta_i - eta * cos_theta_t) / (cos_theta_i + eta * cos_theta_t)
    return (abs(r_parl) ** 2 + abs(r_perp) ** 2) / 2


def distribution(wm: Sequence[float], ax: float, ay: float) -> float:
    e = tan2_theta(wm) * ((cos_phi(wm) / ax) ** 2 + (sin_phi(wm) / ay) ** 2)
    return 1 / (math.pi * ax * ay * wm[2] ** 4 * (1 + e) ** 2)


def mask(w: Sequence[float], ax: float, ay: float) -> float:
    alpha2 = (cos_phi(w) * ax) ** 2 + (sin_phi(w) * ay) ** 2
    return (math.sqrt(1 + alpha2 * tan2_theta(w)) - 1) / 2


def conductor(eta: complex, ax: float, ay: float, wo: Sequence[float], wi: Sequence[float]) -> float:
    cos_o, cos_i = abs(wo[2]), abs(wi[2])
    wm = [a + b for a, b in zip(wi, wo, strict=True)]
    size = math.sqrt(sum(x * x for x in wm))
    wm = [x / size for x in wm]
    f = fr_complex(abs(sum(a * b for a, b in zip(wo, wm, strict=True))), eta)
    g = 1 / (1 + mask(wo, ax, ay) + mask(wi, ax, ay))
    return distribution(wm, ax, ay) * f * g / (4 * cos_i * cos_o)


def mixed(reflectance: float, amount: float, mirror: float) -> float:
    return (1 - amount) * reflectance / math.pi + amount * mirror
