"""Quantities for people: intervals on their natural scale, what follows from what, and why a number is missing."""

import dataclasses
from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import ModelError
from fitmat.fitting.quantities import Quantity
from fitmat.fitting.result import Fit
from fitmat.uncertainty.derived import derived
from fitmat.uncertainty.posterior import Posterior

INTERPOLATION = 1e-3
"""Relative; a quantile between two draws of 2000, taken before or after a smooth change of variable."""

ROUNDING = 1e-6
"""Relative; 1.959964 has seven digits."""


@pytest.fixture(scope="module")
def fit() -> Fit:
    truth, theta_o = fm.model("lambert+ggx", kd=0.3, alpha=0.3, eta=1.5), np.deg2rad(np.arange(-80, 81, 10))
    m = fm.simulate(truth, np.deg2rad([20, 45, 70]), theta_o, relative_noise=0.02, absolute_noise=1e-3, seed=1)
    return fm.fit(m, "lambert+ggx")


def draws(fit: Fit, name: str, values: dict[str, Any]) -> Posterior:
    """2000 log-normal draws, 10 % wide, of a model with these values, given in the order of its vector."""
    centre = np.array(list(values.values()))
    spread = np.exp(0.1 * np.random.default_rng(1).normal(size=(2000, len(centre))))
    covariance = np.diag((0.1 * centre) ** 2)
    other = dataclasses.replace(fit, name=name, model=fm.model(name, **values), likelihood_covariance=covariance)
    return Posterior(other, "laplace", centre * spread, np.full(2000, 0.01))


def named(quantities: list[Quantity]) -> dict[str, Quantity]:
    return {q.name: q for q in quantities}


def test_a_parameter_is_asked_for_by_its_name(fit: Fit) -> None:
    """Of the fit by its curvature, of a posterior by its draws; as a table with one row each."""
    posterior = fm.laplace(fit, seed=1)
    alpha, drawn = fit["alpha"], posterior["alpha"]
    assert alpha.value == fit.values[2]
    assert alpha.sd == pytest.approx(np.sqrt(fit.covariance[2, 2]))
    np.testing.assert_array_equal(drawn.ci95[0], posterior.interval()[2])
    low, high = alpha.ci95[0]
    assert str(alpha).startswith("alpha (α) = 0.")
    assert str(alpha).endswith(f"(95 % {low:.4g} – {high:.4g})")
    table = posterior.to_dataframe()
    assert table["parameter"].to_list() == ["kd", "ks", "alpha", "eta", "discrepancy"]
    assert table.row(2, named=True)["sd"] == float(drawn.sd[0])
    with pytest.raises(ModelError, match=r"lambert\+ggx has no parameter 'alfa', expected one of kd, ks, alpha, eta\."):
        fit["alfa"]
    assert "alpha" in fit
    assert "alfa" not in fit
    assert list(fit) == [q.name for q in fit.parameters]
    assert list(posterior) == ["kd", "ks", "alpha", "eta", "discrepancy"]


def test_parameters_are_listed_with_their_discrepancy(fit: Fit) -> None:
    found = fm.laplace(fit, seed=1).quantities()
    assert [(q.name, q.symbol, q.unit) for q in found] == [
        ("kd", "k_d", "1"),
        ("ks", "k_s", "1"),
        ("alpha", "α", "1"),
        ("eta", "η", "1"),
        ("discrepancy", "s", "sr^(-1/3)"),
    ]
    assert np.concatenate([q.value for q in found[:4]]).tolist() == fit.values.tolist()
    assert [q.remarks for q in found] == [("",)] * 5
    assert [q.per_channel for q in found] == [True, True, False, False, False]


def test_laplace_intervals_are_taken_where_the_parameter_lives(fit: Fit) -> None:
    """Linear for kd and ks; value·exp(± 1.96 sd/value) for alpha and eta, whose scale is logarithmic."""
    found, sd = named(fm.laplace(fit, seed=1, corrected=False).quantities()), np.sqrt(np.diagonal(fit.covariance))
    for k, name in enumerate(("kd", "ks")):
        np.testing.assert_allclose(
            found[name].ci95[0], fit.values[k] + 1.959964 * sd[k] * np.array([-1, 1]), rtol=ROUNDING
        )
    for k, name in enumerate(("alpha", "eta"), start=2):
        factor = np.exp(1.959964 * sd[k] / fit.values[k])
        np.testing.assert_allclose(found[name].ci95[0], fit.values[k] * np.array([1 / factor, factor]), rtol=ROUNDING)
        np.testing.assert_allclose(found[name].sd, sd[k])


def test_laplace_intervals_end_at_the_bounds(fit: Fit) -> None:
    wide = dataclasses.replace(fit, likelihood_covariance=np.diag([1.0, 100.0, 0.5, 1e4]))
    found = named(Posterior(wide, "laplace", fit.values[None], np.zeros(1)).quantities())
    assert found["kd"].ci95.tolist() == [[0.0, 1.0]]
    assert found["ks"].ci95.tolist() == [[0.0, 10.0]]
    assert found["alpha"].ci95[0, 1] == 1.0
    assert found["eta"].ci95.tolist() == [[1.0, 50.0]]


def test_sampled_intervals_are_quantiles(fit: Fit) -> None:
    posterior = fm.sample(fit, seed=1, max_steps=300)
    assert posterior.usable
    found = posterior.quantities()
    for k, quantity in enumerate(found[:4]):
        expected = np.quantile(posterior.values[:, k], [0.025, 0.975])
        np.testing.assert_allclose(quantity.ci95[0], expected, rtol=1e-14)  # NumPy rounds rows and columns differently
        np.testing.assert_allclose(quantity.sd, [posterior.values[:, k].std()])


def test_unusable_chains_fall_back_on_laplace(fit: Fit) -> None:
    short, gauss = fm.sample(fit, seed=1, max_steps=8), fm.laplace(fit, seed=1, corrected=False)
    assert not short.usable
    for one, other in zip(short.quantities()[:4], gauss.quantities()[:4], strict=True):
        np.testing.assert_array_equal(one.ci95, other.ci95)
        np.testing.assert_array_equal(one.sd, other.sd)


def test_a_discrepancy_of_zero_has_a_one_sided_interval(fit: Fit) -> None:
    s = np.abs(np.random.default_rng(1).normal(size=1000))
    none = Posterior(dataclasses.replace(fit, discrepancy=0.0), "laplace", np.tile(fit.values, (1000, 1)), s)
    some = Posterior(dataclasses.replace(fit, discrepancy=0.5), "laplace", np.tile(fit.values, (1000, 1)), s)
    assert none.quantities()[-1].ci95[0] == pytest.approx([0.0, np.quantile(s, 0.95)])
    assert some.quantities()[-1].ci95[0] == pytest.approx(np.quantile(s, [0.025, 0.975]))


def test_remarks_say_why_a_number_is_missing(fit: Fit) -> None:
    model = fm.model("lambert+ggx", channels=1, kd=1.0, ks=0.0, alpha=0.3, eta=1.5)
    other = dataclasses.replace(fit, model=model, held={"eta": np.array([1.5])}, undetermined=("alpha",))
    found = named(fm.laplace(other, seed=1).quantities())
    assert found["kd"].remarks == ("at its upper bound",)
    assert found["ks"].remarks == ("at its lower bound",)
    assert found["eta"].remarks == ("fixed",)
    assert found["alpha"].remarks == ("not determined",)
    assert np.isnan([found[name].sd for name in ("kd", "ks", "eta")]).all()


def following(posterior: Posterior) -> list[Quantity]:
    """What follows from a posterior's parameters."""
    return derived(posterior, posterior.quantities())


def test_f0_follows_from_eta(fit: Fit) -> None:
    """((η−1)/(η+1))² rises with η, so that its quantiles are those of η."""
    posterior = draws(fit, "ggx", {"ks": 1.0, "alpha": 0.1, "eta": 3.0})
    f0, eta = named(following(posterior))["f0"], posterior.values[:, 2]
    assert f0.value == pytest.approx([0.25])
    low, high = np.quantile(eta, [0.025, 0.975])
    np.testing.assert_allclose(f0.ci95[0], [((n - 1) / (n + 1)) ** 2 for n in (low, high)], rtol=INTERPOLATION)
    assert f0.sd == pytest.approx([(((eta - 1) / (eta + 1)) ** 2).std()])


def test_eta_follows_from_f0(fit: Fit) -> None:
    posterior = draws(fit, "ggx-schlick", {"ks": 1.0, "alpha": 0.1, "f0": 0.25})
    found = named(following(posterior))
    assert found["eta"].value == pytest.approx([3.0])
    low, high = (np.sqrt(f) for f in np.quantile(posterior.values[:, 2], [0.025, 0.975]))
    expected = [(1 + low) / (1 - low), (1 + high) / (1 - high)]
    np.testing.assert_allclose(found["eta"].ci95[0], expected, rtol=INTERPOLATION)
    assert "f0" not in found


def test_f0_of_a_metal_follows_from_both_parts_of_its_index(fit: Fit) -> None:
    """((η−1)² + κ²)/((η+1)² + κ²), Born & Wolf sec. 14.2."""
    posterior = draws(fit, "ggx-conductor", {"ks": 1.0, "alpha": 0.1, "eta": 0.5, "kappa": 2.5})
    f0, (eta, kappa) = named(following(posterior))["f0"], posterior.values[:, 2:].T
    assert f0.value == pytest.approx([6.5 / 8.5])
    expected = np.abs((eta + 1j * kappa - 1) / (eta + 1j * kappa + 1)) ** 2
    np.testing.assert_allclose(f0.ci95[0], np.quantile(expected, [0.025, 0.975]))


def test_widths_and_exponents_imply_each_other(fit: Fit) -> None:
    """α² = 2/(n+2): a Blinn lobe of n = 198 is as wide as a microfacet lobe of α = 0.1; the roughness is √α."""
    facets = named(following(draws(fit, "ggx", {"ks": 1.0, "alpha": 0.1, "eta": 3.0})))
    assert facets["exponent"].value == pytest.approx([198.0])
    assert facets["roughness"].value == pytest.approx([np.sqrt(0.1)])
    assert facets["exponent"].ci95[0, 0] < 198 < facets["exponent"].ci95[0, 1]
    blinn = named(following(draws(fit, "blinn-phong", {"ks": 1.0, "exponent": 198.0})))
    assert set(blinn) == {"alpha"}
    assert blinn["alpha"].value == pytest.approx([0.1])


def test_what_follows_from_an_unknown_is_unknown(fit: Fit) -> None:
    posterior = draws(fit, "ggx", {"ks": 1.0, "alpha": 0.1, "eta": 3.0})
    unknown = dataclasses.replace(posterior, fit=dataclasses.replace(posterior.fit, held={"eta": np.array([3.0])}))
    f0 = named(following(unknown))["f0"]
    assert f0.remarks == ("fixed",)
    assert np.isnan(f0.sd).all()
    assert following(draws(fit, "lambert", {"kd": 0.3})) == []
