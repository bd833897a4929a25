"""Laws in fits: what was planted is found as often as the intervals promise, and what has no law is refused."""

from typing import Any

import numpy as np
import pytest
from selection import always

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.fitting.dispersed import carrying, dispersed, law_of
from fitmat.maths.normal import Z95
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import entries, with_vector
from fitmat.models.terms.dispersive import LAWS

NM = np.linspace(400.0, 700.0, 31)
NAMES = tuple(f"{nm:g}" for nm in NM)
KD = 0.15 + 0.35 * np.exp(-(((NM - 600.0) / 60.0) ** 2))
SEEDS = 40

OF_KD, OF_INDEX = (0.93, 0.97), (0.85, 1.0)
"""Shares of intervals that hold the truth: 95 % ± 3 standard errors of 40 fits of 31 bands, or of 40 fits, since the
law's few numbers move η and κ of all wavelengths together."""


def plastic() -> tuple[AbstractBRDF, np.ndarray, np.ndarray]:
    """Lambert and GGX with the η of Cauchy's law, computed here: the model, η and κ."""
    eta = 1.48 + 0.0045 / (1e-3 * NM) ** 2
    return told(dispersed(fm.model("lambert+ggx", channels=31), "cauchy", NAMES), KD, (1.48, 0.0045)), eta, 0.0 * eta


def metal() -> tuple[AbstractBRDF, np.ndarray, np.ndarray]:
    """GGX with η + iκ = √(4 − 81/(E² + 0.3 i E)), E in eV, as numbers of each channel."""
    energy = 1239.8419843320026 / NM
    index: Any = np.sqrt(4.0 - 81.0 / (energy * (energy + 0.3j)))
    numbers = {"kd": 0.1 * KD, "ks": 1.0, "alpha": 0.15, "eta": index.real, "kappa": index.imag}
    return fm.model("lambert+ggx-conductor", channels=31, **numbers), index.real, index.imag


def told(model: AbstractBRDF, kd: np.ndarray, law: tuple[float, ...]) -> AbstractBRDF:
    return with_vector(model, np.concatenate([kd, [1.0, 0.15], law]))


def measured(truth: AbstractBRDF, seed: int, names: tuple[str, ...] = NAMES) -> fm.Measurements:
    theta_i, theta_o = np.deg2rad([10.0, 30.0, 45.0, 60.0, 75.0]), np.deg2rad(np.arange(-78.0, 79.0, 4.0))
    m = fm.simulate(truth, theta_i, theta_o, relative_noise=0.02, absolute_noise=1e-3, seed=seed)
    return fm.from_arrays(m.theta_i, m.theta_o, m.value, phi=m.phi, sigma=m.sigma, channels=names)


CASES = {
    "cauchy": ("lambert+ggx", plastic),
    "smooth": ("lambert+ggx", plastic),
    "drude": ("lambert+ggx-conductor", metal),
    "smooth-metal": ("lambert+ggx-conductor", metal),
}


def found(law: str, seed: int) -> dict[str, np.ndarray]:
    """(estimate − truth)/sd of kd, η and κ of every channel."""
    to, made = CASES[law]
    truth, eta, kappa = made()
    fit = fm.fit(measured(truth, seed), to, dispersion=law, fixed={"ks": 1.0})
    index, kd = fm.indices(fit), fit["kd"]
    scores = {
        "kd": (kd.value - KD * (1.0 if made is plastic else 0.1)) / kd.sd,
        "eta": (index.eta - eta) / index.eta_sd,
    }
    if made is metal:
        scores["kappa"] = (index.kappa - kappa) / index.kappa_sd
    else:
        assert not index.kappa.any()
    return scores


@pytest.mark.parametrize("law", always({"cauchy"}, CASES))
def test_what_was_planted_is_found(law: str) -> None:
    """Three seeds: nothing further than 4.5 standard deviations, 1 in 150,000 for each number."""
    for seed in range(3):
        assert max(np.abs(z).max() for z in found(law, seed).values()) < 4.5


@pytest.mark.study
@pytest.mark.parametrize("law", CASES)
def test_intervals_hold_the_truth_as_often_as_they_promise(law: str) -> None:
    every = [found(law, seed) for seed in range(SEEDS)]
    shares = {name: float(np.mean([np.abs(z[name]) < Z95 for z in every])) for name in every[0]}
    print("\n", law, {name: f"{100 * share:.1f} %" for name, share in shares.items()})
    for name, share in shares.items():
        low, high = OF_KD if name == "kd" else OF_INDEX
        assert low <= share <= high, name


def test_a_law_takes_the_place_of_the_index_and_of_every_ks_but_one() -> None:
    glass = dispersed(fm.model("lambert+ggx", channels=31), "cauchy", NAMES)
    assert {e.name: e.size for e in entries(glass)} == {"kd": 31, "ks": 1, "alpha": 1, "cauchy_a": 1, "cauchy_b": 1}
    coated = dispersed(fm.model("tilt-over-lambert+beckmann", channels=31), "drude", NAMES)
    assert (coated.name, law_of(coated)) == ("tilt-over-lambert+beckmann-conductor", "drude")
    assert law_of(fm.model("lambert+ggx")) is None


def test_names_of_models_with_a_law() -> None:
    assert carrying("lambert+ggx", "sellmeier") == "lambert+ggx"
    assert carrying("tilt-over-lambert+ggx", "drude-lorentz") == "tilt-over-lambert+ggx-conductor"
    assert carrying("lambert+ggx-conductor", "cauchy") is None
    assert carrying("lambert+phong", "drude") is None


@pytest.fixture(scope="module")
def spectrum() -> fm.Measurements:
    return measured(plastic()[0], 1)


@pytest.mark.parametrize(
    ("names", "to", "law", "words"),
    [
        (NAMES, "lambert+ggx", "snell", r"dispersion.*cauchy"),
        (("r", "g", "b"), "lambert+ggx", "cauchy", r"channel 'r', expected two channels or more that are wavelengths"),
        (("value",), "lambert+ggx", "cauchy", r"channel 'value'"),
        (("550",), "lambert+ggx", "cauchy", r"the one channel '550', expected two"),
        (("0.45", "0.55"), "lambert+ggx", "cauchy", r"channel '0.45', expected .* from 250 to 20000 nm"),
        (NAMES, "lambert+blinn-phong", "cauchy", r"no lobe has the exact dielectric term"),
        (NAMES, "lambert+ggx-schlick", "drude", r"no lobe has the exact dielectric or conductor term.*ggx-conductor"),
    ],
)
def test_what_has_no_law_is_refused(
    names: tuple[str, ...], to: str, law: str, words: str, spectrum: fm.Measurements
) -> None:
    m = fm.from_arrays(
        spectrum.theta_i, spectrum.theta_o, spectrum.value[:, : len(names)], phi=spectrum.phi, channels=names
    )
    with pytest.raises(FitmatError, match=words):
        fm.fit(m, to, dispersion=law)


def test_indices_need_a_law(spectrum: fm.Measurements) -> None:
    with pytest.raises(FitmatError, match=r"lambert has no law .* dispersion='cauchy'"):
        fm.indices(fm.fit(spectrum, "lambert"))


@pytest.mark.study
def test_an_interval_of_an_index_is_that_of_its_parameters(spectrum: fm.Measurements) -> None:
    """Of Cauchy's law by hand: Var η = Var A + 2 Cov(A, B)/λ² + Var B/λ⁴."""
    fit = fm.fit(spectrum, "lambert+ggx", dispersion="cauchy")
    cov, um = fit.covariance[-2:, -2:], 1e-3 * NM
    expected = np.sqrt(cov[0, 0] + 2.0 * cov[0, 1] / um**2 + cov[1, 1] / um**4)
    np.testing.assert_allclose(fm.indices(fit).eta_sd, expected, rtol=1e-6)
    np.testing.assert_allclose(fm.indices(fit).nm, NM, rtol=1e-12)


@pytest.mark.study
def test_a_law_is_kept_with_a_run(spectrum: fm.Measurements, tmp_path: Any) -> None:
    """The record tells it, and what is read back reflects as what was fitted."""
    study = fm.study(spectrum, "lambert+ggx", dispersion="cauchy", fixed={"ks": 1.0}, sampling=False, short=True)
    fm.report(study, tmp_path / "run")
    fit, back = study.posteriors[0].fit, fm.load(tmp_path / "run").fitted("lambert+ggx")
    np.testing.assert_allclose(
        fm.evaluate(back.model, spectrum.wi, spectrum.wo), fm.evaluate(fit.model, spectrum.wi, spectrum.wo), rtol=1e-9
    )
    with pytest.raises(FitmatError, match=r"--dispersion cauchy beside --ior Au"):
        fm.study(spectrum, "lambert+ggx", dispersion="cauchy", ior="Au")
    with pytest.raises(FitmatError, match=r"none of lambert\+phong has an index"):
        fm.study(spectrum, "lambert+phong", dispersion="cauchy")


def test_every_law_says_its_parameters() -> None:
    for law in LAWS.values():
        assert "Priors" in (law.__doc__ or "")
