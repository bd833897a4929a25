"""Every lobe is fitted to measurements simulated from itself, and the truth is recovered."""

from typing import Any

import jax
import numpy as np
import pytest
from selection import always

import fitmat as fm
from fitmat.fitting.result import Fit
from fitmat.models.laws import examples
from fitmat.models.registry import LOBES

SIGMAS = 3.5
"""Standard deviations that a seeded estimate may be off: 1 in 2,000 for each of some 150 parameters and fixed seeds."""

FRESNEL: dict[str, dict[str, Any]] = {
    "": {"eta": 1.6},
    "-schlick": {"f0": 0.1},
    "-f82": {"f0": 0.7, "f82": 0.75},
    "-conductor": {"eta": 0.5, "kappa": 2.5},
    "-belcour": {"eta": 0.5, "kappa": 2.5},
}
BARE: dict[str, Any] = {"ks": 1.0}
BRUSHED: dict[str, Any] = {"alpha_x": 0.15, "alpha_y": 0.4, "rotation": 25.0}
PLAIN_DISNEY: dict[str, Any] = {
    "metallic": 0.0,
    "specular_tint": 0.0,
    "anisotropic": 0.0,
    "rotation": 0.0,
    "sheen_tint": 0.5,
    "clearcoat_gloss": 1.0,
}
Case = tuple[dict[str, Any], dict[str, Any]]


def _microfacet(lobe: str, shape: dict[str, Any], *ends: str) -> dict[str, Case]:
    return {lobe + end: (shape | FRESNEL[end], BARE) for end in ends}


CASES: dict[str, Case] = {
    "lambert": ({"kd": 0.4}, {}),
    "oren-nayar": ({"kd": 0.5, "sigma_n": 25.0}, {}),
    "oren-nayar-full": ({"kd": 0.5, "sigma_n": 25.0}, {}),
    "eon": ({"kd": 0.6, "r": 0.6}, {}),
    "phong": ({"ks": 0.3, "exponent": 20.0}, {}),
    "blinn-phong": ({"ks": 0.3, "exponent": 20.0}, {}),
    "blinn-phong-exact": ({"ks": 0.3, "exponent": 20.0}, {}),
    "ward": ({"ks": 0.3, "alpha": 0.2}, {}),
    "ward-gmd": ({"ks": 0.3, "alpha": 0.2}, {}),
    "ward-aniso": ({"ks": 0.3} | BRUSHED, {}),
    "ward-gmd-aniso": ({"ks": 0.3} | BRUSHED, {}),
    "ashikhmin-shirley": ({"kd": 0.4, "exponent": 30.0, "f0": 0.1}, {}),
    "ashikhmin-shirley-aniso": (
        {"kd": 0.4, "exponent_u": 100.0, "exponent_v": 15.0, "rotation": 25.0, "f0": 0.1},
        {},
    ),
    "abg": ({"a": 2e-3, "b": 0.02, "g": 1.8}, {}),
    **_microfacet("cook-torrance", {"alpha": 0.3}, *FRESNEL),
    "walter-ggx": ({"alpha": 0.3, "eta": 1.6}, BARE),
    "walter-beckmann": ({"alpha": 0.3, "eta": 1.6}, BARE),
    **_microfacet("ggx", {"alpha": 0.3}, *FRESNEL),
    **_microfacet("beckmann", {"alpha": 0.3}, *FRESNEL),
    **_microfacet("ggx-aniso", BRUSHED, ""),
    **_microfacet("beckmann-aniso", BRUSHED, ""),
    **_microfacet("ggx-kc", {"alpha": 0.5}, "", "-conductor"),
    **_microfacet("beckmann-kc", {"alpha": 0.5}, ""),
    **_microfacet("ggx-turquin", {"alpha": 0.5}, "", "-conductor"),
    "plastic": ({"alpha": 0.2, "eta": 1.5, "kd": 0.4}, BARE),
    "disney-2012": (
        {"base_color": 0.4, "subsurface": 0.0, "specular": 0.6, "roughness": 0.5, "sheen": 0.5, "clearcoat": 0.4}
        | PLAIN_DISNEY,
        {"subsurface": 0.0} | PLAIN_DISNEY,
    ),
    "disney-2015": (
        {"base_color": 0.4, "eta": 1.6, "roughness": 0.5, "sheen": 0.5, "clearcoat": 0.4} | PLAIN_DISNEY,
        PLAIN_DISNEY,
    ),
    "varnish": ({"kd": 0.6, "depth": 0.2, "eta": 1.5}, {"eta": 1.5, "kd": 0.6}),
    "rough-varnish": ({"kd": 0.6, "depth": 0.2, "eta": 1.5, "alpha": 0.15}, {"kd": 0.6}),
    "tilt": ({"kd": 0.4, "tilt_x": 1.0, "tilt_y": -2.0}, {}),
}
"""Lobe: true parameters, and those of them that a user of it would hold. All lobes, but that the Fresnel terms, which
are the same code in each, are gone through with isotropic roughness only."""


QUICK = ("lambert", "blinn-phong", "ggx", "ashikhmin-shirley-aniso")
"""Tried in every run: with and without a Fresnel term, isotropic and brushed."""


def measured(truth: Any, *, brushed: bool) -> fm.Measurements:
    """In the plane of incidence, or around the normal where the azimuth counts; 2 % noise."""
    azimuths: dict[str, Any] = (
        {"phi": np.deg2rad([180.0, 120.0]), "phi_i": np.deg2rad([0, 35.0, 80.0])} if brushed else {}
    )
    theta_i, theta_o = np.deg2rad([20.0, 45, 70]), np.deg2rad(np.arange(-80.0, 81, 20 if brushed else 10))
    return fm.simulate(truth, theta_i, theta_o, **azimuths, relative_noise=0.02, absolute_noise=1e-3, seed=1)


def twins(values: dict[str, Any]) -> list[dict[str, Any]]:
    """The same brushed surface in other words: axes exchanged and the tangent turned by 90°."""
    if "rotation" not in values:
        return [values]
    pairs = [("alpha_x", "alpha_y"), ("exponent_u", "exponent_v")]
    other = values | {b: values[a] for p in pairs for a, b in (p, p[::-1]) if a in values}
    turned = [base | {"rotation": values["rotation"] + k} for base, k in ((values, 0), (other, 90), (other, -90))]
    return [twin for twin in turned if abs(twin["rotation"]) <= 180.0]


def deviation(found: Fit, name: str, values: dict[str, Any]) -> float:
    """The largest |estimate − truth|/sd of the free parameters."""
    truth = fm.model(examples(name)[0], **values)
    sd = np.sqrt(np.diagonal(found.covariance))[found.free]
    gap = found.values - np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(truth)])
    return float(np.abs(gap[found.free] / sd).max())


def test_no_lobe_is_left_out() -> None:
    """But for combinations of roughness or compensation with a Fresnel term other than the first.

    Films, which need wavelengths, are found in `test_film.py`.
    """
    parts = ("-aniso", "-kc", "-turquin", "-film")
    combined = [n for n, lobe in LOBES.items() if lobe.fresnel_suffix(n) and any(part in n for part in parts)]
    assert set(LOBES) - set(CASES) <= set(combined)


@pytest.mark.parametrize("name", always(QUICK, CASES))
def test_the_truth_is_recovered(name: str) -> None:
    values, held = CASES[name]
    truth = fm.model(examples(name)[0], **values)
    found = fm.fit(measured(truth, brushed=not truth.isotropic), examples(name)[0], fixed=held)
    assert found.result == "converged"
    assert found.misfit_ratio < 0.5
    assert min(deviation(found, name, twin) for twin in twins(values)) < SIGMAS
    for entry in found.entries:
        fixed = entry.name in held
        assert (found.covariance[entry.place, entry.place] == 0.0).all() == fixed
        assert not fixed or found.values[entry.place] == held[entry.name]
