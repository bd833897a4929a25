"""Readings at θ_o = 90°: masked for likelihoods, counted by the objectives of the literature."""

import numpy as np
import pytest

import fitmat as fm
from fitmat.fitting.likelihood import prepare
from fitmat.fitting.losses import LOSSES
from fitmat.measurements.noise import measured_noise

EXPONENT = 1.7


def grid() -> dict[str, np.ndarray]:
    """A smooth surface's 1/(B + β^g), β = |sinθ_o − sinθ_i| in the plane, every sensor angle to both horizons."""
    theta_i, theta_o = (x.ravel() for x in np.meshgrid([5.0, 45.0, 75.0], np.arange(-90.0, 91.0, 5.0), indexing="ij"))
    beta = np.abs(np.sin(np.deg2rad(theta_o)) - np.sin(np.deg2rad(theta_i)))
    return {"theta_i": theta_i, "theta_o": theta_o, "brdf": 3e-3 / (8e-4 + beta**EXPONENT)}


def test_they_are_masked_and_kept_aside() -> None:
    m = fm.read(grid())
    assert m.masked == {"at or below the horizon": 6}
    assert m.horizontal is not None
    flat = np.isfinite(m.horizontal)
    assert flat.sum() == 6
    np.testing.assert_array_equal(flat[:, 0], np.abs(grid()["theta_o"]) == 90.0)
    np.testing.assert_allclose(m.horizontal[flat], grid()["brdf"][flat[:, 0]])
    assert m.value[flat].max() == 0.0


@pytest.mark.parametrize(
    ("loss", "more"), [("default", 0), ("log10", 6), ("cube-root", 6), ("l2", 6), ("l2-cos", 6), ("ngan", 0)]
)
def test_objectives_count_them(loss: str, more: int) -> None:
    m = fm.read(grid())
    data = prepare(m, measured_noise(m), None, LOSSES[loss])
    left = np.count_nonzero(m.theta_o[m.valid[:, 0]] > np.deg2rad(80.01)) if loss == "ngan" else 0
    assert np.count_nonzero(data.weight) == m.n_valid + more - left
    assert data.wo[:, 2].min() > 0


def test_a_log_fit_of_a_wrong_model_needs_them() -> None:
    """Against log-log least squares of all rows by NumPy: A/β^g has no shoulder, which the truth has."""
    table = grid()
    beta = np.abs(np.sin(np.deg2rad(table["theta_o"])) - np.sin(np.deg2rad(table["theta_i"])))
    far = beta > 0.05
    table = {name: column[far] for name, column in table.items()}
    slope, level = np.polyfit(np.log10(beta[far]), np.log10(table["brdf"]), 1)
    fit = fm.fit(fm.read(table), "abg", fixed={"b": 1e-12}, loss="log10")
    assert fit["g"].value == pytest.approx(-slope, rel=1e-6)
    assert fit["a"].value == pytest.approx(10**level, rel=1e-6)
    without = fm.fit(fm.read({name: c[np.abs(table["theta_o"]) < 90] for name, c in table.items()}), "abg",
                     fixed={"b": 1e-12}, loss="log10")  # fmt: skip
    assert abs(without["g"].value / -slope - 1) > 1e-4


def test_a_quantity_with_its_cosine_has_none() -> None:
    """f cosθ_o is 0 at the horizon, whatever f is there."""
    table = grid()
    table["brdf_cos"] = table.pop("brdf") * np.cos(np.deg2rad(table["theta_o"]))
    assert fm.read(table).horizontal is None


def test_they_follow_the_rows() -> None:
    table = grid()
    m = fm.read(table)
    some = m.rows(np.flatnonzero(m.theta_i < 0.5))
    assert some.horizontal is not None
    assert np.isfinite(some.horizontal).sum() == 2
    first, rest = ({n: c[part] for n, c in table.items()} for part in (m.theta_i < 0.5, m.theta_i > 0.5))
    joined = fm.read([first, rest])
    assert joined.horizontal is not None
    assert np.isfinite(joined.horizontal).sum() == 6
