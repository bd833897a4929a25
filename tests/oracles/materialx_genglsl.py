"""MaterialX 1.39.5's GLSL, one pair of directions and one channel at a time, transcribed line by line.

Academy Software Foundation, MaterialX, libraries/pbrlib/genglsl: mx_dielectric_bsdf, mx_generalized_schlick_bsdf,
mx_oren_nayar_diffuse_bsdf, lib/mx_microfacet_specular and lib/mx_microfacet_diffuse; the graph is
libraries/bxdf/open_pbr_surface.mtlx. Responses are divided by the light's cosine.
"""

import math
from collections.abc import Sequence

PI = math.pi


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True))


def dir_albedo(x: float, y: float, f0: float, f90: float) -> float:
    rows = [
        (0.1003, -0.6303, 9.748, -2.038, 29.34, -8.245, -26.44, 19.99, -5.448),
        (0.9345, -2.323, 2.229, -3.748, 1.424, -0.7684, 1.436, 0.2913, 0.6286),
        (1.0, -1.765, 8.263, 11.53, 28.96, -7.507, -36.11, 15.86, 33.37),
        (1.0, 0.2281, 15.94, -55.83, 13.08, 41.26, 54.9, 300.2, -285.1),
    ]
    terms = (1.0, x, y, x * y, x * x, y * y, x * x * y, x * y * y, x * x * y * y)
    r = [dot(row, terms) for row in rows]
    first, second = (min(max(r[k] / r[k + 2], 0.0), 1.0) for k in (0, 1))
    return f0 * first + f90 * second


def fresnel_dielectric(c: float, ior: float) -> float:
    g = math.sqrt(ior * ior + c * c - 1.0)
    return 0.5 * ((g - c) / (g + c)) ** 2 * (1.0 + (((g + c) * c - 1.0) / ((g - c) * c + 1.0)) ** 2)


def fresnel_hoffman_schlick(x: float, f0: float, f82: float, f90: float = 1.0) -> float:
    top = 1.0 / 7.0
    factor = 1.0 / (top * (1.0 - top) ** 6)
    a = (f0 + (f90 - f0) * (1.0 - top) ** 5) * (1.0 - f82) * factor
    return f0 + (f90 - f0) * (1.0 - x) ** 5 - a * x * (1.0 - x) ** 6


def half_of(light: Sequence[float], view: Sequence[float]) -> list[float]:
    total = [a + b for a, b in zip(light, view, strict=True)]
    return [a / math.sqrt(dot(total, total)) for a in total]


def microfacet(fresnel: float, alpha: float, light: Sequence[float], view: Sequence[float]) -> float:
    h, ndotl, ndotv = half_of(light, view), light[2], view[2]
    he = (h[0] / alpha) ** 2 + (h[1] / alpha) ** 2
    ndf = 1.0 / (PI * alpha * alpha * (he + h[2] ** 2) ** 2)
    lambda_l = math.sqrt(alpha**2 + (1.0 - alpha**2) * ndotl**2)
    lambda_v = math.sqrt(alpha**2 + (1.0 - alpha**2) * ndotv**2)
    g2 = 2.0 * ndotl * ndotv / (lambda_l * ndotv + lambda_v * ndotl)
    ess = dir_albedo(ndotv, alpha, 1.0, 1.0)
    return ndf * fresnel * g2 * (1.0 + fresnel * (1.0 - ess) / ess) / (4.0 * ndotv) / ndotl


def compensated_diffuse(color: float, roughness: float, light: Sequence[float], view: Sequence[float]) -> float:
    ndotl, ndotv, ldotv = light[2], view[2], min(max(dot(light, view), 1e-8), 1.0)
    c1, c2 = 0.5 - 2.0 / (3.0 * PI), 2.0 / 3.0 - 28.0 / (15.0 * PI)
    s = ldotv - ndotl * ndotv
    stinv = s / max(ndotl, ndotv) if s > 0.0 else s
    a = 1.0 / (1.0 + c1 * roughness)

    def albedo(cos: float) -> float:
        si = math.sqrt(1.0 - cos * cos)
        g = si * (math.acos(cos) - si * cos) + 2.0 * ((si / cos) * (1.0 - si**3) - si) / 3.0
        return a + roughness * a * g / PI

    mean = a * (1.0 + c2 * roughness)
    multi = color * color * mean / (1.0 - color * (1.0 - mean))
    multi *= (1.0 - albedo(ndotv)) * (1.0 - albedo(ndotl)) / (1.0 - mean)
    return (color * a * (1.0 + roughness * stinv) + multi) / PI


def open_pbr(
    color: float, metalness: float, diffuse: float, tint: float, ior: float, roughness: float,
    light: Sequence[float], view: Sequence[float],
) -> float:  # fmt: skip
    alpha, ndotv = roughness**2, view[2]
    vdoth = dot(view, half_of(light, view))
    f = fresnel_dielectric(vdoth, ior)
    ess = dir_albedo(ndotv, alpha, 1.0, 1.0)
    comp = 1.0 + f * (1.0 - ess) / ess
    throughput = 1.0 - dir_albedo(ndotv, alpha, ((ior - 1.0) / (ior + 1.0)) ** 2, 1.0) * comp
    dielectric = tint * microfacet(f, alpha, light, view)
    dielectric += throughput * compensated_diffuse(color, diffuse, light, view)
    metal = microfacet(fresnel_hoffman_schlick(vdoth, color, tint), alpha, light, view)
    return metal * metalness + dielectric * (1.0 - metalness)
