"""What public functions are given: units and wrong things are named at the door, before anything is computed."""

import dataclasses
import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fitmat as fm
from fitmat.errors import FitmatError
from fitmat.models.base import AbstractBRDF
from fitmat.models.terms.distributions import GGX
from fitmat.models.terms.fresnel import White
from fitmat.studies.result import Fitted


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: fm.from_arrays([20, 50], 0.1, [1, 1]), r"theta_i = 20: expected 0 to π/2 radians\. Are the ang"),
        (lambda: fm.from_arrays(-0.1, [0.1], [1]), r"theta_i = -0\.1: expected 0 to π/2 radians"),
        (lambda: fm.from_arrays(0.1, [0.1, -45], [1, 1]), "theta_o = -45: expected −π/2 to π/2 radians"),
        (lambda: fm.from_arrays(0.1, [0.1], [1], phi=180), "phi = 180: expected −2π to 2π radians"),
        (lambda: fm.from_arrays(0.1, [0.1], [1], phi_i=90), "phi_i = 90: expected −2π to 2π radians"),
        (lambda: fm.albedo(fm.model("lambert"), 45), "theta_i = 45: expected 0 to π/2 radians"),
        (lambda: fm.albedo(fm.model("lambert"), 0.5, 90), "phi_i = 90: expected −2π to 2π radians"),
        (lambda: fm.albedo(fm.model("lambert"), phi_i=0.5), r"phi_i without theta_i: .*\. Give both, or neither"),
        (lambda: fm.Instrument(receiver=2), r"receiver = 2 of the instrument, expected 0 to 0\.5236 radians .*in deg"),
    ],
)
def test_degrees_are_asked_about(call, message) -> None:
    """Radians are meant: 45 rad is 58° beyond seven turns, and was read so."""
    with pytest.raises(FitmatError, match=message):
        call()


def test_rounded_right_angles_are_right_angles() -> None:
    """float32 writes π/2 as 1.5707964, 4e-8 too large."""
    found = fm.from_arrays(np.array([np.pi / 2, 0.5], np.float32), 0.5, [1.0, 1.0])
    assert found.n_samples == 2


def test_what_is_masked_or_missing_is_masked() -> None:
    """NumPy's masked arrays, None and NaN: no datum is made of what stands behind the mask."""
    value = np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False])
    assert fm.from_arrays(0.5, [0.1, 0.2, 0.3], value).valid[:, 0].tolist() == [True, False, True]
    some: Any = [1.0, 2.0, None]
    assert fm.from_arrays(0.5, [0.1, np.nan, 0.3], some).valid[:, 0].tolist() == [True, False, False]


MEASURED = fm.from_arrays(0.5, [0.1, 0.2, 0.3], [1.0, 1.0, 1.0])
LAMBERT = fm.model("lambert")
SURFACE, GLASS = fm.Surface(GGX(), (0.5, 0.5), White()), fm.Surface("ggx", 0.5, 1.5, transmits=True)
FIT, POSTERIOR, STUDY, FITTED = (object.__new__(one) for one in (fm.Fit, fm.Posterior, fm.Study, Fitted))
"""Of the right class and without content: nothing of it is read before the other arguments are looked at."""

UP = [[0.0, 0.0, 1.0]]
NOUN = (None, "lambert+ggx", Path("a.csv"), 3, np.nan, 1j, [], {}, np.zeros((2, 3)), LAMBERT, FIT, MEASURED, fm.Fit)
WHOLE = (None, -1, 1.5, np.nan, "one", True, [1], 1j)
NUMBERS = (None, "much", 1j, [[1.0], [1.0, 2.0]], {}, ["a"], True, FIT)
NUMBER = (*NUMBERS, [0.1, 0.2], np.nan, -1.0)
TEXT = (5, b"x", [], 1j, FIT, np.zeros(2))
FLAG = (None, "no", 1, np.nan, [])
POOLS = (5, b"x", "", " , ", [], [5], 1j, FIT, "lost", np.zeros(2))
NAMED = (5, "ks=1", [("ks", 1.0)], {1: 2.0}, np.zeros(2))
CALLED = (5, "print", [])
PATH = (None, 5, 1j, [], FIT)
FOLDER = (5, "text", [], FIT)


def without(values: tuple[Any, ...], *classes: type) -> tuple[Any, ...]:
    """Wrong things but for those of some classes, which are right."""
    return tuple(value for value in values if not isinstance(value, classes))


NO_FILE = without(NOUN, fm.Measurements, str, Path)
"""What is neither measurements nor the name of a file."""

NOTHING = type(None)
VALUES: dict[str, Any] = {"relative_noise": 0.1, "absolute_noise": 0.0, "seed": 1}
KNOWN: dict[str, tuple[Any, ...]] = {"fixed": (*NAMED, {"kd": "x"}), "priors": (*NAMED, {"kd": 5}, {"kd": (1, "x")})}

DOORS: dict[str, tuple[dict[str, Any], dict[str, tuple[Any, ...]]]] = {
    "read": (
        {"source": {"theta_i": [1.0], "theta_o": [1.0], "brdf": [1.0]}},
        {
            "source": (None, 5, 1j, [], [5], [FIT], FIT, {"theta_i": 1.0}),
            **dict.fromkeys(("quantity", "angle_unit", "where", "scale", "forward"), TEXT),
            **dict.fromkeys(("intensity", "distance", "panel"), ("much", 1j, [], FIT)),
            "columns": (5, 1j, [], FIT),
            "specular_azimuth": ("a", 1.5, []),
            "constants": (5, "theta_i=30", [1.0], FIT, {"theta_i": "30"}, {"alpha": 1.0}, {"theta_i": np.nan}),
            "unknown_scale": FLAG,
            "instrument": NOUN,
        },
    ),
    "join": ({"parts": [MEASURED]}, {"parts": (None, 5, MEASURED, [], [FIT], [MEASURED, "a.csv"], "ab")}),
    "write": (
        {"measurements": MEASURED, "path": "/proc/x.csv"},
        {"measurements": without(NOUN, fm.Measurements), "path": PATH, "force": FLAG},
    ),
    "from_arrays": (
        {"theta_i": 0.5, "theta_o": [0.5, 0.6], "value": [1.0, 1.0]},
        {
            **dict.fromkeys(
                ("theta_i", "theta_o", "value", "phi", "phi_i"), (*NUMBERS, np.zeros((2, 2, 2)), [1.0] * 3)
            ),
            "sigma": (*without(NUMBERS, NOTHING), [1.0] * 3),
            "channels": ("r", 5, ["r", "g"], [5], [None], ()),
            "source": (None, *TEXT),
            "instrument": NOUN,
        },
    ),
    "Measurements": (
        {f.name: getattr(MEASURED, f.name) for f in dataclasses.fields(MEASURED)},
        {
            **dict.fromkeys(("wi", "wo", "value", "valid"), (None, "x", 5, [], np.zeros(3), np.zeros((2, 1)), FIT)),
            **dict.fromkeys(("sigma", "horizontal"), ("x", 5, [], np.zeros(3), np.zeros((2, 1)), FIT)),
            "inferred": ("x", 5, [], True, np.zeros(3, bool), np.zeros((2, 1)), FIT),
            "channels": (None, "r", 5, ("r", "g"), FIT),
            "instrument": NOUN,
            "stated": (None, "TIS", 0.3, [], (0.3,), FIT),
        },
    ),
    "Instrument": (
        {},
        {
            **dict.fromkeys(("source", "receiver", "calibration", "angle_error", "aperture_error"), NUMBER),
            "dark": without(NUMBER, NOTHING),
        },
    ),
    "examine": ({"measurements": MEASURED}, {"measurements": NO_FILE}),
    "simulate": (
        {"truth": LAMBERT, "theta_i": 0.5, "theta_o": 0.5, **VALUES},
        {
            "truth": without(NOUN, AbstractBRDF),
            **dict.fromkeys(("theta_i", "theta_o", "phi", "phi_i"), (*NUMBERS, np.nan)),
            **dict.fromkeys(("relative_noise", "absolute_noise"), NUMBER),
            "seed": WHOLE,
            "samples": without(WHOLE, NOTHING),
            "give_sigma": FLAG,
            "instrument": NOUN,
        },
    ),
    "model": (
        {"name": "lambert"},
        {
            "name": (None, *TEXT, "", "lambort"),
            "masking": TEXT,
            "channels": without((0, *WHOLE), NOTHING),
            "wavelengths": (*without(NUMBERS, NOTHING), [550.0], 0.55, np.nan, []),
            "kd": (*NUMBERS, np.zeros((2, 2)), np.nan, 1.5, -0.1),
        },
    ),
    "every_model": ({}, {"measurements": without(NOUN, fm.Measurements, NOTHING)}),
    "directions": (
        {"theta": 0.5},
        {"theta": (*NUMBERS, 2.0, np.zeros((2, 2))), "phi": (*NUMBERS, 7.0, np.zeros((2, 2))), "degrees": FLAG},
    ),
    "evaluate": (
        {"model": LAMBERT, "wi": UP, "wo": UP},
        {
            "model": without(NOUN, AbstractBRDF),
            **dict.fromkeys(("wi", "wo"), (*NUMBERS, 0.5, [0.5], [[1.0, 1.0, 1.0]])),
            **dict.fromkeys(("samples", "seed"), without(WHOLE, NOTHING)),
        },
    ),
    "albedo": (
        {"model": LAMBERT, "theta_i": 0.5},
        {
            "model": without(NOUN, AbstractBRDF),
            "theta_i": (*without(NUMBERS, NOTHING), np.nan, [], np.zeros((2, 2))),
            "phi_i": (*NUMBERS, np.nan, [0.1, 0.2]),
            "goal": (*NUMBER, 0.0, 2.0),
        },
    ),
    "Surface": (
        {"distribution": GGX(), "slopes": (0.5, 0.5), "fresnel": White()},
        {
            "distribution": (None, "phong", GGX, 5),
            "slopes": (None, 45.0, np.nan, "a", (0.5,), ("a", "b"), (0.5, np.nan), (1j, 1j), (0.5, 45.0)),
            "fresnel": (None, "schlick", White, 0.0, np.nan, True),
            "transmits": FLAG,
        },
    ),
    **{
        name: (
            {"surface": SURFACE, "wi": UP, "samples": 100, "seed": 1} | ({} if name == "albedo_walk" else {"wo": UP}),
            {
                "surface": NOUN,
                "wi": (*NUMBERS, 0.5, [0.5], [[1.0, 1.0, 1.0]]),
                "samples": (0, 1, *WHOLE),
                "seed": WHOLE,
                **({} if name == "albedo_walk" else {"wo": (*NUMBERS, 0.5)}),
                "order": without((0, *WHOLE), NOTHING),
            },
        )
        for name in ("evaluate_walk", "albedo_walk", "evaluate_slab")
    },
    "fresnel_in_rgb": ({"material": "Au"}, {"material": (*NOUN, *TEXT), "illuminant": (*NOUN, *TEXT)}),
    "metamerism": (
        {"one": np.ones(41), "other": np.full(41, 0.5), "wavelengths": np.arange(380.0, 781.0, 10.0)},
        {
            **dict.fromkeys(("one", "other", "wavelengths"), (*NUMBERS, 0.5, np.ones(3), np.full(41, np.nan))),
            **dict.fromkeys(("reference", "illuminant", "observer"), (*NOUN, *TEXT, "D64")),
        },
    ),
    "transmittance": (
        {"theta_i": 0.5, "eta": 1.5},
        {"theta_i": (*NUMBERS, np.nan, 45.0), "eta": (*NUMBERS, np.nan, 0.0, -1.5)},
    ),
    "evaluate_interface": (
        {"surface": GLASS, "wi": UP, "wo": UP},
        {
            "surface": (*NOUN, SURFACE),
            **dict.fromkeys(("wi", "wo"), (*NUMBERS, 0.5, [0.5], [[1.0, 1.0, 1.0]])),
            "masking": (None, *TEXT, "v-cavity"),
        },
    ),
    "albedo_interface": (
        {"surface": GLASS, "theta_i": 0.5},
        {
            "surface": (*NOUN, SURFACE),
            "theta_i": (*NUMBERS, np.nan, [], np.zeros((2, 2))),
            "inside": FLAG,
            "masking": (None, *TEXT, "v-cavity"),
        },
    ),
    "fit": (
        {"measurements": MEASURED, "to": "lambert"},
        {
            "measurements": NO_FILE,
            "to": (None, "lambort", 5, [], MEASURED),
            **KNOWN,
            "loss": (None, *TEXT, "lost"),
            "masking": (*TEXT, "mask"),
            "dispersion": (*TEXT, "snell", "cauchy"),
            "max_steps": (0, *WHOLE),
        },
    ),
    "fit_many": (
        {"wi": UP, "wo": UP, "value": np.ones((2, 1))},
        {
            **dict.fromkeys(("wi", "wo"), (*NUMBERS, 0.5, [0.5], [[1.0, 1.0, 1.0]])),
            "value": (*NUMBERS, 0.5, [0.5], np.zeros((2, 3))),
            "to": (None, "lambort", 5, [], MEASURED),
            "sigma": (*without(NUMBERS, NOTHING), [1.0, 1.0]),
            "fixed": KNOWN["fixed"],
            "loss": (None, *TEXT, "lost", "gaussian", "gaussian-inferred"),
            "masking": (*TEXT, "mask"),
            **dict.fromkeys(("starts", "max_steps"), (0, *WHOLE)),
            "threads": without((0, *WHOLE), NOTHING),
            **dict.fromkeys(("pool", "smooth"), POOLS),
            "precision": (None, *TEXT, "half", "float32"),
            "progress": CALLED,
        },
    ),
    "indices": ({"fit": FIT}, {"fit": without(NOUN, fm.Fit)}),
    "laplace": ({"fit": FIT, "seed": 1}, {"fit": without(NOUN, fm.Fit), "seed": WHOLE, "corrected": FLAG}),
    "sample": (
        {"fit": FIT, "seed": 1},
        {
            "fit": without(NOUN, fm.Fit),
            "seed": WHOLE,
            "walkers": without((0, *WHOLE), NOTHING),
            "max_steps": (0, *WHOLE),
            "progress": CALLED,
            "checkpoint": FOLDER,
        },
    ),
    "identify": ({}, {"posterior": NOUN}),
    "choose": (
        {"posteriors": [POSTERIOR]},
        {"posteriors": (*NOUN, POSTERIOR, [FIT], [None]), "predicting": FLAG, "singly": FLAG},
    ),
    "compare_laboratories": (
        {"measurements": [MEASURED, MEASURED]},
        {
            "measurements": (None, 5, MEASURED, [], [MEASURED], [FIT, FIT], [MEASURED, "a.csv"], [MEASURED, MEASURED]),
            "name": (None, *TEXT),
            "names": (5, "ab", FIT),
            "fixed": (),
        },
    ),
    "check_predictions": ({"posterior": POSTERIOR, "seed": 1}, {"posterior": NOUN, "seed": WHOLE}),
    "check_posterior": (
        {"posterior": POSTERIOR, "seed": 1},
        {"posterior": NOUN, "seed": WHOLE, **dict.fromkeys(("chains", "warmup", "count"), (0, *WHOLE))},
    ),
    "calibrate": (
        {"name": "lambert", "geometry": MEASURED, "noise": (0.1, 0.1), "priors": {}, "simulations": 1, "seed": 1},
        {
            "name": (None, *TEXT, "lambort"),
            "geometry": without(NOUN, fm.Measurements),
            "noise": (*NUMBERS, 0.1, (0.1,), (-0.1, 0.1)),
            "priors": (None, *KNOWN["priors"]),
            "simulations": (0, *WHOLE),
            "seed": WHOLE,
            "method": (None, *TEXT, "nuts"),
            "told": NUMBER,
            "progress": CALLED,
        },
    ),
    "next_angles": (
        {"posterior": POSTERIOR},
        {
            "posterior": NOUN,
            "target": TEXT,
            "against": without(NOUN, NOTHING),
            "kind": (None, *TEXT, "curves"),
            "count": (0, *WHOLE),
            "repeats": (0, *WHOLE),
            "limits": (5, {}, 1j, "60"),
        },
    ),
    "compare": (
        {"one": POSTERIOR, "other": POSTERIOR},
        {
            "one": without(NOUN, fm.Fit),
            "other": without(NOUN, fm.Fit),
            **dict.fromkeys(("spheres", "imitations", "pictures", "short"), FLAG),
        },
    ),
    "imitate": (
        {"what": LAMBERT, "into": "lambert"},
        {
            "what": without(NOUN, AbstractBRDF, fm.Fit),
            "into": (None, "lambort", 5, [], MEASURED),
            "metric": (None, *TEXT, "far"),
            "fixed": KNOWN["fixed"],
            "weight": (*TEXT, "heavy"),
        },
    ),
    "study": (
        {"measurements": MEASURED, "models": "lambert"},
        {
            "measurements": NO_FILE,
            "models": (None, 5, 1j, [], [5], "lambort", FIT),
            **KNOWN,
            "loss": (None, *TEXT, "lost"),
            "masking": (*TEXT, "mask"),
            "ior": (*TEXT, "Unobtainium"),
            "dispersion": (*TEXT, "snell", "cauchy"),
            "film": (*TEXT, "Unobtainium", "TiO2"),
            **dict.fromkeys(("tilt", "sampling", "second_opinion", "full", "short"), FLAG),
            "seed": WHOLE,
            "resume": FOLDER,
            "progress": CALLED,
        },
    ),
    "colour_of": (
        {"fitted": FITTED},
        {
            "fitted": NOUN,
            "theta_i": (*NUMBER, 45.0),
            "theta_o": (*NUMBERS, 45.0, np.nan),
            **dict.fromkeys(("illuminant", "observer"), (*NOUN, *TEXT, "D64")),
        },
    ),
    "load": ({"folder": "/proc/x"}, {"folder": PATH}),
    "export": (
        {"material": LAMBERT, "target": "table"},
        {
            "material": without(NOUN, AbstractBRDF, fm.Fit),
            "target": (None, *TEXT, "hlsl"),
            "folder": without(PATH, NOTHING),
            **dict.fromkeys(("model", "name"), TEXT),
            "theta_i": (5, b"x", [], 1j, FIT, np.nan),
            "step": (*TEXT, 5.0, 0.0),
            **dict.fromkeys(("bump", "strict", "verify", "force"), FLAG),
        },
    ),
    "render": (
        {"material": LAMBERT, "size": 16},
        {
            "material": without(NOUN, AbstractBRDF, fm.Fit),
            "light": (None, 5, "behind", [], ["behind"], (1j, 0.0), FIT),
            "model": TEXT,
            "size": (15, 513, *WHOLE),
            "exposure": ("much", 1j, [], -1.0, 0.0, FIT),
        },
    ),
    "batch": (
        {"sources": ["/dev/null"], "folder": "/proc/x"},
        {
            "sources": (None, 5, 1j, [], [5], [FIT], FIT),
            "folder": PATH,
            "models": ([], [5], "lambort"),
            "jobs": FOLDER[:1],
            **dict.fromkeys(("reading", "studying"), NAMED),
            "processes": without((0, *WHOLE), NOTHING),
            "scheduler": TEXT,
            "pool": POOLS,
            **dict.fromkeys(("runs", "force"), FLAG),
            "progress": CALLED,
        },
    ),
    "report": ({"study": STUDY, "folder": "/proc/x"}, {"study": NOUN, "folder": PATH, "force": FLAG}),
}
"""Public name → arguments that are right, and for each argument what is not."""

UNCHECKED = {"source", "masked", "notes", "warnings", "channels"}
"""What only words are made of; and names of channels, which are looked at once there are values."""

RESULTS = {"Fit", "Fits", "Posterior", "Match", "Study"}
"""Classes that fitmat makes and users do not."""

WRONG = [
    (name, key, k) for name, (_, wrong) in DOORS.items() for key, values in wrong.items() for k in range(len(values))
]


@pytest.mark.parametrize(("name", "key", "k"), WRONG)
def test_wrong_things_are_named_at_the_door(name: str, key: str, k: int) -> None:
    """A sentence that says what was expected, not a traceback from the depths; nothing is fitted or compiled."""
    right, wrong = DOORS[name]
    with pytest.raises(
        FitmatError,
        match=r"expected|needs GGX|no fit is finite|is not known|no lobe|unknown loss|no model given|none of lambert",
    ):
        getattr(fm, name)(**right | {key: wrong[key][k]})


def test_every_public_name_has_its_door() -> None:
    assert DOORS.keys() | RESULTS | {"FitmatError", "plot"} == set(dir(fm))
    for name, (_, wrong) in DOORS.items():
        asked = set(inspect.signature(getattr(fm, name)).parameters) - UNCHECKED - {"values"}
        assert asked <= wrong.keys(), name


def test_every_picture_asks_for_its_thing() -> None:
    shown = [one for one in vars(fm.plot).values() if inspect.isfunction(one) and one.__module__.endswith("plots")]
    shown += [one for one in vars(fm.plot).values() if inspect.isfunction(one) and one.__module__.endswith("plot")]
    pictures = [one for one in shown if not one.__name__.startswith("_")]
    assert {one.__name__ for one in pictures} >= {
        *("curves", "residuals", "albedo", "distances", "corner", "telling", "spheres", "design", "examination"),
    }
    for picture in pictures:
        for wrong in NOUN:
            with pytest.raises(FitmatError, match="expected"):
                picture(wrong)
