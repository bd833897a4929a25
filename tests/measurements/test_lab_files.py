"""Real files of laboratories, from the reader to the fit; they are looked for where `shared_data` says."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree

import fitmat as fm
from fitmat.errors import ReadError
from fitmat.maths.directions import from_angles
from fitmat.measurements.reader import EXCHANGED

JOINT = 3.0
"""Standard deviations of the difference that two fits of one sample may be apart."""

SHARED = np.deg2rad(1.0)
"""Directions so close are the same; the Zemax file is regridded from the measurement in the FRED file."""


def folded(m: fm.Measurements) -> np.ndarray:
    """Directions of the sensor about the plane of incidence, one side, set apart by incidence."""
    apart = np.round(np.rad2deg(m.theta_i))[:, None] * 10.0
    return np.hstack([apart, from_angles(m.theta_o, m.phi)])


@pytest.fixture(scope="module")
def black_anodise(shared_data: Path) -> tuple[fm.Measurements, fm.Measurements]:
    """The EC1 sample as Zemax and as FRED file."""
    folder = shared_data / "ua-loft"
    return fm.read(folder / "zemax/AnoBlackEC1onAlum.bsdf"), fm.read(folder / "fred/AnoBlackEC1onAlum.txt")


def test_two_formats_of_one_sample_agree_on_the_mirror_direction(black_anodise) -> None:
    """0.0348 sr⁻¹ at 10° in both, as the data's README has it."""
    mirror = from_angles(np.deg2rad([10.0]), np.array([np.pi]))
    for m in black_anodise:
        lit = np.flatnonzero((np.abs(np.rad2deg(m.theta_i) - 10) < 0.1) & m.valid[:, 0])
        nearest = lit[np.argmax(from_angles(m.theta_o, m.phi)[lit] @ mirror[0])]
        assert m.value[nearest, 0] == pytest.approx(0.0348, abs=5e-5)


def test_zeros_below_the_horizon_are_no_data(black_anodise) -> None:
    zemax = black_anodise[0]
    below = zemax.wo[:, 2] < -1e-6
    assert below.sum() > 100
    assert not zemax.valid[below].any()
    assert (zemax.value[zemax.valid] > 0).all()
    assert zemax.masked["0 below the horizon, which the format writes for no datum"] == 134


@pytest.mark.study
def test_two_formats_of_one_sample_give_the_same_parameters(black_anodise) -> None:
    """Where they hold the same directions: elsewhere a model that misses both by 7 σ depends on which they are."""
    zemax, fred = black_anodise
    usable = np.flatnonzero(zemax.valid[:, 0])
    distance, partner = KDTree(folded(zemax)[usable]).query(folded(fred))
    near = distance < SHARED
    fits = [
        fm.fit(m, "lambert+ggx")
        for m in (zemax.rows(np.unique(usable[np.asarray(partner)[near]])), fred.rows(np.flatnonzero(near)))
    ]
    spread = np.sqrt(np.diagonal(fits[0].covariance) + np.diagonal(fits[1].covariance))
    assert near.sum() > 100
    assert {fit.result for fit in fits} == {"converged"}
    assert np.max(np.abs(fits[0].values - fits[1].values) / spread) < JOINT


@pytest.mark.study
def test_the_off_specular_peak_is_seen_and_said(black_anodise) -> None:
    """At 50° the sample shines brightest beyond the mirror direction; a round lobe in it leaves positive residuals."""
    zemax = black_anodise[0]
    assert any(line.startswith("Peak at 50° incidence") and "from the mirror direction" in line for line in
               fm.examine(zemax).lines())  # fmt: skip
    fit = fm.fit(zemax, "lambert+blinn-phong")
    beyond = (np.abs(np.rad2deg(zemax.theta_i) - 50) < 0.1) & zemax.in_plane & (zemax.signed_theta_o > np.deg2rad(65))
    rows = np.flatnonzero(beyond & zemax.valid[:, 0])
    assert len(rows) >= 2
    assert (zemax.value[rows] > fm.evaluate(fit.model, zemax.wi[rows], zemax.wo[rows])).all()


def test_a_file_that_calls_the_zenith_phi_fits_as_it_is(shared_data: Path) -> None:
    """White space under a .csv name, 8 decades; the refusal names the option that reads it."""
    path = shared_data / "starlink" / "chassis_brdf.csv"
    with pytest.raises(ReadError, match="where phi is the zenith angle") as refused:
        fm.read(path)
    assert EXCHANGED in str(refused.value)
    m = fm.read(path, columns=EXCHANGED)
    fit = fm.fit(m, "lambert+ggx")
    brightest = np.argmax(m.value[:, 0])
    peak = fm.evaluate(fit.model, m.wi[[brightest]], m.wo[[brightest]])[0, 0]
    assert np.log10(m.value[m.valid].max() / m.value[m.valid].min()) > 7
    assert 0.5 < peak / m.value[brightest, 0] < 2.0


@pytest.mark.parametrize("material", ["Referenzlack (Rau)", "Stahl sandgestrahlt", "Aluminium geschliffen"])
def test_radiances_of_unknown_scale_fit(shared_data: Path, material: str) -> None:
    """Raw detector readings of twelve materials in one table, of which one is chosen."""
    m = fm.read(
        shared_data / "jsss-mwir/jsss_mwir_radiance.csv",
        columns="theta_i=theta_i_deg,theta_o=theta_o_deg,radiance=L_o",
        where=f"material={material}",
        unknown_scale=True,
    )
    fit = fm.fit(m, "lambert+blinn-phong")
    assert m.n_samples == 900
    assert fit.result == "converged"
    assert "scale" in {entry.name for entry in fit.entries}
