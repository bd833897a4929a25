"""Ablation: which of the microfacet lobe's terms make an empirical model differ from it, and at which incidence.

Blinn–Phong is the microfacet lobe F D G/(4 c_i c_o) with F constant, G/(c_i c_o) = 1 and D a cosine power. Each term is
replaced in turn and the distance measured again. Nothing is fitted again, and the falls do not add up: a product of two
terms that both rise towards grazing comes down without either.
"""

import dataclasses
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from fitmat._types import Scalar, Spectrum, Vec3
from fitmat.match.distances import ANGLES, PairedDraws
from fitmat.match.regions import GRAZING_DEG
from fitmat.maths.quadrature import lobe_rules
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF, Sum
from fitmat.models.conversion import exponent_from_alpha
from fitmat.models.lobes.cook_torrance import CookTorrance
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.lobes.walter import Walter
from fitmat.models.terms.distributions import AbstractDistribution, Beckmann, Slopes
from fitmat.models.terms.fresnel import AbstractFresnel
from fitmat.models.values import Draws, blocks, channel_mean, surfaces, widths
from fitmat.text import brief
from fitmat.uncertainty.estimate import Estimate, band, estimates

TERMS = {
    "fresnel": "no Fresnel term",
    "masking": "no masking and foreshortening G/(cosθ_i cosθ_o)",
    "tail": "no long tail",
    "all": "none of the three",
}
"""What is replaced → what an empirical lobe lacks."""

NODES = (40, 16)
"""Of the quadrature over ω_o, in zenith and azimuth: falls are then right to 0.01."""

GRAZING = ANGLES[np.deg2rad(GRAZING_DEG) < ANGLES]
"""Incidences of which the verdict of a match says why light is missing."""

EXPLAINS = 0.2
"""A term is named as the cause where the distance falls by at least this fraction without it."""


class ConstantFresnel(AbstractFresnel):
    """A Fresnel term held at its normal incidence.

    F(c) = F(1) of the term within.
    """

    suffix: ClassVar[str] = "-constant"
    within: AbstractFresnel

    def __call__(self, cos_d: Scalar) -> Spectrum:
        """Reflectance at normal incidence, whatever the angle."""
        del cos_d
        return self.normal_reflectance()

    def normal_reflectance(self) -> Spectrum:
        """That of the term within."""
        return self.within.normal_reflectance()


class ImplicitMasking(AbstractDistribution):
    """A distribution whose separable masking is G = c_i c_o, that of every lobe written without one.

    With 1 + Λ = 1/c the masked cosine is 1, and G/(c_i c_o) = 1 ("implicit" in B. Karis, Real shading in Unreal Engine
    4, SIGGRAPH course 2013). G = 1 would be another thing: it keeps 1/(c_i c_o), which no empirical lobe has.
    """

    label: ClassVar[str] = "implicit"
    within: AbstractDistribution

    def density(self, h: Vec3, slopes: Slopes) -> Scalar:
        """That of the distribution within."""
        return self.within.density(h, slopes)

    def masked_cos(self, w: Vec3, slopes: Slopes) -> Scalar:
        """1."""
        return jnp.ones_like(w[2])


class CosinePower(AbstractDistribution):
    """Blinn's distribution with the peak of the one within, whose masking it keeps.

    D = (n+2)/(2π) c_hⁿ with n = 2/α² − 2 (Walter et al. 2007, eq. 30 and sec. 5.2), along and across the tangent of an
    anisotropic surface as Ashikhmin & Shirley 2000 have it, with √((n_x+2)(n_y+2)) in front.
    """

    label: ClassVar[str] = "cosine-power"
    within: AbstractDistribution

    def density(self, h: Vec3, slopes: Slopes) -> Scalar:
        """√((n_x+2)(n_y+2))/(2π) c_hⁿ, n = n_x cos²φ_h + n_y sin²φ_h."""
        nx, ny = (exponent_from_alpha(alpha) for alpha in slopes)
        across = h[0] ** 2 + h[1] ** 2
        share = jnp.where(across > 0.0, h[0] ** 2 / jnp.where(across > 0.0, across, 1.0), 0.5)
        n = ny + (nx - ny) * share
        return jnp.sqrt((nx + 2.0) * (ny + 2.0)) / (2.0 * jnp.pi) * jnp.maximum(h[2], 1e-300) ** n

    def masked_cos(self, w: Vec3, slopes: Slopes) -> Scalar:
        """That of the distribution within."""
        return self.within.masked_cos(w, slopes)


@dataclasses.dataclass(frozen=True, eq=False)
class Ablation:
    """What the difference of two models owes to each term of the microfacet lobe.

    Attributes:
        theta_i: Incidence, radians, (k,).
        distance: √(∫ (f_P − f_M)² c_o / ∫ f_M² c_o) at each incidence, rows low, best, high, (3, k).
        fall: Term of `TERMS` → fraction by which the distance falls without it, (3, k); negative where it grows.
        near: The same over incidences up to `GRAZING_DEG`, weighted with cosθ_i sinθ_i; empty where none was asked.
        grazing: The same beyond.
    """

    theta_i: Float[np.ndarray, " k"]
    distance: Float[np.ndarray, "3 k"]
    fall: dict[str, Float[np.ndarray, "3 k"]]
    near: dict[str, Estimate]
    grazing: dict[str, Estimate]

    __repr__ = brief

    def causes(self, where: dict[str, Estimate]) -> tuple[str, ...]:
        """The terms without which the distance certainly falls by `EXPLAINS` or more, the strongest first.

        Args:
            where: `near` or `grazing`.
        """
        single = [term for term in where if term != "all" and where[term].ci95[0] > 0.0]
        return tuple(sorted((t for t in single if where[t].value >= EXPLAINS), key=lambda t: -where[t].value))


def can_ablate(model: AbstractBRDF) -> bool:
    """Whether the model has a microfacet lobe whose terms can be replaced one by one."""
    return ablated(model, "all") is not surface(model)


def ablated(model: AbstractBRDF, term: str) -> AbstractBRDF:
    """The model's surface with a term of `TERMS` replaced in its microfacet lobes; the same object where it has none.

    Args:
        model: From `fitmat.model`, or as an instrument shows it.
        term: "fresnel", "masking", "tail", or "all".
    """
    return _replaced(surface(model), tuple(TERMS)[:3] if term == "all" else (term,))


def _replaced(model: AbstractBRDF, terms: tuple[str, ...]) -> AbstractBRDF:
    if isinstance(model, Sum):
        lobes = tuple(_replaced(lobe, terms) for lobe in model.lobes)
        same = all(one is other for one, other in zip(lobes, model.lobes, strict=True))
        return model if same else Sum(lobes)
    lobe = _microfacet(model)
    if lobe is None:
        return model
    fresnel, distribution, masking = lobe.fresnel, lobe.distribution, lobe.masking
    if "fresnel" in terms:
        fresnel = ConstantFresnel(fresnel)
    if "tail" in terms:
        distribution = CosinePower(distribution)
    if "masking" in terms:
        distribution, masking = ImplicitMasking(distribution), "separable"
    return Microfacet(lobe.ks, lobe.roughness, fresnel, distribution, masking)


def _microfacet(lobe: AbstractBRDF) -> Microfacet | None:
    """The lobe as F D G/(4 c_i c_o) where it is one."""
    if isinstance(lobe, Walter):
        return Microfacet(lobe.ks, lobe.roughness, lobe.fresnel, lobe.distribution, "separable")
    if isinstance(lobe, CookTorrance):
        return Microfacet(4.0 * lobe.ks, lobe.roughness, lobe.fresnel, Beckmann(), lobe.masking)
    return lobe if isinstance(lobe, Microfacet) else None


class Ablated(AbstractBRDF):
    """A model without each term of `TERMS` in turn: the values of all channels without the first, then the next."""

    within: AbstractBRDF

    @property
    def name(self) -> str:
        """That of the whole model."""
        return self.within.name

    def __call__(self, wi: Vec3, wo: Vec3) -> Spectrum:
        """(t c) values."""
        return jnp.concatenate([jnp.atleast_1d(ablated(self.within, term)(wi, wo)) for term in TERMS])

    def width(self) -> Scalar:
        """That of the whole model."""
        return self.within.width()

    @property
    def isotropic(self) -> bool:
        """Where the whole model is."""
        return self.within.isotropic


def ablate(
    empirical: AbstractBRDF,
    microfacet: AbstractBRDF,
    draws: PairedDraws,
    theta_i: Float[np.ndarray, " k"] = ANGLES,
) -> Ablation | None:
    """How far the distance falls when the microfacet model loses its terms; None where it has none to lose.

    Args:
        empirical: Its shapes and static choices.
        microfacet: The same.
        draws: Parameters of both, the best fits first, then draws.
        theta_i: Incidences, radians, of `ANGLES`.
    """
    if not can_ablate(microfacet):
        return None
    squares, norm = _squares(surfaces(empirical, draws[0]), surfaces(microfacet, draws[1]), theta_i)

    def falls(weight: np.ndarray) -> np.ndarray:
        """Of every draw and term, over incidences weighted by the columns of a matrix."""
        distance = np.sqrt(squares @ weight)
        return 1.0 - distance[:, 1:] / np.maximum(distance[:, :1], 1e-300)

    def over(part: np.ndarray) -> dict[str, Estimate]:
        found = falls((light * part)[:, None])[..., 0] if part.any() else np.zeros((len(squares), 0))
        return dict(zip(TERMS, estimates(found), strict=True)) if part.any() else {}

    each = falls(np.eye(len(theta_i)))
    light, far = np.cos(theta_i) * np.sin(theta_i), np.deg2rad(GRAZING_DEG) < theta_i
    return Ablation(
        theta_i=theta_i,
        distance=band(np.sqrt(squares[:, 0] / norm)),
        fall={term: band(each[:, k]) for k, term in enumerate(TERMS)},
        near=over(~far),
        grazing=over(far),
    )


def _squares(
    empirical: Draws, microfacet: Draws, theta_i: Float[np.ndarray, " k"]
) -> tuple[Float[np.ndarray, "d t k"], Float[np.ndarray, "d k"]]:
    """∫ (f_P − f)² c_o of the whole microfacet model and without each term, and ∫ f_M² c_o, channel means."""
    model, draws = microfacet
    parts = [empirical, microfacet, (Ablated(model), draws)]
    isotropic = empirical[0].isotropic and model.isotropic
    narrowest = min(widths(*empirical).min(), widths(*microfacet).min())
    rules, count = lobe_rules(theta_i, narrowest, isotropic=isotropic, nodes=NODES), len(theta_i)
    turns = len(rules) // count
    squares, norm = np.zeros((len(draws), 1 + len(TERMS), count)), np.zeros((len(draws), count))
    for rows, k, (f, whole, without) in blocks(parts, [(rule.wi, rule.wo) for rule in rules]):
        place, share = k // turns, rules[k].weight / turns
        without = without.reshape(*without.shape[:2], len(TERMS), -1)
        apart = channel_mean((f[:, :, None] - np.concatenate([whole[:, :, None], without], axis=2)) ** 2)
        squares[rows, :, place] += np.einsum("dmt,m->dt", apart, share)
        norm[rows, place] += channel_mean(whole**2) @ share
    return squares, norm
