"""glTF's metallic-roughness material as a model of the library: Appendix B of the specification, with its extensions.

It writes no file; what a coat reflects in the mirror direction alone is no value of it.
"""

from abc import abstractmethod
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.maths.directions import above, rotated
from fitmat.models.base import AbstractBRDF, AbstractLobe
from fitmat.models.parameters import entries, param, vector
from fitmat.models.terms.distributions import GGX, AbstractRoughness, Isotropic, Slopes, visibility
from fitmat.models.terms.fresnel import schlick

LEAST_ROUGHNESS = 0.01
"""Below it alpha would be smaller than any lobe of the library has it."""

COAT_F0 = 0.04
"""Of KHR_materials_clearcoat, whose index is 1.5."""

STARTS = (0.07, 0.15, 0.25, 0.35, 0.5, 0.7, 0.9)


def fraction(symbol: str, default: float, starts: tuple[float, ...], doc: str) -> Any:
    """A parameter from 0 to 1, shared by the channels."""
    return param(0.0, 1.0, symbol=symbol, default=default, starts=starts, doc=doc)


def roughness(doc: str = "square root of the slope parameter") -> Any:
    """The parameter roughness of a renderer's material."""
    return param(LEAST_ROUGHNESS, 1.0, symbol="r", default=0.5, starts=STARTS, doc=doc)


def turn() -> Any:
    """The parameter rotation: azimuth of the tangent, degrees."""
    return param(
        -180.0, 180.0, symbol="φ_t", unit="°", default=0.0, starts=(0.0,), period=180.0,
        doc="azimuth of the tangent; half a turn changes nothing",
    )  # fmt: skip


class AbstractSquared(AbstractRoughness):
    """A roughness whose square is the slope parameter."""

    roughness: eqx.AbstractVar[Scalar]

    @property
    @abstractmethod
    def slopes(self) -> Slopes:
        """α = roughness², along the tangent and across it."""


class Squared(AbstractSquared):
    """The same in all directions."""

    suffix: ClassVar[str] = ""
    isotropic: ClassVar[bool] = True
    roughness: Scalar = roughness()

    @property
    def slopes(self) -> Slopes:
        """(α, α)."""
        return self.roughness**2, self.roughness**2

    def local(self, w: Vec3) -> Vec3:
        """The direction itself."""
        return w


class Stretched(AbstractSquared):
    """KHR_materials_anisotropy: α_t = mix(α, 1, strength²) along the tangent, α across it."""

    suffix: ClassVar[str] = "-aniso"
    isotropic: ClassVar[bool] = False
    roughness: Scalar = roughness()
    strength: Scalar = fraction("s", 0.3, (0.2, 0.5), "how much the highlight is stretched along the tangent")
    rotation: Scalar = turn()

    @property
    def slopes(self) -> Slopes:
        """(α_t, α_b)."""
        alpha = self.roughness**2
        return alpha + (1.0 - alpha) * self.strength**2, alpha

    def local(self, w: Vec3) -> Vec3:
        """The direction turned by −rotation about the normal."""
        return rotated(w, -jnp.deg2rad(self.rotation))


class MetallicRoughness(AbstractLobe):
    """glTF 2.0's material with KHR_materials_ior and KHR_materials_specular.

    f = (1 − m) ((1 − max F) c/π + F D V) + m F_c D V,  F = s (F0 + (1 − F0)(1 − c_d)⁵),  F_c = c + (1 − c)(1 − c_d)⁵

    D is GGX with α = roughness² and V = G/(4 c_i c_o) Smith's height-correlated masking; max is over the channels.

    Parameters: base_color c, 0 to 1, per channel; metallic m, 0 to 1; roughness, 0.01 to 1; specular s, 0 to 1; f0, per
    channel, 0 to 1: ((ior − 1)/(ior + 1))² times specularColor. With `-aniso` strength and rotation.

    Reference: The Khronos Group, glTF 2.0 specification, appendix B; KHR_materials_specular, _ior, _anisotropy.
    """

    label: ClassVar[str] = "gltf{shape.suffix}"

    base_color: Spectrum = param(
        0.0, 1.0, symbol="c", per_channel=True, weight=True, default=0.5, doc="albedo of a dielectric, F0 of a metal"
    )
    metallic: Scalar = fraction("m", 0.0, (0.5,), "0 is a dielectric, 1 a metal")
    specular: Scalar = fraction("s", 1.0, (0.95,), "strength of a dielectric's reflection")
    f0: Spectrum = param(
        0.0, 1.0, symbol="F0", per_channel=True, default=0.04, starts=(0.04, 0.3), doc="a dielectric's F0; 0.04 is 1.5"
    )
    shape: AbstractSquared = eqx.field(default_factory=Squared)

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """The two materials, mixed."""
        p, slopes = self.shape.pair(wi, wo), self.shape.slopes
        mirror = GGX().density(p.h, slopes) * visibility(GGX(), "correlated", slopes, p) / 4.0
        fresnel, metal = self.specular * schlick(p.cos_d, self.f0), schlick(p.cos_d, self.base_color)
        most = self.specular * schlick(p.cos_d, jnp.max(self.f0))  # of a parameter: rounding cannot hide its channel
        dielectric = (1.0 - most) * self.base_color / jnp.pi + fresnel * mirror
        mixed = (1.0 - self.metallic) * dielectric + self.metallic * metal * mirror
        return jnp.where(above(wi, wo), mixed, 0.0)

    def width(self) -> Scalar:
        """The smaller slope."""
        return self.shape.width()


class Clearcoated(AbstractLobe):
    """KHR_materials_clearcoat over a material: mix(base, D V, clearcoat · F(n·ω_o)).

    f = (1 − k F) f_base + k F D V,  F = 0.04 + 0.96 (1 − c_o)⁵

    Of a polished coat (clearcoatRoughness 0) only what it takes from the base is a value of f.

    Parameters: clearcoat k, 0 to 1; of a rough coat clearcoat.alpha, the square of clearcoatRoughness.

    Reference: The Khronos Group, KHR_materials_clearcoat.
    """

    label: ClassVar[str] = "clearcoat"
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType({"reciprocal": "its coat takes from the eye's side alone"})

    base: MetallicRoughness
    clearcoat: Scalar = fraction("k", 1.0, (0.9,), "strength of the coat")
    coat: Isotropic | None = None

    @property
    def name(self) -> str:
        """That of the base under a coat."""
        return f"clearcoat-over-{self.base.name}"

    @property
    def isotropic(self) -> bool:
        """Where the base is."""
        return self.base.isotropic

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """The base seen through the coat, and the coat."""
        share = self.clearcoat * schlick(jnp.clip(wo[2], 0.0, 1.0), COAT_F0)
        below = (1.0 - share) * self.base(wi, wo)
        if self.coat is None:
            return below
        p, slopes = self.coat.pair(wi, wo), self.coat.slopes
        mirror = GGX().density(p.h, slopes) * visibility(GGX(), "correlated", slopes, p) / 4.0
        return below + jnp.where(above(wi, wo), share * mirror, 0.0)

    def width(self) -> Scalar:
        """The narrower of both."""
        base = self.base.width()
        return base if self.coat is None else jnp.minimum(base, self.coat.width())


def template(model: AbstractBRDF, channels: int) -> tuple[AbstractBRDF, list[dict[str, float]]]:
    """The material of glTF that has what a model has, and what of it is held: as a metal, and as a dielectric.

    A brushed model gives it its tangent, a varnished one a coat; a polished coat counts in full. A mixture of metal
    and dielectric is not tried: its parameters would trade off.

    Args:
        model: What is exported.
        channels: How many its values have.
    """
    given: dict[str, Any] = {"base_color": np.full(channels, 0.5), "f0": np.full(channels, COAT_F0)}
    base = MetallicRoughness(**given, shape=Squared() if model.isotropic else Stretched())
    into: AbstractBRDF = base
    held = {} if model.isotropic else {"rotation": tangent(model)}
    if model.name.startswith("rough-varnish-over-"):
        into = Clearcoated(base, coat=Isotropic())
    elif model.name.startswith("varnish-over-"):
        into, held = Clearcoated(base), held | {"clearcoat": 1.0}
    return into, [held | {"metallic": 1.0, "specular": 1.0, "f0": COAT_F0}, held | {"metallic": 0.0}]


def tangent(model: AbstractBRDF) -> float:
    """Azimuth in degrees along which the first brushed highlight of a model is stretched: that of the larger slope."""
    values = np.asarray(vector(model), float)
    named = {e.name.rpartition(".")[2]: values[e.place][0] for e in reversed(entries(model))}
    across = named.get("alpha_x", 1.0) < named.get("alpha_y", 0.0) or named.get("exponent_u", 0.0) > named.get(
        "exponent_v", np.inf
    )
    return float((named.get("rotation", 0.0) + (90.0 if across else 0.0) + 90.0) % 180.0 - 90.0)
