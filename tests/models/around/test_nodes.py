"""Curves between the cosines at which a coat's light is known."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from fitmat.models.around.nodes import FINE, ROOTS, curve

EXACT = 1e-12

WITHIN = np.linspace(ROOTS[0], ROOTS[-1], 997)

STEPS = {
    "a cliff": np.tanh(40.0 * (ROOTS - 0.2)),
    "a pole": -1.0 / (ROOTS + 1e-3),
    "a peak": np.exp(-200.0 * (ROOTS - 0.5) ** 2),
}


@pytest.mark.parametrize("roots", [ROOTS, FINE])
def test_curves_are_hermites_cubics(roots: np.ndarray) -> None:
    """Scipy's with the same slopes; a parabola that rises everywhere is met exactly within the outermost intervals."""
    ours = curve(roots, jnp.asarray((roots + 0.3) ** 2)[:, None])
    theirs = CubicHermiteSpline(roots, np.asarray(ours.values), np.asarray(ours.slopes))
    np.testing.assert_allclose(ours(jnp.asarray(WITHIN**2)), theirs(WITHIN), rtol=EXACT)
    inner = np.linspace(roots[1], roots[-2], 501)
    np.testing.assert_allclose(ours(jnp.asarray(inner**2))[:, 0], (inner + 0.3) ** 2, rtol=EXACT)


@pytest.mark.parametrize("name", STEPS)
def test_curves_never_leave_the_values_to_both_sides(name: str) -> None:
    """Where the polynomial through the same values swings by more than a tenth of their range."""
    values = STEPS[name]
    found = np.asarray(curve(ROOTS, jnp.asarray(values)[:, None])(jnp.asarray(WITHIN**2)))[:, 0]
    k = np.clip(np.searchsorted(ROOTS, WITHIN) - 1, 0, len(ROOTS) - 2)
    low, high = np.minimum(values[k], values[k + 1]), np.maximum(values[k], values[k + 1])
    assert (found >= low - EXACT).all()
    assert (found <= high + EXACT).all()


def test_curves_go_on_straight_beyond_the_last_values() -> None:
    """At normal incidence and at the horizon."""
    found = curve(ROOTS, jnp.asarray(2.0 * ROOTS - 1.0)[:, None])(jnp.array([1.0, 1e-6]))[:, 0]
    np.testing.assert_allclose(found, [1.0, 2e-3 - 1.0], rtol=EXACT)
