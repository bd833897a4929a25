"""The tilted sample against scipy's rotations, the law of the mirror, and fits of simulated tilted samples."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import root_scalar
from scipy.spatial.transform import Rotation

import fitmat as fm
from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.result import Fit
from fitmat.maths.directions import from_angles
from fitmat.models.around.tilt import Tilted
from fitmat.models.base import evaluate_pairs
from fitmat.models.parameters import entries, vector, with_vector

EXACT = 1e-9
"""Relative; two ways to turn a vector differ by 1e-16, which a lobe of alpha 0.05 multiplies at grazing angles."""

PEAK = 1e-4
"""Degrees; the maximum of a lobe of 0.06° width, found on its slope."""

SIGMAS = 4.0
"""Standard deviations that a seeded estimate may be off."""

DIFFERENCES = 1e-6
"""Relative to |∂f/∂p| + |f|; five-point differences with a step of 1e-3 degrees."""

Hemisphere = Any
Pairs = dict[str, tuple[np.ndarray, np.ndarray]]
BASES = ("lambert", "lambert+ggx", "ggx-aniso-conductor", "varnish-over-lambert", "phong")


def _normal(tilt_x: float, tilt_y: float) -> np.ndarray:
    """The sample's normal: −∇h is (tan t_x, tan t_y)."""
    n = np.array([np.tan(np.deg2rad(tilt_x)), np.tan(np.deg2rad(tilt_y)), 1.0])
    return n / np.linalg.norm(n)


@pytest.mark.parametrize(("tilt_x", "tilt_y"), [(0.4, 0.0), (0.0, -3.0), (15.0, -15.0), (-7.0, 11.0)])
@pytest.mark.parametrize("base", BASES)
def test_tilted_is_the_base_in_a_turned_frame(hemisphere: Hemisphere, base: str, tilt_x: float, tilt_y: float) -> None:
    """By the rotation vector n′ × z of scipy, the shortest way, times the ratio of cosines."""
    wi, wo, n = hemisphere(400, 1), hemisphere(400, 2), _normal(tilt_x, tilt_y)
    axis = np.cross(n, [0, 0, 1])
    turn = Rotation.from_rotvec(axis / np.linalg.norm(axis) * np.arccos(n[2]))
    np.testing.assert_allclose(turn.apply(n), [0, 0, 1], atol=1e-12)
    light, sensor = turn.apply(wi), turn.apply(wo)
    lit = (light[:, 2] > 0) & (sensor[:, 2] > 0)
    model = fm.model(base)
    expected = np.where(lit, fm.evaluate(model, light, sensor)[:, 0] * (wi @ n) / wi[:, 2], 0)
    values = fm.evaluate(fm.model(f"tilt-over-{base}", tilt_x=tilt_x, tilt_y=tilt_y), wi, wo)[:, 0]
    np.testing.assert_allclose(values, expected, rtol=EXACT, atol=1e-14)


@pytest.mark.parametrize("base", BASES)
def test_a_level_sample_is_the_base(hemisphere: Hemisphere, base: str) -> None:
    wi, wo = hemisphere(200, 3), hemisphere(200, 4)
    level = fm.evaluate(fm.model(f"tilt-over-{base}"), wi, wo)
    np.testing.assert_allclose(level, fm.evaluate(fm.model(base), wi, wo), rtol=EXACT)


def _peak(tilt: float, theta_i: float) -> float:
    """Signed theta_o in degrees at which a sharp in-plane lobe is brightest; the light at azimuth 180°."""
    model = fm.model("tilt-over-ggx", alpha=1e-3, tilt_x=tilt)
    wi = jnp.array(from_angles(np.deg2rad(theta_i), np.array(np.pi)))

    @jax.jit
    def slope(theta_o: jax.Array) -> jax.Array:
        def value(angle: jax.Array) -> jax.Array:
            return jnp.log(model(wi, jnp.stack([jnp.sin(angle), 0.0 * angle, jnp.cos(angle)])))

        return jax.grad(value)(jnp.deg2rad(theta_o))

    middle = theta_i + 2 * tilt
    found = root_scalar(lambda angle: float(slope(jnp.array(angle, float))), bracket=(middle - 0.02, middle + 0.02))
    return found.root


@pytest.mark.parametrize("tilt", [-10.0, -0.5, 0.3, 4.0])
def test_the_peak_moves_by_twice_the_tilt(tilt: float) -> None:
    """The law of the mirror: light from −θ leaves at θ + 2t when the normal leans by t towards the sensor."""
    assert _peak(tilt, 30.0) == pytest.approx(30.0 + 2 * tilt, abs=PEAK)


@pytest.mark.study
def test_the_peak_moves_two_degrees_per_degree() -> None:
    """∂peak/∂tilt by the implicit function theorem, −(∂²ln f/∂θ∂t)/(∂²ln f/∂θ²) at the peak, is 2."""
    template = fm.model("tilt-over-ggx", alpha=1e-3, tilt_x=1.0)
    place = next(e.place.start for e in entries(template) if e.name == "tilt_x")
    wi, theta = jnp.array(from_angles(np.deg2rad(30.0), np.array(np.pi))), jnp.array(_peak(1.0, 30.0))

    def log_value(tilt: jax.Array, theta_o: jax.Array) -> jax.Array:
        angle, model = jnp.deg2rad(theta_o), with_vector(template, jnp.asarray(vector(template)).at[place].set(tilt))
        return jnp.log(model(wi, jnp.stack([jnp.sin(angle), 0.0 * angle, jnp.cos(angle)])))

    both = jax.jit(jax.jacfwd(jax.grad(log_value, argnums=1), argnums=(0, 1)))(jnp.array(1.0), theta)
    assert -float(both[0] / both[1]) == pytest.approx(2.0, abs=1e-3)


def test_directions_below_the_tilted_horizon_are_dark() -> None:
    """Leaning by 10° towards +x hides what is below 10° above the horizon on the −x side, and nothing on the other."""
    model = fm.model("tilt-over-lambert", kd=1.0, tilt_x=10.0)
    steep = np.deg2rad([79.0, 81.0, 89.0, 89.0])
    low, up = from_angles(steep, np.array([np.pi, np.pi, np.pi, 0.0])), np.tile([0.0, 0.0, 1.0], (4, 1))
    assert ((fm.evaluate(model, up, low) > 0)[:, 0] == [True, False, False, True]).all()
    assert ((fm.evaluate(model, low, up) > 0)[:, 0] == [True, False, False, True]).all()


def test_a_slope_towards_the_light_catches_more_as_declared() -> None:
    """Cos 70°/cos 85°; the value is per irradiance of the level sample, so the swapped pair differs."""
    up, low = np.array([[0.0, 0.0, 1.0]]), from_angles(np.deg2rad([85.0]), np.zeros(1))
    model = fm.model("tilt-over-lambert", kd=1.0, tilt_x=15.0)
    by_hand = np.cos(np.deg2rad(70)) / np.cos(np.deg2rad(85))
    assert fm.evaluate(model, low, up)[0, 0] * np.pi == pytest.approx(by_hand)
    assert f"{by_hand:.2f}" in Tilted.breaks["energy"]
    assert fm.evaluate(model, up, low)[0, 0] * np.pi == pytest.approx(np.cos(np.deg2rad(15)))


TRUTH: dict[str, Any] = {"kd": 0.3, "alpha": 0.06, "ks": 1.0, "eta": 1.5, "tilt_x": 0.8, "tilt_y": -0.5}


@pytest.fixture(scope="module")
def tilted() -> fm.Measurements:
    """A tilted plastic, seen in two planes, so that both tilts are determined; 1 % noise."""
    theta_i, theta_o, phi_i = np.meshgrid(np.deg2rad([20, 45]), np.deg2rad(np.arange(-60, 67, 3)), [0.0, np.pi / 2])
    theta_i, theta_o, phi_i = theta_i.ravel(), theta_o.ravel(), phi_i.ravel()
    blank = fm.from_arrays(theta_i, theta_o, np.ones_like(theta_i), phi_i=phi_i)
    exact = fm.evaluate(fm.model("tilt-over-lambert+ggx", **TRUTH), blank.wi, blank.wo)
    sigma = np.hypot(0.01 * exact, 1e-3)
    value = exact + sigma * np.random.default_rng(5).normal(size=exact.shape)
    return fm.from_arrays(theta_i, theta_o, value, phi_i=phi_i, sigma=sigma)


def _estimate(found: Fit, name: str) -> tuple[float, float]:
    """A parameter's value and standard deviation."""
    place = next(e.place.start for e in entries(found.model) if e.name == name)
    return float(found.values[place]), float(np.sqrt(found.covariance[place, place]))


@pytest.mark.study
def test_a_fit_finds_the_tilt_and_alpha_which_ignoring_it_biases(tilted: fm.Measurements) -> None:
    """A level model smears the lobe over both planes: alpha is off by several σ of the right fit, and it misfits."""
    found, level = (fm.fit(tilted, name, fixed={"ks": 1.0}) for name in ("tilt-over-lambert+ggx", "lambert+ggx"))
    assert found.result == "converged"
    for name in TRUTH.keys() - {"ks"}:
        value, sd = _estimate(found, name)
        assert abs(value - TRUTH[name]) < SIGMAS * sd, name
        assert sd < 0.05 * max(1.0, abs(value)), name
    (alpha, _), (_, sd) = _estimate(level, "alpha"), _estimate(found, "alpha")
    assert abs(alpha - TRUTH["alpha"]) > SIGMAS * sd
    assert found.misfit_ratio < 0.5 < 1 < level.misfit_ratio


def test_gradients_are_finite_differences(hemisphere: Hemisphere, singular: Pairs) -> None:
    """In both tilts, by jacfwd; finite at the singular pairs and at the bounds, where all is turned below one side."""
    model = fm.model("tilt-over-lambert+ggx", alpha=0.3)
    special_i, special_o = (jnp.array(np.array(column)) for column in zip(*singular.values(), strict=True))
    wi, wo = jnp.array(hemisphere(50, 6)), jnp.array(hemisphere(50, 7))
    names = {e.name: e.place.start for e in entries(model)}

    @jax.jit
    def values(point: jax.Array, wi: jax.Array, wo: jax.Array) -> jax.Array:
        return evaluate_pairs(with_vector(model, point), wi, wo)[:, 0]

    slopes = jax.jit(jax.jacfwd(values))
    bounds = coordinates(model)
    for point in (bounds.lower, bounds.upper, np.asarray(vector(model))):
        assert np.isfinite(slopes(jnp.array(point), special_i, special_o)).all()
    point = jnp.asarray(vector(model)).at[names["tilt_x"]].set(2.0).at[names["tilt_y"]].set(-3.0)
    lit = np.asarray(values(point, wi, wo)) > 0
    for name in ("tilt_x", "tilt_y"):
        at = [np.asarray(values(point.at[names[name]].add(j * 1e-3), wi, wo)) for j in (-2, -1, 1, 2)]
        expected = (at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * 1e-3)
        error = np.abs(np.asarray(slopes(point, wi, wo))[:, names[name]] - expected)
        scale = np.abs(expected) + np.asarray(values(point, wi, wo))
        assert np.all(error[lit] < DIFFERENCES * scale[lit]), name
