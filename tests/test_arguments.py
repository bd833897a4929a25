"""What public functions are given: units and wrong things are named at the door, before anything is computed."""

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import FitmatError


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: fm.from_arrays([20, 50], 0.1, [1, 1]), r"theta_i = 20: expected 0 to π/2 radians\. Are the ang"),
        (lambda: fm.from_arrays(-0.1, [0.1], [1]), r"theta_i = -0\.1: expected 0 to π/2 radians"),
        (lambda: fm.from_arrays(0.1, [0.1, -45], [1, 1]), "theta_o = -45: expected −π/2 to π/2 radians"),
        (lambda: fm.from_arrays(0.1, [0.1], [1], phi=180), "phi = 180: expected −2π to 2π radians"),
        (lambda: fm.from_arrays(0.1, [0.1], [1], phi_i=90), "phi_i = 90: expected −2π to 2π radians"),
        (lambda: fm.albedo(fm.model("lambert"), 45), "theta_i = 45: expected 0 to π/2 radians"),
        (lambda: fm.albedo(fm.model("lambert"), 0.5, 90), "phi_i = 90: expected −2π to 2π radians"),
        (lambda: fm.albedo(fm.model("lambert"), phi_i=0.5), r"phi_i without theta_i: .*\. Give both, or neither"),
        (lambda: fm.Instrument(receiver=2), r"receiver = 2 of the instrument, expected 0 to 0\.5236 radians .*in deg"),
    ],
)
def test_degrees_are_asked_about(call, message) -> None:
    """Radians are meant: 45 rad is 58° beyond seven turns, and was read so."""
    with pytest.raises(FitmatError, match=message):
        call()


def test_rounded_right_angles_are_right_angles() -> None:
    """float32 writes π/2 as 1.5707964, 4e-8 too large."""
    found = fm.from_arrays(np.float32([np.pi / 2, 0.5]), 0.5, [1.0, 1.0])
    assert found.n_samples == 2


def test_what_is_masked_or_missing_is_masked() -> None:
    """NumPy's masked arrays, None and NaN: no datum is made of what stands behind the mask."""
    value = np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False])
    assert fm.from_arrays(0.5, [0.1, 0.2, 0.3], value).valid[:, 0].tolist() == [True, False, True]
    assert fm.from_arrays(0.5, [0.1, np.nan, 0.3], [1.0, 2.0, None]).valid[:, 0].tolist() == [True, False, False]
