"""Blender's Principled BSDF as Cycles computes it, a model of the library: opaque base and specular, single scattering.

Its coat is here as a model around it; sheen, subsurface, transmission, thin film and Multiscatter GGX are not.
"""

import functools
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.exports.metallic_roughness import AbstractSquared, Squared, fraction, roughness, tangent, turn
from fitmat.maths.directions import above, rotated
from fitmat.models.base import AbstractBRDF, AbstractLobe
from fitmat.models.lobes.oren_nayar import EnergyPreservingOrenNayar
from fitmat.models.parameters import param
from fitmat.models.terms.distributions import GGX, Isotropic, Slopes, visibility
from fitmat.models.terms.energy import missing
from fitmat.models.terms.fresnel import (
    COS_82,
    Dielectric,
    average,
    dielectric,
    eta_from_f0,
    f0_from_eta,
    hoffman,
    schlick,
)

SIZE = 16
"""Of Cycles' table in each of roughness, cosine and ∜F0, between which it is interpolated as there."""

COAT_IOR = 1.5
"""Of Blender's coat, as it comes."""

NODES = 3000
"""Of the quadrature over visible normals."""


@functools.cache
def table() -> Float[np.ndarray, "k k k"]:
    """How far the Fresnel term of a rough dielectric is from F0 to 1 for an eye, over ∜F0, cosine and roughness.

    The mean of (F − F0)/(1 − F0) over the normals that are visible (Heitz 2018), 0 where the mirrored direction is
    below the surface: the table `ggx_gen_schlick_ior_s`, which Cycles computes once by Monte Carlo.
    """
    rough, cos = (np.clip(np.linspace(0.0, 1.0, SIZE), 1e-4, 1.0) for _ in range(2))
    f0 = np.clip(np.linspace(0.0, 1.0, SIZE), 1e-4, 0.99) ** 4
    alpha, mu = (a.ravel()[:, None] for a in np.meshgrid(rough**2, cos, indexing="ij"))
    place = np.arange(NODES)
    radius, phase = np.sqrt((place + 0.5) / NODES), np.pi * (3.0 - 5.0**0.5) * place  # Vogel's spiral
    sine = alpha * np.sqrt(1.0 - mu**2)
    size = np.hypot(sine, mu)
    x, z = sine / size, mu / size  # the eye over a sphere
    across, half = radius * np.cos(phase), 0.5 * (1.0 + z)
    up = (1.0 - half) * np.sqrt(1.0 - across**2) + half * radius * np.sin(phase)
    out = np.sqrt(np.maximum(1.0 - across**2 - up**2, 0.0))
    h = np.stack([alpha * (x * out - z * up), alpha * across, np.maximum(z * out + x * up, 0.0)])
    h /= np.linalg.norm(h, axis=0)
    seen = np.sqrt(1.0 - mu**2) * h[0] + mu * h[2]
    risen = 2.0 * seen * h[2] - mu > 0.0
    share = np.empty((SIZE, SIZE, SIZE))
    for k, least in enumerate(f0):
        whole = (dielectric(np.clip(seen, 0.0, 1.0), eta_from_f0(np.asarray(least))) - least) / (1.0 - least)
        share[k] = np.mean(np.clip(whole, 0.0, 1.0) * risen, axis=1).reshape(SIZE, SIZE).T
    return share


class Drawn(AbstractSquared):
    """Anisotropic of the Principled BSDF: α = r²/a along the tangent, r² a across it, a = √(1 − 0.9 anisotropic)."""

    suffix: ClassVar[str] = "-aniso"
    isotropic: ClassVar[bool] = False
    roughness: Scalar = roughness()
    anisotropic: Scalar = fraction("s", 0.5, (0.3, 0.8), "how much the highlight is stretched along the tangent")
    rotation: Scalar = turn()

    @property
    def slopes(self) -> Slopes:
        """(α_x, α_y)."""
        aspect = jnp.sqrt(1.0 - 0.9 * self.anisotropic)
        return self.roughness**2 / aspect, self.roughness**2 * aspect

    def local(self, w: Vec3) -> Vec3:
        """The direction turned by −rotation about the normal."""
        return rotated(w, -jnp.deg2rad(self.rotation))


class Principled(AbstractLobe):
    """The Principled BSDF of Blender 4 and 5 in Cycles, with the distribution GGX.

    f = m F_82(c, t) D V + (1 − m) (F D V + (1 − max A(c_o)) f_d),  F = F0 t + (1 − F0 t) (F_d − F0)/(1 − F0)

    D is GGX with α = roughness², V = G/(4 c_i c_o) Smith's height-correlated masking, F_d the exact dielectric of the
    index and F0 its value at normal incidence, F_82 Hoffman's curve from c with the tint t at 82°, A as F with the
    share of `table` in place of F_d's, max over the channels, and f_d EON whose light of several bounces has a factor
    c more.

    Parameters: base_color c, 0 to 1, per channel; metallic m, 0 to 1; roughness, 0.01 to 1; ior, 1 to 20;
    specular_tint t, 0 to 1, per channel; diffuse_roughness, 0 to 1. With `-aniso` anisotropic and rotation.

    Reference: Blender Foundation, Cycles, src/kernel/svm/closure.h, src/kernel/closure/bsdf_microfacet.h and
    bsdf_oren_nayar.h (5.0).
    """

    label: ClassVar[str] = "principled{shape.suffix}"
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType({"reciprocal": "its layers take from the eye's side alone"})

    base_color: Spectrum = param(
        0.0, 1.0, symbol="c", per_channel=True, weight=True, default=0.5, doc="albedo of a dielectric, F0 of a metal"
    )
    metallic: Scalar = fraction("m", 0.0, (0.5,), "0 is a dielectric, 1 a metal")
    ior: Scalar = param(1.0, 20.0, symbol="η", scale="log", default=1.5, starts=(1.5, 3.0), doc="refractive index")
    specular_tint: Spectrum = param(
        0.0, 1.0, symbol="t", per_channel=True, default=1.0, starts=(0.95,), doc="tint of the reflection"
    )
    diffuse_roughness: Scalar = fraction("r_d", 0.0, (0.05, 0.5), "roughness of the diffuse part")
    shape: AbstractSquared = eqx.field(default_factory=Squared)

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """The metal and the dielectric, mixed."""
        p, slopes = self.shape.pair(wi, wo), self.shape.slopes
        mirror = GGX().density(p.h, slopes) * visibility(GGX(), "correlated", slopes, p) / 4.0
        metal = hoffman(p.cos_d, self.base_color, self.specular_tint * schlick(COS_82, self.base_color))
        f0 = f0_from_eta(self.ior)
        share = (dielectric(p.cos_d, self.ior) - f0) / jnp.maximum(1.0 - f0, 1e-6)
        glossy = _between(f0 * self.specular_tint, share)
        taken = _between(f0 * jnp.max(self.specular_tint), averaged(wo, f0, self.shape.roughness))
        below = EnergyPreservingOrenNayar(self.base_color, self.diffuse_roughness)
        once, more = below.bounces(wi, wo)
        diffuse = self.base_color * (once + below.multiple() * more)
        coated = glossy * mirror + (1.0 - jnp.clip(taken, 0.0, 1.0)) * diffuse
        return jnp.where(above(wi, wo), (1.0 - self.metallic) * coated + self.metallic * metal * mirror, 0.0)

    def width(self) -> Scalar:
        """The smaller slope."""
        return self.shape.width()


class Coated(AbstractLobe):
    """Coat of the Principled BSDF, of index 1.5, untinted.

    f = k F_d D V K + (1 − k A(c_o) K E) f_base,  A = F0 + (1 − F0) share,  K = 1 + F_ms (1 − E(c_o))/E(c_o)

    E is the albedo of GGX, Ē its mean and F_ms = F̄ Ē/(1 − F̄ (1 − Ē)): a coat keeps the light of several bounces,
    whatever the distribution. Of a polished coat (roughness 0) only what it takes from the base is a value of f.

    Parameters: coat k, 0 to 1; of a rough coat coat.alpha, the square of Coat Roughness.

    Reference: as `Principled`.
    """

    label: ClassVar[str] = "coat"
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType({"reciprocal": "its coat takes from the eye's side alone"})

    base: Principled
    weight: Scalar = fraction("k", 1.0, (0.9,), "strength of the coat")
    coat: Isotropic | None = None

    @property
    def name(self) -> str:
        """That of the base under a coat."""
        return f"coat-over-{self.base.name}"

    @property
    def isotropic(self) -> bool:
        """Where the base is."""
        return self.base.isotropic

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """The base seen through the coat, and the coat."""
        f0, kept, albedo = f0_from_eta(jnp.asarray(COAT_IOR)), jnp.ones(()), jnp.ones(())
        rough = jnp.zeros(()) if self.coat is None else jnp.sqrt(self.coat.alpha)
        if self.coat is not None:
            lost, mean = missing(GGX(), "correlated", self.coat.alpha), average(Dielectric())
            albedo, every = 1.0 - lost(jnp.clip(wo[2], 0.0, 1.0)), 1.0 - lost.average()
            kept = 1.0 + mean * every / (1.0 - mean * (1.0 - every)) * (1.0 - albedo) / albedo
        taken = self.weight * _between(f0, averaged(wo, f0, rough)) * kept * albedo
        below = (1.0 - taken) * self.base(wi, wo)
        if self.coat is None:
            return below
        p, slopes = self.coat.pair(wi, wo), self.coat.slopes
        mirror = GGX().density(p.h, slopes) * visibility(GGX(), "correlated", slopes, p) / 4.0
        coat = self.weight * dielectric(p.cos_d, jnp.asarray(COAT_IOR)) * mirror * kept
        return below + jnp.where(above(wi, wo), coat, 0.0)

    def width(self) -> Scalar:
        """The narrower of both."""
        base = self.base.width()
        return base if self.coat is None else jnp.minimum(base, self.coat.width())


def averaged(wo: Vec3, f0: Scalar, rough: Scalar) -> Scalar:
    """`table` between its entries."""
    place = jnp.maximum(f0, 1e-16) ** 0.25, jnp.clip(wo[2], 0.0, 1.0), rough
    at = [(SIZE - 1.0) * jnp.asarray(x) for x in place]
    return jax.scipy.ndimage.map_coordinates(jnp.asarray(table()), at, order=1, mode="nearest")


def _between(f0: Spectrum, share: Scalar) -> Spectrum:
    return f0 + (1.0 - f0) * jnp.clip(share, 0.0, 1.0)


def template(model: AbstractBRDF, channels: int) -> tuple[AbstractBRDF, list[dict[str, float]]]:
    """The model with what a model has, and what of it is held: as a metal, and as a dielectric; a polished coat."""
    given: dict[str, Any] = {"base_color": np.full(channels, 0.5), "specular_tint": np.full(channels, 1.0)}
    held = {} if model.isotropic else {"rotation": tangent(model)}
    metal = {"metallic": 1.0, "diffuse_roughness": 0.0, "ior": 1.5}
    base = Principled(**given, shape=Squared() if model.isotropic else Drawn())
    into: AbstractBRDF = base
    if model.name.startswith("rough-varnish-over-"):
        into = Coated(base, coat=Isotropic())
    elif model.name.startswith("varnish-over-"):
        into, held = Coated(base), held | {"weight": 1.0}
    return into, [held | metal, held | {"metallic": 0.0}]
