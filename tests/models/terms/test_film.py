"""A thin film against matrices of the textbook, against its limits, and in models and fits."""

from typing import Any

import jax
import numpy as np
import pytest
from oracles.thin_films import reflectance

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.fitting.dispersed import located
from fitmat.fitting.known import of_material
from fitmat.models.parameters import entries, of_channels, vector, with_vector
from fitmat.models.refractive_index import index
from fitmat.models.terms.film import Film, film
from fitmat.models.terms.fresnel import conductor, dielectric

MATRICES = 1e-10
"""Absolute; the matrices of a thick absorbing film hold numbers of e^160, whose differences lose some digits."""

ROUNDING = 1e-12
"""Relative; the same reflectance by another order of steps."""

NM = np.linspace(400.0, 700.0, 31)
NAMES = tuple(f"{nm:g}" for nm in NM)
TITANIUM = index("Ti", NM)
OXIDE = {"film_eta": 2.3, "film_b": 0.06, "film_kappa": 0.0}
HELD: dict[str, Any] = {"ks": 1.0, "substrate_eta": np.real(TITANIUM), "substrate_kappa": np.imag(TITANIUM), **OXIDE}


def measured(
    thickness: float,
    names: tuple[str, ...],
    nm: np.ndarray,
    degrees: tuple[float, ...] = (10.0, 30.0, 45.0, 60.0, 75.0),
) -> fm.Measurements:
    """Titanium under its oxide, 2 % noise."""
    ti = index("Ti", nm)
    known: dict[str, Any] = HELD | {"substrate_eta": np.real(ti), "substrate_kappa": np.imag(ti)}
    truth = fm.model("ggx-film", channels=len(nm), wavelengths=nm, thickness=thickness, alpha=0.15, **known)
    theta_i, theta_o = np.deg2rad(degrees), np.deg2rad(np.arange(-76.0, 77.0, 8.0))
    return fm.simulate(truth, theta_i, theta_o, relative_noise=0.02, absolute_noise=1e-3, seed=0, channels=names)


def drawn(number: int) -> list[tuple[Any, ...]]:
    """Angle, wavelength, thickness, index of film and of substrate: glass-like and absorbing, any of each."""
    rng = np.random.default_rng(0)
    theta, nm = np.arccos(1.0 - rng.uniform(size=number)), rng.uniform(250.0, 2000.0, number)
    absorbs = rng.integers(0, 2, (2, number))
    inner = rng.uniform(1.0, 5.0, number) + 1j * absorbs[0] * rng.uniform(0.0, 10.0, number)
    base = np.exp(rng.uniform(np.log(0.05), np.log(6.0), number)) + 1j * absorbs[1] * rng.uniform(0.01, 8.0, number)
    return list(zip(theta, nm, rng.uniform(0.0, 1000.0, number), inner, base, strict=True))


def test_a_film_is_that_of_the_matrices() -> None:
    for theta, nm, thickness, inner, base in drawn(2000):
        expected = np.mean(reflectance(float(theta), float(nm), [(inner, thickness)], base))
        found = film(np.cos(theta), 1e-3 * nm, thickness, inner, base)
        assert found == pytest.approx(expected, abs=MATRICES), (theta, nm, thickness, inner, base)
        assert 0.0 <= found <= 1.0 + ROUNDING


def test_limits_of_a_film() -> None:
    """No thickness, or the substrate's index: the substrate; thick and absorbing: the film; half a wave: nothing."""
    cos, um = np.linspace(0.05, 1.0, 20), 0.55
    oxide, metal, bulk = 2.4 + 0.0j, np.array([1.9, 2.6]), np.array([0.5, 4.0])
    under = complex(*metal)
    np.testing.assert_allclose(film(cos, um, 0.0, oxide, under), conductor(cos, *metal), rtol=ROUNDING)
    np.testing.assert_allclose(film(cos, um, 137.0, under, under), conductor(cos, *metal), rtol=ROUNDING)
    np.testing.assert_allclose(film(cos, um, 1000.0, complex(*bulk), oxide), conductor(cos, *bulk), rtol=ROUNDING)
    glass = dielectric(np.ones(1), np.array(1.5))
    np.testing.assert_allclose(film(np.ones(1), um, 275.0 / 2.4, oxide, 1.5 + 0j), glass, rtol=ROUNDING)
    quarter = film(1.0, um, 137.5 / np.sqrt(1.5), np.sqrt(1.5) + 0j, 1.5 + 0j)
    assert quarter == pytest.approx(0.0, abs=1e-30)  # √n of the glass, a quarter wave: no reflection
    assert film(0.0, um, 100.0, 1.0 + 0j, under) == pytest.approx(1.0, rel=ROUNDING)


def made(*numbers: Any, **given: Any) -> Any:
    """A term of these parameters in their order."""
    return Film(*numbers, **given)


COSINES = np.array([0.01, 0.4, 1.0])


def test_slopes_are_those_of_differences() -> None:
    """Every parameter of the term, near grazing, at normal incidence and between; finite where an index is 1."""
    term = made(120.0, 2.3, 0.06, 0.02, np.array([1.7, 1.9]), np.array([2.4, 2.6]), um=(0.45, 0.55))
    values = vector(term)
    exact = jax.jacfwd(lambda v: jax.vmap(with_vector(term, v))(COSINES))(values)
    for k, h in enumerate(1e-5 * values):
        ends = [with_vector(term, values + sign * h * np.eye(len(values))[k]) for sign in (1.0, -1.0)]
        above, below = (np.stack([end(cos) for cos in COSINES]) for end in ends)
        np.testing.assert_allclose(exact[..., k], (above - below) / (2.0 * h), rtol=1e-6, atol=1e-9)
    bare = made(0.0, 1.0, 0.0, 0.0, 1.0, 1e-4)
    grazing = np.array([0.0, 1e-9, 1.0])
    assert np.isfinite(jax.jacfwd(lambda v: jax.vmap(with_vector(bare, v))(grazing))(vector(bare))).all()


def test_wavelengths_are_the_channels() -> None:
    """As numbers of a model, as names of a measurement, and as some of them."""
    model = fm.model("lambert+ggx-film", channels=31, wavelengths=NM, thickness=80.0, **HELD)
    assert {e.name: e.size for e in entries(model)} == {
        **{"kd": 31, "ks": 1, "alpha": 1, "thickness": 1, "film_eta": 1, "film_b": 1, "film_kappa": 1},
        **{"substrate_eta": 31, "substrate_kappa": 31},
    }
    up = fm.directions(0.0)
    one = located(fm.model("lambert+ggx-film", channels=31, thickness=80.0, **HELD), NAMES)
    np.testing.assert_array_equal(fm.evaluate(one, up, up), fm.evaluate(model, up, up))
    few = of_channels(model, np.array([20, 3]), 31)
    np.testing.assert_allclose(fm.evaluate(few, up, up)[0], fm.evaluate(model, up, up)[0, [20, 3]], rtol=ROUNDING)
    assert fm.evaluate(model, up, up).std() > 0.01


@pytest.mark.parametrize(
    ("name", "given", "words"),
    [
        ("ggx", {"wavelengths": [550.0]}, r"wavelengths beside ggx, expected a model with a film, as ggx-film"),
        ("ggx-film", {"wavelengths": [0.55]}, r"expected a list of numbers from 250 to 20000, nm"),
        ("ggx-film", {"wavelengths": [450.0, 550.0], "channels": 3}, r"2 wavelengths and channels = 3"),
        ("ggx-film", {"thickness": -1.0}, r"thickness = -1: expected a value from 0 to 1000"),
    ],
)
def test_wrong_films_are_refused(name: str, given: dict[str, Any], words: str) -> None:
    with pytest.raises(FitmatError, match=words):
        fm.model(name, **given)


def test_channels_without_wavelengths_are_refused() -> None:
    m = measured(80.0, ("r", "g", "b"), NM[[5, 15, 25]])
    for wrong in (lambda: fm.fit(m, "ggx-film"), lambda: fm.study(m, "ggx-film")):
        with pytest.raises(
            FitmatError, match=r"ggx-film: channel 'r', expected channels that are wavelengths .* brdf_450"
        ):
            wrong()
    with pytest.raises(FitmatError, match=r"a film at 1 wavelength in a model of 3 channels, expected .* wavelengths="):
        fm.evaluate(fm.model("ggx-film", channels=3), m.wi, m.wo)


FEW = NM[::7]


@pytest.mark.study
def test_thickness_is_found() -> None:
    """Of five bands, over titanium from the literature."""
    ti = index("Ti", FEW)
    m = measured(80.0, tuple(f"{nm:g}" for nm in FEW), FEW)
    found = fm.fit(m, "ggx-film", fixed=HELD | {"substrate_eta": np.real(ti), "substrate_kappa": np.imag(ti)})[
        "thickness"
    ]
    assert abs(found.value[0] - 80.0) < 4.5 * found.sd[0] < 1.0


@pytest.mark.study
def test_a_film_is_kept_with_a_run(tmp_path: Any) -> None:
    """Its index fitted as well; what is read back reflects as what was fitted, at the same wavelengths."""
    m = measured(80.0, tuple(f"{nm:g}" for nm in FEW), FEW)
    known: dict[str, Any] = {"ior": "Ti", "fixed": {"ks": 1.0, "film_kappa": 0.0}}
    study = fm.study(m, "ggx-film", **known, sampling=False, short=True)
    fm.report(study, tmp_path / "run")
    fit, back = study.posteriors[0].fit, fm.load(tmp_path / "run").fitted("ggx-film").model
    np.testing.assert_allclose(fm.evaluate(back, m.wi, m.wo), fm.evaluate(fit.model, m.wi, m.wo), rtol=1e-9)
    for name, truth in {"thickness": 80.0, "film_eta": 2.3, "film_b": 0.06}.items():
        assert abs(fit[name].value[0] - truth) < 4.5 * fit[name].sd[0]


@pytest.mark.study
def test_orders_of_one_wavelength_are_said_to_fit_as_well() -> None:
    """Near normal incidence half a wave more of film, 119 nm, changes little: no standard deviation is told."""
    m = measured(200.0, ("550",), np.array([550.0]), (10.0, 20.0))
    ti = index("Ti", 550.0)
    found = fm.fit(m, "ggx-film", fixed=HELD | {"substrate_eta": np.real(ti), "substrate_kappa": np.imag(ti)})[
        "thickness"
    ]
    assert found.remarks == ("another optimum fits as well",)
    assert np.isnan(found.sd).all()


def test_glass_carries_a_film() -> None:
    """What does not absorb is held at the least κ, where its reflectance is that of κ = 0 to 1e-8."""
    known = of_material("ggx-film", "N-BK7", ("450", "550"))["ggx-film"]
    np.testing.assert_array_equal(known["substrate_kappa"], [1e-4, 1e-4])
    bare = film(1.0, 0.55, 0.0, 1.4 + 0j, known["substrate_eta"][1] + 1e-4j)
    assert bare == pytest.approx(dielectric(np.ones(1), known["substrate_eta"][1:])[0], abs=1e-8)
