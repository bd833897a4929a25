"""glTF 2.0, Appendix B, one pair of directions at a time, word for word: the specification's own pseudo-code.

The Khronos Group, glTF 2.0 Specification, appendix B; KHR_materials_specular, KHR_materials_ior and
KHR_materials_clearcoat, sections "Implementation".
"""

import math
from collections.abc import Sequence


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True))


def specular_brdf(alpha: float, light: Sequence[float], view: Sequence[float]) -> float:
    total = [x + y for x, y in zip(light, view, strict=True)]
    half = [x / math.sqrt(dot(total, total)) for x in total]
    square = alpha * alpha
    density = square / (math.pi * (half[2] * half[2] * (square - 1) + 1) ** 2)
    vis = abs(view[2]) * math.sqrt(square + (1 - square) * light[2] ** 2)
    vis += abs(light[2]) * math.sqrt(square + (1 - square) * view[2] ** 2)
    return 1 / (2 * vis) * density


def material(
    color: Sequence[float],
    metallic: float,
    roughness: float,
    ior: float,
    specular: float,
    specular_color: Sequence[float],
    light: Sequence[float],
    view: Sequence[float],
    coat: Sequence[float] = (),
) -> list[float]:
    total = [x + y for x, y in zip(light, view, strict=True)]
    v_dot_h = dot(view, total) / math.sqrt(dot(total, total))
    weight = (1 - abs(v_dot_h)) ** 5
    mirror = specular_brdf(roughness**2, light, view)
    fresnel = []
    for one in specular_color:
        f0 = min(((ior - 1) / (ior + 1)) ** 2 * one, 1) * specular
        fresnel.append(f0 + (specular - f0) * weight)
    result = []
    for c, f in zip(color, fresnel, strict=True):
        metal = mirror * (c + (1 - c) * weight)
        dielectric = (1 - max(fresnel)) * c / math.pi + f * mirror
        base = (1 - metallic) * dielectric + metallic * metal
        if coat:
            clearcoat, clearcoat_roughness = coat
            share = clearcoat * (0.04 + 0.96 * (1 - abs(view[2])) ** 5)
            base = base * (1 - share) + share * specular_brdf(clearcoat_roughness**2, light, view)
        result.append(base)
    return result
