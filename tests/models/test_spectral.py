"""Fresnel over the spectrum against colour-science, published colours of metals, and a fit to what RGB sees."""

import importlib
import warnings

import numpy as np
import pytest

import fitmat as fm
from fitmat.colour import observers
from fitmat.colour.spaces import FROM_SRGB, linear
from fitmat.errors import ModelError, ReadAs
from fitmat.models import in_rgb, spectral
from fitmat.models.refractive_index import index
from fitmat.models.terms.fresnel import conductor, schlick

RGB = ("r", "g", "b")

OBSERVER = "CIE 1931 2 Degree Standard Observer"

PRINTED = 6e-4
"""The tables have three digits."""

PHYSICALLY_BASED = {
    "main/Al/Cheng": ((0.916, 0.923, 0.924), (0.910, 0.936, 0.959)),
    "main/Be/Rakic-BB": ((0.539, 0.533, 0.534), (0.731, 0.738, 0.755)),
    "brass": ((0.910, 0.778, 0.423), (0.952, 0.979, 1.021)),
    "main/Cr/Sytchkova": ((0.654, 0.685, 0.701), (0.688, 0.728, 0.798)),
    "main/Co/Werner-DFT": ((0.699, 0.704, 0.671), (0.727, 0.772, 0.823)),
    "Cu": ((0.932, 0.623, 0.522), (0.982, 0.947, 0.945)),
    "Ge": ((0.500, 0.517, 0.465), (0.620, 0.653, 0.701)),
    "main/Au/Babar": ((1.059, 0.773, 0.307), (0.971, 1.018, 0.994)),
    "Fe": ((0.530, 0.513, 0.494), (0.765, 0.767, 0.802)),
    "main/Li/Rasigni": ((0.916, 0.890, 0.807), (0.985, 0.998, 1.027)),
    "main/Mg/Hagemann": ((0.956, 0.953, 0.950), (0.954, 0.964, 0.977)),
    "main/Mn/Querry": ((0.606, 0.592, 0.573), (0.796, 0.834, 0.889)),
    "Ni": ((0.697, 0.641, 0.563), (0.815, 0.834, 0.871)),
    "Si": ((0.345, 0.369, 0.426), (0.720, 0.701, 0.663)),
    "main/Ag/Babar": ((0.991, 0.985, 0.974), (0.994, 0.995, 0.998)),
    "steel": ((0.669, 0.639, 0.598), (0.789, 0.823, 0.870)),
    "main/Ti/Palm": ((0.441, 0.400, 0.361), (0.865, 0.906, 0.946)),
    "main/W/Werner-DFT": ((0.537, 0.536, 0.519), (0.695, 0.704, 0.714)),
    "main/Zn/Werner-DFT": ((0.808, 0.844, 0.865), (0.762, 0.833, 0.896)),
}
"""Material → F0 and F82 tint in linear sRGB, as the Physically Based Database (A. Palmqvist and contributors, CC0,
release of June 2025, materials.json) has them, computed there from the dataset that it names."""


@pytest.mark.parametrize("material", PHYSICALLY_BASED)
def test_colours_of_metals_are_those_that_others_published(material: str) -> None:
    f0, tint = PHYSICALLY_BASED[material]
    found = in_rgb.fresnel_in_rgb(material)
    np.testing.assert_allclose(found.f0, f0, atol=PRINTED)
    np.testing.assert_allclose(found.tint, tint, atol=PRINTED)


@pytest.mark.parametrize(("material", "printed"), [("Cr", (0.549, 0.556, 0.554)), ("brass", (0.910, 0.778, 0.423))])
def test_colours_of_metals_are_those_of_a_textbook(material: str, printed: tuple[float, ...]) -> None:
    """T. Akenine-Möller et al., Real-Time Rendering, 4th ed., table 9.2; the two metals of which data agree."""
    np.testing.assert_allclose(in_rgb.f0_in_rgb(material), printed, atol=1e-3)


@pytest.mark.parametrize("material", ["Au", "W", "N-BK7"])
@pytest.mark.parametrize("illuminant", ["D65", "A"])
def test_the_spectrum_is_integrated_as_colour_science_does(material: str, illuminant: str) -> None:
    """XYZ of exact Fresnel at 0, 60 and 80°; theirs ends at 400 and 700 nm, where it holds the ends: 1e-3."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        science = importlib.import_module("colour")
    cos = np.cos(np.deg2rad([0.0, 60.0, 80.0]))
    nm = np.arange(400.0, 701.0, 1.0)
    n = index(material, nm)
    theirs = []
    for c in cos:
        curve = conductor(c, np.real(n), np.imag(n))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            spectrum = science.SpectralDistribution(dict(zip(nm, curve, strict=True)))
            found = science.sd_to_XYZ(spectrum, science.MSDS_CMFS[OBSERVER], science.SDS_ILLUMINANTS[illuminant])
            theirs.append(found / 100)
    ours = spectral.reflectance(material, cos) @ observers.seen(illuminant)
    np.testing.assert_allclose(ours, theirs, rtol=1e-3)


def test_a_white_reflectance_is_one_in_every_channel() -> None:
    """At grazing incidence everything reflects all light."""
    for material in ("Au", "water"):
        np.testing.assert_allclose(spectral.seen_by(RGB, material, np.zeros(1)), 1.0, atol=1e-12)


def test_a_line_has_the_index_of_its_wavelength() -> None:
    found = spectral.channel_indices("Au", ("550", "r"))
    assert found[0] == index("Au", 550.0)
    cos = np.cos(np.deg2rad([0.0, 45.0]))
    n = index("Au", 550.0)
    np.testing.assert_allclose(
        spectral.seen_by(("550",), "Au", cos)[:, 0], conductor(cos, np.real(n), np.imag(n)), rtol=1e-12
    )


@pytest.mark.parametrize("material", ["Cu", "Al", "Cr", "N-BK7", "PMMA"])
def test_one_index_a_channel_follows_what_the_channel_sees(material: str) -> None:
    """To 3e-3 at every angle, where one index at the channel's centroid is off by up to 0.01 (copper)."""
    cos = np.cos(np.deg2rad(np.arange(0.0, 90.0)))
    n = spectral.channel_indices(material, RGB)
    np.testing.assert_allclose(
        conductor(cos[:, None], np.real(n), np.imag(n)), spectral.seen_by(RGB, material, cos), atol=3e-3
    )


def test_no_index_reflects_more_than_it_receives() -> None:
    """Red of gold is 1.038 of white: what comes closest is a mirror."""
    n = spectral.channel_indices("Au", RGB)
    assert spectral.seen_by(RGB, "Au", np.ones(1))[0, 0] > 1.03
    assert conductor(1.0, np.real(n), np.imag(n))[0] == pytest.approx(1.0, abs=1e-3)


def test_a_dataset_that_ends_in_the_visible_is_refused() -> None:
    with pytest.raises(
        ModelError, match=r"is known from 667 to 200000 nm, and \d+ % of what channel . responds to lies"
    ):
        spectral.indices("main/Al/Ordal")


@pytest.mark.study
@pytest.mark.parametrize("material", ["Cu", "brass"])
def test_a_metal_measured_in_rgb_is_fitted_with_its_own_colour(material: str) -> None:
    """A truth of 95 wavelengths, each with its own index, seen by linear sRGB, 0.2 % noise: ks = 1, alpha within 3 sd.

    With the index at one wavelength a channel ks comes out as the ratio of F0, 1.2 % off for copper's red.
    """
    nm = observers.wavelengths()[::5]
    rows = spectral.sensitivities()[:, ::5]
    rows = rows / rows.sum(axis=1, keepdims=True)
    n = spectral.indices(material)[::5]
    truth = fm.model("ggx-conductor", channels=len(nm), alpha=0.2, eta=np.real(n), kappa=np.imag(n))
    angles = np.meshgrid(np.deg2rad([10.0, 40.0, 65.0]), np.deg2rad(np.arange(-70.0, 71.0, 5.0)), indexing="ij")
    theta_i, theta_o = (angle.ravel() for angle in angles)
    wi, wo = fm.directions(theta_i, np.zeros_like(theta_i)), fm.directions(theta_o, np.full_like(theta_o, np.pi))
    exact = np.asarray(fm.evaluate(truth, wi, wo)) @ rows.T
    noisy = exact * (1.0 + 0.002 * np.random.default_rng(5).normal(size=exact.shape))
    table = {"theta_i": np.rad2deg(theta_i), "theta_o": np.rad2deg(theta_o)}
    values = {f"brdf_{name}": column for name, column in zip(RGB, noisy.T, strict=True)}
    sigma = {f"sigma_{name}": 0.002 * column for name, column in zip(RGB, exact.T, strict=True)}
    measured = fm.read(table | values | sigma)
    with pytest.warns(
        ReadAs, match=rf"--ior {material}: Fresnel in RGB by the exact .* looks like ΔE2000 = 0\.\d at most"
    ):
        found = fm.study(measured, "ggx", ior=material, sampling=False)
    fit = found.posteriors[0].fit
    for name, true in (("ks", 1.0), ("alpha", 0.2)):
        value = fit[name]
        assert np.all(np.abs(np.atleast_1d(value.value) - true) < 3.0 * np.atleast_1d(value.sd)), name


def test_what_rgb_cannot_hold_depends_on_the_way() -> None:
    """Gold under D65: 4.1 at one wavelength a channel, integrated by another program (colour-science, 1 nm)."""
    found = in_rgb.fresnel_in_rgb("Au")
    assert found.worst("wavelengths") == (pytest.approx(4.1, abs=0.05), 0.0)
    assert found.worst("belcour")[0] < 0.3
    for way in ("schlick", "belcour"):
        assert found.delta_e_2000[way][0] == pytest.approx(0.0, abs=2e-2)  # F0 is right by construction
    np.testing.assert_allclose(linear(found.xyz[:1]), found.f0[None], atol=2e-3)
    np.testing.assert_allclose(found.tint, found.f82 / schlick(1 / 7, found.f0))
    np.testing.assert_allclose(found.f0 @ FROM_SRGB.T, found.xyz[0], atol=1e-3)


def test_another_light_shows_that_rgb_is_not_spectral() -> None:
    """Under a lamp F0 itself is wrong in RGB: a renderer multiplies two triples."""
    assert in_rgb.fresnel_in_rgb("Au", "A").delta_e_2000["belcour"][0] > 5.0
    assert in_rgb.fresnel_in_rgb("Au", "E").delta_e_2000["belcour"][0] < 2.0


def test_what_is_unknown_is_refused() -> None:
    with pytest.raises(fm.FitmatError, match="illuminant is the text 'candle', expected 'D65' or"):
        fm.fresnel_in_rgb("Au", "candle")
    with pytest.raises(fm.FitmatError, match="material"):
        fm.fresnel_in_rgb(3)  # pyright: ignore[reportArgumentType]


def test_how_far_apart_datasets_are() -> None:
    known = in_rgb.published("Al")
    assert known.datasets >= 5
    assert known.furthest.startswith("main/Al/")
    assert 0.1 < known.delta_e_2000 < 1.0
