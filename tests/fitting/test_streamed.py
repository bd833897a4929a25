"""A fit by chunks is the fit of the same rows in one piece; what a large file adds is refused, named or said."""

import dataclasses
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import polars as pl
import pytest
from scipy.optimize import minimize

import fitmat as fm
from fitmat.fitting import information
from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.likelihood import log_density, prepare
from fitmat.fitting.result import Fit
from fitmat.fitting.streamed import passes
from fitmat.fitting.streamed.steps import Range
from fitmat.fitting.streamed.sums import Sums, block_sums
from fitmat.measurements.formats import csv
from fitmat.measurements.instrument import Instrument
from fitmat.measurements.large import chunks, noise
from fitmat.measurements.large.chunks import Chunks
from fitmat.measurements.noise import measured_noise
from fitmat.models.parameters import vector, with_vector

MODEL = "lambert+blinn-phong"

SAME = 1e-4
"""Standard deviations; `fitting.fit` itself stops this close to its optimum (`refining.STEADY`)."""

SAME_COVARIANCE = 1e-5
"""Relative; where exponent ± 3 % differs by `SAME` of its standard deviation, its curvature differs by this."""

PART_OF_THE_ROWS = 0.25
"""Relative, of widths: other rows stand for all where the correlation of the misfit is asked."""

BENT = 0.02
"""Relative, of a covariance whose second-order part comes from 12,000 of 48,000 rows."""

SAME_LIKELIHOOD = 1e-6
"""Absolute, of some 10⁵ to 10⁶: rounding of a sum in another order."""

DIFFERENCES = 1e-5
"""Relative; central differences of a sum of 10³ squares."""

LAW = 0.1
"""Relative; two estimates of a and b from thousands of rows, of which one is a part of the other."""

LIGHT, SENSOR = np.deg2rad(np.linspace(2, 80, 40)), np.deg2rad(np.linspace(1, 80, 100))


def measured(truth: Any, planes: int, **noise: Any) -> fm.Measurements:
    """Rows in scanning order: 4000 for each plane."""
    noise = {"relative_noise": 0.02, "absolute_noise": 1e-3, "seed": 1} | noise
    return fm.simulate(truth, LIGHT, SENSOR, phi=np.deg2rad(np.linspace(0, 180, planes)), **noise)


def saved(m: fm.Measurements, path: Path) -> Path:
    """A CSV or, with the numbers that such a CSV holds, a Parquet file."""
    text = csv.dump(m)
    if path.suffix == ".csv":
        path.write_text(text, encoding="utf-8")
    else:
        pl.read_csv(text.encode(), infer_schema_length=None).write_parquet(path)
    return path


def deviations(found: Fit, whole: Fit) -> np.ndarray:
    """Differences of the free parameters in standard deviations."""
    free = whole.free
    return (found.values - whole.values)[free] / np.sqrt(np.diagonal(whole.likelihood_covariance))[free]


def assert_same(found: Fit, whole: Fit) -> None:
    assert (found.result, found.undetermined) == (whole.result, whole.undetermined)
    assert np.abs(deviations(found, whole)).max() < SAME
    np.testing.assert_allclose(found.likelihood_covariance, whole.likelihood_covariance, rtol=SAME_COVARIANCE)
    wider = [np.sqrt(fit.correlation.inflation) for fit in (found, whole)]
    np.testing.assert_allclose(*wider, rtol=PART_OF_THE_ROWS)
    assert found.discrepancy == pytest.approx(whole.discrepancy, rel=SAME_COVARIANCE)
    assert found.log_likelihood == pytest.approx(whole.log_likelihood, rel=0, abs=SAME_LIKELIHOOD)
    assert found.information.shape == whole.information.shape
    np.testing.assert_array_equal(found.measurements.channels, whole.measurements.channels)


def masked(m: fm.Measurements) -> fm.Measurements:
    valid = m.valid.copy()
    valid[::17], valid[20_000:30_000] = False, False
    return dataclasses.replace(m, valid=valid)


@pytest.fixture(scope="module")
def gloss(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """48,000 rows of GGX, which Blinn–Phong misses: the discrepancy counts, and the curvature of the residuals."""
    truth = fm.model("lambert+ggx", kd=0.3, alpha=0.3, eta=1.5)
    return saved(masked(measured(truth, 12)), tmp_path_factory.mktemp("gloss") / "gloss.csv")


@pytest.fixture(scope="module")
def whole(gloss: Path) -> Fit:
    return fm.fit(fm.read(gloss), MODEL)


@pytest.fixture(scope="module")
def scanned(gloss: Path) -> Chunks:
    return chunks.scan(gloss, rows=13_000, part=8_000)


@pytest.fixture(scope="module")
def found(scanned: Chunks) -> Fit:
    return passes.fit_chunks(scanned, MODEL)


def test_a_large_text_is_fitted_as_in_one_piece(found: Fit, whole: Fit) -> None:
    assert whole.misfit_ratio > 2
    assert_same(found, whole)
    assert found.measurements.n_samples <= 8_000
    assert found.measurements.masked == whole.measurements.masked
    assert "over the 48,000 rows; all are fitted." in found.measurements.notes[-1]


def test_some_of_the_rows_show_the_way(scanned: Chunks, whole: Fit, monkeypatch: pytest.MonkeyPatch) -> None:
    """All rows end where they did without; how far residuals bend comes from the few."""
    monkeypatch.setattr(passes, "FEW", 12_000)
    found = passes.fit_chunks(scanned, MODEL)
    assert np.abs(deviations(found, whole)).max() < SAME
    assert found.discrepancy == pytest.approx(whole.discrepancy, rel=SAME_COVARIANCE)
    assert found.log_likelihood == pytest.approx(whole.log_likelihood, rel=0, abs=SAME_LIKELIHOOD)
    np.testing.assert_allclose(found.likelihood_covariance, whole.likelihood_covariance, rtol=BENT)


@pytest.mark.study
def test_a_large_parquet_file_is_fitted_as_in_one_piece(whole: Fit, tmp_path: Path) -> None:
    path = saved(whole.measurements, tmp_path / "gloss.parquet")
    assert_same(passes.fit_chunks(chunks.scan(path, rows=13_000, part=8_000), MODEL), whole)


@pytest.mark.study
def test_a_far_start_ends_in_the_same_place(scanned: Chunks, found: Fit, monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps that make things worse are taken back and shortened."""
    costs: list[float] = []
    climb, sums = passes._climb, passes._File.sums

    def elsewhere(file: Any, *_: Any) -> Any:
        far = with_vector(file.start.model, np.array([0.2, 0.1, 30.0]))
        expected = information.expected_information(far, file.start.data, 0.01)
        away = Range(dataclasses.replace(file.start, model=far, discrepancy=0.01, information=expected))
        # Nothing of what bends: steps are too long, so that some are taken back.
        return climb(file, away, away.begin, lambda *_: np.zeros_like(expected))

    def noted(*args: Any) -> Sums:
        result = sums(*args)
        costs.append(float(result.cost))
        return result

    monkeypatch.setattr(passes, "PASSES", 40)
    monkeypatch.setattr(passes, "_climb", elsewhere)
    monkeypatch.setattr(passes._File, "sums", noted)
    far = passes.fit_chunks(scanned, MODEL)
    assert len(costs) > 5
    assert far.log_likelihood == pytest.approx(found.log_likelihood, rel=0, abs=SAME_LIKELIHOOD)
    assert np.abs(deviations(far, found)).max() < SAME
    assert (np.diff(costs) > 1.0).any()


def test_what_the_data_do_not_determine_is_named(tmp_path: Path) -> None:
    """A flat surface says nothing of a lobe."""
    path = saved(masked(measured(fm.model("lambert", kd=0.3), 12)), tmp_path / "flat.csv")
    flat = passes.fit_chunks(chunks.scan(path, rows=13_000, part=8_000), MODEL)
    assert flat.result == "unidentifiable"
    assert "exponent" in flat.undetermined


@pytest.fixture(scope="module")
def colours(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three channels of a model that is right; the third reflects more than it may, one is masked now and then."""
    m = measured(fm.model("lambert", kd=np.array([0.1, 0.3, 0.6]), channels=3), 2)
    valid, value = m.valid.copy(), m.value.copy()
    valid[::7, 1] = False
    value[:, 2] *= 2.0
    path = tmp_path_factory.mktemp("colours") / "colours.csv"
    return saved(dataclasses.replace(m, valid=valid, value=value), path)


@pytest.fixture(scope="module")
def coloured(colours: Path) -> Chunks:
    return chunks.scan(colours, rows=3_000, part=1_000)


@pytest.mark.study
def test_a_parameter_on_its_bound_stays_there_and_what_is_held_stays(coloured: Chunks, colours: Path) -> None:
    """The others are then where scipy's simplex finds them with that parameter at its bound."""
    at_bound = passes.fit_chunks(coloured, "lambert")
    assert at_bound.result == "at_bound"
    assert at_bound.values[2] == 1.0
    assert np.isnan(at_bound.covariance[2]).all()
    m = fm.read(colours)
    data, guess = prepare(m, measured_noise(m)), np.append(at_bound.values[:2], at_bound.discrepancy)

    def cost(x: np.ndarray) -> float:
        inside = fm.model("lambert", channels=3, kd=np.append(x[:2], 1.0))
        return -float(density(inside, data, jnp.asarray(abs(x[2]))))

    density = jax.jit(log_density)
    best = minimize(cost, 1.01 * guess, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-9})
    sd = np.sqrt(np.diagonal(at_bound.covariance))[:2]
    assert np.abs((best.x - guess)[:2] / sd).max() < 100 * SAME
    assert guess[2] == pytest.approx(best.x[2], rel=100 * SAME)
    held = passes.fit_chunks(coloured, "lambert", fixed={"kd": at_bound.values})
    assert held.values.tolist() == at_bound.values.tolist()
    assert held.discrepancy == pytest.approx(at_bound.discrepancy, rel=SAME)


@pytest.mark.study
def test_too_few_passes_are_named(coloured: Chunks, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(passes, "PASSES", 1)
    assert not passes._climb(*_climber(coloured)).settled
    monkeypatch.undo()
    assert passes._climb(*_climber(coloured)).settled


def _climber(scanned: Chunks) -> Any:
    start = fm.fit(scanned.part, "lambert")
    around = Range(start)
    return passes._File(passes.rows(scanned), start, None), around, around.begin, around.second_order


@pytest.mark.study
def test_a_calibration_counts_once(tmp_path: Path) -> None:
    """A prior belongs to the file, not to each block."""
    instrument = Instrument(calibration=0.02)
    path = saved(measured(fm.model("lambert", kd=0.3), 2), tmp_path / "calibrated.csv")
    found = passes.fit_chunks(chunks.scan(path, rows=3_000, part=8_000, instrument=instrument), "lambert")
    whole = fm.fit(fm.read(path, instrument=instrument), "lambert")
    assert whole.covariance[0, 0] ** 0.5 == pytest.approx(0.02 * 0.3, rel=0.02)
    assert_same(found, whole)


def test_a_fit_without_an_optimum_ends_with_the_part(tmp_path: Path) -> None:
    m = measured(fm.model("lambert", kd=0.3), 2)
    path = saved(dataclasses.replace(m, sigma=np.full(m.value.shape, 1e-200)), tmp_path / "sharp.csv")
    found = passes.fit_chunks(chunks.scan(path, rows=3_000, part=1_000), "lambert")
    assert found.result == "nonfinite"


def test_the_sums_are_derivatives_of_the_likelihood() -> None:
    """Against central differences."""
    m = measured(fm.model(MODEL, kd=0.3, ks=0.2, exponent=20.0), 1).rows(np.arange(0, 4000, 4))
    data, best, s = prepare(m, measured_noise(m)), fm.model(MODEL, kd=0.31, ks=0.18, exponent=22.0), 0.01
    sums = block_sums(best, data, s)
    every = coordinates(best)
    at = np.append(every.natural(np.asarray(vector(best))), s)

    def cost(x: np.ndarray) -> float:
        moved = with_vector(best, every.physical(jnp.asarray(x[:-1])))
        return -float(log_density(moved, data, jnp.asarray(x[-1])))

    def slope(x: np.ndarray) -> np.ndarray:
        steps = np.diag(1e-5 * np.maximum(np.abs(x), 0.01))
        return np.array([(cost(x + h) - cost(x - h)) / (2 * h.sum()) for h in steps])

    assert float(sums.cost) == pytest.approx(cost(at))
    np.testing.assert_allclose(np.append(sums.gradient, sums.slope), slope(at), rtol=DIFFERENCES)
    h = np.array([0.0, 0.0, 0.0, 1e-5])
    mixed = (slope(at + h) - slope(at - h)) / 2e-5
    np.testing.assert_allclose(np.append(sums.mixed, sums.curvature), mixed, rtol=100 * DIFFERENCES)


@pytest.mark.parametrize("channels", [1, 3])
def test_noise_that_is_not_given_is_estimated_as_in_one_piece(channels: int, tmp_path: Path) -> None:
    """σ agrees to the accuracy of a and b; exactly that of one law at the same levels, but at the ends of chunks."""
    truth = fm.model("lambert+ggx", channels=channels, kd=0.3, alpha=0.3, eta=1.5)
    path = saved(measured(truth, 4, give_sigma=False), tmp_path / "plain.csv")
    scanned, whole = chunks.scan(path, rows=5_000, part=4_000), measured_noise(fm.read(path))
    known = noise.scatter(scanned)
    sigma = np.concatenate([known.of(chunk).sigma for chunk in scanned])
    agreeing = np.isclose(sigma, whole.sigma, rtol=LAW)
    assert agreeing.mean() > 0.99
    part = known.of_part(scanned.part)
    np.testing.assert_array_equal(part.sigma, sigma[scanned.in_part(0, 16_000)])
    assert part.known
    assert part.words.count("sr⁻¹") == channels


def test_noise_that_cannot_be_estimated_is_unknown(tmp_path: Path) -> None:
    """Rows at angles of their own have no neighbours."""
    rng = np.random.default_rng(1)
    angles = rng.uniform(0.1, 1.3, (2, 3_000))
    path = saved(fm.from_arrays(angles[0], angles[1], rng.uniform(0.1, 0.2, 3_000), phi=2.0), tmp_path / "alone.csv")
    scanned = chunks.scan(path, rows=900)
    part = noise.scatter(scanned).of_part(scanned.part)
    whole = measured_noise(scanned.part)
    assert (part.known, part.words) == (whole.known, whole.words)
    np.testing.assert_allclose(part.sigma, whole.sigma)


@pytest.mark.study
def test_progress_is_told_of_each_pass(coloured: Chunks) -> None:
    told: list[tuple[str, int, int]] = []
    passes.fit_chunks(coloured, "lambert", progress=lambda what, done, rows: told.append((what, done, rows)))
    made = list(dict.fromkeys(what for what, _, _ in told))
    assert made[:2] == ["pass 1", "pass 2"]
    assert len(made) < 7
    assert [done for what, done, _ in told if what == "pass 1"] == [3_000, 6_000, 8_000]
    assert {rows for _, _, rows in told} == {8_000}
