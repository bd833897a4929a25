"""The budget of uncertainty: against the GUM Tree Calculator, and against simulated readings with errors of angles.

The GTC programs (B. D. Hall, SoftwareX 20, 2022) are written from the measurement's own equation and know no fit.
"""

import dataclasses
from typing import Any

import GTC
import numpy as np
import pytest

import fitmat as fm
from fitmat.judgement.budget import Budget, Line, draw_up
from fitmat.measurements.instrument import Instrument
from fitmat.uncertainty.derived import derived

gtc: Any = GTC
DEGREE = np.pi / 180

DIGITS = 5e-4
"""Relative difference of numbers that agree to three digits."""


def budget_of(fit: fm.Fit) -> Budget:
    posterior = fm.laplace(fit, seed=0)
    fitted = posterior.quantities()
    found = draw_up(posterior, fitted, derived(posterior, fitted))
    assert found is not None
    return found


def parts(found: Budget, name: str, *sources: str) -> list[float]:
    """The parts of one line; what is not asked for must be negligible, but the draws."""
    line = next(line for line in found.lines if line.name == name)
    left = {source: u for source, u in line.parts.items() if source not in (*sources, "sampling")}
    assert max(left.values()) < 1e-2 * line.combined
    return [line.parts[source] for source in sources]


def coefficient(found: Budget, one: str, other: str) -> float:
    names = [line.name for line in found.lines]
    return found.correlation[names.index(one), names.index(other)]


def ggx(wi: np.ndarray, wo: np.ndarray, alpha: float, eta: float) -> np.ndarray:
    """D G₂ F/(4 c_i c_o) of Walter et al. 2007 with height-correlated masking (Heitz 2014), one pair a row."""
    h = wi + wo
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    cos = h[:, 2] ** 2
    d = alpha**2 / (np.pi * (cos * (alpha**2 - 1.0) + 1.0) ** 2)
    smith = [0.5 * (np.sqrt(1.0 + alpha**2 * (1.0 / w[:, 2] ** 2 - 1.0)) - 1.0) for w in (wi, wo)]
    c = np.sum(wi * h, axis=1)
    g = np.sqrt(eta**2 - 1.0 + c**2)
    f = 0.5 * ((g - c) / (g + c)) ** 2 * (1.0 + ((c * (g + c) - 1.0) / (c * (g - c) + 1.0)) ** 2)
    return d * f / (1.0 + smith[0] + smith[1]) / (4.0 * wi[:, 2] * wo[:, 2])


@pytest.mark.study
def test_weights_of_two_lobes_under_a_shared_error_of_the_scale() -> None:
    """Weighted least squares of y = g (kd/π + ks L) by its normal equations, in uncertain numbers."""
    truth = fm.model("lambert+ggx", kd=0.3, ks=0.8, alpha=0.2, eta=1.5)
    m = fm.simulate(truth, np.array([20.0, 50.0]) * DEGREE, np.arange(-70.0, 71.0, 10.0) * DEGREE,
                    relative_noise=0.02, absolute_noise=1e-3, seed=4)  # fmt: skip
    assert m.sigma is not None
    u = m.sigma[:, 0]
    lobe, weight = ggx(m.wi, m.wo, 0.2, 1.5), 1.0 / u**2
    y = [gtc.ureal(float(value), float(sd)) for value, sd in zip(m.value[:, 0], u, strict=True)]
    g = gtc.ureal(1.0, 0.03)
    columns = [np.full(len(u), 1.0 / np.pi), lobe]
    (a, b), (_, d) = [[float(np.sum(weight * p * q)) for q in columns] for p in columns]
    one, other = (sum(w * p * v for w, p, v in zip(weight, column, y, strict=True)) for column in columns)
    kd, ks = (d * one - b * other) / (a * d - b * b) / g, (a * other - b * one) / (a * d - b * b) / g

    instrument = Instrument(calibration=0.03)
    fit = fm.fit(dataclasses.replace(m, instrument=instrument), "lambert+ggx", fixed={"alpha": 0.2, "eta": 1.5},
                 loss="gaussian")  # fmt: skip
    found = budget_of(fit)
    for name, expected in (("kd", kd), ("ks", ks)):
        line = next(line for line in found.lines if line.name == name)
        scale = gtc.component(expected, g)
        readings = np.sqrt(expected.u**2 - scale**2)
        assert line.value == pytest.approx(expected.x, rel=DIGITS)
        np.testing.assert_allclose(parts(found, name, "readings", "calibration"), [readings, scale], rtol=DIGITS)
        assert line.combined == pytest.approx(expected.u, rel=DIGITS)
    assert coefficient(found, "kd", "ks") == pytest.approx(gtc.get_correlation(kd, ks), abs=DIGITS)


def test_a_brdf_from_radiance_intensity_distance_and_an_angle() -> None:
    """f = L d²/(I cosθ_i) of a Lambertian sample, θ_i with an error of its scale and one of each setting."""
    count, theta, sd, rng = 9, 60.0 * DEGREE, 0.1 * DEGREE, np.random.default_rng(0)
    radiance, noise = 2.0 + 0.02 * rng.normal(size=count), 0.02
    intensity, distance = gtc.ureal(50.0, 0.5), gtc.ureal(0.8, 0.002)
    offset = gtc.ureal(0.0, sd)
    inputs = [(gtc.ureal(float(v), noise), gtc.ureal(0.0, sd)) for v in radiance]
    each = [value * distance**2 / (intensity * gtc.cos(theta + offset + own)) for value, own in inputs]
    kd: Any = np.pi * sum(each) / count
    expected = {
        "readings": np.sqrt(sum(gtc.component(kd, value) ** 2 for value, _ in inputs)),
        "angle jitter": np.sqrt(sum(gtc.component(kd, own) ** 2 for _, own in inputs)),
        "angle offsets": abs(gtc.component(kd, offset)),
        "calibration": np.hypot(gtc.component(kd, intensity), gtc.component(kd, distance)),
    }

    told = Instrument(calibration=float(np.hypot(0.5 / 50.0, 2 * 0.002 / 0.8)), angle_error=sd)
    table = {"theta_i": np.full(count, 60.0), "theta_o": np.linspace(-60.0, 60.0, count), "radiance": radiance,
             "sigma": np.full(count, noise)}  # fmt: skip
    m = fm.read(table, intensity=50.0, distance=0.8, instrument=told)
    found = budget_of(fm.fit(m, "lambert", loss="gaussian"))
    np.testing.assert_allclose(parts(found, "kd", *expected), list(expected.values()), rtol=DIGITS)
    line = next(line for line in found.lines if line.name == "kd")
    assert (line.value, line.combined) == (pytest.approx(kd.x, rel=DIGITS), pytest.approx(kd.u, rel=DIGITS))


def test_f0_of_an_index_that_is_correlated_with_a_weight() -> None:
    truth = fm.model("lambert+ggx", kd=0.3, ks=0.8, alpha=0.2, eta=1.5)
    m = fm.simulate(truth, np.array([10.0, 40.0, 70.0]) * DEGREE, np.arange(-80.0, 81.0, 5.0) * DEGREE,
                    relative_noise=0.02, absolute_noise=1e-3, seed=1)  # fmt: skip
    fit = fm.fit(m, "lambert+ggx", loss="gaussian")
    places = [next(e.place.start for e in fit.entries if e.name == name) for name in ("ks", "eta")]
    covariance = fit.covariance[np.ix_(places, places)]
    sd = np.sqrt(np.diagonal(covariance))
    ks, eta = (gtc.ureal(float(fit.values[k]), float(u), independent=False) for k, u in zip(places, sd, strict=True))
    gtc.set_correlation(float(covariance[0, 1] / sd[0] / sd[1]), ks, eta)
    f0 = ((eta - 1) / (eta + 1)) ** 2
    product = ks * f0

    found = budget_of(fit)
    assert abs(coefficient(found, "ks", "eta")) > 0.5
    for name, expected in (("f0", f0), ("ks·F0", product)):
        line = next(line for line in found.lines if line.name == name)
        assert line.value == pytest.approx(expected.x, rel=DIGITS)
        assert line.combined == pytest.approx(expected.u, rel=DIGITS)
    for one, other, pair in (("f0", "ks·F0", (f0, product)), ("ks", "ks·F0", (ks, product))):
        assert coefficient(found, one, other) == pytest.approx(gtc.get_correlation(*pair), abs=1e-3)


def two_lobes(seed: int) -> fm.Measurements:
    """A surface that no single lobe describes."""
    wide, narrow = (fm.model("lambert+ggx", kd=0.2, ks=ks, alpha=a, eta=1.5) for ks, a in ((0.5, 0.3), (0.5, 0.08)))
    angles = np.array([10.0, 40.0, 65.0]) * DEGREE, np.arange(-76.0, 77.0, 2.0) * DEGREE
    one, other = (
        fm.simulate(x, *angles, relative_noise=0.01, absolute_noise=1e-4, seed=seed + k)
        for k, x in enumerate((wide, narrow))
    )
    assert one.sigma is not None
    return dataclasses.replace(one, value=0.5 * (one.value + other.value))


def test_the_parts_add_up_to_the_covariance_of_the_fit() -> None:
    """Of a model that is wrong as well, where the misfit and its correlation are nearly all."""
    fit = fm.fit(two_lobes(0), "lambert+ggx")
    assert fit.correlation.found
    found = budget_of(fit)
    sd = dict(zip([e.name for e in fit.entries], np.sqrt(np.diagonal(fit.covariance)), strict=True))
    for line in found.lines:
        if line.name in sd:
            assert line.combined == pytest.approx(sd[line.name], rel=2e-3)
            assert line.shares["misfit"] > 0.9


def test_the_albedo_is_that_of_the_integrator() -> None:
    fit = fm.fit(two_lobes(0), "lambert+ggx")
    line = next(line for line in budget_of(fit).lines if line.name == "albedo")
    assert line.value == pytest.approx(float(fm.albedo(fit.model, 8.0 * DEGREE).value[0, 0]), abs=2e-4)


def test_what_is_fixed_or_on_a_bound_has_no_parts() -> None:
    m = fm.simulate(fm.model("lambert+ggx", kd=0.3, alpha=0.1, eta=1.5), [0.2, 0.9], np.linspace(-1.3, 1.3, 41),
                    relative_noise=0.02, absolute_noise=1e-3, seed=0)  # fmt: skip
    found = budget_of(fm.fit(m, "lambert+ggx", fixed={"ks": 1.0}))
    line = next(line for line in found.lines if line.name == "ks")
    assert (line.parts, line.remark) == ({}, "fixed")
    assert np.isnan(line.expanded)
    assert "ks·F0" not in [line.name for line in found.lines]
    assert found.unstated == (
        "No error of the calibration (--calibration) or of the angles (--angle-error) is stated, so none is counted."
    )


def test_an_objective_has_no_budget() -> None:
    m = fm.simulate(fm.model("lambert", kd=0.3), [0.2, 0.9], np.linspace(-1.3, 1.3, 11),
                    relative_noise=0.02, absolute_noise=1e-3, seed=0)  # fmt: skip
    posterior = fm.laplace(fm.fit(m, "lambert", loss="log10"), seed=0)
    assert draw_up(posterior, posterior.quantities(), ()) is None


@pytest.mark.parametrize("u", [0.0, np.nan])
def test_what_has_no_uncertainty_is_a_sentence_all_the_same(u: float) -> None:
    line = Line("albedo", "ρ", "1", 0.0, {"readings": u, "misfit": 0.0})
    assert line.words == "albedo is 0, without an uncertainty that could be stated."
