"""Three sentences: words follow numbers at the thresholds that are named, whatever else a record holds.

Records are made by hand here, so that each threshold has a number on either side; studies of random materials are in
`test_consistent`.
"""

import copy
from typing import Any

import pytest

from fitmat.studies.cards import BAD, CAUTION, GOOD, MOST_WORDS, UNKNOWN, Card, cards, wider


def quantity(value: Any, sd: Any = 0.001, remark: Any = "") -> dict[str, Any]:
    return {"value": value, "sd": sd, "ci95": [0.0, 1.0], "unit": "1", "symbol": "x", "remark": remark, "doc": ""}


def fitted(name: str, **changes: Any) -> dict[str, Any]:
    plain = {
        "model": name,
        "result": "converged",
        "parameters": {"kd": quantity(0.2), "ks": quantity(1.0), "alpha": quantity(0.15, 0.0004), "eta": quantity(1.5)},
        "derived": {"f0": quantity(0.04), "ks·F0": quantity(0.04)},
        "inadequate": False,
        "adequacy": "follows the data within the measurement noise",
        "misfit_ratio": 0.1,
        "doubts": [],
        "intervals_hold": True,
        "not_determined": [],
        "identifiability": {"words": "", "parameters": {"kd": {"state": "determined"}}},
        "posterior": {"verdict": "reliable"},
    }
    return plain | changes


def spread(mean: float, twentieth: float, high: float) -> dict[str, Any]:
    return {"mean": {"value": mean}, "worst_twentieth": {"value": twentieth, "ci95": [0.0, high]}}


def record(**changes: Any) -> dict[str, Any]:
    """Satin plastic, which Blinn–Phong does not match."""
    shares = {"core": 0.02, "tail": 0.01, "grazing": 0.97, "diffuse": 0.0}
    match = {
        "empirical": "lambert+blinn-phong",
        "microfacet": "lambert+ggx",
        "delta_bic": 2000.0,
        "measured_distance": {"value": 0.8, "ci95": [0.7, 0.9]},
        "measured_deg": [10.0, 70.0],
        "serves_up_to_deg": None,
        "perceived": {"delta_e_2000": spread(5.3, 25.0, 30.0)},
        "distances": {"relative": {"share": {region: {"value": share} for region, share in shares.items()}}},
    }
    missing = {"inadequate": True, "misfit_ratio": 46.0, "doubts": ["It misses."]}
    plain = {
        "fits": [fitted("lambert+blinn-phong", **missing), fitted("lambert+ggx")],
        "choice": {"candidates": [{"model": "lambert+ggx"}, {"model": "lambert+blinn-phong"}]},
        "match": match,
        "loss": {"name": "default", "posterior": True},
        "warnings": [],
    }
    return copy.deepcopy(plain | changes)


def test_a_plastic_is_told_in_three_sentences() -> None:
    material, phong, trust = cards(record())
    assert material.sentence == "Like satin plastic: diffuse 20 %, F0 4.0 %, α 0.1500 ± 0.0004 (GGX)."
    assert phong.sentence == (
        "Blinn–Phong does not serve: mean ΔE2000 5.3, different colours; "
        "over the hemisphere, 97 % of the difference to GGX lies beyond 70°."
    )
    assert trust.sentence == (
        "Yes: GGX follows the data within the noise and every parameter is determined; no further angle is needed."
    )
    assert [card.level for card in (material, phong, trust)] == [GOOD, BAD, GOOD]


@pytest.mark.parametrize(
    ("parameters", "derived", "words"),
    [
        (
            {"kd": quantity(0.0), "alpha": quantity(0.04)},
            {"f0": quantity(0.9)},
            "Like glossy metal: diffuse 0 %, F0 90 %",
        ),
        (
            {"kd": quantity(0.3), "alpha": quantity(0.44)},
            {"f0": quantity(0.04)},
            "Like dull paint: diffuse 30 %, F0 4.0 %",
        ),
        ({"kd": quantity(0.3), "alpha": quantity(0.46)}, {"f0": quantity(0.04)}, "Like matte paint: "),
        ({"kd": quantity(0.3), "alpha": quantity(0.029)}, {"f0": quantity(0.04)}, "Like mirror-smooth plastic: "),
        ({"kd": quantity(0.01), "alpha": quantity(0.2)}, {"f0": quantity(0.04)}, "Like a satin dielectric: "),
        ({"kd": quantity([0.45, 0.12, 0.05], [0.1] * 3, [""] * 3), "alpha": quantity(0.2)}, {}, "diffuse 45/12/5 %"),
        ({"kd": quantity([k / 31 for k in range(31)], [0.1] * 31, [""] * 31)}, {}, "GGX: diffuse 0–97 % (GGX)."),
        (
            {"kd": quantity(0.3), "eta": quantity(1.5)},
            {"f0": quantity(0.04, None, "not determined"), "ks·F0": quantity(0.039)},
            "ks·F0 3.9 %",
        ),
        (
            {"kd": quantity(0.3, None, "not determined"), "eta": quantity(1.5)},
            {},
            "GGX: its parameters are not determined.",
        ),
        (
            {"a": quantity(0.003014, 0.000074), "b": quantity(0.0008, 0.1, "not determined"), "g": quantity(1.7, 0.01)},
            {},
            "GGX: a 0.00301 ± 0.00007, g 1.70 ± 0.01 (GGX).",
        ),
        (
            {"kd": quantity(0.2), "ks": quantity(0.06), "exponent": quantity(40.0, 0.5)},
            {},
            "specular weight 0.06, exponent 40.0 ± 0.5",
        ),
    ],
)
def test_a_material_is_called_what_its_numbers_are(parameters: Any, derived: Any, words: str) -> None:
    """Gloss by α at 0.03, 0.12, 0.25, 0.45; metal from F0 = 30 %; what is not determined is not quoted."""
    fits = [fitted("lambert+ggx", parameters=parameters, derived=derived)]
    material = cards(record(fits=fits, match=None))[0]
    assert words.removesuffix(" (GGX).") in material.sentence


@pytest.mark.parametrize(
    ("changes", "level", "words"),
    [
        (
            {"perceived": {"delta_e_2000": spread(0.6, 2.0, 2.9)}},
            GOOD,
            "tell it from GGX (mean ΔE2000 0.6, not visible).",
        ),
        (
            {"perceived": {"delta_e_2000": spread(0.6, 2.0, 3.1)}},
            BAD,
            "does not serve: ΔE2000 2.0 where worst, just visible; over",
        ),
        (
            {"perceived": None, "measured_distance": {"value": 0.08, "ci95": [0.07, 0.099]}},
            GOOD,
            "hardly differs from GGX.",
        ),
        (
            {"perceived": None, "measured_distance": {"value": 0.08, "ci95": [0.07, 0.11]}},
            BAD,
            "does not serve: over the hemisphere, 97 %",
        ),
        (
            {"serves_up_to_deg": 60.0},
            CAUTION,
            "serves up to 60° of incidence, within 30 % of GGX; mean ΔE2000 5.3, different colours.",
        ),
        ({"serves_up_to_deg": 85.0}, CAUTION, "serves up to 85° of incidence, extrapolated, within 30 % of GGX"),
        ({"serves_up_to_deg": 15.0}, BAD, "does not serve"),
        ({"delta_bic": -11.0}, CAUTION, "serves better than GGX, but neither follows the data"),
        ({"delta_bic": None}, BAD, "does not serve"),
    ],
)
def test_phong_serves_as_far_as_it_does(changes: Any, level: str, words: str) -> None:
    found = record()
    phong = cards(found | {"match": found["match"] | changes})[1]
    assert phong.level == level
    assert words in phong.sentence


def test_phong_serves_where_the_data_prefer_it() -> None:
    found = record(fits=[fitted("lambert+blinn-phong"), fitted("lambert+ggx", inadequate=True)])
    found["match"]["delta_bic"] = -2000.0
    phong = cards(found)[1]
    assert (phong.level, phong.sentence) == (
        GOOD,
        "Blinn–Phong serves: it follows the data, which clearly prefer it to GGX.",
    )
    assert cards(record(match=None))[1].level == UNKNOWN


@pytest.mark.parametrize(
    ("changes", "level", "words"),
    [
        (
            {"inadequate": True, "misfit_ratio": 8.0, "doubts": ["a"]},
            CAUTION,
            "With care: GGX misses the data by 8 × the",
        ),
        (
            {"inadequate": True, "misfit_ratio": 8.0, "doubts": ["a"], "not_determined": list("abcd")},
            CAUTION,
            "by 8 × the noise, and a, b, c and 1 more are not determined; try more models.",
        ),
        ({"inadequate": True, "intervals_hold": False, "doubts": ["a"]}, BAD, "No: "),
        ({"not_determined": ["eta", "ks"]}, CAUTION, "In part: eta, ks are not determined by these angles; `"),
        ({"not_determined": ["eta"]}, CAUTION, "In part: eta is not"),
        (
            {
                "not_determined": ["eta"],
                "identifiability": {"parameters": {"eta": {"state": "not determined", "misfit": True}}},
            },
            CAUTION,
            "In part: eta is not determined, because the model misses the data; another model may say more.",
        ),
        ({"not_determined": list("abcdefgh")}, CAUTION, "In part: a, b, c and 5 more are not determined"),
        ({"adequacy": "adequacy unknown: the noise is not known"}, UNKNOWN, "Not known: "),
        (
            {
                "identifiability": {
                    "parameters": {"ks r": {"state": "weakly determined"}, "ks g": {"state": "weakly determined"}}
                }
            },
            CAUTION,
            "but ks is only weakly",
        ),
        ({"doubts": ["a", "b"]}, CAUTION, "but 2 remarks on the data are below."),
        ({"posterior": {"verdict": "approximate"}}, CAUTION, "but the posterior is approximate"),
        ({"identifiability": None}, GOOD, "Yes: GGX follows the data within the noise and nothing speaks against it."),
    ],
)
def test_trust_says_what_speaks_against_it(changes: Any, level: str, words: str) -> None:
    trust = cards(record(fits=[fitted("lambert+ggx", **changes)], match=None))[2]
    assert trust.level == level
    assert words in trust.sentence
    assert len(trust.sentence.split()) <= MOST_WORDS


def place(**changes: Any) -> dict[str, Any]:
    """A curve to measure next."""
    plain = {"target": "eta", "against": None, "theta_i_deg": 80.0, "phi_i_deg": 0.0, "phi_deg": 180.0}
    return plain | {"theta_o_deg": [-80.0, 80.0]} | changes


def weak(*names: str) -> dict[str, Any]:
    return {"identifiability": {"parameters": {name: {"state": "weakly determined"} for name in names}}}


@pytest.mark.parametrize(
    ("changes", "where", "words"),
    [
        ({"not_determined": ["eta"]}, place(), "eta is not determined by these angles; measure next: incidence 80°."),
        (weak(*"abcdefgh"), place(), "but a, b, c and 5 more are only weakly determined; measure next: incidence 80°."),
        (
            weak(*"abcdefgh"),
            place(phi_i_deg=45.0, phi_deg=90.0),
            "but 8 parameters are only weakly determined; measure next: incidence 80° turned 45° across the plane.",
        ),
        (
            {"adequacy": "adequacy unknown: the noise is not known"},
            place(),
            "cannot be judged; measure next: incidence 80°.",
        ),
        ({}, place(target="match", against="lambert+blinn-phong"), "; incidence 80° would tell it from Blinn–Phong."),
    ],
)
def test_what_to_measure_next_is_said_once_and_briefly(changes: Any, where: Any, words: str) -> None:
    told = record(fits=[fitted("lambert+ggx", **changes)], match=None, next=where)
    trust = cards(told)[2]
    assert trust.sentence.endswith(words)
    assert len(trust.sentence.split()) <= MOST_WORDS
    assert "incidence" not in cards(told | {"next": None})[2].sentence


def test_an_objective_has_no_intervals_and_nothing_finite_no_values() -> None:
    trust = cards(record(loss={"name": "log10", "posterior": False}))[2]
    assert trust.sentence == "In part: GGX is a single best fit under the loss log10, without intervals."
    nothing = {"parameters": {"kd": quantity(None, None)}, "derived": {}}
    material, phong, trust = cards(record(fits=[fitted("lambert+ggx", **nothing)], choice=None, match=None))
    assert [card.level for card in (material, phong, trust)] == [BAD, UNKNOWN, BAD]
    assert "nothing finite" in material.sentence


def test_a_word_above_its_sentence_is_not_said_twice() -> None:
    said = Card("Can I trust it?", GOOD, "yes", "Yes: GGX follows the data within the noise.")
    assert said.after_word == "GGX follows the data within the noise."
    other = Card("Phong or not", BAD, "does not serve", "Blinn–Phong does not serve: ΔE2000 5.3 on average.")
    assert other.after_word == other.sentence


@pytest.mark.parametrize(
    ("command", "every"),
    [
        ("fitmat fit a.csv", "fitmat fit a.csv --models all"),
        ("fitmat fit 'a b.csv' --models ggx,phong --seed 3", "fitmat fit 'a b.csv' --seed 3 --models all"),
        ("fitmat fit --models=ggx a.csv", "fitmat fit a.csv --models all"),
        (None, ""),
    ],
)
def test_what_tries_every_model_is_a_whole_command(command: str | None, every: str) -> None:
    missing = {"inadequate": True, "misfit_ratio": 8.0}
    found = record(command=command, fits=[fitted("lambert+ggx", **missing)], choice=None, match=None)
    assert wider(found) == every
    assert wider(record(command=command)) == ""  # GGX, which stands for the material, follows the data
    many = [fitted(name, **missing) for name in ("ggx", "ward", "phong")]
    assert wider(record(command=command, fits=many, choice=None, match=None)) == ""
