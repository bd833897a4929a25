"""Quantities: what a number in a file means, against hand-made numbers and the law of error propagation."""

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import ReadError

ANGLES = {"theta_i": [60.0, 60.0, 60.0], "theta_o": [0.0, 30.0, 60.0]}
EXACT = 1e-12


def test_readings_beside_a_white_panel() -> None:
    """f = R/π · signal/reference: 0.98/π · 0.5, 0.25, 2."""
    m = fm.read({**ANGLES, "signal": [10.0, 5.0, 40.0], "reference": [20.0, 20.0, 20.0]}, panel=0.98)
    np.testing.assert_allclose(m.value[:, 0], 0.98 / np.pi * np.array([0.5, 0.25, 2.0]), rtol=EXACT)
    assert m.sigma is None
    assert m.notes[0] == (
        "ratio to a white panel in the same geometry multiplied by R/π, R = 0.98 the panel's reflectance factor."
    )


def test_the_noise_of_both_readings_counts() -> None:
    """First-order propagation against the spread of 200,000 simulated ratios."""
    rng, (y, r, sigma_y, sigma_r) = np.random.default_rng(0), (10.0, 20.0, 0.2, 0.3)
    simulated = (y + sigma_y * rng.normal(size=200_000)) / (r + sigma_r * rng.normal(size=200_000))
    table = {
        **ANGLES,
        "signal": [y] * 3,
        "reference": [r] * 3,
        "sigma": [sigma_y] * 3,
        "sigma_reference": [sigma_r] * 3,
    }
    m = fm.read(table, panel=1.0)
    assert m.sigma is not None
    np.testing.assert_allclose(m.sigma * np.pi, simulated.std(), rtol=0.01)


def test_a_dark_panel_is_masked() -> None:
    m = fm.read({**ANGLES, "signal": [10.0, 5.0, 40.0], "reference": [20.0, 0.0, -1.0]}, panel=1.0)
    assert m.valid[:, 0].tolist() == [True, False, False]
    assert m.masked == {"reference reading not positive": 2}


def test_channels_have_their_own_panels() -> None:
    table = {**ANGLES, "signal_r": [1.0] * 3, "signal_g": [1.0] * 3, "reference_r": [2.0] * 3, "reference_g": [4.0] * 3}
    np.testing.assert_allclose(fm.read(table, panel=1.0).value[0], np.array([0.5, 0.25]) / np.pi, rtol=EXACT)


@pytest.mark.parametrize("factor", [1e-9, 1.0, 3e6])
def test_a_common_factor_does_not_matter_where_the_scale_is_unknown(factor: float) -> None:
    """With one weight known the others are as if the values were in sr⁻¹: a bare surface gives the scale."""
    truth = fm.model("lambert+ggx", kd=0.3, ks=0.5, alpha=0.2, eta=1.5)
    theta_i, theta_o = np.deg2rad([10, 40, 65]), np.deg2rad(np.arange(-80, 81, 4))
    m = fm.simulate(truth, theta_i, theta_o, relative_noise=0.01, absolute_noise=1e-4, seed=0)
    assert m.sigma is not None
    table = {
        "theta_i": np.rad2deg(m.theta_i), "theta_o": np.rad2deg(m.signed_theta_o),
        "radiance": factor * m.value[:, 0] * m.wi[:, 2], "sigma": factor * m.sigma[:, 0] * m.wi[:, 2],
    }  # fmt: skip
    fit = fm.fit(fm.read(table, unknown_scale=True), "lambert+ggx", fixed={"ks": 0.5})
    sd, place = np.sqrt(np.diagonal(fit.covariance)), {e.name: e.place.start for e in fit.entries}
    assert fit.result == "converged"
    for name, true in {"kd": 0.3, "alpha": 0.2, "eta": 1.5}.items():
        assert abs(fit.values[place[name]] - true) <= 3 * sd[place[name]]


def test_a_free_scale_leaves_the_weights_to_a_factor_of_e() -> None:
    truth = fm.model("lambert+ggx", kd=0.3, ks=0.5, alpha=0.2, eta=1.5)
    theta_i, theta_o = np.deg2rad([10, 40, 65]), np.deg2rad(np.arange(-80, 81, 4))
    m = fm.simulate(truth, theta_i, theta_o, relative_noise=0.01, absolute_noise=1e-4, seed=0)
    table = {"theta_i": np.rad2deg(m.theta_i), "theta_o": np.rad2deg(m.signed_theta_o), "brdf": 1e5 * m.value[:, 0]}
    fit = fm.fit(fm.read(table, unknown_scale=True), "lambert+ggx")
    place = {e.name: e.place.start for e in fit.entries}
    kd, sd = fit.values[place["kd"]], np.sqrt(fit.covariance[place["kd"], place["kd"]])
    assert fit.result == "converged"
    assert 0.9 < sd / kd < 1.1
    assert fit.values[place["alpha"]] == pytest.approx(0.2, abs=0.01)


def test_a_panel_of_unknown_reflectance_leaves_ratios() -> None:
    """Ratios of 1, 2 and 4 stay in proportion, whatever the panel reflects."""
    m = fm.read({**ANGLES, "panel_ratio": [1.0, 2.0, 4.0]}, unknown_scale=True)
    np.testing.assert_allclose(m.value[:, 0] / m.value[0, 0], [1.0, 2.0, 4.0], rtol=EXACT)
    assert m.notes[0] == "ratio to a white panel in the same geometry, to which the BRDF is proportional."


def test_rows_can_be_chosen() -> None:
    table = {**ANGLES, "brdf": [1.0, 2.0, 3.0], "material": ["gold", "tin", "gold"]}
    m = fm.read(table, where="material=gold")
    assert m.value[:, 0].tolist() == [1.0, 3.0]
    assert "Only rows with material = gold: 2 of 3." in m.notes


@pytest.mark.parametrize(
    ("table", "options", "message"),
    [
        ({"signal": [1.0] * 3}, {"panel": 1.0}, r"signal alone, expected a column reference beside it"),
        ({"brdf": [1.0] * 3, "reference": [1.0] * 3}, {}, r"a column reference beside brdf, expected it beside signal"),
        ({"panel_ratio": [1.0] * 3}, {}, r"ratios to a white panel of unknown reflectance, .* \(--panel\)"),
        (
            {"panel_ratio": [1.0] * 3},
            {"panel": 99.0},
            r"panel = 99 \(--panel\), expected its reflectance factor, 0 to 2",
        ),
        ({"radiance": [1.0] * 3}, {}, r"radiances without the light .* or fit the scale \(--unknown-scale\)"),
        (
            {"brdf": [1.0] * 3},
            {"intensity": 5.0, "distance": 2.0},
            r"\(--intensity, --distance\), expected none: the values are brdf, not radiance\. Leave them out",
        ),
        (
            {"brdf_cos": [1.0] * 3},
            {"panel": 0.99},
            r"panel = 0\.99 \(--panel\), expected none: the values are brdf_cos",
        ),
        (
            {"radiance": [1.0] * 3},
            {"unknown_scale": True, "intensity": 5.0, "distance": 2.0},
            r"intensity and distance .* beside unknown_scale \(--unknown-scale\), expected one of the two",
        ),
        (
            {"panel_ratio": [1.0] * 3},
            {"unknown_scale": True, "panel": 0.99},
            r"panel \(--panel\) beside unknown_scale \(--unknown-scale\), expected one of the two",
        ),
        (
            {"brdf": [1.0] * 3},
            {"unknown_scale": True, "instrument": fm.Instrument(calibration=0.03)},
            r"calibration = 0\.03 \(--calibration\) beside unknown_scale \(--unknown-scale\), expected one",
        ),
        ({"brdf": [0.0] * 3}, {"unknown_scale": True}, r"no positive values, expected readings of reflected light"),
        ({"brdf": [1.0] * 3}, {"where": "material=gold"}, r"where = 'material=gold' \(--where\), expected a column of"),
        (
            {"brdf": [1.0] * 3, "material": ["tin"] * 3},
            {"where": "material=gold"},
            r"material is never 'gold', expected one of tin\. Choose one \(--where\)",
        ),
    ],
)
def test_what_is_missing_is_asked_for(table: dict, options: dict, message: str) -> None:
    with pytest.raises(ReadError, match=message):
        fm.read({**ANGLES, **table}, **options)
