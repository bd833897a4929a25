"""What follows from noise that is assumed: against the closed form of one weight, and in words."""

import numpy as np
import pytest

import fitmat as fm
from fitmat.fitting.result import Fit
from fitmat.judgement import assumed_noise
from fitmat.judgement.assumed_noise import ASSUMED, consequences
from fitmat.judgement.doubts import find_doubts

READINGS = 12
TRUE = 0.02


@pytest.fixture(scope="module")
def unknown() -> Fit:
    """k_d/π of twelve readings with noise of 2 %, too few for an estimate."""
    rng, theta = np.random.default_rng(3), np.deg2rad([20.0, 45.0, 60.0, 75.0])
    value = 0.3 / np.pi * (1 + TRUE * rng.normal(size=READINGS))
    return fm.fit(fm.from_arrays(np.repeat(theta, 3), np.tile([0.3, 0.8, 1.2], 4), value), "lambert")


def test_widths_are_those_of_a_mean(unknown: Fit) -> None:
    """σ(k_d)/k_d is the fraction over √n where the noise explains all that is left over, else what is left over."""
    found, own = consequences(unknown), np.sqrt(unknown.likelihood_covariance[0, 0]) / unknown.values[0]
    assert not unknown.noise.known
    left = np.std(unknown.measurements.value) / np.mean(unknown.measurements.value)
    assert own == pytest.approx(left / np.sqrt(READINGS), rel=0.1)  # s holds all of it; n and n − 1
    assert found[2, 1] * own == pytest.approx(ASSUMED[2] / np.sqrt(READINGS), rel=1e-3)
    assert found[2, 0] == 0.0
    assert found[0, 1] == pytest.approx(1.0, abs=0.1)  # 1 % does not explain it: the misfit takes the rest
    assert found[0, 0] == pytest.approx(left / ASSUMED[0] - 1.0, rel=0.2)  # spreads add up, a + d


def test_it_is_said_where_the_noise_is_unknown(unknown: Fit) -> None:
    words = find_doubts(unknown).words[-1]
    assert "the noise is not known. If it were 1, 3 or 10 % of each value, the misfit would be " in words
    assert words.endswith("times as wide as they are.")
    m = unknown.measurements
    given = fm.from_arrays(m.theta_i, m.theta_o, m.value, sigma=np.full_like(m.value, 1e-3))
    assert assumed_noise.words(fm.fit(given, "lambert")) == ""
