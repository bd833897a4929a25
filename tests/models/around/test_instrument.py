"""The instrument: apertures against brute-force averages, calibration and dark signal against planted ones."""

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import qmc

import fitmat as fm
from fitmat.errors import ModelError, ReadError
from fitmat.fitting.jitter import jittered
from fitmat.fitting.likelihood import prepare
from fitmat.maths.directions import from_angles
from fitmat.measurements.instrument import IDEAL, Instrument
from fitmat.measurements.noise import measured_noise
from fitmat.models.around.instrument import Seen, cone_rule
from fitmat.models.around.shown import surface
from fitmat.models.base import AbstractBRDF

DEGREE = np.pi / 180
THETA_I = np.array([10.0, 30.0, 50.0, 70.0]) * DEGREE
THETA_O = np.arange(-80.0, 80.5, 2.0) * DEGREE

WIDE = 4e-3
"""Of the average where source and receiver together are twice as wide as the lobe, Sobol's error included."""

THREE = 3.0
"""Standard deviations within which a recovered parameter may lie."""


def cap(points: np.ndarray, half_angle: float, axis: np.ndarray) -> np.ndarray:
    """Directions uniform in solid angle within a cone, from points of the unit square (Archimedes)."""
    z = 1.0 - points[:, 0] * (1.0 - np.cos(half_angle))
    r, psi = np.sqrt(1.0 - z * z), 2.0 * np.pi * points[:, 1]
    first = np.cross(axis, [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first)
    return np.outer(r * np.cos(psi), first) + np.outer(r * np.sin(psi), np.cross(axis, first)) + np.outer(z, axis)


def averaged(model: AbstractBRDF, wi: np.ndarray, wo: np.ndarray, instrument: Instrument) -> np.ndarray:
    """Nicodemus' average of a BRDF over both projected cones, by 4,096 Sobol points each pair of directions."""
    points = qmc.Sobol(4, scramble=False).random(4096)
    found = []
    for i, o in zip(wi, wo, strict=True):
        lights, sensors = cap(points[:, :2], instrument.source, i), cap(points[:, 2:], instrument.receiver, o)
        product = lights[:, 2] * sensors[:, 2]
        found.append((product[:, None] * fm.evaluate(model, lights, sensors)).sum(axis=0) / product.sum())
    return np.array(found)


def plane(theta_i: np.ndarray, theta_o: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions of every pair of incidence and signed outgoing angle."""
    light, sensor = (a.ravel() for a in np.meshgrid(theta_i, theta_o, indexing="ij"))
    return from_angles(light, np.zeros_like(light)), from_angles(np.abs(sensor), np.where(sensor > 0, np.pi, 0.0))


@pytest.mark.parametrize(("source", "receiver"), [(2.0, 0.0), (0.0, 2.0), (1.0, 1.0), (0.3, 1.7)])
def test_apertures_average_as_brute_force_does(source: float, receiver: float) -> None:
    base, instrument = fm.model("ggx", alpha=0.0175, eta=1.5), Instrument(source * DEGREE, receiver * DEGREE)
    wi, wo = plane(THETA_I, np.array([-30.0, 5.0, 10.0, 28.0, 30.0, 31.0, 47.0, 50.0, 53.0, 68.0, 70.0, 75.0]) * DEGREE)
    shown, expected = fm.evaluate(Seen(base, instrument), wi, wo), averaged(base, wi, wo, instrument)
    np.testing.assert_allclose(shown, expected, rtol=WIDE)
    assert np.max(np.abs(fm.evaluate(base, wi, wo) / expected - 1.0)) > 0.5  # what the average changes


def test_a_lambertian_surface_looks_the_same_through_any_aperture() -> None:
    """As long as no part of a cone lies below the horizon."""
    wi, wo = plane(THETA_I, np.arange(-70.0, 71.0, 10.0) * DEGREE)
    shown = fm.evaluate(Seen(fm.model("lambert", kd=0.3), Instrument(0.1, 0.2)), wi, wo)
    np.testing.assert_allclose(shown, 0.3 / np.pi, rtol=1e-12)


@pytest.mark.parametrize(("source", "receiver"), [(0.01, 0.0), (0.0, 0.03), (0.02, 0.02), (0.01, 0.03)])
def test_the_cone_rule_has_the_variance_of_two_discs(source: float, receiver: float) -> None:
    """A uniform disc of radius A has the variance A²/4 along each axis; independent offsets add theirs."""
    lights, sensors, weights = cone_rule(source, receiver)
    offset = (lights + sensors)[:, :2]
    assert weights.sum() == pytest.approx(1.0, abs=1e-12)
    expected = (source**2 + receiver**2) / 4 * np.eye(2)
    np.testing.assert_allclose(offset.T * weights @ offset, expected, rtol=1e-3, atol=1e-9)


@pytest.mark.study
@pytest.mark.parametrize("alpha", [0.02, 0.03])
def test_wide_apertures_do_not_bias_alpha(alpha: float) -> None:
    """Mirror-like data averaged by brute force, read with 1.5° receiver and 0.5° source; then without saying so.

    Unsaid, alpha is off by more than ten standard deviations of the fit that is told; its own are wider, for it misses
    the data.
    """
    truth = fm.model("lambert+ggx", kd=0.1, alpha=alpha, eta=1.5)
    instrument = Instrument(source=0.5 * DEGREE, receiver=1.5 * DEGREE)
    wi, wo = plane(THETA_I, np.arange(-80.0, 80.5, 1.0) * DEGREE)
    exact = averaged(truth, wi, wo, instrument)
    for seed in range(3):
        sigma = np.hypot(0.02 * exact, 1e-3)
        value = exact + sigma * np.random.default_rng(seed).normal(size=exact.shape)
        valid = np.ones(value.shape, bool)
        m = fm.Measurements(wi, wo, value, sigma, valid, ("value",), instrument=instrument)
        told = fm.fit(m, "lambert+ggx", fixed={"ks": 1.0})
        assert np.max(np.abs(deviations(told, alpha=alpha, kd=0.1, eta=1.5))) <= THREE
        blind = fm.fit(dataclasses.replace(m, instrument=IDEAL), "lambert+ggx", fixed={"ks": 1.0})
        place, unsaid = (next(e.place.start for e in fit.entries if e.name == "alpha") for fit in (told, blind))
        assert blind.values[unsaid] - alpha > 10.0 * np.sqrt(told.covariance[place, place])


def deviations(fit: fm.Fit, **truth: float) -> list[float]:
    """(estimate − truth)/sd of the named parameters."""
    sd, places = np.sqrt(np.diagonal(fit.covariance)), {e.name: e.place.start for e in fit.entries}
    return [float((fit.values[places[name]] - true) / sd[places[name]]) for name, true in truth.items()]


@pytest.mark.study
def test_a_shared_calibration_error_is_covered() -> None:
    """95 % intervals of kd over 200 repeats with a 3 % scale error: with the correlated term, and without it."""
    truth, instrument = fm.model("lambert+ggx", kd=0.3, alpha=0.2, eta=1.5), Instrument(calibration=0.03)
    inside, blind = [], []
    for seed in range(200):
        m = fm.simulate(truth, THETA_I, THETA_O, relative_noise=0.02, absolute_noise=1e-3, seed=seed,
                        instrument=instrument)  # fmt: skip
        for told, found in ((m, inside), (dataclasses.replace(m, instrument=IDEAL), blind)):
            fit = fm.fit(told, "lambert+ggx")
            found.append(abs(deviations(fit, kd=0.3)[0]) < 1.96)
    print(f"coverage of kd: {np.mean(inside):.3f} with the correlated term, {np.mean(blind):.3f} without")
    assert 0.92 <= np.mean(inside) <= 0.98
    assert np.mean(blind) < 0.3


@pytest.mark.study
def test_a_planted_dark_signal_is_recovered() -> None:
    truth = fm.model("lambert+ggx", kd=0.05, alpha=0.1, eta=1.5)
    shown = Instrument(dark=0.01)
    m = fm.simulate(truth, THETA_I, THETA_O, relative_noise=0.02, absolute_noise=1e-4, seed=3, instrument=shown)
    known = fm.fit(m, "lambert+ggx", fixed={"ks": 1.0})
    fitted = fm.fit(dataclasses.replace(m, instrument=Instrument(dark=None)), "lambert+ggx", fixed={"ks": 1.0})
    assert np.max(np.abs(deviations(known, kd=0.05, alpha=0.1, eta=1.5))) <= THREE
    assert np.max(np.abs(deviations(fitted, kd=0.05, alpha=0.1, eta=1.5, dark=0.01))) <= THREE


def test_a_calibration_prior_is_sampled_as_it_is_given() -> None:
    """Data that say nothing of the scale leave ln g its prior, N(0, 0.1²)."""
    flat = fm.from_arrays(np.full(60, 0.5), np.linspace(-1.2, 1.2, 60), np.full(60, 0.1), sigma=np.full(60, 1e-4),
                          instrument=Instrument(calibration=0.1))  # fmt: skip
    posterior = fm.sample(fm.fit(flat, "lambert"), seed=0)
    place = next(e.place.start for e in posterior.fit.entries if e.name == "scale")
    logs = np.log(posterior.values[:, place])
    assert posterior.verdict == "reliable"
    # Some 2,500 effective draws: the mean is good to 0.002, the sd to 1.4 %.
    assert logs.mean() == pytest.approx(0.0, abs=0.006)
    assert logs.std() == pytest.approx(0.1, rel=0.05)


@pytest.mark.study
def test_the_match_is_of_the_surfaces_and_not_of_the_instrument() -> None:
    truth = fm.model("lambert+blinn-phong", kd=0.3, ks=0.2, exponent=100.0)
    m = fm.simulate(truth, THETA_I, THETA_O, relative_noise=0.01, absolute_noise=1e-4, seed=0)
    through = dataclasses.replace(m, value=m.value * 1.03, instrument=Instrument(calibration=0.03))
    plain, shown = (
        fm.compare(*(fm.laplace(fm.fit(x, name), seed=0) for name in ("lambert+blinn-phong", "lambert+ggx")))
        for x in (m, through)
    )
    assert shown.hemisphere_distance.value == pytest.approx(plain.hemisphere_distance.value, rel=0.02)


def test_surface_takes_off_instrument_and_mount() -> None:
    base = fm.model("lambert")
    assert surface(Seen(fm.model("tilt-over-lambert"), Instrument(0.1))).name == "lambert"
    assert surface(base) is base


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"source": 1.0}, r"source = 1 of the instrument, expected 0 to 0.5236 radians"),
        ({"receiver": -0.1}, r"receiver = -0.1 of the instrument"),
        ({"calibration": np.nan}, r"calibration = nan of the instrument, expected 0 to 1\."),
        ({"dark": np.inf}, r"dark = inf of the instrument"),
        ({"angle_error": 0.1}, r"angle_error = 0.1 of the instrument, expected 0 to 0.03491 radians; is it in degrees"),
        ({"angle_error": np.nan}, r"angle_error = nan of the instrument"),
        ({"source": 0.1, "aperture_error": 0.6}, r"aperture_error = 0.6 of the instrument, expected 0 to 0.5, a frac"),
        ({"aperture_error": 0.1}, r"aperture_error = 0.1 of an instrument without apertures .* expected a half-angle"),
    ],
)
def test_impossible_instruments_are_refused(given: dict[str, float], message: str) -> None:
    with pytest.raises(ReadError, match=message):
        Instrument(**given)


def offsets(of_light: float, of_sensor: float) -> dict[str, Any]:
    return {"theta_i_offset": jnp.array(of_light), "theta_o_offset": jnp.array(of_sensor)}


@pytest.mark.parametrize("phi", [0.0, 0.7])
def test_offsets_are_what_is_added_to_the_angles(phi: float) -> None:
    """A surface at the true angles, and the read ones with offsets; the cosine of the light is that of the true one."""
    base, light, sensor = fm.model("lambert+ggx", kd=0.2, alpha=0.1, eta=1.5), 0.6, np.linspace(-1.2, 1.2, 25)
    turned = np.full(25, phi)
    wi, read = from_angles(np.full(25, light), turned), from_angles(sensor, turned + np.pi)
    shown = Seen(base, IDEAL, **offsets(0.5, -1.5))
    there = from_angles(np.full(25, light + 0.5 * DEGREE), turned), from_angles(sensor - 1.5 * DEGREE, turned + np.pi)
    expected = fm.evaluate(base, *there) * np.cos(light + 0.5 * DEGREE) / np.cos(light)
    np.testing.assert_allclose(fm.evaluate(shown, wi, read), expected, rtol=1e-10)


def test_out_of_the_plane_an_offset_counts_from_the_normal() -> None:
    base, azimuth = fm.model("ggx", alpha=0.2, eta=1.5), np.linspace(0.1, 3.0, 12)
    wi, read = from_angles(np.full(12, 0.5), 0.0 * azimuth), from_angles(np.full(12, 0.7), azimuth)
    shown = Seen(base, IDEAL, **offsets(0.0, 2.0), signed=False)
    expected = fm.evaluate(base, wi, from_angles(np.full(12, 0.7 + 2.0 * DEGREE), azimuth))
    np.testing.assert_allclose(fm.evaluate(shown, wi, read), expected, rtol=1e-10)


def test_light_along_the_normal_has_a_mirror_side() -> None:
    """That of `from_angles`: the offset of a signed angle has the same sign on both sides."""
    base, sensor = fm.model("ggx", alpha=0.2, eta=1.5), np.array([-0.4, 0.0, 0.4])
    wi, read = from_angles(np.zeros(3), np.zeros(3)), from_angles(sensor, np.full(3, np.pi))
    shown = Seen(base, IDEAL, **offsets(0.0, 2.0))
    expected = fm.evaluate(base, wi, from_angles(sensor + 2.0 * DEGREE, np.full(3, np.pi)))
    np.testing.assert_allclose(fm.evaluate(shown, wi, read), expected, rtol=1e-10)


def test_a_wider_aperture_is_that_of_wider_half_angles() -> None:
    base, wide = fm.model("ggx", alpha=0.05, eta=1.5), Instrument(0.5 * DEGREE, 1.5 * DEGREE)
    wi, wo = plane(THETA_I, np.array([25.0, 30.0, 33.0, 48.0, 50.0]) * DEGREE)
    shown = fm.evaluate(Seen(base, wide, aperture=jnp.array(1.2)), wi, wo)
    np.testing.assert_allclose(
        shown, fm.evaluate(Seen(base, Instrument(0.6 * DEGREE, 1.8 * DEGREE)), wi, wo), rtol=1e-4
    )


def test_jitter_is_the_spread_of_values_at_drawn_angles() -> None:
    """20,000 draws of the angles of each reading, on the flanks and on the top of a lobe."""
    base, sd, rng = fm.model("lambert+ggx", kd=0.1, alpha=0.1, eta=1.5), 0.4 * DEGREE, np.random.default_rng(0)
    light, sensor = 30.0 * DEGREE, np.array([-20.0, 22.0, 26.0, 30.0, 35.0]) * DEGREE
    m = fm.from_arrays(np.full(5, light), sensor, np.ones(5), sigma=np.full(5, 1e-3))
    found = jittered(prepare(m, measured_noise(m)), base, sd, signed=True)
    drawn = []
    for reading in sensor:
        i, o = light + sd * rng.normal(size=20_000), reading + sd * rng.normal(size=20_000)
        value = fm.evaluate(base, from_angles(i, np.zeros_like(i)), from_angles(o, np.full_like(o, np.pi)))[:, 0]
        drawn.append(np.std(value * np.cos(i)))
    np.testing.assert_allclose(found.jitter[:5, 0], drawn, rtol=0.03)
    np.testing.assert_allclose(found.noise[:5, 0] ** 2, found.jitter[:5, 0] ** 2 + (1e-3 * np.cos(light)) ** 2)
    assert not found.jitter[5:].any()


@pytest.mark.study
def test_noise_that_readings_show_has_their_jitter_in_it() -> None:
    truth, told = fm.model("lambert+ggx", kd=0.3, alpha=0.2, eta=1.5), Instrument(angle_error=0.2 * DEGREE)
    m = fm.simulate(truth, THETA_I, THETA_O, relative_noise=0.02, absolute_noise=1e-3, seed=0, give_sigma=False,
                    instrument=told)  # fmt: skip
    fit = fm.fit(m, "lambert+ggx")
    assert fit.data.jitter is None
    assert {"theta_i_offset", "theta_o_offset"} <= {e.name for e in fit.entries}


def test_a_tilt_beside_an_error_of_the_angles_is_refused() -> None:
    m = fm.simulate(fm.model("lambert", kd=0.3), THETA_I, THETA_O, relative_noise=0.02, absolute_noise=1e-3, seed=0,
                    instrument=Instrument(angle_error=0.1 * DEGREE))  # fmt: skip
    with pytest.raises(ModelError, match=r"a tilt \(--tilt\) beside angle_error = 0.1° .* expected one of the two"):
        fm.fit(m, "tilt-over-lambert")
    with pytest.raises(ModelError, match=r"prior of theta_i_offset beside the instrument's angle_error"):
        fm.fit(m, "lambert", priors={"theta_i_offset": (0.0, 0.1)})


@pytest.mark.study
def test_errors_of_the_angles_are_covered() -> None:
    """95 % intervals over 500 data sets with offsets and jitter of 0.2° drawn for each; in 100 of them also unsaid.

    Where it is not, readings that count as independent hold the truth far less often; what the correlation of the
    misfit adds holds it, by intervals that are wider than those of the fit that is told.
    """
    said = Instrument(angle_error=0.2 * DEGREE)
    truth: dict[str, Any] = {"kd": 0.3, "ks": 1.0, "alpha": 0.1, "eta": 1.5}
    told, alone = [], []
    for seed in range(500):
        m = fm.simulate(fm.model("lambert+ggx", **truth), THETA_I, THETA_O, relative_noise=0.01, absolute_noise=1e-3,
                        seed=seed, instrument=said)  # fmt: skip
        told.append([abs(z) < 1.96 for z in deviations(fm.fit(m, "lambert+ggx"), **truth)])
        if seed >= 100:
            continue
        blind = fm.fit(dataclasses.replace(m, instrument=IDEAL), "lambert+ggx")
        sd, places = np.sqrt(np.diagonal(blind.likelihood_covariance)), {e.name: e.place.start for e in blind.entries}
        alone.append([abs(blind.values[places[n]] - true) < 1.96 * sd[places[n]] for n, true in truth.items()])
    covered = [dict(zip(truth, np.mean(found, axis=0), strict=True)) for found in (told, alone)]
    print(covered)
    chance = 4.0 * np.sqrt(0.95 * 0.05 / 500)  # four standard errors
    assert all(abs(share - 0.95) <= chance for share in covered[0].values())
    least = min(covered[1].values())
    assert least + 4.0 * np.sqrt(least * (1.0 - least) / 100) < 0.7


def test_an_instrument_says_what_it_does() -> None:
    words = str(Instrument(0.5 * DEGREE, 1.5 * DEGREE, 0.03, None))
    assert words == (
        "Instrument: source of 0.5° half-angle; receiver of 1.5° half-angle; calibration good to 3 %, shared by all "
        "values; dark signal fitted."
    )
    assert str(IDEAL) == ""
