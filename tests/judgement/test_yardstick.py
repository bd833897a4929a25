"""The yardstick: against a Gaussian process solved with all pairs, and against truths that are known."""

from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.fitting.process import Sizes
from fitmat.judgement import yardstick as room
from fitmat.judgement.yardstick import LENGTHS, WIDTHS, explained, yardstick

LIGHT, SENSOR = np.deg2rad([15.0, 40.0, 65.0]), np.deg2rad(np.arange(-75.0, 76.0, 5.0))


def scan(name: str = "lambert+ggx", noise: float = 0.03, seed: int = 0, **told: Any) -> fm.Measurements:
    told = told or {"kd": 0.2, "alpha": 0.25}
    return fm.simulate(
        fm.model(name, **told), LIGHT, SENSOR, relative_noise=noise, absolute_noise=0.03 * noise, seed=seed
    )


def every_pair(m: fm.Measurements, width: float, white: float, process: float) -> tuple[np.ndarray, np.ndarray]:
    """k (K + σ²)⁻¹ (t − t̄), and k(x, x) less what is known (Rasmussen & Williams 2006, eqs. 2.25, 2.26)."""
    h = m.wi + m.wo
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    far, side = np.arcsinh(np.arccos(np.minimum(h[:, 2], 1.0)) / width), np.sign(h[:, 0] * m.wi[:, 0])
    d = np.arccos(np.clip(np.sum(m.wi * h, axis=1), -1, 1))
    places = np.stack([far * side / LENGTHS[0], d / LENGTHS[2]], axis=1)
    apart = np.sqrt(3.0) * np.linalg.norm(places[:, None] - places, axis=2)
    k = process * (1 + apart) * np.exp(-apart)
    t = np.cbrt(m.value[:, 0] * m.wi[:, 2])
    inverse = np.linalg.inv(k + white * np.eye(len(t)))
    return t.mean() + k @ inverse @ (t - t.mean()), np.diagonal(k - k @ inverse @ k)


def test_it_is_the_posterior_of_a_gaussian_process(monkeypatch: pytest.MonkeyPatch) -> None:
    m = scan()
    kept: dict[int, Sizes] = {}

    def sized(*given: Any) -> Sizes:
        kept[len(kept)] = found = genuine(*given)
        return found

    genuine = room.sizes
    monkeypatch.setattr(room, "sizes", sized)
    found = yardstick(m)
    best = max(range(len(WIDTHS)), key=lambda j: kept[j].gain)
    last = kept[len(WIDTHS)]
    mean, variance = every_pair(m, WIDTHS[best], last.white, float(last.process[0]))
    np.testing.assert_allclose(found.mean[:, 0], mean, rtol=1e-6)
    np.testing.assert_allclose(found.variance[:, 0], variance, rtol=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_the_truth_explains_all_and_a_constant_nothing(seed: int) -> None:
    m = scan(seed=seed)
    found = yardstick(m)
    right, wrong, constant = (explained(found, fm.fit(m, name)) for name in ("lambert+ggx", "lambert+phong", "lambert"))
    assert right is not None
    assert wrong is not None
    assert right > 0.97
    assert 0.2 < wrong < right - 0.02
    assert constant == pytest.approx(0.0, abs=0.05)


def test_a_share_is_that_of_the_known_truth() -> None:
    """Without noise g is the truth, and the share that of a wrong model is 1 − Σ(g − t)²/Σ(g − ḡ)² by hand."""
    m = scan(noise=1e-4)
    fit = fm.fit(m, "lambert+phong")
    kappa = m.wi[:, 2]
    g = np.cbrt(fm.evaluate(fm.model("lambert+ggx", kd=0.2, alpha=0.25), m.wi, m.wo)[:, 0] * kappa)
    t = np.cbrt(fm.evaluate(fit.model, m.wi, m.wo)[:, 0] * kappa)
    share = 1 - np.sum((g - t) ** 2) / np.sum((g - g.mean()) ** 2)
    assert explained(yardstick(m), fit) == pytest.approx(
        share, abs=0.03
    )  # what turns between readings 5° apart is lost


def test_nothing_is_said_of_noise_alone_or_of_few() -> None:
    m = scan(seed=1)
    rng = np.random.default_rng(0)
    flat = fm.from_arrays(m.theta_i, m.theta_o, rng.normal(0.1, 0.01, size=len(m.wi)) / m.wi[:, 2], phi=m.phi)
    fit = fm.fit(m, "lambert+ggx")
    assert np.isnan(yardstick(flat).mean).all()
    assert explained(yardstick(flat), fit) is None
    assert np.isnan(yardstick(m.rows(np.arange(12))).mean).all()
