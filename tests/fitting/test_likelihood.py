"""The likelihood against quadrature and scipy's densities: the transform, its limits, its inverse, its best s."""

import dataclasses
from collections.abc import Callable
from itertools import pairwise

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy import integrate, optimize, stats

import fitmat as fm
from fitmat.fitting.discrepancy import NEGLIGIBLE, best_discrepancy, first_discrepancy
from fitmat.fitting.likelihood import Data, log_likelihood, prepare, residuals
from fitmat.fitting.stabilising import from_stabilised, spread, stabilised
from fitmat.measurements.noise import Noise

QUADRATURE = 1e-9
"""Relative; quad is asked for 1e-11."""

ROUNDING = 1e-9
"""Absolute error of a log density of some hundred samples."""

SLOPE = 1e-7
"""Relative error of dz/ds, which cancels digits where its closed form meets its series."""

STEEP = 1e-8
"""Relative error of z after z → x → z: ∛x is known to 15 digits, and z to at least 1e-9."""

COVER = 1e-6
"""Error of an integral of the density; quad with the mean and the origin as break points reaches 1e-8."""

BRENT = 1e-5
"""Relative; both searches stop where the cost is flat to rounding: √1e-16 times a condition of about 100."""

NOISES, DISCREPANCIES = st.floats(1e-6, 10.0), st.floats(1e-8, 10.0)
SIGNED = st.floats(-5.0, 4.0).map(lambda e: 10.0**e) | st.floats(-5.0, 4.0).map(lambda e: -(10.0**e))

_transform = jax.jit(stabilised)
_inverse = jax.jit(from_stabilised)
_slopes = jax.jit(jax.grad(stabilised, argnums=(0, 2)))
_density = eqx.filter_jit(log_likelihood)
_best = jax.jit(best_discrepancy)


def transform(x: float, noise: float, s: float) -> float:
    """∫₀ˣ dt/(noise + 3 s |t|^(2/3)) by quadrature in u = ∛t, where nothing is singular."""
    return float(np.sign(x) * _integral(lambda u: 3 * u**2 / (noise + 3 * s * u**2), abs(np.cbrt(x)), noise, s))


def _integral(f: Callable[[float], float], end: float, noise: float, s: float) -> float:
    """∫₀^end f(u) du; f turns where noise and discrepancy are equal, which quad must be told."""
    turn = np.sqrt(noise / (3 * s)) if s > 0 else np.inf
    edges = [0.0, *(edge for edge in (turn, 30 * turn, 1e3 * turn) if edge < end), end]
    return sum(integrate.quad(f, a, b, epsabs=0, epsrel=1e-11, limit=200)[0] for a, b in pairwise(edges))


def separation(low: np.ndarray, high: np.ndarray, noise: np.ndarray, s: float) -> np.ndarray:
    """z(high) − z(low) by Gauss–Legendre in ∛x."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    start, width = np.cbrt(low), np.cbrt(high) - np.cbrt(low)
    u = start[..., None] + width[..., None] * (nodes + 1) / 2
    return (3 * u**2 / (noise[..., None] + 3 * s * u**2)) @ weights / 2 * width


def one_sample(y: float, sigma: float, kappa: float = 0.8) -> Data:
    """A sample of value y at cosθ_i = kappa; both directions near the normal."""
    up = jnp.array([[np.sqrt(1 - kappa**2), 0.0, kappa]])
    parts = (jnp.array([[y * kappa]]), jnp.array([[sigma * kappa]]), jnp.array([[kappa]]), jnp.array([[1.0]]))
    return Data(up, up, *parts)


@pytest.fixture(scope="module")
def measured() -> fm.Measurements:
    """51 samples of a known surface with two values masked, and one row masked altogether."""
    truth, theta_o = fm.model("lambert+ggx", kd=0.3, alpha=0.3, eta=1.5), np.deg2rad(np.arange(-80, 81, 10))
    m = fm.simulate(truth, np.deg2rad([20, 45, 70]), theta_o, relative_noise=0.02, absolute_noise=1e-3, seed=1)
    valid = m.valid.copy()
    valid[[3, 17, 40]] = False
    return dataclasses.replace(m, valid=valid)


@given(SIGNED, NOISES, DISCREPANCIES)
@example(1.0, 1.0, 1 / 3)  # q = 1, where two forms meet
@example(1.0, 1.0, 0.3334)
@example(-1e4, 1e-6, 10.0)
def test_the_transform_is_the_integral_of_one_over_the_spread(x: float, noise: float, s: float) -> None:
    np.testing.assert_allclose(_transform(x, noise, s), transform(x, noise, s), rtol=QUADRATURE)


@given(SIGNED, NOISES, DISCREPANCIES)
@example(1.0, 1.0, 0.99e-3 / 3)  # on either side of where the slope's series ends
@example(1.0, 1.0, 1.01e-3 / 3)
@example(1.0, 1.0, 1 / 3)
@example(0.0, 1e-3, 0.1)
@example(-1e-12, 1e-3, 0.1)
@example(1.0, 1e-3, 0.0)
def test_its_derivatives_are_finite_and_right(x: float, noise: float, s: float) -> None:
    """In x the integrand; in s minus the integral of 3|t|^(2/3)/(noise + 3 s |t|^(2/3))²."""
    by_x, by_s = _slopes(x, noise, s)
    np.testing.assert_allclose(by_x, 1 / (noise + 3 * s * np.abs(x) ** (2 / 3)), rtol=1e-12)
    np.testing.assert_allclose(spread(jnp.array(x), jnp.array(noise), jnp.array(s)) * by_x, 1.0, rtol=1e-12)
    expected = _integral(lambda u: -9 * u**4 / (noise + 3 * s * u**2) ** 2, abs(np.cbrt(x)), noise, s)
    np.testing.assert_allclose(by_s, np.sign(x) * expected, rtol=SLOPE)


@given(st.floats(-5.0, 4.0).map(lambda e: 10.0**e), NOISES, DISCREPANCIES, st.floats(-6.0, 6.0))
@example(1e-3, 1.0, 0.1, -6.0)
@example(1e4, 1e-6, 10.0, -6.0)
@example(1e-5, 1e-6, 10.0, 6.0)
def test_the_inverse_undoes_the_transform(value: float, noise: float, s: float, e: float) -> None:
    """From a model's value, e standard deviations away, through 0 to negative values where need be."""
    z = _transform(value, noise, s) + e
    np.testing.assert_allclose(_transform(_inverse(z, noise, s), noise, s), z, rtol=STEEP)


def test_the_inverse_reaches_negative_values() -> None:
    x = _inverse(jnp.array(-3.0), jnp.array(0.1), jnp.array(0.05))
    assert x < 0
    assert transform(float(x), 0.1, 0.05) == pytest.approx(-3.0, rel=QUADRATURE)


def test_without_discrepancy_it_is_the_gaussian_density(measured: fm.Measurements) -> None:
    """scipy.stats.norm over the valid values alone: padding and masked values add nothing."""
    assert measured.sigma is not None
    model, used = fm.model("lambert+ggx", kd=0.31, alpha=0.28, eta=1.52), measured.valid
    data = prepare(measured, Noise(measured.sigma, True, ""))
    assert data.x.shape == (64, 1)
    expected = stats.norm.logpdf(measured.value, fm.evaluate(model, measured.wi, measured.wo), measured.sigma)
    for s in (0.0, 1e-17):
        assert abs(_density(model, data, jnp.array(s)) - expected[used].sum()) < ROUNDING


def test_without_noise_it_is_the_gaussian_density_of_the_cube_root(measured: fm.Measurements) -> None:
    """scipy.stats.norm of ∛(y κ), times d∛(y κ)/dy."""
    model, used, s = fm.model("lambert+ggx", kd=0.31, alpha=0.28, eta=1.52), measured.valid[:, 0], 0.05
    data = prepare(measured, Noise(np.full_like(measured.value, 1e-13), True, ""))
    kappa, y = measured.wi[used, 2], measured.value[used, 0]
    mean = np.cbrt(fm.evaluate(model, measured.wi, measured.wo)[used, 0] * kappa)
    expected = stats.norm.logpdf(np.cbrt(y * kappa), mean, s) + np.log(kappa / 3 * np.cbrt(y * kappa) ** -2)
    assert abs(_density(model, data, jnp.array(s)) - expected.sum()) < ROUNDING


def test_padding_and_masked_values_weigh_nothing(measured: fm.Measurements) -> None:
    """Noise and discrepancy both at work; the sum over valid values by Gauss–Legendre and numpy."""
    assert measured.sigma is not None
    model, used, s = fm.model("lambert+ggx", kd=0.31, alpha=0.28, eta=1.52), measured.valid[:, 0], 0.01
    kappa, sigma, y = measured.wi[used, 2], measured.sigma[used, 0], measured.value[used, 0]
    f = fm.evaluate(model, measured.wi, measured.wo)[used, 0]
    r = separation(f * kappa, y * kappa, sigma * kappa, s)
    logs = np.log((sigma * kappa + 3 * s * np.abs(y * kappa) ** (2 / 3)) / kappa) + 0.5 * np.log(2 * np.pi)
    spoilt = np.where(measured.valid, measured.value, 1e30)
    for m in (measured, dataclasses.replace(measured, value=spoilt), measured.rows(used)):
        assert m.sigma is not None
        data = prepare(m, Noise(m.sigma, True, ""))
        found = np.asarray(residuals(model, data, jnp.array(s)))[:, 0]
        np.testing.assert_allclose(found[: len(r)], r, atol=ROUNDING)
        assert not found[len(r) :].any()
        assert abs(_density(model, data, jnp.array(s)) + np.sum(0.5 * r**2 + logs)) < ROUNDING


def test_a_masked_channel_of_a_row_weighs_nothing() -> None:
    value, angles = np.array([[0.3, 7.0], [0.2, 0.25]]), np.array([0.1, 0.2])
    m = fm.from_arrays(angles, angles, value, sigma=np.full_like(value, 0.01))
    masked = dataclasses.replace(m, valid=np.array([[True, False], [True, True]]))
    data = prepare(masked, Noise(np.full_like(value, 0.01), True, ""))
    model = fm.model("lambert", channels=2, kd=0.8)
    expected = stats.norm.logpdf(value[masked.valid], 0.8 / np.pi, 0.01).sum()
    assert abs(_density(model, data, jnp.array(0.0)) - expected) < ROUNDING


@pytest.mark.parametrize(("sigma", "s"), [(0.05, 0.0), (0.02, 0.03), (0.1, 0.3), (1e-3, 0.1)])
def test_the_density_of_a_measurement_integrates_to_one(sigma: float, s: float) -> None:
    """Over all y, negative ones included, for a model value of 0.1."""
    model = fm.model("lambert", kd=0.1 * np.pi)

    def density(u: float) -> float:
        return float(jnp.exp(_density(model, one_sample(u**3, sigma), jnp.array(s)))) * 3 * u**2

    breaks = [0.0, *np.cbrt([0.1 - 3 * sigma, 0.1, 0.1 + 3 * sigma])]
    total, _ = integrate.quad(density, -2.5, 2.5, points=breaks, epsabs=1e-8, limit=100)
    assert abs(total - 1.0) < COVER


@pytest.mark.parametrize("planted", [0.01, 0.05, 0.2])
def test_the_best_discrepancy_minimises_the_cost(measured: fm.Measurements, planted: float) -> None:
    """scipy's bounded search in log s over a cost written with Gauss–Legendre; its minimum is near what was planted."""
    assert measured.sigma is not None
    truth = fm.evaluate(fm.model("lambert+ggx", kd=0.3, alpha=0.3, eta=1.5), measured.wi, measured.wo)
    kappa = measured.wi[:, 2:3]
    roots = np.cbrt(truth * kappa) + planted * np.random.default_rng(3).normal(size=truth.shape)
    off = dataclasses.replace(measured, value=roots**3 / kappa)
    data = prepare(off, Noise(measured.sigma, True, ""))
    used = np.asarray(data.weight) > 0
    x, noise, kappa = (np.asarray(part)[used[:, 0], 0] for part in (data.x, data.noise, data.kappa))
    predicted = (truth * measured.wi[:, 2:3])[measured.valid]

    def cost(log_s: float) -> float:
        s = np.exp(log_s)
        r = separation(predicted, x, noise, s)
        return float(np.sum(0.5 * r**2 + np.log(noise + 3 * s * np.abs(x) ** (2 / 3))))

    best = np.exp(optimize.fminbound(cost, -12.0, 2.0, xtol=1e-9))
    padded = jnp.zeros_like(data.x).at[: len(predicted), 0].set(predicted)
    for start in (planted / 30, planted * 30):
        assert _best(padded, data, jnp.array(start)) == pytest.approx(best, rel=BRENT)
    assert best == pytest.approx(planted, rel=0.35)  # 3.5 standard errors 1/√(2·48), with noise on top


def test_no_discrepancy_where_the_noise_explains_everything(measured: fm.Measurements) -> None:
    """The true values under a noise stated twice too large."""
    assert measured.sigma is not None
    truth = fm.evaluate(fm.model("lambert+ggx", kd=0.3, alpha=0.3, eta=1.5), measured.wi, measured.wo)
    data = prepare(measured, Noise(2 * measured.sigma, True, ""))
    predicted = (truth * measured.wi[:, 2:3])[measured.valid]
    padded = jnp.zeros_like(data.x).at[: len(predicted), 0].set(predicted)
    assert _best(padded, data, first_discrepancy(data)) == 0.0


def test_scales_are_medians_over_valid_values(measured: fm.Measurements) -> None:
    assert measured.sigma is not None
    data, used = prepare(measured, Noise(measured.sigma, True, "")), measured.valid[:, 0]
    kappa = measured.wi[used, 2]
    x, noise = measured.value[used, 0] * kappa, measured.sigma[used, 0] * kappa
    assert first_discrepancy(data) == pytest.approx(0.1 * np.median(np.cbrt(x)))
    assert data.typical == pytest.approx(np.median(noise / (3 * (x + noise) ** (2 / 3))))
    assert NEGLIGIBLE * data.typical < 1e-5
