"""Pooling: surfaces of one kind, simulated, fitted and pooled, are known better, and their intervals hold the truth."""

from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.fitting.many.fits import Fits
from fitmat.fitting.pooling import pooled
from fitmat.models.parameters import entries

BATCHES, MEMBERS, SPREAD = 30, 12, 0.04
"""Coated panels: their lacquers' ln η differ by the spread, roughness and base colour by much more."""

WI = fm.directions([20.0] * 15 + [60.0] * 15, degrees=True)
WO = fm.directions(np.tile(np.linspace(5.0, 75.0, 15), 2), 180.0, degrees=True)


@pytest.fixture(scope="module")
def panels() -> tuple[np.ndarray, Fits]:
    """True η of the panels of every batch, (batches, members), and the fits of all, each as if it stood alone."""
    rng = np.random.default_rng(11)
    eta = 1.5 * np.exp(SPREAD * rng.normal(size=(BATCHES, MEMBERS)))
    value = np.stack([[_panel(one, rng) for one in batch] for batch in eta])
    sigma = 0.05 * value + 1e-3
    noisy = value + sigma * rng.normal(size=value.shape)
    return eta, fm.fit_many(WI, WO, noisy, "lambert+ggx", sigma=sigma, fixed={"ks": 1.0}, loss="gaussian")


def _panel(eta: float, rng: np.random.Generator) -> np.ndarray:
    model = fm.model("lambert+ggx", kd=rng.uniform(0.1, 0.7), ks=1.0, alpha=rng.uniform(0.15, 0.5), eta=eta)
    return fm.evaluate(model, WI, WO)


def test_intervals_hold_the_truth_and_errors_shrink(panels: tuple[np.ndarray, Fits]) -> None:
    """Within four binomial errors of 95 %, and 1 % for the normal that stands for each likelihood."""
    eta, fits = panels
    param = next(e.param for e in entries(fits.template) if e.name == "eta")
    reach = np.exp(1.959964 * fits.sd_of("eta") / fits["eta"])
    each = [pooled("eta", param, *(fits["eta"][k] * reach[k] ** side for side in (-1, 1))) for k in range(BATCHES)]
    inside = [(one.ci95[:, 0] < true) & (true < one.ci95[:, 1]) for one, true in zip(each, eta, strict=True)]
    assert np.mean(inside) > 0.95 - 4.0 * np.sqrt(0.95 * 0.05 / eta.size) - 0.01
    assert np.mean([one.centre[0] < 1.5 < one.centre[2] for one in each]) > 0.8
    assert np.mean([one.spread[0] < np.exp(SPREAD) < one.spread[2] for one in each]) > 0.8
    alone = np.sqrt(np.mean(np.log(fits["eta"] / eta) ** 2))
    together = np.sqrt(np.mean([np.log(one.value / true) ** 2 for one, true in zip(each, eta, strict=True)]))
    assert together < 0.85 * alone


def test_fit_many_pools_what_it_is_asked_to() -> None:
    rng = np.random.default_rng(2)
    value = np.stack([_panel(eta, rng) for eta in (1.45, 1.5, 1.55, 1.5)]).reshape(2, 2, 30, 1)
    told: dict[str, Any] = {"sigma": 0.02 * value, "loss": "gaussian"}
    fits = fm.fit_many(WI, WO, value, fixed={"ks": 1.0}, pool="eta,kd", **told)
    assert list(fits.pooled) == ["kd", "eta"]
    eta = fits.pooled["eta"]
    assert eta.value.shape == (2, 2)
    assert eta.ci95.shape == (2, 2, 2)
    assert eta.sd.max() < fits.sd_of("eta").max()
    assert str(fits).split("\n")[1].startswith("kd, pooled over 4: ")
    wrongs: list[tuple[dict[str, Any], str]] = [
        ({"pool": "ks", "fixed": {"ks": 1.0}}, r"pool ks \(--pool\): it is held"),
        (
            {"pool": "etta"},
            r"pool etta \(--pool\): no model of lambert\+ggx has it, expected one of kd, ks, alpha, eta",
        ),
        ({"pool": "eta", "loss": "log10"}, r"pool eta \(--pool\): the loss log10 is no likelihood"),
    ]
    for wrong, message in wrongs:
        with pytest.raises(FitmatError, match=message):
            fm.fit_many(WI, WO, value, **(told | wrong))
    with pytest.raises(
        FitmatError, match=r"pool eta \(--pool\): 2 surfaces, expected at least 3, of which some can differ"
    ):
        fm.fit_many(WI, WO, value[0], pool="eta", loss="gaussian", sigma=0.01)
