"""Posteriors: emcee against importance sampling and Laplace, verdicts, interrupts, files, and coverage of the truth."""

import dataclasses
import json
import sys
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import polars as pl
import pytest
from scipy import stats

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.likelihood import log_likelihood
from fitmat.fitting.result import Fit
from fitmat.models.parameters import vector, with_vector
from fitmat.uncertainty.chains import CHUNK, WALKERS
from fitmat.uncertainty.density import log_posterior
from fitmat.uncertainty.diagnostics import ENOUGH_ESS, ENOUGH_TAIL_ESS, ENOUGH_TAU, GOOD_RHAT, Diagnostics
from fitmat.uncertainty.mixing import split_rhat, tail_ess
from fitmat.uncertainty.posterior import Posterior

QUANTILE = 0.15
"""In standard deviations: three Monte Carlo errors, 2.7/√ESS, of an outer quantile from about 1600 effective draws,
rounded down from 0.2 because the seeds are fixed."""

GAUSSIAN = 0.06
"""Relative: three errors, 1/√(2·1200), of a standard deviation from 1200 effective draws."""

REPEATS, AT_LEAST = 100, 0.88
"""95 % intervals of a correct program cover fewer than 88 of 100 truths for one choice of seeds in 700."""

TRUTH: dict[str, Any] = {"kd": 0.3, "ks": 1.0, "alpha": 0.3, "eta": 1.5}


def seen(seed: int) -> fm.Measurements:
    theta_o = np.deg2rad(np.arange(-80, 81, 10))
    truth = fm.model("lambert+ggx", **TRUTH)
    return fm.simulate(truth, np.deg2rad([20, 45, 70]), theta_o, relative_noise=0.02, absolute_noise=1e-3, seed=seed)


@pytest.fixture(scope="module")
def fit() -> Fit:
    return fm.fit(seen(1), "lambert+ggx")


@pytest.fixture(scope="module")
def sampled(fit: Fit) -> Posterior:
    return fm.sample(fit, seed=1)


def natural(fit: Fit, values: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Sampled coordinates: kd, ks, ln alpha, ln eta, s."""
    return np.column_stack([values[:, :2], np.log(values[:, 2:]), s])


def test_the_target_is_likelihood_times_flat_priors(fit: Fit) -> None:
    inside = natural(fit, fit.values[None] * 1.01, np.array([0.002]))
    moved = with_vector(fit.model, jnp.asarray(fit.values * 1.01))
    expected = float(log_likelihood(moved, fit.data, jnp.array(0.002)))
    assert log_posterior(fit)(inside) == pytest.approx([expected], rel=1e-9)  # rounding of exp and log
    outside = np.tile(inside, (5, 1)) + np.diag([1.0, -2.0, 5.0, -1.0, -1.0])
    assert np.isneginf(log_posterior(fit)(outside)).all()


def test_the_moves_leave_the_target_as_it_is(fit: Fit) -> None:
    """Quantiles by importance sampling of 40,000 draws, a method without chains; only the target is shared."""
    rng, count = np.random.default_rng(1), 40_000
    scale = np.where(coordinates(fit.model).ratio, fit.values, 1.0)
    centre, shape = natural(fit, fit.values[None], np.zeros(1))[0, :4], fit.covariance / np.outer(scale, scale)
    wide, folded = rng.standard_t(5, (count, 4)), np.abs(rng.standard_cauchy(count))
    parameters = centre + wide @ np.linalg.cholesky(1.5 * shape).T
    drawn = np.column_stack([parameters, 0.2 * float(fit.data.typical) * folded])
    logs = log_posterior(fit)(drawn) - stats.t.logpdf(wide, 5).sum(axis=1) - stats.cauchy.logpdf(folded)
    weight = np.exp(logs - logs.max())
    weight /= weight.sum()
    assert 1 / np.sum(weight**2) > 2000  # the effective number of draws: the reference is sharper than the chain
    sampled = fm.sample(fit, seed=1, walkers=128)
    assert sampled.diagnostics is not None
    assert sampled.diagnostics.ess.min() > 1600
    chain = natural(fit, sampled.values, sampled.discrepancy)
    for k in range(5):
        order = np.argsort(drawn[:, k])
        places = np.searchsorted(np.cumsum(weight[order]), [0.025, 0.25, 0.5, 0.75, 0.975])
        difference = np.quantile(chain[:, k], [0.025, 0.25, 0.5, 0.75, 0.975]) - drawn[order[places], k]
        assert np.abs(difference).max() < QUANTILE * chain[:, k].std()


def test_emcee_agrees_with_laplace_where_the_posterior_is_gaussian() -> None:
    """1,000 samples of a Lambert surface with a planted misfit: albedo and s are both well determined."""
    rng, theta = np.random.default_rng(1), np.linspace(0.0, 1.2, 1000)
    root = np.cbrt(0.1 * np.cos(theta)) + 0.02 * rng.normal(size=theta.shape)
    m = fm.from_arrays(theta, 0.5, root**3 / np.cos(theta), sigma=np.full(theta.shape, 1e-4))
    found = fm.fit(m, "lambert")
    chain, gauss = fm.sample(found, seed=2), fm.laplace(found, seed=2)
    sd = np.sqrt(found.covariance[0, 0])
    for posterior in (chain, gauss):
        assert posterior.sd()[0] == pytest.approx(sd, rel=GAUSSIAN)
        assert abs(posterior.values[:, 0].mean() - found.values[0]) < GAUSSIAN * 1.5 * sd
        assert posterior.discrepancy.mean() == pytest.approx(0.02, rel=3 / np.sqrt(2000))  # three errors of an sd
        assert posterior.discrepancy.std() == pytest.approx(0.02 / np.sqrt(2000), rel=2 * GAUSSIAN)


def test_the_seed_is_the_chain(fit: Fit) -> None:
    first, same, other = (fm.sample(fit, seed=seed, max_steps=20).values for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, same)
    assert not np.isin(first[:, 0], other[:, 0]).any()
    one, again, two = (fm.laplace(fit, seed=seed).values for seed in (5, 5, 6))
    np.testing.assert_array_equal(one, again)
    assert not np.any(one == two)


def test_a_finished_chain_is_reliable(sampled: Posterior) -> None:
    d = sampled.diagnostics
    assert d is not None
    assert sampled.verdict == "reliable"
    assert d.steps - d.burn_in >= ENOUGH_TAU * d.tau.max()
    assert d.ess.min() >= ENOUGH_ESS
    assert d.tail_ess.min() >= ENOUGH_TAIL_ESS
    assert d.rhat.max() <= GOOD_RHAT
    assert 0.2 < d.acceptance < 0.9
    assert sampled.chain is not None
    assert sampled.chain.shape == (d.steps - d.burn_in, WALKERS, 5)
    np.testing.assert_array_equal(sampled.chain[..., :4].reshape(-1, 4), sampled.values)
    assert sampled.values.min(axis=0)[3] > 1.0  # eta within its bounds


def test_short_chains_are_said_to_be_short(fit: Fit) -> None:
    assert fm.sample(fit, seed=1, max_steps=8).verdict == "unusable"
    short = fm.sample(fit, seed=1, max_steps=100)
    assert short.verdict == "tentative"
    assert short.usable
    assert short.diagnostics is not None
    assert short.diagnostics.steps == 100


def diagnosed(sampled: Posterior, **changes: object) -> str:
    given: dict[str, object] = {"tau": np.full(5, 8.0), "ess": np.full(5, 4000.0), "rhat": np.full(5, 1.01)}
    given["tail_ess"] = np.full(5, 4000.0)
    given |= {"acceptance": 0.5, "steps": 1040, "burn_in": 40, "walkers": 32, "seed": 1, **changes}
    return dataclasses.replace(sampled, diagnostics=Diagnostics(**given)).verdict  # pyright: ignore[reportArgumentType]


def test_verdicts_follow_their_thresholds(sampled: Posterior) -> None:
    assert diagnosed(sampled) == "reliable"
    assert diagnosed(sampled, tau=np.full(5, 21.0)) == "tentative"  # 1000 steps are 48 τ
    assert diagnosed(sampled, tau=np.full(5, 101.0)) == "unusable"  # fewer than 10 τ
    assert diagnosed(sampled, tau=np.full(5, np.nan)) == "unusable"
    assert diagnosed(sampled, ess=np.full(5, 399.0)) == "tentative"
    assert diagnosed(sampled, tail_ess=np.full(5, 713.0)) == "tentative"
    assert diagnosed(sampled, rhat=np.full(5, 1.06)) == "tentative"
    assert diagnosed(sampled, rhat=np.full(5, 1.21)) == "unusable"


def test_laplace_is_not_sampled(fit: Fit) -> None:
    gauss = fm.laplace(fit, seed=1, corrected=False)
    assert gauss.verdict == "not sampled"
    assert gauss.usable
    assert gauss.chain is None
    sd = np.sqrt(np.diagonal(fit.covariance))
    np.testing.assert_allclose(gauss.sd(), sd, rtol=GAUSSIAN)
    middle = gauss.interval(0.6827)
    np.testing.assert_allclose(middle[:, 1] - middle[:, 0], 2 * sd, rtol=2 * GAUSSIAN)  # ±1 sd of a Gaussian


def test_draws_respect_the_bounds() -> None:
    """Albedo 0.98 ± 0.02: Laplace's Gaussian is folded at 1, emcee's prior ends there."""
    value = 0.98 / np.pi * (1 + 0.1 * np.random.default_rng(3).normal(size=51))
    m = fm.from_arrays(np.linspace(0, 1.2, 51), 0.3, value, sigma=np.full(51, 0.1 * 0.98 / np.pi))
    found = fm.fit(m, "lambert")
    for posterior in (fm.laplace(found, seed=1), fm.sample(found, seed=1, max_steps=100)):
        assert 0.999 < posterior.values.max() <= 1.0
        assert posterior.discrepancy.min() >= 0.0


@pytest.mark.parametrize("calls", [1, 2])
def test_an_interrupt_keeps_what_was_done(fit: Fit, calls: int) -> None:
    seen: list[tuple[int, int]] = []

    def stop(what: str, done: int, expected: int) -> None:
        assert what == f"sampling {fit.name}"
        seen.append((done, expected))
        if len(seen) == calls:
            raise KeyboardInterrupt

    kept = fm.sample(fit, seed=1, max_steps=350, progress=stop)
    assert kept.interrupted
    assert kept.diagnostics is not None
    assert kept.diagnostics.steps == CHUNK * calls
    assert [done for done, _ in seen] == [CHUNK, 2 * CHUNK][:calls]
    assert all(done <= expected <= 350 for done, expected in seen)


def test_an_interrupt_before_the_first_steps_leaves_laplace(fit: Fit, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("emcee.EnsembleSampler.run_mcmc", interrupted)
    kept = fm.sample(fit, seed=1)
    assert kept.interrupted
    assert kept.method == "laplace"
    np.testing.assert_array_equal(kept.values, fm.laplace(fit, seed=1).values)


def test_nothing_to_sample_is_said() -> None:
    m = seen(1)
    assert m.sigma is not None
    broken = fm.fit(dataclasses.replace(m, sigma=1e-200 * m.sigma), "lambert+ggx")
    with pytest.raises(FitmatError, match=r"lambert\+ggx: the fit ended nonfinite, there is nothing to sample; check "):
        fm.sample(broken, seed=1)
    assert fm.laplace(broken, seed=1).verdict == "unusable"


def test_split_rhat_by_hand() -> None:
    """Vehtari et al. 2021, eqs. 1–4 and 14, chain by chain; two walkers of eight steps, one of which drifts."""
    chain = np.random.default_rng(3).normal(size=(8, 2)) + np.linspace(0.0, 3.0, 8)[:, None] * [1.0, 0.0]
    halves = np.array([chain[:4, 0], chain[:4, 1], chain[4:, 0], chain[4:, 1]])

    def by_hand(halves: np.ndarray) -> float:
        z = stats.norm.ppf((stats.rankdata(halves).reshape(halves.shape) - 3 / 8) / (halves.size + 1 / 4))
        between = 4 * np.var([np.mean(h) for h in z], ddof=1)
        within = np.mean([np.var(h, ddof=1) for h in z])
        return np.sqrt((within * (4 - 1) / 4 + between / 4) / within)

    expected = max(by_hand(halves), by_hand(np.abs(halves - np.median(halves))))
    assert split_rhat(chain[..., None]) == pytest.approx([expected])


def test_split_rhat_knows_good_chains_from_bad() -> None:
    chain = np.random.default_rng(1).normal(size=(500, 16, 3))
    assert np.abs(split_rhat(chain) - 1).max() < 0.01
    assert split_rhat(chain + np.linspace(0, 2, 16)[:, None]).min() > 1.1  # walkers that disagree
    assert split_rhat(chain + np.linspace(0, 2, 500)[:, None, None]).min() > 1.1  # walkers that still drift
    assert np.isnan(split_rhat(np.zeros((500, 16, 1)))).all()  # stuck


def test_limits_scatter_as_their_effective_draws_say() -> None:
    """400 sets of AR(1) walks with ρ = 0.8: how far 2.5 % quantiles scatter, beside √(p (1 − p)/ESS)/φ(1.96)."""
    rng, rho = np.random.default_rng(5), 0.8
    x = np.zeros((300, 400, 8))
    for k in range(1, 300):
        x[k] = rho * x[k - 1] + np.sqrt(1 - rho**2) * rng.normal(size=x.shape[1:])
    walks = x[60:].transpose(1, 0, 2)  # set, step, walker
    limit = np.quantile(walks, 0.025, axis=(1, 2))
    told = np.mean([tail_ess(one[..., None])[0] for one in walks])
    assert limit.std() == pytest.approx(np.sqrt(0.025 * 0.975 / told) / 0.0584, rel=0.12)  # its own error is 4 %
    assert told > 1.5 * walks[0].size * (1 - rho) / (1 + rho)  # a threshold is forgotten sooner than the value


def test_walks_that_linger_in_a_tail_are_said_to() -> None:
    """Independent draws but for one walker in forty that rests below all others' 2.5 % for half of the time."""
    chain = np.random.default_rng(6).normal(size=(400, 40, 1))
    free = tail_ess(chain)[0]
    chain[:200, 0] = -3.0
    assert free > 10_000
    assert tail_ess(chain)[0] < 714
    assert np.isnan(tail_ess(np.zeros((50, 8, 1)))).all()


def test_thinning_spreads_over_the_run(sampled: Posterior) -> None:
    values, s = sampled.thinned(10)
    assert values.shape == (10, 4)
    assert s.shape == (10,)
    np.testing.assert_array_equal(values[[0, -1]], sampled.values[[0, -1]])
    assert len(dataclasses.replace(sampled, drawn=sampled.drawn[:3]).thinned(10)[0]) == 3


def test_draws_are_saved_as_a_table(fit: Fit, sampled: Posterior, tmp_path: Path) -> None:
    for posterior in (sampled, fm.laplace(fit, seed=1)):
        path = tmp_path / f"{posterior.method}.parquet"
        posterior.save(path)
        table, known = pl.read_parquet(path), pl.read_parquet_metadata(path)
        assert table.columns == ["chain", "draw", *TRUTH, "discrepancy"]
        numbers = table.sort("draw", "chain").select(*TRUTH, "discrepancy").to_numpy()
        np.testing.assert_array_equal(numbers, np.column_stack([posterior.values, posterior.discrepancy]))
        assert (known["model"], known["method"], known["verdict"]) == ("lambert+ggx", path.stem, posterior.verdict)
        assert json.loads(known["units"]) == dict.fromkeys(TRUTH, "1")
    assert (table["chain"].n_unique(), table["draw"].n_unique()) == (1, 2000)
    assert "seed" not in known
    diagnostics, table = sampled.diagnostics, sampled.table()
    assert diagnostics is not None
    assert (table["chain"].n_unique(), table["draw"].max()) == (
        diagnostics.walkers,
        diagnostics.steps - diagnostics.burn_in - 1,
    )
    assert (sampled.description()["seed"], sampled.description()["burn_in"]) == ("1", str(diagnostics.burn_in))


def test_channels_have_their_own_columns(tmp_path: Path) -> None:
    value = np.full((51, 3), [0.1, 0.2, 0.3])
    m = fm.from_arrays(np.linspace(0, 1.2, 51), 0.3, value, sigma=0.01 * value, channels=("r", "g", "b"))
    posterior = fm.laplace(fm.fit(m, "lambert"), seed=1)
    posterior.save(tmp_path / "rgb.parquet")
    table = pl.read_parquet(tmp_path / "rgb.parquet")
    assert table.columns == ["chain", "draw", "kd r", "kd g", "kd b", "discrepancy"]
    np.testing.assert_array_equal(table.select("^kd .*$").to_numpy(), posterior.values)


def test_draws_are_saved_in_no_other_form(fit: Fit, tmp_path: Path) -> None:
    with pytest.raises(FitmatError, match=r"draws\.csv: draws are written to \.parquet or \.nc; end the name with one"):
        fm.laplace(fit, seed=1).save(tmp_path / "draws.csv")


@pytest.mark.parametrize("missing", ["arviz_base", "h5netcdf"])
def test_a_missing_arviz_is_said_with_its_remedy(
    fit: Fit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(FitmatError, match=rf"needs the package {missing}, .* pip install 'fitmat\[netcdf\]'\.$"):
        fm.laplace(fit, seed=1).save(tmp_path / "draws.nc")
    assert not (tmp_path / "draws.nc").exists()


def test_draws_are_saved_as_arviz_reads_them(fit: Fit, sampled: Posterior, tmp_path: Path) -> None:
    for package in ("arviz_base", "h5netcdf"):
        pytest.importorskip(package, reason="install it with pip install 'fitmat[netcdf]'")
    import xarray

    for posterior in (sampled, fm.laplace(fit, seed=1)):
        path = tmp_path / f"{posterior.method}.nc"
        posterior.save(path)
        with xarray.open_datatree(path, engine="h5netcdf") as tree:
            group = tree.children["posterior"].to_dataset().load()
            assert set(group.data_vars) == {*TRUTH, "discrepancy"}
            assert group["alpha"].dims == ("chain", "draw")
            chains = group["alpha"].transpose("draw", "chain").values
            np.testing.assert_array_equal(chains.ravel(), posterior.values[:, 2])
            np.testing.assert_array_equal(
                group["discrepancy"].transpose("draw", "chain").values.ravel(), posterior.discrepancy
            )
            assert group.attrs["model"] == "lambert+ggx"
            assert group.attrs["verdict"] == posterior.verdict
    assert group["alpha"].shape == (1, 2000)


def test_fixed_parameters_are_not_saved_but_stay_in_the_draws(tmp_path: Path) -> None:
    m = fm.from_arrays(np.linspace(0, 1.2, 51), 0.3, np.full(51, 0.1), sigma=np.full(51, 0.01))
    held = fm.laplace(fm.fit(m, "lambert", fixed={"kd": 0.3}), seed=1)
    assert set(held.values[:, 0]) == {0.3}
    assert held.table().columns == ["chain", "draw", "discrepancy"]
    assert held.description()["units"] == "{}"


@pytest.mark.study
def test_intervals_cover_the_truth() -> None:
    """emcee's 95 % intervals of all four parameters, over files that differ by their noise alone."""
    truth, covered = np.array(list(TRUTH.values())), np.zeros(4)
    for seed in range(REPEATS):
        low, high = fm.sample(fm.fit(seen(1000 + seed), "lambert+ggx"), seed=seed, max_steps=200).interval().T
        covered += (low <= truth) & (truth <= high)
    print("\ncovered:", dict(zip(TRUTH, covered / REPEATS, strict=True)))
    assert covered.min() / REPEATS >= AT_LEAST
    assert vector(fm.model("lambert+ggx", **TRUTH)).tolist() == truth.tolist()
