"""Cycles' Principled BSDF, one pair of directions and one channel at a time, line by line from its own source.

Blender 5.0, intern/cycles/kernel: svm/closure.h (CLOSURE_BSDF_PRINCIPLED_ID), closure/bsdf_microfacet.h,
closure/bsdf_oren_nayar.h, util/lookup_table.h; app/cycles_precompute.cpp says what the table holds, which is
integrated here over the hemisphere of normals instead of sampled.
"""

import functools
import math
from collections.abc import Sequence

import numpy as np


def fresnel_dielectric(c: float, eta: float) -> float:
    g = eta * eta - 1 + c * c
    if g <= 0:
        return 1.0
    g = math.sqrt(g)
    a = (g - c) / (g + c)
    b = (c * (g + c) - 1) / (c * (g - c) + 1)
    return 0.5 * a * a * (1 + b * b)


def ior_from_f0(f0: float) -> float:
    return (1 + math.sqrt(f0)) / (1 - math.sqrt(f0))


@functools.cache
def table_ggx_gen_schlick_ior_s(z: int, y: int, x: int) -> float:
    rough, mu, zeta = max(x / 15, 1e-4), max(y / 15, 1e-4), min(max(z / 15, 1e-4), 0.99)
    f0, alpha2 = zeta**4, rough**4
    slope = np.tan((np.arange(600) + 0.5) / 600 * math.pi / 2) * rough**2  # evenly in the angle of slope over alpha
    cos = 1 / np.sqrt(1 + slope**2)
    phi = (np.arange(100) + 0.5) / 100 * 2 * math.pi
    seen = math.sqrt(1 - mu * mu) * np.sqrt(1 - cos**2)[:, None] * np.cos(phi) + mu * cos[:, None]
    tan2 = (1 - mu * mu) / (mu * mu)
    g1 = 2 / (1 + math.sqrt(1 + alpha2 * tan2))
    d = 1 / (math.pi * alpha2 * cos**4 * (1 + slope**2 / alpha2) ** 2)
    per_node = rough**2 * (1 + slope**2 / alpha2) * slope * cos**3 * (math.pi / 2 / 600) * (2 * math.pi / 100)
    weight = np.maximum(seen, 0) * (d * per_node)[:, None] * g1 / mu
    eta, c = ior_from_f0(f0), np.clip(seen, 0, 1)
    g = np.sqrt(eta**2 - 1 + c**2)
    f = 0.5 * ((g - c) / (g + c)) ** 2 * (1 + ((c * (g + c) - 1) / (c * (g - c) + 1)) ** 2)
    above = 2 * seen * cos[:, None] - mu > 0
    return float((weight * above * (f - f0) / (1 - f0)).sum())


def lookup_table_read_3d(x: float, y: float, z: float) -> float:
    total, places = 0.0, [min(max(value, 0.0), 1.0) * 15 for value in (z, y, x)]
    for corner in range(8):
        weight, index = 1.0, []
        for k, place in enumerate(places):
            low = min(int(place), 15)
            upper = corner >> k & 1
            weight *= place - low if upper else 1 - (place - low)
            index.append(min(low + upper, 15))
        if weight:
            total += weight * table_ggx_gen_schlick_ior_s(*index)
    return total


def oren_nayar_g(c: float) -> float:
    s, theta = math.sqrt(1 - c * c), math.acos(c)
    return s * (theta - 2 / 3 - s * c) + 2 / 3 * (s / c) * (1 - s * s * s)


def oren_nayar(color: float, sigma: float, nl: float, nv: float, lv: float) -> float:
    a = 1 / (math.pi + sigma * (math.pi / 2 - 2 / 3))
    b = sigma * a
    e_avg = a * math.pi + (2 * math.pi - 5.6) / 3 * b
    ems = 1 / math.pi * color * color * (e_avg / (1 - e_avg)) / (1 - color * (1 - e_avg))
    t = lv - nl * nv
    if t > 0:
        t /= max(nl, nv)
    ev, el = a * math.pi + b * oren_nayar_g(nv), a * math.pi + b * oren_nayar_g(nl)
    return a + b * t + ems * (1 - ev) * (1 - el)


def principled(
    base_color: float,
    metallic: float,
    roughness: float,
    ior: float,
    tint: float,
    largest_tint: float,
    diffuse_roughness: float,
    light: Sequence[float],
    eye: Sequence[float],
) -> float:
    total = [a + b for a, b in zip(light, eye, strict=True)]
    size = math.sqrt(sum(x * x for x in total))
    cos_nh, cos_hi = total[2] / size, sum(a * b for a, b in zip(total, eye, strict=True)) / size
    alpha2 = roughness**4
    d = alpha2 / (math.pi * (1 - cos_nh**2 + alpha2 * cos_nh**2) ** 2)
    li, lo = (0.5 * (math.sqrt(1 + alpha2 * (1 / w[2] ** 2 - 1)) - 1) for w in (eye, light))
    common = d / (1 + li + lo) / (4 * light[2] * eye[2])
    # metallic component, F82 tint
    f = 6 / 7
    f5 = f**5
    f82 = tint
    b = (base_color + (1 - base_color) * f5) * (7 / (f5 * f)) * (1 - f82)
    m = 1 - cos_hi
    metal = min(max(base_color + (1 - base_color) * m**5 - b * cos_hi * m**6, 0), 1)
    # specular component
    real = ((ior - 1) / (ior + 1)) ** 2
    f0 = real * tint
    s = min(max((fresnel_dielectric(cos_hi, ior) - real) / (1 - real), 0), 1)
    specular = f0 + (1 - f0) * s
    z = math.sqrt(abs((ior - 1) / (ior + 1)))
    share = lookup_table_read_3d(roughness, eye[2], z)
    largest = real * largest_tint
    weight = 1 - (largest + (1 - largest) * share)
    lv = sum(a * b for a, b in zip(light, eye, strict=True))
    diffuse = base_color * weight * oren_nayar(base_color, diffuse_roughness, light[2], eye[2], lv)
    return metallic * metal * common + (1 - metallic) * (specular * common + diffuse)
