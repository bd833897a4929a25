"""Smoothing: points of a texture are fitted and smoothed, and known better; what cannot be smoothed is a sentence."""

from typing import Any

import numpy as np
import pytest
from scipy.fft import idctn

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.fitting.smoothing import smoothed
from fitmat.models.parameters import entries

WI = fm.directions([20.0] * 12 + [60.0] * 12, degrees=True)
WO = fm.directions(np.tile(np.linspace(5.0, 75.0, 12), 2), 180.0, degrees=True)

TOLD: dict[str, Any] = {"fixed": {"ks": 1.0, "eta": 1.5}, "loss": "gaussian"}

SHAPE = 24, 20


STEPS = {"kd": 0.01, "alpha": 0.025}
"""Deviations of neighbours' differences of the true kd and ln α."""


@pytest.fixture(scope="module")
def texture() -> tuple[dict[str, np.ndarray], fm.Fits]:
    """True α and kd, α by 60 % another in the right half; and the fits, of which six points have no values."""
    rng = np.random.default_rng(1)
    true = {"kd": 0.4 + drawn(STEPS["kd"], rng), "alpha": 0.25 * np.exp(drawn(STEPS["alpha"], rng))}
    true["alpha"][:, SHAPE[1] // 2 :] *= 1.6
    value = np.empty((*SHAPE, len(WI), 1))
    for at in np.ndindex(*SHAPE):
        made: dict[str, Any] = {name: part[at] for name, part in true.items()}
        value[at] = fm.evaluate(fm.model("lambert+ggx", ks=1.0, eta=1.5, **made), WI, WO)
    sigma = 0.1 * value + 0.01
    value += sigma * rng.normal(size=value.shape)
    value[5:8, 3:5] = np.nan
    return true, fm.fit_many(WI, WO, value, sigma=sigma, smooth=("kd", "alpha"), **TOLD)


def drawn(step: float, rng: np.random.Generator) -> np.ndarray:
    """An intrinsic field of first order by its cosines; neighbours of a wide one differ by τ/√2."""
    squares = [2.0 - 2.0 * np.cos(np.pi * np.arange(n) / n) for n in SHAPE]
    values = squares[0][:, None] + squares[1]
    values[0, 0] = np.inf
    return np.asarray(idctn(np.sqrt(2.0 / values) * step * rng.normal(size=SHAPE), norm="ortho"))


def test_points_are_known_better_and_their_intervals_hold(texture: tuple[dict[str, np.ndarray], fm.Fits]) -> None:
    """Relative errors fall, and are as said, or less: the edge in α makes its differences seem larger elsewhere."""
    true, fits = texture
    assert list(fits.smoothed) == ["kd", "alpha"]
    ended = fits.result != "too_few"
    for name, those in {"alpha": true["alpha"], "kd": true["kd"][..., None]}.items():
        found = fits.smoothed[name]
        assert found.value.shape == found.sd.shape == found.inferred.shape == those.shape
        np.testing.assert_array_equal(found.inferred.reshape(SHAPE), ~ended)
        inside = (found.ci95[..., 0] < those) & (those < found.ci95[..., 1])
        assert np.mean(inside) == pytest.approx(0.95, abs=4.0 * np.sqrt(0.95 * 0.05 / inside.size))
        off, before = (np.sqrt(np.mean((part / those - 1.0)[ended] ** 2)) for part in (found.value, fits[name]))
        assert off < 0.85 * before
        assert 0.7 < off / np.sqrt(np.mean((found.sd / those)[ended] ** 2)) < 1.1


def test_sentences_say_how_far_neighbours_differ(texture: tuple[dict[str, np.ndarray], fm.Fits]) -> None:
    """In ln α, where equal ratios matter, as per cent; and the deviations of points before and after."""
    fits = texture[1]
    kd, alpha = (fits.smoothed[name] for name in ("kd", "alpha"))
    assert str(fits).split("\n")[1:] == [str(kd), str(alpha)]
    assert kd.step[0] == pytest.approx(STEPS["kd"], rel=0.3)
    used = ~alpha.inferred
    before, after = (np.median(part[used]) for part in (fits.sd_of("alpha") / fits["alpha"], alpha.sd / alpha.value))
    assert str(alpha) == (
        f"alpha, smoothed: neighbours are taken to differ by {100 * alpha.step[0]:.2g} % (sd; more where materials "
        f"meet), and the median sd of a point falls from {100 * before:.2g} % to {100 * after:.2g} %; "
        f"inferred at 6 of 480 points."
    )
    assert str(kd).startswith(f"kd, smoothed: neighbours are taken to differ by {kd.step[0]:.2g} (sd; more")
    assert "Smoothed: alpha, smoothed" in repr(alpha)


def test_nothing_else_changes(texture: tuple[dict[str, np.ndarray], fm.Fits]) -> None:
    fits = texture[1]
    value = np.stack([fm.evaluate(fits.model(0, k), WI, WO) for k in range(6)]).reshape(2, 3, -1, 1)
    plain, smooth = (fm.fit_many(WI, WO, value, sigma=0.01, smooth=how, **TOLD) for how in (None, "alpha"))
    np.testing.assert_array_equal(plain.values, smooth.values)
    np.testing.assert_array_equal(plain.sd, smooth.sd)
    assert not plain.smoothed
    assert smooth.smoothed["alpha"].value.shape == (2, 3)


def test_each_channel_is_smoothed_by_itself_within_the_bounds() -> None:
    """Of one no point has an interval: it is not smoothed, and the sentence says so."""
    rng = np.random.default_rng(3)
    entry = next(e for e in entries(fm.model("lambert+ggx", channels=2)) if e.name == "kd")
    value = np.stack([0.01 + 0.02 * rng.normal(size=(9, 9)), np.full((9, 9), 0.5)], axis=-1)
    sd = np.stack([np.full((9, 9), 0.02), np.full((9, 9), np.nan)], axis=-1)
    found = smoothed(("kd r", "kd g"), entry, value, sd)
    assert (found.value[..., 0] >= 0.0).all()
    assert found.ci95.min() == 0.0 or np.isnan(found.ci95).any()
    assert np.isnan(found.value[..., 1]).all()
    assert found.inferred[..., 1].all()
    assert str(found).split("\n")[1] == "kd g not smoothed: 0 have an interval of it, expected at least 3."


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"smooth": "ks"}, r"smooth ks \(--smooth\): it is held, expected a parameter that is fitted"),
        ({"smooth": "etta"}, r"smooth etta \(--smooth\): no model of lambert\+ggx has it, expected one of kd, ks"),
        ({"loss": "log10"}, r"smooth alpha \(--smooth\): the loss log10 is no likelihood, expected one that gives"),
        ({"value": np.ones((1, 2, 24, 1))}, r"smooth alpha \(--smooth\): 2 surfaces, expected at least 3"),
        (
            {"value": np.ones((6, 24, 1))},
            r"smooth alpha \(--smooth\): the values of 6 surfaces have no rows and columns, expected the shape \(rows",
        ),
        ({"smooth": ""}, "smooth is the text '', expected the name of a parameter"),
    ],
)
def test_what_cannot_be_smoothed_is_said(told: dict[str, Any], message: str) -> None:
    asked = {"value": np.ones((2, 3, 24, 1)), "smooth": "alpha", "sigma": 0.1} | TOLD | told
    with pytest.raises(FitmatError, match=message):
        fm.fit_many(WI, WO, **asked)
