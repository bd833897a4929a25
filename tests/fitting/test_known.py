"""What is known of a sample: refractive indices that are held, and the tilt that a plane cannot show."""

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import ModelError, ReadAs
from fitmat.fitting.known import of_film, of_material, prepare_known, tilted
from fitmat.models.simulation import simulate

JOHNSON_CHRISTY = 2e-2
"""Absolute; their table is in steps of 0.12 eV, of which 2.26 eV (548.6 nm) is next to 550 nm."""


def test_gold_in_a_dielectric_lobe_makes_it_a_conductor() -> None:
    """η = 0.43, κ = 2.46 at 2.26 eV (Johnson & Christy 1972, table I)."""
    ((name, held),) = of_material("lambert+ggx", "Au", ("550",)).items()
    assert name == "lambert+ggx-conductor"
    assert held["eta"] == pytest.approx(0.43, abs=JOHNSON_CHRISTY)
    assert held["kappa"] == pytest.approx(2.46, abs=JOHNSON_CHRISTY)


def test_every_fresnel_term_takes_the_index_in_its_own_terms() -> None:
    """Per channel where the term is; F0 of water, 0.020, from η = 1.333; gold's red is 1.04, of which 1 is held."""
    with pytest.warns(
        ReadAs, match="--ior Cu: Fresnel in RGB by the exact equations .* looks like ΔE2000 = 0.1 at most"
    ):
        ((_, held),) = of_material("ggx-conductor", "Cu", ("r", "g", "b")).items()
    assert held["eta"].shape == held["kappa"].shape == (3,)
    with pytest.warns(ReadAs, match="--ior Au: Fresnel in RGB by Schlick's curve from F0 in RGB"):
        ((_, held),) = of_material("ggx-schlick", "Au", ("b", "g", "r")).items()
    assert held["f0"] == pytest.approx([0.364, 0.729, 1.0], abs=2e-3)
    with pytest.warns(ReadAs, match="--ior water"):
        ((_, held),) = of_material("ggx", "water", ("r", "g", "b")).items()
    assert held["eta"] == pytest.approx([1.333], abs=5e-3)
    ((_, held),) = of_material("ggx-schlick", "water", ("550",)).items()
    assert held["f0"] == pytest.approx([0.0204], abs=5e-4)


def test_below_a_cover_the_base_takes_the_index() -> None:
    ((name, held),) = of_material("rough-varnish-over-lambert+ggx", "Al", ("550",)).items()
    assert name == "rough-varnish-over-lambert+ggx-conductor"
    assert set(held) == {"ggx-conductor.eta", "kappa"}


@pytest.mark.parametrize(
    ("name", "material", "message"),
    [
        ("lambert+phong", "Au", "has no lobe with a refractive index; use ggx or beckmann"),
        ("ggx-conductor", "PMMA", "does not absorb light: use the lobe without -conductor"),
        ("ggx", "unobtainium", "unobtainium"),
    ],
)
def test_materials_that_do_not_fit(name: str, material: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        of_material(name, material, ("550",))


@pytest.mark.study
def test_with_gold_fixed_only_the_roughness_is_fitted() -> None:
    """Simulated with the literature's numbers; alpha within 4 sd, and the index is not touched."""
    ((name, held),) = of_material("ggx", "Au", ("550",)).items()
    truth = fm.model(name, alpha=0.2, eta=held["eta"][0], kappa=held["kappa"][0])
    angles = np.deg2rad([10, 40, 65]), np.deg2rad(np.arange(-70, 71, 10))
    made = simulate(truth, *angles, relative_noise=0.02, absolute_noise=1e-3, seed=3)
    found = fm.fit(made, name, fixed={**held, "ks": 1.0})
    (free,) = found.free
    assert found.entries[1].name == "alpha"
    assert abs(found.values[free] - 0.2) < 4 * np.sqrt(found.covariance[free, free])


def _plane(azimuth: float) -> fm.Measurements:
    table = {"theta_i": [20.0, 40.0, 60.0, 0.0], "phi_i": [azimuth] * 4, "theta_o": [30.0, 10.0, 60.0, 5.0]}
    return fm.read(table | {"phi_o": [azimuth + 180.0, azimuth, azimuth + 180.0, azimuth], "brdf": np.ones(4)})


def test_the_tilt_across_the_plane_is_held() -> None:
    assert tilted("ggx", _plane(0.0)) == {"tilt-over-ggx": {"tilt_y": np.zeros(1)}}
    assert tilted("ggx", _plane(90.0)) == {"tilt-over-ggx": {"tilt_x": np.zeros(1)}}
    with pytest.raises(ModelError, match=r"one plane at azimuth 30\.0°"):
        tilted("ggx", _plane(30.0))


def test_both_tilts_are_free_off_the_plane() -> None:
    table = {"theta_i": [20.0, 40.0], "phi_i": [0.0, 90.0], "theta_o": [30.0, 10.0], "phi_o": [180.0, 270.0]}
    assert tilted("ggx", fm.read(table | {"brdf": np.ones(2)})) == {"tilt-over-ggx": {}}


def test_models_without_an_index_stay_as_they_are() -> None:
    """Where at least one has one."""
    with pytest.warns(ReadAs, match="--ior Au: taken at 550 nm"):
        known = prepare_known(["lambert+phong", "lambert+ggx"], _plane(0.0), ior="Au", tilt=True)
    assert list(known) == ["tilt-over-lambert+phong", "tilt-over-lambert+ggx-conductor"]
    assert set(known["tilt-over-lambert+ggx-conductor"]) == {"eta", "kappa", "tilt_y"}
    with pytest.raises(ModelError, match="no lobe with a refractive index"):
        prepare_known(["lambert"], _plane(0.0), ior="Au", tilt=False)


SPECTRUM = ("400", "450", "500", "550", "600", "650", "700")


def test_a_named_film_is_held_at_the_literature() -> None:
    """Fused silica, 1.4585 at 587.6 nm (Malitson 1965), by Cauchy's law to 1e-4; κ 0; below it a metal."""
    with pytest.warns(ReadAs, match=r"--film fused-silica: held η = 1\.448 \+ 0\.00351/λ².*, off by"):
        held = of_film("lambert+ggx-film", "fused-silica", SPECTRUM)
    assert held["film_eta"] + held["film_b"] / 0.5876**2 == pytest.approx(1.4585, abs=2e-4)
    assert held["film_kappa"] == 0.0
    assert of_film("lambert+ggx", "fused-silica", SPECTRUM) == {}


def test_what_a_law_leaves_of_a_film_is_said() -> None:
    """Amorphous TiO2 is 2.66 at 400 nm and 2.45 at 550 nm (Jolivet et al.): too steep for two terms."""
    with pytest.warns(ReadAs, match=r"off by 0\.02\d? at most\. As much as 1\.\d% of the thickness is not in its int"):
        of_film("ggx-film", "TiO2", tuple(f"{nm}" for nm in range(400, 701, 10)))
    with pytest.warns(ReadAs, match=r"off by 0\.0001\d? at most\.$"):
        of_film("ggx-film", "fused-silica", SPECTRUM)


def test_where_a_channel_without_a_wavelength_is_taken_is_said() -> None:
    """Gold at 548.6 nm is 0.43 + 2.455i, at 563.6 nm 0.35 + 2.683i (Johnson & Christy 1972, table I)."""
    with pytest.warns(ReadAs, match=r"--ior Au: taken at 550 nm, η = 0\.42\d+, κ = 2\.4\d, as the one channel has no"):
        of_material("ggx", "Au", ("value",))
    held = pytest.warns(ReadAs, match="--film fused-silica: held")
    with held, pytest.warns(ReadAs, match=r"--film fused-silica: taken at 550 nm, η = 1\.46, κ = 0, as"):
        of_film("ggx-film", "fused-silica", ("value",))


def test_one_wavelength_of_a_film_has_no_dispersion() -> None:
    """Fused silica at 546.07 nm: 1.4601 (Malitson 1965, table 1: 1.46008)."""
    with pytest.warns(ReadAs, match="--film fused-silica"):
        held = of_film("ggx-film", "fused-silica", ("546.07",))
    assert (held["film_eta"], held["film_b"]) == (pytest.approx(1.46008, abs=2e-5), 0.0)


@pytest.mark.parametrize(
    ("name", "film", "words"),
    [
        ("ggx-film", "Au", r"--film Au: its index is .* from η = .*, expected 0\.05 at most"),
        ("ggx-film", "Unobtainium", r"material 'Unobtainium' is not known\. The names"),
        ("lambert+ggx", "TiO2", r"--film TiO2: none of lambert\+ggx has a film; use ggx-film"),
    ],
)
def test_what_is_no_film_is_refused(name: str, film: str, words: str) -> None:
    m = fm.from_arrays(0.5, [0.1, 0.2], np.ones((2, len(SPECTRUM))), channels=SPECTRUM)
    with pytest.raises(ModelError, match=words):
        prepare_known([name], m, ior=None, tilt=False, film=film)
