"""Synthetic measurements: the noise is what it claims, the files can be made again, and every truth is recovered."""

import dataclasses
import json
import pathlib
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from selection import always

from fitmat.errors import FitmatError, OutputError
from fitmat.files import write_text
from fitmat.fitting.fitting import fit
from fitmat.fitting.result import Fit
from fitmat.measurements.formats import csv
from fitmat.measurements.instrument import Instrument
from fitmat.measurements.reader import read
from fitmat.measurements.samples import from_arrays
from fitmat.models.base import AbstractBRDF, evaluate
from fitmat.models.catalogue import MATERIALS, Material, write_catalogue
from fitmat.models.registry import model
from fitmat.models.simulation import simulate

FOLDER = pathlib.Path(__file__).parents[2] / "data" / "synthetic"
NAMES = {material.name: material for material in MATERIALS}

SIZE_LIMIT = 60_000
"""Bytes; the files live in the repository."""

DIGITS = 5e-7
"""Relative rounding of 7 written digits."""

FOUR_SIGMA = 4.0
"""Bound on a statistic in its own standard errors: a correct program fails in 1 of 16,000 seeds."""

REPEATS = 500
MEAN_Z = 0.15
"""3.4 standard errors 1/√500 of a mean z."""

COVERAGE = (0.92, 0.98)
"""0.95 ± 3.1 standard errors √(0.95 · 0.05/500)."""


def gloss() -> AbstractBRDF:
    return model("lambert+ggx", kd=0.3, ks=1.0, alpha=0.3, eta=1.5)


def standardised(found: Fit, material: Material) -> dict[str, np.ndarray]:
    """(estimate − truth)/sd for each parameter, in the logarithm where the scale is log."""
    sd, scores = np.sqrt(np.diag(found.covariance)), {}
    for entry in found.entries:
        value, truth = found.values[entry.place], np.asarray(material.parameters[entry.name])
        log = entry.param.scale == "log"
        difference = value * np.log(value / truth) if log else value - truth
        scores[entry.name] = difference / sd[entry.place]
    return scores


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    """The catalogue, made again."""
    folder = tmp_path_factory.mktemp("catalogue") / "new"
    write_catalogue(folder)
    return folder


def test_the_files_can_be_made_again(made: pathlib.Path) -> None:
    committed = {path.name: path.read_bytes() for path in (*FOLDER.glob("*.csv"), *FOLDER.glob("*.truth.json"))}
    assert {path.name: path.read_bytes() for path in made.iterdir()} == committed
    assert max(len(content) for content in committed.values()) < SIZE_LIMIT


def test_the_readme_lists_every_file() -> None:
    rows = [line for line in (FOLDER / "README.md").read_text(encoding="utf-8").splitlines() if "| `" in line]
    listed = [tuple(cell.strip(" `") for cell in row.strip("|").split("|")) for row in rows]
    assert [(cells[0], cells[1], cells[-1]) for cells in listed] == [
        (material.name, material.model, str(material.seed)) for material in MATERIALS
    ]


def test_every_material_has_its_own_seed() -> None:
    assert len({material.seed for material in MATERIALS}) == len(NAMES) == len(MATERIALS)


@pytest.mark.parametrize("material", MATERIALS, ids=lambda m: m.name)
def test_a_file_holds_what_was_measured(material: Material) -> None:
    written, measured = read(FOLDER / f"{material.name}.csv"), material.measured()
    assert written.value == pytest.approx(measured.value, rel=DIGITS, abs=0)
    assert written.wi == pytest.approx(measured.wi, abs=1e-12)
    assert written.wo == pytest.approx(measured.wo, abs=1e-12)
    assert written.channels == measured.channels
    assert written.n_masked == 0
    assert (written.sigma is None) == (measured.sigma is None)
    if written.sigma is not None:
        assert written.sigma == pytest.approx(measured.sigma, rel=DIGITS, abs=0)


@pytest.mark.parametrize("material", MATERIALS, ids=lambda m: m.name)
def test_the_truth_beside_a_file_is_its_model(material: Material) -> None:
    truth = json.loads((FOLDER / f"{material.name}.truth.json").read_text(encoding="utf-8"))
    again = model(truth["model"], channels=len(material.setup.channels or ("value",)), **truth["parameters"])
    m = material.measured()
    assert evaluate(again, m.wi, m.wo).tolist() == evaluate(material.truth(), m.wi, m.wo).tolist()
    assert tuple(truth["not_determined"]) == material.not_determined


def test_noise_is_standard_normal_in_units_of_the_true_sigma() -> None:
    theta = np.linspace(-1.4, 1.4, 301)
    m = simulate(gloss(), theta[theta > 0], theta, relative_noise=0.05, absolute_noise=0.01, seed=1)
    exact = evaluate(gloss(), m.wi, m.wo)
    assert m.sigma == pytest.approx(np.sqrt(0.01**2 + (0.05 * exact) ** 2), rel=1e-12)
    assert m.sigma is not None
    z, n = ((m.value - exact) / m.sigma).ravel(), m.n_valid
    assert n == 150 * 301
    assert abs(z.mean()) * np.sqrt(n) < FOUR_SIGMA
    assert abs(z.std() - 1.0) * np.sqrt(2 * n) < FOUR_SIGMA
    assert abs(np.corrcoef(z, exact.ravel())[0, 1]) * np.sqrt(n) < FOUR_SIGMA


def test_negative_values_are_kept() -> None:
    m = simulate(model("lambert", kd=0.01), [0.5], np.linspace(-1, 1, 200), relative_noise=0, absolute_noise=1, seed=2)
    assert m.n_valid == 200
    assert 60 < np.count_nonzero(m.value < 0) < 140


def test_the_seed_is_the_noise() -> None:
    angles = ([0.3, 0.9], np.linspace(-1, 1, 21))
    first, same, other = (
        simulate(gloss(), *angles, relative_noise=0.1, absolute_noise=0.01, seed=seed).value for seed in (5, 5, 6)
    )
    assert first.tolist() == same.tolist()
    assert not np.any(first == other)


def test_every_incidence_meets_every_reflection() -> None:
    m = simulate(gloss(), [0.2, 0.7], [-0.5, 0.0, 0.7], relative_noise=0, absolute_noise=0, seed=1)
    assert m.theta_i == pytest.approx([0.2, 0.2, 0.2, 0.7, 0.7, 0.7])
    assert m.signed_theta_o == pytest.approx([-0.5, 0.0, 0.7] * 2)
    assert m.sigma is None
    assert m.value.tolist() == evaluate(gloss(), m.wi, m.wo).tolist()
    assert np.argmax(m.value) == 5  # the mirror direction of the larger incidence


def test_sigma_and_channels_are_as_asked() -> None:
    paint = model("lambert", kd=np.array([0.1, 0.2, 0.3]))
    m = simulate(
        paint, [0.5], [0.1], relative_noise=0.1, absolute_noise=0, seed=1, channels=("a", "b", "c"), give_sigma=False
    )
    assert m.channels == ("a", "b", "c")
    assert m.sigma is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"relative_noise": -0.1}, r"relative_noise is -0\.1, expected a number of at least 0\."),
        ({"absolute_noise": np.nan}, r"absolute_noise is nan, expected a number of at least 0\."),
        ({"theta_i": [30.0]}, r"theta_i = 30: expected 0 to π/2 radians\. Are the angles in degrees \(np\.deg2rad\)\?"),
        ({"theta_i": [-0.1]}, r"theta_i = -0\.1: expected 0 to π/2 radians"),
        ({"theta_o": [0.1, -30.0]}, r"theta_o = -30: expected −π/2 to π/2 radians"),
        ({"theta_i": [np.nan]}, "theta_i = nan: expected 0 to π/2 radians"),
        ({"phi": 180.0}, r"phi = 180: expected −2π to 2π radians\. Are the angles in degrees"),
        ({"instrument": Instrument(dark=None)}, r"dark = None of the instrument \(--dark fit\), expected a number"),
        ({"channels": ("r", "g", "b")}, r"3 channel names, expected 1, one for each of the model's\."),
    ],
)
def test_wrong_input_is_refused(change: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {
        "theta_i": [0.5],
        "theta_o": [0.5],
        "relative_noise": 0.1,
        "absolute_noise": 0.1,
        "seed": 1,
        **change,
    }
    with pytest.raises(FitmatError, match=message):
        simulate(gloss(), **given)


def test_single_precision_is_refused() -> None:
    single = jax.tree.map(lambda a: a.astype(jnp.float32), gloss())
    with pytest.raises(FitmatError, match=r"fitmat needs 64-bit floats: run jax\.config\.update"):
        simulate(single, [0.5], [0.5], relative_noise=0.1, absolute_noise=0.1, seed=1)


def test_out_of_plane_files_have_an_azimuth(tmp_path: pathlib.Path) -> None:
    theta = ([0.2, 0.7], [-0.5, 0.3, 0.7])
    m = simulate(gloss(), *theta, relative_noise=0.1, absolute_noise=0.01, seed=1, phi=2.0)
    path = write_text(tmp_path / "aside.csv", csv.dump(m, ["one", "two"]))
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines[:3] == ["# one", "# two", "theta_i,theta_o,phi,brdf,sigma"]
    assert read(path).phi == pytest.approx(m.phi, abs=1e-7)
    assert read(path).value == pytest.approx(m.value, rel=DIGITS)


def test_masked_values_stay_masked(tmp_path: pathlib.Path) -> None:
    m = from_arrays(np.array([0.5, 0.5]), np.array([0.1, 0.2]), np.array([[0.1, np.nan, 0.3], [0.1, 0.2, 0.3]]))
    again = read(write_text(tmp_path / "masked.csv", csv.dump(m)))
    assert again.valid.tolist() == m.valid.tolist()
    assert again.channels == m.channels


def test_a_place_that_cannot_be_written_is_named(tmp_path: pathlib.Path) -> None:
    occupied = tmp_path / "file"
    occupied.touch()
    with pytest.raises(OutputError, match=r"dull-plastic\.csv: cannot be written \(.+\); choose another place\."):
        write_catalogue(occupied)


USUAL = {"satin-plastic", "lacquer", "normal-incidence", "no-sigma-paint", "one-curve"}
"""Materials that every run fits: both lobes, a curve, a blind file, and unknown noise."""


@pytest.mark.parametrize("name", always(USUAL, NAMES))
def test_the_default_fit_recovers_the_truth(name: str) -> None:
    material = NAMES[name]
    found = fit(read(FOLDER / f"{material.name}.csv"), material.model)
    assert found.result == ("unidentifiable" if material.not_determined else "converged")
    assert found.undetermined == material.not_determined
    assert found.adequacy == "follows the data within the measurement noise"
    for name, z in standardised(found, material).items():
        if name not in material.not_determined:
            assert np.all(np.abs(z) <= 3.0), f"{name} is {z} sd from the truth"


@pytest.mark.study
@pytest.mark.parametrize("name", ["sparse", "wax"])
def test_intervals_cover_the_truth_as_often_as_they_say(name: str) -> None:
    scores = []
    for repeat in range(REPEATS):
        again = dataclasses.replace(NAMES[name], seed=10_000 * NAMES[name].seed + repeat)
        scores.append(standardised(fit(again.measured(), again.model), again))
    for parameter in scores[0]:
        z = np.concatenate([score[parameter] for score in scores])
        covered = np.mean(np.abs(z) < 1.96)
        assert COVERAGE[0] <= covered <= COVERAGE[1], f"{parameter}: covered {covered:.1%}"
        assert abs(z.mean()) <= MEAN_Z, f"{parameter}: mean z {z.mean():.3f}"


def test_the_scores_notice_a_wrong_truth() -> None:
    wrong = dataclasses.replace(NAMES["sparse"], parameters={**NAMES["sparse"].parameters, "kd": 0.31})
    found = fit(read(FOLDER / "sparse.csv"), "lambert+ggx")
    assert abs(standardised(found, wrong)["kd"]) > 5


@pytest.mark.study
def test_no_seed_makes_the_unidentifiable_look_determined() -> None:
    """A fit that slides along the ridge of ks and eta until it meets a bound must quote no small sd for the other."""
    material = next(m for m in MATERIALS if m.not_determined)
    for seed in range(20):
        found = fit(dataclasses.replace(material, seed=seed).measured(), material.model)
        assert (found.result, set(found.undetermined)) == ("unidentifiable", set(material.not_determined))
