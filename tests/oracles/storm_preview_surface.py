"""UsdPreviewSurface as Storm lights it, one channel and one pair of directions at a time, line by line.

Pixar, OpenUSD 24.08, pxr/usdImaging/plugin/usdShaders/shaders/previewSurface.glslfx: evaluateLight, without clearcoat
and occlusion, over the irradiance NdotL.
"""

import math
from collections.abc import Sequence

EPSILON = 0.001


def normal_distribution(specular_roughness: float, n_dot_h: float) -> float:
    alpha = specular_roughness * specular_roughness
    alpha2 = alpha * alpha
    d_denom = (n_dot_h * n_dot_h * (alpha2 - 1.0)) + 1.0
    d_denom *= d_denom
    d_denom *= math.pi
    return (alpha2 + EPSILON) / d_denom


def geometric(specular_roughness: float, n_dot_l: float, n_dot_e: float) -> float:
    alpha = specular_roughness * specular_roughness
    k = alpha * 0.5
    g = n_dot_e / (n_dot_e * (1.0 - k) + k)
    return g * n_dot_l / (n_dot_l * (1.0 - k) + k)


def evaluate_light(
    diffuse_color: float, specular_color: float, roughness: float, light: Sequence[float], eye: Sequence[float]
) -> float:
    total = [a + b for a, b in zip(light, eye, strict=True)]
    size = math.sqrt(sum(x * x for x in total))
    n_dot_l, n_dot_e, n_dot_h = light[2], eye[2], total[2] / size
    e_dot_h = sum(a * b for a, b in zip(total, eye, strict=True)) / size
    roughness = max(0.001, roughness)
    fresnel = max(0.0, 1.0 - e_dot_h) ** 5.0
    f = specular_color * (1 - fresnel) + 1.0 * fresnel
    d = diffuse_color / math.pi
    r_num = f * geometric(roughness, n_dot_l, n_dot_e) * normal_distribution(roughness, n_dot_h)
    s1 = r_num / (4.0 * n_dot_l * n_dot_e + EPSILON)
    d *= 1.0 - f
    return d + s1
