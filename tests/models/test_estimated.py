"""Multiple scattering by name: against Heitz's own program, in sums, simulated, and refused where it cannot be."""

from typing import Any

import numpy as np
import pytest
from oracles.multiscatter import VALUES
from selection import always

import fitmat as fm
from fitmat.maths.directions import from_angles
from fitmat.models import estimated
from fitmat.models.registry import WALKS

ROWS = [row for row in VALUES if (row.distribution, row.alpha_x, row.alpha_y, row.eta) == ("ggx", 0.5, 0.5, 0)]
"""Heitz's MicrosurfaceScattering.cpp, white mirrors."""

WHITE: dict[str, Any] = {"f0": 0.999}
"""The whitest that has a name."""

ABSORBED = 0.003
"""Relative; what 0.999 takes of light that meets up to three facets, on the mean less than twice."""

SIGMAS = 4.0

SAMPLES = 12_800
"""Everywhere the same, so that one program is compiled."""

ALPHA: dict[str, Any] = {"alpha": 0.5}
WI, WO = (from_angles(np.deg2rad([20.0, 50.0, 70.0]), np.array(phi)) for phi in ([0.0, 0.3, 0.1], [3.0, 2.0, 3.2]))


@pytest.mark.parametrize("estimator", always({"walk"}, ["walk", "slab"]))
def test_values_are_those_of_heitzs_program(estimator: str) -> None:
    """The sum of all orders; the light at azimuth 20°."""
    rows = [row for row in ROWS if row.order == 0]
    theta_i, theta_o, phi = np.deg2rad([[row.theta_i, row.theta_o, row.phi] for row in rows]).T
    wi, wo = from_angles(theta_i, 0 * phi), from_angles(theta_o, phi)
    model = fm.model(f"ggx-{estimator}-schlick", **ALPHA, **WHITE)
    found = fm.evaluate(model, wi, wo, samples=SAMPLES, seed=1)
    expected = np.array([row.value for row in rows])
    error = np.hypot(found.standard_error[:, 0], [row.standard_error for row in rows])
    assert len(rows) == 5
    assert np.all(np.abs(found.value[:, 0] - expected) < SIGMAS * error + ABSORBED * expected)


def test_a_sum_is_the_sum_and_ks_a_factor() -> None:
    """Beside a Lambert lobe in two channels; directions below the surface give 0."""
    sampled: dict[str, Any] = {"samples": SAMPLES, "seed": 3}
    alone = fm.evaluate(fm.model("ggx-walk-schlick", **ALPHA, f0=0.8), WI, WO, **sampled)
    both = fm.model("lambert+ggx-walk-schlick", **ALPHA, f0=0.8, kd=np.array([0.1, 0.4]), ks=0.5, channels=2)
    found = fm.evaluate(both, WI, WO, **sampled)
    assert both.name == "lambert+ggx-walk-schlick"
    np.testing.assert_allclose(found.value, 0.5 * alone.value + np.array([0.1, 0.4]) / np.pi, rtol=1e-12)
    np.testing.assert_allclose(found.standard_error, 0.5 * alone.standard_error * [1, 1], rtol=1e-12)
    below = fm.evaluate(both, WI, WO * [[1, 1, 1], [1, 1, -1], [1, 1, 1]], **sampled)
    assert not below.value[1].any()
    assert not below.standard_error[1].any()
    assert (below.value[[0, 2]] > 0).all()


@pytest.mark.study
def test_many_pairs_are_followed_in_parts_with_seeds_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(estimated, "ROWS", 64)
    wi, wo = (np.tile(w[:1], (70, 1)) for w in (WI, WO))
    found = fm.evaluate(fm.model("ggx-walk-schlick", **ALPHA, f0=0.9), wi, wo, samples=SAMPLES, seed=1)
    assert found.value.shape == (70, 1)
    assert abs(found.value[0] - found.value[64]) > 0
    assert found.samples == SAMPLES


def test_simulated_measurements_scatter_as_they_say() -> None:
    """Without other noise σ is the standard error; the same seed gives the same file, another one another."""
    model = fm.model("ggx-walk-schlick", **ALPHA, f0=0.9)
    angles: dict[str, Any] = {"theta_i": [0.3, 1.0], "theta_o": [-0.6, 0.2, 0.9]}
    noise: dict[str, Any] = {"relative_noise": 0.0, "absolute_noise": 1e-9}
    one, again, other = (fm.simulate(model, **angles, **noise, samples=SAMPLES, seed=seed) for seed in (1, 1, 2))
    third = fm.evaluate(model, one.wi, one.wo, samples=SAMPLES, seed=5)
    np.testing.assert_array_equal(one.value, again.value)
    assert (one.value != other.value).all()
    assert one.sigma is not None
    assert np.all(np.abs(one.value - third.value) < SIGMAS * np.hypot(one.sigma, third.standard_error))
    assert (one.sigma < 0.05 * one.value).all()


def test_every_name_has_its_lobe() -> None:
    for name, (single, estimator) in WALKS.items():
        assert fm.model(name).name == name
        assert fm.model(single).name == name.replace(f"-{estimator}", "")


WALK = fm.model("ggx-walk", **ALPHA)
MEASURED = fm.from_arrays(0.5, [0.1, 0.2, 0.3], [1.0, 1.0, 1.0])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: fm.fit(MEASURED, "ggx-walk"), "ggx-walk is estimated from random walks .* take ggx-kc"),
        (lambda: fm.fit(MEASURED, WALK), "ggx-walk is estimated .* no formula to fit"),
        (lambda: fm.study(MEASURED, "lambert+ggx-slab"), r"lambert\+ggx-slab is estimated .* expected another model"),
        (lambda: fm.albedo(WALK, 0.5), r"albedo_walk\(model.surface"),
        (lambda: fm.imitate(WALK, "lambert"), "no formula"),
        (lambda: fm.evaluate(WALK, WI, WO), "samples is None, expected a whole number of at least 2"),
        (lambda: fm.evaluate(WALK, WI, WO, samples=0, seed=1), "samples is 0, expected"),
        (lambda: fm.evaluate(WALK, WI, WO, samples=100, seed=-1), "seed is -1, expected"),
        (lambda: fm.evaluate(fm.model("ggx"), WI, WO, samples=100, seed=1), "samples = 100 beside ggx, expected None"),
        (lambda: fm.evaluate(WALK, WI[:2], WO, samples=100, seed=1), r"shapes \(2, 3\) and \(3, 3\): expected"),
        (lambda: fm.model("varnish-over-ggx-walk"), "expected one of ggx-walk, alone or in a sum without ggx, below"),
        (lambda: fm.model("ggx-walk+ggx-slab"), "expected one of ggx-walk, ggx-slab, alone"),
        (lambda: fm.model("ggx+ggx-walk"), "in a sum without ggx, .* ggx is its first collision"),
        (lambda: fm.model("ggx-wlk"), "no lobe 'ggx-wlk'; try ggx-walk"),
        (lambda: fm.model("ggx-walk", masking="separable"), "masking 'separable' of ggx-walk: expected correlated"),
        (lambda: fm.model("ggx-walk", alpha=0.0), "parameter alpha = 0: expected a value from 0.0001 to 1"),
        (
            lambda: fm.simulate(WALK, 0.5, 0.5, relative_noise=0.1, absolute_noise=0.0, seed=1),
            "samples is None, expected",
        ),
        (
            lambda: fm.simulate(
                WALK, 0.5, 0.5, relative_noise=0.1, absolute_noise=0.0, seed=1, samples=9,
                instrument=fm.Instrument(receiver=0.01),
            ),
            "instrument of ggx-walk: expected an ideal one",
        ),
    ],
)  # fmt: skip
def test_what_has_no_formula_is_refused_in_a_sentence(call: Any, message: str) -> None:
    with pytest.raises(fm.FitmatError, match=message):
        call()
