"""Several modes: periods and exchanged axes against the models themselves, and optima that are as good as the best."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fitmat as fm
from fitmat.fitting import refining
from fitmat.fitting.concluding import conclude
from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.ends import AS_GOOD, Ends, behind, home
from fitmat.fitting.likelihood import Data
from fitmat.fitting.quantities import SEVERAL
from fitmat.fitting.result import Fit
from fitmat.fitting.symmetries import nearest
from fitmat.judgement.identifiability.verdicts import STATES, identify
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import entries, vector, with_vector

TURNED = ("ggx-aniso", "beckmann-aniso", "ward-aniso", "ashikhmin-shirley-aniso", "disney-2012", "disney-2015")

ROUNDING = 1e-9
"""Relative; a turn by 180° rounds."""


def measured(truth: AbstractBRDF, seed: int = 1) -> fm.Measurements:
    theta_i, theta_o = np.deg2rad([15.0, 45.0, 65.0]), np.deg2rad(np.arange(0.0, 81.0, 8.0))
    phi = np.deg2rad([0.0, 60.0, 120.0, 180.0])
    return fm.simulate(truth, theta_i, theta_o, phi=phi, relative_noise=0.02, absolute_noise=1e-3, seed=seed)


@pytest.fixture(scope="module")
def brushed() -> Fit:
    return fm.fit(measured(fm.model("ward-aniso", ks=0.3, alpha_x=0.1, alpha_y=0.3, rotation=88.0)), "ward-aniso")


@pytest.mark.parametrize("name", TURNED)
def test_a_period_is_that_of_the_model(name: str) -> None:
    """f is the same one period further, and not at half of one."""
    kind: dict[str, Any] = {"anisotropic": 0.7} if "disney" in name else {}
    model = fm.model(name, **kind)
    entry = next(e for e in entries(model) if e.name == "rotation")
    wi, wo = np.random.default_rng(1).normal(size=(2, 50, 3))
    wi[:, 2], wo[:, 2] = np.abs(wi[:, 2]), np.abs(wo[:, 2])
    wi, wo = (w / np.linalg.norm(w, axis=1, keepdims=True) for w in (wi, wo))

    def turned(angle: float) -> np.ndarray:
        return fm.evaluate(fm.model(name, rotation=angle, **kind), wi, wo)

    assert entry.param.period == 180.0
    np.testing.assert_allclose(turned(-130.0), turned(50.0), rtol=ROUNDING)
    assert np.abs(turned(-40.0) - turned(50.0)).max() > 0.01 * turned(50.0).max()


@given(st.floats(-180.0, 180.0), st.booleans())
def test_the_nearest_form_is_the_same_surface(angle: float, exchanged: bool) -> None:
    best = fm.model("ggx-aniso", alpha_x=0.1, alpha_y=0.3, rotation=10.0)
    slopes = (0.32, 0.11) if exchanged else (0.11, 0.32)
    other = fm.model("ggx-aniso", alpha_x=slopes[0], alpha_y=slopes[1], rotation=angle)
    found = nearest(best, np.asarray(vector(other))[None], coordinates(best))[0]
    wi, wo = np.array([[0.3, 0.1, 0.9]]), np.array([[-0.2, 0.3, 0.8]])
    wi, wo = wi / np.linalg.norm(wi), wo / np.linalg.norm(wo)
    np.testing.assert_allclose(fm.evaluate(with_vector(best, found), wi, wo), fm.evaluate(other, wi, wo), rtol=ROUNDING)
    assert abs(found[coordinates(best).names.index("rotation")] - 10.0) <= 90.0


def test_what_is_held_is_not_exchanged() -> None:
    best = fm.model("ggx-aniso", alpha_x=0.1, alpha_y=0.3, rotation=10.0)
    other = fm.model("ggx-aniso", alpha_x=0.1, alpha_y=0.05, rotation=100.0)
    moved = coordinates(best, {"alpha_x": 0.1})
    np.testing.assert_allclose(nearest(best, np.asarray(vector(other))[None], moved)[0], vector(other))


def test_a_rotation_comes_home_and_sits_on_no_bound(brushed: Fit) -> None:
    """Truth 88°, at which −92° and 88° are one surface: the interval crosses neither bound, and starts agree."""
    rotation = next(q for q in fm.laplace(brushed, seed=1).quantities() if q.name == "rotation")
    slopes = brushed.values[[e.place.start for e in brushed.entries if e.name.startswith("alpha")]]
    truth = 88.0 if slopes[0] < slopes[1] else -2.0
    assert abs((rotation.value[0] - truth + 90.0) % 180.0 - 90.0) < 4 * rotation.sd[0]
    assert abs(brushed.values[-1]) <= 90.0
    assert rotation.ci95[0, 0] < rotation.value[0] < rotation.ci95[0, 1]
    assert np.ptp(rotation.ci95[0]) < 10.0
    assert brushed.on_bound == {}
    assert not brushed.elsewhere
    draws = fm.laplace(brushed, seed=1).values[:, -1]
    assert np.abs(draws - brushed.values[-1]).max() <= 90.0


@pytest.mark.study
def test_a_rotation_with_a_prior_stays_where_the_prior_has_it(brushed: Fit) -> None:
    moved, values = brushed.coordinates, np.array(brushed.values)
    values[-1] = 170.0
    told = fm.fit(brushed.measurements, "ward-aniso", priors={"rotation": (170.0, 1.0)}).data
    assert home(brushed.data, moved, values)[-1] == pytest.approx(-10.0)
    assert home(told, moved, values)[-1] == pytest.approx(170.0)


def _with_rival(fit: Fit, alpha: float, worse: float) -> Fit:
    """The fit as it were had another start ended at another alpha, so many nats below."""
    other = np.array(fit.values)
    other[2] = alpha
    ends = Ends(
        np.stack([fit.values, other]),
        np.full(2, fit.discrepancy),
        fit.log_likelihood - np.array([0.0, worse]),
        np.ones(2, bool),
        np.ones(2, int),
    )
    return conclude(fit.measurements, fit.model, fit.held, (fit.noise, fit.data), ends)


@pytest.fixture(scope="module")
def plain() -> Fit:
    return fm.fit(measured(fm.model("lambert+ggx", kd=0.3, alpha=0.2, eta=1.5)), "lambert+ggx")


def test_an_end_as_good_elsewhere_vetoes_determined(plain: Fit) -> None:
    verdicts = identify(fm.laplace(plain, seed=1))
    assert verdicts.state("alpha") == STATES[0]
    twin = _with_rival(plain, 0.215, AS_GOOD / 2)
    assert twin.elsewhere == {"alpha": (0.215,)}
    posterior = fm.laplace(twin, seed=1)
    found = identify(posterior)
    assert found.state("alpha") == STATES[1]
    assert found.state("kd") == STATES[0]
    verdict = next(v for v in found.verdicts if v.name == "alpha")
    assert verdict.ci95[1] == pytest.approx(0.215)
    assert "Another optimum fits as well, with alpha = 0.215" in found.words
    shown = next(q for q in posterior.quantities() if q.name == "alpha")
    assert shown.remarks == (SEVERAL,)
    assert shown.ci95[0, 1] == pytest.approx(0.215)
    assert np.isnan(shown.sd[0])


def test_an_end_that_is_worse_vetoes_nothing(plain: Fit) -> None:
    assert _with_rival(plain, 0.9, 2 * AS_GOOD).elsewhere == {}
    assert _with_rival(plain, plain.values[2] * 1.001, AS_GOOD / 2).elsewhere == {}  # well within its interval


def test_the_ends_of_an_objective_are_compared_by_what_it_leaves_over(plain: Fit) -> None:
    """1 % of noise more is the same ratio of residuals whatever their unit."""
    data = fm.fit(plain.measurements, "lambert+ggx", loss="l2").data
    n = np.count_nonzero(data.weight)
    for unit in (1e-6, 1.0, 1e6):
        cost = np.array([0.5 * n, 0.5 * n + 1.0]) * unit
        one = Ends(np.zeros((2, 4)), np.zeros(2), -cost, np.ones(2, bool), np.ones(2, int))
        np.testing.assert_allclose(behind(one, data), [0.0, 1.0], rtol=1e-6)


@pytest.mark.study
def test_an_isotropic_surface_has_no_rotation() -> None:
    """Of a surface without axes no rotation is determined, in whatever direction the noise stretches the lobe."""
    held: dict[str, Any] = {"metallic": 0.0, "specular_tint": 0.0, "sheen_tint": 0.0, "sheen": 0.0, "clearcoat": 0.0,
        "clearcoat_gloss": 1.0, "subsurface": 0.0}  # fmt: skip
    truth = fm.model("disney-2012", base_color=0.4, roughness=0.4, **held)
    for seed in (1, 2):
        found = identify(fm.laplace(fm.fit(measured(truth, seed), "disney-2012", fixed=held), seed=1))
        assert found.state("rotation") == STATES[2]
        assert found.state("roughness") == STATES[0]
        rotation = next(v for v in found.verdicts if v.name == "rotation")
        assert rotation.ci95[1] - rotation.ci95[0] <= 180.0 + 1e-9


def test_a_start_alone_is_not_believed(monkeypatch: pytest.MonkeyPatch, plain: Fit) -> None:
    """Where no second start finds the best optimum more are tried; the grid of this model has enough of them."""

    def ranked(ends: Ends, data: Data) -> np.ndarray:
        return np.argsort(np.argsort(behind(ends, data), kind="stable"), kind="stable").astype(float)

    monkeypatch.setattr(refining, "behind", ranked)
    alone = fm.fit(plain.measurements, "lambert+ggx")
    assert alone.n_starts > plain.n_starts
    np.testing.assert_allclose(alone.values, plain.values, rtol=1e-4)
