"""The laws of reflection: which of them a model keeps, measured over its parameters and the closed hemisphere.

It measures; what a model is known to break, its class declares (`AbstractBRDF.breaks`).
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from fitmat.maths.directions import from_angles, mirror
from fitmat.maths.programs import program
from fitmat.models.albedo import albedo
from fitmat.models.base import AbstractBRDF, evaluate_pairs
from fitmat.models.lobes.kulla_conty import KullaConty
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.parameters import Entry, bounds, entries, vector, with_vector
from fitmat.models.registry import LOBES, OVER
from fitmat.models.terms.distributions import Isotropic
from fitmat.models.terms.fresnel import AbstractFresnel, White
from fitmat.models.values import values

LAWS = {
    "positive": "f ≥ 0 for all directions",
    "reciprocal": "f(ω_i, ω_o) = f(ω_o, ω_i)",
    "energy": "∫ f c_o dω_o, and the mirror image of a polished coat, ≤ 1 for light from anywhere, with all weights 1",
    "gradient": "value and gradient finite on the closed hemisphere, at every bound of the parameters",
    "furnace": "the same = 1 within 1 % where nothing absorbs, at alpha 0.5; covers over a base that keeps all light",
}
"""Law → what it says. Single scattering breaks the last, see `keeps_all`; the others are declared where broken."""

BASES = ("lambert", "ggx", "ggx-conductor")
"""What a cover is tried over: a diffuse base, a specular one and a metal."""

PARAMETER_SETS = 8
"""Sets of parameters that are tried, beside the defaults."""

PAIRS = 400
"""Pairs of directions that are tried, a quarter of them near the mirror direction."""

ANGLES = np.deg2rad([0.0, 30.0, 60.0, 75.0, 85.0, 89.9])
"""Incidence angles of the albedo."""

ROUNDING = 1e-9
"""Relative gap between the two directions that rounding explains."""

QUADRATURE = 2e-3
"""An albedo is above 1 only if by more than this and more than its error bound."""

FURNACE = 0.01

WHITE = {"ks": 1.0, "kd": 1.0, "base_color": 1.0, "metallic": 1.0, "depth": 0.0}
"""Parameters of a surface that absorbs nothing, as far as it has them."""

ROUGH = {"alpha": 0.5, "alpha_x": 0.5, "alpha_y": 0.5, "roughness": 0.7}


@dataclasses.dataclass(frozen=True)
class Finding:
    """One law and one model.

    Attributes:
        holds: Whether the model kept it.
        number: What was measured: the smallest value, the largest relative gap, the largest albedo, how many numbers
            were not finite, the albedo that is farthest from 1.
    """

    holds: bool
    number: float


def examples(name: str) -> tuple[str, ...]:
    """A lobe's name as models of their own: itself, or what covers a base over each of `BASES`."""
    return tuple(f"{name}{OVER}{base}" for base in BASES) if LOBES[name].kind == "cover" else (name,)


def keeps_all(name: str) -> bool:
    """Whether a lobe is meant to be a white furnace: some diffuse ones, those that give back what is lost, covers."""
    return name in ("lambert", "eon", "plastic") or "-kc" in name or LOBES[name].kind == "cover"


def check(template: AbstractBRDF, *, seed: int, furnace: Finding | None = None) -> dict[str, Finding]:
    """Measure every law on a model.

    Args:
        template: Gives the parameters and their bounds; its own values are tried first.
        seed: Of the directions and parameters that are drawn.
        furnace: What was found of a model that is the same one `white`; None where it is not known.

    Returns:
        Law → finding, in the order of `LAWS`.
    """
    rng = np.random.default_rng(seed)
    draws = _drawn(template, rng)
    smallest, gap = _signs(template, draws, *_pairs(rng))
    above = max(float(_reflected(with_vector(template, v), sure=True).max()) for v in draws)
    broken = unbounded(template)
    found = (
        Finding(bool(smallest >= 0), float(smallest)),
        Finding(bool(gap < ROUNDING), float(gap)),
        Finding(above < 1.0 + QUADRATURE, above),
        Finding(broken == 0, float(broken)),
        furnace or in_furnace(white(template)),
    )
    return dict(zip(LAWS, found, strict=True))


def in_furnace(model: AbstractBRDF) -> Finding:
    """The albedo that is farthest from 1."""
    found = _reflected(model, sure=False).ravel()
    worst = float(found[np.argmax(np.abs(found - 1.0))])
    return Finding(abs(worst - 1.0) < FURNACE, worst)


def _reflected(model: AbstractBRDF, *, sure: bool) -> Float[np.ndarray, "k c"]:
    """Albedo at `ANGLES` with the mirror image of a polished coat; less the error of its quadrature where `sure`."""
    found = albedo(model, ANGLES, goal=1.0)
    if type(model).mirror is AbstractBRDF.mirror:  # it has none
        return found.value - found.error * sure
    return found.value - found.error * sure + np.asarray(_mirror(model, from_angles(ANGLES, 0.0 * ANGLES)))


@program
def _mirror(model: AbstractBRDF, wi: Array) -> Array:
    return jax.vmap(lambda w: jnp.atleast_1d(model.mirror(w)))(wi)


def _range(entry: Entry) -> tuple[float, float]:
    """Where a parameter is drawn from: its bounds, or where its scale is log the range of its starts."""
    p = entry.param
    return (min(p.starts), max(p.starts)) if p.scale == "log" and p.starts else (p.lower, p.upper)


def _drawn(template: AbstractBRDF, rng: np.random.Generator) -> Float[np.ndarray, "d p"]:
    """Parameter vectors, weights 1: the defaults, all at the lower or upper end, then `PARAMETER_SETS` at random."""
    first = np.array(vector(template))
    rows = np.tile(first, (PARAMETER_SETS + 3, 1))
    for entry in entries(template):
        lower, upper = _range(entry)
        part = np.concatenate(
            [np.zeros((1, entry.size)), np.ones((1, entry.size)), rng.uniform(size=(PARAMETER_SETS, entry.size))]
        )
        if entry.param.weight:
            rows[:, entry.place] = min(1.0, entry.param.upper)
        elif entry.param.scale == "log":
            rows[1:, entry.place] = lower * (upper / lower) ** part
        else:
            rows[1:, entry.place] = lower + (upper - lower) * part
    return rows


def white(template: AbstractBRDF) -> AbstractBRDF:
    """The model with everything that can be white at white, and rough; facets below a cover lose nothing."""
    if isinstance(base := getattr(template, "base", None), AbstractBRDF):
        if isinstance(base, Microfacet) and isinstance(base.roughness, Isotropic):
            base = KullaConty(base.ks, base.roughness, base.fresnel, base.distribution, base.masking)
        template = dataclasses.replace(template, base=white(base))  # pyright: ignore[reportCallIssue]
    if isinstance(getattr(template, "fresnel", None), AbstractFresnel):
        template = dataclasses.replace(template, fresnel=White())  # pyright: ignore[reportCallIssue]
    whole = np.array(vector(template))
    for entry in entries(template):
        wanted = (WHITE | ROUGH).get(entry.name.rpartition(".")[2])
        if wanted is not None:
            whole[entry.place] = wanted
    return with_vector(template, whole)


def _pairs(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Directions uniform over the hemisphere, (PAIRS, 3) each; a quarter of the ω_o near the mirror direction."""
    cos, phi = rng.uniform(size=(2, 2 * PAIRS))
    sin = np.sqrt(1.0 - cos**2)
    wi, wo = np.split(np.stack([sin * np.cos(2 * np.pi * phi), sin * np.sin(2 * np.pi * phi), cos], axis=1), 2)
    near = mirror(wi) + 0.02 * rng.normal(size=wi.shape)
    near[:, 2] = np.abs(near[:, 2])
    wo[: PAIRS // 4] = (near / np.linalg.norm(near, axis=1, keepdims=True))[: PAIRS // 4]
    return wi, wo


def _signs(
    template: AbstractBRDF, draws: np.ndarray, wi: np.ndarray, wo: np.ndarray
) -> tuple[np.floating, np.floating]:
    """The smallest value, and the largest gap between the two directions relative to their sum."""
    there, back = (values(template, draws, *pair) for pair in ((wi, wo), (wo, wi)))
    smallest = np.minimum(there.min(), back.min())
    return smallest, np.max(np.abs(there - back) / (np.abs(there) + np.abs(back) + 1e-30))


def singular() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Where formulas of reflection divide by zero or take the root of zero: name → (ω_i, ω_o)."""

    def at(cos: float, phi: float) -> np.ndarray:
        sin = np.sqrt(1.0 - cos**2)
        return np.array([sin * np.cos(phi), sin * np.sin(phi), cos])

    normal, oblique, flat, almost = at(1, 0), at(0.6, 1.0), at(0, 0.3), at(1e-12, 0.3)
    return {
        "normal incidence": (normal, oblique),
        "both along the normal": (normal, normal),
        "retro-reflection": (oblique, oblique),
        "mirror, h = n": (oblique, mirror(oblique)),
        "light at cos 0": (flat, oblique),
        "light at cos 1e-12": (almost, oblique),
        "sensor at cos 1e-12": (oblique, almost),
        "both at cos 1e-12, forward": (almost, mirror(almost)),
        "both at cos 1e-12, backward": (almost, almost),
        "both at cos 1e-12, across": (almost, at(1e-12, 1.9)),
        "wi = -wo at the horizon": (flat, -flat),
        "wi = -wo": (oblique, -oblique),
        "nearly the normal": (normal, at(1 - 1e-15, 2.0)),
        "nearly retro-reflection": (oblique, at(0.6 + 1e-9, 1.0)),
        "nearly the mirror": (oblique, at(0.6, 1.0 + np.pi + 1e-9)),
    }


def unbounded(template: AbstractBRDF) -> int:
    """How many values and slopes are not finite, at the singular pairs and the corners of the parameters.

    Slopes in all parameters and both directions; corners are all parameters at a lower or upper bound, and each
    alone at either with the rest as given. Values and slopes in parameters are summed over the pairs, as one that is
    not finite makes a sum that is not; so that what a coat exchanges with its base is solved once a corner.
    """
    ends, given = bounds(template), np.asarray(vector(template))
    rows = list(ends)
    for k in range(len(given)):
        rows += [np.where(np.arange(len(given)) == k, bound, given) for bound in ends]
    wi, wo = (np.array(column) for column in zip(*singular().values(), strict=True))
    return int(_not_finite(template, np.array(rows), wi, wo))


@program
def _not_finite(template: AbstractBRDF, values: Array, wi: Array, wo: Array) -> Array:
    def total(v: Array, a: Array, b: Array) -> Array:
        return jnp.sum(evaluate_pairs(with_vector(template, v), a, b))

    def corner(v: Array) -> Array:
        found = jax.value_and_grad(total, argnums=(0, 1, 2))(v, wi, wo)
        return sum((jnp.sum(~jnp.isfinite(leaf)) for leaf in jax.tree.leaves(found)), jnp.array(0))

    return jnp.sum(jax.lax.map(corner, values))
