"""Many fits at once are the fits one by one: values, deviations and outcomes; a bad surface spoils no other."""

from typing import Any

import numpy as np
import pytest
import scipy.optimize
from oracles.ggx import brdf
from selection import always

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.fitting.concluding import RESULTS
from fitmat.fitting.losses import LOSSES
from fitmat.fitting.many import searching, tiles
from fitmat.fitting.many.concluding import OUTCOMES, TOO_FEW
from fitmat.fitting.many.fitting_many import shared_by_all
from fitmat.fitting.many.gathering import gathered
from fitmat.fitting.many.solving import BEHIND, PATIENCE, Ends, solve_many
from fitmat.fitting.many.table import begin_many, table
from fitmat.fitting.refining import BURST, SETTLED
from fitmat.measurements.samples import Measurements

SAMPLES, SURFACES = 64, 40

SAME = 1e-8
"""Relative: that to which both solvers end their steps; where a discrepancy is inferred they end at `SETTLED`.

A standard deviation changes with a high power of the parameters, so that it may be ten times as far.
"""


def geometry(rows: int, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Directions that see a highlight: half vectors near the normal, some at random."""
    rng = np.random.default_rng(seed)
    wi = fm.directions(rng.uniform(5.0, 75.0, rows), rng.uniform(0.0, 360.0, rows), degrees=True)
    h = fm.directions(np.abs(rng.normal(0.0, 18.0, rows)).clip(0.0, 80.0), rng.uniform(0.0, 360.0, rows), degrees=True)
    mirrored = 2.0 * np.sum(wi * h, axis=1, keepdims=True) * h - wi
    elsewhere = fm.directions(rng.uniform(0.0, 70.0, rows), rng.uniform(0.0, 360.0, rows), degrees=True)
    return wi, np.where(mirrored[:, 2:] > 0.1, mirrored, elsewhere)


WI, WO = geometry(SAMPLES)


def surfaces(count: int, channels: int = 1, misfit: float = 0.0, seed: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """Simulated values of surfaces of many kinds, and σ, (count, n, c) both; `misfit` is no noise that σ tells of."""
    rng = np.random.default_rng(seed)
    value = np.stack(
        [
            fm.evaluate(
                fm.model(
                    "lambert+ggx", channels=channels, kd=rng.uniform(0.1, 0.8, channels), alpha=rng.uniform(0.08, 0.6),
                    ks=rng.uniform(0.5, 1.5, channels), eta=rng.uniform(1.3, 2.2),
                ), WI, WO,
            )
            for _ in range(count)
        ]
    )  # fmt: skip
    sigma = 0.02 * value + 1e-3
    bent = np.cbrt(value) + misfit * rng.normal(size=value.shape)
    return bent**3 + sigma * rng.normal(size=value.shape), sigma


def single(value: np.ndarray, sigma: np.ndarray | None, **told: Any) -> fm.Fit:
    """The fit of one surface."""
    valid = np.isfinite(value)
    shown = np.where(valid, value, 0.0)
    channels = ("value",) if value.shape[1] == 1 else ("r", "g", "b")
    return fm.fit(Measurements(WI, WO, shown, sigma, valid, channels), "lambert+ggx", **told)


def agree(found: fm.Fits, k: int, one: fm.Fit) -> None:
    """That a surface's fit is the single one."""
    assert found.result[k] == one.result
    sd = np.sqrt(np.diagonal(one.likelihood_covariance)) if one.loss.posterior else np.full(len(one.values), np.nan)
    sd[~np.isin(np.arange(len(sd)), one.free)] = 0.0
    assert found.log_likelihood[k] == pytest.approx(one.log_likelihood, rel=SAME, abs=SAME)
    assert found.discrepancy[k] == pytest.approx(one.discrepancy, rel=1e-5, abs=SAME)
    assert found.n_values[k] == one.n_values
    if one.result == "converged":
        apart = SETTLED if one.discrepancy > 0.0 else SAME
        np.testing.assert_allclose(found.values[k], one.values, rtol=apart)
        np.testing.assert_allclose(found.sd[k], sd, rtol=10.0 * apart, atol=0.0)


@pytest.mark.parametrize(
    "of", always({("default", 0.02)}, [("gaussian", 0.0), ("default", 0.0), ("default", 0.02), ("cube-root", 0.0)])
)
def test_many_fits_are_the_single_ones(of) -> None:
    loss, misfit = of
    value, sigma = surfaces(SURFACES, misfit=misfit)
    value[3, ::5] = np.nan
    found = fm.fit_many(WI, WO, value, "lambert+ggx", sigma=sigma, loss=loss)
    assert found.values.shape == (SURFACES, 4)
    assert np.count_nonzero(found.result == "converged") > SURFACES / 2
    for k in range(8):
        agree(found, k, single(value[k], sigma[k], loss=loss))


@pytest.mark.study
def test_channels_share_what_is_shared() -> None:
    value, sigma = surfaces(3, channels=3)
    found = fm.fit_many(WI, WO, value, "lambert+ggx", sigma=sigma, loss="gaussian")
    assert (found["kd"].shape, found["alpha"].shape) == ((3, 3), (3,))
    agree(found, 1, single(value[1], sigma[1], loss="gaussian"))


def test_what_is_fixed_stays_and_noise_is_not_looked_for() -> None:
    value, _ = surfaces(2)
    found = fm.fit_many(WI, WO, value, "lambert+ggx", fixed={"ks": 0.7})
    assert (found["ks"] == 0.7).all()
    assert (found.sd_of("ks") == 0.0).all()
    one = single(value[0], None, fixed={"ks": 0.7})
    assert not one.noise.known
    agree(found, 0, one)


def test_scipy_finds_the_same() -> None:
    """Another solver, and another code of the model."""
    value, sigma = surfaces(4)
    found = fm.fit_many(WI, WO, value, "lambert+ggx", sigma=sigma, loss="gaussian")
    for k in range(4):

        def residual(p: np.ndarray, k: int = k) -> np.ndarray:
            kd, ks, alpha, eta = p
            return (kd / np.pi + ks * brdf(WI, WO, alpha, eta) - value[k, :, 0]) / sigma[k, :, 0]

        best = scipy.optimize.least_squares(
            residual, found.values[k] * 1.05, x_scale=found.values[k], xtol=1e-15, ftol=1e-15
        )
        np.testing.assert_allclose(found.values[k], best.x, rtol=1e-6)  # scipy's slopes are differences
        spread = np.sqrt(np.diagonal(np.linalg.inv(best.jac.T @ best.jac)))
        np.testing.assert_allclose(found.sd[k], spread, rtol=1e-4)


def test_bad_surfaces_are_outcomes_and_spoil_no_other() -> None:
    value, sigma = surfaces(6)
    alone = fm.fit_many(WI, WO, value[:1], "lambert+ggx", sigma=sigma[:1], loss="gaussian")
    value[1], value[2, 5:] = np.nan, np.inf
    value[3, 0] = 1e300
    found = fm.fit_many(WI, WO, value, "lambert+ggx", sigma=sigma, loss="gaussian")
    assert found.result[[1, 2]].tolist() == [TOO_FEW, TOO_FEW]
    assert np.isnan(found.values[1]).all()
    assert np.isnan(found.sd[1]).all()
    assert found.n_values[[1, 2]].tolist() == [0, 5]
    assert found.result[3] in ("nonfinite", "at_bound", "max_steps", "unidentifiable")
    np.testing.assert_array_equal(found.values[0], alone.values[0])
    assert str(found).startswith("6 fits of lambert+ggx: ")
    assert sum(found.counts.values()) == 6


def test_too_few_steps_are_said() -> None:
    value, sigma = surfaces(8)
    found = fm.fit_many(WI, WO, value, "lambert+ggx", sigma=sigma, loss="gaussian", max_steps=2)
    assert (found.result == "max_steps").all()
    assert (found.steps == 2).all()


def test_what_angles_cannot_determine_is_said() -> None:
    """Without a highlight in sight nothing is known of it."""
    wi, wo = fm.directions(np.zeros(24), degrees=True), fm.directions(np.linspace(60.0, 70.0, 24), degrees=True)
    flat = fm.evaluate(fm.model("lambert+ggx", channels=1, kd=0.5, alpha=0.02), wi, wo)[None]
    found = fm.fit_many(wi, wo, flat, "lambert+ggx", sigma=0.01, loss="gaussian")
    assert found.result.tolist() == ["unidentifiable"]


def test_a_ridge_does_not_end_where_another_start_goes_on() -> None:
    """One camera above: ks, eta and alpha trade off, and the way from the grid's one valley leads to eta = 50.

    Without noise the optimum is the surface itself.
    """
    wi = fm.directions([0, 10, 20, 30, 40, 50, 60, 70, 15, 25], 40.0, degrees=True)
    wo = fm.directions(np.zeros(10), degrees=True)
    alpha = np.linspace(0.15, 0.46, 8)
    value = np.stack([0.3 / np.pi + brdf(wi, wo, r, 1.5) for r in alpha])
    found = fm.fit_many(wi, wo, value)
    np.testing.assert_allclose(found["eta"], 1.5, rtol=0.01)
    np.testing.assert_allclose(found["alpha"], alpha, rtol=0.01)


def test_a_start_that_is_far_behind_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Second starts creep towards bounds for hundreds of steps; the optimum is still the one that scipy finds."""
    value, sigma = surfaces(256)
    ended: list[tuple[np.ndarray, Ends]] = []

    def watched(*told: Any) -> Any:
        found = solve_many(*told)
        count = told[5][0]
        ended.append((told[2][:count], Ends(*(np.asarray(part)[:count] for part in found))))
        return found

    monkeypatch.setattr(searching, "solve_many", watched)
    found = fm.fit_many(WI, WO, value, "lambert+ggx", sigma=sigma, loss="gaussian", threads=1)
    of, ends = ended[0]

    def residual(p: np.ndarray, k: int) -> np.ndarray:
        return (p[0] / np.pi + p[1] * brdf(WI, WO, p[2], p[3]) - value[k, :, 0]) / sigma[k, :, 0]

    half = np.array([0.5 * np.sum(residual(p, k) ** 2) for k, p in enumerate(found.values)])
    behind = ends.log_likelihood < -half[of] - BEHIND
    assert np.count_nonzero(behind) > 10
    assert ends.steps[behind].max() <= PATIENCE + BURST
    for k in np.unique(of[behind])[:8]:
        best = scipy.optimize.least_squares(
            residual,
            [0.4, 1.0, 0.3, 1.6],
            x_scale=found.values[k],
            bounds=([0.0, 0.0, 1e-4, 1.0], [1.0, 10.0, 1.0, 50.0]),
            args=(k,),
        )
        assert half[k] == pytest.approx(best.cost, abs=1e-6)


def test_a_bound_is_said_and_has_no_deviation() -> None:
    value, sigma = surfaces(2)
    found = fm.fit_many(WI, WO, value + 0.5, "lambert+ggx", sigma=sigma, loss="gaussian", fixed={"ks": 1.0, "eta": 1.5})
    one = single(value[0] + 0.5, sigma[0], loss="gaussian", fixed={"ks": 1.0, "eta": 1.5})
    assert one.result == "at_bound"
    agree(found, 0, one)
    assert np.isnan(found.sd_of("kd")).all()
    assert np.isfinite(found.sd_of("alpha")).all()


@pytest.mark.study
def test_neither_order_nor_tiles_nor_threads_matter(monkeypatch) -> None:
    value, sigma = surfaces(SURFACES)
    told: Any = {"to": "lambert+ggx", "loss": "gaussian"}
    found = fm.fit_many(WI, WO, value, sigma=sigma, **told)
    said: list[tuple[str, int, int]] = []
    monkeypatch.setattr(tiles, "SIZES", (16,))
    monkeypatch.setattr(tiles, "BLOCKS", (4, 4))
    back = fm.fit_many(
        WI, WO, value[::-1], sigma=sigma[::-1], threads=2, progress=lambda *words: said.append(words), **told
    )
    np.testing.assert_array_equal(back.outcome[::-1], found.outcome)
    np.testing.assert_allclose(back.values[::-1], found.values, rtol=SAME)
    assert [done for _, done, _ in said][-1] == SURFACES
    assert len(said) == 3


def test_a_texture_keeps_its_shape() -> None:
    value, sigma = surfaces(6)
    shape = (2, 3, SAMPLES, 1)
    found = fm.fit_many(WI, WO, value.reshape(shape), sigma=sigma.reshape(shape), loss="gaussian")
    flat = fm.fit_many(WI, WO, value[..., 0], sigma=sigma[..., 0], loss="gaussian")
    assert (found.outcome.shape, found["kd"].shape, found["alpha"].shape) == ((2, 3), (2, 3, 1), (2, 3))
    np.testing.assert_array_equal(found.values.reshape(6, 4), flat.values)
    np.testing.assert_array_equal(fm.evaluate(found.model(1, 2), WI, WO), fm.evaluate(flat.model(5), WI, WO))


def test_a_grid_has_valleys() -> None:
    """The first start is the node that a single fit would try first where the noise is Gaussian."""
    shared, held = shared_by_all([WI, WO], 1, "lambert+ggx", {}, LOSSES["gaussian"], None)
    known = table(shared, held)
    truth = fm.evaluate(fm.model("lambert+ggx", channels=1, kd=0.4, ks=0.8, alpha=0.25, eta=1.5), WI, WO)
    samples = gathered(shared, truth[None], None, 1)
    starts, cost = (np.asarray(part) for part in begin_many(known, samples, np.array([1e-9]), 3))
    np.testing.assert_allclose(starts[0, 0], [0.4, 0.8, 0.25, 1.5], rtol=1e-9)
    assert cost[0, 0] < 1e-9 * np.sum(samples.x**2 / samples.noise**2)


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"value": np.zeros((4, 63))}, r"value has shape \(4, 63\), expected \(…, 64, c\) for 64 pairs"),
        ({"value": np.zeros(64)}, r"value has shape \(64,\), expected"),
        ({"value": np.zeros((0, 64))}, r"value has shape \(0, 64\), expected"),
        ({"sigma": np.ones(3)}, r"sigma has shape \(3,\), expected one number, or \(2, 64\) as value"),
        ({"wi": 2.0 * WI}, "wi row 0 has length 2: expected unit vectors"),
        ({"wi": WI[:5]}, r"wi and wo have shapes \(5, 3\) and \(64, 3\)"),
        ({"loss": "gaussian"}, r"sigma is None, expected the noise: the loss gaussian \(--loss\) needs it"),
        ({"loss": "gaussian-inferred"}, r"loss is 'gaussian-inferred' \(--loss\), expected one that infers no noise"),
        ({"fixed": {"kd": 1, "ks": 1, "alpha": 0.1, "eta": 1.5}}, "every parameter of lambert.ggx is fixed"),
        ({"fixed": {"kp": 1}}, "cannot fix 'kp'"),
        ({"to": fm.model("lambert", channels=3)}, "the model has 3 channels and the values 1"),
        ({"to": fm.model("lambert"), "masking": "separable"}, "masking = 'separable' beside a model"),
        ({"to": "ggx-walk"}, "ggx-walk"),
        ({"to": "ggx-film"}, "expected a model: a film has wavelengths"),
    ],
)
def test_wrong_arguments_are_one_sentence(told, message) -> None:
    with pytest.raises(FitmatError, match=message):
        fm.fit_many(**({"wi": WI, "wo": WO, "value": np.ones((2, 64))} | told))


def test_a_parameter_that_is_not_there() -> None:
    value, sigma = surfaces(2)
    found = fm.fit_many(WI, WO, value, sigma=sigma, loss="gaussian")
    with pytest.raises(FitmatError, match=r"has no parameter 'kp', expected one of kd, ks, alpha, eta\."):
        found["kp"]


def test_outcomes_are_those_of_single_fits_and_one_more() -> None:
    assert list(OUTCOMES) == [*RESULTS, TOO_FEW]
