"""Light in a coat over a base, photon by photon, in plain numpy; from the papers and not from fitmat.

A photon crosses the coat's face, meets the base, and goes back and forth until it leaves. A smooth face splits it by
Fresnel's equations; a rough one is walked on facet by facet (Heitz, Hanika, d'Eon & Dachsbacher 2016, algorithm 1, with
uniform heights, reflection and refraction on both sides). The base is Lambert's, or GGX facets met once (Heitz 2018:
visible normals; weight F G2/G1; what is masked is lost). `value` is position-free: at each meeting with the base the
light towards the sensor is added, so that only the photon's own path is random.

Directions point away from the surface, (m, 3), the normal is +z.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
from oracles import ggx

Curve = Callable[[np.ndarray], np.ndarray]
"""Reflectance at cosines, (m,) to (m,)."""

BOUNCES = 300
LEAST = 1e-6
"""Photons of less weight are given up: a bias below 1e-6."""


def interface(cos: np.ndarray, eta: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reflectance, and the cosine behind; `eta` is the index behind over that before. 1 beyond total reflection."""
    sin2 = (1 - cos**2) / eta**2
    behind = np.sqrt(np.maximum(1 - sin2, 0))
    r_s = (cos - eta * behind) / np.maximum(cos + eta * behind, 1e-300)
    r_p = (eta * cos - behind) / np.maximum(eta * cos + behind, 1e-300)
    return np.where(sin2 >= 1, 1.0, (r_s**2 + r_p**2) / 2), behind


def schlick(f0: float) -> Curve:
    """F0 + (1 − F0)(1 − c)⁵."""
    return lambda cos: f0 + (1 - f0) * (1 - cos) ** 5


def visible(w: np.ndarray, alpha: float, rng: np.random.Generator) -> np.ndarray:
    """Normals as often as they are seen from w, which may lie below the horizon (Heitz 2018, listing 1)."""
    v = w * [alpha, alpha, 1.0]
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    flat = np.hypot(v[:, 0], v[:, 1])
    turned = np.stack([-v[:, 1], v[:, 0], 0 * flat], axis=1) / np.maximum(flat, 1e-300)[:, None]
    t1 = np.where(flat[:, None] > 1e-12, turned, [1.0, 0.0, 0.0])
    t2 = np.cross(v, t1)
    u, angle = np.sqrt(rng.uniform(size=len(w))), 2 * np.pi * rng.uniform(size=len(w))
    p1, s = u * np.cos(angle), (1 + v[:, 2]) / 2
    p2 = (1 - s) * np.sqrt(1 - p1**2) + s * u * np.sin(angle)
    p3 = np.sqrt(np.maximum(0, 1 - p1**2 - p2**2))
    n = (p1[:, None] * t1 + p2[:, None] * t2 + p3[:, None] * v) * [alpha, alpha, 1.0]
    return n / np.linalg.norm(n, axis=1, keepdims=True)


@dataclasses.dataclass(frozen=True)
class Lambert:
    """Albedo kd."""

    kd: float

    def scatter(self, w: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Where light from w goes, and its weight."""
        r, phi = np.sqrt(rng.uniform(size=len(w))), 2 * np.pi * rng.uniform(size=len(w))
        return np.stack([r * np.cos(phi), r * np.sin(phi), np.sqrt(1 - r**2)], axis=1), np.full(len(w), self.kd)

    def value(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        """BRDF, sr⁻¹."""
        del wo
        return np.full(len(wi), self.kd / np.pi)


@dataclasses.dataclass(frozen=True)
class Facets:
    """GGX facets, single scattering, height-correlated masking."""

    alpha: float
    fresnel: Curve

    def scatter(self, w: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Where light from w goes, and its weight F G2/G1."""
        h = visible(w, self.alpha, rng)
        cos = np.clip(np.sum(w * h, axis=1), 0, 1)
        out = 2 * cos[:, None] * h - w
        up = out[:, 2] > 1e-9
        safe = np.where(up[:, None], out, [0.0, 0.0, 1.0])
        here = ggx.smith(w, self.alpha)
        kept = (1 + here) / (1 + here + ggx.smith(safe, self.alpha))
        return safe, np.where(up, self.fresnel(cos) * kept, 0.0)

    def value(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        """F D G2/(4 c_i c_o), sr⁻¹."""
        h = wi + wo
        h = h / np.linalg.norm(h, axis=1, keepdims=True)
        d = self.alpha**2 / (np.pi * ((self.alpha**2 - 1) * h[:, 2] ** 2 + 1) ** 2)
        g2 = 1 / (1 + ggx.smith(wi, self.alpha) + ggx.smith(wo, self.alpha))
        return self.fresnel(np.clip(np.sum(wi * h, axis=1), 0, 1)) * d * g2 / (4 * wi[:, 2] * wo[:, 2])


Base = Lambert | Facets


def refracted(w: np.ndarray, eta: float) -> np.ndarray:
    """The direction in the coat, still pointing up."""
    inner = w / eta
    return np.concatenate([inner[:, :2], np.sqrt(1 - np.sum(inner[:, :2] ** 2, axis=1, keepdims=True))], axis=1)


def albedo(base: Base, theta: float, eta: float, *, depth: float = 0.0, count: int, seed: int) -> tuple[float, float]:
    """Reflected fraction with the mirror image of a smooth coat, and its standard error; theta in radians."""
    rng = np.random.default_rng(seed)
    w = np.tile([np.sin(theta), 0.0, np.cos(theta)], (count, 1))
    mirrored, _ = interface(w[:, 2], eta)
    w, total, weight = refracted(w, eta), mirrored.copy(), 1 - mirrored
    for _ in range(BOUNCES):
        weight = weight * np.exp(-depth / w[:, 2])
        w, kept = base.scatter(w, rng)
        weight = weight * kept * np.exp(-depth / w[:, 2])
        back, _ = interface(w[:, 2], 1 / eta)
        total += weight * (1 - back)
        weight, w = weight * back, w * [-1.0, -1.0, 1.0]
        if weight.max() < LEAST:
            break
    return float(total.mean()), float(total.std() / np.sqrt(count))


def value(
    base: Base, wi: np.ndarray, wo: np.ndarray, eta: float, *, depth: float = 0.0, count: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """BRDF of a smooth coat over a base at pairs (n, 3), sr⁻¹, without the mirror image, and its standard error."""
    rng = np.random.default_rng(seed)
    found = []
    for i, o in zip(wi, wo, strict=True):
        enter, leave = (1 - interface(w[None, 2], eta)[0] for w in (i, o))
        w, up = (np.tile(refracted(x[None], eta), (count, 1)) for x in (i, o))
        total, weight, where = np.zeros(count), np.full(count, enter * leave / eta**2), np.arange(count)
        for _ in range(BOUNCES):
            weight = weight * np.exp(-depth / w[:, 2])
            total[where] += weight * np.exp(-depth / up[where, 2]) * base.value(w, up[where])
            w, kept = base.scatter(w, rng)
            back, _ = interface(w[:, 2], 1 / eta)
            weight = weight * kept * back * np.exp(-depth / w[:, 2])
            alive = weight >= LEAST
            w, weight, where = w[alive] * [-1.0, -1.0, 1.0], weight[alive], where[alive]
            if not len(w):
                break
        found.append((total.mean(), total.std() / np.sqrt(count)))
    means, errors = np.array(found).T
    return means, errors


def walk(
    w: np.ndarray, outside: np.ndarray, alpha: float, eta: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Where photons that come from w (away from the face, z > 0 outside and z < 0 inside) leave a rough face.

    Returns:
        Directions (m, 3) away from the face, and whether they are outside.
    """
    going, outside = -w, outside.copy()
    depth = np.full(len(w), 1 - 1e-6)  # C1(h) seen from the photon's own side
    active = np.ones(len(w), bool)
    while active.any():
        k = np.flatnonzero(active)
        side = np.where(outside[k], 1.0, -1.0)
        ahead = going[k] * np.stack([np.ones_like(side), np.ones_like(side), side], axis=1)
        tan2 = (1 - ahead[:, 2] ** 2) / np.maximum(ahead[:, 2] ** 2, 1e-300)
        shadow = (-1 + np.sign(ahead[:, 2]) * np.sqrt(1 + alpha**2 * tan2)) / 2
        draw = np.maximum(rng.uniform(size=len(k)), 1e-300)
        up = ahead[:, 2] > 0
        with np.errstate(over="ignore", divide="ignore"):
            height = depth[k] * np.exp(-np.log(draw) / np.where(shadow == 0, 1e-300, shadow))
        leaves = up & ((height >= 1) | (shadow <= 0))
        active[k[leaves]] = False
        stay = ~leaves
        k, ahead, side, height = k[stay], ahead[stay], side[stay], np.clip(height[stay], 1e-300, 1 - 1e-9)
        h = visible(-ahead, alpha, rng)
        cos = np.clip(np.sum(-ahead * h, axis=1), 0, 1)
        index = np.where(side > 0, eta, 1 / eta)
        reflectance, behind = interface(cos, index)
        mirrored = rng.uniform(size=len(k)) < reflectance
        out = ahead + 2 * cos[:, None] * h
        through = ahead / index[:, None] + (cos / index - behind)[:, None] * h
        going[k] = np.where(mirrored[:, None], out, through) * np.stack([side * 0 + 1, side * 0 + 1, side], axis=1)
        depth[k] = np.where(mirrored, height, 1 - height)
        outside[k] = np.where(mirrored, side > 0, side < 0)
    return going, outside


def rough_albedo(
    base: Base, theta: float, eta: float, alpha: float, *, depth: float = 0.0, count: int, seed: int
) -> tuple[float, float]:
    """Reflected fraction under a coat whose face is a GGX surface, all orders of scattering there, and its error."""
    rng = np.random.default_rng(seed)
    w, weight = np.tile([np.sin(theta), 0.0, np.cos(theta)], (count, 1)), np.ones(count)
    total, where = np.zeros(count), np.arange(count)
    outside = np.ones(count, bool)
    for _ in range(BOUNCES):
        going, outside = walk(w, outside, alpha, eta, rng)
        total[where[outside]] += weight[outside]
        going, weight, where = going[~outside], weight[~outside], where[~outside]
        down = -going  # from the base towards the face
        out, kept = base.scatter(down, rng)
        weight = weight * kept * np.exp(-depth / down[:, 2] - depth / out[:, 2])
        alive = weight > 1e-3
        survive = alive | (rng.uniform(size=len(weight)) < weight / 1e-3)
        weight = np.where(alive, weight, 1e-3)[survive]
        w, where = (-out * [1.0, 1.0, 1.0])[survive], where[survive]
        outside = np.zeros(len(w), bool)
        if not len(w):
            break
    return float(total.mean()), float(total.std() / np.sqrt(count))
