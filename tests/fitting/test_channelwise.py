"""Channels: which parameters count in one only, and that fits of many channels end where the plain way ends."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from selection import always

import fitmat as fm
from fitmat.fitting import channelwise, linear, refining, settling, starts
from fitmat.fitting.channelwise import Part, apart, divides, layout
from fitmat.fitting.coordinates import coordinates
from fitmat.fitting.result import Fit
from fitmat.models.base import AbstractBRDF
from fitmat.models.parameters import param, vector

SAME = 1e-8
"""Relative; both ways end where a step is below 1e-8 of a parameter's own scale."""

APART = (
    "lambert+ggx",
    "oren-nayar+ggx-conductor",
    "plastic",
    "varnish-over-lambert+ggx-f82",
    "tilt-over-lambert+phong",
)


@pytest.mark.parametrize("name", always(APART[:3], APART))
def test_channels_of_most_models_are_apart(name: str) -> None:
    assert apart(fm.model(name, channels=3))


@pytest.mark.parametrize("name", ["disney-2012", "disney-2015"])
def test_a_luminance_joins_channels(name: str) -> None:
    model = fm.model(name, channels=3)
    assert not apart(model)
    assert layout(model, coordinates(model), 3) is None


class Leaking(AbstractBRDF):
    """A diffuse surface that shows a little of its second channel in the first, or of its first in the others."""

    kd: Any = param(0.0, 1.0, symbol="k_d", doc="albedo", per_channel=True)
    back: bool = eqx.field(static=True, default=False)

    @property
    def name(self) -> str:
        return "leaking"

    def __call__(self, wi: Any, wo: Any) -> Any:
        first, second = (1e-9 * jnp.eye(3)[k] for k in (0, 1))
        return (self.kd + (first * self.kd[1] if self.back else second * self.kd[0])) * wo[2]

    def width(self) -> Any:
        return jnp.array(1.0)

    @property
    def isotropic(self) -> bool:
        return True


@pytest.mark.parametrize("back", [True, False])
def test_a_trace_of_another_channel_is_seen(back: bool) -> None:
    assert not apart(Leaking(np.ones(3), back))


def test_kinds_of_a_model() -> None:
    """Kd of three channels, ks of three, then alpha and eta of all; one of them held."""
    model = fm.model("lambert+ggx", channels=3)
    every, held = coordinates(model), coordinates(model, {"alpha": None})
    assert layout(model, every, 3) == channelwise.Layout((6, 7), ((0, 1, 2), (3, 4, 5)))
    assert layout(model, held, 3) == channelwise.Layout((6,), ((0, 1, 2), (3, 4, 5)))
    assert layout(model, coordinates(model, {"kd": None, "ks": None}), 3) is None
    assert layout(fm.model("lambert+ggx", channels=1), coordinates(fm.model("lambert+ggx")), 1) is None


def measured(truth: AbstractBRDF, channels: int, seed: int = 1) -> fm.Measurements:
    theta_i, theta_o = np.deg2rad([15.0, 40.0, 65.0]), np.deg2rad(np.arange(-76.0, 77.0, 8.0))
    m = fm.simulate(truth, theta_i, theta_o, relative_noise=0.02, absolute_noise=1e-3, seed=seed)
    names = [f"{nm:g}" for nm in np.linspace(420.0, 680.0, channels)]
    return fm.from_arrays(m.theta_i, m.theta_o, m.value, phi=m.phi, sigma=m.sigma, channels=names)


def spectrum(channels: int, low: float, high: float) -> np.ndarray:
    """A band of light that rises in the middle."""
    nm = np.linspace(420.0, 680.0, channels)
    return low + (high - low) * np.exp(-(((nm - 560.0) / 50.0) ** 2))


def plastic(channels: int) -> fm.Measurements:
    return measured(fm.model("lambert+ggx", channels=channels, kd=spectrum(channels, 0.1, 0.6), alpha=0.2), channels)


def close(one: Fit, other: Fit) -> None:
    sd = np.sqrt(np.diagonal(one.likelihood_covariance))
    np.testing.assert_allclose(one.values, other.values, rtol=SAME, atol=1e-6 * np.nanmax(sd))
    np.testing.assert_allclose(
        one.likelihood_covariance, other.likelihood_covariance, rtol=1e-5, atol=1e-5 * np.nanmax(sd) ** 2
    )
    assert one.discrepancy == pytest.approx(other.discrepancy, rel=1e-5, abs=1e-12)
    assert (one.result, one.n_starts) == (other.result, other.n_starts)


ASKED: dict[str, tuple[str, dict[str, Any]]] = {
    "as it is": ("lambert+ggx", {}),
    "one lobe": ("lambert", {}),
    "noise inferred": ("lambert+ggx", {"loss": "gaussian-inferred"}),
    "some held": ("lambert+ggx", {"loss": "mixture", "fixed": {"kd": [0.1, 0.5, 0.3]}}),
    "known": ("lambert+ggx-schlick", {"fixed": {"ks": 1.0}, "priors": {"f0": (0.04, 0.01), "alpha": (0.2, 0.1)}}),
}


@pytest.mark.parametrize("asked", always({"as it is"}, ASKED))
def test_fits_end_where_one_slope_for_each_parameter_leads(asked: str, monkeypatch: pytest.MonkeyPatch) -> None:
    m, (to, told) = plastic(3), ASKED[asked]
    by_kind = fm.fit(m, to, **told)
    together = by_kind.linear
    for room in (refining, settling, linear):
        monkeypatch.setattr(room, "layout", lambda *_: None)
    close(by_kind, alone := fm.fit(m, to, **told))
    assert together is not None
    assert alone.linear is not None
    largest = np.abs(alone.linear.slopes).max()
    np.testing.assert_allclose(together.slopes, alone.linear.slopes, atol=1e-6 * largest)  # of finite differences


@pytest.mark.study
def test_a_fit_that_begins_with_some_channels_ends_where_one_of_all_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    m = plastic(8)
    told: dict[str, Any] = {"priors": {"kd": (spectrum(8, 0.1, 0.6), 0.05)}}
    assert divides(fm.model("lambert+ggx", channels=8), 8)
    some = fm.fit(m, "lambert+ggx", **told)
    for room in (refining, starts):
        monkeypatch.setattr(room, "divides", lambda *_: False)
    close(some, fm.fit(m, "lambert+ggx", **told))


def test_what_is_held_stays_in_every_channel() -> None:
    kd = spectrum(8, 0.1, 0.6)
    found = fm.fit(plastic(8), "lambert+ggx", fixed={"kd": kd})
    np.testing.assert_array_equal(found.values[:8], kd)
    assert found.result == "converged"


def test_between_the_channels_of_a_part_a_line_is_drawn() -> None:
    model = fm.model("lambert+ggx", channels=9)
    part = Part(model, 9)
    assert part.which.tolist() == [1, 4, 7]
    assert part.places.tolist() == [1, 4, 7, 10, 13, 16, 18, 19]
    base, few = np.asarray(vector(model))[None], np.array([[0.1, 0.4, 0.1, 2.0, 2.0, 5.0, 0.3, 1.6]])
    found = part.spread(base, few, [0, 18])
    np.testing.assert_allclose(found[0, :9], [0.1, 0.1, 0.2, 0.3, 0.4, 0.3, 0.2, 0.1, 0.1])
    np.testing.assert_array_equal(found[0, 9:18], base[0, 9:18])
    assert (found[0, 18], found[0, 19]) == (0.3, base[0, 19])


def test_a_model_of_as_many_channels_as_it_is_written_for_is_not_divided() -> None:
    class Lit(Leaking):
        def __call__(self, wi: Any, wo: Any) -> Any:
            return self.kd * jnp.linspace(0.5, 1.0, 8) * wo[2]

    model = Lit(np.full(8, 0.4))
    assert apart(model)
    assert not divides(model, 8)
    assert not divides(fm.model("lambert", channels=4), 4)
    assert not divides(fm.model("disney-2012", channels=8), 8)


def test_of_many_channels_fewer_rows_stand_for_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """The slopes that are held stay within their limit; what they count for is what was fitted."""
    found = fm.fit(plastic(8), "lambert+ggx")
    monkeypatch.setattr(linear, "MOST", 8 * 18 * 16)
    few = found.linear
    assert few is not None
    assert few.slopes.shape == (16, 8, 18)
    assert few.more == pytest.approx(found.n_values / np.count_nonzero(few.used))


def test_negative_values_of_some_bands_are_noise() -> None:
    """As a dark band of a noisy instrument has them: nothing is left out, and the band's kd comes near 0."""
    m = plastic(8)
    value = np.array(m.value)
    value[:, 0] = 1e-3 * np.random.default_rng(1).standard_normal(len(value))
    sigma = np.full_like(value, 1e-3)
    told: dict[str, Any] = {"phi": m.phi, "sigma": sigma, "channels": m.channels}
    found = fm.fit(fm.from_arrays(m.theta_i, m.theta_o, value, **told), "lambert+ggx")
    assert found.n_values == m.value.size
    assert found["kd"].value[0] < 2e-3
    assert found["ks"].value[0] < 2e-3
