"""The match: distances by hand and by brute force in numpy, the words of the verdict, the metrics of the literature."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from oracles import ggx

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.fitting.result import Fit
from fitmat.judgement.fit_metrics import fit_metrics
from fitmat.match import sentences
from fitmat.match.ablation import Ablation
from fitmat.match.discernibility import SEPARATED, Telling
from fitmat.match.imitation import Imitation
from fitmat.match.match import ALBEDO_ANGLES, IMITATED, Match, compare
from fitmat.models.base import AbstractBRDF
from fitmat.models.conversion import alpha_from_exponent, exponent_from_alpha, fitted_alpha, fitted_exponent
from fitmat.reports import plot
from fitmat.studies import match_record
from fitmat.text import plain
from fitmat.uncertainty.estimate import Estimate
from fitmat.uncertainty.posterior import Posterior

EXACT = 1e-9
"""Relative; where both models are constant the quadrature cancels."""

CUBE = 1e-3
"""Relative; 16 Gauss nodes in cosθ_i meet cos^(2/3), whose slope is infinite at grazing."""

BRUTE = 5e-3
"""Relative; midpoint rules of 90 × 90 × 90 here and the library's own rule, each within 2e-3 for these wide lobes."""

SETTINGS = 0.25
"""In ln of the width: about twice the rms error that the corrections state for these widths."""

GREY = {"empirical": {"kd": 0.25, "ks": 0.0, "exponent": 30.0}, "microfacet": {"kd": 0.2, "ks": 0.0, "alpha": 0.3}}
"""Lobes of weight 0: only the diffuse parts differ, by a quarter of the microfacet model's."""


@pytest.fixture(scope="module")
def plastic() -> fm.Measurements:
    truth, theta_o = fm.model("lambert+ggx", kd=0.3, alpha=0.3, eta=1.5), np.deg2rad(np.arange(-80, 81, 10))
    return fm.simulate(truth, np.deg2rad([20, 45, 70]), theta_o, relative_noise=0.02, absolute_noise=1e-3, seed=1)


@pytest.fixture(scope="module")
def fits(plastic: fm.Measurements) -> tuple[Fit, Fit]:
    return fm.fit(plastic, "lambert+blinn-phong"), fm.fit(plastic, "lambert+ggx")


@pytest.fixture(scope="module")
def match(fits: tuple[Fit, Fit]) -> Match:
    return compare(*(fm.laplace(fit, seed=1) for fit in fits), spheres=False)


def certain(fit: Fit, values: dict[str, Any]) -> Posterior:
    """Two draws that both say this model."""
    model = fm.model(fit.name, channels=1, **values)
    other = dataclasses.replace(fit, model=model)
    return Posterior(other, "laplace", np.tile(other.values, (2, 1)), np.zeros(2))


def pair(fits: tuple[Fit, Fit], empirical: dict[str, Any], microfacet: dict[str, Any]) -> Match:
    return compare(certain(fits[0], empirical), certain(fits[1], microfacet), spheres=False)


def test_diffuse_surfaces_differ_as_computed_by_hand(fits: tuple[Fit, Fit]) -> None:
    """|0.25 − 0.2|/0.2; in the cube root |∛(0.25/π) − ∛(0.2/π)| √(mean cos^(2/3)), the mean over solid angle 3/5."""
    found = pair(fits, **GREY)
    assert found.hemisphere_distance.value == pytest.approx(0.25, rel=EXACT)
    assert found.measured_distance.value == pytest.approx(0.25, rel=EXACT)
    by_hand = (np.cbrt(0.25 / np.pi) - np.cbrt(0.2 / np.pi)) * np.sqrt(0.6)
    assert found.cube_root_distance is not None
    assert found.cube_root_distance.value == pytest.approx(by_hand, rel=CUBE)
    assert found.albedo_gap_max.value == pytest.approx(0.05, rel=BRUTE)
    assert found.albedo_gap_sign == 1
    assert found.hemisphere_distance.ci95 == pytest.approx((0.25, 0.25))  # both draws say the same


def test_exponents_beside_each_other(fits: tuple[Fit, Fit]) -> None:
    found = pair(fits, GREY["empirical"], {"kd": 0.2, "ks": 0.0, "alpha": 0.1})
    assert found.fitted_exponent is not None
    assert found.implied_exponent is not None
    assert found.fitted_exponent.value == pytest.approx(30.0)
    assert found.implied_exponent.value == pytest.approx(198.0)  # 2/0.1² − 2


def test_lobes_differ_as_by_brute_force(fits: tuple[Fit, Fit]) -> None:
    """Both formulas again in numpy, on midpoint grids in θ_i, θ_o and φ."""
    found = pair(fits, {"kd": 0.2, "ks": 0.05, "exponent": 10.0}, {"kd": 0.2, "ks": 1.0, "alpha": 0.4, "eta": 1.5})
    count = 90
    theta, phi = (np.arange(count) + 0.5) * np.pi / 2 / count, (np.arange(count) + 0.5) * np.pi / count
    ti, to, azimuth = np.meshgrid(theta, theta, phi, indexing="ij")
    wi, wo = ggx.hemisphere(ti, 0.0), ggx.hemisphere(to, azimuth)
    h = wi + wo
    cos = h[..., 2] / np.linalg.norm(h, axis=-1)
    difference = 0.05 * 18 / (8 * np.pi) * cos**10 - ggx.brdf(wi, wo, 0.4, 1.5)
    microfacet = 0.2 / np.pi + ggx.brdf(wi, wo, 0.4, 1.5)
    solid = np.sin(ti) * np.sin(to)
    weight = solid * np.cos(ti) * np.cos(to)
    hemisphere = np.sqrt(np.sum(weight * difference**2) / np.sum(weight * microfacet**2))
    roots = np.cbrt((microfacet + difference) * np.cos(ti)) - np.cbrt(microfacet * np.cos(ti))
    assert found.hemisphere_distance.value == pytest.approx(hemisphere, rel=BRUTE)
    by_roots = np.sqrt(np.sum(solid * roots**2) / solid.sum())
    assert found.cube_root_distance is not None
    assert found.cube_root_distance.value == pytest.approx(by_roots, rel=BRUTE)
    at_normal = ggx.albedo(0.0, 0.4, 1.5) + 0.2
    assert found.albedo_microfacet[1, 0] == pytest.approx(at_normal, rel=BRUTE)
    assert found.albedo_theta_i is ALBEDO_ANGLES
    gap = found.albedo_empirical[1] - found.albedo_microfacet[1]
    worst = np.argmax(np.abs(gap))
    assert found.albedo_gap_theta_i_deg == pytest.approx(np.rad2deg(ALBEDO_ANGLES[worst]))
    assert found.albedo_gap_sign == np.sign(gap[worst])
    assert found.albedo_gap_max.value == pytest.approx(np.abs(gap[worst]))


def test_only_the_measured_incidences_count_where_said(fits: tuple[Fit, Fit]) -> None:
    """20°, 45° and 70° by brute force in θ_o and φ, each weighted by cosθ_i."""
    found = pair(fits, {"kd": 0.2, "ks": 0.05, "exponent": 10.0}, {"kd": 0.2, "ks": 1.0, "alpha": 0.4, "eta": 1.5})
    count = 400
    theta, phi = (np.arange(count) + 0.5) * np.pi / 2 / count, (np.arange(count) + 0.5) * np.pi / count
    to, azimuth = np.meshgrid(theta, phi, indexing="ij")
    wo, sums = ggx.hemisphere(to, azimuth), np.zeros(2)
    for angle in np.deg2rad([20, 45, 70]):
        wi = np.broadcast_to(ggx.hemisphere(angle, 0.0), wo.shape)
        h = wi + wo
        lobe = ggx.brdf(wi, wo, 0.4, 1.5)
        difference = 0.05 * 18 / (8 * np.pi) * (h[..., 2] / np.linalg.norm(h, axis=-1)) ** 10 - lobe
        weight = np.cos(angle) * np.sin(to) * np.cos(to)
        sums += np.sum(weight * difference**2), np.sum(weight * (0.2 / np.pi + lobe) ** 2)
    assert found.measured_distance.value == pytest.approx(np.sqrt(sums[0] / sums[1]), rel=BRUTE)


def test_the_order_of_arguments_does_not_matter(fits: tuple[Fit, Fit], match: Match) -> None:
    other = compare(*(fm.laplace(fit, seed=1) for fit in reversed(fits)), spheres=False)
    assert other.verdict == match.verdict
    assert other.hemisphere_distance == match.hemisphere_distance
    assert other.delta_bic == match.delta_bic


def test_evidence_is_the_difference_of_criteria(fits: tuple[Fit, Fit], match: Match) -> None:
    """The microfacet model has one parameter more: Schwarz's price is ln 51."""
    gain = 2 * (fits[1].log_likelihood - fits[0].log_likelihood)
    assert match.delta_bic == pytest.approx(gain - np.log(51))
    assert match.delta_aicc == pytest.approx(fits[0].aicc - fits[1].aicc)
    low, high = match.hemisphere_distance.ci95
    assert low <= match.hemisphere_distance.value < high  # the nearest the two can be is one end (`estimate.limits`)
    assert (match.albedo_empirical[0] <= match.albedo_empirical[2]).all()


@pytest.mark.parametrize(
    ("ci95", "words"),
    [
        ((0.04, 0.09), "hardly differ: 8 % apart at the incidences measured (95 % interval 4–9 %)."),
        ((0.12, 0.25), "differ moderately: 8 % apart"),
        ((0.3, 0.31), "differ strongly: 8 % apart"),
        ((0.04, 0.25), "hardly differ or differ moderately, which the data leave open: 8 % apart"),
        ((0.04, 0.31), "hardly differ or differ strongly, which the data leave open: 8 % apart"),
    ],
)
def test_the_verdict_names_the_measured_distance_first(match: Match, ci95: tuple[float, float], words: str) -> None:
    verdict = dataclasses.replace(match, measured_distance=Estimate(0.08, ci95)).verdict
    assert verdict.startswith(f"blinn-phong and ggx {words}")


@pytest.mark.parametrize(
    ("beyond", "words"),
    [(0.972, "is 20 % (95 % interval 10–30 %), of which 97 % rests on incidences beyond those measured."), (0.02, ".")],
)
def test_the_verdict_says_how_much_rests_on_what_nobody_measured(match: Match, beyond: float, words: str) -> None:
    distances = dataclasses.replace(match.distances, beyond=beyond)
    changed = dataclasses.replace(match, hemisphere_distance=Estimate(0.2, (0.1, 0.3)), distances=distances)
    assert (
        f"Over the whole hemisphere it {words if beyond > 0.5 else 'is 20 % (95 % interval 10–30 %).'}"
        in changed.verdict
    )


@pytest.mark.parametrize(
    ("delta_bic", "words"),
    [
        (9.9, "The data do not decide between them (ΔBIC 10)."),
        (-9.0, "The data do not decide between them (ΔBIC -9)."),
        (12.0, "The data clearly prefer ggx (ΔBIC 12)."),
        (-12.0, "The data clearly prefer blinn-phong (ΔBIC 12)."),
    ],
)
def test_the_verdict_names_the_evidence(match: Match, delta_bic: float, words: str) -> None:
    assert words in dataclasses.replace(match, delta_bic=delta_bic).verdict


def test_the_verdict_names_the_gap_in_albedo(match: Match) -> None:
    gap = {"albedo_gap_max": Estimate(0.123, (0.1, 0.15)), "albedo_gap_theta_i_deg": 70.0, "albedo_gap_sign": -1}
    words = "At 70° incidence blinn-phong reflects 12.3 % of the light less than ggx (10.0–15.0 %)."
    assert words in dataclasses.replace(match, **gap).verdict
    beyond = dataclasses.replace(match, **{**gap, "albedo_gap_theta_i_deg": 75.0})
    assert "At 75° incidence, which is extrapolated, blinn-phong reflects 12.3 %" in beyond.verdict
    assert words.replace("less", "more") in dataclasses.replace(match, **{**gap, "albedo_gap_sign": 1}).verdict


def test_the_verdict_warns_of_impossible_albedos(match: Match) -> None:
    bright = np.tile(np.linspace(1.2, 0.9, len(ALBEDO_ANGLES)), (3, 1))
    verdict = dataclasses.replace(match, albedo_empirical=bright).verdict
    assert "blinn-phong reflects more light than it receives (albedo 1.20 at 0°)." in verdict
    assert "more light than it receives" not in match.verdict


@pytest.mark.parametrize("result", ["max_steps", "nonfinite"])
def test_the_verdict_warns_of_unfinished_fits(match: Match, result: str) -> None:
    unfinished = dataclasses.replace(match.microfacet, fit=dataclasses.replace(match.microfacet.fit, result=result))
    warning = f"Do not rely on this match: the fit of lambert+ggx ended {result}."
    assert warning in dataclasses.replace(match, microfacet=unfinished).verdict
    assert "Do not rely" not in match.verdict
    assert match.microfacet.fit.adequacy in match.verdict


def test_widths_beside_each_other(fits: tuple[Fit, Fit]) -> None:
    """√(2/(n+2)) = 0.25 for n = 30, beside α = 0.1."""
    found = pair(fits, GREY["empirical"], {"kd": 0.2, "ks": 0.0, "alpha": 0.1})
    widths = found.implied_alpha, found.fitted_alpha, found.width_ratio
    assert [w.value for w in widths if w is not None] == pytest.approx([0.25, 0.1, 2.5])


def test_the_match_asks_what_an_eye_sees(fits: tuple[Fit, Fit], monkeypatch: pytest.MonkeyPatch) -> None:
    """With the best fits in the first row, and its sentence in the verdict."""
    asked = []

    def look(*given: Any, pictures: bool) -> Any:
        asked.append((*given, pictures))
        return type("Seen", (), {"words": "An eye would wonder."})()

    monkeypatch.setattr("fitmat.match.match.perceived", look)
    found = compare(*(fm.laplace(fit, seed=1) for fit in fits))
    empirical, microfacet, draws, channels, pictures = asked[0]
    assert (empirical.name, microfacet.name, channels) == ("lambert+blinn-phong", "lambert+ggx", ("value",))
    assert not pictures
    for fit, values in zip(fits, draws, strict=True):
        assert np.asarray(values[0]) == pytest.approx(fit.values)
    assert "An eye would wonder." in found.verdict


def imitated(what: AbstractBRDF, into: AbstractBRDF, metric: str) -> Imitation:
    """What `imitate` would return, without its search."""
    return Imitation(into, what.name, metric, 0.5, True)


def test_each_model_imitates_the_other_where_that_is_asked_for(match: Match, monkeypatch: pytest.MonkeyPatch) -> None:
    """In four metrics, both ways, at the best fits."""
    monkeypatch.setattr("fitmat.match.match.imitate", lambda fit, into, metric: imitated(fit.model, into, metric))
    assert match.imitations == ()
    found = compare(match.empirical, match.microfacet, spheres=False, imitations=True).imitations
    one, other = "lambert+blinn-phong", "lambert+ggx"
    metrics = ("relative", "ngan", "cube-root", "log-ratio")
    expected = [(one, other, metric) for metric in metrics] + [(other, one, metric) for metric in metrics]
    assert [(each.model.name, each.of, each.metric) for each in found] == expected
    assert found[0].model is match.empirical.fit.model


def telling(separation: list[float], rms: list[float], every: float) -> Telling:
    """The same at best and in all draws; 10°, 30° and 70°."""
    d, hidden = (np.tile(np.array(x), (3, 1)) for x in (separation, rms))
    angles = np.array([10.0, 30.0, 70.0])
    return Telling(
        angles, np.full(3, 9), hidden, hidden, d, (SEPARATED / d) ** 2, Estimate(every, (every, every)), True
    )


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (([1.0, 1.0, 1.0], [0.3, 0.3, 0.3], 1.96), "cannot tell them apart; that would take 4 times as many readings."),
        (([3.0, 3.0, 3.0], [0.9, 0.9, 0.9], 5.2), "Only all incidences together tell them apart, no single one does."),
        (([3.0, 3.0, 9.0], [1.0, 1.0, 3.0], 9.9), "Up to 30° incidence this instrument cannot tell blinn from ggx,"),
        (([6.0, 3.0, 9.0], [0.9, 0.9, 3.0], 9.9), "Up to 30° incidence their difference is within the noise of a sing"),
        (([6.0, 6.0, 6.0], [0.9, 0.9, 0.9], 9.9), "Everywhere their difference is within the noise of a single readin"),
        (([6.0, 6.0, 6.0], [1.9, 0.9, 0.9], 9.9), "This instrument tells them apart at every incidence measured."),
    ],
)
def test_the_headline_says_what_the_instrument_can_tell(given: tuple[Any, ...], words: str) -> None:
    sentence = sentences.telling_sentence(("blinn", "ggx"), telling(*given))
    assert sentence is not None
    assert words in sentence


def test_the_headline_keeps_quiet_where_the_noise_is_unknown() -> None:
    unknown = dataclasses.replace(telling([6.0] * 3, [2.0] * 3, 9.9), known=False)
    assert sentences.telling_sentence(("blinn", "ggx"), unknown) is None


def test_the_headline_says_what_is_missing_at_grazing_incidence_and_why(match: Match) -> None:
    ablation = match.ablation
    assert isinstance(ablation, Ablation)
    certain = {
        "fresnel": Estimate(0.5, (0.4, 0.6)),
        "tail": Estimate(0.1, (0.0, 0.2)),
        "all": Estimate(1.0, (1.0, 1.0)),
    }
    known = dataclasses.replace(ablation, grazing=certain)
    sentence = sentences.grazing_sentence(("blinn", "ggx"), Estimate(-0.38, (-0.42, -0.34)), known)
    assert sentence == "Beyond 70° blinn reflects 38 % less than ggx (34–42 %): it has no Fresnel term."
    without = sentences.grazing_sentence(("blinn", "ggx"), Estimate(0.12, (0.1, 0.14)), None)
    assert without == "Beyond 70° blinn reflects 12 % more than ggx (10–14 %)."
    for little in (Estimate(-0.04, (-0.05, -0.03)), Estimate(-0.38, (-0.8, 0.04))):
        assert sentences.grazing_sentence(("blinn", "ggx"), little, known) is None


def test_the_pictures_show_the_numbers(match: Match) -> None:
    """Lines by their labels, against incidence in degrees."""
    ax = plot.telling(match.telling)
    points = {box.get_label(): box[0].get_xydata() for box in ax.containers}
    np.testing.assert_allclose(points["all readings"][:, 1], match.telling.separation[1])
    np.testing.assert_allclose(points["a single reading"][:, 1], match.telling.rms[1])


@pytest.mark.parametrize("known", [True, False])
def test_the_record_of_a_match_holds_what_is_said(match: Match, known: bool) -> None:
    """Of causes and of the instrument only what is known; each imitation in each metric."""
    telling = dataclasses.replace(match.telling, known=known)
    fits = match.empirical.fit, match.microfacet.fit
    both = [imitated(fits[1 - k].model, fits[k].model, metric) for k in (0, 1) for metric in IMITATED]
    ablation = match.ablation if known else None
    one = dataclasses.replace(match, telling=telling, ablation=ablation, imitations=tuple(both))
    told = plain(match_record.to_dict(one, None))
    assert (told["causes"] is None, told["telling"] is None) == (not known, not known)
    assert [i["metric"] for i in told["imitations"]] == [*IMITATED, *IMITATED]
    assert told["verdict"] == one.verdict
    if ablation is not None:
        assert told["causes"]["grazing_named"] == list(ablation.causes(ablation.grazing))
        assert [t["separation"] for t in told["telling"]] == match.telling.separation.T.tolist()


def test_an_empirical_model_serves_up_to_where_it_differs_moderately(match: Match) -> None:
    """From 0° on without a gap: what holds beyond a break does not count."""
    curves = dict(match.distances.by_incidence)

    def serving(best: list[float]) -> float | None:
        row = np.r_[best, np.full(len(match.distances.theta_i) - len(best), 0.1)]
        found = dataclasses.replace(
            match.distances, by_incidence=curves | {"relative": np.stack([0 * row, row, 9 + row])}
        )
        return dataclasses.replace(match, distances=found).serves_up_to_deg

    assert serving([0.31]) is None
    assert serving([0.1, 0.29, 0.31]) == pytest.approx(5.0)
    assert serving([]) == pytest.approx(85.0)


def test_fits_stand_for_their_approximations(fits: tuple[Fit, Fit]) -> None:
    """In either order, and also where the same values were read twice."""
    again = dataclasses.replace(fits[0], measurements=dataclasses.replace(fits[0].measurements))
    found = compare(fits[1], again, spheres=False)
    meant = compare(*(fm.laplace(fit, seed=0) for fit in fits), spheres=False)
    assert found.hemisphere_distance == meant.hemisphere_distance
    assert found.empirical.fit.name == fits[0].name


def test_what_cannot_be_compared_is_refused(fits: tuple[Fit, Fit]) -> None:
    blinn, facets = (fm.laplace(fit, seed=1) for fit in fits)
    with pytest.raises(
        FitmatError, match=r"one empirical .* and one microfacet model, got lambert\+ggx and lambert\+g"
    ):
        compare(facets, facets)
    with pytest.raises(FitmatError, match=r"got lambert\+blinn-phong and lambert\+blinn-phong\."):
        compare(blinn, blinn)
    m = fits[0].measurements
    elsewhere = dataclasses.replace(blinn, fit=dataclasses.replace(fits[0], measurements=m.rows(np.arange(50))))
    with pytest.raises(
        FitmatError,
        match=r"compare needs two fits to the same measurements, got fits to .* samples\) and .* samples\)\.",
    ):
        compare(elsewhere, facets)
    broken = dataclasses.replace(blinn, fit=dataclasses.replace(fits[0], result="nonfinite", log_likelihood=np.nan))
    with pytest.raises(
        FitmatError, match=r"lambert\+blinn-phong: the fit ended nonfinite, there is nothing to compare"
    ):
        compare(broken, facets)


def test_metrics_of_three_samples_by_hand(fits: tuple[Fit, Fit]) -> None:
    """A Lambert surface of f = 0.1; the third sample lies beyond Ngan's 80°, and a fourth is masked."""
    ti, to = np.deg2rad([30.0, 60.0, 30.0, 30.0]), np.deg2rad([0.0, 60.0, 85.0, 10.0])
    measured = np.array([0.12, 0.3, 0.05, 9.0])
    m = fm.from_arrays(ti, to, measured)
    m = dataclasses.replace(m, valid=np.array([[True], [True], [True], [False]]))
    fit = dataclasses.replace(fits[0], measurements=m, model=fm.model("lambert", kd=0.1 * np.pi))
    found = fit_metrics(fit)
    ci, co, y = np.cos(ti)[:3], np.cos(to)[:3], measured[:3]
    assert found["cube_root"] == pytest.approx(np.sqrt(np.mean((np.cbrt(y * ci) - np.cbrt(0.1 * ci)) ** 2)))
    logs = np.log((y * ci * co + 1e-3) / (0.1 * ci * co + 1e-3))
    assert found["log_ratio"] == pytest.approx(np.sqrt(np.mean(logs**2)))
    assert found["ngan"] == pytest.approx(np.sqrt(np.mean(((y - 0.1) * ci)[:2] ** 2)))
    assert found["low_e2"] == pytest.approx(np.mean((np.log1p(y * ci) - np.log1p(0.1 * ci)) ** 2 * np.sin(ti[:3])))
    assert found["peak_ratio"] == pytest.approx(np.median([0.1 / 0.12, 0.1 / 0.3]))
    assert found["misfit_ratio"] == fits[0].misfit_ratio


def test_metrics_without_a_basis_are_none(fits: tuple[Fit, Fit]) -> None:
    """Nothing within 80°, no positive maximum, no known noise."""
    m = fm.from_arrays(np.deg2rad([85.0]), np.deg2rad([10.0]), np.array([-0.1]))
    unknown = dataclasses.replace(fits[0].noise, known=False)
    found = fit_metrics(dataclasses.replace(fits[0], measurements=m, noise=unknown))
    assert [key for key, value in found.items() if value is None] == ["ngan", "peak_ratio", "misfit_ratio"]


def test_a_fit_has_the_peak_of_its_data(fits: tuple[Fit, Fit]) -> None:
    """GGX fitted to GGX with 2 % noise."""
    assert fit_metrics(fits[1])["peak_ratio"] == pytest.approx(1.0, abs=0.05)
    spoilt = dataclasses.replace(fits[1], model=fm.model("lambert", kd=0.3))
    ratio = fit_metrics(spoilt)["peak_ratio"]
    assert ratio is not None
    assert ratio < 0.9


def measured(truth: AbstractBRDF) -> fm.Measurements:
    lights, sensor = np.deg2rad([10.0, 30.0, 50.0, 70.0]), np.deg2rad(np.arange(-70.0, 81.0, 10.0))
    return fm.simulate(truth, lights, sensor, relative_noise=0.02, absolute_noise=1e-3, seed=7)


@pytest.mark.parametrize("alpha", [0.1, 0.2, 0.5])
def test_exponents_are_recovered_from_simulated_ggx(alpha: float) -> None:
    found = fm.fit(measured(fm.model("lambert+ggx", kd=0.3, alpha=alpha, eta=1.5)), "lambert+blinn-phong")
    width = np.log(alpha_from_exponent(found.values[2]))
    assert width == pytest.approx(np.log(alpha_from_exponent(fitted_exponent(alpha))), abs=SETTINGS)


@pytest.mark.parametrize("alpha", [0.1, 0.2, 0.5])
def test_slopes_are_recovered_from_simulated_blinn_phong(alpha: float) -> None:
    n = exponent_from_alpha(alpha)
    truth = fm.model("lambert+blinn-phong", kd=0.3, ks=0.04 * (n + 2) / (n + 8), exponent=n)
    found = fm.fit(measured(truth), "lambert+ggx")
    place = next(e.place for e in found.entries if e.name == "alpha")
    assert np.log(found.values[place][0]) == pytest.approx(np.log(fitted_alpha(n)), abs=SETTINGS)
