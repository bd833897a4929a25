"""Direct light in Unreal Engine and in Unity's URP, one channel and one pair of directions at a time, line by line.

Epic Games, Engine/Shaders/Private/BRDF.ush, ShadingModels.ush (DefaultLitBxDF), ShadingCommon.ush, over the
irradiance; Unity Technologies, ShaderLibrary/BRDF.hlsl and Lighting.hlsl, in which a light's colour is irradiance
over pi.
"""

import math
from collections.abc import Sequence


def cosines(light: Sequence[float], eye: Sequence[float]) -> tuple[float, float]:
    total = [a + b for a, b in zip(light, eye, strict=True)]
    size = math.sqrt(sum(x * x for x in total))
    return total[2] / size, sum(a * b for a, b in zip(total, eye, strict=True)) / size


def unreal(
    base: float,
    base_green: float,
    metallic: float,
    specular: float,
    roughness: float,
    light: Sequence[float],
    eye: Sequence[float],
) -> float:
    no_h, vo_h = cosines(light, eye)
    no_l, no_v = light[2], eye[2]
    a2 = roughness**4
    d = (no_h * a2 - no_h) * no_h + 1
    d_ggx = a2 / (math.pi * d * d)
    a = math.sqrt(a2)
    vis_smith_v = no_l * (no_v * (1 - a) + a)
    vis_smith_l = no_v * (no_l * (1 - a) + a)
    vis = 0.5 / (vis_smith_v + vis_smith_l)
    dielectric = 0.08 * specular
    specular_color, green = (dielectric + (c - dielectric) * metallic for c in (base, base_green))
    fc = (1 - vo_h) ** 5
    f_schlick = min(max(50.0 * green, 0), 1) * fc + (1 - fc) * specular_color
    diffuse_color = base - base * metallic
    return diffuse_color * (1 / math.pi) + (d_ggx * vis) * f_schlick


def unity(base: float, metallic: float, smoothness: float, light: Sequence[float], eye: Sequence[float]) -> float:
    no_h, lo_h = cosines(light, eye)
    one_minus_reflectivity = 0.96 - metallic * 0.96
    brdf_diffuse = base * one_minus_reflectivity
    brdf_specular = 0.04 + (base - 0.04) * metallic
    perceptual_roughness = 1.0 - smoothness
    roughness = perceptual_roughness * perceptual_roughness
    roughness2 = roughness * roughness
    normalization_term = roughness * 4.0 + 2.0
    d = no_h * no_h * (roughness2 - 1.0) + 1.00001
    specular_term = roughness2 / ((d * d) * max(0.1, lo_h * lo_h) * normalization_term)
    return (brdf_diffuse + brdf_specular * specular_term) / math.pi
