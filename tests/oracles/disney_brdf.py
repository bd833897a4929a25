"""Disney's BRDF of 2012 in plain numpy, line by line from its GLSL and not from fitmat.

Source: github.com/wdas/brdf, src/brdfs/disney.brdf (Copyright Disney Enterprises, Inc., modified Apache 2.0) as of
commit 0202adc4; `roughness_remap` puts back the two lines for Gs that pull request 14 of 23 February 2017 removed.
Names are the shader's. n pairs at once: vectors (n, 3), numbers (n,), in the precision of the arrays given.
"""

import numpy as np

PI = np.pi

Array = np.ndarray


def dot(a: Array, b: Array) -> Array:
    return np.sum(a * b, axis=-1)


def mix(a: Array | float, b: Array | float, t: Array) -> Array:
    return a * (1 - t) + b * t


def sqr(x: Array) -> Array:
    return x * x


def schlick_fresnel(u: Array) -> Array:
    m = np.clip(1 - u, 0, 1)
    m2 = m * m
    return m2 * m2 * m


def gtr1(n_dot_h: Array, a: Array) -> Array:
    a2 = a * a
    t = 1 + (a2 - 1) * n_dot_h * n_dot_h
    return np.where(a >= 1, 1 / PI, (a2 - 1) / (PI * np.log(a2) * t))


def gtr2_aniso(n_dot_h: Array, h_dot_x: Array, h_dot_y: Array, ax: Array, ay: Array) -> Array:
    return 1 / (PI * ax * ay * sqr(sqr(h_dot_x / ax) + sqr(h_dot_y / ay) + n_dot_h * n_dot_h))


def smith_g_ggx(n_dot_v: Array, alpha_g: Array) -> Array:
    a = alpha_g * alpha_g
    b = n_dot_v * n_dot_v
    return 1 / (n_dot_v + np.sqrt(a + b - a * b))


def smith_g_ggx_aniso(n_dot_v: Array, v_dot_x: Array, v_dot_y: Array, ax: Array, ay: Array) -> Array:
    return 1 / (n_dot_v + np.sqrt(sqr(v_dot_x * ax) + sqr(v_dot_y * ay) + sqr(n_dot_v)))


def mon2lin(x: Array) -> Array:
    return x**2.2


def brdf(
    light: Array,
    view: Array,
    x: Array,
    y: Array,
    *,
    base_color: Array,
    metallic: Array,
    subsurface: Array,
    specular: Array,
    roughness: Array,
    specular_tint: Array,
    anisotropic: Array,
    sheen: Array,
    sheen_tint: Array,
    clearcoat: Array,
    clearcoat_gloss: Array,
    roughness_remap: bool,
) -> Array:
    """The shader's `BRDF(L, V, N, X, Y)` with N = +z; base_color is the display value, (n, 3)."""
    n_dot_l, n_dot_v = light[:, 2], view[:, 2]

    h = light + view
    h = h / np.sqrt(dot(h, h))[:, None]
    n_dot_h = h[:, 2]
    l_dot_h = dot(light, h)

    cdlin = mon2lin(base_color)
    cdlum = 0.3 * cdlin[:, 0] + 0.6 * cdlin[:, 1] + 0.1 * cdlin[:, 2]

    lit = (cdlum > 0)[:, None]
    ctint = np.where(lit, cdlin / np.where(lit, cdlum[:, None], 1), 1)
    cspec0 = mix((specular * 0.08)[:, None] * mix(np.ones(3), ctint, specular_tint[:, None]), cdlin, metallic[:, None])
    csheen = mix(np.ones(3), ctint, sheen_tint[:, None])

    fl, fv = schlick_fresnel(n_dot_l), schlick_fresnel(n_dot_v)
    fd90 = 0.5 + 2 * l_dot_h * l_dot_h * roughness
    fd = mix(1, fd90, fl) * mix(1, fd90, fv)

    fss90 = l_dot_h * l_dot_h * roughness
    fss = mix(1, fss90, fl) * mix(1, fss90, fv)
    ss = 1.25 * (fss * (1 / (n_dot_l + n_dot_v) - 0.5) + 0.5)

    aspect = np.sqrt(1 - anisotropic * 0.9)
    ax = np.maximum(0.001, sqr(roughness) / aspect)
    ay = np.maximum(0.001, sqr(roughness) * aspect)
    ds = gtr2_aniso(n_dot_h, dot(h, x), dot(h, y), ax, ay)
    fh = schlick_fresnel(l_dot_h)
    fs = mix(cspec0, 1, fh[:, None])
    if roughness_remap:
        roughg = sqr(roughness * 0.5 + 0.5)
        gs = smith_g_ggx(n_dot_l, roughg) * smith_g_ggx(n_dot_v, roughg)
    else:
        gs = smith_g_ggx_aniso(n_dot_l, dot(light, x), dot(light, y), ax, ay)
        gs = gs * smith_g_ggx_aniso(n_dot_v, dot(view, x), dot(view, y), ax, ay)

    fsheen = (fh * sheen)[:, None] * csheen

    dr = gtr1(n_dot_h, mix(0.1, 0.001, clearcoat_gloss))
    fr = mix(0.04, 1, fh)
    gr = smith_g_ggx(n_dot_l, np.asarray(0.25)) * smith_g_ggx(n_dot_v, np.asarray(0.25))

    body = (1 / PI) * mix(fd, ss, subsurface)[:, None] * cdlin + fsheen
    return body * (1 - metallic)[:, None] + (gs * ds)[:, None] * fs + (0.25 * clearcoat * gr * fr * dr)[:, None]
