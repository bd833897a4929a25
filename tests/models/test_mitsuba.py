"""Reflection pair by pair against Mitsuba 3.9, scalar and single precision, which shares no code with fitmat.

Measured, worst relative differences (12,000 pairs per roughness, half of them with normals drawn from D, half
uniform; "grazing": a direction within 3° of the horizon). They are rounding.

========================================  ==========  =========  =======
model                                     pairs       elsewhere  grazing
========================================  ==========  =========  =======
rough conductor, GGX, alpha 0.1–1         36,000      4·10⁻⁶     1·10⁻⁵
rough conductor, Beckmann, alpha 0.1–1    36,000      2·10⁻⁶     1·10⁻⁵
rough conductor, GGX anisotropic          36,000      4·10⁻⁶     3·10⁻⁵
rough conductor, Beckmann anisotropic     36,000      4·10⁻⁶     3·10⁻⁵
rough dielectric, reflection, GGX         36,000      5·10⁻⁶     2·10⁻⁵
rough dielectric, reflection, Beckmann    36,000      3·10⁻⁶     2·10⁻⁵
rough plastic, the face alone             36,000      5·10⁻⁶     2·10⁻⁵
seven metals, the same index, 4 colours   7 × 12,000  < 1·10⁻⁵   < 10⁻⁴
========================================  ==========  =========  =======

Beckmann's differences are divided by 1 + tan²θ_h/α², by which its exponential multiplies the rounding of h. Below
alpha = 0.1 the differences grow like 1/alpha (2·10⁻⁵ at 0.03, 6·10⁻⁵ at 0.01): D multiplies the rounding of h, 6e-8,
by about 4/alpha, so single precision and not the model limits the comparison. `METALS`, `PLASTIC` and `RETURNED` hold
the numbers where two definitions or two sets of data are compared.
"""

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import ArrayLike
from oracles import rough_interface
from selection import always

import fitmat as fm
from fitmat.models.around.coat import RoughCoat
from fitmat.models.base import AbstractBRDF, evaluate_pairs
from fitmat.models.lobes.microfacet import Microfacet
from fitmat.models.parameters import vector, with_vector
from fitmat.models.refractive_index import index
from fitmat.models.terms.distributions import GGX, AbstractDistribution, Anisotropic, BeckmannRational, Isotropic
from fitmat.models.terms.fresnel import AbstractFresnel, Conductor, Dielectric

SINGLE = 1e-5
"""Relative; single precision, for alpha ≥ 0.1: D multiplies the rounding of h, 6e-8, by about 4/alpha."""

SINGLE_GRAZING = 1e-4
"""Within 3° of grazing, where ω_i + ω_o loses digits as well."""

CUT = 1e-19
"""sr⁻¹; Mitsuba sets D c_h below 1e-20 to 0, which only Beckmann's tail reaches."""

SLOPE = 1e-3
"""Relative to |f/p|; differences of single-precision values (1e-6) over 4 % of p, and their h⁴."""

SUMS = 5e-6
"""Relative; Mitsuba adds 1,024 or 16,384 weighted single-precision numbers to get T and R."""

RULE = 5e-4
"""Relative; what Mitsuba's 32 by 32 Gauss rule is off in T, the integrand having a kink along the disk's diagonals."""

ENTERING = 1e-3
"""Absolute; the albedo of the face by 12 by 12 visible normals at 24 cosines, eta 1.5."""

MEASURED = 0.1
"""Relative; how far a stated difference may be from the one found."""

METALS = {"Au": 0.084, "Ag": 0.07, "Cu": 0.051, "Al": 0.011, "Cr": 0.21, "Mo": 0.039, "W": 0.002}
"""Worst relative difference of f at 450, 530, 580 and 650 nm: fitmat's index data against those that Mitsuba ships.

Of the index alone: with Mitsuba's own spectra put into fitmat the values agree to single precision.
"""

PLASTIC = {0.03: 0.028, 0.1: 0.16, 0.3: 0.44, 1.0: 3.2}
"""alpha → worst relative difference of the whole BRDF of rough plastic up to 78°, eta 1.5, kd 0.5, by definition.

Mitsuba lets enter what one facet transmits unmasked and returns to the body what one facet reflects; the rest is lost.
In fitmat all enters that the face does not reflect, and all returns that does not leave.
"""

RETURNED = {0.03: (0.583, 0.596), 0.1: (0.552, 0.590), 0.3: (0.415, 0.579), 1.0: (0.117, 0.564)}
"""alpha → the share R of diffuse light that the underside returns, eta 1.5: Mitsuba's and fitmat's."""

ETA = 1.5
Vectors = np.ndarray


@dataclasses.dataclass(frozen=True)
class Lobe:
    """Statistics of micro-normals under both names; the tangent is turned by `turn` degrees."""

    distribution: Literal["ggx", "beckmann"]
    alpha_x: float
    alpha_y: float
    turn: float = 0.0

    @property
    def slopes(self) -> Vectors:
        """(2,)."""
        return np.array([self.alpha_x, self.alpha_y])

    def ours(self, fresnel: AbstractFresnel) -> Microfacet:
        """With the separable masking of Mitsuba and, for Beckmann, Walter's rational G1."""
        normals: AbstractDistribution = GGX() if self.distribution == "ggx" else BeckmannRational()
        even = self.alpha_x == self.alpha_y
        alphas = jnp.array(self.alpha_x), jnp.array(self.alpha_y)
        rough = Isotropic(alphas[0]) if even else Anisotropic(*alphas, jnp.array(self.turn))
        return Microfacet(jnp.ones(()), rough, fresnel, normals, "separable")

    def plugin(self, kind: str, **options: object) -> dict[str, object]:
        """The dictionary that Mitsuba loads; only the conductor can be anisotropic."""
        alphas = {"alpha_u": self.alpha_x, "alpha_v": self.alpha_y} if self.turn else {"alpha": self.alpha_x}
        return {"type": kind, "distribution": self.distribution, **alphas, **options}

    def squared_slope(self, wi: Vectors, wo: Vectors) -> np.ndarray:
        """tan²θ_h/α² of the half vector, (n,)."""
        h = wi.astype(np.float64) + wo
        return np.sum((h[:, :2] / self.slopes / h[:, 2:]) ** 2, axis=1)


def _uniform(rng: np.random.Generator, number: int) -> Vectors:
    """Directions above the surface, uniform in solid angle."""
    cos, phi = rng.uniform(size=number), rng.uniform(0, 2 * np.pi, number)
    return np.stack([np.sqrt(1 - cos**2) * np.cos(phi), np.sqrt(1 - cos**2) * np.sin(phi), cos], axis=1)


def _pairs(lobe: Lobe, number: int = 6000) -> tuple[Vectors, Vectors]:
    """2·number pairs in the frame of the tangent, single precision: normals drawn from D, then uniform pairs."""
    rng = np.random.default_rng(7)
    wi, (u, phi) = _uniform(rng, 4 * number), rng.uniform(size=(2, 4 * number))
    slope = np.sqrt(u / (1 - u) if lobe.distribution == "ggx" else -np.log1p(-u))
    flat = slope[:, None] * lobe.slopes * np.stack([np.cos(2 * np.pi * phi), np.sin(2 * np.pi * phi)], axis=1)
    h = np.column_stack([flat, np.ones_like(u)]) / np.sqrt(1 + np.sum(flat**2, axis=1, keepdims=True))
    cos_d = np.sum(wi * h, axis=1, keepdims=True)
    wo = 2 * cos_d * h - wi
    kept = (wo[:, 2] > 0) & (cos_d[:, 0] > 0)
    uniform = _uniform(rng, number), _uniform(rng, number)
    wi, wo = (np.concatenate([w[kept][:number], u]) for w, u in zip((wi, wo), uniform, strict=True))
    return wi.astype(np.float32), wo.astype(np.float32)


def _theirs(
    mi: ModuleType, plugin: dict[str, object], wi: Vectors, wo: Vectors, nm: tuple[float, ...] = ()
) -> np.ndarray:
    """f·cosθ_o of Mitsuba, (n,), or (n, 4) at four wavelengths."""
    bsdf, context, point = mi.load_dict(plugin), mi.BSDFContext(), mi.SurfaceInteraction3f()
    if nm:
        point.wavelengths = list(nm)
    values = []
    for i, o in zip(wi.tolist(), wo.tolist(), strict=True):
        point.wi = i
        value = bsdf.eval(context, point, o)
        values.append([value[k] for k in range(4)] if nm else value[0])
    return np.array(values)


def _exact(w: Vectors, turn: float = 0.0) -> Vectors:
    """The rounded directions, normalised, from the frame of the tangent to that of the measurement."""
    x, y, z = w.astype(np.float64).T / np.linalg.norm(w.astype(np.float64), axis=1)
    sin, cos = np.sin(np.deg2rad(turn)), np.cos(np.deg2rad(turn))
    return np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)


def _ours(model: AbstractBRDF, wi: Vectors, wo: Vectors, turn: float = 0.0) -> np.ndarray:
    """f·cosθ_o, one column per channel."""
    light, sensor = _exact(wi, turn), _exact(wo, turn)
    return fm.evaluate(model, light, sensor) * sensor[:, 2:]


def _metal(eta: ArrayLike, kappa: ArrayLike) -> Conductor:
    return Conductor(jnp.asarray(eta), jnp.asarray(kappa))


def _assert_single_precision(ours: np.ndarray, theirs: np.ndarray, lobe: Lobe, wi: Vectors, wo: Vectors) -> None:
    """As far as rounding allows, see the constants; where Mitsuba cuts D off, fitmat must be as faint."""
    cut = theirs == 0
    assert np.all(ours[cut] < CUT)
    assert np.count_nonzero(~cut) > 6000
    rounding = 1 + (lobe.squared_slope(wi, wo) if lobe.distribution == "beckmann" else 0)
    allowed = np.where(np.minimum(wi[:, 2], wo[:, 2]) < np.sin(np.deg2rad(3)), SINGLE_GRAZING, SINGLE) * rounding
    error = np.abs(ours / np.where(cut, 1, theirs) - 1) / (allowed * max(1, 0.1 / lobe.slopes.min()))
    assert np.max(error[~cut]) < 1, f"worst of allowed: {np.max(error[~cut]):.3g}"


SHAPES = [
    Lobe(distribution, *shape)
    for distribution in ("ggx", "beckmann")
    for shape in (
        (0.01, 0.01),
        (0.1, 0.1),
        (0.3, 0.3),
        (1.0, 1.0),
        (0.1, 0.4, 20.0),
        (0.5, 0.1, 35.0),
        (1.0, 0.3, -70.0),
    )
]


@pytest.mark.parametrize("lobe", SHAPES, ids=str)
def test_rough_conductor_agrees_with_mitsuba(mitsuba: ModuleType, lobe: Lobe) -> None:
    """Mitsuba's local frame has the tangent along x, ours is turned; the height-correlated form is told apart."""
    wi, wo = _pairs(lobe)
    theirs = _theirs(mitsuba, lobe.plugin("roughconductor", eta=1.5, k=2.9), wi, wo)
    model = lobe.ours(_metal(1.5, 2.9))
    _assert_single_precision(_ours(model, wi, wo, lobe.turn)[:, 0], theirs, lobe, wi, wo)
    correlated = dataclasses.replace(model, masking="correlated")
    with pytest.raises(AssertionError, match="worst of allowed"):
        _assert_single_precision(_ours(correlated, wi, wo, lobe.turn)[:, 0], theirs, lobe, wi, wo)


@pytest.mark.parametrize("lobe", [lobe for lobe in SHAPES if not lobe.turn], ids=str)
def test_reflection_of_rough_dielectric_agrees_with_mitsuba(mitsuba: ModuleType, lobe: Lobe) -> None:
    wi, wo = _pairs(lobe)
    theirs = _theirs(mitsuba, lobe.plugin("roughdielectric", int_ior=ETA, ext_ior=1.0), wi, wo)
    _assert_single_precision(_ours(lobe.ours(Dielectric(jnp.array(ETA))), wi, wo)[:, 0], theirs, lobe, wi, wo)


@pytest.mark.parametrize("distribution", ["ggx", "beckmann"])
def test_slopes_agree_with_mitsuba(mitsuba: ModuleType, distribution: Literal["ggx", "beckmann"]) -> None:
    """jax.jacrev in alpha, eta and kappa against five-point differences of Mitsuba's values.

    Left out: uniform pairs, and pairs whose differences straddle a = 1.6, where Walter's approximation jumps by 6e-5.
    """
    at = {"alpha": 0.3, "eta": 1.5, "k": 2.9}
    wi, wo = (w[:300] for w in _pairs(Lobe(distribution, 0.3, 0.3), 300))
    a = np.array([w[:, 2] / np.hypot(w[:, 0], w[:, 1]) / at["alpha"] for w in (wi, wo)])
    smooth = np.all(np.abs(a / 1.6 - 1) > 0.05, axis=0)
    wi, wo = wi[smooth], wo[smooth]
    model = Lobe(distribution, 0.3, 0.3).ours(_metal(1.5, 2.9))

    def one(values: jax.Array) -> jax.Array:
        sensor = _exact(wo)
        return evaluate_pairs(with_vector(model, values), jnp.array(_exact(wi)), jnp.array(sensor))[:, 0] * sensor[:, 2]

    slopes = jax.jit(jax.jacrev(one))(vector(model))
    for column, (name, value) in enumerate(at.items(), start=1):
        step = 0.02 * value
        plugins = [
            {"type": "roughconductor", "distribution": distribution, **at | {name: value + j * step}}
            for j in (-2, -1, 1, 2)
        ]
        f = [_theirs(mitsuba, plugin, wi, wo) for plugin in plugins]
        theirs = (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step)
        assert np.all(np.abs(slopes[:, column] - theirs) < SLOPE * (f[1] + f[2]) / 2 / value), name


@pytest.fixture
def spectral(mitsuba: ModuleType) -> Iterator[ModuleType]:
    """Mitsuba with four wavelengths at a time."""
    mitsuba.set_variant("scalar_spectral")
    yield mitsuba
    mitsuba.set_variant("scalar_rgb")


NM = (450.0, 530.0, 580.0, 650.0)


@pytest.mark.parametrize("metal", METALS)
def test_named_metals_agree_with_mitsuba(spectral: ModuleType, metal: str) -> None:
    """With Mitsuba's data (its .spd files, linear between rows) to single precision; with fitmat's as stated."""
    lobe = Lobe("ggx", 0.3, 0.3)
    wi, wo = _pairs(lobe)
    theirs = _theirs(spectral, lobe.plugin("roughconductor", material=metal), wi, wo, NM)
    folder = Path(str(spectral.__file__)).parent / "data" / "ior"
    same = [np.interp(NM, *np.loadtxt(folder / f"{metal}.{part}.spd").T) for part in ("eta", "k")]
    ours = _ours(lobe.ours(_metal(*same)), wi, wo)
    for k in range(len(NM)):
        _assert_single_precision(ours[:, k], theirs[:, k], lobe, wi, wo)
    known = index(metal, NM)
    difference = np.max(np.abs(_ours(lobe.ours(_metal(np.real(known), np.imag(known))), wi, wo) / theirs - 1))
    assert difference == pytest.approx(METALS[metal], rel=MEASURED, abs=5e-4)


def _plastic(alpha: float, kd: float, specular: float, *, nonlinear: bool = True) -> dict[str, object]:
    """Mitsuba's rough plastic; `specular` scales its face."""
    colours: dict[str, Any] = {
        f"{part}_reflectance": {"type": "rgb", "value": value}
        for part, value in (("diffuse", kd), ("specular", specular))
    }
    return Lobe("ggx", alpha, alpha).plugin("roughplastic", int_ior=ETA, ext_ior=1.0, nonlinear=nonlinear, **colours)


def _tables(mi: ModuleType, alpha: float) -> tuple[np.ndarray, float]:
    """T at the cosines of Mitsuba's table but the first, and its R, from values of its diffuse part."""
    along = np.stack([np.sqrt(1 - rough_interface.TABLE**2), 0 * rough_interface.TABLE, rough_interface.TABLE], axis=1)
    along = along[1:].astype(np.float32)
    black, white = (_theirs(mi, _plastic(alpha, kd, 0.0), along, along) / kd for kd in (0.01, 1.0))
    ratio = np.mean(white / black)  # (1 − 0.01 R)/(1 − R)
    returned = (ratio - 1) / (ratio - 0.01)
    return np.sqrt(black * (1 - 0.01 * returned) * np.pi * ETA**2 / along[:, 2]), float(returned)


def _coat(alpha: float) -> RoughCoat:
    return RoughCoat(jnp.array(ETA), jnp.array(alpha), jnp.zeros(()), "separable")


def _entering(alpha: float, cosines: np.ndarray) -> np.ndarray:
    """What fitmat lets enter the body."""
    return 1 - np.asarray(jax.jit(lambda c: _coat(alpha).reflectance()(c))(jnp.array(cosines)))


@pytest.mark.parametrize("alpha", always({0.3}, [0.1, 0.3, 1.0]))
def test_face_of_rough_plastic_agrees_with_mitsuba(mitsuba: ModuleType, alpha: float) -> None:
    """With a black body."""
    lobe = Lobe("ggx", alpha, alpha)
    wi, wo = _pairs(lobe)
    ours = _ours(fm.model("plastic", alpha=alpha, eta=ETA, kd=0.0, masking="separable"), wi, wo)[:, 0]
    _assert_single_precision(ours, _theirs(mitsuba, _plastic(alpha, 0.0, 1.0), wi, wo), lobe, wi, wo)


@pytest.mark.parametrize("alpha", always({0.3}, PLASTIC))
def test_fitmat_lets_enter_what_mitsuba_transmits_or_loses(mitsuba: ModuleType, alpha: float) -> None:
    """Mitsuba's T is its Gauss rule over visible normals to single precision; ours adds what is masked behind them."""
    theirs, _ = _tables(mitsuba, alpha)
    cosines, rule, fine = rough_interface.TABLE[1:], rough_interface.gauss(32), rough_interface.fine(200)
    np.testing.assert_allclose(theirs, [rough_interface.share(c, alpha, ETA, rule)[1] for c in cosines], rtol=SUMS)
    lost = [1 - sum(rough_interface.share(c, alpha, ETA, fine)) for c in cosines[::6]]
    np.testing.assert_allclose(_entering(alpha, cosines[::6]), theirs[::6] + lost, atol=ENTERING)


@pytest.mark.parametrize("alpha", always({0.3}, RETURNED))
def test_returned_light_of_rough_plastic_is_what_mitsuba_and_fitmat_define(mitsuba: ModuleType, alpha: float) -> None:
    """Mitsuba: the mean of R_1(c) c over its 64 cosines, doubled; R_1 of one scattering, from inside.

    That sum weighs c = 1 fully: it is 1.4 % below the integral. Fitmat: 1 − (1 − Ē)/eta², Ē the mean of what the face
    reflects from outside (Judd 1942).
    """
    _, theirs = _tables(mitsuba, alpha)
    cosines, rule = np.maximum(rough_interface.TABLE, 1e-6), rough_interface.gauss(128)
    reflected = [rough_interface.share(c, alpha, 1 / ETA, rule)[0] for c in cosines]
    assert theirs == pytest.approx(2 * np.mean(reflected * cosines), rel=SUMS)
    integral = 2 * np.trapezoid(reflected * cosines, cosines)
    assert theirs / integral == pytest.approx(1 - 0.014, abs=0.002)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    mirrored = [rough_interface.share((x + 1) / 2, alpha, ETA, rough_interface.fine(200))[0] for x in nodes]
    ours = float(_coat(alpha).layer().returned()[0])
    assert ours == pytest.approx(1 - (1 - weights @ (mirrored * (nodes + 1) / 2)) / ETA**2, rel=2e-3)
    assert (round(theirs, 3), round(ours, 3)) == pytest.approx(RETURNED[alpha], abs=0.002)


@pytest.mark.parametrize("alpha", always({0.3}, PLASTIC))
def test_rough_plastic_is_mitsubas_but_for_what_enters_and_returns(mitsuba: ModuleType, alpha: float) -> None:
    """Our body with Mitsuba's T and R in the place of ours is its body; then ours as it is."""
    lobe, kd = Lobe("ggx", alpha, alpha), 0.5
    wi, wo = _pairs(lobe)
    ci, co, (through, returned) = _exact(wi)[:, 2], _exact(wo)[:, 2], _tables(mitsuba, alpha)
    first = rough_interface.share(1e-6, alpha, ETA, rough_interface.gauss(32))[1]
    table, ours_returned = np.concatenate([[first], through]), float(_coat(alpha).layer().returned()[0])
    theirs_enter = np.interp(ci, rough_interface.TABLE, table) * np.interp(co, rough_interface.TABLE, table)
    exchanged = theirs_enter / (_entering(alpha, ci) * _entering(alpha, co))
    body, ours = (
        _ours(fm.model("plastic", alpha=alpha, eta=ETA, kd=kd, ks=ks, masking="separable"), wi, wo)[:, 0]
        for ks in (0.0, 1.0)
    )
    for nonlinear in (True, False):
        shared = exchanged * (1 - kd * ours_returned) / (1 - returned * (kd if nonlinear else 1))
        theirs = _theirs(mitsuba, _plastic(alpha, kd, 0.0, nonlinear=nonlinear), wi, wo)
        np.testing.assert_allclose(body * shared, theirs, rtol=3 * RULE)
    both = _theirs(mitsuba, _plastic(alpha, kd, 1.0), wi, wo)
    level = np.minimum(ci, co) > 0.2
    assert np.max(np.abs(ours / both - 1)[level]) == pytest.approx(PLASTIC[alpha], rel=MEASURED)
