"""Fresnel reflectance against Mitsuba 3, textbooks and limits that are known exactly."""

from collections.abc import Callable
from types import ModuleType

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fitmat.fresnel import (
    Conductor,
    Dielectric,
    Schlick,
    conductor,
    dielectric,
    eta_from_f0,
    f0_from_eta,
    schlick,
)

MITSUBA = 1e-5
"""Relative; Mitsuba rounds to single precision (6e-8) at each of some ten steps."""

MITSUBA_GRAZING = 1e-4
"""Within 3° of grazing, where single precision loses digits in 1 − sin²."""

EXACT = 1e-13
"""Relative; a formula and its limit or inverse in double precision."""

DIFFERENCES = 1e-8
"""Relative; five-point differences of step h = 1e-3: h⁴ times the fifth derivative, and rounding 1e-16/h."""


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
    ):
        np.testing.assert_allclose(fresnel(jnp.array(0.0)), 1.0, rtol=EXACT)


def test_schlick_ends_and_middle() -> None:
    """F0 at the normal, 1 at grazing, and 0.04 + 0.96/32 = 0.07 at 60°, by hand."""
    at = [schlick(jnp.array(cos), jnp.array(0.04)) for cos in (1.0, 0.5, 0.0)]
    np.testing.assert_allclose(at, [0.04, 0.07, 1.0], rtol=EXACT)


TERMS: dict[str, tuple[Callable[..., jax.Array], tuple[float, ...]]] = {
    "dielectric": (dielectric, (1.5,)),
    "conductor": (conductor, (0.2, 3.5)),
    "schlick": (schlick, (0.04,)),
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
    bounds += [(Conductor, (eta, kappa)) for eta in (0.01, 1.0, 50.0) for kappa in (0.01, 50.0)]
    for cls, values in bounds:
        value, slopes = jax.value_and_grad(lambda p, c, cls=cls: cls(*p)(c), argnums=(0, 1))(
            tuple(map(jnp.array, values)), jnp.array(cos)
        )
        assert 0 <= value <= 1
        assert np.isfinite(jax.tree.leaves(slopes)).all(), (cls.__name__, values)
