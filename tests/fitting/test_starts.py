"""Where a fit begins: exact non-negative weights against scipy, and a grid that comes near the truth."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.optimize import nnls

import fitmat as fm
from fitmat.fitting import starts
from fitmat.fitting.likelihood import Data, prepare
from fitmat.fitting.starts import _weights, nonnegative, starting_points
from fitmat.measurements.noise import measured_noise
from fitmat.models.parameters import entries

OBJECTIVE = 1e-3
"""Of |b|²: how much more than scipy may be left; coordinate descent ends within about 1/sweeps = 1/300 in the worst
case, nearly parallel columns."""

WEIGHTS = 1e-9
"""Relative; two lobes of a BRDF are far from parallel, and the sweeps converge to rounding."""


def left(a: np.ndarray, b: np.ndarray, w: np.ndarray) -> float:
    return float(np.sum((a @ w - b) ** 2))


@given(
    hnp.arrays(float, (8, 3), elements=st.floats(-1, 1, width=16)),
    hnp.arrays(float, 8, elements=st.floats(-1, 1, width=16)),
)
@example(np.ones((8, 3)), np.arange(8.0))  # three times the same lobe
@example(np.eye(8, 3) * [1, 0, 1], np.ones(8))  # a lobe that no sample sees
@example(-np.eye(8, 3), np.ones(8))  # every weight wants to be negative
@example(np.zeros((8, 3)), np.ones(8))
@example(np.eye(8, 3) * 0.0 + np.outer(np.eye(8)[0], [1, -1, 0]) + np.outer(np.eye(8)[1], [0.0625, 0, 0]), np.ones(8))
def test_weights_are_as_good_as_scipys(a: np.ndarray, b: np.ndarray) -> None:
    w = nonnegative(a.T @ a, a.T @ b)
    assert (w >= 0).all()
    assert left(a, b, w) <= left(a, b, nnls(a, b)[0]) + OBJECTIVE * (b @ b)


@pytest.mark.parametrize("seed", range(5))
def test_weights_are_scipys_where_they_are_unique(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(40, 3)), rng.normal(size=40)
    np.testing.assert_allclose(nonnegative(a.T @ a, a.T @ b), nnls(a, b)[0], rtol=WEIGHTS, atol=WEIGHTS)


MANY = "lambert+phong+blinn-phong+ggx+beckmann+ward+ashikhmin-shirley"


def test_a_small_grid_is_looked_at_whole() -> None:
    model = fm.model("lambert+ggx+phong")
    shapes = [e for e in entries(model) if not e.param.weight]
    nodes = starts.nodes(model, shapes, {})
    expected = itertools.product(*(e.param.starts for e in shapes))
    assert nodes[:, [e.place.start for e in shapes]].tolist() == [list(node) for node in expected]


def test_of_a_grid_of_many_lobes_an_even_part_is_looked_at() -> None:
    """180 million nodes took gigabytes. Each pair of starts of two parameters has its share, to a tenth."""
    model = fm.model(MANY)
    shapes = [e for e in entries(model) if not e.param.weight]
    nodes = starts.nodes(model, shapes, {})
    assert len(nodes) == starts.MOST_NODES < math.prod(len(e.param.starts) for e in shapes) / 10_000
    for one, other in itertools.combinations(shapes, 2):
        pairs = nodes[:, [one.place.start, other.place.start]]
        found, count = np.unique(pairs, axis=0, return_counts=True)
        assert len(found) == len(one.param.starts) * len(other.param.starts)
        np.testing.assert_allclose(count, len(nodes) / len(found), rtol=0.1)


@pytest.fixture(scope="module")
def data() -> Data:
    truth, theta_o = fm.model("lambert+ggx", kd=0.3, alpha=0.15, eta=1.5), np.deg2rad(np.arange(-80, 81, 10))
    m = fm.simulate(truth, np.deg2rad([20, 45, 70]), theta_o, relative_noise=0.01, absolute_noise=1e-3, seed=1)
    return prepare(m, measured_noise(m))


def test_the_grid_comes_near_the_truth(data: Data) -> None:
    """alpha = 0.15 and eta = 1.5 are nodes of the grid; there the weights are solved to the noise."""
    template = fm.model("lambert+ggx")
    places = {e.name: e.place.start for e in entries(template)}
    points = np.asarray(starting_points(template, data, np.array(1e-3), {}, 6))
    assert points.shape == (6, 4)
    best = points[0]
    assert (best[places["alpha"]], best[places["eta"]]) == (0.15, 1.5)
    assert best[places["kd"]] == pytest.approx(0.3, rel=0.01)  # the noise
    assert best[places["ks"]] == pytest.approx(1.0, rel=0.01)


def test_fixed_parameters_stay_and_small_grids_give_fewer_starts(data: Data) -> None:
    template = fm.model("lambert+ggx")
    places = {e.name: e.place.start for e in entries(template)}
    held = {"ks": np.array([0.7]), "alpha": np.array([0.123])}
    points = np.asarray(starting_points(template, data, np.array(1e-3), held, 40))
    assert len(points) == 6  # the nodes of eta
    assert set(points[:, places["ks"]]) == {0.7}
    assert set(points[:, places["alpha"]]) == {0.123}
    assert len(set(points[:, places["eta"]])) == 6


def test_a_model_with_everything_fixed_has_one_start(data: Data) -> None:
    points = starting_points(fm.model("lambert"), data, np.array(1e-3), {"kd": np.array([0.4])}, 6)
    np.testing.assert_array_equal(points, [[0.4]])


@pytest.mark.parametrize("sizes", [(4, 4), (4, 1), (1, 1), (1, 4, 4)])
def test_weights_of_several_channels_are_those_of_scipy(sizes: tuple[int, ...]) -> None:
    """Lawson & Hanson on the whole system, in which each number of a weight has its own column."""
    rng = np.random.default_rng(7)
    columns, target = rng.uniform(0.0, 1.0, (30, 4, len(sizes))), rng.uniform(-0.5, 2.0, (30, 4))
    whole = []
    for k, size in enumerate(sizes):
        own = np.zeros((30, 4, size))
        for channel in range(4):
            own[:, channel, channel if size > 1 else 0] = columns[:, channel, k]
        whole.append(own.reshape(120, size))
    expected = np.split(nnls(np.concatenate(whole, axis=1), target.ravel())[0], np.cumsum(sizes)[:-1])
    gram, moment = np.einsum("nci,ncj->cij", columns, columns), np.einsum("nci,nc->ci", columns, target)
    found = _weights(gram[None], moment[None], sizes)[0]
    for k, numbers in enumerate(expected):
        np.testing.assert_allclose(found[:, k], np.broadcast_to(numbers, 4), atol=1e-7)
