"""What Mitsuba gets is the model where both mean the same, to single precision; elsewhere the difference is said."""

import ast
import json
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from types import ModuleType
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from lanes import mapped

import fitmat as fm
from fitmat.errors import ModelError
from fitmat.exports import mitsuba as target
from fitmat.exports.verification import Difference, compared, directions, exact
from fitmat.maths.directions import from_angles
from fitmat.models.base import AbstractBRDF

AGREE = 1e-4
"""Relative; single precision at alpha 0.1, up to 89.9 degrees."""

K = np.array([0.2, 0.4, 0.8])
BRUSHED: dict[str, Any] = {"alpha_x": 0.1, "alpha_y": 0.3}

SAME: dict[str, AbstractBRDF] = {
    "grey": fm.model("lambert", kd=0.5),
    "coloured": fm.model("lambert", kd=K),
    "gold": fm.model("ggx-conductor", masking="separable", ks=0.7, alpha=0.1, eta=K, kappa=K + 2.0),
    "brushed": fm.model("ggx-aniso-conductor", masking="separable", **BRUSHED, eta=K, kappa=K + 2.0),
    "brushed across": fm.model("ggx-aniso", masking="separable", **BRUSHED, rotation=90.0),
    "plastic": fm.model("lambert+walter-ggx", kd=0.9, alpha=0.1),
    "coloured plastic": fm.model("lambert+walter-beckmann", kd=K, ks=K[::-1] / 5.0, alpha=0.1),
}


def executed(plugin: target.Plugin, *models: AbstractBRDF) -> list[Difference]:
    """Of the dictionary and the XML, whichever is further, from each model."""
    wi, wo = (w[::4] for w in directions())
    values, executor = target.run(plugin, wi, wo)
    found = []
    for model in models:
        own = mapped(lambda a, b, m=model: jnp.atleast_1d(m(a, b)), (), exact(wi, wo))[0]
        every = [compared(one, own, wi, wo, executor, least=target.LEAST) for one in values]
        found.append(max(every, key=lambda one: one.largest))
    return found


@pytest.mark.parametrize("name", SAME)
def test_mitsubas_values_are_the_models(mitsuba: ModuleType, name: str) -> None:
    """Over 3,072 pairs of directions, of the dictionary and of the XML; a model a hundredth brighter is not it."""
    plugin = target.translated(SAME[name])
    (found,) = executed(plugin, SAME[name])
    assert found.largest <= AGREE, found.words
    assert target.notes(SAME[name]) == []
    wrong = json.loads(
        json.dumps(plugin).replace('"value": 0.', '"value": 0.1').replace('"value": [0.', '"value": [0.1')
    )
    wrong |= {"alpha": 0.101} if "alpha" in plugin else {"weight": 0.123} if "weight" in plugin else {}
    if wrong != plugin:
        assert executed(wrong, SAME[name])[0].largest > 10 * AGREE


@pytest.mark.parametrize("name", ["lambert+ggx", "beckmann"])
def test_another_masking_is_said_and_is_all_that_differs(mitsuba: ModuleType, name: str) -> None:
    model, twin = fm.model(name, alpha=0.3), fm.model(name.replace("ggx", "walter-ggx").replace("beck", "walter-beck"))
    twin = fm.model(twin.name, alpha=0.3)
    found, same = executed(target.translated(model), model, twin)
    assert same.largest < AGREE
    assert found.largest > 0.1
    assert "Mitsuba masks light and eye separately" in target.notes(model)[0]
    assert "Fit with --masking separable" in target.notes(model)[0]
    with pytest.raises(ModelError, match="Mitsuba masks light and eye separately"):
        fm.export(model, "mitsuba", strict=True)


def test_the_session_keeps_its_variant(mitsuba: ModuleType) -> None:
    mitsuba.set_variant("scalar_spectral")
    try:
        found = target.difference(fm.model("lambert"), target.translated(fm.model("lambert")))
        assert found is not None
        assert (mitsuba.variant(), found.executor) == ("scalar_spectral", f"Mitsuba {mitsuba.__version__}")
    finally:
        mitsuba.set_variant("scalar_rgb")


def test_a_name_is_a_comment_and_nothing_else(mitsuba: ModuleType) -> None:
    """The dictionary is Python's, the XML a scene that Mitsuba loads, whatever the name holds."""
    name = 'it\'s "é*/ --> ]]> <bsdf> & </scene>\\ \n\u202e """\nimport os'
    files = fm.export(SAME["coloured plastic"], "mitsuba", name=name, verify=False).files
    code, scene, record = files.values()
    assert code.isascii()
    assert scene.isascii()
    tree = ast.parse(code)
    assert [type(node) for node in tree.body] == [ast.Assign]
    assert ast.literal_eval(code.partition("bsdf = ")[2]) == target.translated(SAME["coloured plastic"])
    assert [child.tag for child in ElementTree.fromstring(scene)] == ["bsdf"]
    mitsuba.set_variant("scalar_rgb")
    assert len(mitsuba.load_string(scene).shapes()) == 0
    assert json.loads(record)["name"] == name


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (lambda: fm.model("lambert+phong"), r"Mitsuba has no plugin for phong, expected lambert, and ggx or beckmann"),
        (lambda: fm.model("ggx+beckmann"), "no plugin for two lobes of a kind"),
        (
            lambda: fm.model("ggx-schlick"),
            "ggx-schlick: Mitsuba's rough surfaces have a refractive index, .*ggx-conduct",
        ),
        (lambda: fm.model("ggx-aniso", rotation=10.0), "turns no tangent, expected a rotation of 0 or 90 degrees"),
        (lambda: fm.model("lambert+ggx", kd=K, ks=K), "kd and ks are coloured and up to 0.8 and 0.8, expected a sum"),
        (lambda: fm.model("ggx", ks=3.0 * K), r"ks is coloured and up to 2\.4, expected at most 1 in Mitsuba"),
        (lambda: fm.model("lambert", channels=4), "there are 4 channels, expected 1 or 3"),
        (lambda: fm.model("varnish-over-lambert"), "no plugin for varnish-over-lambert"),
    ],
)
def test_what_mitsuba_cannot_hold_is_refused(build: Callable[[], AbstractBRDF], sentence: str) -> None:
    with pytest.raises(ModelError, match=sentence):
        target.translated(build())


@pytest.mark.study
def test_what_mitsuba_shows_is_fitted_back(mitsuba: ModuleType) -> None:
    """Its values on a goniometer's angles, with 1 % noise: every parameter within two standard deviations."""
    truth: dict[str, Any] = {"kd": 0.3, "alpha": 0.2, "eta": 1.6}
    plugin = target.translated(fm.model("lambert+walter-ggx", **truth))
    theta_i, theta_o = (a.ravel() for a in np.meshgrid(np.deg2rad([10, 30, 50, 70]), np.deg2rad(np.arange(-80, 81, 4))))
    wi = from_angles(theta_i, 0.0 * theta_i).astype(np.float32)
    wo = from_angles(np.abs(theta_o), np.where(theta_o > 0.0, np.pi, 0.0)).astype(np.float32)
    value = target.run(plugin, wi, wo)[0][1][:, 0]
    sigma = 0.01 * value
    noisy = value + sigma * np.random.default_rng(3).standard_normal(len(value))
    fit = fm.fit(fm.from_arrays(theta_i, theta_o, noisy, sigma=sigma), "lambert+walter-ggx", fixed={"ks": 1.0})
    sd = np.sqrt(np.diagonal(fit.covariance))
    found = {e.name: (fit.values[e.place.start], sd[e.place.start]) for e in fit.entries if e.name != "ks"}
    assert found.keys() == truth.keys()
    for name, (best, error) in found.items():
        assert abs(best - truth[name]) < 2.0 * error < 0.05 * truth[name], (name, best, error)
