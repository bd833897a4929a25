"""Arrows against the matrices that they stand for, and slopes by kind against one slope for each parameter."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fitmat.maths.grams import Arrow, Layout, Normal, Whole, joined
from fitmat.maths.least_squares import Residuals, least_squares, normal_equations

SAME = 1e-12
"""Relative to the largest number; sums of some tens of products in another order."""

SOLVED = 1e-9
"""Relative; systems whose condition is far below 1e6."""

FULL = Layout((2, 6, 7), ((0, 1, 8), (3, 4, 5)))
"""Three shared parameters, and two kinds of three columns, in an order of their own."""


@pytest.fixture
def arrow() -> Arrow:
    rng = np.random.default_rng(1)
    root = rng.normal(size=(3, 12, 5))
    table = jnp.asarray(np.einsum("cmq,cmt->cqt", root, root))
    return Arrow(jnp.sum(table[:, :3, :3], axis=0), table[:, 3:, :3], table[:, 3:, 3:], FULL)


def test_the_matrix_holds_every_number_in_its_place(arrow: Arrow) -> None:
    whole = np.asarray(arrow.dense())
    np.testing.assert_array_equal(whole, whole.T)
    np.testing.assert_array_equal(whole[np.ix_([2, 6, 7], [2, 6, 7])], arrow.core)
    for c, own in enumerate(np.array(FULL.own).T):
        np.testing.assert_array_equal(whole[np.ix_(own, own)], arrow.blocks[c])
        np.testing.assert_array_equal(whole[np.ix_(own, [2, 6, 7])], arrow.edges[c])
        others = np.setdiff1d(np.arange(9), [2, 6, 7, *own])
        assert not whole[np.ix_(own, others)].any()


@pytest.mark.parametrize(
    "of",
    [
        lambda a, x: a.diagonal(),
        lambda a, x: a.times(x),
        lambda a, x: a.scaled(x).dense(),
        lambda a, x: a.plus(x).dense(),
    ],
)
def test_arrows_do_what_their_matrix_does(of: Callable, arrow: Arrow) -> None:
    x = jnp.asarray(np.random.default_rng(2).uniform(0.5, 2.0, 9))
    expected = np.asarray(of(Whole(arrow.dense()), x))
    np.testing.assert_allclose(of(arrow, x), expected, atol=SAME * np.abs(expected).max())


def test_arrows_are_solved_as_numpy_does(arrow: Arrow) -> None:
    right = np.random.default_rng(3).normal(size=9)
    np.testing.assert_allclose(
        arrow.solve(jnp.asarray(right)), np.linalg.solve(np.asarray(arrow.dense()), right), rtol=SOLVED
    )


@pytest.mark.parametrize("less", [[0.0, 0.0, 1e3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0] * 8 + [1e3]])
def test_an_arrow_that_is_not_positive_definite_has_no_solution(less: list[float], arrow: Arrow) -> None:
    """Neither where the core is not, nor where one block is not."""
    broken = arrow.plus(-jnp.array(less))
    assert np.linalg.eigvalsh(np.asarray(broken.dense())).min() < 0
    assert np.isnan(broken.solve(jnp.ones(9))).any()


def test_what_is_joined_stands_where_the_layout_says() -> None:
    found = joined(FULL, jnp.array([1.0, 2.0, 3.0]), jnp.array([[10.0, 11.0], [20.0, 21.0], [30.0, 31.0]]))
    assert found.tolist() == [10.0, 20.0, 1.0, 11.0, 21.0, 31.0, 2.0, 3.0, 30.0]


TIMES = jnp.linspace(0.1, 2.0, 20)


def decays(x: jax.Array) -> Residuals:
    """Three exponentials with one offset and one power: own amplitude and rate; a prior of each."""
    amplitude, rate = x[np.array(FULL.own[0])], x[np.array(FULL.own[1])]
    value = amplitude * jnp.exp(-rate * TIMES[:, None] ** x[2]) + x[6] * TIMES[:, None] + x[7]
    target = jnp.array([1.0, 2.0, 3.0]) * jnp.exp(-jnp.array([0.5, 1.0, 1.5]) * TIMES[:, None])
    return Residuals(value - target, 0.1 * (x - 1.0))


def test_slopes_by_kind_are_those_of_every_parameter() -> None:
    x = jnp.asarray(np.random.default_rng(4).uniform(0.5, 1.5, 9))
    jac = jax.jacfwd(lambda x: jnp.concatenate([part.ravel() for part in decays(x)]))(x)
    r = jnp.concatenate([part.ravel() for part in decays(x)])

    def close(found: Normal) -> None:
        np.testing.assert_allclose(found.square, r @ r, rtol=SAME)
        np.testing.assert_allclose(found.slope, r @ jac, atol=SAME * np.abs(jac).max() * 60)
        np.testing.assert_allclose(found.gram.dense(), jac.T @ jac, atol=SAME * np.abs(jac).max() ** 2 * 60)

    close(normal_equations(decays, x, FULL))
    close(normal_equations(decays, x))
    assert FULL.kinds.shape == (5, 9)


def test_both_ways_end_at_the_same_minimum() -> None:
    x0 = jnp.ones(9)
    ends = [least_squares(lambda x, _: (decays(x), None), x0, tolerance=1e-12, layout=way) for way in (FULL, None)]
    assert all(end.solved for end in ends)
    np.testing.assert_allclose(ends[0].x, ends[1].x, rtol=SOLVED)
    np.testing.assert_allclose(ends[0].offset, ends[1].offset, atol=SOLVED)


def test_columns_may_share_nothing() -> None:
    layout = Layout((), ((0, 2), (1, 3)))
    blocks = jnp.array([[[2.0, 1.0], [1.0, 3.0]], [[4.0, 1.0], [1.0, 5.0]]])
    arrow = Arrow(jnp.zeros((0, 0)), jnp.zeros((2, 2, 0)), blocks, layout)
    assert arrow.dense().tolist() == [[2.0, 1.0, 0.0, 0.0], [1.0, 3.0, 0, 0], [0, 0, 4.0, 1.0], [0, 0, 1.0, 5.0]]
    right = np.array([1.0, 2.0, 3.0, 4.0])
    np.testing.assert_allclose(arrow.solve(jnp.asarray(right)), np.linalg.solve(arrow.dense(), right), rtol=SOLVED)
