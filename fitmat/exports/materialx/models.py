"""What MaterialX 1.39.5 does, as models of the library: its rough diffuse node, its specular nodes, and OpenPBR 1.1.1.

Its renderers' own approximations are part of it: the fitted albedo, and what it clamps. Of OpenPBR the opaque base and
the specular lobe are here; coat, fuzz, subsurface, transmission, thin film and its anisotropy are not.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.exports.metallic_roughness import fraction, roughness
from fitmat.maths.directions import COS_MIN, above, pair
from fitmat.models.base import AbstractDiffuse, AbstractLobe, AbstractSpecular, specular_weight
from fitmat.models.lobes.oren_nayar import C1_FON, EnergyPreservingOrenNayar
from fitmat.models.parameters import param
from fitmat.models.terms.distributions import GGX, AbstractRoughness, Isotropic, visibility
from fitmat.models.terms.fresnel import COS_82, AbstractFresnel, Dielectric, dielectric, f0_from_eta, schlick

# mx_microfacet_specular.glsl, mx_ggx_dir_albedo_analytic: factors of 1, x, y, xy, x², y², x²y, xy², x²y².
ALBEDO = np.array(
    [
        [0.1003, 0.9345, 1.0, 1.0],
        [-0.6303, -2.323, -1.765, 0.2281],
        [9.748, 2.229, 8.263, 15.94],
        [-2.038, -3.748, 11.53, -55.83],
        [29.34, 1.424, 28.96, 13.08],
        [-8.245, -0.7684, -7.507, 41.26],
        [-26.44, 1.436, -36.11, 54.9],
        [19.99, 0.2913, 15.86, 300.2],
        [-5.448, 0.6286, 33.37, -285.1],
    ]
)


def albedo(cos: Scalar, alpha: Scalar) -> Float[Array, "2"]:
    """A and B of MaterialX's directional albedo F0 A + F90 B of a GGX lobe (`mx_ggx_dir_albedo_analytic`)."""
    x, y = cos, alpha
    terms = jnp.stack([jnp.ones_like(x * y), x, y, x * y, x * x, y * y, x * x * y, x * y * y, x * x * y * y])
    r = terms @ ALBEDO
    return jnp.clip(r[:2] / r[2:], 0.0, 1.0)


def lost(cos: Scalar, alpha: Scalar) -> Scalar:
    """(1 − E)/E of a white lobe, with the fitted albedo."""
    a, b = albedo(jnp.clip(cos, COS_MIN, 1.0), alpha)
    return (1.0 - a - b) / (a + b)


class RoughDiffuse(AbstractDiffuse):
    """`oren_nayar_diffuse_bsdf` with energy compensation: EON, in which ω_i·ω_o below 0 counts as 0.

    f = f_EON + kd A r max(0, −ω_i·ω_o)/π,  A = 1/(1 + r (½ − 2/(3π)))

    Parameters: kd, per channel; r, 0 to 1, as `eon`.

    Reference: MaterialX 1.39.5, libraries/pbrlib/genglsl/mx_oren_nayar_diffuse_bsdf.glsl.
    """

    label: ClassVar[str] = "materialx-eon"

    kd: Spectrum = param(0.0, 1.0, symbol="k_d", per_channel=True, weight=True, default=0.5, doc="albedo of a facet")
    r: Scalar = fraction("r", 0.5, (0.1, 0.5, 0.9), "roughness; 0 is Lambert")

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """EON and what the clamp adds."""
        clamped = jnp.maximum(-(wi[0] * wo[0] + wi[1] * wo[1] + wi[2] * wo[2]), 0.0)
        more = self.kd * self.r * clamped / (1.0 + C1_FON * self.r) / jnp.pi
        return EnergyPreservingOrenNayar(self.kd, self.r)(wi, wo) + jnp.where(above(wi, wo), more, 0.0)


class Compensated(AbstractSpecular):
    """`dielectric_bsdf`, `conductor_bsdf` and `generalized_schlick_bsdf`: GGX with the energy of multiple scattering.

    f = ks F D G/(4 c_i c_o) (1 + F (1 − E(c_o))/E(c_o))

    As `ggx-turquin`, with F at the micro-normal instead of F0, and the fitted albedo for E. Of brushed surfaces G and
    E are those of one slope, √(α_x α_y).

    Parameters: as `ggx`, or as `ggx-aniso`.

    Reference: MaterialX 1.39.5, libraries/pbrlib/genglsl.
    """

    label: ClassVar[str] = "materialx-ggx{roughness.suffix}{fresnel.suffix}"
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType({"reciprocal": "its factor is that of the eye alone"})

    ks: Spectrum = specular_weight()
    roughness: AbstractRoughness = eqx.field(default_factory=Isotropic)
    fresnel: AbstractFresnel = eqx.field(default_factory=Dielectric)

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """Single scattering times 1 + F (1 − E)/E."""
        p, slopes = self.roughness.pair(wi, wo), self.roughness.slopes
        mean = jnp.sqrt(slopes[0] * slopes[1])
        mirror = GGX().density(p.h, slopes) * visibility(GGX(), "correlated", (mean, mean), p) / 4.0
        fresnel = self.fresnel(p.cos_d)
        kept = 1.0 + fresnel * lost(wo[2], mean)
        return jnp.where(above(wi, wo), self.ks * fresnel * mirror * kept, 0.0)

    def width(self) -> Scalar:
        """The smaller slope."""
        return self.roughness.width()


class OpenPBR(AbstractLobe):
    """OpenPBR's opaque base and specular lobe in MaterialX 1.39.

    f = (1 − m) (t F_d(ior) D V k_d + (1 − A(c_o) k_d) f_EON(c, r_d)) + m F_82(c, t) D V k_m

    D is GGX with α = roughness², V = G/(4 c_i c_o) Smith's height-correlated masking, F_d the exact dielectric, F_82
    Hoffman's curve from c with the tint t at 82°, k = 1 + F (1 − E)/E the compensation of `Compensated`, A the fitted
    albedo of the dielectric lobe, and f_EON that of `RoughDiffuse`.

    Parameters: base_color c, per channel; base_metalness m; base_diffuse_roughness r_d; specular_color t, per channel;
    specular_ior, 1 to 20; roughness, 0.01 to 1.

    References: OpenPBR Surface 1.1.1 (Academy Software Foundation, 2025); MaterialX 1.39,
    libraries/bxdf/open_pbr_surface.mtlx and libraries/pbrlib/genglsl.
    """

    label: ClassVar[str] = "open-pbr"
    breaks: ClassVar[Mapping[str, str]] = MappingProxyType({"reciprocal": "its layers take from the eye's side alone"})

    base_color: Spectrum = param(
        0.0, 1.0, symbol="c", per_channel=True, weight=True, default=0.5, doc="albedo of a dielectric, F0 of a metal"
    )
    base_metalness: Scalar = fraction("m", 0.0, (0.5,), "0 is a dielectric, 1 a metal")
    base_diffuse_roughness: Scalar = fraction("r_d", 0.0, (0.05, 0.5), "roughness of the diffuse part")
    specular_color: Spectrum = param(
        0.0, 1.0, symbol="t", per_channel=True, default=1.0, starts=(0.95,), doc="tint of the specular part"
    )
    specular_ior: Scalar = param(
        1.0, 20.0, symbol="η", scale="log", default=1.5, starts=(1.5, 3.0), doc="refractive index"
    )
    specular_roughness: Scalar = roughness()

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """The dielectric and the metal, mixed."""
        p, alpha = pair(wi, wo), self.specular_roughness**2
        slopes = alpha, alpha
        mirror = GGX().density(p.h, slopes) * visibility(GGX(), "correlated", slopes, p) / 4.0
        more = lost(wo[2], alpha)
        glossy = dielectric(p.cos_d, self.specular_ior)
        kept = 1.0 + glossy * more
        a, b = albedo(jnp.clip(wo[2], COS_MIN, 1.0), alpha)
        through = 1.0 - (f0_from_eta(self.specular_ior) * a + b) * kept
        below = RoughDiffuse(self.base_color, self.base_diffuse_roughness)(wi, wo)
        coated = self.specular_color * glossy * mirror * kept + through * below
        dip = schlick(COS_82, self.base_color) * (1.0 - self.specular_color) / (COS_82 * (1.0 - COS_82) ** 6)
        metal = schlick(p.cos_d, self.base_color) - dip * p.cos_d * (1.0 - p.cos_d) ** 6
        bare = metal * mirror * (1.0 + metal * more)
        mixed = (1.0 - self.base_metalness) * coated + self.base_metalness * bare
        return jnp.where(above(wi, wo), mixed, 0.0)

    def width(self) -> Scalar:
        """α."""
        return self.specular_roughness**2


def template(channels: int) -> tuple[OpenPBR, list[dict[str, float]]]:
    """The model with so many channels, and what of it is held: as a metal, and as a dielectric."""
    given: dict[str, Any] = {"base_color": np.full(channels, 0.5), "specular_color": np.full(channels, 1.0)}
    metal = {"base_metalness": 1.0, "base_diffuse_roughness": 0.0, "specular_ior": 1.5}
    return OpenPBR(**given), [metal, {"base_metalness": 0.0}]
