"""Angles and directions: the conventions of `fitmat.maths.directions`, on cases that are known by hand."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fitmat.errors import FitmatError
from fitmat.maths.directions import (
    above,
    cos_difference,
    directions,
    from_angles,
    half_vector,
    mirror,
    relative_azimuth,
    signed_zenith,
    zenith,
)

ROUNDING = 1e-14
"""Absolute; a few roundings of numbers of order one."""

Pairs = dict[str, tuple[np.ndarray, np.ndarray]]


def _at(degrees_zenith: float, degrees_azimuth: float) -> np.ndarray:
    return from_angles(np.deg2rad([degrees_zenith]), np.deg2rad([degrees_azimuth]))


def test_angles_by_hand() -> None:
    np.testing.assert_allclose(_at(0, 77), [[0, 0, 1]], atol=ROUNDING)
    np.testing.assert_allclose(_at(90, 90), [[0, 1, 0]], atol=ROUNDING)
    np.testing.assert_allclose(_at(30, 180), [[-0.5, 0, np.sqrt(3) / 2]], atol=ROUNDING)


def test_directions_by_hand_in_either_unit() -> None:
    """One azimuth serves all zenith angles; below 0 is the other side."""
    sin = np.sqrt(3) / 2
    expected = [[0, 0, 1], [-0.5, 0, sin], [0.5, 0, sin]]
    np.testing.assert_allclose(directions([0, 30, -30], 180, degrees=True), expected, atol=ROUNDING)
    np.testing.assert_allclose(directions([0, np.pi / 6, -np.pi / 6], np.pi), expected, atol=ROUNDING)
    np.testing.assert_allclose(directions(0.0), [[0, 0, 1]], atol=ROUNDING)


@pytest.mark.parametrize(
    ("theta", "phi", "degrees", "message"),
    [
        (30, 0, False, r"theta = 30: expected −π/2 to π/2 radians\. Are the angles in degrees"),
        (95, 0, True, r"theta is 95\.0, expected numbers from -90 to 90 degrees"),
        ([0.1, 0.2], [1.0, 2.0, 3.0], False, r"shapes \(2,\) and \(3,\), expected \(n,\) or one number each"),
    ],
)
def test_directions_refuse(theta: Any, phi: Any, degrees: bool, message: str) -> None:
    with pytest.raises(FitmatError, match=message):
        directions(theta, phi, degrees=degrees)


@given(st.floats(1e-12, np.pi / 2), st.floats(-3.14, 3.14))
def test_zenith_inverts_from_angles(theta: float, phi: float) -> None:
    """Relative error, also close to the normal, where the inverse cosine would lose half the digits."""
    assert zenith(from_angles(np.array([theta]), np.array([phi])))[0] == pytest.approx(theta, rel=ROUNDING)


@pytest.mark.parametrize(
    ("phi_i", "phi_o", "expected"),
    [(0, 180, 180), (0, 0, 0), (170, -170, 20), (-90, 90, 180), (30, 75, 45), (75, 30, 45)],
)
def test_relative_azimuth_is_folded(phi_i: float, phi_o: float, expected: float) -> None:
    found = relative_azimuth(_at(40, phi_i), _at(50, phi_o))
    np.testing.assert_allclose(np.rad2deg(found), expected, atol=1e-12)


def test_forward_is_positive() -> None:
    """The mirror side (φ = π) has positive signed zenith, the light's own side negative."""
    np.testing.assert_allclose(np.rad2deg(signed_zenith(_at(20, 0), _at(50, 180))), [50])
    np.testing.assert_allclose(np.rad2deg(signed_zenith(_at(20, 0), _at(50, 0))), [-50])


def test_mirror_by_hand() -> None:
    np.testing.assert_allclose(mirror(jnp.array(_at(35, 20)[0])), _at(35, 200)[0], atol=ROUNDING)


def test_half_vector_by_hand() -> None:
    """Light at 60°, sensor at 0°, same plane: h at 30°, difference angle 30°."""
    wi, wo = jnp.array(_at(60, 0)[0]), jnp.array(_at(0, 0)[0])
    np.testing.assert_allclose(half_vector(wi, wo), _at(30, 0)[0], atol=ROUNDING)
    np.testing.assert_allclose(cos_difference(wi, wo), np.cos(np.pi / 6), atol=ROUNDING)


def test_half_vector_bisects(hemisphere) -> None:
    """|h| = 1 and ω_i·h = ω_o·h = cos_difference."""
    wi, wo = jnp.array(hemisphere(500, 5)), jnp.array(hemisphere(500, 6))
    h = jax.vmap(half_vector)(wi, wo)
    expected = jax.vmap(cos_difference)(wi, wo)
    np.testing.assert_allclose(jnp.linalg.norm(h, axis=1), 1, atol=ROUNDING)
    for w in (wi, wo):
        np.testing.assert_allclose(jnp.sum(w * h, axis=1), expected, atol=10 * ROUNDING)


def test_opposite_directions_have_the_normal_as_half_vector(singular: Pairs) -> None:
    wi, wo = singular["wi = -wo at the horizon"]
    np.testing.assert_array_equal(half_vector(jnp.array(wi), jnp.array(wo)), [0, 0, 1])


def test_above_needs_both_directions() -> None:
    up, flat, down = jnp.array([0.0, 0.0, 1.0]), jnp.array([1.0, 0.0, 0.0]), jnp.array([0.0, 0.0, -1.0])
    assert above(up, up)
    assert not any(above(*pair) for pair in [(up, flat), (flat, up), (up, down), (down, up), (down, down)])


def test_gradients_are_finite_where_roots_vanish(singular: Pairs) -> None:
    for where, (wi, wo) in singular.items():
        for function in (half_vector, cos_difference):
            slopes = jax.jacrev(function, argnums=(0, 1))(jnp.array(wi), jnp.array(wo))
            assert all(np.isfinite(slope).all() for slope in slopes), (where, function.__name__)
