"""Dielectric interfaces against Mitsuba's `roughdielectric`, Snell's law, visible normals, and Heitz's walk."""

from types import ModuleType
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from oracles import rough_interface

import fitmat as fm
from fitmat.maths.directions import from_angles
from fitmat.models.multiple_scattering.surface import Surface
from fitmat.models.terms.distributions import GGX, AbstractDistribution, Beckmann
from fitmat.models.terms.fresnel import Conductor, Dielectric

ETA = 1.5

SINGLE = 1e-4
"""Relative, where f |c_o| > 1e-3; Mitsuba computes in single precision."""

SUMS = 2e-3
"""Absolute; the error of the sum over the sphere below, most of which is the horizon's."""

GRID = 3e-4
"""Absolute; error of the average over 300 by 300 visible normals, with an edge of total reflection."""

SIGMAS = 3.0

Hemisphere = Any


def surface(alpha: float, distribution: AbstractDistribution | None = None, eta: float = ETA) -> Surface:
    return Surface(distribution or GGX(), (alpha, alpha), Dielectric(jnp.array(eta)), transmits=True)


def sphere(number: int, seed: int) -> np.ndarray:
    w = np.random.default_rng(seed).normal(size=(number, 3))
    return w / np.linalg.norm(w, axis=1, keepdims=True)


def test_a_smooth_interface_by_snells_law() -> None:
    """1 − (R_s + R_p)/2 from the two angles; out of glass beyond 41.8° nothing; the same both ways."""
    theta = np.deg2rad([0.0, 20.0, 56.3, 80.0])
    inner = np.arcsin(np.sin(theta) / ETA)
    with np.errstate(invalid="ignore"):
        r_s = np.where(theta == 0, 0.2, np.sin(theta - inner) / np.sin(theta + inner))
        r_p = np.where(theta == 0, 0.2, np.tan(theta - inner) / np.tan(theta + inner))
    expected = 1 - (r_s**2 + r_p**2) / 2
    np.testing.assert_allclose(fm.transmittance(theta, ETA), expected, rtol=1e-12)
    np.testing.assert_allclose(fm.transmittance(inner, 1 / ETA), expected, rtol=1e-12)
    np.testing.assert_array_equal(fm.transmittance(np.deg2rad([41.9, 60.0, 90.0]), 1 / ETA), 0.0)
    np.testing.assert_array_equal(fm.transmittance(theta, 1.0), 1.0)


@pytest.mark.parametrize("alpha", [0.1, 0.5])
def test_values_are_mitsubas(mitsuba: ModuleType, alpha: float) -> None:
    """Both sides; energy as light carries it, and radiance, which is η² of it less (`TransportMode`)."""
    wi, wo = sphere(1500, 1), sphere(1500, 2)
    bsdf = mitsuba.load_dict(
        {"type": "roughdielectric", "distribution": "ggx", "alpha": alpha, "int_ior": ETA, "ext_ior": 1.0}
    )
    si, theirs = mitsuba.SurfaceInteraction3f(), []
    for mode in (mitsuba.TransportMode.Importance, mitsuba.TransportMode.Radiance):
        context, found = mitsuba.BSDFContext(mode), []
        for light, sensor in zip(wi, wo, strict=True):
            si.wi = light.tolist()
            found.append(bsdf.eval(context, si, sensor.tolist())[0])
        theirs.append(np.array(found))
    ours = fm.evaluate_interface(surface(alpha), wi, wo, masking="separable") * np.abs(wo[:, 2])
    across, down = wi[:, 2] * wo[:, 2] < 0, wi[:, 2] > 0
    bright = ours > 1e-3
    for part in (~across, across & down, across & ~down):
        assert np.count_nonzero(bright & part) > 40
    np.testing.assert_allclose(ours[bright], theirs[0][bright], rtol=SINGLE)
    compressed = np.where(across, np.where(down, ETA**2, ETA**-2), 1.0)
    np.testing.assert_allclose((ours / compressed)[bright], theirs[1][bright], rtol=SINGLE)


@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize("alpha", [0.15, 0.6])
def test_energies_are_those_of_visible_normals(alpha: float, inside: bool) -> None:
    degrees = np.array([10.0, 50.0, 75.0])
    found = fm.albedo_interface(surface(alpha), np.deg2rad(degrees), inside=inside, masking="separable")
    rule, ratio = rough_interface.fine(300), 1 / ETA if inside else ETA
    for k, angle in enumerate(degrees):
        expected = rough_interface.share(float(np.cos(np.deg2rad(angle))), alpha, ratio, rule)
        assert abs(found.reflected[k] - expected[0]) < found.error[k] + GRID
        assert abs(found.transmitted[k] - expected[1]) < found.error[k] + GRID


@pytest.mark.parametrize("masking", ["correlated", "separable"])
@pytest.mark.parametrize("below", [False, True])
def test_values_add_up_to_the_energies(masking: str, below: bool) -> None:
    """∫ f |c_o| dω_o over either half of the sphere, by midpoints in cosine and azimuth."""
    glass, theta = surface(0.5, Beckmann()), 0.7
    cos, phi = (np.arange(300) + 0.5) / 300, (np.arange(360) + 0.5) / 360 * 2 * np.pi
    zenith, azimuth = (part.ravel() for part in np.meshgrid(np.arccos(cos), phi, indexing="ij"))
    wo = from_angles(zenith, azimuth)
    wi = np.tile(from_angles(np.array([theta]), np.zeros(1)) * [1, 1, -1 if below else 1], (len(wo), 1))
    same, other = wo * [1, 1, -1 if below else 1], wo * [1, 1, 1 if below else -1]
    weight = wo[:, 2] * 2 * np.pi / len(wo)
    sums = [weight @ fm.evaluate_interface(glass, wi, half, masking=masking) for half in (same, other)]
    found = fm.albedo_interface(glass, np.array([theta]), inside=below, masking=masking)
    assert sums == pytest.approx([found.reflected[0], found.transmitted[0]], abs=SUMS)


def test_reciprocal_as_radiance_is() -> None:
    """f(ω_i, ω_o)/η_o² = f(ω_o, ω_i)/η_i² (E. Veach, 1997, sec. 5.2)."""
    wi, wo = sphere(500, 3), sphere(500, 4)
    there, back = (fm.evaluate_interface(surface(0.4), *pair) for pair in ((wi, wo), (wo, wi)))
    index = [np.where(w[:, 2] < 0, ETA, 1.0) for w in (wo, wi)]
    assert np.count_nonzero(there) > 300
    np.testing.assert_allclose(there / index[0] ** 2, back / index[1] ** 2, rtol=1e-10)


@pytest.mark.parametrize("eta", [ETA, 1 / ETA])
@pytest.mark.parametrize("distribution", [GGX(), pytest.param(Beckmann(), marks=pytest.mark.study)])
def test_one_collision_is_the_walks_first_and_all_lose_nothing(distribution: AbstractDistribution, eta: float) -> None:
    """From above and, with 1/η, from below: R and T of one collision, and R + T of all, within 3 standard errors."""
    glass, theta = surface(0.7, distribution, eta), np.deg2rad([0.0, 60.0])
    once = fm.albedo_interface(glass, theta)
    wi = from_angles(theta, np.zeros(2))
    first, every = (fm.albedo_walk(glass, wi, samples=60_000, seed=5, order=order) for order in (1, None))
    for ours, walk in ((once.reflected, first.reflected), (once.transmitted, first.transmitted)):
        assert np.all(np.abs(ours - walk.value[:, 0]) < SIGMAS * walk.standard_error[:, 0] + once.error)
    total = every.reflected.value[:, 0] + every.transmitted.value[:, 0] + every.reflected.omitted
    np.testing.assert_allclose(total, 1.0, rtol=1e-12)
    assert np.all(once.reflected + once.transmitted < 1.0)


def test_from_below_is_an_interface_turned_over() -> None:
    theta = np.deg2rad([5.0, 35.0, 65.0])
    below = fm.albedo_interface(surface(0.3), theta, inside=True)
    over = fm.albedo_interface(surface(0.3, eta=1 / ETA), theta)
    np.testing.assert_allclose(below.transmitted, over.transmitted, rtol=1e-12)


UP = np.array([[0.0, 0.0, 1.0]])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: fm.transmittance(45.0, 1.5), "theta_i = 45: expected 0 to π/2 radians"),
        (lambda: fm.Surface("phong", 0.3, 1.5), "distribution 'phong': expected ggx or beckmann"),
        (lambda: fm.Surface("ggx", 0.0, 1.5), "expected .alpha_x, alpha_y., each from 0.0001 to 2"),
        (lambda: fm.Surface("ggx", 0.3, -1.5), "fresnel = -1.5: expected a Fresnel term, or the index"),
        (lambda: fm.transmittance(0.5, 0.0), "eta = 0.0: expected an index above 0"),
        (lambda: fm.transmittance(0.5, np.array([1.5, np.nan])), "expected an index above 0|eta"),
        (lambda: fm.transmittance(np.zeros(2), np.ones(3)), r"shapes \(2,\) and \(3,\): expected the same"),
        (lambda: fm.evaluate_interface(fm.model("ggx"), UP, -UP), "surface is a Microfacet, expected a Surface"),  # type: ignore[arg-type]
        (
            lambda: fm.evaluate_interface(Surface(GGX(), (0.3, 0.3), Conductor()), UP, -UP),
            "does not transmit, expected",
        ),
        (lambda: fm.evaluate_interface(surface(0.3, eta=1.0), UP, -UP), "eta = 1 of the surface: light passes"),
        (lambda: fm.evaluate_interface(surface(0.3, eta=-1.5), UP, -UP), "eta of the surface = -1.5: expected an"),
        (lambda: fm.evaluate_interface(surface(0.3), UP, -2 * UP), "wo row 0 has length 2: expected unit vectors"),
        (lambda: fm.evaluate_interface(surface(0.3), UP[0], -UP), r"shapes \(3,\) and \(1, 3\): expected \(n, 3\)"),
        (
            lambda: fm.evaluate_interface(surface(0.3), UP, UP, masking="v-cavity"),
            "masking 'v-cavity': expected one of",
        ),
        (lambda: fm.albedo_interface(surface(0.3), np.zeros((1, 1))), r"theta_i has shape \(1, 1\): expected \(k,\)"),
    ],
)
def test_wrong_input_is_one_sentence(call: Any, message: str) -> None:
    with pytest.raises(fm.FitmatError, match=message):
        call()


def test_a_surface_in_words_is_that_in_classes() -> None:
    words = fm.Surface("beckmann", 0.3, 1.5, transmits=True)
    np.testing.assert_array_equal(
        fm.evaluate_interface(words, UP, -UP), fm.evaluate_interface(surface(0.3, Beckmann()), UP, -UP)
    )


def test_along_the_surface_and_towards_eta_1() -> None:
    """0 along the surface; finite everywhere, and for η → 1 all light goes on: R → 0."""
    flat = np.array([[1.0, 0.0, 0.0]])
    assert fm.evaluate_interface(surface(0.3), flat, UP) == 0.0
    assert fm.evaluate_interface(surface(0.3), UP, flat) == 0.0
    assert np.isfinite(fm.evaluate_interface(surface(1e-4), sphere(200, 6), sphere(200, 7))).all()
    nearly = fm.albedo_interface(surface(0.05, eta=1.0 + 1e-6), np.deg2rad([0.0, 60.0]))
    assert np.all(nearly.reflected < 1e-6)
    assert np.all(nearly.transmitted > 0.99)
