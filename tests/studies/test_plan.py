"""Which models a study fits, and which option concerns which model."""

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import ModelError, ReadAs
from fitmat.measurements.samples import Measurements
from fitmat.models.simulation import simulate
from fitmat.studies.plan import model_names, plan


@pytest.fixture(scope="module")
def measurements() -> Measurements:
    angles = np.deg2rad([20, 45, 70]), np.deg2rad(np.arange(-80, 81, 10))
    return simulate(fm.model("lambert"), *angles, relative_noise=0.02, absolute_noise=1e-3, seed=1)


def test_model_names_are_tidied(measurements: Measurements) -> None:
    assert model_names(" lambert + GGX,phong,,lambert+ggx", measurements) == ["lambert+ggx", "phong"]
    assert model_names(["lambert + GGX", "phong", "phong"], measurements) == ["lambert+ggx", "phong"]


def test_all_is_every_model_that_makes_sense(measurements: Measurements) -> None:
    assert model_names(" all ", measurements) == list(fm.every_model(measurements))


def test_no_model_name(measurements: Measurements) -> None:
    with pytest.raises(ModelError, match="no model given; try --models lambert"):
        model_names(" , ", measurements)


def test_options_go_to_the_models_that_have_them(measurements: Measurements) -> None:
    fixed, priors = {"exponent": 20.0, "kd": 0.3}, {"eta": (1.5, 0.1), "discrepancy": (0.0, 0.1)}
    jobs = plan("lambert+phong,lambert+ggx", measurements, fixed=fixed, priors=priors, masking="separable")
    phong, ggx = jobs["lambert+phong"], jobs["lambert+ggx"]
    assert (sorted(phong["fixed"]), sorted(ggx["fixed"])) == (["exponent", "kd"], ["kd"])
    assert (sorted(phong["priors"]), sorted(ggx["priors"])) == (["discrepancy"], ["discrepancy", "eta"])
    assert ("masking" in phong, ggx["masking"]) == (False, "separable")


def test_a_known_material_is_held_and_renames_its_model(measurements: Measurements) -> None:
    with pytest.warns(ReadAs, match="--ior Au: taken at 550 nm"):
        jobs = plan("ggx,phong", measurements, ior="Au")
    assert list(jobs) == ["ggx-conductor", "phong"]
    assert sorted(jobs["ggx-conductor"]["fixed"]) == ["eta", "kappa"]


@pytest.mark.parametrize(
    ("chosen", "sentence"),
    [
        ({"fixed": {"zz": 1.0}}, r"--fix zz: no model of lambert has it; they have kd\."),
        ({"priors": {"eta": (1.5, 0.1)}}, r"--prior eta: no model of lambert has it; they have kd\."),
        ({"fixed": {"discrepancy": 0.0}}, r"--fix discrepancy: no model of lambert has it; they have kd\."),
        (
            {"fixed": {"kd": 0.5}, "priors": {"kd": (0.5, 0.1)}},
            r"kd is fixed and has a prior \(--fix or --ior, and --prior\)",
        ),
        ({"loss": "ngan", "priors": {"discrepancy": (0.0, 0.1)}}, r"under the loss ngan \(--loss\), expected none"),
        ({"masking": "separable"}, "--masking separable: none of lambert has a masking to choose"),
    ],
)
def test_options_that_concern_no_model(measurements: Measurements, chosen: dict, sentence: str) -> None:
    with pytest.raises(ModelError, match=sentence):
        plan("lambert", measurements, **chosen)


def test_what_a_material_says_is_not_said_again(measurements: Measurements) -> None:
    said = pytest.warns(ReadAs, match="--ior N-BK7: taken at 550 nm")
    with said, pytest.raises(ModelError, match="--fix eta beside --ior, expected one of the two: the material says it"):
        plan("ggx", measurements, ior="N-BK7", fixed={"eta": 1.5})
    spectrum = fm.from_arrays(0.5, [0.1, 0.2], np.ones((2, 3)), channels=("450", "550", "650"))
    refused = pytest.raises(ModelError, match="--fix film_eta beside --film, expected one of the two")
    with refused, pytest.warns(ReadAs, match="--film TiO2: held"):
        plan("ggx-film", spectrum, film="TiO2", fixed={"film_eta": 2.0})
    said = pytest.warns(ReadAs, match="--ior N-BK7: taken at 550 nm")
    with said, pytest.raises(ModelError, match=r"eta is fixed and has a prior \(--fix or --ior, and --prior\)"):
        plan("ggx", measurements, ior="N-BK7", priors={"eta": (1.5, 0.1)})
