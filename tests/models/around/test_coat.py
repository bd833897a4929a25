"""Coats against Mitsuba's smooth plastic, closed forms of internal reflection, scipy's quadrature, and by hand."""

import functools
from types import ModuleType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import ggx
from scipy.integrate import quad
from selection import always

import fitmat as fm
from fitmat.errors import ModelError
from fitmat.fitting.coordinates import coordinates
from fitmat.maths.programs import UNFUSED
from fitmat.models.albedo import albedo
from fitmat.models.around.coat import RoughCoat, SmoothCoat
from fitmat.models.around.face import face_albedo
from fitmat.models.around.varnish import Varnish
from fitmat.models.base import evaluate_pairs
from fitmat.models.lobes.lambert import Lambert
from fitmat.models.parameters import entries, vector, with_vector
from fitmat.models.terms.fresnel import Dielectric, average_inside

SINGLE = 1e-6
"""Relative; Mitsuba's single precision, a dozen operations of 6e-8; its approximation of R is divided out."""

SINGLE_GRAZING = 5e-7
"""Relative, over the smaller cosine c: 1 − F ∝ c is the difference of two numbers near 1."""

CLOSED = 1e-9
"""Relative; Gauss nodes on a smooth integrand against a closed form, eta ≥ 1.1."""

NEAR_ONE = 1e-5
"""Absolute; at eta = 1.0001 almost all of F lies within 1° of grazing."""

ABSORBED = 5e-6
"""Absolute; exp(−2τ/c) is not smooth at c = 0, which a small τ brings out."""

EXACT = 1e-12
"""Relative; the same formula written twice in double precision."""

SOLVED = 1e-9
"""Relative; the same linear equations, solved for one or three channels: rounding of 2.2e-16 times a condition of up to
1e6 (`exchange.TRAPPED`), in another order on each kind of processor."""

ROUNDING = 1e-7
"""Relative; at eta = 1 the half vector of refracted directions is rounded differently."""

FACE = 6e-4
"""Absolute, alpha ≥ 0.001 and eta ≤ 1.5; 12 by 12 visible normals at 24 cosines."""

FACE_DENSE = 1.5e-3
"""The same at eta 3."""

CURVE = 1e-3
"""Relative; the albedo of the face is a polynomial in √c, and its quadrature is off by 1e-4."""

FURNACE = 1e-6
"""Absolute; 200 Gauss nodes in √c for the light that leaves a smooth coat."""

DIFFERENCES = 1e-6
"""Relative to |∂f/∂p| + |f|/p; five-point differences with steps of p/10⁴."""

WHITE = 2e-3
"""Absolute; the quadrature of the face's albedo and that of `albedo`."""

AIR: dict[str, Any] = {"varnish.eta": 1.0}
"""The coat's own index, not that of the base."""

Hemisphere = Any
Pairs = dict[str, tuple[np.ndarray, np.ndarray]]


def _single(w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rounded to single precision, and the same normalised in double."""
    rounded = w.astype(np.float32)
    exact = rounded.astype(np.float64)
    return rounded, exact / np.linalg.norm(exact, axis=1, keepdims=True)


def _mitsuba(mi: ModuleType, wi: np.ndarray, wo: np.ndarray, eta: float, kd: float, nonlinear: bool) -> np.ndarray:
    """f·cosθ_o of the plugin `plastic` away from its mirror direction."""
    colour = {"type": "rgb", "value": kd}
    plugin = {"type": "plastic", "int_ior": eta, "ext_ior": 1.0, "nonlinear": nonlinear, "diffuse_reflectance": colour}
    bsdf, context, point = mi.load_dict(plugin), mi.BSDFContext(), mi.SurfaceInteraction3f()
    values = []
    for i, o in zip(wi.tolist(), wo.tolist(), strict=True):
        point.wi = i
        values.append(bsdf.eval(context, point, o)[0])
    return np.array(values)


def _egan_hilgeman(eta: float) -> float:
    """R from inside as Mitsuba approximates it: Egan & Hilgeman 1973, in Donner & Jensen's form, off by 1e-3."""
    return -1.4399 / eta**2 + 0.7099 / eta + 0.6681 + 0.0636 * eta


def _closed(eta: float) -> float:
    """F_avg from outside, J. W. T. Walsh 1926 as printed by D. B. Judd, J. Res. NBS 29, 1942, eq. 1."""
    n, n2 = eta, eta**2
    first = 0.5 + (n - 1) * (3 * n + 1) / (6 * (n + 1) ** 2)
    second = n2 * (n2 - 1) ** 2 / (n2 + 1) ** 3 * np.log((n - 1) / (n + 1))
    third = 2 * n**3 * (n2 + 2 * n - 1) / ((n2 + 1) * (n2**2 - 1))
    fourth = 8 * n2**2 * (n2**2 + 1) / ((n2 + 1) * (n2**2 - 1) ** 2) * np.log(n)
    return first + second - third + fourth


def _inside(cos: float, eta: float) -> float:
    """Fresnel reflectance from inside, by Snell's law."""
    sin = eta * np.sqrt(1 - cos**2)
    return 1.0 if sin >= 1 else float(ggx.fresnel(np.sqrt(1 - sin**2), eta))


def _returned(eta: float, depth: float = 0.0) -> float:
    """R of a smooth coat."""
    return float(SmoothCoat(jnp.array(eta), jnp.array(depth)).layer().returned()[0])


@pytest.mark.parametrize("nonlinear", [True, False])
@pytest.mark.parametrize("eta", always({1.5}, [1.1, 1.5, 1.9]))
def test_varnish_over_lambert_agrees_with_mitsuba(
    mitsuba: ModuleType, hemisphere: Hemisphere, eta: float, nonlinear: bool
) -> None:
    """12,000 pairs; Mitsuba's approximate R is divided out, and ours is as near to it as it claims."""
    (wi, light), (wo, sensor), kd = _single(hemisphere(12_000, 1)), _single(hemisphere(12_000, 2)), 0.7
    theirs, returned = _mitsuba(mitsuba, wi, wo, eta, kd, nonlinear), _returned(eta)
    ours = fm.evaluate(fm.model("varnish-over-lambert", kd=kd, eta=eta), light, sensor)[:, 0] * sensor[:, 2]
    ours *= (1 - kd * returned) / (1 - (kd if nonlinear else 1) * _egan_hilgeman(eta))
    allowed = SINGLE + SINGLE_GRAZING / np.minimum(wi[:, 2], wo[:, 2])
    assert np.max(np.abs(ours / theirs - 1) / allowed) < 1
    assert returned == pytest.approx(_egan_hilgeman(eta), abs=2e-3)


@pytest.mark.parametrize("eta", [1.01, 1.1, 1.5, 3.0])
def test_returned_light_is_walshs_closed_form(eta: float) -> None:
    """1 − (1 − F_avg)/η²; 0.5963 for eta 1.5 as in Judd's table (0.596)."""
    by_hand = 1 - (1 - _closed(eta)) / eta**2
    assert _returned(eta) == pytest.approx(by_hand, rel=CLOSED)
    assert float(average_inside(jnp.array(_closed(eta)), jnp.array(eta))) == pytest.approx(by_hand, rel=EXACT)
    assert eta != 1.5 or by_hand == pytest.approx(0.596, abs=5e-4)


@pytest.mark.parametrize("depth", [0.01, 0.1, 1.0, 10.0])
@pytest.mark.parametrize("eta", [1.0001, 1.1, 1.5, 3.0])
def test_returned_light_is_absorbed_on_both_passages(eta: float, depth: float) -> None:
    """2∫ R(c) exp(−2τ/c) c dc by scipy, split at the critical angle."""
    critical = np.sqrt(1 - 1 / eta**2)
    parts = [
        quad(lambda c: 2 * c * _inside(c, eta) * np.exp(-2 * depth / c), low, high, epsabs=1e-12, limit=200)[0]
        for low, high in ((1e-9, critical), (critical, 1.0))
    ]
    assert _returned(eta, depth) == pytest.approx(sum(parts), abs=ABSORBED)


@pytest.mark.parametrize("theta_i", [0.0, 45.0, 80.0, 89.0])
@pytest.mark.parametrize(("kd", "depth"), [(1.0, 0.0), (0.6, 0.0), (1.0, 0.2)])
def test_mirror_and_body_share_the_light(theta_i: float, kd: float, depth: float) -> None:
    """F(θ_i) by hand + ∫ f c dω: 1 where nothing absorbs, less elsewhere."""
    model, wi = (
        fm.model("varnish-over-lambert", kd=kd, depth=depth),
        np.array([np.sin(np.deg2rad(theta_i)), 0.0, np.cos(np.deg2rad(theta_i))]),
    )
    x, weights = np.polynomial.legendre.leggauss(200)
    cos = ((x + 1) / 2) ** 2
    wo = np.stack([np.sqrt(1 - cos**2), 0 * cos, cos], axis=1)
    values = fm.evaluate(model, np.tile(wi, (200, 1)), wo)[:, 0]
    body = 2 * np.pi * np.sum(weights * np.sqrt(cos) * cos * values)
    total = float(ggx.fresnel(wi[2], 1.5)) + body
    assert total == pytest.approx(1.0, abs=FURNACE) if kd == 1 and depth == 0 else total < 0.95


def test_absorption_by_hand() -> None:
    """Snell, Beer and Lambert for light at 60° and a sensor at 30°, eta 1.5, τ 0.3, kd 0.4; R by scipy."""
    eta, depth, kd = 1.5, 0.3, 0.4
    wi, wo = np.array([[np.sqrt(0.75), 0, 0.5]]), np.array([[0, 0.5, np.sqrt(0.75)]])
    inner = [np.sqrt(1 - sin2 / eta**2) for sin2 in (0.75, 0.25)]
    enter, leave = (1 - float(ggx.fresnel(np.array(c), eta)) for c in (0.5, np.sqrt(0.75)))
    beer = np.exp(-depth / inner[0]) * np.exp(-depth / inner[1])
    back = quad(lambda c: 2 * c * _inside(c, eta) * np.exp(-2 * depth / c), 1e-9, 1, points=[np.sqrt(5) / 3])[0]
    by_hand = enter * leave / eta**2 * beer * kd / (np.pi * (1 - kd * back))
    model = fm.model("varnish-over-lambert", kd=kd, eta=eta, depth=depth)
    assert fm.evaluate(model, wi, wo)[0, 0] == pytest.approx(by_hand, rel=ABSORBED)


@pytest.mark.parametrize("base", always({"lambert"}, ["lambert", "lambert+ggx-conductor", "ggx-aniso"]))
def test_a_coat_of_air_is_the_base(hemisphere: Hemisphere, base: str) -> None:
    """Eta = 1 and no absorption: nothing is bent, mirrored or lost."""
    wi, wo = hemisphere(300, 3), hemisphere(300, 4)
    coated = fm.evaluate(fm.model(f"varnish-over-{base}", **AIR), wi, wo)
    np.testing.assert_allclose(coated, fm.evaluate(fm.model(base), wi, wo), rtol=ROUNDING)


@pytest.mark.parametrize(
    "name",
    always(
        {"rough-varnish-over-lambert"},
        ["varnish-over-lambert+ggx", "rough-varnish-over-lambert", "varnish-over-rough-varnish-over-lambert"],
    ),
)
def test_coats_are_reciprocal(hemisphere: Hemisphere, name: str) -> None:
    wi, wo, model = hemisphere(200, 5), hemisphere(200, 6), fm.model(name, depth=0.2)
    np.testing.assert_allclose(fm.evaluate(model, wi, wo), fm.evaluate(model, wo, wi), rtol=1e-10)


@pytest.mark.parametrize(("eta", "allowed"), [(1.001, FACE), (1.5, FACE), (3.0, FACE_DENSE)])
def test_rough_face_reflects_what_visible_normals_do(eta: float, allowed: float) -> None:
    """The mean of F G2/G1 over Heitz's visible normals on a fine grid: what one facet reflects."""
    degrees = np.array([0.0, 45.0, 75.0, 85.0, 89.0])
    reflectance = jax.jit(lambda alpha, cos: face_albedo(alpha, Dielectric(jnp.array(eta)), "correlated")(cos))
    for alpha in (0.001, 0.03, 0.3, 1.0):
        expected = [ggx.albedo(theta, alpha, eta, 120) for theta in np.deg2rad(degrees)]
        ours = reflectance(jnp.array(alpha), jnp.cos(jnp.deg2rad(degrees)))
        np.testing.assert_allclose(ours, expected, atol=allowed)


@pytest.mark.study
def test_a_hardly_rough_coat_is_the_smooth_one(hemisphere: Hemisphere) -> None:
    """At alpha 0.001, away from grazing and from the mirror direction, whose lobe the smooth coat leaves out."""
    wi, wo = hemisphere(300, 7), hemisphere(300, 8)
    kept = (np.minimum(wi[:, 2], wo[:, 2]) > 0.1) & (np.linalg.norm((wi + wo)[:, :2], axis=1) > 0.3)
    smooth = fm.evaluate(fm.model("varnish-over-lambert", depth=0.1), wi[kept], wo[kept])
    rough = fm.evaluate(fm.model("rough-varnish-over-lambert", depth=0.1, alpha=1e-3), wi[kept], wo[kept])
    assert kept.sum() > 100
    np.testing.assert_allclose(rough, smooth, rtol=CURVE)


@pytest.mark.parametrize("masking", always({"correlated"}, ["correlated", "separable", "v-cavity"]))
def test_a_white_body_under_a_rough_coat_is_a_white_furnace(masking: Any) -> None:
    """What the face does not mirror enters, and all of it comes out again."""
    for alpha, eta in ((0.01, 1.5), (0.3, 1.5), (1.0, 1.5), (0.3, 2.5)):
        model = Varnish(RoughCoat(jnp.array(eta), jnp.array(alpha), jnp.zeros(()), masking), Lambert(jnp.ones(())))
        np.testing.assert_allclose(albedo(model, np.deg2rad([0.0, 60.0, 80.0, 85.0])).value, 1.0, atol=WHITE)


@pytest.mark.study
def test_rough_coats_of_air_vanish(hemisphere: Hemisphere) -> None:
    """Eta = 1 at any alpha, and nearly 1 away from grazing, where F is 1 however little eta exceeds 1."""
    wi, wo = hemisphere(100, 7), hemisphere(100, 8)
    for alpha in (0.001, 0.3, 1.0):
        air = fm.evaluate(fm.model("rough-varnish-over-lambert", eta=1.0, alpha=alpha, kd=0.5), wi, wo)
        np.testing.assert_allclose(air, 0.5 / np.pi, rtol=EXACT)
    kept = np.minimum(wi[:, 2], wo[:, 2]) > 0.1
    thin = fm.evaluate(fm.model("rough-varnish-over-lambert", eta=1.0001, alpha=0.3, kd=0.5), wi[kept], wo[kept])
    np.testing.assert_allclose(thin, 0.5 / np.pi, rtol=1e-3)


def test_absorption_is_per_channel(hemisphere: Hemisphere) -> None:
    """Column k of three depths is the model with depth k."""
    wi, wo, depth = hemisphere(20, 9), hemisphere(20, 10), np.array([0.0, 0.1, 0.7])
    name = "varnish-over-lambert+ggx-conductor"
    columns = fm.evaluate(fm.model(name, channels=3, depth=depth), wi, wo)
    single = [fm.evaluate(fm.model(name, depth=d), wi, wo)[:, 0] for d in depth]
    np.testing.assert_allclose(columns, np.stack(single, axis=1), rtol=SOLVED)


def test_covers_nest_from_the_outside_in(hemisphere: Hemisphere) -> None:
    model = fm.model("tilt-over-varnish-over-lambert", kd=0.4, depth=0.1)
    assert model.name == "tilt-over-varnish-over-lambert"
    wi, wo = hemisphere(50, 11), hemisphere(50, 12)
    inner = fm.model("varnish-over-lambert", kd=0.4, depth=0.1)
    np.testing.assert_allclose(fm.evaluate(model, wi, wo), fm.evaluate(inner, wi, wo), rtol=1e-9)
    assert [e.name for e in entries(model)] == ["eta", "depth", "kd", "tilt_x", "tilt_y"]


GRADIENTS = ["plastic", "rough-varnish-over-lambert", "varnish-over-ggx-schlick"]


@pytest.mark.parametrize("name", always({"plastic"}, [*GRADIENTS, "rough-varnish-over-lambert+ggx"]))
def test_gradients_are_finite_differences(hemisphere: Hemisphere, singular: Pairs, name: str) -> None:
    """By jacfwd in every parameter; finite at the singular pairs and at the bounds of the parameters."""
    model = fm.model(name) if name == "plastic" else fm.model(name, depth=0.3)
    special_i, special_o = (jnp.array(np.array(column)) for column in zip(*singular.values(), strict=True))
    wi, wo = jnp.array(hemisphere(15, 13)), jnp.array(hemisphere(15, 14))

    @functools.partial(jax.jit, compiler_options=UNFUSED)
    def both(point: jax.Array) -> tuple[jax.Array, jax.Array]:
        def values(point: jax.Array) -> tuple[jax.Array, jax.Array]:
            every = jnp.concatenate([wi, special_i]), jnp.concatenate([wo, special_o])
            found = evaluate_pairs(with_vector(model, point), *every)[:, 0]
            return found, found

        slopes, found = jax.jacfwd(values, has_aux=True)(point)
        return found, slopes

    bounds, point = coordinates(model), np.asarray(vector(model))
    for corner in (bounds.lower, bounds.upper):
        assert all(np.isfinite(part).all() for part in both(jnp.array(corner)))
    value, slopes = (np.asarray(part)[:15] for part in both(jnp.array(point)))
    for k, step in enumerate(1e-4 * point):
        at = [
            np.asarray(both(jnp.array(point + j * step * (np.arange(len(point)) == k)))[0])[:15] for j in (-2, -1, 1, 2)
        ]
        expected = (at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * step)
        assert np.all(np.abs(slopes[:, k] - expected) < DIFFERENCES * (np.abs(expected) + value / point[k])), k


def test_plastic_is_a_rough_coat_over_lambert(hemisphere: Hemisphere) -> None:
    """Ks scales the face alone; without a face (eta 1) plastic is its body."""
    wi, wo = hemisphere(60, 15), hemisphere(60, 16)
    plastic = fm.model("plastic", alpha=0.2, kd=0.4)
    face = fm.evaluate(fm.model("plastic", alpha=0.2, kd=0.0), wi, wo)
    coated = fm.evaluate(fm.model("rough-varnish-over-lambert", alpha=0.2, kd=0.4), wi, wo)
    np.testing.assert_allclose(fm.evaluate(plastic, wi, wo), coated, rtol=EXACT)
    tripled = fm.evaluate(fm.model("plastic", alpha=0.2, kd=0.4, ks=3.0), wi, wo)
    np.testing.assert_allclose(tripled - coated, 2 * face, rtol=1e-9, atol=1e-12)
    bare = fm.evaluate(fm.model("plastic", kd=0.4, eta=1.0), wi, wo)
    np.testing.assert_allclose(bare, 0.4 / np.pi, rtol=EXACT)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("varnish", r"model 'varnish': varnish needs a base, for example varnish-over-lambert\."),
        ("lambert+tilt", r"tilt needs a base, for example tilt-over-lambert\."),
        ("lambert-over-ggx", r"lambert cannot stand over a base; varnish, rough-varnish, tilt can\."),
        ("varnish-over-", r"no lobe ''; try lambert"),
        ("varnish-over-varnish-over-lambert", r"the same lobe twice cannot be told apart"),
    ],
)
def test_names_without_sense_are_refused(name: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        fm.model(name)
