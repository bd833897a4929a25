"""Lighting: the inverse-square and cosine laws, and radiances read as BRDF."""

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import ReadError
from fitmat.measurements.lighting import PointSource, brdf_from_radiance

ROUNDING = 1e-14
"""Relative; a handful of multiplications."""


def test_irradiance_by_hand() -> None:
    """100 W/sr at 2 m: 25 W/m² upright, half of it at 60°, a quarter at twice the distance."""
    assert PointSource(100.0, 2.0).irradiance(0.0) == pytest.approx(25.0, rel=ROUNDING)
    assert PointSource(100.0, 2.0).irradiance(np.pi / 3) == pytest.approx(12.5, rel=ROUNDING)
    assert PointSource(100.0, 4.0).irradiance(0.0) == pytest.approx(6.25, rel=ROUNDING)


def test_a_white_lambertian_sheet_has_the_radiance_of_the_textbook() -> None:
    """L = ρE/π (Nicodemus et al. 1977): 25 W/m² on white paper look like 7.958 W/(m² sr) from anywhere."""
    assert brdf_from_radiance(25.0 / np.pi, 0.0, PointSource(100.0, 2.0)) == pytest.approx(1 / np.pi, rel=ROUNDING)


def test_radiances_in_a_table_become_brdf_with_their_sigma() -> None:
    """Lambert's 0.8 under a source of 50 W/sr at 0.5 m, written as radiances; the note says what was done."""
    theta_i, theta_o = np.array([10.0, 40.0, 70.0]), np.array([0.0, 20.0, -50.0])
    radiance = 0.8 / np.pi * 50.0 * np.cos(np.deg2rad(theta_i)) / 0.25
    table = {"theta_i": theta_i, "theta_o": theta_o, "radiance": radiance, "sigma": 0.01 * radiance}
    m = fm.read(table, intensity=50.0, distance=0.5)
    np.testing.assert_allclose(m.value[:, 0], 0.8 / np.pi, rtol=1e-12)
    assert m.sigma is not None
    np.testing.assert_allclose(m.sigma[:, 0], 0.008 / np.pi, rtol=1e-12)
    assert "I = 50 W/sr at d = 0.5 m" in " ".join(m.notes)


@pytest.mark.parametrize(
    ("intensity", "distance"),
    [(0.0, 1.0), (-1.0, 1.0), (np.nan, 1.0), (1.0, 0.0), (1.0, np.inf), (1.0, 1e200), (1e200, 1.0), (1.0, 1e-200)],
)
def test_sources_that_cannot_be(intensity: float, distance: float) -> None:
    with pytest.raises(ReadError, match=r"(intensity|distance) = .*, expected a positive number"):
        PointSource(intensity, distance)
