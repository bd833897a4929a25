"""Fresnel reflectance against Mitsuba 3, textbooks and limits that are known exactly."""

from collections.abc import Callable
from types import ModuleType

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from fitmat.models.terms.fresnel import (
    COS_82,
    F82,
    AbstractFresnel,
    Conductor,
    Dielectric,
    Schlick,
    average,
    average_inside,
    conductor,
    dielectric,
    eta_from_f0,
    f0_f82_from_ior,
    f0_from_eta,
    f0_from_ior,
    hoffman,
    ior_from_tint,
    schlick,
    tint_from_ior,
)

MITSUBA = 1e-5
"""Relative; Mitsuba rounds to single precision (6e-8) at each of some ten steps."""

MITSUBA_GRAZING = 1e-4
"""Within 3° of grazing, where single precision loses digits in 1 − sin²."""

EXACT = 1e-13
"""Relative; a formula and its limit or inverse in double precision."""

DIFFERENCES = 1e-8
"""Relative; five-point differences of step h = 1e-3: h⁴ times the fifth derivative, and rounding 1e-16/h."""

QUADRATURE = 1e-12
"""Absolute; 32 nodes on an analytic integrand, for |η + iκ| up to 10 (the dip of a larger one is narrower)."""

INSIDE = 1e-9
"""Absolute; scipy's adaptive rule up to the critical angle, where F rises with infinite slope."""

ROUND_TRIP = 1e-10
"""Relative; κ² is a difference of two numbers some 1e3 times as large."""

METALS = {"silver": (0.20, 3.44), "aluminium": (1.44, 5.23), "iron": (2.93, 3.00), "black glass": (1.6, 0.01)}
"""η and κ; the first two of Born & Wolf, 7th ed., table 14.1, iron as Johnson & Christy 1974 at 589 nm."""


def _cosines_and_ior(number: int = 12_000) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Cosines uniform over (0, 1], η from 1.1 to 4, κ from 0.1 to 8, rounded to single precision."""
    rng = np.random.default_rng(3)
    draws = 1 - rng.uniform(size=number), rng.uniform(1.1, 4, number), rng.uniform(0.1, 8, number)
    cos, eta, kappa = (jnp.array(draw.astype(np.float32), float) for draw in draws)
    return cos, eta, kappa


def _tolerance(cos: jax.Array) -> jax.Array:
    return jnp.where(cos > np.cos(np.deg2rad(87)), MITSUBA, MITSUBA_GRAZING)


def _each(theirs: Callable[..., float], *arguments: jax.Array) -> np.ndarray:
    return np.array([theirs(*row) for row in zip(*(np.asarray(a).tolist() for a in arguments), strict=True)])


def test_dielectric_agrees_with_mitsuba(mitsuba: ModuleType) -> None:
    cos, eta, _ = _cosines_and_ior()
    theirs = _each(lambda c, e: mitsuba.fresnel(c, e)[0], cos, eta)
    assert np.all(np.abs(dielectric(cos, eta) / theirs - 1) < _tolerance(cos))


def test_dielectric_seen_from_inside_agrees_with_mitsuba(mitsuba: ModuleType) -> None:
    """η < 1: total reflection beyond the critical angle.

    Towards that angle F rises with infinite slope; single precision is no oracle in its last 1e-3 of cosine.
    """
    cos, eta, _ = _cosines_and_ior()
    inside = jnp.array((1 / eta).astype(jnp.float32), float)
    theirs = _each(lambda c, e: mitsuba.fresnel(c, e)[0], cos, inside)
    apart = jnp.abs(cos - jnp.sqrt(1 - inside**2)) > 1e-3
    ours = dielectric(cos, inside)
    assert np.all(np.abs(ours / theirs - 1)[apart] < MITSUBA)
    assert (np.asarray(ours) == 1).sum() > 1000


def test_conductor_agrees_with_mitsuba(mitsuba: ModuleType) -> None:
    cos, eta, kappa = _cosines_and_ior()
    theirs = _each(lambda c, e, k: mitsuba.fresnel_conductor(c, mitsuba.Complex2f(e, k)), cos, eta, kappa)
    assert np.all(np.abs(conductor(cos, eta, kappa) / theirs - 1) < _tolerance(cos))


@pytest.mark.parametrize(("eta", "f0"), [(1.5, 0.04), (4 / 3, 1 / 49), (2.0, 1 / 9), (1.0, 0.0)])
def test_published_reflectance_of_dielectrics(eta: float, f0: float) -> None:
    """((η−1)/(η+1))² by hand: glass, water, η = 2, nothing."""
    np.testing.assert_allclose(Dielectric(jnp.array(eta)).normal_reflectance(), f0, rtol=EXACT)
    np.testing.assert_allclose(dielectric(jnp.array(1.0), jnp.array(eta)), f0, rtol=EXACT)


@pytest.mark.parametrize(
    ("metal", "eta", "kappa", "reflectance"),
    [
        ("silver", 0.20, 3.44, 0.94),
        ("aluminium", 1.44, 5.23, 0.83),
        ("gold", 0.47, 2.83, 0.82),
        ("copper", 0.62, 2.57, 0.73),
    ],
)
def test_published_reflectance_of_metals(metal: str, eta: float, kappa: float, reflectance: float) -> None:
    """Born & Wolf, Principles of Optics, 7th ed., table 14.1 (589.3 nm), which prints R to two digits."""
    fresnel = Conductor(jnp.array(eta), jnp.array(kappa))
    np.testing.assert_allclose(fresnel.normal_reflectance(), reflectance, atol=0.005, err_msg=metal)
    np.testing.assert_allclose(fresnel(jnp.array(1.0)), fresnel.normal_reflectance(), rtol=EXACT)


def test_f0_and_eta_are_inverse() -> None:
    f0 = jnp.geomspace(1e-4, 0.999, 50)
    np.testing.assert_allclose(f0_from_eta(eta_from_f0(f0)), f0, rtol=EXACT)
    np.testing.assert_allclose(eta_from_f0(jnp.array(0.04)), 1.5, rtol=EXACT)


@pytest.mark.parametrize("eta", [1.1, 1.5, 4.0])
def test_brewster_angle(eta: float) -> None:
    """At tan θ = η no p light is reflected and R_s = ((η²−1)/(η²+1))²; F is half of that."""
    half_rs = 0.5 * ((eta**2 - 1) / (eta**2 + 1)) ** 2
    np.testing.assert_allclose(dielectric(jnp.cos(jnp.arctan(eta)), jnp.array(eta)), half_rs, rtol=EXACT)


def test_conductor_without_absorption_is_the_dielectric() -> None:
    cos, eta = jnp.linspace(0.0, 1.0, 101), jnp.array(1.5)
    np.testing.assert_allclose(conductor(cos, eta, jnp.array(0.0)), dielectric(cos, eta), rtol=EXACT)


@pytest.mark.parametrize("cos", [1.0, 0.5, 1e-3, 1e-9, 1e-12])
def test_equal_media_reflect_nothing(cos: float) -> None:
    """No interface; below cos 1e-8 the plain form η² + c² − 1 would round to 0 and mean total reflection."""
    assert dielectric(jnp.array(cos), jnp.array(1.0)) < 1e-30


def test_every_term_reflects_all_light_at_grazing() -> None:
    for fresnel in (
        Dielectric(jnp.array(1.5)),
        Conductor(jnp.array(0.2), jnp.array(3.4)),
        Schlick(jnp.array(0.04)),
        F82(jnp.array(0.5), jnp.array(0.6)),
    ):
        np.testing.assert_allclose(fresnel(jnp.array(0.0)), 1.0, rtol=EXACT)


def test_schlick_ends_and_middle() -> None:
    """F0 at the normal, 1 at grazing, and 0.04 + 0.96/32 = 0.07 at 60°, by hand."""
    at = [schlick(jnp.array(cos), jnp.array(0.04)) for cos in (1.0, 0.5, 0.0)]
    np.testing.assert_allclose(at, [0.04, 0.07, 1.0], rtol=EXACT)


def test_f82_by_hand() -> None:
    """F0 = F82 = 0.5: a = 0.5 (6/7)⁵/((1/7)(6/7)⁶) = 0.5·49/6, so F(½) = 0.5 + 0.5/32 − (49/12)/128."""
    at = [hoffman(np.array(cos), np.array(0.5), np.array(0.5)) for cos in (1.0, 0.5, 1 / 7, 0.0)]
    np.testing.assert_allclose(at, [0.5, 0.5 + 0.5 / 32 - 49 / 12 / 128, 0.5, 1.0], rtol=EXACT)


def test_f82_is_the_form_of_materialx() -> None:
    """`mx_fresnel_hoffman_schlick` of MaterialX, whose F82 is the ratio ("tint") to Schlick's value at c = 1/7."""
    cos, f0, tint = np.linspace(0.0, 1.0, 101), np.array(0.6), np.array(0.9)
    top = (1 / 7) * (1 - 1 / 7) ** 6
    at_82 = f0 * (1 - (1 - 1 / 7) ** 5) + (1 - 1 / 7) ** 5
    theirs = f0 * (1 - (1 - cos) ** 5) + (1 - cos) ** 5 - at_82 * (1 - tint) / top * cos * (1 - cos) ** 6
    np.testing.assert_allclose(hoffman(cos, f0, tint * at_82), theirs, rtol=EXACT)


def test_f82_is_schlick_where_its_value_is_schlicks() -> None:
    cos, f0 = np.linspace(0.0, 1.0, 101), np.array(0.3)
    np.testing.assert_allclose(hoffman(cos, f0, schlick(COS_82, f0)), schlick(cos, f0), rtol=EXACT)


def test_f82_is_cut_only_where_its_docstring_says() -> None:
    """Uncut below F0 + (1−F0)((6/7)⁵ + 5 (1/7)(6/7)⁶) and above (6/7)⁵ − 4 (1/7)(6/7)⁶, cut beyond."""
    fifth, peak = (6 / 7) ** 5, (1 / 7) * (6 / 7) ** 6
    cos, f0 = np.linspace(0.0, 1.0, 4001)[:, None], np.array([1e-4, 0.04, 0.5, 0.95])
    for offset, cut in ((-1e-3, False), (1e-3, True)):
        high = hoffman(cos[1:], f0, f0 + (1 - f0) * (fifth + 5 * peak + offset))
        assert np.all((high == 1).any(axis=0) == cut)
        low = hoffman(cos[:-1], f0[:1], np.array(fifth - 4 * peak - offset))
        assert np.all((low == 0).any(axis=0) == cut)


@pytest.mark.parametrize("metal", METALS)
def test_f82_and_f0_of_a_metal_are_those_of_the_exact_equations(metal: str) -> None:
    """Complex amplitudes, Born & Wolf sec. 1.5.2 with a complex index, at c = 1 and 1/7."""
    index = complex(*METALS[metal])
    f0, f82 = f0_f82_from_ior(*(np.array(v) for v in METALS[metal]))
    np.testing.assert_allclose(f0, abs((index - 1) / (index + 1)) ** 2, rtol=EXACT)
    np.testing.assert_allclose(f82, _amplitudes(1 / 7, index), rtol=EXACT)


def _amplitudes(cos: float, index: complex) -> float:
    """(|r_s|² + |r_p|²)/2 with Snell's law in complex numbers."""
    below = np.sqrt(1 - (1 - cos**2) / index**2)
    rs = (cos - index * below) / (cos + index * below)
    rp = (index * cos - below) / (index * cos + below)
    return float(abs(rs) ** 2 + abs(rp) ** 2) / 2


@pytest.mark.parametrize("metal", METALS)
def test_edge_tint_and_index_are_inverse(metal: str) -> None:
    eta, kappa = (np.array(v) for v in METALS[metal])
    f0, tint = tint_from_ior(eta, kappa)
    assert 0 <= tint <= 1
    np.testing.assert_allclose(ior_from_tint(f0, tint), (eta, kappa), rtol=ROUND_TRIP)


def test_edge_tint_keeps_the_reflectivity_and_spans_the_possible_indices() -> None:
    """Gulbrandsen 2014: any g gives the same F0; g = 0 is the dielectric, g = 1 the least η, (1−F0)/(1+F0)."""
    f0, tint = jnp.array(0.6), jnp.linspace(0.0, 1.0, 11)
    eta, kappa = ior_from_tint(f0, tint)
    np.testing.assert_allclose(f0_from_ior(eta, kappa), 0.6, rtol=EXACT)
    assert kappa[0] < 1e-6
    np.testing.assert_allclose(eta[0], (1 + np.sqrt(0.6)) / (1 - np.sqrt(0.6)), rtol=EXACT)
    np.testing.assert_allclose(eta[-1], 0.4 / 1.6, rtol=EXACT)
    slopes = jax.vmap(jax.grad(lambda g: sum(ior_from_tint(f0, g))))(tint)
    assert np.isfinite(slopes).all()


def test_numpy_and_jax_give_the_same_numbers() -> None:
    values = np.array([0.02, 0.3, 0.97])
    for one in (f0_from_eta, eta_from_f0):
        np.testing.assert_allclose(one(values), one(jnp.array(values)), rtol=EXACT)
    for two in (dielectric, schlick, f0_from_ior, f0_f82_from_ior, tint_from_ior, ior_from_tint, average_inside):
        assert isinstance(np.ravel(two(values, values[::-1])), np.ndarray)
        theirs = two(jnp.array(values), jnp.array(values[::-1]))
        np.testing.assert_allclose(two(values, values[::-1]), theirs, rtol=ROUND_TRIP)
    for three in (conductor, hoffman):
        np.testing.assert_allclose(three(values, values, values), three(*[jnp.array(values)] * 3), rtol=EXACT)


def test_average_of_schlick_and_f82_in_closed_form() -> None:
    """2∫(1−c)⁵ c dc = 1/21 and 2∫c²(1−c)⁶ dc = 1/126, here for two channels at once."""
    f0, f82 = np.array([0.04, 0.9]), np.array([0.4, 0.85])
    expected = f0 + (1 - f0) / 21
    np.testing.assert_allclose(average(Schlick(jnp.array(f0))), expected, rtol=EXACT)
    a = (f0 + (1 - f0) * (6 / 7) ** 5 - f82) / ((1 / 7) * (6 / 7) ** 6)
    np.testing.assert_allclose(average(F82(jnp.array(f0), jnp.array(f82))), expected - a / 126, rtol=EXACT)


def _walsh(m: float) -> float:
    """J. W. T. Walsh 1926, as printed by S. Prahl, Light transport in tissue, thesis 1988, eq. B41."""
    m2, m4 = m**2, m**4
    return (
        1 / 2
        + (m - 1) * (3 * m + 1) / (6 * (m + 1) ** 2)
        + m2 * (m2 - 1) ** 2 / (m2 + 1) ** 3 * np.log((m - 1) / (m + 1))
        - 2 * m**3 * (m2 + 2 * m - 1) / ((m2 + 1) * (m4 - 1))
        + 8 * m4 * (m4 + 1) / ((m2 + 1) * (m4 - 1) ** 2) * np.log(m)
    )


@pytest.mark.parametrize("eta", [1.1, 4 / 3, 1.5, 2.4, 4.0, 10.0])
def test_average_of_a_dielectric_is_walshs_formula(eta: float) -> None:
    ours = average(Dielectric(jnp.array(eta)))
    np.testing.assert_allclose(ours, _walsh(eta), atol=QUADRATURE)


@pytest.mark.parametrize("metal", METALS)
def test_average_of_a_conductor_is_the_integral(metal: str) -> None:
    expected = 2 * quad(lambda c: c * _amplitudes(c, complex(*METALS[metal])), 0, 1, epsabs=1e-13)[0]
    ours = average(Conductor(*(jnp.array(v) for v in METALS[metal])))
    np.testing.assert_allclose(ours, expected, atol=QUADRATURE)


@pytest.mark.parametrize("eta", [1.3, 1.5, 2.4])
def test_average_from_inside_is_the_integral(eta: float) -> None:
    """2∫F c dc with the relative index 1/η, split at the critical angle."""
    critical = np.sqrt(1 - 1 / eta**2)
    below = quad(lambda c: 2 * c * _amplitudes(c, 1 / eta), critical, 1, epsabs=1e-12)[0]
    ours = average_inside(average(Dielectric(jnp.array(eta))), jnp.array(eta))
    np.testing.assert_allclose(ours, critical**2 + below, atol=INSIDE)


def test_average_has_the_slope_of_walshs_formula() -> None:
    slope = jax.grad(lambda eta: average(Dielectric(eta)))(jnp.array(1.5))
    at = [_walsh(1.5 + j * 1e-3) for j in (-2, -1, 1, 2)]
    np.testing.assert_allclose(slope, (at[0] - 8 * at[1] + 8 * at[2] - at[3]) / 12e-3, rtol=DIFFERENCES)


TERMS: dict[str, tuple[Callable[..., jax.Array], tuple[float, ...]]] = {
    "dielectric": (dielectric, (1.5,)),
    "conductor": (conductor, (0.2, 3.5)),
    "schlick": (schlick, (0.04,)),
    "hoffman": (hoffman, (0.5, 0.6)),
    "dark hoffman": (hoffman, (0.04, 0.4)),
}


@pytest.mark.parametrize("name", TERMS)
def test_gradients_are_finite_differences(name: str) -> None:
    """jax.grad in the angle and in each parameter."""
    term, values = TERMS[name]
    for cos in (0.02, 0.3, 0.9):
        point = np.array([cos, *values])
        slope = jax.grad(lambda p, term=term: term(*p))(jnp.array(point))
        for k, step in enumerate(1e-3 * point):
            at = [float(term(*(point + j * step * (np.arange(len(point)) == k)))) for j in (-2, -1, 1, 2)]
            expected = (at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * step)
            np.testing.assert_allclose(slope[k], expected, rtol=DIFFERENCES, atol=DIFFERENCES)


@pytest.mark.parametrize("cos", [0.0, 1e-150, 1e-12, 0.5, 1.0])
def test_values_and_gradients_are_finite_at_every_bound(cos: float) -> None:
    bounds = [(Dielectric, (eta,)) for eta in (1.0, 50.0)] + [(Schlick, (f0,)) for f0 in (1e-4, 0.999)]
    bounds += [(Conductor, (eta, kappa)) for eta in (0.01, 1.0, 50.0) for kappa in (0.0, 0.01, 50.0)]
    bounds += [(F82, (f0, f82)) for f0 in (1e-4, 0.999) for f82 in (1e-4, 1.0)]
    for cls, values in bounds:
        value, slopes = jax.value_and_grad(lambda p, c, cls=cls: cls(*p)(c), argnums=(0, 1))(
            tuple(map(jnp.array, values)), jnp.array(cos)
        )
        assert 0 <= value <= 1
        assert np.isfinite(jax.tree.leaves(slopes)).all(), (cls.__name__, values)


@pytest.mark.parametrize(
    ("term", "values"), [(Dielectric, (1.0,)), (Conductor, (1.0, 0.0)), (F82, (1e-4, 1e-4)), (F82, (0.999, 1.0))]
)
def test_average_has_a_finite_slope_at_every_bound(term: type[AbstractFresnel], values: tuple[float, ...]) -> None:
    value, slopes = jax.value_and_grad(lambda p: average(term(*p)))(tuple(map(jnp.array, values)))
    assert -EXACT < value <= 1
    assert np.isfinite(jax.tree.leaves(slopes)).all()
