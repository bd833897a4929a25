"""Spaces of colour against the standards and colour-science."""

from types import ModuleType

import numpy as np
import pytest

from fitmat.colour import spaces
from fitmat.colour.channels import colouring
from fitmat.errors import FitmatError


def test_a_display_shows_nothing_brighter_than_white() -> None:
    weights = colouring(("r", "g", "b")).weights
    np.testing.assert_allclose(spaces.shown(5.0 * weights.sum(axis=0)), weights.sum(axis=0), atol=1e-9)
    np.testing.assert_allclose(spaces.shown(np.array([2.0, 0.5, -0.1]) @ weights), np.array([1, 0.5, 0]) @ weights)


def test_displays_are_those_of_colour_science(science: ModuleType) -> None:
    xyz = np.random.default_rng(3).uniform(0.0, 1.2, (2000, 3)) @ spaces.FROM_SRGB.T
    xyz[-3:] = [[0.0, 0.0, 0.0], [1.2, 1.2, 1.2], [1e-3, 1e-3, 1e-3]]
    matrix = science.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ
    np.testing.assert_array_equal(spaces.FROM_SRGB, matrix)
    linear = np.clip(xyz @ np.linalg.inv(matrix).T, 0.0, 1.0)
    assert (linear < 0.0031308).any()
    np.testing.assert_allclose(spaces.to_srgb(xyz), science.cctf_encoding(linear, function="sRGB"), atol=1e-12)


@pytest.mark.parametrize(("name", "theirs"), [("p3", "Display P3"), ("acescg", "ACEScg")])
def test_spaces_of_renderers_are_those_of_colour_science(science: ModuleType, name: str, theirs: str) -> None:
    """Adapted in Bradford's cones; matrices printed to four or five digits in the standards."""
    xyz = np.random.default_rng(4).uniform(0.0, 1.0, (200, 3))
    found = science.RGB_COLOURSPACES[theirs]
    white = science.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    expected = science.XYZ_to_RGB(xyz, found, white, "Bradford", apply_cctf_encoding=False)
    np.testing.assert_allclose(spaces.linear(xyz, name), expected, atol=2e-4)
    np.testing.assert_allclose(spaces.linear(colouring(("r", "g", "b")).weights.sum(axis=0), name), 1.0, atol=3e-4)


def test_adaptation_makes_one_white_the_other(science: ModuleType) -> None:
    one, other = np.array([1.0985, 1.0, 0.3558]), np.array([0.9505, 1.0, 1.0888])
    expected = science.adaptation.matrix_chromatic_adaptation_VonKries(one, other, "Bradford")
    np.testing.assert_allclose(spaces.adaptation(one, other), expected, atol=1e-12)
    np.testing.assert_allclose(spaces.adaptation(one, other) @ one, other, rtol=1e-14)


def test_lightness_chroma_and_hue_are_those_that_ottosson_printed() -> None:
    """The table of his page: XYZ (0.950, 1, 1.089), X, Y and Z alone → L, a, b to three digits."""
    found = spaces.oklch(np.array([[0.950, 1.0, 1.089], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    hue = np.deg2rad(found[:, 2])
    lab = np.stack([found[:, 0], found[:, 1] * np.cos(hue), found[:, 1] * np.sin(hue)], axis=1)
    printed = [[1.0, 0.0, 0.0], [0.450, 1.236, -0.019], [0.922, -0.671, 0.263], [0.153, -1.415, -0.449]]
    np.testing.assert_allclose(lab, printed, atol=6e-4)


def test_a_space_that_is_not_known_is_refused() -> None:
    with pytest.raises(FitmatError, match="space is the text 'adobe', expected 'srgb' or 'p3' or"):
        spaces.linear(np.ones(3), "adobe")
