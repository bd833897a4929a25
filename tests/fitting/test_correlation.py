"""Correlation: sizes beside a dense likelihood of error contrasts, widths beside the process itself, and bad input."""

import dataclasses

import numpy as np
import pytest
from jaxtyping import Float
from scipy.linalg import null_space
from scipy.optimize import lsq_linear, minimize
from scipy.stats import multivariate_normal

import fitmat as fm
from fitmat.fitting import correlation, linear
from fitmat.fitting.left_blocks import BLOCKS, LEAST, Again, left_out, of_few, ranges
from fitmat.fitting.likelihood import prepare
from fitmat.fitting.losses import LOSSES
from fitmat.fitting.process import ASKED, LEFT_OVER, counted, factor, find, independent, kernel, sizes
from fitmat.fitting.result import Fit
from fitmat.judgement.scope import describe_scope
from fitmat.maths.directions import from_angles
from fitmat.maths.matern import matern
from fitmat.measurements.noise import measured_noise

INCIDENCES = np.deg2rad([10.0, 30.0, 50.0])

OUT = np.deg2rad(np.arange(-78.0, 79.0, 3.0))

FAR = Again(np.array(-np.inf), np.array(np.inf), lambda block, step: np.full(1, np.nan))
"""Without bounds: no step is too long."""


def dense(places: Float[np.ndarray, "n d"]) -> Float[np.ndarray, "n n"]:
    """K, every pair."""
    return matern(np.linalg.norm(places[:, None] - places[None], axis=-1))


def two_lobes(theta_i: np.ndarray, theta_o: np.ndarray, seed: int, noise: float = 0.01) -> fm.Measurements:
    """GGX + a GGX three times as wide, in the plane: no single GGX lobe follows it."""
    rng = np.random.default_rng(seed)
    kd, alpha, share = rng.uniform(0.05, 0.4), rng.uniform(0.1, 0.25), rng.uniform(0.2, 0.6)
    narrow, wide = (fm.model("lambert+ggx", kd=kd, ks=1.0, alpha=a, eta=1.5) for a in (alpha, 3.0 * alpha))
    ti, to = (part.ravel() for part in np.meshgrid(theta_i, theta_o, indexing="ij"))
    seen = np.abs(ti + to) > np.deg2rad(3.0)
    ti, to = ti[seen], to[seen]
    wi, wo = from_angles(ti, 0.0 * ti), from_angles(np.abs(to), np.where(to >= 0, np.pi, 0.0))
    exact = sum(w * fm.evaluate(m, wi, wo)[:, 0] for w, m in ((1.0 - share, narrow), (share, wide)))
    sigma = np.maximum(noise * exact, 1e-9)
    return fm.from_arrays(ti, to, exact + sigma * rng.normal(size=len(ti)), sigma=sigma)


@pytest.fixture(scope="module")
def wrong() -> Fit:
    """A single lobe fitted to two."""
    return fm.fit(two_lobes(INCIDENCES, OUT, 1), "lambert+ggx")


@pytest.fixture(scope="module")
def right() -> Fit:
    """A lobe fitted to itself."""
    truth = fm.model("lambert+ggx", kd=0.2, alpha=0.2)
    return fm.fit(fm.simulate(truth, INCIDENCES, OUT, relative_noise=0.02, absolute_noise=1e-3, seed=1), "lambert+ggx")


def test_the_factor_is_the_kernel() -> None:
    """Its product and the diagonal left over beside K of every pair; K is singular, for places are repeated."""
    places = np.random.default_rng(0).uniform(0.0, 4.0, (150, 2))
    places = np.concatenate([places, places[:50]])
    root = factor(places, np.ones(len(places), bool))
    assert root.shape[1] < 150
    gap = dense(places) - root @ root.T
    left = np.diagonal(gap)
    assert np.abs(gap).max() <= left.max() + 1e-9  # what is left is positive semidefinite
    assert left.mean() < LEFT_OVER


def test_sizes_are_those_of_the_error_contrasts() -> None:
    """Beside SciPy's density of Nᵀr, N spanning what no parameter moves, maximised over both sizes at once."""
    rng = np.random.default_rng(3)
    places, basis = rng.uniform(0.0, 3.0, (80, 2)), np.linalg.qr(rng.normal(size=(80, 3)))[0]
    kernel = dense(places)
    r = np.linalg.cholesky(0.5 * np.eye(80) + 2.0 * kernel) @ rng.normal(size=80)
    contrasts = null_space(basis.T)

    def cost(logs: np.ndarray) -> float:
        spread = np.exp(logs[0]) * np.eye(80) + np.exp(logs[1]) * kernel
        return -multivariate_normal.logpdf(contrasts.T @ r, cov=contrasts.T @ spread @ contrasts)

    best = minimize(cost, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-8})
    white = -cost(np.array([np.log(np.mean((contrasts.T @ r) ** 2)), -40.0]))
    found = sizes(r, basis, [np.linalg.cholesky(kernel)])
    assert found.gain == pytest.approx(-best.fun - white, abs=0.02)  # the grid's ratios are 10 % apart
    assert [found.white, found.process[0]] == pytest.approx(np.exp(best.x), rel=0.15)


@pytest.mark.study
def test_each_part_has_a_size_of_its_own() -> None:
    """Beside the same density, maximised over three sizes; a part whose process hardly raises it has none."""
    rng = np.random.default_rng(4)
    places, basis = rng.uniform(0.0, 6.0, (160, 2)), np.linalg.qr(rng.normal(size=(160, 3)))[0]
    rows = np.stack([places[:, 0] < 3.0, places[:, 0] >= 3.0])
    kernels = [dense(places) * np.outer(part, part) for part in rows]
    unit = [np.linalg.cholesky(k + 1e-9 * np.eye(160)) @ rng.normal(size=160) for k in kernels]
    white, contrasts = rng.normal(size=160), null_space(basis.T)
    parts = kernel(places, rows)

    def cost(logs: np.ndarray, r: np.ndarray) -> float:
        spread = np.exp(logs[0]) * np.eye(160) + sum(np.exp(x) * k for x, k in zip(logs[1:], kernels, strict=True))
        return -multivariate_normal.logpdf(contrasts.T @ r, cov=contrasts.T @ spread @ contrasts)

    r = white + 3.0 * unit[0] + unit[1]
    best = minimize(cost, np.zeros(3), args=(r,), method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-7})
    found = sizes(r, basis, parts.roots)
    assert [found.white, *found.process] == pytest.approx(np.exp(best.x), rel=0.15)
    lone = sizes(white + 3.0 * unit[0], basis, parts.roots)
    assert lone.process[0] > 3.0
    assert lone.process[1] == 0.0


def test_a_right_model_keeps_its_intervals(right: Fit) -> None:
    assert right.correlation.outcome == "independent"
    np.testing.assert_array_equal(right.correlation.stretch, np.eye(4))
    np.testing.assert_array_equal(right.covariance, right.likelihood_covariance)
    assert right.correlation.independent == right.n_values
    draws = fm.laplace(right, seed=1)
    assert draws.values is draws.drawn


def test_a_misfit_of_the_highlight_leaves_the_base_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sharp lobe, brighter than its model at some incidences and darker at others; beside it one size for all."""
    truth, incidences = fm.model("lambert+ggx", kd=0.8, alpha=0.02), np.deg2rad(np.arange(10.0, 51.0, 10.0))
    out = np.deg2rad(np.arange(-78.0, 79.0))
    m = fm.simulate(truth, incidences, out, relative_noise=0.01, absolute_noise=1e-4, seed=1)
    half = m.wi + m.wo
    near = np.arccos(half[:, 2] / np.linalg.norm(half, axis=1)) < 0.04
    uneven = 1.0 + 0.1 * near * np.cos(9.0 * m.theta_i)
    fit = fm.fit(dataclasses.replace(m, value=m.value * uneven[:, None]), "lambert+ggx")
    found, wider = fit.correlation, np.sqrt(fit.correlation.inflation)
    assert found.size[0, 0] > 0.0
    assert found.size[0, 1] == 0.0
    assert wider[0] < 1.5
    assert wider[[1, 3]].min() > 10.0  # ks and eta, which trade off
    assert fit.adequacy.endswith(", but near the highlight neighbouring angles share a misfit")
    assert ". Near the highlight neighbouring angles share a misfit: " in describe_scope(fit)
    monkeypatch.setattr(correlation, "NEAR", np.inf)
    single = dataclasses.replace(fit)
    assert single.correlation.shared == "neighbouring angles share a misfit"


def test_widened_draws_have_the_covariance_that_is_quoted(wrong: Fit) -> None:
    posterior = fm.laplace(wrong, seed=1, corrected=False)
    assert wrong.correlation.found
    assert posterior.description()["widened"].startswith(f"{wrong.n_values} readings count as ")
    sd = np.sqrt(np.diagonal(wrong.covariance))
    assert (sd > 2.0 * np.sqrt(np.diagonal(wrong.likelihood_covariance))).any()
    moved = wrong.coordinates
    here = moved.natural(wrong.values)
    free = np.minimum(here - moved.low, moved.high - here) > 3.0 * sd / moved.slope(wrong.values)
    assert free.sum() >= 2  # those that no bound folds
    np.testing.assert_allclose((posterior.values.std(axis=0) / sd)[free], 1.0, atol=0.08)  # 2000 draws
    ratio = wrong.covariance.diagonal() / wrong.likelihood_covariance.diagonal()
    np.testing.assert_allclose(wrong.correlation.inflation, ratio, rtol=0.02)  # of one on the range of the bounds


def test_a_range_left_out_moves_a_line_as_it_moves_without_it() -> None:
    """Straight lines fitted again by NumPy without each quarter of the abscissa; t(0.975, 3) = 3.182446 in tables."""
    rng, x = np.random.default_rng(5), np.sort(np.random.default_rng(6).uniform(0.0, 2.0, 60))
    y, design = np.sin(3.0 * x) + 0.1 * rng.normal(size=60), np.stack([np.ones(60), x], axis=1)
    best = np.polynomial.polynomial.polyfit(x, y, 1)
    edges = np.quantile(x, [0.25, 0.5, 0.75])
    quarter = np.digitize(x, edges)
    again = [np.polynomial.polynomial.polyfit(x[quarter != k], y[quarter != k], 1) for k in range(4)]
    expected = 3.0 / 4.0 * np.cov(np.array(again).T, bias=True) * 4.0
    assert of_few(3) == pytest.approx((3.182446 / 1.959964) ** 2, rel=1e-6)
    residual, slopes = (y - design @ best)[:, None], design[:, None, :]
    found = left_out(residual, slopes, design.T @ design, ranges(x), 1.0, FAR)
    np.testing.assert_allclose(found, expected, rtol=100 * LEAST)
    every_second = np.arange(0, 60, 2)  # stands for all, each twice
    thin = left_out(residual[every_second], slopes[every_second], design.T @ design, ranges(x)[every_second], 2.0, FAR)
    assert 0.3 < np.sqrt(thin[1, 1] / found[1, 1]) < 3.0


def test_where_a_step_leaves_the_bounds_it_is_fitted_again() -> None:
    """A line with a bend of which the last quarter tells alone, beside SciPy's fits within bounds without each."""
    rng, x = np.random.default_rng(5), np.sort(np.random.default_rng(6).uniform(0.0, 2.0, 60))
    design = np.stack([np.ones(60), x, np.maximum(x - 1.5, 0.0) + 1e-3 * x**2], axis=1)
    y = np.sin(3.0 * x) + 0.1 * rng.normal(size=60)
    best = np.linalg.lstsq(design, y, rcond=None)[0]
    low, high, asked = np.array([-9.0, -9.0, -4.0]), np.array([9.0, 9.0, 4.0]), []
    quarter = np.digitize(x, np.quantile(x, [0.25, 0.5, 0.75]))

    def moves(block: int, step: np.ndarray) -> np.ndarray:
        asked.append(block)
        assert step[2] > high[2] or step[2] < low[2]
        kept = quarter != block
        return lsq_linear(design[kept], y[kept], (best + low, best + high)).x - best

    residual, slopes, known = (y - design @ best)[:, None], design[:, None, :], design.T @ design
    found = left_out(residual, slopes, known, quarter, 1.0, Again(low, high, moves))
    assert asked == [3]
    expected = 3.0 * np.cov(np.array([moves(k, 2.0 * high) for k in range(4)]).T, bias=True)
    np.testing.assert_allclose(found, expected, rtol=0.01, atol=1e-4)
    assert left_out(residual, slopes, known, quarter, 1.0, FAR)[2, 2] > 3.0 * found[2, 2]


@pytest.fixture(scope="module")
def valley() -> Fit:
    """93 readings of which ks and eta trade off without one range: a straight step leaves their bounds far behind."""
    m = two_lobes(np.deg2rad([15.0, 30.0, 45.0]), np.deg2rad(np.arange(-75.0, 76.0, 5.0)), 10, noise=0.005)
    return fm.fit(m, "lambert+ggx")


@pytest.mark.study
def test_no_misfit_makes_an_interval_wider_than_its_bounds(valley: Fit) -> None:
    sd = np.sqrt(np.diagonal(valley.covariance)) / valley.coordinates.slope(valley.values)
    assert valley.correlation.found
    assert (sd < valley.coordinates.span).all()
    assert (valley["ks"].remarks, valley["kd"].remarks) == (("not determined",), ("",))


@pytest.mark.study
def test_a_misfit_moves_parameters_as_fits_without_a_range_do(valley: Fit) -> None:
    """From all starts, and without their own linear steps."""
    m, moved, total = valley.measurements, valley.coordinates, np.zeros((4, 4))
    h = m.wi + m.wo
    theta_d = np.arccos(np.sum(m.wi * h, axis=1) / np.linalg.norm(h, axis=1))
    along = ranges(theta_d), ranges(np.round(m.theta_i, 6))
    for blocks in along:
        kept = [dataclasses.replace(m, valid=m.valid & (blocks != k)[:, None]) for k in np.unique(blocks)]
        again = np.array([moved.natural(fm.fit(part, "lambert+ggx").values) for part in kept])
        total += (len(again) - 1) * np.cov(again.T, bias=True)
    expected = np.sqrt(of_few(sum(int(blocks.max()) for blocks in along)) * np.diagonal(total))
    sd = np.sqrt(np.diagonal(valley.covariance)) / moved.slope(valley.values)
    np.testing.assert_allclose(sd, expected, rtol=0.2)


def test_equal_places_lie_in_one_range_and_one_range_says_nothing() -> None:
    assert len(np.unique(ranges(np.repeat([0.1, 0.5], 10)))) == 2
    assert len(np.unique(ranges(np.arange(100.0)))) == BLOCKS
    alone = ranges(np.full(20, 0.3))
    assert not left_out(np.ones((20, 1)), np.ones((20, 1, 1)), 20.0 * np.eye(1), alone, 1.0, FAR).any()


def test_what_one_range_determines_alone_moves_finitely() -> None:
    """The last parameter is seen in the last quarter only."""
    slopes = np.zeros((40, 1, 2))
    slopes[:, 0, 0], slopes[30:, 0, 1] = 1.0, 1.0
    known = np.einsum("nci,ncj->ij", slopes, slopes)
    r = np.where(np.arange(40) % 2, 1.0, -1.0)[:, None] + np.linspace(-1.0, 1.0, 40)[:, None]
    found = left_out(r, slopes, known, ranges(np.arange(40.0)), 1.0, FAR)
    assert np.isfinite(found).all()
    assert found[1, 1] > 1e3 * found[0, 0] > 0.0


@pytest.mark.study
def test_two_halves_of_a_range_agree() -> None:
    """Low and high incidences of surfaces with two lobes: the small version of `benchmarks/misfit.py`.

    In natural coordinates, as intervals are. As if the misfit of each sample were its own, hardly any difference of kd,
    ks and alpha is within 1.96 standard deviations. Eta is left out: how F rises towards grazing is not seen at low
    incidences.
    """
    halves = np.deg2rad([[10.0, 20.0, 30.0], [45.0, 55.0, 65.0]])
    quoted, alone = [], []
    for seed in range(32):
        pair = [fm.fit(two_lobes(half, OUT, seed), "lambert+ggx") for half in halves]
        apart = np.abs(np.subtract(*(fit.coordinates.natural(fit.values) for fit in pair)))[:3]
        for found, of in ((quoted, "covariance"), (alone, "likelihood_covariance")):
            sd = (np.sqrt(np.diagonal(getattr(fit, of))) / fit.coordinates.slope(fit.values) for fit in pair)
            found.append(apart / np.hypot(*(one[:3] for one in sd)))
    assert np.mean(np.array(quoted) < 1.96) >= 0.8
    assert np.mean(np.array(alone) < 1.96) <= 0.5


@pytest.mark.parametrize("count", [1500, 2000])
def test_many_rows_are_as_the_exact_kernel_has_them(count: int) -> None:
    """Of a factor of `RANK` columns, how alike they are beside tr K² of every pair."""
    rng = np.random.default_rng(2)
    places = np.stack([rng.uniform(-3.0, 3.0, count), np.zeros(count), rng.uniform(0.0, 1.7, count)], axis=1)
    every = np.ones(count, bool)
    found = counted(every[:, None], kernel(places, every[None]))
    assert found.alike[0, 0] == pytest.approx(np.sum(dense(places) ** 2), rel=2e-3)
    assert found.part[0, 0] == count


def test_a_dense_scan_is_as_wide_as_a_part_of_it(wrong: Fit, monkeypatch: pytest.MonkeyPatch) -> None:
    """4,200 rows about a fit, all and every second: the same widths to a fifth, for τ of a part is known less well."""
    m = two_lobes(INCIDENCES, np.deg2rad(np.linspace(-78.0, 78.0, 1400)), 1)
    data = prepare(m, measured_noise(m))
    more = m.n_samples / wrong.n_values

    def inflation(rows: int) -> np.ndarray:
        monkeypatch.setattr(linear, "ROWS", rows)
        given = wrong.model, data, wrong.discrepancy, wrong.coordinates, more * wrong.information, m.n_samples
        near = linear.linearise(*given)
        return correlation.correlate(
            wrong.model, data, wrong.discrepancy, near, wrong.coordinates, m.n_samples
        ).inflation

    every = inflation(10_000)
    assert every.max() > 100.0
    np.testing.assert_allclose(np.sqrt(inflation(2200)), np.sqrt(every), rtol=0.2)


def test_the_channel_that_is_wrong_is_the_one_in_which_it_is_found() -> None:
    """Ten channels of one shared parameter and one each; the residuals of the last follow a process."""
    rng, channels = np.random.default_rng(7), 10
    places = np.stack([np.linspace(-3.0, 3.0, 200), np.zeros(200), np.zeros(200)], axis=1)
    r = rng.normal(size=(200, channels))
    r[:, 9] += np.linalg.cholesky(dense(places) + 1e-9 * np.eye(200)) @ rng.normal(size=200)
    slopes = np.zeros((200, channels, channels + 1))
    slopes[:, :, 0] = np.exp(-(places[:, :1] ** 2))
    slopes[:, np.arange(channels), 1 + np.arange(channels)] = 1.0
    used, parts = np.ones(r.shape, bool), kernel(places, np.ones((1, 200), bool))
    found, counts = find(r, slopes, used, parts), counted(used, parts)
    assert (found.gain[:9] < ASKED).all()
    assert not found.size[:9].any()
    assert 0.5 < found.size[9, 0] < 2.0
    spread = np.diag(np.repeat(found.white, 200))
    spread[1800:, 1800:] += found.size[9, 0] ** 2 * dense(places)
    exact = np.trace(spread) ** 2 / np.sum(spread**2)
    assert independent(found, counts, 1.0) == pytest.approx(exact, rel=1e-3)


def test_few_values_are_not_judged(wrong: Fit) -> None:
    weight = np.where(np.arange(len(wrong.data.x)) < 9, 1.0, 0.0)[:, None]
    few = dataclasses.replace(wrong, data=dataclasses.replace(wrong.data, weight=weight), n_values=9)
    assert few.correlation.outcome == "not judged"
    assert few.correlation.independent == 9
    np.testing.assert_array_equal(few.covariance, few.likelihood_covariance)


def test_values_without_noise_are_no_reason_to_fail(wrong: Fit) -> None:
    """Simulated without noise: a right model is not widened, a wrong one is."""
    exact = fm.fit(two_lobes(INCIDENCES, OUT, 1, noise=0.0), "lambert+ggx")
    assert exact.correlation.found
    assert np.isfinite(exact.covariance).all()
    m = exact.measurements
    found = fm.fit(dataclasses.replace(m, value=fm.evaluate(exact.model, m.wi, m.wo)), "lambert+ggx")
    assert not found.correlation.found
    np.testing.assert_array_equal(found.covariance, found.likelihood_covariance)


def test_an_objective_has_no_intervals_to_widen(wrong: Fit) -> None:
    objective = dataclasses.replace(wrong, data=wrong.data.under(LOSSES["cube-root"]))
    assert objective.correlation.outcome == "not judged"
